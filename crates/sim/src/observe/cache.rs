//! The frame cache: which modules of the structure move, grouped so that a frame evaluates them together.

use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::world::life::same_bits;
use dlsys_expr::Lanes;
use dlsys_tree::{ModuleId, SimTime, Version};

/// The moving modules of the structure of some version.
#[derive(Debug, Default)]
pub struct FrameCache {
    /// Tells the simulations of a process apart; copies of one have the same number.
    pub source: u64,
    pub version: Option<Version>,
    /// Lazy modules, by label.
    pub columns: Vec<Column>,
    /// Modules with a state, and where their parameters begin in the string.
    pub others: Vec<(ModuleId, usize)>,
    pub registers: Vec<Lanes>,
    pub values: Vec<f64>,
}

/// The number of simulations that there have been.
static SOURCES: AtomicU64 = AtomicU64::new(0);

impl FrameCache {
    pub fn new() -> FrameCache {
        FrameCache { source: SOURCES.fetch_add(1, Ordering::Relaxed), ..FrameCache::default() }
    }
}

/// The cache of a copy is empty: it may be as large as all the rest.
impl Clone for FrameCache {
    fn clone(&self) -> FrameCache {
        FrameCache { source: self.source, ..FrameCache::default() }
    }
}

/// The moving lazy modules of a class.
#[derive(Clone, Debug, Default)]
pub struct Column {
    pub rows: Vec<Row>,
    /// Where the parameters of each stand in the string.
    pub places: Vec<u32>,
}

/// A lazy module with its twins: those after it in the string that were born at the same instant with the same values,
/// so that they are the same at all times.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    pub birth: SimTime,
    /// Where the parameters of one of them begin in the tree.
    pub from: u32,
    /// Where they end in the list of places; they begin where those of the row before end.
    pub end: u32,
}

impl Column {
    pub fn clear(&mut self) {
        self.rows.clear();
        self.places.clear();
    }

    pub fn add(&mut self, birth: SimTime, values: &[f64], own: Range<usize>, to: usize) {
        self.places.push(to as u32);
        let end = self.places.len() as u32;
        if let Some(last) = self.rows.last_mut()
            && last.birth == birth
            && same_bits(&values[last.from as usize..last.from as usize + own.len()], &values[own.clone()])
        {
            last.end = end;
            return;
        }
        self.rows.push(Row { birth, from: own.start as u32, end });
    }
}
