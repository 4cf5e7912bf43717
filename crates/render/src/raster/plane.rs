//! A triangle made ready to be drawn: its sides as functions of a place, and the plane of its depth.

use std::ops::Range;

use wide::{f32x4, f32x8};

use super::{Oriented, Place, STEPS, Side, range};

/// The depth of a triangle at the upper left corners of pixels: at one place, its growth to the right and down, and its bounds.
#[derive(Clone, Copy)]
pub(super) struct Plane {
    column: f32,
    row: f32,
    depth: f32,
    right: f32,
    down: f32,
    least: f32,
    greatest: f32,
}

impl Plane {
    /// Of a triangle that is not drawn.
    pub(super) const NONE: Plane =
        Plane { column: 0.0, row: 0.0, depth: 0.0, right: 0.0, down: 0.0, least: 0.0, greatest: 0.0 };

    #[inline(always)]
    pub(super) fn at(&self, [column, row]: [usize; 2]) -> f32 {
        let [right, down] = [number(column) - self.column, number(row) - self.row];
        self.depth + self.right * right + self.down * down
    }

    /// That of eight pixels of a row, from one on.
    #[inline(always)]
    pub(super) fn along_row(&self, [column, row]: [usize; 2]) -> f32x8 {
        let right =
            f32x8::splat(number(column) - self.column) + f32x8::new([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);
        let down = self.down * (number(row) - self.row);
        f32x8::splat(self.depth) + f32x8::splat(self.right) * right + f32x8::splat(down)
    }

    /// The depth of what is the nearest of it.
    #[inline(always)]
    pub(super) fn front(&self) -> f32 {
        self.greatest
    }

    /// The depth in the middle of a pixel, which is yet to be bounded, and its growth to the right.
    #[inline(always)]
    pub(super) fn along(&self, pixel: [usize; 2]) -> (f32, f32) {
        (self.at(pixel) + 0.5 * (self.right + self.down), self.right)
    }

    /// The least and the greatest that a sample adds, or less and more.
    #[inline(always)]
    pub(super) fn reach(&self) -> [f32; 2] {
        let range = |slope: f32| if slope < 0.0 { [slope, 0.0] } else { [0.0, slope] };
        let ([a, b], [c, d]) = (range(self.right), range(self.down));
        [a + c, b + d]
    }

    /// The depths at four samples, given that at the corner of their pixel.
    #[inline(always)]
    pub(super) fn samples(&self, base: f32, [x, y]: [f32x4; 2]) -> f32x4 {
        const STEP: f32x4 = f32x4::splat(1.0 / STEPS as f32);
        let [right, down] = [self.right, self.down].map(f32x4::splat);
        self.bounded_four(f32x4::splat(base) + right * (x * STEP) + down * (y * STEP))
    }

    /// The depth at a sample, given that at the corner of its pixel; the sample's place is in steps.
    #[inline(always)]
    pub(super) fn sample(&self, base: f32, [x, y]: [f32; 2]) -> f32 {
        const STEP: f32 = 1.0 / STEPS as f32;
        self.bounded(base + self.right * (x * STEP) + self.down * (y * STEP))
    }

    #[inline(always)]
    pub(super) fn bounded_four(&self, depth: f32x4) -> f32x4 {
        depth.fast_max(f32x4::splat(self.least)).fast_min(f32x4::splat(self.greatest))
    }

    #[inline(always)]
    pub(super) fn bounded_all(&self, depth: f32x8) -> f32x8 {
        depth.fast_max(f32x8::splat(self.least)).fast_min(f32x8::splat(self.greatest))
    }

    #[inline(always)]
    pub(super) fn bounded(&self, depth: f32) -> f32 {
        let depth = if depth > self.least { depth } else { self.least };
        if depth < self.greatest { depth } else { self.greatest }
    }
}

/// A column or row as a number: from 32 bits with a sign that is one instruction.
#[inline(always)]
fn number(at: usize) -> f32 {
    at as i32 as f32
}

/// A triangle, ready to be drawn.
pub(super) struct Ready {
    pub(super) columns: [usize; 2],
    pub(super) rows: [usize; 2],
    /// For each side the value of its function at the upper left corner of the first pixel, and its growth by a step to the right and
    /// down. The function is not negative within.
    pub(super) sides: [[i64; 3]; 3],
    pub(super) plane: Plane,
}

impl Ready {
    /// `None` if no sample of these rows can be in it.
    #[inline(always)]
    pub(super) fn new(corners: [Place; 3], width: usize, band: &Range<usize>) -> Option<Ready> {
        let [p, q, r] = corners;
        let columns = range([p.x, q.x, r.x], width)?;
        let [first, last] = range([p.y, q.y, r.y], band.end)?;
        let rows = [first.max(band.start), last];
        if rows[0] > rows[1] {
            return None;
        }
        let Oriented { at, depths, area } = Oriented::new(corners)?;
        let (x, y) = (columns[0] as i64 * STEPS, rows[0] as i64 * STEPS);
        // Places on a side belong to one of the two triangles that meet there.
        let side = |from: [i64; 2], to: [i64; 2]| {
            let Side { a, b, bias } = Side::new(from, to);
            [a * (x - from[0]) + b * (y - from[1]) + bias, a, b]
        };
        let lines = [side(at[1], at[2]), side(at[2], at[0]), side(at[0], at[1])];
        let scale = STEPS as f64 / area;
        let [zp, zq, zr] = depths;
        let slope = |p: i64, q: i64, r: i64| (p as f64 * zp + q as f64 * zq + r as f64 * zr) * scale;
        let right = slope(lines[0][1], lines[1][1], lines[2][1]);
        let down = slope(lines[0][2], lines[1][2], lines[2][2]);
        let steps = STEPS as f64;
        let depth = zp + right * ((x - at[0][0]) as f64 / steps) + down * ((y - at[0][1]) as f64 / steps);
        let [least, greatest] = [zp.min(zq).min(zr), zp.max(zq).max(zr)];
        let plane = Plane {
            column: number(columns[0]),
            row: number(rows[0]),
            depth: depth as f32,
            right: right as f32,
            down: down as f32,
            least: least as f32,
            greatest: greatest as f32,
        };
        Some(Ready { columns, rows, sides: lines, plane })
    }
}
