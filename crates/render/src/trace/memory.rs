//! Memory for rasters of cells, kept from frame to frame: the system takes longer to hand it out than it takes to fill.

use std::sync::{Mutex, PoisonError};

/// Rasters of more cells are not kept.
const MOST_CELLS: usize = 5_000_000;

/// Rasters that were used before, for any number of threads.
#[derive(Debug, Default)]
pub(crate) struct Memory(Mutex<Vec<Rasters>>);

/// The rasters of a picture.
#[derive(Debug, Default)]
pub(crate) struct Rasters {
    pub(super) numbers: Vec<[u32; 1]>,
    pub(super) depths: Vec<[f32; 1]>,
    pub(super) labels: Vec<u32>,
    pub(super) places: Vec<u32>,
    pub(super) strengths: Vec<f32>,
    pub(super) marks: [Vec<u32>; 3],
    pub(super) is_done: Vec<bool>,
}

impl Memory {
    /// Rasters with any content.
    pub(super) fn take(&self) -> Rasters {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).pop().unwrap_or_default()
    }

    /// Keeps rasters for the next picture.
    pub(super) fn keep(&self, rasters: Rasters) {
        if rasters.labels.len() <= MOST_CELLS {
            self.0.lock().unwrap_or_else(PoisonError::into_inner).push(rasters);
        }
    }
}

/// A raster of so many cells, all with this value, in place of another one.
pub(crate) fn filled<T: Clone>(kept: &mut Vec<T>, cells: usize, value: T) -> Vec<T> {
    let mut raster = std::mem::take(kept);
    // New memory is often empty without being filled.
    if raster.capacity() < cells {
        return vec![value; cells];
    }
    raster.clear();
    raster.resize(cells, value);
    raster
}
