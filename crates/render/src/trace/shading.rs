//! The strength of light in cells, triangle by triangle.
//!
//! Under the default lamp light depends on the normal and the depth alone. Where the corners of a triangle are turned about the same way, it is taken to change
//! evenly from one to the other, or as a quadratic function of the place that is right half-way between them, too; elsewhere, and in declared light, which casts shadows, it is that in the middle of each cell.

use crate::formats::png::{CornerLight, Lit};
use crate::raster::Corner;
use crate::raster::cells::weights;

/// The strength of light between three corners, as a function of a place in cells.
#[derive(Clone, Copy)]
pub struct Even {
    origin: [f32; 2],
    /// The weights of the second and of the third corner: what a cell to the right and one down add.
    weights: [[f32; 2]; 2],
    /// At the first corner, and by how much it is stronger at the others.
    strength: f32,
    more: [f32; 2],
    /// Four times by how much it is stronger half-way between two corners than their mean.
    bend: [f32; 3],
    /// The least and the greatest of all these places.
    range: [f32; 2],
}

impl Even {
    /// `None` if the triangle has no area.
    fn new([p, q, r]: [Corner; 3], CornerLight { at: [a, b, c], between }: CornerLight) -> Option<Even> {
        let ([x1, y1], [x2, y2]) = ([q.x - p.x, q.y - p.y], [r.x - p.x, r.y - p.y]);
        let by_area = 1.0 / (x1 * y2 - y1 * x2);
        let weights = [[y2, -x2], [-y1, x1]].map(|weight| weight.map(|by| (by * by_area) as f32));
        let is_fine = weights.iter().flatten().all(|weight| weight.is_finite());
        let all = [a, b, c].into_iter().chain(between.into_iter().flatten());
        let range = all.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)]);
        let bend = between.map_or([0.0; 3], |[ab, bc, ca]| {
            [4.0 * ab - 2.0 * (a + b), 4.0 * bc - 2.0 * (b + c), 4.0 * ca - 2.0 * (c + a)]
        });
        is_fine.then(|| Even {
            origin: [p.x - 0.5, p.y - 0.5].map(|at| at as f32),
            weights,
            strength: a as f32,
            more: [b - a, c - a].map(|more| more as f32),
            bend: bend.map(|bend| bend as f32),
            range: range.map(|bound| bound as f32),
        })
    }

    /// In the middle of a cell; no more and no less than on the triangle if that is beside it.
    pub fn at(&self, [column, row]: [usize; 2]) -> f32 {
        let [x, y] = [column as f32 - self.origin[0], row as f32 - self.origin[1]];
        let [v, w] = self.weights.map(|[right, down]| right * x + down * y);
        let u = 1.0 - v - w;
        let [ab, bc, ca] = self.bend;
        let strength =
            self.strength + self.more[0] * v + self.more[1] * w + ab * u * v + bc * v * w + ca * w * u;
        let [low, high] = self.range;
        let strength = if strength > low { strength } else { low };
        if strength < high { strength } else { high }
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
        match self.even(n) {
            Some(even) => even.at(cell).into(),
            None => self.uneven(n, cell),
        }
    }

    /// That on a triangle on which it does not change evenly.
    pub fn uneven(&self, n: usize, cell: [usize; 2]) -> f64 {
        self.lit.strength(n, weights(self.lit.corners(n), cell))
    }

    /// How light changes on a triangle if it does so evenly.
    pub fn even(&mut self, n: usize) -> Option<Even> {
        if let Known::Not = self.known[n] {
            let found = self.lit.at_corners(n, &mut self.by_normal);
            self.known[n] = match found.and_then(|light| Even::new(self.lit.corners(n), light)) {
                Some(even) => {
                    self.even.push(even);
                    Known::Even(self.even.len() as u32 - 1)
                }
                None => Known::Uneven,
            };
        }
        match self.known[n] {
            Known::Even(number) => self.even.get(number as usize).copied(),
            Known::Not | Known::Uneven => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_is_right_at_corners_and_half_way_between_them() {
        let corner = |x: f64, y: f64| Corner { x, y, depth: 0.0 };
        let corners = [corner(2.5, 1.5), corner(8.5, 3.5), corner(4.5, 9.5)];
        let light = |between| CornerLight { at: [0.5, 0.75, 1.0], between };
        let bent = Even::new(corners, light(Some([0.75, 0.9, 0.7]))).expect("an area");
        let expected =
            [([2, 1], 0.5), ([8, 3], 0.75), ([4, 9], 1.0), ([5, 2], 0.75), ([6, 6], 0.9), ([3, 5], 0.7)];
        for (cell, strength) in expected {
            assert!((bent.at(cell) - strength).abs() < 1e-6, "{cell:?}: {}", bent.at(cell));
        }
        // Beside it no more and no less than on it.
        for cell in [[0, 0], [9, 0], [0, 9], [12, 12], [100, 100]] {
            assert!((0.5..=1.0).contains(&bent.at(cell)), "{cell:?}: {}", bent.at(cell));
        }
        let plain = Even::new(corners, light(None)).expect("an area");
        assert!((plain.at([5, 2]) - 0.625).abs() < 1e-6);
        assert!(Even::new([corner(1.0, 1.0), corner(2.0, 2.0), corner(3.0, 3.0)], light(None)).is_none());
    }
}
