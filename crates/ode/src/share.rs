//! Work on many components that is shared by several threads: each has a range of its own, and what it computes of a component does not
//! depend on the range that holds it.

use std::ops::Range;

/// Calls `work` on consecutive parts of a list, one for each thread, with the number of the first element of each.
pub(crate) fn each_part<T: Send>(threads: usize, list: &mut [T], work: impl Fn(usize, &mut [T]) + Sync) {
    if threads <= 1 || list.len() <= 1 {
        return work(0, list);
    }
    let size = list.len().div_ceil(threads);
    std::thread::scope(|scope| {
        let mut parts = list.chunks_mut(size).enumerate();
        let own = parts.next();
        for (number, part) in parts {
            let work = &work;
            scope.spawn(move || work(number * size, part));
        }
        if let Some((_, part)) = own {
            work(0, part);
        }
    });
}

/// What `work` finds in consecutive ranges of the numbers below `count`, one for each thread, in their order.
pub(crate) fn each_range<T: Send>(
    threads: usize,
    count: usize,
    work: impl Fn(Range<usize>) -> T + Sync,
) -> Vec<T> {
    let size = count.div_ceil(threads.max(1)).max(1);
    let range = |number: usize| number * size..((number + 1) * size).min(count);
    let mut found: Vec<Option<T>> = (0..count.div_ceil(size)).map(|_| None).collect();
    each_part(threads, &mut found, |first, found| {
        for (number, found) in (first..).zip(found) {
            *found = Some(work(range(number)));
        }
    });
    found.into_iter().flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_element_is_worked_on_once() {
        for threads in [0, 1, 2, 3, 7, 200] {
            for count in [0, 1, 2, 50, 101] {
                let mut list: Vec<usize> = vec![0; count];
                each_part(threads, &mut list, |first, part| {
                    part.iter_mut().enumerate().for_each(|(i, x)| *x += first + i + 1);
                });
                assert!(list.iter().enumerate().all(|(i, x)| *x == i + 1), "{threads} {count}");
                let ranges = each_range(threads, count, |range| range);
                let all: Vec<usize> = ranges.into_iter().flatten().collect();
                assert_eq!(all, (0..count).collect::<Vec<_>>(), "{threads} {count}");
            }
        }
    }
}
