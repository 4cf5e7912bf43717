//! Memory for rasters of cells, kept from frame to frame: the system takes longer to hand it out than it takes to fill. Rasters that are kept are empty, so
//! that only those cells are filled that something was in.

use std::sync::{Mutex, PoisonError};

use super::regions::NOTHING;
use super::spans::Spans;

/// Rasters of more cells are not kept.
const MOST_CELLS: usize = 5_000_000;
/// Marks begin anew at this number.
const MOST_MARKS: u32 = u32::MAX / 2;

/// Rasters that were used before, for any number of threads.
#[derive(Debug, Default)]
pub(crate) struct Memory(Mutex<Vec<Rasters>>);

/// The rasters of a picture.
#[derive(Debug, Default)]
pub(crate) struct Rasters {
    /// Empty between pictures.
    pub(super) numbers: Vec<[u32; 1]>,
    pub(super) depths: Vec<[f32; 1]>,
    pub(super) labels: Vec<u32>,
    pub(super) places: Vec<u32>,
    pub(super) strengths: Vec<f32>,
    pub(super) marks: Marks,
}

/// Marks on cells, which need not be taken away: those of something new have numbers that no mark has yet.
#[derive(Debug, Default)]
pub(crate) struct Marks {
    pub(super) on: [Vec<u32>; 3],
    last: u32,
    /// Of no cell anything between pictures.
    pub(super) first: Vec<u32>,
}

impl Marks {
    /// Room for marks on so many cells, and the last number that was used.
    pub(super) fn begin(&mut self, cells: usize) -> u32 {
        if self.last > MOST_MARKS {
            self.on.iter_mut().for_each(|on| on.fill(0));
            self.last = 0;
        }
        for on in self.on.iter_mut().filter(|on| on.len() < cells) {
            *on = vec![0; cells];
        }
        self.last
    }

    /// Remembers the last number.
    pub(super) fn end(&mut self, last: u32) {
        self.last = last;
    }
}

impl Memory {
    /// Rasters with nothing in them.
    pub(super) fn take(&self) -> Rasters {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).pop().unwrap_or_default()
    }

    /// Keeps rasters for the next picture. Triangles are in the first ones of these cells, and nothing is beyond the others.
    pub(super) fn keep(&self, mut rasters: Rasters, [seen, around]: [&Spans; 2]) {
        if rasters.labels.len() > MOST_CELLS {
            return;
        }
        seen.fill(&mut rasters.numbers, [0]);
        seen.fill(&mut rasters.depths, [f32::NEG_INFINITY]);
        around.fill(&mut rasters.labels, NOTHING);
        around.fill(&mut rasters.places, 0);
        around.fill(&mut rasters.strengths, 0.0);
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(rasters);
    }
}

/// A raster of so many cells, all with this value, which those of the kept one have. There is room for `most` cells.
pub(crate) fn empty<T: Clone>(kept: &mut Vec<T>, [cells, most]: [usize; 2], value: T) -> Vec<T> {
    let mut raster = std::mem::take(kept);
    if raster.capacity() < cells {
        let most = if most > MOST_CELLS { cells } else { most.max(cells) };
        // New memory is often empty without being filled.
        raster = vec![value.clone(); most];
    }
    raster.resize(cells, value);
    raster
}
