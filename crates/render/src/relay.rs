//! A file made in parts on several threads, and written in order.

use std::io::{self, Write};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Condvar, Mutex, PoisonError};

/// The part that is to be written next.
struct Turn<'w> {
    next: usize,
    out: &'w mut (dyn Write + Send),
    /// Until the first that failed.
    result: io::Result<()>,
    /// True if all threads can stop: writing failed, or a thread has panicked.
    over: bool,
}

/// Makes `count` parts of a file by `make`, each into a buffer that is empty, and writes them one after the other. Every
/// one of `threads` threads makes a part, waits for its turn, writes it and makes the next, so that buffers stay
/// few and in the cache, and making and writing overlap. The bytes do not depend on the number of threads.
///
/// # Errors
/// The first error of writing.
pub(super) fn write<Buffer: Default>(
    threads: usize,
    count: usize,
    make: impl Fn(usize, &mut Buffer) + Sync,
    bytes: impl Fn(&Buffer) -> &[u8] + Sync,
    out: &mut (dyn Write + Send),
) -> io::Result<()> {
    let threads = threads.min(count);
    if threads <= 1 {
        let mut buffer = Buffer::default();
        return (0..count).try_for_each(|part| {
            make(part, &mut buffer);
            out.write_all(bytes(&buffer))
        });
    }
    let parts = AtomicUsize::new(0);
    let turn = Mutex::new(Turn { next: 0, out, result: Ok(()), over: false });
    let passed = Condvar::new();
    let lock = || turn.lock().unwrap_or_else(PoisonError::into_inner);
    let run = || {
        // If this thread ends early, the others must not wait for it.
        let end = Ending(|| {
            lock().over = true;
            passed.notify_all();
        });
        let mut buffer = Buffer::default();
        loop {
            let part = parts.fetch_add(1, Ordering::Relaxed);
            if part >= count {
                break;
            }
            make(part, &mut buffer);
            let mut turn = lock();
            while turn.next != part && !turn.over {
                turn = passed.wait(turn).unwrap_or_else(PoisonError::into_inner);
            }
            if turn.over {
                break;
            }
            turn.next += 1;
            turn.result = turn.out.write_all(bytes(&buffer));
            turn.over = turn.result.is_err();
            drop(turn);
            passed.notify_all();
        }
        std::mem::forget(end);
    };
    std::thread::scope(|scope| {
        for _ in 1..threads {
            scope.spawn(run);
        }
        run();
    });
    turn.into_inner().unwrap_or_else(PoisonError::into_inner).result
}

/// Does something when it is dropped.
struct Ending<F: Fn()>(F);

impl<F: Fn()> Drop for Ending<F> {
    fn drop(&mut self) {
        (self.0)();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn count(part: usize, buffer: &mut Vec<u8>) {
        buffer.clear();
        buffer.extend(format!("{part} ").bytes());
    }

    #[test]
    fn parts_come_in_order_from_any_number_of_threads() {
        let expected: Vec<u8> = (0..1000).flat_map(|part| format!("{part} ").into_bytes()).collect();
        for threads in [0, 1, 2, 7] {
            let mut out = Vec::new();
            write(threads, 1000, count, |buffer| buffer, &mut out).expect("room");
            assert_eq!(out, expected);
        }
        let mut nothing = Vec::new();
        write(3, 0, count, |buffer| buffer, &mut nothing).expect("room");
        assert!(nothing.is_empty());
    }

    #[test]
    fn the_first_error_ends_it() {
        for threads in [1, 4] {
            let mut small = [0; 10];
            let error = write(threads, 1000, count, |buffer| buffer, &mut &mut small[..]).unwrap_err();
            assert_eq!((error.kind(), &small), (io::ErrorKind::WriteZero, b"0 1 2 3 4 "));
        }
    }

    #[test]
    #[should_panic(expected = "panicked")]
    fn a_bug_on_a_thread_ends_it_all() {
        let buggy = |part: usize, buffer: &mut Vec<u8>| {
            // On whichever thread.
            assert!(part != 5, "a scoped thread panicked");
            count(part, buffer);
        };
        let _ = write(3, 1000, buggy, |buffer| buffer, &mut Vec::new());
    }
}
