//! Short lists of things of one byte, such as the signs of a rule's atoms. Every module has some, so they take 16 bytes, and copying one
//! is copying these.

use std::hash::{Hash, Hasher};
use std::ops::{Deref, DerefMut};

/// So many stand in place.
const FEW: usize = 14;

/// A list of things of one byte each, mostly of no more than [`FEW`].
#[derive(Clone, Debug)]
pub struct Short<T>(Kept<T>);

#[derive(Clone, Debug)]
#[expect(
    clippy::box_collection,
    reason = "a box of a slice knows its length, which takes twice the room here"
)]
enum Kept<T> {
    Few { count: u8, things: [T; FEW] },
    Many(Box<Vec<T>>),
}

impl<T: Copy + Default> Short<T> {
    pub fn new() -> Short<T> {
        Short(Kept::Few { count: 0, things: [T::default(); FEW] })
    }

    pub fn push(&mut self, thing: T) {
        match &mut self.0 {
            Kept::Few { count, things } if usize::from(*count) < FEW => {
                things[usize::from(*count)] = thing;
                *count += 1;
            }
            Kept::Few { things, .. } => {
                let mut all = things.to_vec();
                all.push(thing);
                self.0 = Kept::Many(Box::new(all));
            }
            Kept::Many(things) => things.push(thing),
        }
    }

    pub fn clear(&mut self) {
        *self = Short::new();
    }
}

impl<T: Copy + Default> Default for Short<T> {
    fn default() -> Short<T> {
        Short::new()
    }
}

impl<T> Deref for Short<T> {
    type Target = [T];

    #[inline]
    fn deref(&self) -> &[T] {
        match &self.0 {
            Kept::Few { count, things } => &things[..usize::from(*count)],
            Kept::Many(things) => things,
        }
    }
}

impl<T> DerefMut for Short<T> {
    #[inline]
    fn deref_mut(&mut self) -> &mut [T] {
        match &mut self.0 {
            Kept::Few { count, things } => &mut things[..usize::from(*count)],
            Kept::Many(things) => things,
        }
    }
}

impl<T: Copy + Default> FromIterator<T> for Short<T> {
    #[inline]
    fn from_iter<I: IntoIterator<Item = T>>(things: I) -> Short<T> {
        let mut all = Short::new();
        things.into_iter().for_each(|thing| all.push(thing));
        all
    }
}

impl<T: Copy + Default> From<&[T]> for Short<T> {
    #[inline]
    fn from(things: &[T]) -> Short<T> {
        let count = things.len();
        if count > FEW {
            return Short(Kept::Many(Box::new(things.to_vec())));
        }
        let mut few = [T::default(); FEW];
        few[..count].copy_from_slice(things);
        Short(Kept::Few { count: count as u8, things: few })
    }
}

impl<'s, T> IntoIterator for &'s Short<T> {
    type Item = &'s T;
    type IntoIter = std::slice::Iter<'s, T>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}

impl<T: PartialEq> PartialEq for Short<T> {
    fn eq(&self, other: &Short<T>) -> bool {
        self[..] == other[..]
    }
}

impl<T: Hash> Hash for Short<T> {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self[..].hash(state);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_of_any_length_are_what_was_put_in() {
        assert_eq!(size_of::<Short<bool>>(), 16);
        for count in [0, 1, FEW - 1, FEW, FEW + 1, 3 * FEW] {
            let all: Vec<u8> = (0..count as u8).collect();
            let mut short: Short<u8> = all.iter().copied().collect();
            assert_eq!((&short[..], &short), (&all[..], &short.clone()));
            if let Some(last) = short.last_mut() {
                *last = 99;
                assert_ne!(short[..], all[..]);
            }
            short.clear();
            assert!(short.is_empty());
        }
    }
}
