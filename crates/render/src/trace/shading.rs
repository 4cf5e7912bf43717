//! The strength of light in cells, triangle by triangle.
//!
//! Under the default lamp light depends on the normal and the depth alone. Where the corners of a triangle are turned about the same way, it is taken to change
//! evenly from one to the other; elsewhere, and in declared light, which casts shadows, it is that in the middle of each cell.

use crate::formats::png::Lit;
use crate::raster::Corner;
use crate::raster::cells::weights;

/// The strength of light between three corners, as a function of a place in cells.
#[derive(Clone, Copy)]
struct Even {
    origin: [f64; 2],
    /// At the origin, and what a cell to the right and one down add.
    strength: f64,
    right: f64,
    down: f64,
    /// The least and the greatest of the corners.
    range: [f64; 2],
}

impl Even {
    /// `None` if the triangle has no area.
    fn new([p, q, r]: [Corner; 3], [a, b, c]: [f64; 3]) -> Option<Even> {
        let ([x1, y1], [x2, y2]) = ([q.x - p.x, q.y - p.y], [r.x - p.x, r.y - p.y]);
        let area = x1 * y2 - y1 * x2;
        let (right, down) = (((b - a) * y2 - (c - a) * y1) / area, ((c - a) * x1 - (b - a) * x2) / area);
        let is_fine = right.is_finite() && down.is_finite();
        let range = [a.min(b).min(c), a.max(b).max(c)];
        is_fine.then_some(Even { origin: [p.x, p.y], strength: a, right, down, range })
    }

    /// In the middle of a cell, or at a corner if that is outside.
    fn at(&self, [column, row]: [usize; 2]) -> f64 {
        let [x, y] = [column as f64 + 0.5 - self.origin[0], row as f64 + 0.5 - self.origin[1]];
        (self.strength + self.right * x + self.down * y).clamp(self.range[0], self.range[1])
    }
}

/// How light changes on a triangle.
#[derive(Clone, Copy)]
enum Known {
    Not,
    Even(u32),
    Uneven,
}

/// The light on triangles in cells.
pub struct Shading<'a> {
    lit: &'a Lit<'a>,
    /// By triangle.
    known: Vec<Known>,
    even: Vec<Even>,
    /// By normal, on both of its sides: the light on it; NaN if it was not asked for.
    by_normal: Vec<[f64; 2]>,
}

impl<'a> Shading<'a> {
    pub fn new(lit: &'a Lit<'a>) -> Shading<'a> {
        let [triangles, normals] = lit.counts();
        Shading {
            lit,
            known: vec![Known::Not; triangles],
            even: Vec::new(),
            by_normal: vec![[f64::NAN; 2]; normals],
        }
    }

    /// The strength of light on a triangle in a cell.
    pub fn strength(&mut self, n: usize, cell: [usize; 2]) -> f64 {
        if let Known::Not = self.known[n] {
            self.known[n] = match self.even(n) {
                Some(even) => {
                    self.even.push(even);
                    Known::Even(self.even.len() as u32 - 1)
                }
                None => Known::Uneven,
            };
        }
        match self.known[n] {
            Known::Even(number) => self.even[number as usize].at(cell),
            Known::Not | Known::Uneven => self.lit.strength(n, weights(self.lit.corners(n), cell)),
        }
    }

    fn even(&mut self, n: usize) -> Option<Even> {
        let strengths = self.lit.at_corners(n, &mut self.by_normal)?;
        Even::new(self.lit.corners(n), strengths)
    }
}
