//! The law of slipping on a block of columns: fluxes along all edges, limited by what each column has, as integers.
//!
//! A square of four columns has a triangle at each of its corners, made of the two edges that meet there, with the differences of height e = (eₓ, e_z).
//! A triangle that is steeper than the slope of repose k moves τ(1 - k/|e|)e along its edges, downhill. Heights are integers in
//! `f64`s, which are exact, and fluxes are rounded to integers; rounding to the nearest is odd, so mirrored blocks have mirrored fluxes.

use std::ops::Range;

use crate::squares::{squares, varied_squares};

/// Added to and subtracted from a number of less than 2^51, this rounds it to an integer.
const ROUND: f64 = 6_755_399_441_055_744.0;
/// The bits of [`ROUND`] as an integer.
const ROUND_BITS: i64 = 0x4338_0000_0000_0000;

/// An integer of less than 2^51 as a float; as fast as an addition, unlike `as`.
#[inline(always)]
pub(crate) fn to_float(value: i64) -> f64 {
    f64::from_bits(value.wrapping_add(ROUND_BITS) as u64) - ROUND
}

/// A float of less than 2^51 that is an integer.
#[inline(always)]
pub(crate) fn to_integer(value: f64) -> i64 {
    ((value + ROUND).to_bits() as i64).wrapping_sub(ROUND_BITS)
}

/// The larger one, where neither is NaN.
#[inline(always)]
pub(crate) fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

#[inline(always)]
pub(crate) fn smaller(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

/// What the law needs of the material, in quanta.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Law {
    /// λδt/4Δ², less than 1/16.
    pub tau: f64,
    /// Slope of repose.
    pub slope: f64,
    /// Ratio of the slope to that of repose above which a triangle moves.
    pub rest: f64,
    /// Loose material up to this thickness counts as none.
    pub film: f64,
}

/// Loose material that no flux takes: fluxes are rounded, and four of them could take two quanta too much.
const SPARE: f64 = 4.0;

/// A block of columns with the two columns around it that its fluxes depend on.
#[derive(Debug)]
pub(crate) struct Block {
    /// Columns in a row.
    pub width: usize,
    /// Height of the surface.
    pub height: Vec<f64>,
    /// Thickness of loose material.
    pub loose: Vec<f64>,
    /// Slope of repose of each column.
    pub slope: Vec<f64>,
    /// Ratio to it above which the column lets triangles move.
    pub ratio: Vec<f64>,
    /// How much a column can take until it meets what is above it; infinite if that is nothing.
    pub room: Vec<f64>,
    /// Differences along x, from a column to the next, and along z.
    ex: Vec<f64>,
    ez: Vec<f64>,
    /// Weights, then fluxes against x and against z.
    fx: Vec<f64>,
    fz: Vec<f64>,
    /// Parts of their outflow that columns can give, and of their inflow that they can take.
    give: Vec<f64>,
    take: Vec<f64>,
    /// Weights of the squares of a row at their edges: along x at the lower and the higher z, along z at the lower and the higher x.
    edge: [Vec<f64>; 4],
}

/// Which properties of columns matter in a block.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Traits {
    /// Slopes or ratios differ.
    pub varied: bool,
    /// No slope of repose is less, in quanta.
    pub least: f64,
    /// Some columns are bare: the edges down from these are walls.
    pub bare: bool,
    /// Some columns have a ceiling.
    pub roofed: bool,
}

impl Block {
    pub fn new(width: usize) -> Block {
        let field = || vec![0.0; width * width];
        let row = || vec![0.0; width];
        Block {
            width,
            height: field(),
            loose: field(),
            slope: field(),
            ratio: field(),
            room: field(),
            ex: field(),
            ez: field(),
            fx: field(),
            fz: field(),
            give: field(),
            take: field(),
            edge: [row(), row(), row(), row()],
        }
    }

    /// Computes the fluxes of the columns in a box of rows and places in them, which is at least two columns away from the edge of the block.
    pub fn flow(&mut self, law: &Law, rows: &Range<usize>, places: &Range<usize>, traits: Traits) {
        // Columns that the fluxes depend on.
        let (rows, places) = (rows.start - 2..rows.end + 2, places.start - 2..places.end + 2);
        self.differences(law, &rows, &places, traits);
        if traits.varied {
            self.weights::<true>((law, traits.least), &rows, &places);
        } else {
            self.weights::<false>((law, law.slope), &rows, &places);
        }
        self.limits(&rows, &places, traits);
    }

    fn differences(&mut self, law: &Law, rows: &Range<usize>, places: &Range<usize>, traits: Traits) {
        let (w, n) = (self.width, places.len());
        for r in rows.clone() {
            let at = r * w + places.start;
            let row = &self.height[at..at + n];
            for ((e, low), high) in self.ex[at..at + n - 1].iter_mut().zip(row).zip(&row[1..]) {
                *e = high - low;
            }
            if r + 1 < rows.end {
                let next = &self.height[at + w..at + w + n];
                for ((e, low), high) in self.ez[at..at + n].iter_mut().zip(row).zip(next) {
                    *e = high - low;
                }
            }
            if traits.bare || traits.roofed {
                self.walls(law, at, n, r + 1 < rows.end, traits);
            }
        }
    }

    /// Edges down from bare columns and to full ones count as level.
    fn walls(&mut self, law: &Law, at: usize, n: usize, has_next: bool, traits: Traits) {
        let w = self.width;
        let Block { loose, room, ex, ez, .. } = self;
        let along_z = has_next.then_some((&mut ez[at..at + n], w));
        for (e, step) in [(&mut ex[at..at + n - 1], 1)].into_iter().chain(along_z) {
            let count = e.len();
            let [low, high] = [at, at + step].map(|from| from..from + count);
            if traits.bare {
                close(e, &loose[low.clone()], &loose[high.clone()], law.film);
            }
            if traits.roofed {
                close(e, &room[high], &room[low], law.film);
            }
        }
    }

    fn weights<const VARIED: bool>(
        &mut self,
        (law, least): (&Law, f64),
        rows: &Range<usize>,
        places: &Range<usize>,
    ) {
        let (w, n) = (self.width, places.len() - 1);
        let start = places.start;
        self.fx[rows.start * w..rows.end * w].fill(0.0);
        for r in rows.start..rows.end - 1 {
            let at = r * w + start;
            let [low, high, left, right] = &mut self.edge;
            let (low, high) = (&mut low[..n], &mut high[..n]);
            let (left, right) = (&mut left[..n], &mut right[..n]);
            let (b, t) = (&self.ex[at..at + n], &self.ex[at + w..at + w + n]);
            let (l, s) = (&self.ez[at..at + n], &self.ez[at + 1..at + 1 + n]);
            let steep = if VARIED {
                let slopes = [&self.slope[at..=at + n], &self.slope[at + w..=at + w + n]];
                let ratios = [&self.ratio[at..=at + n], &self.ratio[at + w..=at + w + n]];
                varied_squares((law, least), [b, t, l, s], slopes, ratios, [low, high, left, right])
            } else {
                squares(law, [b, t, l, s], [low, high, left, right])
            };
            let [low, high, left, right] = &self.edge;
            let fz = &mut self.fz[at..=at + n];
            if steep {
                for (flux, low) in self.fx[at..at + n].iter_mut().zip(&low[..n]) {
                    *flux += low;
                }
                self.fx[at + w..at + w + n].copy_from_slice(&high[..n]);
                fz[0] = left[0];
                fz[n] = right[n - 1];
                for ((flux, left), right) in fz[1..n].iter_mut().zip(&left[1..n]).zip(&right[..n - 1]) {
                    *flux = left + right;
                }
            } else {
                fz.fill(0.0);
            }
        }
    }

    /// Fluxes from weights, limited by what columns can give and take, as integers.
    fn limits(&mut self, rows: &Range<usize>, places: &Range<usize>, traits: Traits) {
        let (w, n) = (self.width, places.len());
        for r in rows.clone() {
            let at = r * w + places.start;
            for (flux, e) in self.fx[at..at + n - 1].iter_mut().zip(&self.ex[at..at + n - 1]) {
                *flux = (*flux * e + ROUND) - ROUND;
            }
            if r + 1 < rows.end {
                for (flux, e) in self.fz[at..at + n].iter_mut().zip(&self.ez[at..at + n]) {
                    *flux = (*flux * e + ROUND) - ROUND;
                }
            }
        }
        let inner = (rows.start + 1..rows.end - 1, places.start + 1..places.end - 1);
        let exceeds = |r: usize| {
            let short = self.exceeds(r, &inner.1, &self.loose, 1.0);
            short || traits.roofed && self.exceeds(r, &inner.1, &self.room, -1.0)
        };
        // Bits of rows in which a column would give more than it has, or take more than it can.
        let limited = inner.0.clone().fold(0_u64, |all, r| all | u64::from(exceeds(r)) << r);
        if limited == 0 {
            return;
        }
        for r in inner.0.clone() {
            if limited >> r & 1 != 0 {
                self.factors(r, &inner.1, traits);
            } else {
                let all = r * w + inner.1.start..r * w + inner.1.end;
                self.give[all.clone()].fill(1.0);
                self.take[all].fill(1.0);
            }
        }
        for r in inner.0.clone() {
            // The fluxes of a row depend on it and the next one.
            if limited >> r & 3 != 0 {
                self.scale(r, &inner.1, r + 1 < inner.0.end, traits);
            }
        }
    }

    /// What flows out of a column, from the fluxes to the next columns and from those before.
    #[inline(always)]
    fn outflow(east: f64, west: f64, north: f64, south: f64) -> f64 {
        (larger(-east, 0.0) + larger(west, 0.0)) + (larger(-north, 0.0) + larger(south, 0.0))
    }

    /// Whether a column of a row would give more than there is; or take, with the opposite sign.
    #[inline(always)]
    fn exceeds(&self, r: usize, places: &Range<usize>, most: &[f64], sign: f64) -> bool {
        let (at, w, n) = (r * self.width + places.start, self.width, places.len());
        let (east, west) = (&self.fx[at..at + n], &self.fx[at - 1..at - 1 + n]);
        let (north, south) = (&self.fz[at..at + n], &self.fz[at - w..at - w + n]);
        let most = &most[at..at + n];
        let mut short = 0;
        for c in 0..n {
            let out = Self::outflow(sign * east[c], sign * west[c], sign * north[c], sign * south[c]);
            short |= u64::from(out > larger(most[c] - SPARE, 0.0));
        }
        short != 0
    }

    /// The parts of their outflow that the columns of a row can give, and of their inflow that they can take.
    fn factors(&mut self, r: usize, places: &Range<usize>, traits: Traits) {
        let (at, w, n) = (r * self.width + places.start, self.width, places.len());
        let Block { loose, room, fx, fz, give, take, .. } = self;
        let (east, west) = (&fx[at..at + n], &fx[at - 1..at - 1 + n]);
        let (north, south) = (&fz[at..at + n], &fz[at - w..at - w + n]);
        let part = |has: f64, wanted: f64| {
            let has = larger(has - SPARE, 0.0);
            if wanted > has { has / larger(wanted, 1.0) } else { 1.0 }
        };
        let (loose, give) = (&loose[at..at + n], &mut give[at..at + n]);
        for c in 0..n {
            give[c] = part(loose[c], Self::outflow(east[c], west[c], north[c], south[c]));
        }
        if traits.roofed {
            let (room, take) = (&room[at..at + n], &mut take[at..at + n]);
            for c in 0..n {
                take[c] = part(room[c], Self::outflow(-east[c], -west[c], -north[c], -south[c]));
            }
        }
    }

    /// Scales the fluxes along x from the columns of a row, and those along z to the next row.
    fn scale(&mut self, r: usize, places: &Range<usize>, has_next: bool, traits: Traits) {
        let (at, w, n) = (r * self.width + places.start, self.width, places.len());
        let Block { fx, fz, give, take, .. } = self;
        let along_z = has_next.then_some((&mut *fz, n, w));
        for (fluxes, n, step) in [(&mut *fx, n - 1, 1)].into_iter().chain(along_z) {
            let fluxes = &mut fluxes[at..at + n];
            let (low, high) = (&give[at..at + n], &give[at + step..at + step + n]);
            for c in 0..n {
                fluxes[c] *= if fluxes[c] > 0.0 { high[c] } else { low[c] };
            }
            if traits.roofed {
                let (low, high) = (&take[at..at + n], &take[at + step..at + step + n]);
                for c in 0..n {
                    fluxes[c] *= if fluxes[c] > 0.0 { low[c] } else { high[c] };
                }
            }
            for flux in fluxes {
                *flux = (*flux + ROUND) - ROUND;
            }
        }
    }

    /// What flows through a column, along x and z, in quanta.
    pub fn stream(&self, row: usize, place: usize) -> [f64; 2] {
        let (w, at) = (self.width, row * self.width + place);
        [self.fx[at] + self.fx[at - 1], self.fz[at] + self.fz[at - w]].map(|against| -0.5 * against)
    }

    /// Adds the fluxes to the loose material of a row of columns, and returns the bits of those with a flux, from the first place on.
    pub fn apply(&self, row: usize, places: &Range<usize>, loose: &mut [i64]) -> u32 {
        let (w, n) = (self.width, places.len());
        let at = row * w + places.start;
        let (east, west) = (&self.fx[at..at + n], &self.fx[at - 1..at - 1 + n]);
        let (north, south) = (&self.fz[at..at + n], &self.fz[at - w..at - w + n]);
        let (old, loose) = (&self.loose[at..at + n], &mut loose[..n]);
        let mut moved = 0;
        for c in 0..n {
            let sum = (east[c] - west[c]) + (north[c] - south[c]);
            loose[c] = to_integer(old[c] + sum);
        }
        // Whether all columns have a flux, or none, is found fast.
        let stirred = |c: usize| {
            larger(larger(east[c], -east[c]), larger(west[c], -west[c]))
                + larger(larger(north[c], -north[c]), larger(south[c], -south[c]))
        };
        let (mut still, mut stirs) = (0, 0);
        for c in 0..n {
            let moves = stirred(c) > 0.0;
            still |= u64::from(!moves);
            stirs |= u64::from(moves);
        }
        match (still, stirs) {
            (_, 0) => 0,
            (0, _) => u32::MAX >> (32 - n),
            _ => {
                for c in 0..n {
                    moved |= u32::from(stirred(c) > 0.0) << c;
                }
                moved
            }
        }
    }
}

/// Sets differences from low to high to 0 where the value at the upper end, of those at both ends, is at most `least`. With the ends exchanged, it is that at the
/// lower end.
fn close(e: &mut [f64], low: &[f64], high: &[f64], least: f64) {
    for ((e, low), high) in e.iter_mut().zip(low).zip(high) {
        let upper = if *e > 0.0 { *high } else { *low };
        *e = if upper > least { *e } else { 0.0 };
    }
}
