//! The search of a stretch of time for a module's next event.
//!
//! The signs of the rule's atoms are known at the start of the stretch. An event is the first instant at which a change
//! of signs has a consequence: the condition of a production becomes true, the condition of the active equations ends,
//! or a condition inside them changes. Changes without consequence are recorded on the way.
//!
//! ```text
//! track_atoms ─▶ which atoms may change, and the first crossing or doubt of each   ([`crossing`], [`doubt`])
//! follow      ─▶ from one crossing to the next, until one has a consequence or none is left
//! ```
//!
//! [`crossing`]: super::crossing
//! [`doubt`]: super::doubt

use smallvec::SmallVec;

use crate::detect::crossing::{Crossing, CrossingDetector, LocationMethod, location_method, reachable};
use crate::detect::doubt::{AtomQuery, Lookahead};
use crate::detect::level::{LevelFinding, LevelQuery};
use crate::detect::limit::Arrival;
use crate::detect::signs::{matters, produces};
use crate::detect::switched;
use crate::world::path::Path;
use crate::world::state::{Change, Signs};
use dlsys_expr::Program;
use dlsys_model::Sign;
use dlsys_ode::Function;

/// Most changes of a module's signs that are followed within one stretch.
const MAX_ROUNDS: usize = 50;

/// The outcome of a search.
#[derive(Clone, Debug, Default)]
pub struct SearchResult {
    /// Position of the event on the path, in units of its length, if there is one.
    pub event: Option<f64>,
    /// Signs that are zero at the event, the earliest first.
    pub touched: SmallVec<[Change; 1]>,
    /// Signs that change without consequence before the event, or before the end of the path.
    pub changes: Vec<Change>,
    /// The error of integration does not decide whether the event takes place.
    pub in_doubt: bool,
    /// Atoms, one bit each, whose sides are too near each other at the end for their sign to be known; as in
    /// [`Next`](crate::world::state::Next).
    pub near: u64,
}

impl SearchResult {
    /// True if the path has no event, nothing changes on it, and no sides come near each other.
    pub fn is_nothing(&self) -> bool {
        self.event.is_none() && self.changes.is_empty() && self.near == 0
    }
}

/// An atom whose sign may change on the path.
struct TrackedAtom {
    atom: usize,
    /// Up to this the difference counts as zero; NaN where the instant is known by a formula.
    tolerance: f64,
    ahead: Lookahead,
}

impl TrackedAtom {
    fn is_exact(&self) -> bool {
        self.tolerance.is_nan()
    }
}

/// The atoms whose crossings coincide with the first one: the signs at the instant and just after it, and their changes.
struct Coincidence {
    at: Signs,
    after: Signs,
    group: SmallVec<[Change; 1]>,
}

/// Positions that are indistinguishable from that of a first crossing.
struct Together {
    /// The last one, given the resolution of time.
    instant: f64,
    /// The last one, given the error of integration.
    uncertain: f64,
    /// The atom that crosses first, if its values are integrated.
    atom: Option<usize>,
}

/// A search in progress.
struct Search<'s, 'p> {
    detector: &'s mut CrossingDetector,
    path: &'s Path<'p>,
    /// The position up to which the path is searched.
    limit: f64,
    /// The relative error of integrated values; 0 where nothing is integrated, so that all is known to the last digits.
    error: f64,
    /// The signs just after the last change.
    now: Signs,
    tracked: SmallVec<[TrackedAtom; 4]>,
    /// Changes that have been followed.
    rounds: usize,
}

impl CrossingDetector {
    /// Searches a path up to the position `limit`, in units of its length.
    pub fn search(&mut self, path: &Path, limit: f64) -> SearchResult {
        let (rule, state) = (path.rule, path.state);
        if rule.atoms.is_empty() {
            return SearchResult::default();
        }
        let mut now: Signs = state.marks.signs().into();
        for change in state.next.changes() {
            now[change.atom()] = change.after;
        }
        let error = path.error();
        let mut search =
            Search { detector: self, path, limit, error, now, tracked: SmallVec::new(), rounds: 0 };
        search.track_atoms();
        search.follow()
    }
}

impl Search<'_, '_> {
    fn is_integrated(&self) -> bool {
        self.error > 0.0
    }

    /// Finds the atoms whose sign may change, with the first crossing of each.
    #[inline]
    fn track_atoms(&mut self) {
        let (path, rule, state) = (self.path, self.path.rule, self.path.state);
        let mut measured = false;
        for (atom, crossing) in reachable(rule, state) {
            match location_method(crossing, state) {
                LocationMethod::Never => {}
                LocationMethod::Formula(variable, level) => self.track_formula(atom, variable, level),
                LocationMethod::Search => {
                    if self.detector.keeps_clear(path, crossing, self.now[atom], self.error) {
                        continue;
                    }
                    if self.track_level(atom) {
                        continue;
                    }
                    if !std::mem::replace(&mut measured, true) {
                        self.detector.measure(path);
                    }
                    if let Some(tolerance) = self.detector.may_change(path, atom, self.now[atom]) {
                        let tolerance = self.detector.away_from_pole(path, atom, tolerance);
                        let near = atom < 64 && state.next.near() & 1 << atom != 0;
                        let decides = self.decides(atom);
                        let ahead = self.look_ahead(atom, tolerance, 0.0, near, decides);
                        let ahead = self.but_for_limits(atom, ahead);
                        self.tracked.push(TrackedAtom { atom, tolerance, ahead });
                    }
                }
            }
        }
    }

    /// Tracks an atom whose crossing is known by a formula, if it lies on the path.
    #[inline]
    fn track_formula(&mut self, atom: usize, variable: usize, level: &Program) {
        let next = self.detector.meet(self.path, atom, variable, level, self.now[atom]);
        let next = next.filter(|crossing| crossing.position <= self.limit);
        if next.is_some() {
            let ahead = Lookahead { next, ..Lookahead::default() };
            self.tracked.push(TrackedAtom { atom, tolerance: f64::NAN, ahead });
        }
    }

    /// Tracks an atom that compares an integrated parameter with a number, if it changes on the path; false if more has to be asked.
    fn track_level(&mut self, atom: usize) -> bool {
        let query = LevelQuery { atom, sign: self.now[atom], limit: self.limit, decides: self.decides(atom) };
        match self.detector.plain_crossing(self.path, query) {
            LevelFinding::Nothing => true,
            LevelFinding::Ahead(tolerance, ahead) => {
                let ahead = self.but_for_limits(atom, ahead);
                self.tracked.push(TrackedAtom { atom, tolerance, ahead });
                true
            }
            LevelFinding::Unclear => false,
        }
    }

    /// True if a production may depend on an atom that is integrated, so that doubts about it have to be reported.
    fn decides(&self, atom: usize) -> bool {
        self.is_integrated()
            && (produces(self.path.rule, &self.now, atom) || switched::may_decide(self.path, atom))
    }

    /// True if a production depends on the sign of an atom at a position by way of a value. Next to nothing it has none.
    fn decides_by_value(&mut self, atom: usize, position: f64) -> bool {
        if !switched::decides(self.path, atom, position, &self.now) {
            return false;
        }
        let there = self.detector.difference(self.path, atom).value(position).abs();
        there > self.detector.least_noise(self.path, atom, position)
    }

    /// What lies ahead of an atom, but for limits, at which nothing ever arrives.
    fn but_for_limits(&mut self, atom: usize, ahead: Lookahead) -> Lookahead {
        let sign = self.now[atom];
        let place = ahead.next.map(|crossing| crossing.position).or(ahead.doubt);
        let Some(position) = place.or(ahead.near.then_some(self.limit)) else { return ahead };
        if !matches!(sign, Sign::Plus | Sign::Minus) {
            return ahead;
        }
        match self.detector.arrival(self.path, atom, position, sign) {
            Arrival::Never => Lookahead::default(),
            Arrival::Unclear if ahead.next.is_none() => Lookahead::in_doubt(position),
            _ => ahead,
        }
    }

    /// The first crossing or doubt of an atom from a position on.
    fn look_ahead(&mut self, atom: usize, tolerance: f64, from: f64, near: bool, decides: bool) -> Lookahead {
        let (limit, sign, error) = (self.limit, self.now[atom], self.error);
        // Sides that follow formulas are known to the last digits, whatever else the module reads.
        let is_integrated = self.is_integrated() && self.path.is_integrated(&self.path.rule.atom_reads[atom]);
        if is_integrated && matches!(sign, Sign::Plus | Sign::Minus) {
            let query = AtomQuery { atom, from, limit, sign, tolerance, near, decides, error };
            return self.detector.look(self.path, query);
        }
        // A step may begin where a formula has come back to zero from a value whose rounding is larger.
        let tolerance = match self.is_integrated() {
            true => tolerance.max(self.detector.noise(self.path, atom, from)),
            false => tolerance,
        };
        let next = self.detector.root(self.path, atom, from, limit, sign, tolerance);
        Lookahead { next, ..Lookahead::default() }
    }

    /// Follows the crossings of the tracked atoms one after another, up to the first that has a consequence.
    fn follow(&mut self) -> SearchResult {
        let mut result = SearchResult::default();
        loop {
            let crossings = self.tracked.iter().filter_map(|t| t.ahead.next);
            let first = crossings.min_by(|a, b| a.position.total_cmp(&b.position));
            if let Some((index, position)) = self.first_doubt()
                && first.is_none_or(|first| position < first.position)
            {
                let atom = self.tracked[index].atom;
                if produces(self.path.rule, &self.now, atom) || self.decides_by_value(atom, position) {
                    let (time, at) = (self.path.start.after(position * self.path.h), Sign::Zero);
                    let after = self.now[atom];
                    result.event = Some(position);
                    result.touched.push(Change::new(atom, time, [at, after]));
                    result.in_doubt = true;
                    return result;
                }
                self.pass_doubt(index, position);
                continue;
            }
            let Some(first) = first else { break };
            self.rounds += 1;
            if let Some((index, ahead)) = self.by_error(first) {
                self.tracked[index].ahead = ahead;
                continue;
            }
            let Coincidence { at, after, mut group } = self.coincidence(first);
            // A condition that oscillates without end is cut into short stretches, each of bounded work.
            if matters(self.path.rule, self.path.state, &at, &after) || self.rounds > MAX_ROUNDS {
                result.event = Some(first.position);
                group.sort_by(|a, b| a.time.since(b.time).total_cmp(&0.0));
                result.touched = group;
                return result;
            }
            self.now = after;
            self.pass_changes(&group, first.position);
            result.changes.extend(group);
        }
        for tracked in self.tracked.iter().filter(|t| t.ahead.near && t.atom < 64) {
            result.near |= 1 << tracked.atom;
        }
        result
    }

    /// The tracked atom, by its index, that crosses first, if it does so by an error only and keeps its sign, and what lies ahead of it then.
    fn by_error(&mut self, first: Crossing) -> Option<(usize, Lookahead)> {
        let is_first = |t: &TrackedAtom| t.ahead.next.is_some_and(|c| c.position == first.position);
        let index = self.tracked.iter().position(is_first)?;
        let TrackedAtom { atom, tolerance, .. } = self.tracked[index];
        let decides = || produces(self.path.rule, &self.now, atom) || switched::may_decide(self.path, atom);
        if self.tracked[index].is_exact() || decides() {
            return None;
        }
        let (limit, sign, error) = (self.limit, self.now[atom], self.error);
        let query = AtomQuery { atom, from: 0.0, limit, sign, tolerance, near: false, decides: false, error };
        Some((index, self.detector.crosses_by_error(self.path, query, first, &self.now)?))
    }

    /// The tracked atom with the earliest doubt, by its index, and the position of that.
    #[inline]
    fn first_doubt(&self) -> Option<(usize, f64)> {
        let doubts = self.tracked.iter().enumerate().filter_map(|(i, t)| Some((i, t.ahead.doubt?)));
        doubts.min_by(|(_, a), (_, b)| a.total_cmp(b))
    }

    /// Goes on behind a doubt from which nothing follows.
    fn pass_doubt(&mut self, index: usize, position: f64) {
        let TrackedAtom { atom, tolerance, .. } = self.tracked[index];
        self.rounds += 1;
        self.tracked[index].ahead = match self.rounds > MAX_ROUNDS {
            true => Lookahead::default(),
            false => self.look_ahead(atom, tolerance, position, false, true),
        };
    }

    /// The changes of sign that belong to the instant of the first crossing.
    fn coincidence(&mut self, first: Crossing) -> Coincidence {
        let Together { instant, uncertain, atom: leader } = self.together(first.position);
        let together: SmallVec<[f64; 4]> = (self.tracked.iter())
            .map(|t| {
                if leader.is_some_and(|first| self.share_uncertainty(first, t.atom)) {
                    uncertain
                } else {
                    instant
                }
            })
            .collect();
        let (mut at, mut after) = (self.now.clone(), self.now.clone());
        let mut group: SmallVec<[Change; 1]> = SmallVec::new();
        let Search { detector, path, now, tracked, .. } = self;
        for (tracked, together) in tracked.iter().zip(together) {
            let atom = tracked.atom;
            // The instant of a touch is known only to about the square root of the rounding: a difference that is zero
            // here touches here.
            let mut is_zero =
                || detector.difference(path, atom).value(first.position).abs() <= tracked.tolerance;
            let here = match &tracked.ahead.next {
                Some(crossing) if crossing.position <= together => Some(*crossing),
                _ if tracked.is_exact() => None,
                Some(crossing) if crossing.after == now[atom] && is_zero() => {
                    Some(Crossing { at: Sign::Zero, time: first.time, ..*crossing })
                }
                None if now[atom] != Sign::Zero && is_zero() => {
                    Some(Crossing { at: Sign::Zero, after: now[atom], level: None, ..first })
                }
                _ => None,
            };
            if let Some(crossing) = here {
                (at[atom], after[atom]) = (crossing.at, crossing.after);
                let time = if crossing.position <= first.position { first.time } else { crossing.time };
                let (at, after, level) = (crossing.at, crossing.after, crossing.level);
                group.push(Change::new(atom, time, [at, after]).at_level(level));
            }
        }
        Coincidence { at, after, group }
    }

    /// The last positions that are indistinguishable from that of the first crossing.
    fn together(&mut self, first: f64) -> Together {
        let instant = first + self.path.start.after(first * self.path.h).resolution() / self.path.h;
        let crosses_first = |t: &TrackedAtom| t.ahead.next.is_some_and(|c| c.position == first);
        let crossing = self.tracked.iter().filter(|t| t.ahead.next.is_some()).count();
        let first_is_exact = || self.tracked.iter().any(|t| t.is_exact() && crosses_first(t));
        if !self.is_integrated() || crossing <= 1 || first_is_exact() {
            return Together { instant, uncertain: instant, atom: None };
        }
        let atom = self.tracked.iter().find(|t| crosses_first(t)).map(|t| t.atom);
        let slack = atom.map_or(0.0, |atom| self.detector.slack(self.path, atom, first));
        Together { instant, uncertain: instant.max(first + slack), atom }
    }

    /// True if the errors of integration leave it open which of two atoms changes first. Levels of one value are taken in their order, whatever its
    /// error is.
    fn share_uncertainty(&self, first: usize, other: usize) -> bool {
        let moving = |atom: usize| -> SmallVec<[usize; 4]> {
            self.path.rule.atom_reads[atom].iter().copied().filter(|v| self.path.moves(*v)).collect()
        };
        let (a, b) = (moving(first), moving(other));
        a.len() != 1 || a != b
    }

    /// Looks ahead again for the atoms that have changed without consequence.
    fn pass_changes(&mut self, group: &[Change], first: f64) {
        for i in 0..self.tracked.len() {
            let TrackedAtom { atom, tolerance, ahead } = &self.tracked[i];
            let (atom, tolerance) = (*atom, *tolerance);
            if !group.iter().any(|change| change.atom() == atom) {
                continue;
            }
            let from = ahead.next.map_or(first, |crossing| crossing.position.max(first));
            // A variable that moves monotonically takes its level only once.
            self.tracked[i].ahead = if self.tracked[i].is_exact() {
                Lookahead::default()
            } else {
                let decides = self.decides(atom);
                let ahead = self.look_ahead(atom, tolerance, from, false, decides);
                self.but_for_limits(atom, ahead)
            };
        }
    }
}
