//! Work that is shared by several threads, with results in order: they do not depend on the number of threads.
//!
//! Threads live for one call. A panic in one of them is a panic of the caller.

mod meeting;

pub use meeting::{Meeting, together};

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, OnceLock, PoisonError};

/// What `make` makes of each number below `count`, in the order of numbers, on so many threads; 0 counts as 1.
pub fn each<Made: Send + Sync>(
    threads: usize,
    count: usize,
    make: impl Fn(usize) -> Made + Sync,
) -> Vec<Made> {
    if threads <= 1 || count <= 1 {
        return (0..count).map(make).collect();
    }
    let made: Vec<OnceLock<Made>> = (0..count).map(|_| OnceLock::new()).collect();
    let next = AtomicUsize::new(0);
    let run = || {
        loop {
            let number = next.fetch_add(1, Ordering::Relaxed);
            let Some(place) = made.get(number) else { return };
            place.get_or_init(|| make(number));
        }
    };
    std::thread::scope(|scope| {
        (1..threads.min(count)).for_each(|_| drop(scope.spawn(run)));
        run();
    });
    made.into_iter().filter_map(OnceLock::into_inner).collect()
}

/// Does each job on one of so many threads; the results are in the order of the jobs. 0 threads count as 1.
pub fn in_order<Job: Send, Done: Send>(
    threads: usize,
    jobs: Vec<Job>,
    work: impl Fn(Job) -> Done + Sync,
) -> Vec<Done> {
    if threads <= 1 || jobs.len() <= 1 {
        return jobs.into_iter().map(work).collect();
    }
    let count = jobs.len();
    let queue = Mutex::new(jobs.into_iter().enumerate());
    let done = Mutex::new(Vec::with_capacity(count));
    let take = || queue.lock().unwrap_or_else(PoisonError::into_inner).next();
    let run = || {
        while let Some((number, job)) = take() {
            let result = work(job);
            done.lock().unwrap_or_else(PoisonError::into_inner).push((number, result));
        }
    };
    std::thread::scope(|scope| {
        (1..threads.min(count)).for_each(|_| drop(scope.spawn(run)));
        run();
    });
    let mut done = done.into_inner().unwrap_or_else(PoisonError::into_inner);
    done.sort_by_key(|(number, _)| *number);
    done.into_iter().map(|(_, result)| result).collect()
}

#[cfg(test)]
mod tests {
    use super::{each, in_order};

    #[test]
    fn results_come_in_order_from_any_number_of_threads() {
        let expected: Vec<usize> = (0..100).map(|n| n * n).collect();
        for threads in [0, 1, 2, 7, 200] {
            assert_eq!(each(threads, 100, |n| n * n), expected);
            assert_eq!(in_order(threads, (0..100).collect(), |n: usize| n * n), expected);
        }
        assert_eq!(each(3, 0, |n| n), []);
        assert_eq!(in_order(3, Vec::new(), |n: usize| n), []);
    }

    #[test]
    #[should_panic(expected = "scoped thread panicked")]
    fn a_panic_is_one_of_the_caller() {
        let caller = std::thread::current().id();
        // Both threads have a number before either goes on.
        let both = std::sync::Barrier::new(2);
        each(2, 2, |_| {
            both.wait();
            assert!(std::thread::current().id() == caller);
        });
    }
}
