//! Lists that are as long as there are modules: how they grow.

use std::collections::TryReserveError;

/// A list of so many elements grows by a part of them only: the room that is not needed yet would be a third of what is kept of a
/// million modules if every list became twice as long. Moving the elements costs less than making them, also four times.
const LONG: usize = 4096;
const PART: usize = 4;

/// The number of elements for which a list of so many makes room when one more does not fit in.
#[inline]
pub fn step(len: usize) -> usize {
    if len < LONG { len.max(PART) } else { len / PART }
}

/// Makes room for so many elements more.
#[inline]
pub fn reserve<T>(list: &mut Vec<T>, more: usize) {
    if list.capacity() - list.len() < more {
        grow(list, more);
    }
}

#[cold]
fn grow<T>(list: &mut Vec<T>, more: usize) {
    list.reserve_exact(more.max(step(list.len())));
}

/// The same where there may not be so much memory.
///
/// # Errors
///
/// There is not.
pub fn try_reserve<T>(list: &mut Vec<T>, more: usize) -> Result<(), TryReserveError> {
    match list.capacity() - list.len() < more {
        true => list.try_reserve_exact(more.max(step(list.len()))),
        false => Ok(()),
    }
}

/// Adds an element.
#[inline]
pub fn push<T>(list: &mut Vec<T>, element: T) {
    reserve(list, 1);
    list.push(element);
}

/// Makes a list at least so long with elements that are made for that.
#[inline]
pub fn lengthen<T>(list: &mut Vec<T>, len: usize, make: impl FnMut() -> T) {
    if list.len() < len {
        fill(list, len, make);
    }
}

/// Makes a list so long that it has an element at a place, and as long as there is room for: the lists by slots, in which modules are put one
/// by one.
#[inline]
pub fn cover<T>(list: &mut Vec<T>, place: usize, make: impl FnMut() -> T) {
    if list.len() <= place {
        reserve(list, place + 1 - list.len());
        fill(list, list.capacity(), make);
    }
}

/// Apart, so that the question before it stands in the place of the call: most lists are long enough.
#[cold]
#[inline(never)]
fn fill<T>(list: &mut Vec<T>, len: usize, make: impl FnMut() -> T) {
    reserve(list, len - list.len());
    list.resize_with(len, make);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_lists_have_no_more_room_than_a_part_of_them() {
        let mut list = Vec::new();
        for i in 0..100_000u32 {
            push(&mut list, i);
            assert!(
                list.capacity() <= list.len() + step(list.len()),
                "{} of {}",
                list.capacity(),
                list.len()
            );
        }
        assert!(list.iter().copied().eq(0..100_000));
        lengthen(&mut list, 100_001, || 7);
        lengthen(&mut list, 10, || 8);
        cover(&mut list, 10, || 8);
        assert_eq!((list.len(), list.last()), (100_001, Some(&7)));
        cover(&mut list, 100_001, || 9);
        assert!(
            list.len() > 100_001 && list.len() == list.capacity() && list[100_001..].iter().all(|n| *n == 9)
        );
    }
}
