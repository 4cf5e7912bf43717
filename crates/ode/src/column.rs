//! A column of numbers, one for each component, that begins at a line of the processor's cache: so the widest registers take whole lines.

use std::ops::{Deref, DerefMut};

/// The length of a line, in bytes.
const LINE: usize = 64;
/// The numbers in a line.
const IN_LINE: usize = LINE / size_of::<f64>();

/// Most components that are few: those of a module that is integrated alone, as a rule.
pub(crate) const FEW: usize = 4;

/// A column that grows has room for this part of its numbers more.
const SPARE: usize = 8;

/// Numbers that begin at a line.
#[derive(Debug, Default)]
pub(crate) struct Column {
    /// The numbers, with others before and after.
    room: Vec<f64>,
    /// The place of the first.
    first: usize,
    len: usize,
}

impl Column {
    /// Makes room for so many numbers; those that were there are kept, new ones are 0.
    pub fn resize(&mut self, len: usize) {
        if self.first + len > self.room.len() {
            // What has grown grows on, by a little with each step of a tissue.
            let more = if self.len > 0 { len / SPARE } else { 0 };
            let mut other = Column { len, ..Column::with_room(len + more) };
            let kept = self.len.min(len);
            other.room[other.first..][..kept].copy_from_slice(&self[..kept]);
            *self = other;
        }
        let from = self.len.min(len);
        self.len = len;
        self[from..].fill(0.0);
    }

    /// One number: fewer questions than an index of the slice asks.
    ///
    /// # Panics
    /// If the place is beyond those that there is room for.
    #[inline]
    pub fn at(&self, place: usize) -> f64 {
        self.room[self.first + place]
    }

    /// The first numbers: fewer questions than a part of the slice asks.
    ///
    /// # Panics
    /// If they are more than there is room for.
    #[inline]
    pub fn head(&self, count: usize) -> &[f64] {
        &self.room[self.first..][..count]
    }

    /// The same, to be changed.
    #[inline]
    pub fn head_mut(&mut self, count: usize) -> &mut [f64] {
        &mut self.room[self.first..][..count]
    }

    /// Room for so many zeros.
    fn with_room(len: usize) -> Column {
        let room = vec![0.0; len + IN_LINE - 1];
        // Where it cannot be told, any place will do: it costs time, no more.
        let first = room.as_ptr().align_offset(LINE).min(IN_LINE - 1);
        Column { room, first, len }
    }
}

/// The rates of all components at a stage, or of those of one thread.
pub(crate) trait Stage: Deref<Target = [f64]> {
    /// One number.
    fn at(&self, place: usize) -> f64;
}

impl Stage for Column {
    #[inline]
    fn at(&self, place: usize) -> f64 {
        Column::at(self, place)
    }
}

impl Stage for &mut [f64] {
    #[inline]
    fn at(&self, place: usize) -> f64 {
        self[place]
    }
}

/// The rates of few components at a stage; what is behind them means nothing.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Row(pub [f64; FEW]);

impl Deref for Row {
    type Target = [f64];

    #[inline(always)]
    fn deref(&self) -> &[f64] {
        &self.0
    }
}

impl Stage for Row {
    #[inline(always)]
    fn at(&self, place: usize) -> f64 {
        self.0[place]
    }
}

impl Clone for Column {
    fn clone(&self) -> Column {
        let mut copy = Column::with_room(self.len);
        copy.copy_from_slice(self);
        copy
    }
}

impl Deref for Column {
    type Target = [f64];

    #[inline]
    fn deref(&self) -> &[f64] {
        &self.room[self.first..self.first + self.len]
    }
}

impl DerefMut for Column {
    #[inline]
    fn deref_mut(&mut self) -> &mut [f64] {
        &mut self.room[self.first..self.first + self.len]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_stay_where_a_line_begins() {
        let mut column = Column::default();
        column.resize(3);
        column.copy_from_slice(&[1.0, 2.0, 3.0]);
        column.resize(100);
        assert_eq!((&column[..3], &column[3..]), (&[1.0, 2.0, 3.0][..], &[0.0; 97][..]));
        column.resize(2);
        column.resize(4);
        assert_eq!(column[..], [1.0, 2.0, 0.0, 0.0]);
        (100..400).for_each(|len| column.resize(len));
        assert_eq!((&column[..2], &column[2..]), (&[1.0, 2.0][..], &[0.0; 397][..]));
        let copy = column.clone();
        assert_eq!(copy[..], column[..]);
        for column in [column, copy] {
            assert_eq!(column.as_ptr().align_offset(LINE), 0);
        }
    }
}
