//! Frames that are encoded on several threads, and written in order.

use std::collections::VecDeque;
use std::panic::resume_unwind;
use std::thread::JoinHandle;

/// Results in the order of their work, which is begun while earlier work is still going on.
pub(crate) struct Pipeline<T> {
    threads: usize,
    working: VecDeque<JoinHandle<T>>,
}

impl<T: Send + 'static> Pipeline<T> {
    pub(crate) fn new(threads: usize) -> Pipeline<T> {
        Pipeline { threads, working: VecDeque::new() }
    }

    /// Begins another piece of work; returns the result of the oldest if there are as many pieces as threads.
    pub(crate) fn push(&mut self, work: impl FnOnce() -> T + Send + 'static) -> Option<T> {
        if self.threads <= 1 {
            return Some(work());
        }
        let oldest = if self.working.len() < self.threads { None } else { self.pop() };
        self.working.push_back(std::thread::spawn(work));
        oldest
    }

    /// The next result; none when all have been taken.
    pub(crate) fn pop(&mut self) -> Option<T> {
        let oldest = self.working.pop_front()?;
        Some(oldest.join().unwrap_or_else(|panic| resume_unwind(panic)))
    }
}
