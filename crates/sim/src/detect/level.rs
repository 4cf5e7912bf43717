//! Atoms that compare an integrated parameter of the module with a number: most of those whose crossings are searched for.
//!
//! Bounds, rates and errors of their sides are those of one polynomial, so nothing need be gathered from the rule's other variables and no
//! program need be evaluated. [`CrossingDetector::plain_crossing`] is the whole search of a step for the first crossing of such an atom where nothing
//! about it is special; what it finds is what the search for any atom finds, to the same bits.

use crate::detect::crossing::{Crossing, CrossingDetector, POLE, TOUCH};
use crate::detect::doubt::Lookahead;
use crate::detect::signs::{half_width, opposite, sign_of};
use crate::world::coupled_solution::DenseComponent;
use crate::world::path::{Path, around};
use dlsys_expr::{Binary, Dual, Interval, Value};
use dlsys_model::Sign;
use dlsys_ode::{Dense, Function, MAX_DEGREE, first_root};

/// The difference of an atom whose sides are an integrated parameter of the module and a number: the same bits as those of
/// [`Difference`], without all that the rule's other variables take.
pub(super) struct LevelDifference<'p> {
    along: DenseComponent<'p>,
    /// Its coefficients, if they are those of the highest degree.
    coefficients: Option<&'p [f64; MAX_DEGREE + 1]>,
    level: f64,
    /// The parameter is the left side.
    is_left: bool,
    stretch: f64,
}

impl<'p> LevelDifference<'p> {
    pub fn new(path: &'p Path, atom: usize) -> Option<LevelDifference<'p>> {
        let sides = &path.rule.sides;
        let [left, right] = [0, 1].map(|side| sides.variable_output(2 * atom + side));
        let (variable, is_left) = (left.or(right)?, left.is_some());
        let level = sides.constant_output(2 * atom + usize::from(is_left))?;
        let stretch = path.world.stretch / path.h;
        let along = path.dense_component(variable)?;
        let coefficients = along.coefficients().try_into().ok();
        Some(LevelDifference { along, coefficients, level, is_left, stretch })
    }

    /// The value of the parameter.
    #[inline]
    fn value_along(&self, at: f64) -> f64 {
        match self.coefficients {
            Some(coefficients) if at > 0.0 && at < 1.0 => Dense::at(coefficients, self.along.position(at)),
            _ => self.along.value(at),
        }
    }

    #[inline]
    fn of<T: Value>(&self, x: T) -> T {
        let level = T::constant(self.level);
        if self.is_left { T::binary(Binary::Sub, x, level) } else { T::binary(Binary::Sub, level, x) }
    }
}

impl Function for LevelDifference<'_> {
    fn bounds(&mut self, lo: f64, hi: f64) -> Dual<Interval> {
        self.of(self.along.over(lo, hi))
    }

    #[inline]
    fn value(&mut self, at: f64) -> f64 {
        self.of(self.value_along(at))
    }

    fn stretch(&self) -> f64 {
        self.stretch
    }
}

/// An atom of this kind, to be searched for along a whole path.
pub(super) struct LevelQuery {
    pub atom: usize,
    /// The sign at the start.
    pub sign: Sign,
    /// The position up to which is searched.
    pub limit: f64,
    /// A production may follow.
    pub decides: bool,
}

/// What a search for the crossing of a level has found.
pub(super) enum LevelFinding {
    /// The sign does not change.
    Nothing,
    /// What lies ahead, with the tolerance up to which the difference counts as zero.
    Ahead(f64, Lookahead),
    /// Something is special: the search for any atom is to be made.
    Unclear,
}

impl LevelDifference<'_> {
    /// Half the width of the band around zero at a position, as far as the polynomial errs, given its bounds up to there; see
    /// [`CrossingDetector::noise`].
    fn noise(&self, at: f64, before: Interval) -> f64 {
        let value = around(self.value_along(at), self.along.error_of(before.magnitude()));
        let level = Interval::constant(self.level);
        if self.is_left { half_width(value, level) } else { half_width(level, value) }
    }

    /// The tolerance below which the difference counts as zero, if its bounds over the whole path admit a change of a sign; as
    /// [`CrossingDetector::may_change`].
    fn may_change(&self, path: &Path, sign: Sign) -> Option<f64> {
        let instant = path.start.resolution() / path.h;
        let Dual { value, rate } = self.along.departure();
        let finite = |x: f64| if x.is_finite() { x } else { 0.0 };
        let tolerance =
            TOUCH * finite(value.abs()).max(finite(self.level.abs())) + finite(rate.abs()) * instant;
        let bounds = self.along.bounds();
        let width = self.along.error_of(bounds.magnitude());
        let Interval { lo, hi, .. } =
            self.of(Interval { lo: bounds.lo - width, hi: bounds.hi + width, ..bounds });
        let may = match sign {
            Sign::Plus => lo.is_nan() || lo <= tolerance,
            _ => hi.is_nan() || hi >= -tolerance,
        };
        may.then_some(tolerance)
    }
}

impl CrossingDetector {
    /// Searches a path, from its start on, for the crossing of an atom that compares an integrated parameter with a number.
    pub(super) fn plain_crossing(&mut self, path: &Path, query: LevelQuery) -> LevelFinding {
        let LevelQuery { atom, sign, limit, decides } = query;
        let (rule, state) = (path.rule, path.state);
        let is_signed = matches!(sign, Sign::Plus | Sign::Minus);
        if !is_signed || rule.jumping_whole[atom] || rule.reads_context && !state.context.is_empty() {
            return LevelFinding::Unclear;
        }
        let Some(mut f) = LevelDifference::new(path, atom) else { return LevelFinding::Unclear };
        let Some(tolerance) = f.may_change(path, sign) else { return LevelFinding::Nothing };
        let (start, first) = (sign_of(sign) * f.value(0.0), Interval::constant(f.along.value(0.0)));
        // It begins on the boundary, in doubt, or at a pole.
        let begins_clear = start > tolerance && start > f.noise(0.0, first) && tolerance <= TOUCH * POLE;
        if !begins_clear {
            return LevelFinding::Unclear;
        }
        let Some(root) = first_root(&mut f, 0.0, limit, sign, tolerance) else {
            return LevelFinding::Unclear;
        };
        if root.at != Sign::Zero || root.after != opposite(sign) {
            return LevelFinding::Unclear;
        }
        if decides {
            let Dual { value: before, rate } = f.along.over(0.0, root.position);
            let noise = f.noise(root.position, before);
            let is_monotonic = !rate.partial && (rate.lo > 0.0 || rate.hi < 0.0);
            let is_evident = noise <= tolerance || is_monotonic && sign_of(sign) * f.value(limit) < -noise;
            if !is_evident {
                return LevelFinding::Unclear;
            }
        }
        let time = path.start.after(root.position * path.h);
        let level = self.level_of(path, atom);
        let crossing = Crossing { position: root.position, time, at: root.at, after: root.after, level };
        LevelFinding::Ahead(tolerance, Lookahead { next: Some(crossing), ..Lookahead::default() })
    }
}
