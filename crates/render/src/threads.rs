//! Values that several threads make side by side.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Makes so many values, on several threads; they do not depend on that.
pub(crate) fn side_by_side<T: Send + Sync>(
    count: usize,
    threads: usize,
    make: impl Fn(usize) -> T + Sync,
) -> Vec<T> {
    if threads <= 1 || count <= 1 {
        return (0..count).map(make).collect();
    }
    let made: Vec<OnceLock<T>> = (0..count).map(|_| OnceLock::new()).collect();
    let next = AtomicUsize::new(0);
    let work = || {
        loop {
            let number = next.fetch_add(1, Ordering::Relaxed);
            let Some(place) = made.get(number) else { return };
            place.get_or_init(|| make(number));
        }
    };
    std::thread::scope(|scope| {
        (1..threads.min(count)).for_each(|_| drop(scope.spawn(work)));
        work();
    });
    made.into_iter().filter_map(OnceLock::into_inner).collect()
}
