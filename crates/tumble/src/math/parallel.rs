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

/// Tasks that threads may take. Like `take`, it does not depend on what is done with them, so that it is compiled once for all that is.
fn list<I: Iterator>(tasks: I) -> Vec<Mutex<Option<I::Item>>> {
    tasks.map(|task| Mutex::new(Some(task))).collect()
}

fn take<T>(task: &Mutex<Option<T>>) -> Option<T> {
    task.lock().unwrap_or_else(PoisonError::into_inner).take()
}

/// Tasks for all threads, coarse ones: each costs an entry of a list and a lock.
pub trait Tasks: Iterator<Item: Send> + Sized {
    /// Calls `f` for each.
    fn in_parallel(self, f: impl Fn(Self::Item) + Sync) {
        let tasks = list(self);
        each(tasks.len(), &|i| take(&tasks[i]).into_iter().for_each(&f));
    }

    /// Results of `f` for each, in order.
    fn map_in_parallel<R: Send>(self, f: impl Fn(Self::Item) -> R + Sync) -> Vec<R> {
        let mut results: Vec<Option<R>> = Vec::new();
        let tasks: Vec<_> = self.collect();
        results.resize_with(tasks.len(), || None);
        tasks.into_iter().zip(&mut results).in_parallel(|(task, result)| *result = Some(f(task)));
        results.into_iter().flatten().collect()
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
    (0..n.div_ceil(CHUNK)).map_in_parallel(|i| f(range(i)))
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
