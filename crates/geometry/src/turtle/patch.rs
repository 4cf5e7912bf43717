//! Bézier patches that branching structures set (paper, figure 11; Hanan 1992): the turtle begins a patch,
//! makes its positions control points, in any order and from any branch, and has it drawn.

use std::collections::HashMap;

use super::ErrorKind;
use crate::scene::{Net, Point};

/// Most numbers of patches that one frame may use.
const MOST: usize = 1_000_000;

/// The patches that were begun, by number.
#[derive(Default)]
pub(super) struct OpenPatches(HashMap<i64, [Option<Point>; 16]>);

impl OpenPatches {
    /// Begins a patch; one of this number that was begun before is forgotten.
    pub(super) fn begin(&mut self, number: f64) -> Result<(), ErrorKind> {
        if self.0.len() >= MOST {
            return Err(ErrorKind::TooManyPatches);
        }
        self.0.insert(rounded(number), [None; 16]);
        Ok(())
    }

    /// Sets a control point.
    pub(super) fn set(&mut self, [number, row, column]: [f64; 3], point: Point) -> Result<(), ErrorKind> {
        // What was computed may be a rounding away from what was meant, but no more.
        let place = |x: f64| (x - x.round()).abs() < 1e-9 && (0.0..=3.0).contains(&x.round());
        if !place(row) || !place(column) {
            return Err(ErrorKind::NoControlPoint { row, column });
        }
        let patch = rounded(number);
        let Some(points) = self.0.get_mut(&patch) else {
            return Err(ErrorKind::PatchNotBegun { patch });
        };
        points[row.round() as usize * 4 + column.round() as usize] = Some(point);
        Ok(())
    }

    /// The control points of a patch. They stay, so that it can be drawn again.
    pub(super) fn net(&self, number: f64) -> Result<Net, ErrorKind> {
        let patch = rounded(number);
        let Some(points) = self.0.get(&patch) else {
            return Err(ErrorKind::PatchNotBegun { patch });
        };
        let missing: Vec<String> =
            (0..16).filter(|&i| points[i].is_none()).map(|i| format!("({}, {})", i / 4, i % 4)).collect();
        if !missing.is_empty() {
            let missing = missing.join(" ");
            return Err(ErrorKind::PatchIncomplete { patch, missing });
        }
        let point = |i: usize| points[i].unwrap_or_else(Point::origin);
        Ok([0, 4, 8, 12].map(|row| [0, 1, 2, 3].map(|column| point(row + column))))
    }
}

/// Numbers of patches are rounded, as numbers of colours are.
fn rounded(number: f64) -> i64 {
    number.round() as i64
}
