//! Work that is shared by several threads, with results in order.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};

/// What `make` makes of each number below `count`, in the order of numbers. It does not depend on the number of threads.
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
        for _ in 1..threads.min(count) {
            scope.spawn(run);
        }
        run();
    });
    made.into_iter().filter_map(OnceLock::into_inner).collect()
}

#[cfg(test)]
mod tests {
    use super::each;

    #[test]
    fn results_come_in_order_from_any_number_of_threads() {
        let expected: Vec<usize> = (0..100).map(|n| n * n).collect();
        for threads in [0, 1, 2, 7, 200] {
            assert_eq!(each(threads, 100, |n| n * n), expected);
        }
        assert_eq!(each(3, 0, |n| n), []);
    }
}
