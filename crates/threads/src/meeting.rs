//! Threads that work on one thing at the same time, and wait for one another between its parts.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Who waits asks so often in a row, which takes some microseconds, before it offers its processor to others.
const ASKED: usize = 100;

/// Where threads wait until all of them are there; then all go on. What one has written before, all others read after.
///
/// A wait is short (some thousandths of a millisecond) if all have a processor, so they ask again and again instead of sleeping: being woken takes
/// tens of microseconds.
pub struct Meeting {
    threads: usize,
    /// Those that are there, and the number of meetings so far.
    here: AtomicUsize,
    past: AtomicUsize,
    /// One of them will not come.
    is_broken: AtomicBool,
}

impl Meeting {
    fn of(threads: usize) -> Meeting {
        let (here, past, is_broken) = Default::default();
        Meeting { threads, here, past, is_broken }
    }

    /// Waits for all others.
    ///
    /// # Panics
    /// If one of them has panicked.
    pub fn wait(&self) {
        let before = self.past.load(Ordering::Acquire);
        if self.here.fetch_add(1, Ordering::AcqRel) + 1 == self.threads {
            self.here.store(0, Ordering::Relaxed);
            self.past.store(before.wrapping_add(1), Ordering::Release);
            return;
        }
        let mut asked = 0;
        while self.past.load(Ordering::Acquire) == before {
            assert!(!self.is_broken.load(Ordering::Relaxed), "another thread has panicked");
            match asked < ASKED {
                true => std::hint::spin_loop(),
                false => std::thread::yield_now(),
            }
            asked += 1;
        }
    }
}

/// Tells the others if a thread panics: they would wait for ever.
struct Watch<'m>(&'m Meeting);

impl Drop for Watch<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            self.0.is_broken.store(true, Ordering::Relaxed);
        }
    }
}

/// Does all jobs at the same time, each on a thread of its own, the first on that of the caller; they may wait for one another. All have to wait
/// equally often. The results are in the order of the jobs.
pub fn together<Job: Send, Done: Send>(
    jobs: Vec<Job>,
    work: impl Fn(Job, &Meeting) -> Done + Sync,
) -> Vec<Done> {
    let meeting = Meeting::of(jobs.len());
    let run = |job| {
        let _watch = Watch(&meeting);
        work(job, &meeting)
    };
    let mut jobs = jobs.into_iter();
    let Some(first) = jobs.next() else { return Vec::new() };
    std::thread::scope(|scope| {
        let others: Vec<_> = jobs.map(|job| scope.spawn(|| run(job))).collect();
        let first = run(first);
        let join = |other: std::thread::ScopedJoinHandle<Done>| {
            other.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        };
        std::iter::once(first).chain(others.into_iter().map(join)).collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// In each round each thread adds what the others wrote in the round before.
    #[test]
    fn all_have_come_before_one_goes_on() {
        for threads in 1..5 {
            let board: Vec<AtomicUsize> = (0..2 * threads).map(|_| AtomicUsize::new(1)).collect();
            let done = together((0..threads).collect(), |number: usize, meeting| {
                let mut sum = 1;
                for round in 0..50 {
                    let board = &board[threads * (round % 2)..][..threads];
                    board[number].store(sum, Ordering::Relaxed);
                    meeting.wait();
                    sum = board.iter().map(|x| x.load(Ordering::Relaxed)).fold(0, usize::wrapping_add);
                }
                sum
            });
            assert_eq!(done, vec![threads.wrapping_pow(50); threads], "{threads} threads");
        }
        assert_eq!(together(Vec::<u8>::new(), |job, _| job), []);
    }

    #[test]
    #[should_panic(expected = "panicked")]
    fn nobody_waits_for_one_that_panics() {
        together(vec![false, true, false], |panics, meeting| {
            assert!(!panics, "it panicked");
            meeting.wait();
        });
    }
}
