//! Levels that variables meet at an instant: whoever reads a variable then reads the level, and not a rounding of it.
//!
//! A successor that gets a value at its limit would else get a number a little beyond, or a whole part from before the jump.

use super::chance;
use super::meeting::Meeting;
use super::{EventStage, Firing};
use crate::scratch::Scratch;
use crate::setup::Setup;
use crate::world::World;
use crate::world::context::Context;
use crate::world::new_modules::NewModules;
use crate::world::state::State;
use dlsys_model::{Rule, Sign};
use dlsys_tree::{ModuleId, Tree};

/// A value that is further from a level than this part of it, or of 1, has left it since.
const LEFT: f64 = 1e-12;

/// Most by which values are corrected so that sides are equal that meet, in errors of integration as they are estimated,
const ERRORS: f64 = 10.0;

/// or in tolerances, if that is more: a value of what is integrated errs by a part of one. Where it would take more to bring a value to its level, as
/// at `x^2 - 4*x + 4.00001 = 0`, the values that it is computed from are known better than that level is met.
const TOLERANCES: f64 = 0.5;

/// Puts the levels that parameters of a module's context meet at this instant among the variables of its rule; a value that has jumped at the
/// instant meets none any more.
pub fn put_levels(
    met: &[(ModuleId, usize, f64)],
    (tree, id): (&Tree, ModuleId),
    around: &Context,
    variables: &mut [f64],
) {
    if met.is_empty() {
        return;
    }
    let mut first = tree.parameters(id).len();
    for &module in around.context() {
        for &(_, parameter, level) in met.iter().filter(|met| met.0 == module) {
            let value: &mut f64 = &mut variables[first + parameter];
            if (*value - level).abs() <= LEFT * level.abs().max(1.0) {
                *value = level;
            }
        }
        first += tree.parameters(module).len();
    }
}

/// Most by which a value that a module reads may be corrected, as a part of its size or of 1.
fn error_of(setup: &Setup, world: &World, state: &State) -> f64 {
    let own = state.trajectories.step().map_or(0.0, |step| step.dense.error);
    let common = world.coupled.as_ref().map_or(0.0, |solution| solution.error);
    (ERRORS * own.max(common)).max(TOLERANCES * setup.settings.tolerance)
}

/// Most steps of rounding by which a level is moved, so that the sides that meet there are equal.
const MOST_ULPS: u32 = 8;

/// Gives the variables that meet a level their levels, not roundings of them, and makes sides equal that meet otherwise: see [`Meeting`].
/// The variables in `scratch` are those of the rule.
pub fn set_levels(setup: &Setup, world: &World, fire: &Firing, scratch: &mut Scratch) {
    let Some(state) = world.state(fire.id).filter(|state| state.rule.get() == Some(fire.rule)) else {
        return;
    };
    let Some(open) = state.open.as_ref().filter(|open| !open.levels.is_empty()) else { return };
    let (rule, decide) = (&setup.model.rules[fire.rule], setup.levels_decide[fire.rule]);
    for (variable, value) in open.levels.iter().filter_map(|level| level.level) {
        // The time is known to the last digit as it is.
        if decide || variable != rule.time_variable() {
            scratch.variables[variable] = value;
        }
    }
    let is_delicate = decide || setup.is_delicate[fire.rule][fire.produce];
    if !is_delicate && !setup.has_meetings[fire.rule] {
        return;
    }
    let meeting = Meeting::new(rule, open, state.numeric_only, error_of(setup, world, state));
    let meeting = if setup.leads_to_edges[fire.rule] { meeting.alone() } else { meeting };
    if !is_delicate {
        if meeting.is_integrated() {
            meeting.settle(scratch, |_| true);
        }
        return;
    }
    let (clause, lineage) = (&rule.produces[fire.produce], world.tree.lineage(fire.id));
    let mut trial = Scratch::default();
    meeting.settle(scratch, |variables| {
        trial.variables.clear();
        trial.variables.extend_from_slice(variables);
        chance::successor(setup.seed, clause, lineage, &mut trial, &mut NewModules::default()).is_ok()
    });
}

/// The number nearest to a value, within some steps of rounding, with which the difference of an atom's sides has a sign. The variables in
/// `scratch` are those of the rule; the one that is asked for is written over.
fn nearest(
    rule: &Rule,
    (atom, variable): (usize, usize),
    value: f64,
    sign: Sign,
    scratch: &mut Scratch,
) -> Option<f64> {
    let Scratch { variables, registers, .. } = scratch;
    let mut sides = vec![0.0; rule.sides.outputs()];
    let mut has_sign = |candidate: f64| {
        variables[variable] = candidate;
        rule.sides.eval(variables, registers, &mut sides);
        Sign::of(sides[2 * atom] - sides[2 * atom + 1]) == sign
    };
    let (mut up, mut down) = (value, value);
    let around = (0..MOST_ULPS).flat_map(|_| {
        (up, down) = (up.next_up(), down.next_down());
        [up, down]
    });
    std::iter::once(value).chain(around).find(|candidate| has_sign(*candidate))
}

impl EventStage<'_, '_> {
    /// Gives a module that goes on, and some equations of which end at an edge (`sqrt(x + y - 3.4)`), values at which the sides that meet now
    /// are equal: a rounding beyond, they would not be defined.
    pub(super) fn settle_at_edge(&mut self, id: ModuleId) {
        let Some(state) = self.world.state(id) else { return };
        let Some(index) = state.rule.get().filter(|rule| self.setup.has_edges[*rule]) else { return };
        let rule = &self.setup.model.rules[index];
        let Some(open) = &state.open else { return };
        if !open.levels.iter().any(|level| rule.decides_equations(level.atom)) {
            return;
        }
        let variables = &mut self.scratch.variables;
        self.world.variables(rule, id, &state.context, self.instant.at, variables);
        put_levels(&self.events.met, (&self.world.tree, id), &state.context, variables);
        let error = error_of(self.setup, self.world, state);
        Meeting::new(rule, open, state.numeric_only, error).settle(self.scratch, |_| true);
        let places = self.world.tree.places(id);
        for (place, &value) in places.zip(&self.scratch.variables) {
            self.world.tree.set_value(place, value);
        }
    }

    /// A variable of a module or of its context that moves, and the number at which the sides of an atom are equal; none if there is
    /// none within the rounding of the numbers of now.
    pub fn meeting(&mut self, id: ModuleId, rule: &Rule, atom: usize) -> Option<(usize, f64)> {
        let mut moving = Vec::new();
        self.flows.known_rates.clear();
        self.flow().moving_variables(id, 0.0, &mut moving);
        self.scratch.variables.clear();
        self.scratch.variables.extend(moving.iter().map(|variable| variable.value));
        let known = rule.first_aggregate;
        let candidates = rule.atom_reads[atom].iter().copied();
        candidates.filter(|variable| *variable < known && moving[*variable].rate != 0.0).find_map(
            |variable| {
                let value = moving[variable].value;
                let level = nearest(rule, (atom, variable), value, Sign::Zero, self.scratch);
                self.scratch.variables[variable] = value;
                Some((variable, level?))
            },
        )
    }
}
