//! The search of a stretch of time for a module's next event.
//!
//! The signs of the rule's atoms are known at the start. NextKind is looked for is the first instant at which a change of
//! signs matters: a production's condition becomes true, the active equations' condition ends, or a condition inside
//! them changes. Where a formula gives the instant it is taken; elsewhere the stretch is searched.

use smallvec::SmallVec;

use crate::detect::doubt::{Ahead, Question};
use crate::detect::signs::{Reach, matters, opposite, produces, rate_at, reach, sign_of};
use crate::world::path::Path;
use crate::world::state::{Change, Signs, State};
use dlsys_expr::{Binary, Dual, Interval, Program, Scratch, Value};
use dlsys_model::{Rule, Sign, ZeroCrossing};
use dlsys_ode::{Function, Root, first_root};
use dlsys_tree::SimTime;

/// Zero, for a difference of two sides, in units of their rounding.
pub const TOUCH: f64 = 256.0 * f64::EPSILON;

/// A difference of two sides of no more than this part of them, or of 1, may be what numerical trajectories leave of zero.
const NOISE: f64 = 1e-10;

/// Most changes of a module's signs that are followed within one stretch.
const MAX_ROUNDS: usize = 50;

/// NextKind a search found.
#[derive(Clone, Debug, Default)]
pub struct Found {
    /// Position of the event, if there is one.
    pub event: Option<f64>,
    /// Signs that are zero at the event, the first one first.
    pub touched: SmallVec<[Change; 1]>,
    /// Signs that change without consequence before it, or before the end.
    pub changes: Vec<Change>,
    /// It is not known whether there is one.
    pub in_doubt: bool,
    /// As in [`Next`](super::state::Next).
    pub near: u64,
}

/// Working memory of searches.
#[derive(Clone, Debug, Default)]
pub struct CrossingDetector {
    pub values: Vec<f64>,
    departure: Vec<Dual<f64>>,
    whole: Vec<Interval>,
    bounds: Vec<Dual<Interval>>,
    scratch: Scratch<f64>,
    departure_scratch: Scratch<Dual<f64>>,
    pub whole_scratch: Scratch<Interval>,
    pub around: Vec<Interval>,
    pub around_out: Vec<Interval>,
    bounds_scratch: Scratch<Dual<Interval>>,
    pub out: Vec<f64>,
    departure_out: Vec<Dual<f64>>,
    whole_out: Vec<Interval>,
    bounds_out: Vec<Dual<Interval>>,
    rates: Vec<f64>,
}

/// An atom under watch.
struct Watched {
    atom: usize,
    /// NextKind counts as zero; NaN for those whose instant is a formula.
    tolerance: f64,
    ahead: Ahead,
}

/// An instant at which the sides of an atom meet.
#[derive(Clone, Copy, Debug)]
pub struct Crossing {
    pub position: f64,
    pub time: SimTime,
    pub at: Sign,
    pub after: Sign,
    pub level: Option<(usize, f64)>,
}

/// The difference of two sides of an atom along a path.
pub struct Difference<'w, 'p> {
    path: &'w Path<'p>,
    sides: &'w Program,
    atom: usize,
    memory: &'w mut CrossingDetector,
}

impl Function for Difference<'_, '_> {
    fn bounds(&mut self, lo: f64, hi: f64) -> Dual<Interval> {
        // Values that move together may differ by much less than each of them moves.
        if let ZeroCrossing::Search(Some(sum)) =
            &self.path.rule.zero_crossings(self.path.state.solve)[self.atom]
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
}

/// True if some atom of a module can only be found by search, so that the stretch must have an end.
pub fn needs_search(state: &State, rule: &Rule) -> bool {
    rule.zero_crossings(state.solve)
        .iter()
        .enumerate()
        .any(|(atom, watch)| !is_unreachable(rule, state, atom) && matches!(how(watch, state), How::Search))
}

fn is_unreachable(rule: &Rule, state: &State, atom: usize) -> bool {
    state.solve.is_some_and(|s| rule.solves[s].unreachable[atom])
}

enum How<'w> {
    Not,
    Formula(usize, &'w Program),
    Search,
}

/// How an atom is watched, given how the parameters move.
fn how<'w>(watch: &'w ZeroCrossing, state: &State) -> How<'w> {
    match watch {
        ZeroCrossing::Constant => How::Not,
        ZeroCrossing::Formula { variable, level } => match state.trajectories.get(*variable) {
            Some(trajectory) if !trajectory.is_formula() => How::Search,
            _ => How::Formula(*variable, level),
        },
        ZeroCrossing::Search(_) => How::Search,
    }
}

impl CrossingDetector {
    /// Searches the path up to the position `limit`.
    pub fn search(&mut self, path: &Path, limit: f64) -> Found {
        let (rule, state) = (path.rule, path.state);
        let mut found = Found::default();
        if rule.atoms.is_empty() {
            return found;
        }
        let mut now = Signs::from_slice(&state.signs);
        for change in &state.next.changes {
            now[change.atom] = change.after;
        }
        let mut watched: SmallVec<[Watched; 4]> = SmallVec::new();
        let mut measured = false;
        // Where nothing is integrated, all is known to the last digits.
        let error = path.error();
        let integrated = error > 0.0;
        let near = state.next.near;
        for (atom, watch) in rule.zero_crossings(state.solve).iter().enumerate() {
            if is_unreachable(rule, state, atom) {
                continue;
            }
            match how(watch, state) {
                How::Not => {}
                How::Formula(variable, level) => {
                    let next =
                        self.meet(path, atom, variable, level, now[atom]).filter(|m| m.position <= limit);
                    if next.is_some() {
                        let ahead = Ahead { next, ..Ahead::default() };
                        watched.push(Watched { atom, tolerance: f64::NAN, ahead });
                    }
                }
                How::Search => {
                    if self.keeps_clear(path, watch, now[atom], error) {
                        continue;
                    }
                    if !std::mem::replace(&mut measured, true) {
                        self.measure(path);
                    }
                    if let Some(tolerance) = self.may_change(path, atom, now[atom]) {
                        let near = atom < 64 && near & 1 << atom != 0;
                        let decides = integrated && produces(rule, &now, atom);
                        let question = Question {
                            atom,
                            from: 0.0,
                            limit,
                            sign: now[atom],
                            tolerance,
                            near,
                            decides,
                            error,
                        };
                        let ahead = self.ahead(path, question);
                        watched.push(Watched { atom, tolerance, ahead });
                    }
                }
            }
        }
        let mut rounds = 0;
        loop {
            let first =
                watched.iter().filter_map(|w| w.ahead.next).min_by(|a, b| a.position.total_cmp(&b.position));
            let doubts = watched.iter().enumerate().filter_map(|(i, w)| Some((i, w.ahead.doubt?)));
            let doubt = doubts.min_by(|(_, a), (_, b)| a.total_cmp(b));
            if let Some((i, position)) = doubt
                && first.is_none_or(|first| position < first.position)
            {
                let atom = watched[i].atom;
                if produces(rule, &now, atom) {
                    let (time, at, after) = (path.start.after(position * path.h), Sign::Zero, now[atom]);
                    found.event = Some(position);
                    found.touched.push(Change { atom, time, at, after, level: None });
                    found.in_doubt = true;
                    return found;
                }
                let (sign, tolerance, decides) = (now[atom], watched[i].tolerance, true);
                let question =
                    Question { atom, from: position, limit, sign, tolerance, near: false, decides, error };
                rounds += 1;
                watched[i].ahead = match rounds > MAX_ROUNDS {
                    true => Ahead::default(),
                    false => self.ahead(path, question),
                };
                continue;
            }
            let Some(first) = first else { break };
            rounds += 1;
            let mut together = path_together(path, first.position);
            let others = watched.iter().filter(|w| w.ahead.next.is_some()).count();
            if integrated && others > 1 && !first_is_exact(&watched, first.position) {
                let atom =
                    watched.iter().find(|w| w.ahead.next.is_some_and(|m| m.position == first.position));
                together = together
                    .max(first.position + atom.map_or(0.0, |w| self.slack(path, w.atom, first.position)));
            }
            let (mut at, mut after) = (Signs::from_slice(&now), Signs::from_slice(&now));
            let mut group: SmallVec<[Change; 1]> = SmallVec::new();
            for w in &watched {
                // A touch is known only to about the root of the rounding; one that is zero here is here.
                let mut zero = || self.difference(path, w.atom).value(first.position).abs() <= w.tolerance;
                let here = match &w.ahead.next {
                    Some(crossing) if crossing.position <= together => Some(*crossing),
                    _ if w.tolerance.is_nan() => None,
                    Some(crossing) if crossing.after == now[w.atom] && zero() => {
                        Some(Crossing { at: Sign::Zero, time: first.time, ..*crossing })
                    }
                    None if now[w.atom] != Sign::Zero && zero() => {
                        Some(Crossing { at: Sign::Zero, after: now[w.atom], level: None, ..first })
                    }
                    _ => None,
                };
                if let Some(m) = here {
                    (at[w.atom], after[w.atom]) = (m.at, m.after);
                    let time = if m.position <= first.position { first.time } else { m.time };
                    group.push(Change { atom: w.atom, time, at: m.at, after: m.after, level: m.level });
                }
            }
            // A condition that oscillates without end is cut into short stretches, each of bounded work.
            if matters(rule, state, &at, &after) || rounds > MAX_ROUNDS {
                found.event = Some(first.position);
                group.sort_by(|a, b| a.time.since(b.time).total_cmp(&0.0));
                found.touched = group;
                return found;
            }
            now = after;
            for w in &mut watched {
                if group.iter().any(|change| change.atom == w.atom) {
                    let from = w.ahead.next.map_or(first.position, |m| m.position.max(first.position));
                    // One that moves one way only meets its level once.
                    w.ahead = if w.tolerance.is_nan() {
                        Ahead::default()
                    } else {
                        let (atom, tolerance) = (w.atom, w.tolerance);
                        let decides = integrated && produces(rule, &now, atom);
                        let question = Question {
                            atom,
                            from,
                            limit,
                            sign: now[atom],
                            tolerance,
                            near: false,
                            decides,
                            error,
                        };
                        self.ahead(path, question)
                    };
                }
            }
            found.changes.extend(group);
        }
        for w in watched.iter().filter(|w| w.ahead.near && w.atom < 64) {
            found.near |= 1 << w.atom;
        }
        found
    }

    /// Looks ahead for an atom.
    fn ahead(&mut self, path: &Path, question: Question) -> Ahead {
        if question.error > 0.0 && matches!(question.sign, Sign::Plus | Sign::Minus) {
            return self.look(path, question);
        }
        let Question { atom, from, limit, sign, tolerance, .. } = question;
        Ahead { next: self.root(path, atom, from, limit, sign, tolerance), ..Ahead::default() }
    }

    /// True if a parameter that is integrated stays away from the one value at which its atom's sides meet: most steps
    /// need no more than a look at its bounds.
    fn keeps_clear(&mut self, path: &Path, watch: &ZeroCrossing, sign: Sign, error: f64) -> bool {
        let ZeroCrossing::Formula { variable, level } = watch else { return false };
        if !matches!(sign, Sign::Plus | Sign::Minus) {
            return false;
        }
        let Some(bounds) = path.dense_bounds(*variable) else { return false };
        let level = self.level(path, level);
        let margin = error.max(1e-9) * (level.abs() + bounds.magnitude());
        level < bounds.lo - margin || level > bounds.hi + margin
    }

    /// The value at which the sides of an atom meet.
    fn level(&mut self, path: &Path, level: &Program) -> f64 {
        if let Some(&[level]) = level.constants() {
            return level;
        }
        path.at(0.0, &mut self.values);
        let mut out = [0.0];
        level.eval(&self.values, &mut self.scratch, &mut out);
        out[0]
    }

    pub fn difference<'w, 'p>(&'w mut self, path: &'w Path<'p>, atom: usize) -> Difference<'w, 'p> {
        Difference { path, sides: &path.rule.sides, atom, memory: self }
    }

    pub fn root(
        &mut self,
        path: &Path,
        atom: usize,
        from: f64,
        limit: f64,
        sign: Sign,
        tolerance: f64,
    ) -> Option<Crossing> {
        // The sign that a boundary was left with is believed against values that are rounding, and against a jump that
        // comes within the rounding of time.
        let (mut from, mut tolerance) = (from, tolerance);
        let start = self.difference(path, atom).value(from);
        if sign != Sign::Any && start != 0.0 && start * sign_of(sign) <= 0.0 {
            let size = self.out[2 * atom].abs().max(1.0);
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
        let Root { position, at, after } =
            first_root(&mut self.difference(path, atom), from, limit, sign, tolerance)?;
        let time = path.start.after(position * path.h);
        Some(Crossing { position, time, at, after, level: None })
    }

    /// NextKind rounding of the variables makes of the difference of two sides.
    fn rounding(&mut self, path: &Path, atom: usize, at: f64) -> f64 {
        path.over(at, at, &mut self.bounds);
        for variable in &mut self.bounds {
            let width = 64.0 * f64::EPSILON * variable.value.magnitude();
            variable.value.lo -= width;
            variable.value.hi += width;
        }
        let sides = &path.rule.sides;
        self.bounds_out.resize(sides.outputs(), Dual::constant(0.0));
        sides.eval(&self.bounds, &mut self.bounds_scratch, &mut self.bounds_out);
        let [a, b] = [0, 1].map(|side| self.bounds_out[2 * atom + side].value);
        let width = (a.hi - a.lo) + (b.hi - b.lo);
        // More than that is a jump.
        let size = a.magnitude().max(b.magnitude()).max(1.0);
        if width <= NOISE * size { width } else { 0.0 }
    }

    /// When a variable that moves one way only takes the value at which its atom's sides meet.
    fn meet(
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
        let trajectory = path.state.trajectories.get(variable);
        let start = trajectory.map_or(0.0, |_| path.world.tree.parameters(path.state.id)[variable]);
        let clause = path.state.solve.map(|s| &path.rule.solves[s]);
        let (values, scratch, rates) = (&mut self.values, &mut self.scratch, &mut self.rates);
        let exact = || {
            path.start(values);
            values.extend(path.state.switches.iter().map(|&on| f64::from(u8::from(on))));
            rate_at(clause, values, variable, level, scratch, rates)
        };
        let time = match reach(variable, t, level, trajectory, start, exact)? {
            Reach::At(time) => time,
            Reach::Age(age) => path.world.tree.birth(path.state.id).after(age),
            Reach::After(tau) => path.state.since.after(tau),
        };
        let position = time.since(path.start) / path.h;
        let level = (variable < t).then_some((variable, level));
        let after = opposite(sign);
        let crossing = Crossing { position, time, at: Sign::Zero, after, level };
        if position > path.start.resolution() / path.h {
            return Some(crossing);
        }
        // Here, but for rounding, or already behind: an instant that has been passed, or one that fell on the very end
        // of the stretch before this one and was not seen? The difference goes towards zero, or away from it.
        path.departure(&mut self.departure);
        self.departure_out.resize(path.rule.sides.outputs(), Dual::constant(0.0));
        path.rule.sides.eval(&self.departure, &mut self.departure_scratch, &mut self.departure_out);
        let slope = self.departure_out[2 * atom].rate - self.departure_out[2 * atom + 1].rate;
        if Sign::of(slope) != crossing.after {
            return None;
        }
        let time = if position > 0.0 { time } else { path.start };
        Some(Crossing { position: position.max(0.0), time, ..crossing })
    }

    /// Values at the start and bounds over the whole path: most atoms keep their sign on most paths.
    fn measure(&mut self, path: &Path) {
        let sides = &path.rule.sides;
        path.whole(&mut self.whole);
        self.whole_out.resize(sides.outputs(), Interval::EMPTY);
        sides.eval(&self.whole, &mut self.whole_scratch, &mut self.whole_out);
        path.departure(&mut self.departure);
        self.departure_out.resize(sides.outputs(), Dual::constant(0.0));
        sides.eval(&self.departure, &mut self.departure_scratch, &mut self.departure_out);
    }

    /// Whether an atom's sign may change, judged by its bounds over the whole path; and what counts as zero, on the
    /// scale of the start, not of the far end: a stretch may be a thousand lives long.
    fn may_change(&self, path: &Path, atom: usize, sign: Sign) -> Option<f64> {
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

/// The last position that is the same instant as this one.
pub fn path_together(path: &Path, position: f64) -> f64 {
    position + path.start.after(position * path.h).resolution() / path.h
}

/// True if what comes first is known by a formula.
fn first_is_exact(watched: &[Watched], position: f64) -> bool {
    watched.iter().any(|w| w.tolerance.is_nan() && w.ahead.next.is_some_and(|m| m.position == position))
}
