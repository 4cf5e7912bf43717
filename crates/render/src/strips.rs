//! Strips of a picture whose triangles are too many to be in memory at a time.
//!
//! A census counts the triangles of every part of the picture by the rows that they are in, and keeps none of them. It tells which strips have few
//! enough triangles, and which parts are in each of them, so that what is small in the picture is made twice and not once for every strip.

use std::ops::Range;

use super::raster::BAND;

/// Which rows the parts of a picture and their triangles are in.
pub(super) struct Census {
    /// Rows of the picture.
    height: usize,
    /// By band of rows: how many triangles begin in it, and how many end before it, one more of the latter.
    begin: Vec<usize>,
    ended: Vec<usize>,
    /// By part, in their order: the rows that it has triangles in; none if its end is not after its start.
    rows: Vec<Range<usize>>,
}

impl Census {
    /// Of a picture with so many rows; no parts are counted yet.
    pub(super) fn new(height: usize) -> Census {
        let bands = height.div_ceil(BAND);
        Census { height, begin: vec![0; bands], ended: vec![0; bands + 1], rows: Vec::new() }
    }

    /// Counts the next part, given the first and the last row of each of its triangles, all within the picture.
    pub(super) fn add_part(&mut self, triangles: impl Iterator<Item = [usize; 2]>) {
        let (mut start, mut end) = (self.height, 0);
        for [first, last] in triangles {
            self.begin[first / BAND] += 1;
            self.ended[last / BAND + 1] += 1;
            (start, end) = (start.min(first), end.max(last + 1));
        }
        self.rows.push(start..end);
    }

    /// The picture from the top in strips, as few as there can be with at most so many triangles in each; one band may have more.
    pub(super) fn strips(&self, most: usize) -> Vec<Range<usize>> {
        let mut strips = Vec::new();
        // Triangles in the bands from the start of the strip on: those that did not end above it, and those that have begun since.
        let (mut start, mut count, mut ended) = (0, 0, 0);
        for (band, begin) in self.begin.iter().enumerate() {
            ended += self.ended[band];
            if band > start && count + begin > most {
                strips.push(start..band);
                (start, count, ended) = (band, count - ended, 0);
            }
            count += begin;
        }
        strips.push(start..self.begin.len());
        strips.into_iter().map(|bands| bands.start * BAND..(bands.end * BAND).min(self.height)).collect()
    }

    /// The numbers of the parts that have triangles in these rows.
    pub(super) fn parts_in(&self, rows: &Range<usize>) -> impl Iterator<Item = usize> {
        let is_in = |part: &Range<usize>| part.start < rows.end && part.end > rows.start;
        self.rows.iter().enumerate().filter(move |(_, part)| is_in(part)).map(|(number, _)| number)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_have_few_triangles_and_the_parts_that_are_in_them() {
        let mut census = Census::new(10 * BAND - 5);
        let at = |first: usize, last: usize| [first * BAND + 3, last * BAND + 3];
        // Two triangles in each band, one in all, and many in one.
        census.add_part((0..10).flat_map(|band| [at(band, band); 2]));
        census.add_part([at(0, 9)].into_iter());
        census.add_part([at(6, 6); 50].into_iter());
        census.add_part([].into_iter());
        let bands = |strips: Vec<Range<usize>>| -> Vec<[usize; 2]> {
            strips.iter().map(|rows| [rows.start / BAND, rows.end.div_ceil(BAND)]).collect()
        };
        assert_eq!(bands(census.strips(1000)), [[0, 10]]);
        assert_eq!(bands(census.strips(7)), [[0, 3], [3, 6], [6, 7], [7, 10]]);
        assert_eq!(bands(census.strips(0)), (0..10).map(|band| [band, band + 1]).collect::<Vec<_>>());
        assert_eq!(census.strips(0)[9], 9 * BAND..10 * BAND - 5);
        assert_eq!(census.parts_in(&(0..BAND)).collect::<Vec<_>>(), [0, 1]);
        assert_eq!(census.parts_in(&(6 * BAND..7 * BAND)).collect::<Vec<_>>(), [0, 1, 2]);
        assert_eq!(bands(Census::new(0).strips(5)), [[0, 0]]);
    }
}
