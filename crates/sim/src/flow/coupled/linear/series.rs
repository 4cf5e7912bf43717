//! Uniformisation: the exponential of a matrix as a series without cancellation.
//!
//! `exp(τ A) = exp(-q τ) exp(τ (A + q))`. If q is at least as large as every decay, and no unknown is decreased by
//! another, `A + q` has no negative entry, and neither has any term of the series: the result is right to its own
//! digits, down to the truncation error, and never negative (A. Jensen, Scand. Actuar. J. 1953; W. Grassmann, Comput.
//! Oper. Res. 4 (1977) 47). Equations whose unknowns can be given signs so that they take this form (see [`Orthant`])
//! are as good. The spectrum does not matter: transport in one direction along a thousand cells is as easy as
//! diffusion. The cost is one product of the matrix and a vector for each mean time between two events of the fastest
//! unknown.
//!
//! Long times are cut into stretches on a grid that observation does not move. States at two grids, a coarse one and a
//! fine one, are kept, so that repeated evaluations do not begin at the start each time.

use super::{Problem, ROUNDING};
use dlsys_wide::Kernel;

/// Lengths of the stretches, in units of the mean time between two events of the fastest unknown.
const STRETCHES: [f64; 2] = [256.0, 64.0];
/// The truncation error of a stretch, as a part of the largest value.
const CUT: f64 = 1.0 / (1u64 << 56) as f64;
/// The truncation error of a stretch, as a part of the tolerance.
const CUT_OF_TOLERANCE: f64 = 1e-6;
/// Couplings with the same difference of column and row are stored as a band if they occur in at least one of this many
/// rows.
const DENSE: usize = 8;
/// The number of terms that are added up between two tests of the truncation error.
const STRIDE: usize = 3;
/// The number of rows that are worked on together, so that they stay in the first-level cache.
const TILE: usize = 512;

/// The signs that unknowns keep: no unknown is driven away from its sign by another one.
#[derive(Clone, Debug)]
pub struct Orthant {
    /// 1 or -1: the unknown has that sign, or is zero, at all times; 0: it may change. Empty: all are 1.
    signs: Vec<f64>,
    everywhere: bool,
}

impl Orthant {
    /// None if there are no such signs.
    pub fn new(problem: &Problem) -> Option<Orthant> {
        let Problem { entries, b, y, .. } = problem;
        let off = || entries.iter().filter(|e| e.0 != e.1 && e.2 != 0.0);
        if off().all(|e| e.2 > 0.0) && y.iter().chain(b).all(|x| *x >= 0.0) {
            return Some(Orthant { signs: Vec::new(), everywhere: true });
        }
        // By unknown: another one on the path to the root of its part, and its sign relative to that (union and find).
        let mut above: Vec<(u32, f64)> = (0..y.len() as u32).map(|i| (i, 1.0)).collect();
        for &(row, column, value) in off() {
            let ((i, of_row), (j, of_column)) = (root(&mut above, row), root(&mut above, column));
            let sign = of_row * of_column * value.signum();
            if i != j {
                above[i as usize] = (j, sign);
            } else if sign < 0.0 {
                return None;
            }
        }
        // The sign of the root of each part that follows from the values of the part: NaN if they do not agree.
        let mut parts = vec![0.0f64; y.len()];
        for i in 0..y.len() {
            let (part, sign) = root(&mut above, i as u32);
            for x in [y[i], b[i]].into_iter().filter(|x| *x != 0.0) {
                let says = sign * x.signum();
                let part = &mut parts[part as usize];
                *part = if *part == 0.0 || *part == says { says } else { f64::NAN };
            }
        }
        let sign = |i: u32| {
            let (part, sign) = root(&mut above, i);
            let known = parts[part as usize] * sign;
            if known.is_nan() { 0.0 } else { known }
        };
        let signs: Vec<f64> = (0..y.len() as u32).map(sign).collect();
        // A part that is zero stays zero.
        let everywhere = parts.iter().all(|part| !part.is_nan());
        Some(Orthant { signs, everywhere })
    }

    /// True if an unknown keeps its sign.
    pub fn holds(&self, i: usize) -> bool {
        self.everywhere || self.signs[i] != 0.0
    }

    /// True if all unknowns keep their signs.
    pub fn holds_everywhere(&self) -> bool {
        self.everywhere
    }

    /// True if no unknown can ever be negative.
    #[cfg(test)]
    pub fn is_positive(&self) -> bool {
        self.signs.iter().all(|sign| *sign > 0.0)
    }

    /// Sets values to zero that an error has led out of the orthant.
    pub fn confine(&self, y: &mut [f64]) {
        if self.signs.is_empty() {
            y.iter_mut().for_each(|y| *y = if *y < 0.0 { 0.0 } else { *y });
        }
        for (y, sign) in y.iter_mut().zip(&self.signs) {
            *y = if sign * *y < 0.0 { 0.0 } else { *y };
        }
    }
}

/// The root of an unknown's part, and the sign of the unknown relative to it.
fn root(above: &mut [(u32, f64)], i: u32) -> (u32, f64) {
    let (mut at, mut sign) = (i, 1.0);
    while above[at as usize].0 != at {
        let (next, s) = above[at as usize];
        // Path halving: later searches take half as long.
        let (second, t) = above[next as usize];
        if second != next {
            above[at as usize] = (second, s * t);
            (at, sign) = (second, sign * s * t);
        } else {
            (at, sign) = (next, sign * s);
        }
    }
    (at, sign)
}

/// The matrix `A + q`, made for products, and states on the grids.
#[derive(Clone, Debug)]
pub struct Series {
    diagonal: Vec<f64>,
    /// Couplings by column minus row.
    bands: Vec<(isize, Vec<f64>)>,
    others: Vec<(u32, u32, f64)>,
    /// The constant term; empty if it is zero.
    b: Vec<f64>,
    q: f64,
    /// The norm of `A + q` for the largest of all values, with the constant that stands for b as a further value.
    speed: f64,
    /// The size of that constant.
    constant: f64,
    /// An error grows no faster than this in the largest of all values, and in their sum.
    growth: [f64; 2],
    /// The number of roundings of a term.
    roundings: f64,
    /// The largest value at the start, and of b.
    sizes: [f64; 2],
    cut: f64,
    marks: Option<[Checkpoint; 2]>,
    memory: [Vec<f64>; 2],
}

/// A state on a grid, and the errors accumulated up to it.
#[derive(Clone, Debug, Default)]
struct Checkpoint {
    /// Stretches since the start, or since the coarser mark.
    count: f64,
    y: Vec<f64>,
    /// The truncation error so far: bounds for the largest of all values, and for their sum.
    cut: [f64; 2],
    /// The number of terms that were added up.
    terms: f64,
}

impl Series {
    /// The series of a problem whose couplings keep an orthant ([`Orthant::new`]).
    pub fn new(problem: &Problem) -> Series {
        let Problem { entries, b, y, tolerance } = problem;
        let n = y.len();
        let mut diagonal = vec![0.0; n];
        let (mut in_row, mut in_column) = (vec![0.0f64; n], vec![0.0f64; n]);
        let mut couplings = vec![0u32; n];
        let mut offsets: Vec<(isize, usize)> = Vec::new();
        let offset = |e: &(u32, u32, f64)| e.1 as isize - e.0 as isize;
        for e in entries {
            let (i, j) = (e.0 as usize, e.1 as usize);
            if i == j {
                diagonal[i] += e.2;
                continue;
            }
            couplings[i] += 1;
            in_row[i] += e.2.abs();
            in_column[j] += e.2.abs();
            match offsets.iter().position(|o| o.0 == offset(e)) {
                Some(known) => offsets[known].1 += 1,
                // A matrix with this many different offsets is not banded.
                None if offsets.len() < 32 => offsets.push((offset(e), 1)),
                None => {}
            }
        }
        let mut bands: Vec<(isize, Vec<f64>)> =
            offsets.iter().filter(|o| o.1 * DENSE > n).map(|o| (o.0, vec![0.0; n])).collect();
        let mut others = Vec::new();
        for e in entries.iter().filter(|e| e.0 != e.1) {
            match bands.iter_mut().find(|band| band.0 == offset(e)) {
                Some(band) => band.1[e.0 as usize] += e.2,
                None => others.push(*e),
            }
        }
        let most = |values: &mut dyn Iterator<Item = f64>| values.fold(0.0, f64::max);
        let growth =
            [&in_row, &in_column].map(|sums| most(&mut diagonal.iter().zip(sums).map(|(d, s)| d + s)));
        let q = most(&mut diagonal.iter().map(|d| -d));
        for d in &mut diagonal {
            *d += q;
        }
        let rows = || diagonal.iter().zip(&in_row).map(|(d, s)| d + s);
        let matrix = most(&mut rows());
        let largest = |values: &[f64]| values.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        let sizes = [largest(y), largest(b)];
        // The larger the constant, the smaller its share in one product; but the more terms follow from it.
        let scale = if matrix.max(q) > 0.0 { 0.25 * matrix.max(q) } else { 1.0 };
        let constant = sizes[1] / scale;
        let part = |b: &f64| if *b == 0.0 { 0.0 } else { b.abs() / constant };
        let speed = most(&mut rows().zip(b).map(|(r, b)| r + part(b))).max(q);
        let roundings = f64::from(couplings.into_iter().max().unwrap_or(0) + 5);
        let b = if sizes[1] == 0.0 { Vec::new() } else { b.clone() };
        let (marks, memory) = Default::default();
        let cut = CUT_OF_TOLERANCE * tolerance;
        Series {
            diagonal,
            bands,
            others,
            b,
            q,
            speed,
            constant,
            growth,
            roundings,
            sizes,
            cut,
            marks,
            memory,
        }
    }

    /// The series of the absolute values of all coefficients.
    pub fn majorant(&self) -> Series {
        let mut series = self.clone();
        series.marks = None;
        let all = series.bands.iter_mut().flat_map(|band| &mut band.1).chain(&mut series.b);
        all.chain(series.others.iter_mut().map(|other| &mut other.2)).for_each(|x| *x = x.abs());
        series
    }

    /// The approximate number of products of the matrix and a vector from the start to a time.
    pub fn products(&self, tau: f64) -> f64 {
        let stretch = |theta: f64| theta + 7.0 * theta.sqrt() + 12.0;
        let mut theta = tau * self.speed;
        let mut products = 0.0;
        for length in STRETCHES {
            let whole = (theta / length).floor();
            products += whole * stretch(length);
            theta -= whole * length;
        }
        products + stretch(theta)
    }

    /// A bound of all unknowns at a time, and of the sums of sizes that they are made of.
    pub fn largest(&self, tau: f64) -> f64 {
        (self.growth[0] * tau).exp() * (self.sizes[0] + tau * self.sizes[1])
    }

    /// The state some time after the start, which is `y`; a bound of the truncation error of every value; and a bound
    /// of the rounding error, relative to the sum of the sizes of all terms of the value.
    pub fn at(&mut self, y: &[f64], tau: f64) -> (Vec<f64>, f64, f64) {
        let [coarse, fine] = STRETCHES.map(|stretch| stretch / self.speed.max(f64::MIN_POSITIVE));
        let count = (tau / coarse).floor();
        let rest = (tau - count * coarse).max(0.0);
        let small = (rest / fine).floor();
        let rest = (rest - small * fine).max(0.0);
        let start = || Checkpoint { y: y.to_vec(), ..Checkpoint::default() };
        let [mut far, mut near] = self.marks.take().unwrap_or_else(|| [start(), start()]);
        if far.count != count || near.count > small {
            if far.count > count {
                far = start();
            }
            while far.count < count {
                self.advance(&mut far, coarse);
            }
            near = Checkpoint { count: 0.0, ..far.clone() };
        }
        while near.count < small {
            self.advance(&mut near, fine);
        }
        let mut last = near.clone();
        self.advance(&mut last, rest);
        self.marks = Some([far, near]);
        let rounding = ROUNDING * (self.roundings * last.terms + 4.0 * self.q * tau);
        (last.y, last.cut[0].min(last.cut[1]), rounding)
    }

    /// Advances a state by one stretch of the series.
    fn advance(&mut self, mark: &mut Checkpoint, h: f64) {
        let theta = self.speed * h;
        // Half of the damping before and half after, so that nothing leaves the range of numbers in between.
        let damping = (-0.5 * self.q * h).exp();
        let [mut term, mut next] = std::mem::take(&mut self.memory);
        let sum = &mut mark.y;
        sum.iter_mut().for_each(|x| *x *= damping);
        term.clone_from(sum);
        next.resize(sum.len(), 0.0);
        let largest = |values: &[f64]| values.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        let mut constant = damping;
        let mut look = (theta + 4.0 * theta.sqrt() + 6.0) as usize;
        let most = 4 * look + 400;
        let mut j = 0;
        let cut = loop {
            if j >= look {
                let size = largest(&term).max(self.constant * constant);
                // All further terms together, as a geometric series.
                let ratio = theta / (j + 1) as f64;
                let cut = size * ratio / (1.0 - ratio);
                if cut <= CUT * largest(sum) && cut * damping <= self.cut {
                    break cut * damping;
                }
                // The series does not converge to the required error.
                if j > most {
                    break f64::INFINITY;
                }
                look = look.max(j + STRIDE);
            }
            j += 1;
            let c = h / j as f64;
            self.multiply(&term, c, constant, &mut next, sum);
            constant *= c * self.q;
            std::mem::swap(&mut term, &mut next);
        };
        sum.iter_mut().for_each(|x| *x *= damping);
        self.memory = [term, next];
        mark.count += 1.0;
        mark.terms += (j + 1) as f64;
        let more = [cut, cut * mark.y.len() as f64];
        for ((all, more), growth) in mark.cut.iter_mut().zip(more).zip(self.growth) {
            *all = if *all > 0.0 { *all * (growth * h).exp() } else { 0.0 } + more;
        }
    }

    /// `out = c ((A + q) x + b constant)`, which is added to the sum.
    fn multiply(&self, x: &[f64], c: f64, constant: f64, out: &mut [f64], sum: &mut [f64]) {
        dlsys_wide::run(Product { series: self, x, c, constant, out: &mut *out, sum: &mut *sum });
        for &(row, column, a) in &self.others {
            let more = c * a * x[column as usize];
            out[row as usize] += more;
            sum[row as usize] += more;
        }
    }
}

/// The part of a product that stands along bands, for all rows side by side.
struct Product<'p> {
    series: &'p Series,
    x: &'p [f64],
    c: f64,
    constant: f64,
    out: &'p mut [f64],
    sum: &'p mut [f64],
}

impl Kernel for Product<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Product { series, x, c, constant, out, sum } = self;
        let Series { diagonal, bands, b, .. } = series;
        let n = x.len();
        let mut first = 0;
        while first < n {
            let end = (first + TILE).min(n);
            let tile = &mut out[first..end];
            for ((out, d), x) in tile.iter_mut().zip(&diagonal[first..end]).zip(&x[first..end]) {
                *out = d * x;
            }
            for (offset, band) in bands {
                // The rows of the tile whose columns exist.
                let from = first.max((-*offset).max(0) as usize);
                let to = end.min(n - (*offset).max(0) as usize);
                if from < to {
                    let columns = from.wrapping_add_signed(*offset)..to.wrapping_add_signed(*offset);
                    let rows = out[from..to].iter_mut().zip(&band[from..to]);
                    for ((out, a), x) in rows.zip(&x[columns]) {
                        *out += a * x;
                    }
                }
            }
            let tile = out[first..end].iter_mut().zip(&mut sum[first..end]);
            match b.get(first..end) {
                Some(b) => {
                    for ((out, sum), b) in tile.zip(b) {
                        *out = c * (*out + constant * b);
                        *sum += *out;
                    }
                }
                None => {
                    for (out, sum) in tile {
                        *out *= c;
                        *sum += *out;
                    }
                }
            }
            first = end;
        }
    }
}
