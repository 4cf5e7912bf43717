//! Stretches on which nothing happens: a test of few operations, which most stretches of coupled modules pass, in place of
//! a search.
//!
//! It asks less of each atom than a search of the same stretch does, so a search would find nothing either: a formula meets
//! its level after the end, or never; the hull of a parameter's dense output, from here to the end and not piece by piece,
//! keeps clear of the level by the margin that a search asks for. All else is left to the search.

use super::crossing::{LocationMethod, is_clear_of, level_of_dense, location_method, reachable};
use super::signs::{Reach, is_at, reach};
use crate::world::World;
use crate::world::coupled_solution::CoupledSolution;
use crate::world::state::State;
use crate::world::trajectories::Law;
use dlsys_expr::Program;
use dlsys_model::{Rule, Sign, ZeroCrossing};
use dlsys_tree::SimTime;

/// An instant counts as later than another if it is so by this many times the resolution of time.
const LATER: f64 = 64.0;

/// A coupled module from an instant to the end of the common step.
pub struct Outlook<'w> {
    pub world: &'w World,
    pub solution: &'w CoupledSolution,
    pub state: &'w State,
    pub rule: &'w Rule,
    pub from: SimTime,
}

/// When a variable meets a level.
enum Meeting {
    Unknown,
    Never,
    At(SimTime),
}

impl Outlook<'_> {
    /// True if it is plain that no atom changes its sign before the end, nor comes near to it.
    pub fn is_quiet(&self) -> bool {
        let Outlook { state, rule, .. } = self;
        if self.solution.error <= 0.0 || state.next.near() != 0 || !state.next.changes().is_empty() {
            return false;
        }
        let end = self.solution.end;
        let are_formulas_free = state.horizon - end.to_f64() > 2.0 * LATER * end.resolution();
        reachable(rule, state).all(|(atom, crossing)| match location_method(crossing, state) {
            LocationMethod::Never => true,
            LocationMethod::Formula(variable, level) => {
                are_formulas_free || self.is_met_later(variable, level, state.marks.signs()[atom])
            }
            LocationMethod::Search => self.keeps_clear(crossing, state.marks.signs()[atom]),
        })
    }

    /// The time before which no variable with a formula meets its level: see [`State::horizon`].
    pub fn free_until(&self) -> f64 {
        let Outlook { state, rule, .. } = self;
        let meetings =
            reachable(rule, state).filter_map(|(_, crossing)| match location_method(crossing, state) {
                LocationMethod::Formula(variable, level) => Some(self.meeting(variable, level)),
                LocationMethod::Never | LocationMethod::Search => None,
            });
        let time = |met: Meeting| match met {
            Meeting::Unknown => f64::NEG_INFINITY,
            Meeting::Never => f64::INFINITY,
            Meeting::At(time) => time.to_f64(),
        };
        meetings.map(time).fold(f64::INFINITY, f64::min)
    }

    /// True if a variable with a formula meets its level after the end, or never.
    fn is_met_later(&self, variable: usize, level: &Program, sign: Sign) -> bool {
        if !matches!(sign, Sign::Plus | Sign::Minus) {
            // Such a sign is not tracked along a formula.
            return true;
        }
        let end = self.solution.end;
        match self.meeting(variable, level) {
            Meeting::Unknown => false,
            Meeting::Never => true,
            Meeting::At(met) => met.since(end) > LATER * end.resolution(),
        }
    }

    /// The instant at which a variable with a formula meets its level.
    fn meeting(&self, variable: usize, level: &Program) -> Meeting {
        let Some(&[level]) = level.constants() else { return Meeting::Unknown };
        let law = self.state.trajectories.get(variable);
        let start = law.map_or(0.0, |_| self.world.tree.parameters(self.state.id)[variable]);
        // Near an equilibrium the rate has to be computed from the equation as written: that is for the search.
        let mut is_known = true;
        let exact = || {
            is_known = false;
            f64::NAN
        };
        match reach(variable, self.rule.time_variable(), level, law.and_then(Law::formula), start, exact) {
            Some(Reach::At(time)) => Meeting::At(time),
            Some(Reach::Age(age)) => Meeting::At(self.world.tree.birth(self.state.id).after(age)),
            Some(Reach::After(tau)) => Meeting::At(self.state.since.after(tau)),
            // At the level, its sign may be yet to turn.
            None if is_known && !is_at(level, start) => Meeting::Never,
            None => Meeting::Unknown,
        }
    }

    /// True if an integrated parameter keeps clear of the one level at which its atom's sides meet.
    fn keeps_clear(&self, crossing: &ZeroCrossing, sign: Sign) -> bool {
        let level = |level: &Program| level.constants().map(|all| all[0]);
        let Some((variable, level, side)) = level_of_dense(crossing, sign, level) else { return false };
        let bounds = self.state.trajectories.get(variable).and_then(|law| match law {
            Law::Coupled(component) => self.solution.hull(component as usize, self.from),
            _ => None,
        });
        bounds.is_some_and(|bounds| is_clear_of(bounds, level, side, self.solution.error))
    }
}
