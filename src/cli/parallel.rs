//! Jobs on several threads, with results in order.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::{Mutex, PoisonError, mpsc};

/// Largest number of jobs in progress or waiting for each thread.
const AHEAD: usize = 2;

/// Makes jobs until there are no more, runs `work` on `threads` threads, and passes the results to `take` in the order of
/// the jobs. `make` and `take` run on this thread. Jobs and results do not depend on the number of threads.
///
/// # Errors
/// The first error of `take`, after which no more jobs are made.
pub fn in_order<Job: Send, Done: Send, Error>(
    threads: usize,
    mut make: impl FnMut() -> Option<Job>,
    work: impl Fn(Job) -> Done + Sync,
    mut take: impl FnMut(Done) -> Result<(), Error>,
) -> Result<(), Error> {
    if threads <= 1 {
        while let Some(job) = make() {
            take(work(job))?;
        }
        return Ok(());
    }
    let (jobs, queue) = mpsc::channel::<(usize, Job)>();
    let queue = Mutex::new(queue);
    std::thread::scope(|scope| {
        // Moved here, so that the channel closes at the end of this scope.
        let jobs = jobs;
        let (results, done) = mpsc::channel();
        // The threads end when `jobs` is dropped and the queue is empty.
        for _ in 0..threads {
            let (queue, results, work) = (&queue, results.clone(), &work);
            let next = move || queue.lock().unwrap_or_else(PoisonError::into_inner).recv();
            scope.spawn(move || {
                while let Ok((number, job)) = next() {
                    let result = catch_unwind(AssertUnwindSafe(|| work(job)));
                    if results.send((number, result)).is_err() {
                        return;
                    }
                }
            });
        }
        drop(results);
        let (mut made, mut taken, mut more) = (0, 0, true);
        let mut early = BTreeMap::new();
        loop {
            while more && made - taken < AHEAD * threads {
                match make() {
                    // Sending succeeds, because the threads outlive this loop.
                    Some(job) => more = jobs.send((made, job)).is_ok(),
                    None => more = false,
                }
                made += usize::from(more);
            }
            if taken == made {
                return Ok(());
            }
            let Ok((number, result)) = done.recv() else { return Ok(()) };
            early.insert(number, result);
            while let Some(result) = early.remove(&taken) {
                taken += 1;
                take(result.unwrap_or_else(|panic| resume_unwind(panic)))?;
            }
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_come_in_order_from_any_number_of_threads() {
        for threads in [1, 2, 7] {
            let mut numbers = 0..100_u64;
            let mut seen = Vec::new();
            let slow_at_first = |n: u64| {
                std::thread::sleep(std::time::Duration::from_micros(if n.is_multiple_of(7) {
                    500
                } else {
                    0
                }));
                n * n
            };
            let done: Result<(), ()> = in_order(
                threads,
                || numbers.next(),
                slow_at_first,
                |n| {
                    seen.push(n);
                    Ok(())
                },
            );
            assert_eq!(done, Ok(()));
            assert_eq!(seen, (0..100).map(|n| n * n).collect::<Vec<u64>>());
        }
    }

    #[test]
    fn the_first_error_in_order_ends_it_and_little_is_made_in_vain() {
        for threads in [1, 4] {
            let mut made = 0;
            let mut taken = 0;
            let done = in_order(
                threads,
                || {
                    made += 1;
                    Some(made)
                },
                |n| n,
                |n| {
                    taken += 1;
                    if n >= 10 { Err(n) } else { Ok(()) }
                },
            );
            assert_eq!((done, taken), (Err(10), 10));
            assert!(made <= 10 + AHEAD * threads, "{made}");
        }
    }

    #[test]
    #[should_panic(expected = "a bug")]
    fn a_bug_on_a_thread_is_one_here() {
        let mut numbers = 0..10;
        let _ = in_order(2, || numbers.next(), |n| assert!(n != 5, "a bug"), |()| Ok::<(), ()>(()));
    }
}
