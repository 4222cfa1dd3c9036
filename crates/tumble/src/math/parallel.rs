//! Parallel loops whose result does not depend on the number of threads: chunks of fixed size, partial sums
//! kept per chunk and added in chunk order.

use rayon::prelude::*;
use std::ops::Range;
use std::sync::{Mutex, PoisonError};

/// Rows per task. A chunk of positions and velocities (32 B a row in single precision) stays in a 2 MiB L2 cache
/// with its scratch; smaller ones cost scheduling, larger ones balance badly.
pub const CHUNK: usize = 4096;

/// Calls `f(0)`, ..., `f(n - 1)`, each once, on all threads. All parallel loops go through here, so that rayon's machinery is
/// compiled once.
pub fn each(n: usize, f: &(dyn Fn(usize) + Sync)) {
    if n <= 1 {
        (0..n).for_each(f);
    } else {
        (0..n).into_par_iter().with_max_len(1).for_each(f);
    }
}

/// What threads give to one another, each once. The functions of slots do not depend on what is done with their contents, so that they
/// are compiled once for all that is.
type Slot<T> = Mutex<Option<T>>;

fn filled<I: Iterator>(tasks: I) -> Vec<Slot<I::Item>> {
    let mut slots = Vec::new();
    for task in tasks {
        slots.push(Mutex::new(Some(task)));
    }
    slots
}

fn empty<T>(n: usize) -> Vec<Slot<T>> {
    let mut slots = Vec::new();
    slots.resize_with(n, || Mutex::new(None));
    slots
}

fn take<T>(slot: &Slot<T>) -> Option<T> {
    slot.lock().unwrap_or_else(PoisonError::into_inner).take()
}

fn put<T>(slot: &Slot<T>, content: T) {
    *slot.lock().unwrap_or_else(PoisonError::into_inner) = Some(content);
}

fn contents<T>(slots: Vec<Slot<T>>) -> Vec<T> {
    let mut all = Vec::with_capacity(slots.len());
    for slot in slots {
        all.extend(slot.into_inner().unwrap_or_else(PoisonError::into_inner));
    }
    all
}

/// `f(0)`, ..., `f(n - 1)`, in order.
pub fn map<R: Send>(n: usize, f: impl Fn(usize) -> R + Sync) -> Vec<R> {
    let results = empty(n);
    each(n, &|i| put(&results[i], f(i)));
    contents(results)
}

/// Tasks for all threads, coarse ones: each costs an entry of a list and a lock.
pub trait Tasks: Iterator<Item: Send> + Sized {
    /// Calls `f` for each.
    fn in_parallel(self, f: impl Fn(Self::Item) + Sync) {
        let tasks = filled(self);
        each(tasks.len(), &|i| {
            if let Some(task) = take(&tasks[i]) {
                f(task);
            }
        });
    }

    /// Results of `f` for each, in order.
    fn map_in_parallel<R: Send>(self, f: impl Fn(Self::Item) -> R + Sync) -> Vec<R> {
        let tasks = filled(self);
        let results = empty(tasks.len());
        each(tasks.len(), &|i| {
            if let Some(task) = take(&tasks[i]) {
                put(&results[i], f(task));
            }
        });
        contents(results)
    }
}

impl<I: Iterator<Item: Send>> Tasks for I {}

/// Calls `f(start, chunk)` for every chunk of `a`.
pub fn chunks<A: Send>(a: &mut [A], f: impl Fn(usize, &mut [A]) + Sync) {
    if a.len() <= CHUNK {
        return f(0, a);
    }
    a.chunks_mut(CHUNK).enumerate().in_parallel(|(i, a)| f(i * CHUNK, a));
}

/// Calls `f(start, chunk of a, chunk of b)`.
pub fn chunks2<A: Send, B: Send>(a: &mut [A], b: &mut [B], f: impl Fn(usize, &mut [A], &mut [B]) + Sync) {
    debug_assert_eq!(a.len(), b.len());
    if a.len() <= CHUNK {
        return f(0, a, b);
    }
    a.chunks_mut(CHUNK).zip(b.chunks_mut(CHUNK)).enumerate().in_parallel(|(i, (a, b))| f(i * CHUNK, a, b));
}

/// Calls `f(r, row)` for every row of `n` of `a`.
pub fn rows<A: Send>(a: &mut [A], n: usize, f: impl Fn(usize, &mut [A]) + Sync) {
    let task = (CHUNK / n).max(1);
    a.chunks_mut(task * n).enumerate().in_parallel(|(t, part)| {
        part.chunks_mut(n).enumerate().for_each(|(r, row)| f(t * task + r, row));
    });
}

/// Sum of `f(start, chunk)` over the chunks of `a`, added in order.
pub fn chunk_sum<A: Send>(a: &mut [A], f: impl Fn(usize, &mut [A]) -> f64 + Sync) -> f64 {
    a.chunks_mut(CHUNK).enumerate().map_in_parallel(|(c, a)| f(c * CHUNK, a)).iter().sum()
}

/// Sum of `f(range)` over the chunks of 0..n, added in order.
pub fn sum(n: usize, f: impl Fn(Range<usize>) -> f64 + Sync) -> f64 {
    fold(n, f).into_iter().sum()
}

/// Largest of `f(range)` over the chunks of 0..n; negative infinity for n = 0. A NaN wins.
pub fn max(n: usize, f: impl Fn(Range<usize>) -> f64 + Sync) -> f64 {
    fold(n, f).into_iter().fold(f64::NEG_INFINITY, |a, b| if a >= b || a.is_nan() { a } else { b })
}

/// Index in 0..n and value of the largest `f(i)`, the first if there are several; `None` if nothing is above negative infinity.
pub fn worst(n: usize, f: impl Fn(usize) -> f64 + Sync) -> Option<(usize, f64)> {
    let larger = |most: (usize, f64), one: (usize, f64)| if one.1 > most.1 { one } else { most };
    let none = (0, f64::NEG_INFINITY);
    let found = fold(n, |range| range.map(|i| (i, f(i))).fold(none, larger)).into_iter().fold(none, larger);
    (found.1 > f64::NEG_INFINITY).then_some(found)
}

/// `f(range)` of every chunk of 0..n, in order.
pub fn fold<T: Send>(n: usize, f: impl Fn(Range<usize>) -> T + Sync) -> Vec<T> {
    let range = |i: usize| i * CHUNK..((i + 1) * CHUNK).min(n);
    map(n.div_ceil(CHUNK), |i| f(range(i)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_do_not_depend_on_the_number_of_threads() {
        let n = 10 * CHUNK + 17;
        let f = |r: Range<usize>| r.map(|i| 1.0 / (i as f64 + 1.0)).sum();
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| sum(n, f))
        };
        assert_eq!(with(1).to_bits(), with(2).to_bits());
        assert_eq!(with(1).to_bits(), with(8).to_bits());
        assert!((with(1) - ((n as f64).ln() + 0.577_215_664_9)).abs() < 1e-4);
        assert_eq!(max(n, |r| r.end as f64), n as f64);
        assert!(max(n, |r| if r.start == 0 { f64::NAN } else { 1.0 }).is_nan());
    }
}
