//! Dense output: the solution within one step, as polynomials in Bernstein form.
//!
//! Every method's dense output is a polynomial; in Bernstein form its coefficients bound it (the convex
//! hull property), so that a step can be searched for events without sampling it (Farouki 2012, sections
//! 3 and 4). Both ends of the step are coefficients: evaluation there is exact.

use dlsys_expr::SimTime;
use dlsys_expr::{Dual, Interval, Value};

/// Highest degree of a dense output.
pub const MAX_DEGREE: usize = 7;
/// The position at which the error of interpolation is measured.
pub(crate) const PLACE: f64 = 0.7;
/// Bernstein polynomials of degree 7 and their slopes at [`PLACE`].
const AT_PLACE: [[f64; 8]; 2] = bernstein(PLACE);

const fn bernstein(at: f64) -> [[f64; 8]; 2] {
    const CHOOSE: [f64; 8] = [1.0, 7.0, 21.0, 35.0, 35.0, 21.0, 7.0, 1.0];
    const fn power(x: f64, n: usize) -> f64 {
        if n == 0 { 1.0 } else { x * power(x, n - 1) }
    }
    let mut all = [[0.0; 8]; 2];
    let mut i = 0;
    while i < 8 {
        all[0][i] = CHOOSE[i] * power(at, i) * power(1.0 - at, 7 - i);
        all[1][i] = all[0][i] * (i as f64 / at - (7 - i) as f64 / (1.0 - at));
        i += 1;
    }
    all
}

/// Bernstein coefficients of one component; those above the degree of the dense output are 0 or mean nothing.
pub type Coefficients = [f64; MAX_DEGREE + 1];

/// All components of the solution from `start` to `start + h`.
#[derive(Debug)]
pub struct Dense {
    /// Time at position 0.
    pub start: SimTime,
    /// Time at position 1.
    pub end: SimTime,
    /// Length of the step, in units of simulated time.
    pub h: f64,
    /// Bound of the error of the components, relative to their size; 0 where the output is exact.
    pub error: f64,
    /// Errors of single components beyond that, absolute, by component in ascending order: where a polynomial stands for a function that is not smooth.
    pub misfits: Box<[(u32, f64)]>,
    degree: usize,
    /// `degree + 1` coefficients for each component.
    coefficients: Box<[f64]>,
}

impl Clone for Dense {
    fn clone(&self) -> Dense {
        let (misfits, coefficients) = (self.misfits.clone(), self.coefficients.clone());
        Dense { misfits, coefficients, ..*self }
    }

    /// In the memory of the one that is replaced, if both are alike.
    fn clone_from(&mut self, other: &Dense) {
        let (mut misfits, mut coefficients) =
            (std::mem::take(&mut self.misfits), std::mem::take(&mut self.coefficients));
        misfits.clone_from(&other.misfits);
        coefficients.clone_from(&other.coefficients);
        *self = Dense { misfits, coefficients, ..*other };
    }
}

impl Dense {
    /// A step to `end`, if that is known more precisely than as `start + h`. `coefficients` holds `degree + 1` for each component;
    /// `degree` is at most [`MAX_DEGREE`].
    pub fn new(start: SimTime, end: Option<SimTime>, h: f64, degree: usize, coefficients: Vec<f64>) -> Dense {
        debug_assert!(degree <= MAX_DEGREE);
        let end = end.unwrap_or_else(|| start.after(h));
        let coefficients = coefficients.into_boxed_slice();
        Dense { start, end, h, error: 0.0, misfits: Box::default(), degree, coefficients }
    }

    /// The error of a component beyond [`Dense::error`], absolute.
    pub fn misfit(&self, component: usize) -> f64 {
        let place = self.misfits.binary_search_by_key(&(component as u32), |misfit| misfit.0);
        place.map_or(0.0, |place| self.misfits[place].1)
    }

    /// Number of components.
    pub fn components(&self) -> usize {
        self.coefficients.len() / (self.degree + 1)
    }

    /// Position of an instant in the step: 0 at its start, 1 at its end.
    #[inline]
    pub fn position(&self, at: SimTime) -> f64 {
        if self.h == 0.0 { 0.0 } else { (at.since(self.start) / self.h).clamp(0.0, 1.0) }
    }

    /// The Bernstein coefficients of one component.
    #[inline]
    pub fn of(&self, component: usize) -> &[f64] {
        &self.coefficients[component * (self.degree + 1)..(component + 1) * (self.degree + 1)]
    }

    /// One component at a position, by de Casteljau's algorithm.
    #[inline]
    pub fn value(&self, component: usize, position: f64) -> f64 {
        // The most common degree has code without loops, in the place of the call.
        match self.of(component).try_into() {
            Ok(c) => casteljau::<5>(c, position),
            Err(_) => self.value_of_any_degree(component, position),
        }
    }

    /// The same; at the ends, where searches begin and end, without a computation.
    #[inline]
    pub fn value_or_end(&self, component: usize, position: f64) -> f64 {
        match self.of(component) {
            [first, ..] if position == 0.0 => *first,
            [.., last] if position == 1.0 => *last,
            _ => self.value(component, position),
        }
    }

    fn value_of_any_degree(&self, component: usize, position: f64) -> f64 {
        let c = self.of(component);
        if let Ok(c) = c.try_into() {
            return casteljau::<8>(c, position);
        }
        let mut all: Coefficients = [0.0; MAX_DEGREE + 1];
        all[..=self.degree].copy_from_slice(c);
        for level in (1..=self.degree).rev() {
            for i in 0..level {
                all[i] = mix(all[i], all[i + 1], position);
            }
        }
        all[0]
    }

    /// The value of a polynomial of the highest degree.
    #[inline]
    pub fn at(coefficients: &[f64; MAX_DEGREE + 1], position: f64) -> f64 {
        casteljau(coefficients, position)
    }

    /// The stretch from `lo` to `hi`, with other polynomials for some components.
    pub fn with(&self, lo: f64, hi: f64, components: &[usize], others: &[[f64; MAX_DEGREE + 1]]) -> Dense {
        let count = self.components();
        let mut all = Vec::with_capacity(count * (MAX_DEGREE + 1));
        for component in 0..count {
            let mut c: Coefficients = [0.0; MAX_DEGREE + 1];
            c[..=self.degree].copy_from_slice(self.of(component));
            cut(&mut c[..=self.degree], lo, hi);
            // The same polynomial, written as one of a higher degree.
            for degree in self.degree..MAX_DEGREE {
                for i in (0..=degree + 1).rev() {
                    let s = i as f64 / (degree + 1) as f64;
                    let before = if i > 0 { c[i - 1] } else { 0.0 };
                    c[i] = if i > degree { before } else { mix(c[i], before, s) };
                }
            }
            all.extend(c);
        }
        for (component, other) in components.iter().zip(others) {
            all[component * (MAX_DEGREE + 1)..][..=MAX_DEGREE].copy_from_slice(other);
        }
        let start = if lo == 0.0 { self.start } else { self.start.after(lo * self.h) };
        let end = if hi == 1.0 { self.end } else { self.start.after(hi * self.h) };
        let h = if lo == 0.0 && hi == 1.0 { self.h } else { end.since(start) };
        Dense { error: self.error, ..Dense::new(start, Some(end), h, MAX_DEGREE, all) }
    }

    /// The rest of a step of one component, from a position below 1 on; its start is to be at this time, with this value.
    pub fn rest(&self, position: f64, start: SimTime, value: f64) -> Dense {
        let mut c: Coefficients = [0.0; MAX_DEGREE + 1];
        let coefficients = &mut c[..=self.degree];
        coefficients.copy_from_slice(self.of(0));
        cut(coefficients, position, 1.0);
        coefficients[0] = value;
        let h = (1.0 - position) * self.h;
        Dense { error: self.error, ..Dense::new(start, None, h, self.degree, coefficients.to_vec()) }
    }

    /// The position at which a component, which rises or falls all along, has a value that lies between its ends.
    pub fn position_of(&self, component: usize, value: f64) -> f64 {
        let c = self.of(component);
        let [first, last] = [c[0], c[self.degree]];
        let [mut lo, mut hi] = [0.0, 1.0];
        let mut position = (value - first) / (last - first);
        for _ in 0..64 {
            let here = self.departure(component, position);
            let gap = value - here.value;
            if gap == 0.0 {
                break;
            }
            match (gap > 0.0) == (last > first) {
                true => lo = position,
                false => hi = position,
            }
            let next = position + gap / here.rate;
            let next = if next > lo && next < hi { next } else { 0.5 * (lo + hi) };
            if (next - position).abs() <= f64::EPSILON {
                break;
            }
            position = next;
        }
        position
    }

    /// One component at a position, and its rate there, per unit of position.
    pub fn departure(&self, component: usize, position: f64) -> Dual<f64> {
        let mut c: Coefficients = [0.0; MAX_DEGREE + 1];
        c[..=self.degree].copy_from_slice(self.of(component));
        // The degree of most steps has code without loops.
        match self.degree {
            MAX_DEGREE => departure(&mut c, position),
            degree => departure(&mut c[..=degree], position),
        }
    }

    /// The value of one component and its rate, per unit of position, at [`PLACE`]; fast for polynomials of degree 7.
    pub(crate) fn at_place(&self, component: usize) -> (f64, f64) {
        let Ok(c): Result<&[f64; 8], _> = self.of(component).try_into() else {
            let Dual { value, rate } = self.departure(component, PLACE);
            return (value, rate);
        };
        let (mut value, mut rate) = (-0.0, -0.0);
        for i in 0..8 {
            value += AT_PLACE[0][i] * c[i];
            rate += AT_PLACE[1][i] * c[i];
        }
        (value, rate)
    }

    /// Bounds of one component over the whole step: the hull of its coefficients.
    #[inline]
    pub fn bounds(&self, component: usize) -> Interval {
        hull(self.of(component))
    }

    /// Bounds of one component and of its rate (per unit of position) from `lo` to `hi`.
    pub fn piece(&self, component: usize, lo: f64, hi: f64) -> Dual<Interval> {
        let mut c: Coefficients = [0.0; MAX_DEGREE + 1];
        c[..=self.degree].copy_from_slice(self.of(component));
        self.stretch(&mut c, lo, hi)
    }

    /// The coefficients of one component along the stretch from `lo` to `hi`, by powers of the position in the stretch.
    pub fn powers(&self, component: usize, lo: f64, hi: f64) -> Coefficients {
        let mut c: Coefficients = [0.0; MAX_DEGREE + 1];
        c[..=self.degree].copy_from_slice(self.of(component));
        // The degrees of most steps have code without loops.
        match self.degree {
            4 => to_powers(&mut c[..5], lo, hi),
            MAX_DEGREE => to_powers(&mut c, lo, hi),
            degree => to_powers(&mut c[..=degree], lo, hi),
        }
        c
    }

    /// Adds a component, times a factor, to the coefficients of a sum.
    pub fn add_to(&self, component: usize, factor: f64, sum: &mut Coefficients) {
        sum.iter_mut().zip(self.of(component)).for_each(|(sum, c)| *sum += factor * c);
    }

    /// Bounds of a polynomial of the degree of the components and of its rate (per unit of position) from `lo` to `hi`.
    pub fn stretch(&self, c: &mut Coefficients, lo: f64, hi: f64) -> Dual<Interval> {
        // The degree of most steps has code without loops.
        match self.degree {
            MAX_DEGREE => bounds_between(c, lo, hi),
            degree => bounds_between(&mut c[..=degree], lo, hi),
        }
    }
}

/// Bounds of a polynomial with these coefficients and of its rate (per unit of position) from `lo` to `hi`. The coefficients become those of that stretch.
#[inline(always)]
fn bounds_between(c: &mut [f64], lo: f64, hi: f64) -> Dual<Interval> {
    cut(c, lo, hi);
    let (degree, width) = (c.len() - 1, hi - lo);
    let mut rate = Interval::constant(0.0);
    if degree > 0 {
        let mut slopes: Coefficients = [0.0; MAX_DEGREE + 1];
        for i in 0..degree {
            slopes[i] = degree as f64 * (c[i + 1] - c[i]) / width;
        }
        rate = hull(&slopes[..degree]);
    }
    Dual { value: hull(c), rate }
}

/// The value of a polynomial with these coefficients, which it takes, and its rate.
#[inline(always)]
fn departure(c: &mut [f64], position: f64) -> Dual<f64> {
    let degree = c.len() - 1;
    if degree == 0 {
        return Dual { value: c[0], rate: 0.0 };
    }
    for level in (2..=degree).rev() {
        for i in 0..level {
            c[i] = mix(c[i], c[i + 1], position);
        }
    }
    Dual { value: mix(c[0], c[1], position), rate: degree as f64 * (c[1] - c[0]) }
}

/// Restricts a polynomial to the positions from `lo` to `hi` (de Casteljau's subdivision, at `hi` and then at `lo`).
#[inline(always)]
fn cut(c: &mut [f64], lo: f64, hi: f64) {
    let degree = c.len() - 1;
    if hi < 1.0 {
        for level in 1..=degree {
            for i in (level..=degree).rev() {
                c[i] = mix(c[i - 1], c[i], hi);
            }
        }
    }
    if lo > 0.0 {
        let cut = lo / hi;
        for level in (1..=degree).rev() {
            for i in 0..level {
                c[i] = mix(c[i], c[i + 1], cut);
            }
        }
    }
}

/// Writes a polynomial, restricted to the positions from `lo` to `hi`, by powers of the position there.
#[inline(always)]
fn to_powers(c: &mut [f64], lo: f64, hi: f64) {
    cut(c, lo, hi);
    let degree = c.len() - 1;
    for level in 1..=degree {
        for i in (level..=degree).rev() {
            c[i] -= c[i - 1];
        }
    }
    let mut choose = 1.0;
    for (i, c) in c.iter_mut().enumerate().skip(1) {
        choose *= (degree + 1 - i) as f64 / i as f64;
        *c *= choose;
    }
}

/// The value of a polynomial with `N` coefficients.
#[inline(always)]
fn casteljau<const N: usize>(coefficients: &[f64; N], position: f64) -> f64 {
    let mut c = *coefficients;
    for level in (1..N).rev() {
        for i in 0..level {
            c[i] = mix(c[i], c[i + 1], position);
        }
    }
    c[0]
}

/// Exact at both ends, unlike `a + s (b - a)`.
#[inline(always)]
fn mix(a: f64, b: f64, s: f64) -> f64 {
    a * (1.0 - s) + b * s
}

#[inline(always)]
fn hull(values: &[f64]) -> Interval {
    let mut all = Interval::constant(values[0]);
    for &v in &values[1..] {
        all.lo = if v < all.lo { v } else { all.lo };
        all.hi = if v > all.hi { v } else { all.hi };
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn pieces_bound_the_polynomial_and_its_rate(
            c in proptest::collection::vec(-10.0..10.0f64, 5),
            a in 0.0..1.0f64, w in 0.01..1.0f64, s in 0.0..1.0f64,
        ) {
            let (lo, hi) = (a, (a + w).min(1.0));
            prop_assume!(hi - lo > 1e-3);
            let dense = Dense::new(SimTime::ZERO, None, 1.0, 4, c);
            let at = lo + s * (hi - lo);
            let piece = dense.piece(0, lo, hi);
            let value = dense.value(0, at);
            prop_assert!(piece.value.lo - 1e-9 <= value && value <= piece.value.hi + 1e-9);
            let e = 1e-6;
            let slope = (dense.value(0, (at + e).min(1.0)) - dense.value(0, (at - e).max(0.0)))
                / ((at + e).min(1.0) - (at - e).max(0.0));
            prop_assert!(piece.rate.lo - 1e-3 <= slope && slope <= piece.rate.hi + 1e-3);
        }

        #[test]
        fn powers_are_the_same_polynomial(
            c in proptest::collection::vec(-10.0..10.0f64, 5),
            a in 0.0..1.0f64, w in 0.01..1.0f64, s in 0.0..1.0f64,
        ) {
            let dense = Dense::new(SimTime::ZERO, None, 1.0, 4, c);
            let lo = a * (1.0 - w);
            let value = dense.powers(0, lo, lo + w).iter().rev().fold(0.0, |sum, c| sum * s + c);
            prop_assert!((value - dense.value(0, lo + s * w)).abs() < 1e-12);
        }

        #[test]
        fn a_value_is_found_again(
            steps in proptest::collection::vec(1e-3..10.0f64, 1..=MAX_DEGREE), falls in any::<bool>(), s in 0.0..0.999f64,
        ) {
            let sign = if falls { -1.0 } else { 1.0 };
            let c: Vec<f64> = std::iter::once(3.0)
                .chain(steps.iter().scan(3.0, |x, step| { *x += sign * step; Some(*x) }))
                .collect();
            let dense = Dense::new(SimTime::ZERO, None, 2.0, steps.len(), c);
            let value = dense.value(0, s);
            let found = dense.position_of(0, value);
            prop_assert!((dense.value(0, found) - value).abs() <= 1e-14 * value.abs().max(1.0));
            let rest = dense.rest(found, SimTime::new(5.0), value);
            prop_assert_eq!((rest.value(0, 0.0), rest.value(0, 1.0)), (value, dense.value(0, 1.0)));
            let (middle, whole) = (rest.value(0, 0.5), dense.value(0, found + 0.5 * (1.0 - found)));
            prop_assert!((middle - whole).abs() <= 1e-13 * whole.abs().max(1.0));
        }

        #[test]
        fn ends_are_exact(c in proptest::collection::vec(-1e9..1e9f64, 5)) {
            let dense = Dense::new(SimTime::ZERO, None, 1.0, 4, c.clone());
            prop_assert_eq!(dense.value(0, 0.0), c[0]);
            prop_assert_eq!(dense.value(0, 1.0), c[4]);
        }
    }
}
