//! The triangles that a band of rows may show.

use std::ops::Range;

/// Triangles in the order of their numbers, and the runs of those of one surface.
#[derive(Default)]
pub(super) struct List {
    pub(super) numbers: Vec<u32>,
    runs: Vec<Run>,
}

/// Triangles of one surface, by their places in the list, and the depth of the nearest of their corners.
struct Run {
    surface: u32,
    nearest: f32,
    places: Range<usize>,
}

impl List {
    /// Adds a triangle, given its surface and the depth of its nearest corner.
    pub(super) fn push(&mut self, number: u32, surface: u32, nearest: f32) {
        let place = self.numbers.len();
        self.numbers.push(number);
        match self.runs.last_mut().filter(|run| run.surface == surface) {
            Some(run) => {
                run.nearest = run.nearest.max(nearest);
                run.places.end = place + 1;
            }
            None => self.runs.push(Run { surface, nearest, places: place..place + 1 }),
        }
    }

    /// The places of triangles in the list, those of a surface together, and surfaces that come nearer first: what is behind is then passed
    /// without looking at samples.
    pub(super) fn nearest_first(&self) -> impl Iterator<Item = usize> {
        let mut runs: Vec<&Run> = self.runs.iter().collect();
        runs.sort_by(|a, b| b.nearest.total_cmp(&a.nearest));
        runs.into_iter().flat_map(|run| run.places.clone())
    }
}
