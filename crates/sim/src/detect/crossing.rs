//! Zero crossings of one atom: where the sides of a condition meet along a path.
//!
//! An atom is a comparison in a rule's conditions; its sign is that of the difference of its two sides. Where a closed
//! form gives the instant at which a variable takes a level, that instant is taken ([`CrossingDetector::meet`]).
//! Elsewhere the difference is bounded by interval arithmetic and its roots are isolated ([`CrossingDetector::root`]),
//! unless the bounds over the whole path already exclude a change of sign.

use crate::detect::level::LevelDifference;
use crate::detect::signs::{NEAR, Reach, half_width, is_at, opposite, rate_at, reach, sign_of};
use crate::world::path::Path;
use crate::world::state::State;
use crate::world::trajectories::Law;
use dlsys_expr::{Binary, Dual, Interval, Program, Scratch, Value};
use dlsys_model::{AffineSum, Rule, Sign, ZeroCrossing};
use dlsys_ode::{Function, Root, first_root};
use dlsys_tree::SimTime;
use smallvec::SmallVec;

/// A difference of two sides counts as zero up to this many times the size of the sides.
pub const TOUCH: f64 = 256.0 * f64::EPSILON;

/// Sides that are this many times larger at the start of a path than in its middle begin at a pole.
pub(super) const POLE: f64 = 1e8;

/// Residue that numerical trajectories may leave of zero, relative to the size of the sides or to 1.
const NOISE: f64 = 1e-10;

/// A part of a path over which rates are known, but for the rounding of values.
const INSTANT: f64 = 1e-6;

/// What moves over a jump has left it for good when it has moved by so many times its rounding,
const BLUR: f64 = 64.0;

/// or, if it is slow, after this part of the present time, or of 1.
const LONGEST_BLUR: f64 = 1e-10;

/// Detects zero crossings along paths. The fields are working memory: a search allocates nothing once they have grown.
#[derive(Clone, Debug, Default)]
pub struct CrossingDetector {
    /// Values of the rule's variables where the difference was last evaluated.
    pub(super) values: Vec<f64>,
    departure: Vec<Dual<f64>>,
    whole: Vec<Interval>,
    pub(super) bounds: Vec<Dual<Interval>>,
    scratch: Scratch<f64>,
    departure_scratch: Scratch<Dual<f64>>,
    pub(super) whole_scratch: Scratch<Interval>,
    pub(super) around: Vec<Interval>,
    pub(super) around_out: Vec<Interval>,
    pub(super) bounds_scratch: Scratch<Dual<Interval>>,
    /// Both sides of every atom where the difference was last evaluated.
    pub(super) out: Vec<f64>,
    departure_out: Vec<Dual<f64>>,
    whole_out: Vec<Interval>,
    pub(super) bounds_out: Vec<Dual<Interval>>,
    rates: Vec<f64>,
}

/// An instant at which the sides of an atom meet.
#[derive(Clone, Copy, Debug)]
pub struct Crossing {
    /// Position on the path, in units of its length.
    pub position: f64,
    /// The instant at that position.
    pub time: SimTime,
    /// The sign at the instant.
    pub at: Sign,
    /// The sign just after it.
    pub after: Sign,
    /// The parameter that reaches a level there, or the time, and the level, if both are known.
    pub level: Option<(usize, f64)>,
}

/// What the rounding of variables does to the sides of an atom.
struct Widened {
    /// On the difference of the sides.
    width: f64,
    /// The size of the sides.
    size: f64,
    /// The sides are defined, and finite.
    bounded: bool,
}

/// The difference of the two sides of an atom, as a function of the position on a path.
pub struct Difference<'w, 'p> {
    path: &'w Path<'p>,
    sides: &'w Program,
    atom: usize,
    memory: &'w mut CrossingDetector,
}

impl Function for Difference<'_, '_> {
    fn bounds(&mut self, lo: f64, hi: f64) -> Dual<Interval> {
        // The difference of values that move together may vary much less than each of them does.
        if let ZeroCrossing::Search { sum: Some(sum), .. } =
            &self.path.rule.zero_crossings(self.path.state.solve.get())[self.atom]
            && let Some(bounds) = self.path.sum_over(sum, lo, hi)
        {
            return bounds;
        }
        let m = &mut *self.memory;
        self.path.over(lo, hi, &mut m.bounds);
        m.bounds_out.resize(self.sides.outputs(), Dual::constant(0.0));
        self.sides.eval(&m.bounds, &mut m.bounds_scratch, &mut m.bounds_out);
        Dual::binary(Binary::Sub, m.bounds_out[2 * self.atom], m.bounds_out[2 * self.atom + 1])
    }

    fn value(&mut self, at: f64) -> f64 {
        let m = &mut *self.memory;
        self.path.at(at, &mut m.values);
        m.out.resize(self.sides.outputs(), 0.0);
        self.sides.eval(&m.values, &mut m.scratch, &mut m.out);
        m.out[2 * self.atom] - m.out[2 * self.atom + 1]
    }

    fn is_total(&self) -> bool {
        let reads = &self.path.rule.atom_reads[self.atom];
        self.sides.is_total() && reads.iter().all(|variable| self.path.is_total(*variable))
    }

    fn stretch(&self) -> f64 {
        self.path.world.stretch / self.path.h
    }
}

/// True if the crossings of some atom of a module can only be found by search, so that the stretch to search must be
/// bounded.
pub fn needs_search(state: &State, rule: &Rule) -> bool {
    let searched = |(_, crossing)| matches!(location_method(crossing, state), LocationMethod::Search);
    reachable(rule, state).any(searched)
}

/// The atoms of a module's rule whose signs may change under the active equations, as far as the analysis of the model has not proven that
/// they do not: their numbers, and how their sides meet.
#[inline]
pub(super) fn reachable<'r>(
    rule: &'r Rule,
    state: &State,
) -> impl Iterator<Item = (usize, &'r ZeroCrossing)> + use<'r> {
    let solve = state.solve.get();
    let unreachable = solve.map_or(&[][..], |solve| &rule.solves[solve].unreachable);
    let all = rule.zero_crossings(solve).iter().enumerate();
    all.filter(move |(atom, _)| !unreachable.get(*atom).is_some_and(|unreachable| *unreachable))
}

/// How the crossings of an atom are located.
pub(super) enum LocationMethod<'w> {
    /// There are none: both sides are constant.
    Never,
    /// By inverting the trajectory of a variable at a level.
    Formula(usize, &'w Program),
    /// By isolating the roots of the difference.
    Search,
}

/// The location method of an atom, given the trajectories of the parameters.
#[inline]
pub(super) fn location_method<'w>(crossing: &'w ZeroCrossing, state: &State) -> LocationMethod<'w> {
    match crossing {
        ZeroCrossing::Constant => LocationMethod::Never,
        ZeroCrossing::Formula { variable, level } => match state.trajectories.get(*variable) {
            Some(law) if law.is_numeric() => LocationMethod::Search,
            _ => LocationMethod::Formula(*variable, level),
        },
        ZeroCrossing::Search { .. } => LocationMethod::Search,
    }
}

/// The one level at which the sides of an atom meet that compares a variable with it: the variable, the level, and the side
/// on which the difference has the sign that it has now; 0 where a formula does not tell. `value` gives that of a formula for
/// the level.
#[inline]
pub(super) fn level_of_dense(
    crossing: &ZeroCrossing,
    sign: Sign,
    value: impl FnOnce(&Program) -> Option<f64>,
) -> Option<(usize, f64, f64)> {
    if !matches!(sign, Sign::Plus | Sign::Minus) {
        return None;
    }
    match crossing {
        ZeroCrossing::Formula { variable, level } => Some((*variable, value(level)?, 0.0)),
        ZeroCrossing::Search { sum: Some(AffineSum { constant, terms }), .. } if terms.len() == 1 => {
            let (variable, factor) = terms[0];
            Some((variable, -constant / factor, sign_of(sign) * factor))
        }
        _ => None,
    }
}

/// True if values within some bounds stay away from a level, on this side of it, by more than the relative error of
/// integration.
pub(super) fn is_clear_of(bounds: Interval, level: f64, side: f64, error: f64) -> bool {
    let margin = error.max(1e-9) * (level.abs() + bounds.magnitude());
    (side >= 0.0 && level < bounds.lo - margin) || (side <= 0.0 && level > bounds.hi + margin)
}

impl CrossingDetector {
    /// True if the dense output of a parameter stays away from the one level at which its atom's sides meet, by more
    /// than the relative error of integration, `error`. Most steps need no other test.
    pub(super) fn keeps_clear(
        &mut self,
        path: &Path,
        crossing: &ZeroCrossing,
        sign: Sign,
        error: f64,
    ) -> bool {
        let Some((variable, level, side)) =
            level_of_dense(crossing, sign, |level| Some(self.level(path, level)))
        else {
            return false;
        };
        path.dense_bounds(variable).is_some_and(|bounds| is_clear_of(bounds, level, side, error))
    }

    /// The value of the variable at which the sides of an atom meet.
    fn level(&mut self, path: &Path, level: &Program) -> f64 {
        if let Some(&[level]) = level.constants() {
            return level;
        }
        path.at(0.0, &mut self.values);
        let mut out = [0.0];
        level.eval(&self.values, &mut self.scratch, &mut out);
        out[0]
    }

    /// The difference of an atom's sides along a path.
    pub(super) fn difference<'w, 'p>(&'w mut self, path: &'w Path<'p>, atom: usize) -> Difference<'w, 'p> {
        Difference { path, sides: &path.rule.sides, atom, memory: self }
    }

    /// The first crossing between the positions `from` and `limit`, of a difference that has `sign` at `from`. Up to
    /// `tolerance` the difference counts as zero.
    pub(super) fn root(
        &mut self,
        path: &Path,
        atom: usize,
        from: f64,
        limit: f64,
        sign: Sign,
        tolerance: f64,
    ) -> Option<Crossing> {
        // The sign with which a boundary was left prevails over values that are rounding, and over a jump within the
        // resolution of time.
        let (mut from, mut tolerance) = (from, tolerance);
        let mut start = self.difference(path, atom).value(from);
        if path.rule.jumping_whole[atom] && sign != Sign::Any {
            let behind = (from + self.blur(path, atom, from)).min(limit);
            if sign == Sign::Zero && start == 0.0 {
                from = behind;
            } else if Sign::of(start) != sign {
                let then = self.difference(path, atom).value(behind);
                let has_jumped = then == start || start.abs() > NEAR * self.out[2 * atom].abs().max(1.0);
                if Sign::of(then) == sign {
                    (from, start) = (behind, then);
                } else if sign != Sign::Zero && Sign::of(then) == Sign::of(start) && has_jumped {
                    // Another event of the module came a rounding before the jump, and its numbers are those behind it.
                    let (time, now) = (path.start.after(from * path.h), Sign::of(start));
                    return Some(Crossing { position: from, time, at: now, after: now, level: None });
                }
            }
        }
        if sign != Sign::Any && start != 0.0 && start * sign_of(sign) <= 0.0 {
            let size = self.out[2 * atom].abs().max(self.extent(path, atom).min(1.0));
            let soon = (from + 4.0 * path.start.resolution() / path.h).min(limit);
            let then = self.difference(path, atom).value(soon);
            if sign == Sign::Zero && then == 0.0 || then * sign_of(sign) > tolerance {
                from = soon;
            } else {
                let limit = if sign == Sign::Zero { 64.0 * f64::EPSILON } else { NOISE };
                let noise = if start.abs() <= limit * size { 4.0 * start.abs() } else { 0.0 };
                tolerance = tolerance.max(noise).max(self.rounding(path, atom, from));
            }
        }
        // Inside equations a sign may be that of noise: which of them are taken next to nothing does not count.
        let is_noise = |noise: f64| {
            matches!(sign, Sign::Zero | Sign::Any)
                || start.abs() <= noise && !path.rule.decides_productions(atom)
        };
        let is_among_others = path.reads_others() && path.error() > 0.0;
        if is_among_others && start.abs() < path.error() {
            let noise = self.least_noise(path, atom, from);
            tolerance = if is_noise(noise) { tolerance.max(noise) } else { tolerance };
        }
        let Root { mut position, mut at, mut after } = loop {
            let root = match LevelDifference::new(path, atom) {
                Some(mut plain) => first_root(&mut plain, from, limit, sign, tolerance),
                None => first_root(&mut self.difference(path, atom), from, limit, sign, tolerance),
            };
            let root = root?;
            match self.leaving(path, atom, (from, start), (root.position, limit), sign) {
                Some(end) => (from, start) = end,
                None => break root,
            }
        };
        if is_among_others && position == from && at == Sign::Zero && start.abs() <= tolerance {
            position = self.way_out(path, atom, (from, limit), tolerance);
            after = self.side_taken(path, atom, (from, limit)).unwrap_or(after);
        }
        if at == after && after == opposite(sign) && self.passes_by_rounding(path, atom, position) {
            at = Sign::Zero;
        }
        let behind =
            position + if path.rule.jumping_whole[atom] { self.blur(path, atom, position) } else { 0.0 };
        if position < behind && behind < limit {
            // Nearer to the jump rounding decides.
            let then = self.difference(path, atom).value(behind);
            after = if then.abs() <= tolerance { Sign::Zero } else { Sign::of(then) };
        }
        let time = path.start.after(position * path.h);
        // At the end of a path what comes after may not be known.
        let passes = at == Sign::Zero && after != sign;
        let level = if passes { self.level_of(path, atom) } else { None };
        Some(Crossing { position, time, at, after, level })
    }

    /// The size of the largest variable that an atom reads, anywhere on a path: what arrives in empty cells is far smaller than 1, and no rounding of it.
    fn extent(&mut self, path: &Path, atom: usize) -> f64 {
        path.over(0.0, 1.0, &mut self.bounds);
        let sizes =
            path.rule.atom_reads[atom].iter().map(|variable| self.bounds[*variable].value.magnitude());
        sizes.fold(0.0, f64::max)
    }

    /// The place at which a difference that leaves zero at the beginning of a stretch has left it: an output that is a polynomial through
    /// later values departs at once from what stays zero longer. At the instant itself nothing tells that it is not zero any more.
    fn way_out(&mut self, path: &Path, atom: usize, (from, limit): (f64, f64), tolerance: f64) -> f64 {
        let (mut reach, least) = (limit - from, 4.0 * path.start.resolution() / path.h);
        while reach > least && self.difference(path, atom).value(from + 0.5 * reach).abs() > tolerance {
            reach *= 0.5;
        }
        from + reach
    }

    /// The side on which a difference is that leaves zero at the beginning of a stretch, as soon as it is more than what the polynomial may be wrong by there;
    /// None if it is nowhere.
    fn side_taken(&mut self, path: &Path, atom: usize, (from, limit): (f64, f64)) -> Option<Sign> {
        let noise = self.noise_on_the_way(path, atom, from);
        let there = self.way_out(path, atom, (from, limit), noise);
        let value = self.difference(path, atom).value(there);
        (value.abs() > noise).then_some(Sign::of(value))
    }

    /// The parameter of the module, or of a neighbour, or the time, whose value the condition of a production compares with a level that rests, and the level.
    /// Without it a successor that gets a value at its limit would get a rounding of the limit, perhaps on its other side.
    pub(super) fn level_of(&mut self, path: &Path, atom: usize) -> Option<(usize, f64)> {
        if !path.rule.decides_productions(atom) {
            return None;
        }
        let (variable, level) = match &path.rule.zero_crossings(path.state.solve.get())[atom] {
            ZeroCrossing::Formula { variable, level } => (*variable, self.level(path, level)),
            ZeroCrossing::Search { level: Some((variable, level)), .. } => {
                (*variable, self.level(path, level) + 0.0)
            }
            _ => return None,
        };
        (variable <= path.rule.time_variable()).then_some((variable, level))
    }

    /// The time, in units of the path's length, within which rounding may make something jump to and fro that moves over a jump at a position: until
    /// every value has moved by more than its rounding.
    fn blur(&mut self, path: &Path, atom: usize, at: f64) -> f64 {
        let hi = (at + INSTANT).min(1.0);
        path.over(hi - INSTANT, hi, &mut self.bounds);
        let moves = path.rule.atom_reads[atom].iter().map(|variable| self.bounds[*variable]);
        let moves = moves.map(|x| [x.value, x.rate].map(Interval::magnitude));
        let times = moves.filter(|[_, rate]| *rate != 0.0).map(|[x, rate]| BLUR * f64::EPSILON * x / rate);
        let longest = LONGEST_BLUR * path.start.to_f64().abs().max(1.0) / path.h;
        times.fold(BLUR * path.start.resolution() / path.h, f64::max).min(longest)
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

    /// True if a difference that is found on the one side of zero, and then on the other, is a difference of large numbers, none of which
    /// may come nearer to zero: it passes zero without a jump.
    fn passes_by_rounding(&mut self, path: &Path, atom: usize, at: f64) -> bool {
        let there = self.difference(path, atom).value(at).abs();
        let jumps = path.rule.jumping_whole[atom]
            || path.rule.atom_reads[atom].iter().any(|variable| path.is_function(*variable));
        match jumps {
            true => there <= self.rounding(path, atom, at),
            false => self.is_bounded_around(path, atom, at),
        }
    }

    /// False where a difference passes through infinity: the rounding of a variable on its way, which is larger than that of a value near 0,
    /// takes it there, too.
    fn is_bounded_around(&mut self, path: &Path, atom: usize, at: f64) -> bool {
        path.over(0.0, 1.0, &mut self.bounds);
        let sizes: SmallVec<[f64; 16]> = self.bounds.iter().map(|bounds| bounds.value.magnitude()).collect();
        self.widened_by(path, atom, at, &sizes).bounded
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

    /// The crossing at which a variable that moves monotonically takes the level at which its atom's sides meet.
    #[inline]
    pub(super) fn meet(
        &mut self,
        path: &Path,
        atom: usize,
        variable: usize,
        level: &Program,
        sign: Sign,
    ) -> Option<Crossing> {
        if !matches!(sign, Sign::Plus | Sign::Minus) {
            return None;
        }
        let level = self.level(path, level);
        let t = path.rule.time_variable();
        let law = path.state.trajectories.get(variable);
        let start = law.map_or(0.0, |_| path.world.tree.parameters(path.state.id)[variable]);
        let clause = path.state.solve.get().map(|s| &path.rule.solves[s]);
        let (values, scratch, rates) = (&mut self.values, &mut self.scratch, &mut self.rates);
        let exact = || {
            path.start(values);
            values.extend(path.state.marks.switch_values());
            rate_at(clause, values, variable, level, scratch, rates)
        };
        let met = reach(variable, t, level, law.and_then(Law::formula), start, exact);
        let is_known = met.is_some();
        let time = match met {
            Some(Reach::At(time)) => time,
            Some(Reach::Age(age)) => path.world.tree.birth(path.state.id).after(age),
            Some(Reach::After(tau)) => path.state.since.after(tau),
            // Another event of the module may come a rounding before this one. It leaves the variable at the level or beyond it, and the
            // sign as it was.
            None if law.is_some() && is_at(level, start) => path.start,
            None => return None,
        };
        let position = time.since(path.start) / path.h;
        let level = (variable <= t).then_some((variable, level));
        let after = opposite(sign);
        let crossing = Crossing { position, time, at: Sign::Zero, after, level };
        if position > path.start.resolution() / path.h {
            return Some(crossing);
        }
        // The crossing is at the start but for rounding, or before it: either it has been passed, or it fell on the
        // very end of the stretch before this one and was missed. Only in the second case does the difference move
        // towards zero.
        path.departure(&mut self.departure);
        self.departure_out.resize(path.rule.sides.outputs(), Dual::constant(0.0));
        path.rule.sides.eval(&self.departure, &mut self.departure_scratch, &mut self.departure_out);
        let [a, b] = [self.departure_out[2 * atom], self.departure_out[2 * atom + 1]];
        let is_still_to_come = is_known || (a.value - b.value) * sign_of(sign) <= 0.0;
        if Sign::of(a.rate - b.rate) != crossing.after || !is_still_to_come {
            return None;
        }
        let time = if position > 0.0 { time } else { path.start };
        Some(Crossing { position: position.max(0.0), time, ..crossing })
    }

    /// Evaluates the sides of all atoms at the start and their bounds over the whole path: most atoms keep their sign
    /// on most paths.
    #[inline]
    pub(super) fn measure(&mut self, path: &Path) {
        let sides = &path.rule.sides;
        path.whole(&mut self.whole);
        self.whole_out.resize(sides.outputs(), Interval::EMPTY);
        sides.eval(&self.whole, &mut self.whole_scratch, &mut self.whole_out);
        path.departure(&mut self.departure);
        self.departure_out.resize(sides.outputs(), Dual::constant(0.0));
        sides.eval(&self.departure, &mut self.departure_scratch, &mut self.departure_out);
    }

    /// The tolerance of a path that begins at a pole, where sides are so large that all that follows would count as zero: that of the
    /// middle of the path.
    pub(super) fn away_from_pole(&mut self, path: &Path, atom: usize, tolerance: f64) -> f64 {
        if tolerance <= TOUCH * POLE {
            return tolerance;
        }
        self.difference(path, atom).value(0.5);
        let there = self.out[2 * atom].abs().max(self.out[2 * atom + 1].abs());
        if TOUCH * there * POLE < tolerance { TOUCH * there } else { tolerance }
    }

    /// The tolerance below which the difference counts as zero, if its bounds over the whole path admit a change of
    /// sign; None if they exclude one. The tolerance has the scale of the start, not of the far end: a stretch may be a
    /// thousand lives long.
    #[inline]
    pub(super) fn may_change(&self, path: &Path, atom: usize, sign: Sign) -> Option<f64> {
        let instant = path.start.resolution() / path.h;
        let start = [self.departure_out[2 * atom], self.departure_out[2 * atom + 1]];
        let size = start.iter().map(|s| s.value.abs()).filter(|s| s.is_finite()).fold(0.0, f64::max);
        let slope = Some((start[0].rate - start[1].rate).abs()).filter(|s| s.is_finite());
        let tolerance = TOUCH * size + slope.unwrap_or(0.0) * instant;
        let (a, b) = (self.whole_out[2 * atom], self.whole_out[2 * atom + 1]);
        let may = if a.is_empty() || b.is_empty() {
            sign != Sign::Undefined
        } else if a.partial || b.partial {
            true
        } else {
            let (lo, hi) = (a.lo - b.hi, a.hi - b.lo);
            match sign {
                Sign::Plus => lo.is_nan() || lo <= tolerance,
                Sign::Minus => hi.is_nan() || hi >= -tolerance,
                Sign::Zero | Sign::Any => !(lo >= -tolerance && hi <= tolerance),
                Sign::Undefined => true,
            }
        };
        may.then_some(tolerance)
    }
}
