//! How wide the band around zero is in which the difference of two sides has no sign: by the errors of integration ([`noise`](CrossingDetector::noise)),
//! by the rounding of what is read ([`rounding`](CrossingDetector::rounding)), and next to nothing.

use crate::detect::crossing::{CrossingDetector, NOISE};
use crate::detect::doubt::FAR;
use crate::detect::signs::half_width;
use crate::world::path::Path;
use crate::world::sizes::NEXT_TO_NOTHING;
use dlsys_expr::{Dual, Interval, Value};
use dlsys_model::ZeroCrossing;
use smallvec::SmallVec;

/// Sides that read more variables have bounds by terms.
const MANY_READS: usize = 8;

/// What the rounding of variables does to the sides of an atom.
struct Widened {
    /// On the difference of the sides.
    width: f64,
    /// The size of the sides.
    size: f64,
    /// The sides are defined, and finite.
    bounded: bool,
}

impl CrossingDetector {
    /// Half the width of the band: the effect of the errors of integration and rounding on the difference of two sides.
    /// 0 where the difference jumps.
    pub(super) fn noise(&mut self, path: &Path, atom: usize, at: f64) -> f64 {
        path.uncertain(at, &mut self.around);
        let sides = &path.rule.sides;
        self.around_out.resize(sides.outputs(), Interval::EMPTY);
        sides.eval(&self.around, &mut self.whole_scratch, &mut self.around_out);
        let (a, b) = (self.around_out[2 * atom], self.around_out[2 * atom + 1]);
        let width = half_width(a, b);
        let is_sum = matches!(
            path.rule.zero_crossings(path.state.solve.get())[atom],
            ZeroCrossing::Search { sum: Some(_), .. }
        );
        // By each term for itself, bounds of what is written out (`x^2 - 2*x + 1`) are far too wide.
        let width = if is_sum || width == 0.0 { width } else { width.min(self.sensitivity(path, atom, at)) };
        // What stands alone, or is compared with another number than 0, may be next to nothing and follow its own size all the same; of two that
        // differ by less than what is followed nobody knows which is larger, and of one that no influence has reached yet not that it is not below 0.
        let may_be_nothing = |side: Interval| half_width(side, side) > 0.0 || side.magnitude() == 0.0;
        let is_tiny =
            path.reads_others() && width < NEXT_TO_NOTHING && may_be_nothing(a) && may_be_nothing(b);
        let width = if is_tiny { width.max(self.noise_on_the_way(path, atom, at)) } else { width };
        // A wider one is that of a jump.
        let is_jump = || width > FAR * path.error() * a.magnitude().max(b.magnitude()).max(1.0);
        if path.rule.jumping_whole[atom] && is_jump() { 0.0 } else { width }
    }

    /// The same by the mean value theorem: the errors of the variables, which are those around their values, times the partial derivatives, and
    /// the effect of rounding; infinite where that says nothing.
    fn sensitivity(&mut self, path: &Path, atom: usize, at: f64) -> f64 {
        let (reads, sides) = (&path.rule.atom_reads[atom], &path.rule.sides);
        if reads.len() > MANY_READS {
            return f64::INFINITY;
        }
        let around = std::mem::take(&mut self.around);
        let mut all = 0.0;
        for &variable in reads {
            let error = 0.5 * (around[variable].hi - around[variable].lo);
            if error == 0.0 {
                continue;
            }
            self.bounds.clear();
            self.bounds
                .extend(around.iter().map(|value| Dual { value: *value, rate: Interval::constant(0.0) }));
            self.bounds[variable].rate = Interval::constant(error);
            self.bounds_out.resize(sides.outputs(), Dual::constant(0.0));
            sides.eval(&self.bounds, &mut self.bounds_scratch, &mut self.bounds_out);
            let [a, b] = [0, 1].map(|side| self.bounds_out[2 * atom + side].rate);
            let moved = (a.hi - b.lo).abs().max((a.lo - b.hi).abs());
            let is_known = !a.partial && !b.partial && !a.is_empty() && !b.is_empty() && moved.is_finite();
            all += if is_known { moved } else { f64::INFINITY };
        }
        self.around = around;
        all + if all.is_finite() { self.rounding_width(path, atom, at) } else { 0.0 }
    }

    /// The effect on the difference of two sides of errors of integration that nobody follows, because the values are next to nothing: what has not
    /// arrived has no sign. 0 where the difference jumps.
    pub(super) fn least_noise(&mut self, path: &Path, atom: usize, at: f64) -> f64 {
        path.next_to_nothing(at, false, &mut self.around);
        self.width_around(path, atom)
    }

    /// The same, and of those inside the step of values that are next to nothing and become more.
    pub(super) fn noise_on_the_way(&mut self, path: &Path, atom: usize, at: f64) -> f64 {
        path.next_to_nothing(at, true, &mut self.around);
        self.width_around(path, atom)
    }

    /// Half the width of the difference of two sides of values that are around some; 0 where the difference jumps.
    fn width_around(&mut self, path: &Path, atom: usize) -> f64 {
        let sides = &path.rule.sides;
        self.around_out.resize(sides.outputs(), Interval::EMPTY);
        sides.eval(&self.around, &mut self.whole_scratch, &mut self.around_out);
        let [a, b] = [0, 1].map(|side| self.around_out[2 * atom + side]);
        let width = half_width(a, b);
        if path.rule.jumping_whole[atom] || !width.is_finite() { 0.0 } else { width }
    }

    /// The effect of the rounding of the variables on the difference of two sides; 0 where the difference jumps.
    pub(super) fn rounding(&mut self, path: &Path, atom: usize, at: f64) -> f64 {
        let Widened { width, size, .. } = self.widened(path, atom, at);
        // A larger effect is that of a jump.
        if width <= NOISE * size.max(1.0) { width } else { 0.0 }
    }

    /// The effect of the rounding of the variables on the difference of two sides, however large.
    pub(super) fn rounding_width(&mut self, path: &Path, atom: usize, at: f64) -> f64 {
        let Widened { width, bounded, .. } = self.widened(path, atom, at);
        if bounded { width } else { f64::INFINITY }
    }

    /// False where a difference passes through infinity: the rounding of a variable on its way, which is larger than that of a value near 0,
    /// takes it there, too.
    pub(super) fn is_bounded_around(&mut self, path: &Path, atom: usize, at: f64) -> bool {
        path.over(0.0, 1.0, &mut self.bounds);
        let sizes: SmallVec<[f64; 16]> = self.bounds.iter().map(|bounds| bounds.value.magnitude()).collect();
        self.widened_by(path, atom, at, &sizes).bounded
    }

    /// What the rounding of the variables does to two sides.
    fn widened(&mut self, path: &Path, atom: usize, at: f64) -> Widened {
        self.widened_by(path, atom, at, &[])
    }

    /// The same of variables that are rounded as if they were of these sizes, or of their own, if that is larger.
    fn widened_by(&mut self, path: &Path, atom: usize, at: f64, sizes: &[f64]) -> Widened {
        path.over(at, at, &mut self.bounds);
        for (number, variable) in self.bounds.iter_mut().enumerate() {
            let size = sizes.get(number).copied().unwrap_or(0.0).max(variable.value.magnitude());
            let width = 64.0 * f64::EPSILON * size;
            variable.value.lo -= width;
            variable.value.hi += width;
        }
        let sides = &path.rule.sides;
        self.bounds_out.resize(sides.outputs(), Dual::constant(0.0));
        sides.eval(&self.bounds, &mut self.bounds_scratch, &mut self.bounds_out);
        let [a, b] = [0, 1].map(|side| self.bounds_out[2 * atom + side].value);
        let width = (a.hi - a.lo) + (b.hi - b.lo);
        let bounded = width.is_finite() && !a.is_empty() && !b.is_empty() && !a.partial && !b.partial;
        Widened { width, size: a.magnitude().max(b.magnitude()), bounded }
    }
}
