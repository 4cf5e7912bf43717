//! Crossings of integrated values: which changes of sign are evidence of an event.
//!
//! An integrated value is known up to some error, so a difference of two sides has a band around zero in which its sign
//! is unknown. A change of sign that stays within the band is evidence neither of an event nor against one: neighbours
//! that equalise approach each other without limit and never meet, and their difference then changes sign by rounding.
//! Therefore
//!
//! - a crossing counts when the difference leaves the band on the other side, now or in a later step; its instant is
//!   that of the change of sign;
//! - a difference that stays in the band keeps the sign that it had;
//! - a difference that comes from outside the band and leaves it on the same side may have touched zero or not: where a
//!   production depends on it, that is reported ([`Error::InDoubt`](crate::error::Error::InDoubt)).
//!
//! A touch to the last digits counts as one. All this is for productions only: conditions inside equations change
//! where the integrated values change them, or else pieces of equations would be continued beyond their ends. But one that makes rates jump so that the
//! sides, which had come to rest, part on the other side, keeps its sign within the band
//! ([`crosses_by_error`](CrossingDetector::crosses_by_error)).
//!
//! Two modules, one of which reads the other, may have simultaneous events whose integrated instants differ; the second
//! would then see the successors of the first. So when a module has its event, the events of those of its readers that
//! are no further away than the error of integration happen with it
//! ([`about_to_meet`](CrossingDetector::about_to_meet)), with a warning if they are not much nearer than that.

use crate::detect::crossing::{Crossing, CrossingDetector};
use crate::detect::signs::{half_width, opposite, sign_of};
use crate::detect::switched;
use crate::world::path::{NEXT_TO_NOTHING, Path};
use dlsys_expr::{Dual, Interval, Value};
use dlsys_model::{Sign, ZeroCrossing};
use dlsys_ode::{Function, first_root};

/// The rate of a difference at a position is bounded over this part of the path on both sides of it.
const NEARBY: f64 = 1e-6;

/// A difference that is never slower, on its way through the band, than this part of its mean rate passes zero.
const STEADY: f64 = 0.5;

/// Sides that part so many times faster than they have come together had all but come to rest.
const SLOW: f64 = 10.0;

/// A difference that is this many times larger than the error of its sides lies surely outside the band.
pub const FAR: f64 = 1e3;

/// The band of a difference of values of neighbours is at least this many roundings wide.
const BLUR: f64 = 4.0;

/// The result of looking ahead for one atom on a path. Positions are in units of the path's length.
#[derive(Clone, Copy, Debug, Default)]
pub struct Lookahead {
    /// The next crossing, if there is one.
    pub next: Option<Crossing>,
    /// The position, before the next crossing, at which the sides have parted again after they had come near each other.
    pub doubt: Option<f64>,
    /// At the end of the path the difference is inside the band, and has come there from outside.
    pub near: bool,
}

impl Lookahead {
    fn crossing(next: Option<Crossing>) -> Lookahead {
        Lookahead { next, ..Lookahead::default() }
    }

    pub(super) fn in_doubt(position: f64) -> Lookahead {
        Lookahead { doubt: Some(position), ..Lookahead::default() }
    }

    fn ends_near(near: bool) -> Lookahead {
        Lookahead { near, ..Lookahead::default() }
    }
}

/// One atom to look ahead for.
#[derive(Clone, Copy)]
pub struct AtomQuery {
    /// Number of the atom in the rule.
    pub atom: usize,
    /// The position from which on the path is searched.
    pub from: f64,
    /// The position up to which it is searched.
    pub limit: f64,
    /// The sign at `from`: plus or minus.
    pub sign: Sign,
    /// The effect of rounding on the difference.
    pub tolerance: f64,
    /// The difference was inside the band before, and had come there from outside.
    pub near: bool,
    /// A production may follow.
    pub decides: bool,
    /// The error of integrated values, relative; 0 if there are none.
    pub error: f64,
}

/// A function raised by a constant.
struct Raised<'f, F>(&'f mut F, f64);

impl<F: Function> Function for Raised<'_, F> {
    fn bounds(&mut self, lo: f64, hi: f64) -> Dual<Interval> {
        let Dual { value, rate } = self.0.bounds(lo, hi);
        Dual { value: Interval { lo: value.lo + self.1, hi: value.hi + self.1, ..value }, rate }
    }

    fn value(&mut self, at: f64) -> f64 {
        self.0.value(at) + self.1
    }

    fn is_total(&self) -> bool {
        self.0.is_total()
    }

    fn stretch(&self) -> f64 {
        self.0.stretch()
    }
}

/// Sides that read more variables have bounds by terms.
const MANY_READS: usize = 8;

impl CrossingDetector {
    /// The place up to which a difference that is zero at `from`, but for rounding, is nothing else, and its value there; None if it then has not the
    /// sign that it was said to get, or if a root that was found is beyond. What does not move at once (`dx/dt = age`) is rounding much longer than
    /// the resolution of time.
    pub(super) fn leaving(
        &mut self,
        path: &Path,
        atom: usize,
        (from, start): (f64, f64),
        (root, limit): (f64, f64),
        sign: Sign,
    ) -> Option<(f64, f64)> {
        let (side, instant) = (sign_of(sign), path.start.resolution() / path.h);
        let jumps = path.rule.jumping[atom] || path.rule.jumping_whole[atom];
        if side == 0.0 || jumps || start.abs() > self.rounding(path, atom, from) {
            return None;
        }
        let mut width = instant;
        loop {
            let to = (from + width).min(limit);
            let value = self.difference(path, atom).value(to);
            if value.is_nan() || value.abs() > self.rounding(path, atom, to) {
                return (to > root && value * side > 0.0).then_some((to, value));
            }
            if to >= limit {
                return None;
            }
            width *= 2.0;
        }
    }

    /// Looks ahead for an atom of which some variable is integrated.
    pub(super) fn look(&mut self, path: &Path, mut query: AtomQuery) -> Lookahead {
        let AtomQuery { atom, limit, sign, tolerance, .. } = query;
        let start = sign_of(sign) * self.difference(path, atom).value(query.from);
        // Most differences are far from the band, whose width then need not be computed.
        let [a, b] = [self.out[2 * atom], self.out[2 * atom + 1]];
        // `x - y` and 0 are small where `x` and `y` are not.
        let size = self.values.iter().fold(a.abs().max(b.abs()), |m, x| m.max(x.abs()));
        let is_far = start.abs() > FAR * query.error * size;
        let noise = if is_far { 0.0 } else { self.noise(path, atom, query.from) };
        // The value of a neighbour is approached only numerically, and rounding may make the sides equal at last.
        let around = path.rule.reads_context
            && !path.state.context.is_empty()
            && query.decides
            && !path.rule.jumping_whole[atom];
        let noise = if around { noise.max(BLUR * tolerance) } else { noise };
        // Equations change where their conditions do, however near that is: only a wrong sign waits.
        let in_band = start.abs() <= noise && (query.decides || start <= 0.0);
        let begins_inside = noise > tolerance && in_band;
        if begins_inside && let Some(ahead) = self.leave_band(path, &mut query, start, noise) {
            return ahead;
        }
        let next = self.root(path, atom, query.from, limit, sign, tolerance);
        if let Some(Crossing { position, at: Sign::Zero, after, .. }) = next
            && (around && after != opposite(sign))
        {
            let band = BLUR * self.noise(path, atom, position).max(tolerance);
            if self.leaves(path, AtomQuery { from: position, ..query }, band, sign).is_none() {
                return Lookahead::ends_near(true);
            }
        }
        // A crossing that leaves the domain, jumps, or touches to the last digits is not in doubt.
        let crossing = match next {
            Some(crossing) if crossing.at != Sign::Zero || crossing.after != opposite(sign) => {
                return Lookahead::crossing(next);
            }
            _ if !query.decides => {
                let near = query.near && next.is_none() && self.is_near(path, atom, limit);
                return Lookahead { next, near, doubt: None };
            }
            Some(crossing) => crossing.position,
            None => limit,
        };
        let noise = self.noise(path, atom, crossing);
        let noise = if around { noise.max(BLUR * tolerance) } else { noise };
        if noise <= tolerance {
            return Lookahead::crossing(next);
        }
        // What begins on the boundary, or near it, has no or less error there, and soon more than its distance: it does not come near,
        // it comes from there.
        if (begins_inside || start.abs() <= tolerance)
            && let Some(ahead) = self.leave_band(path, &mut query, start, noise)
        {
            return ahead;
        }
        if next.is_none()
            && let Some(ahead) = self.grow(path, &mut query, start, noise)
        {
            return ahead;
        }
        match self.approach(path, query, next, crossing, noise) {
            Some(ahead) => ahead,
            None => self.confirm(path, query, next, crossing, noise),
        }
    }

    /// True if the difference is inside the band at a position.
    fn is_near(&mut self, path: &Path, atom: usize, at: f64) -> bool {
        self.difference(path, atom).value(at).abs() <= self.noise(path, atom, at)
    }

    /// From inside the band: the crossing, the doubt or the stay that follows. None if the difference leaves the band
    /// on its own side, without doubt; `query` then begins there.
    fn leave_band(
        &mut self,
        path: &Path,
        query: &mut AtomQuery,
        start: f64,
        noise: f64,
    ) -> Option<Lookahead> {
        let AtomQuery { sign, limit, .. } = *query;
        let up = self.leaves(path, *query, noise, sign);
        let down = self.leaves(path, *query, noise, opposite(sign));
        match (up, down) {
            (None, None) => Some(Lookahead::ends_near(query.near)),
            (up, Some(down)) if up.is_none_or(|up| down < up) => {
                let position = self.crossing_inside(path, *query, start, down);
                Some(Lookahead::crossing(Some(Self::crossing_at(path, position, opposite(sign)))))
            }
            (up, _) => {
                let out = up.unwrap_or(limit);
                if query.near {
                    return Some(Lookahead::in_doubt(out));
                }
                (query.from, query.near) = (out, false);
                None
            }
        }
    }

    /// What lies ahead of a difference that is so small at first that the noise of what it grows to is larger, before it has grown beyond that; None if nothing
    /// does, or if it is no such difference. `query` then begins where it has.
    fn grow(&mut self, path: &Path, query: &mut AtomQuery, start: f64, noise: f64) -> Option<Lookahead> {
        if start <= query.tolerance || start > noise {
            return None;
        }
        let grown = self.leaves(path, *query, noise, query.sign)?;
        // There the noise is that part of this one by which values are uncertain, unless it has another reason.
        if self.noise(path, query.atom, grown) > 0.5 * noise {
            return None;
        }
        let ahead = self.look(path, AtomQuery { limit: grown, ..*query });
        if ahead.next.is_some() || ahead.doubt.is_some() {
            return Some(ahead);
        }
        (query.from, query.near) = (grown, false);
        None
    }

    /// The position of the crossing of a difference that starts inside the band and leaves it on the other side at
    /// `down`.
    fn crossing_inside(&mut self, path: &Path, query: AtomQuery, start: f64, down: f64) -> f64 {
        let AtomQuery { atom, from, sign, .. } = query;
        if start > 0.0 {
            let f = &mut self.difference(path, atom);
            first_root(f, from, down, sign, 0.0).map(|root| root.position).unwrap_or(from)
        } else if self.heads(path, query, sign) {
            // On the wrong side because of the error, and moving to the right one: it crosses on its way back.
            let f = &mut self.difference(path, atom);
            let there = first_root(f, from, down, opposite(sign), 0.0);
            let back = there.and_then(|root| first_root(f, root.position, down, sign, 0.0));
            back.map_or(down, |root| root.position)
        } else {
            from
        }
    }

    /// A doubt before the crossing, or before the limit if there is no crossing: the difference enters the band and
    /// leaves it again, or stays in it. None if the crossing itself has to be confirmed.
    fn approach(
        &mut self,
        path: &Path,
        query: AtomQuery,
        next: Option<Crossing>,
        crossing: f64,
        noise: f64,
    ) -> Option<Lookahead> {
        let AtomQuery { atom, from, sign, .. } = query;
        let bounds = self.difference(path, atom).bounds(from, crossing);
        let monotonic = !bounds.rate.partial && (bounds.rate.lo > 0.0 || bounds.rate.hi < 0.0);
        if next.is_some() && monotonic {
            return None;
        }
        let before = AtomQuery { limit: crossing, ..query };
        let Some(enters) = self.falls_below(path, before, noise) else {
            return next.is_none().then(Lookahead::default);
        };
        let inside = AtomQuery { from: enters, ..before };
        if let Some(out) = self.leaves(path, inside, noise, sign) {
            return Some(Lookahead::in_doubt(out));
        }
        next.is_none().then(|| Lookahead::ends_near(true))
    }

    /// The crossing, if the difference goes on to the other side of the band; else a doubt, or a stay inside the band.
    fn confirm(
        &mut self,
        path: &Path,
        query: AtomQuery,
        next: Option<Crossing>,
        crossing: f64,
        noise: f64,
    ) -> Lookahead {
        let AtomQuery { atom, limit, sign, .. } = query;
        if sign_of(sign) * self.difference(path, atom).value(limit) < -noise {
            return Lookahead::crossing(next);
        }
        let beyond = AtomQuery { from: crossing, ..query };
        let down = self.leaves(path, beyond, noise, opposite(sign));
        match (down, self.leaves(path, beyond, noise, sign)) {
            (Some(down), up) if up.is_none_or(|up| down < up) => Lookahead::crossing(next),
            (_, Some(out)) => Lookahead::in_doubt(out),
            // The path ends too soon for a decision. A difference that passes as fast as it came does not stay.
            _ if self.passes(path, AtomQuery { limit: crossing, ..query }, noise) => {
                Lookahead::crossing(next)
            }
            _ => Lookahead::ends_near(true),
        }
    }

    /// What lies ahead instead, if a crossing of sides that approach each other without limit (two cells with one equilibrium) is one of the error of
    /// integration, or of rounding, and the equations would take it for a reason to part: a switch makes the rates jump that way, many times faster than
    /// the sides have come. They stay near each other.
    pub(super) fn crosses_by_error(
        &mut self,
        path: &Path,
        query: AtomQuery,
        crossing: Crossing,
        now: &[Sign],
    ) -> Option<Lookahead> {
        let AtomQuery { atom, sign, tolerance, .. } = query;
        let Crossing { position, at, after, .. } = crossing;
        let around = path.rule.reads_context && !path.state.context.is_empty();
        // Rounding may make values of neighbours equal at last.
        let ends_equal = around && after == Sign::Zero && matches!(sign, Sign::Plus | Sign::Minus);
        if at != Sign::Zero || after != opposite(sign) && !ends_equal {
            return None;
        }
        let change = switched::change_of_rate(path, atom, position, now, after)?;
        let (lo, hi) = ((position - NEARBY).max(0.0), (position + NEARBY).min(1.0));
        let rate = self.difference(path, atom).bounds(lo, hi).rate;
        let parts = -sign_of(sign) * change > SLOW * rate.magnitude();
        // Equations that end where they change are not continued.
        if !parts || !switched::is_defined(path, query.limit) {
            return None;
        }
        let noise = self.noise(path, atom, position);
        let band = if around { noise.max(BLUR * tolerance) } else { noise };
        if band <= tolerance {
            return None;
        }
        let ahead = self.confirm(path, query, Some(crossing), position, band);
        // What is known to the last digits touches where it seems to.
        let is_uncertain = noise > tolerance;
        let stays = ahead.next.is_none() && (is_uncertain || ahead.near);
        stays.then(|| Lookahead::ends_near(is_uncertain))
    }

    /// True if the difference comes from outside the band on this path and crosses zero, at the limit, at a steady
    /// rate. A difference that only approaches zero is slower the nearer it is.
    fn passes(&mut self, path: &Path, query: AtomQuery, noise: f64) -> bool {
        let Some(enters) = self.falls_below(path, query, noise) else { return false };
        let crossing = query.limit;
        let rate = self.difference(path, query.atom).bounds(enters, crossing).rate;
        let speed = (-sign_of(query.sign) * rate.lo).min(-sign_of(query.sign) * rate.hi);
        !rate.partial && speed * (crossing - enters) > STEADY * noise
    }

    /// True if the difference moves towards a side at first.
    fn heads(&mut self, path: &Path, query: AtomQuery, towards: Sign) -> bool {
        let end = (query.from + NEARBY).min(query.limit);
        let rate = self.difference(path, query.atom).bounds(query.from, end).rate;
        !rate.partial && sign_of(towards) * rate.lo > 0.0 && sign_of(towards) * rate.hi > 0.0
    }

    /// The position at which the difference, on its side, falls below the noise.
    fn falls_below(&mut self, path: &Path, query: AtomQuery, noise: f64) -> Option<f64> {
        let AtomQuery { atom, from, limit, sign, tolerance, .. } = query;
        let f = &mut self.difference(path, atom);
        let root = first_root(&mut Raised(f, -sign_of(sign) * noise), from, limit, sign, tolerance)?;
        (root.after == opposite(sign)).then_some(root.position)
    }

    /// The position at which the difference leaves the band on a side.
    fn leaves(&mut self, path: &Path, query: AtomQuery, noise: f64, towards: Sign) -> Option<f64> {
        let AtomQuery { atom, from, limit, tolerance, .. } = query;
        let f = &mut self.difference(path, atom);
        let raised = &mut Raised(f, -sign_of(towards) * noise);
        let mut from = from;
        // A touch of the edge of the band does not leave it.
        for _ in 0..8 {
            let root = first_root(raised, from, limit, opposite(towards), tolerance)?;
            if root.after == towards || root.position <= from {
                return (root.after == towards).then_some(root.position);
            }
            from = root.position;
        }
        None
    }

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
        let is_tiny = path.reads_others()
            && width < path.error() * NEXT_TO_NOTHING
            && may_be_nothing(a)
            && may_be_nothing(b);
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

    /// How far the sides of an atom are apart at the start of a path, as a part of `factor` times the error of integration, if that is no more than 1
    /// and they approach each other over the path.
    pub fn about_to_meet(&mut self, path: &Path, atom: usize, sign: Sign, factor: f64) -> Option<f64> {
        let gap = sign_of(sign) * self.difference(path, atom).value(0.0);
        let error = path.error().max(f64::EPSILON);
        if gap > FAR * factor * error * (1.0 + gap) {
            return None;
        }
        let noise = factor * self.noise(path, atom, 0.0);
        let rate = self.difference(path, atom).bounds(0.0, 1.0).rate;
        let approaches = sign_of(sign) * rate.lo < 0.0 && sign_of(sign) * rate.hi < 0.0;
        (gap <= noise && approaches).then(|| if gap > 0.0 { gap / noise } else { 0.0 })
    }

    /// A crossing at a position.
    fn crossing_at(path: &Path, position: f64, after: Sign) -> Crossing {
        let time = path.start.after(position * path.h);
        Crossing { position, time, at: Sign::Zero, after, level: None }
    }

    /// How much earlier or later a crossing may be because of the errors of integration, in units of position.
    pub(super) fn slack(&mut self, path: &Path, atom: usize, position: f64) -> f64 {
        let noise = self.noise(path, atom, position);
        let (lo, hi) = ((position - NEARBY).max(0.0), (position + NEARBY).min(1.0));
        let Dual { rate, .. } = self.difference(path, atom).bounds(lo, hi);
        let speed = rate.lo.abs().min(rate.hi.abs());
        if rate.partial || rate.lo.is_nan() || rate.lo * rate.hi <= 0.0 {
            return 0.0;
        }
        // Not more than a small part of the time in which the solution changes.
        (noise / speed).min(10.0 * path.error())
    }
}
