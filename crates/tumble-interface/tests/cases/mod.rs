//! Random cases, counted, with what each took of memory.
//!
//! `TUMBLE_FUZZ=20` tries twenty times as many, as `make validate` does; `--nocapture` shows the counts.

use proptest::strategy::Strategy;
use proptest::test_runner::{Config, TestRunner};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::io::Write;
use std::time::Instant;

/// Seconds that a case may take; measured: 0.1 on a busy machine.
const SLOWEST: f64 = 10.0;

/// The system's allocator, with the bytes that this thread has now and had at most.
struct Counting;

thread_local! {
    static NOW: Cell<isize> = const { Cell::new(0) };
    static MOST: Cell<isize> = const { Cell::new(0) };
}

fn count(bytes: isize) {
    // Gone while the thread ends.
    let _ = NOW.try_with(|now| {
        now.set(now.get() + bytes);
        let _ = MOST.try_with(|most| most.set(most.get().max(now.get())));
    });
}

// SAFETY: everything is left to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        count(-(layout.size() as isize));
        unsafe { System.dealloc(block, layout) }
    }

    unsafe fn realloc(&self, block: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count(size as isize - layout.size() as isize);
        unsafe { System.realloc(block, layout, size) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

/// The result of `task`, and the bytes that it took at most beyond those that were there.
pub fn weighed<T>(task: impl FnOnce() -> T) -> (T, usize) {
    let before = NOW.get();
    MOST.set(before);
    let result = task();
    (result, (MOST.get() - before).max(0) as usize)
}

/// Outcome of a case.
pub struct Outcome {
    /// Whether it was read, or else refused.
    pub read: bool,
    /// Bytes that it took at most.
    pub taken: usize,
    /// Bytes that it may be expected to take.
    pub expected: usize,
}

/// Adds a line to the file that is named by `TUMBLE_COUNTS`, if any; `python/tests/counts.py` makes a table of it.
fn note(kind: &str, cases: u32, read: u32, slowest: f64) {
    if let Some(path) = std::env::var_os("TUMBLE_COUNTS") {
        let mut file = std::fs::OpenOptions::new().create(true).append(true).open(path).unwrap();
        let line = format!(
            r#"{{"count": "random cases", "kind": "{kind}", "cases": {cases}, "refused": {}, "read": {read}, "slowest": "{slowest:.2} s"}}"#,
            cases - read
        );
        // In one piece: tests run at the same time.
        file.write_all(format!("{line}\n").as_bytes()).unwrap();
    }
}

/// Tries `cases` values, or `TUMBLE_FUZZ` times as many, and prints what became of them. None takes more than twice what was expected,
/// or longer than 10 s.
pub fn cases<S: Strategy>(kind: &str, cases: u32, values: S, case: impl Fn(S::Value) -> Outcome) {
    let factor: f64 = std::env::var("TUMBLE_FUZZ").ok().and_then(|text| text.parse().ok()).unwrap_or(1.0);
    let cases = ((f64::from(cases) * factor) as u32).max(1);
    let (read, most, slowest, begin) = (Cell::new(0), Cell::new(0.0_f64), Cell::new(0.0_f64), Instant::now());
    let mut runner = TestRunner::new(Config { cases, failure_persistence: None, ..Config::default() });
    let result = runner.run(&values, |value| {
        let start = Instant::now();
        let outcome = case(value);
        let took = start.elapsed().as_secs_f64();
        slowest.set(slowest.get().max(took));
        read.set(read.get() + u32::from(outcome.read));
        let share = outcome.taken as f64 / outcome.expected as f64;
        most.set(most.get().max(share));
        assert!(share <= 2.0, "{} bytes taken, {} expected", outcome.taken, outcome.expected);
        assert!(took < SLOWEST, "a case of {took:.1} s");
        Ok(())
    });
    let (read, most, slowest, seconds) = (read.get().min(cases), most.get(), slowest.get(), begin.elapsed().as_secs_f64());
    println!(
        "{kind}: {cases} cases, {} refused, {read} read, {seconds:.1} s, {slowest:.2} s at most, memory at most {most:.2} of the estimate",
        cases - read
    );
    if let Err(error) = result {
        panic!("{kind}: {error}");
    }
    note(kind, cases, read, slowest);
}
