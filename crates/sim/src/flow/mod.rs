//! Flows: how parameters move from one instant to the next, and the next event of each module.
//!
//! ```text
//! start_trajectories ─▶ closed_form            a formula, evaluated and never stepped
//!               ─▶ independent            steps of the module alone, ─▶ alike  or of one that is alike
//!               ─▶ coupled                one step for all modules that read one another
//! look_ahead    ─▶ detect (zero crossings) ─▶ schedule
//! prediction: the whole life of a module whose parameters all have closed forms, as one function
//! ```

pub mod algebraic;
mod alike;
pub mod closed_form;
pub mod coupled;
mod independent;
pub mod integrator;
pub mod known_rates;
pub mod lazy;
mod orbits;
pub mod prediction;
mod rates;

use crate::detect::Detector;
use crate::detect::crossing::needs_search;
use crate::error::{Error, Near};
use crate::log::Log;
use crate::schedule::{Owner, Schedule};
use crate::scratch::Scratch;
use crate::setup::Setup;
use crate::trajectory::Trajectory;
use crate::world::neighbours::Neighbours;
use crate::world::path::Path;
use crate::world::state::{Change, Next, NextKind};
use crate::world::trajectories::{Law, Trajectories};
use crate::world::{Instant, World};
use alike::{Followed, KnownSteps};
use coupled::Coupled;
use dlsys_model::{Model, Sign};
use dlsys_ode::Dense;
use dlsys_tree::{ModuleId, SimTime};
use independent::Hint;
use integrator::Integrator;
use known_rates::KnownRates;
use smallvec::SmallVec;

pub use integrator::next_grid_time;

/// Two sides that differ by less than this part of the tolerance have met, where the equations end.
const ARRIVED: f64 = 0.01;
/// Growth of the stretches that are searched on closed forms.
const WIDENING: f64 = 4.0;
/// Most of the stretches within which fields change that are searched at once. Modules that go on together read the same instants of a field, of which few are kept.
const CHANGES: f64 = 16.0;

/// The data that flows keep from step to step.
#[derive(Clone)]
pub struct Flows {
    pub coupled: Coupled,
    /// Some algebraic parameters are computed only where they are observed.
    pub lazy_algebra: bool,
    /// Steps of modules that are integrated alone, and the module and end of the last one.
    independent: Integrator,
    independent_last: Option<(ModuleId, SimTime)>,
    known_steps: KnownSteps,
    /// The experience of step control, by kind and number of the clause: modules of one kind under different rules take
    /// the same steps.
    hints: Vec<Vec<Hint>>,
    pub known_rates: KnownRates,
    trajectories: Vec<Trajectory>,
    y: Vec<f64>,
    /// The variables and registers of the equations of a module that is integrated alone.
    registers: Vec<f64>,
}

impl Flows {
    pub fn new(model: &Model) -> Flows {
        let hints = (model.kinds.iter()).map(|(_, kind)| {
            let clauses = kind.rules.iter().map(|r| model.rules[*r].solves.len()).max();
            vec![Hint::default(); clauses.unwrap_or(0)]
        });
        let mut algebraic = model.rules.iter().flat_map(|rule| &rule.solves).map(|solve| &solve.algebraic);
        Flows {
            coupled: Coupled::default(),
            lazy_algebra: algebraic.any(|a| (0..a.of.len()).any(|place| a.is_lazy(place))),
            independent: Integrator::default(),
            independent_last: None,
            known_steps: KnownSteps::new(model),
            hints: hints.collect(),
            known_rates: KnownRates::default(),
            trajectories: Vec::new(),
            y: Vec::new(),
            registers: Vec::new(),
        }
    }

    /// The estimated error now of integrated values that a module reads, relative; 0 where nothing is integrated.
    pub fn error_of(&self, world: &World, id: ModuleId) -> f64 {
        let Some(state) = world.state(id) else { return 0.0 };
        let step = state.trajectories.step().filter(|_| state.is_numeric());
        let own = step.map_or(0.0, |step| step.dense.error);
        let common = if world.coupled.is_some() { self.coupled.control.error } else { 0.0 };
        own.max(common)
    }

    /// The relative error of the values that a module reads, inside the common step, too; 0 of one that stands alone, whose values are followed to their own
    /// accuracy. Differences below [`NEXT_TO_NOTHING`](crate::world::path::NEXT_TO_NOTHING) times that have no sign.
    pub fn error_among_others(&self, world: &World, id: ModuleId) -> f64 {
        if !world.state(id).is_some_and(Path::is_among_others) {
            return 0.0;
        }
        let inside = world.coupled.as_ref().map_or(0.0, |solution| solution.error);
        self.error_of(world, id).max(inside)
    }

    /// The time scale of a module's equations, as far as it is known.
    pub fn reach_of(&self, world: &World, id: ModuleId) -> f64 {
        let Some(state) = world.state(id) else { return 1.0 };
        if state.coupled && self.coupled.control.size > 0.0 {
            return self.coupled.control.size;
        }
        let hint = state
            .solve
            .get()
            .map_or(0.0, |solve| self.hints[world.tree.kind(id).index()][solve].control.size);
        if hint > 0.0 { hint } else { 1.0 }
    }

    /// Some living module: to name one where no more is known.
    pub fn anyone(&self, world: &World) -> ModuleId {
        let named = self.coupled.members.iter().copied().find(|id| world.state(*id).is_some());
        named.or_else(|| world.states.iter().find(|s| s.is_alive).map(|s| s.id)).expect("there are modules")
    }
    /// Evaluations of the equations of one module so far.
    pub fn evaluations(&self) -> u64 {
        self.independent.evaluations() + self.coupled.evaluations()
    }

    /// True if equations were stiff, so that the implicit method was taken.
    pub fn has_been_stiff(&self) -> bool {
        self.independent.is_implicit() || self.coupled.integrator.is_implicit()
    }
}

/// The parts that flows work on.
pub struct FlowStage<'s, 'm> {
    pub setup: &'s Setup<'m>,
    pub instant: &'s Instant,
    pub world: &'s mut World,
    pub neighbours: &'s Neighbours,
    pub schedule: &'s mut Schedule,
    pub flows: &'s mut Flows,
    pub detector: &'s mut Detector,
    pub log: &'s mut Log,
    pub scratch: &'s mut Scratch,
}

impl FlowStage<'_, '_> {
    /// Gives each parameter of a module its trajectory from the present on. Numeric trajectories get their component; the
    /// steps are made later.
    pub fn start_trajectories(&mut self, id: ModuleId, numeric_only: bool) {
        let model = self.setup.model;
        let state = self.world.state(id).expect("a module with a rule");
        let rule = &model.rules[state.rule.get().expect("a module with a rule")];
        let clause = state.solve.get().map(|s| &rule.solves[s]);
        let Some(solve) = clause.filter(|solve| !solve.of.is_empty() || !solve.algebraic.is_empty()) else {
            self.begin_anew(id, false);
            return;
        };
        if !numeric_only && solve.is_all_numeric() {
            let numeric = solve.numeric.iter().map(|position| solve.of[*position]);
            self.begin_anew(id, false).follow_step(rule.parameters.len(), numeric);
            return;
        }
        let mut trajectories = std::mem::take(&mut self.flows.trajectories);
        trajectories.clear();
        trajectories.resize(rule.parameters.len(), Trajectory::Rest);
        let mut refused = false;
        if numeric_only {
            for (component, &parameter) in solve.of.iter().enumerate() {
                trajectories[parameter] = Trajectory::Step(component as u32);
            }
            closed_form::solved(solve, true, &mut trajectories);
        } else {
            let read = (rule, solve.stepping.formulas_read());
            self.world.variables_read(read, id, &state.context, self.instant.at, &mut self.scratch.variables);
            self.scratch.variables.extend(state.marks.switch_values());
            refused = !closed_form::formulas(solve, rule.time_variable(), self.scratch, &mut trajectories)
                || !closed_form::functions(solve, rule.time_variable(), self.scratch, &mut trajectories);
        }
        if !refused {
            self.begin_anew(id, numeric_only).assign(trajectories.drain(..));
        }
        self.flows.trajectories = trajectories;
        if refused {
            self.start_trajectories(id, true);
        }
    }

    /// Ends the trajectories of a module; those from the present on are to be put in their place.
    fn begin_anew(&mut self, id: ModuleId, numeric_only: bool) -> &mut Trajectories {
        let now = self.instant.at;
        let state = self.world.state_mut(id).expect("a module with a rule");
        state.since = now;
        state.numeric_only = numeric_only;
        state.horizon = f64::NAN;
        if let Some(step) = state.trajectories.step_mut() {
            step.live = false;
        }
        &mut state.trajectories
    }

    /// Finds the next event of a module that is not coupled, from an instant on, and schedules it.
    pub fn look_ahead(&mut self, id: ModuleId, from: SimTime) -> Result<(), Error> {
        let model = self.setup.model;
        let who = Owner::Module(id.slot() as u32);
        let state = self.world.state_mut(id).expect("a module with a rule");
        let rule = &model.rules[state.rule.get().expect("a module with a rule")];
        // The steps of coupled modules are not their own.
        let numeric = state.is_numeric() && !state.coupled;
        state.next = state.next.again();
        let searched = !numeric && needs_search(state, rule);
        let experience = numeric.then(|| self.experience(id));
        let (is_kept, accuracy) = match experience.map(|own| self.follow_alike(id, from, &own)).transpose()? {
            Some(Followed::Alike) => return Ok(()),
            Some(Followed::Alone { is_kept, accuracy }) => (is_kept, accuracy),
            None => (false, 1.0),
        };
        let (h, limit) = if let Some(experience) = experience {
            match self.step_independent(id, from, experience, accuracy) {
                Ok(h) => (h, 1.0),
                Err(error) => return self.arrest(id, from).ok_or(error),
            }
        } else if searched {
            let World { tree, states, stretch, .. } = &mut *self.world;
            let state = states.get_mut(id.slot()).expect("a module with a rule");
            let h = if state.horizon > 0.0 {
                WIDENING * state.horizon
            } else {
                closed_form::time_scale(state, tree)
            };
            // Not shorter than time itself can tell.
            let h = h.min(CHANGES * *stretch).max(64.0 * from.resolution());
            state.horizon = h;
            (h, 1.0)
        } else {
            (1.0, f64::INFINITY)
        };
        let state = self.world.state(id).expect("seen above");
        let path = Path::new(self.world, state, rule, from, h);
        let found = self.detector.crossings.search(&path, limit);
        let formulas = state.trajectories.iter().filter_map(Law::formula);
        let end = formulas.filter_map(Trajectory::end).reduce(f64::min);
        let end = end.map(|tau| state.since.after(tau));
        let (kind, at) = match found.event {
            Some(_) if found.in_doubt => (NextKind::Doubt, found.touched[0].time),
            Some(_) => (NextKind::Event, found.touched[0].time),
            None if numeric => (NextKind::Window, state.trajectories.step().map_or(from, |s| s.dense.end)),
            None if limit.is_finite() => (NextKind::Window, from.after(h)),
            None => (NextKind::Nothing, from),
        };
        let (kind, at) = match end {
            Some(end) if kind == NextKind::Nothing || end.since(at) < 0.0 => (NextKind::Fault, end),
            _ => (kind, at),
        };
        let state = self.world.state_mut(id).expect("seen above");
        let lasting = limit.is_infinite();
        let (near, before, index) = (found.near, state.next.near(), state.rule.get());
        state.next = Next::new(kind, found.touched, &found.changes);
        state.next.lasting = lasting;
        state.next.set_near(near);
        if kind == NextKind::Nothing {
            self.schedule.cancel(who);
        } else {
            self.schedule.schedule(who, at);
        }
        self.detector.note_approach(index.unwrap_or(0), near, before, at);
        if is_kept {
            self.keep_step(id, at);
        }
        Ok(())
    }

    /// Where no step leads on because the equations end there: if a boundary is there too, it has been reached.
    pub fn arrest(&mut self, id: ModuleId, at: SimTime) -> Option<()> {
        let model = self.setup.model;
        let state = self.world.state(id)?;
        let rule = &model.rules[state.rule.get()?];
        self.world.variables(rule, id, &state.context, at, &mut self.scratch.variables);
        let mut sides = vec![0.0; rule.sides.outputs()];
        rule.sides.eval(&self.scratch.variables, &mut self.scratch.registers, &mut sides);
        let near = |atom: &usize| {
            let (a, b) = (sides[2 * atom], sides[2 * atom + 1]);
            (a - b).abs() <= ARRIVED * self.setup.settings.tolerance * a.abs().max(b.abs()).max(1.0)
        };
        let signed = |atom: &usize| matches!(state.marks.signs()[*atom], Sign::Plus | Sign::Minus);
        let touched: SmallVec<[Change; 1]> = (0..rule.atoms.len())
            .filter(signed)
            .filter(near)
            .map(|atom| Change::new(atom, at, [Sign::Zero, state.marks.signs()[atom]]))
            .collect();
        if touched.is_empty() {
            return None;
        }
        let state = self.world.state_mut(id)?;
        state.next = Next::new(NextKind::Event, touched, &[]);
        self.schedule.schedule(Owner::Module(id.slot() as u32), at);
        Some(())
    }

    /// Goes on to the next stretch of a module.
    pub fn pass_window(&mut self, id: ModuleId, at: SimTime) -> Result<(), Error> {
        let state = self.world.state_mut(id).expect("scheduled");
        state.pass_changes(at);
        if state.is_numeric() {
            // The numeric parameters begin anew; formulas go on from where they began.
            self.rebase(id, at);
        }
        self.look_ahead(id, at)
    }

    /// Makes the end of a module's own step the start of its next.
    fn rebase(&mut self, id: ModuleId, at: SimTime) {
        let state = self.world.state(id).expect("scheduled");
        let first = self.world.tree.places(id).start;
        let ends: SmallVec<[(usize, f64); 4]> = (state.trajectories.iter().enumerate())
            .filter_map(|(parameter, law)| match law {
                Law::Step(c) => {
                    let dense: &Dense = &state.trajectories.step()?.dense;
                    Some((first + parameter, dense.value(c as usize, dense.position(at))))
                }
                _ => None,
            })
            .collect();
        for (place, value) in ends {
            self.world.tree.set_value(place, value);
        }
    }

    /// Removes the state of a module that has been replaced, or has lost its rule.
    pub fn forget(&mut self, id: ModuleId) {
        // Its memory stays for the next module in the slot.
        let World { states, coupled, .. } = &mut *self.world;
        if let Some(state) = states.get_mut(id.slot()).filter(|state| state.id == id && state.is_alive) {
            state.is_alive = false;
            if state.coupled {
                self.flows.coupled.reintegrated = true;
                self.flows.coupled.loosened.extend_from_slice(&state.context);
                coupled.iter_mut().for_each(|solution| solution.release(state.trajectories.coupled()));
            }
            self.schedule.cancel(Owner::Module(id.slot() as u32));
        }
    }

    /// The error of two sides of a condition that are nearer each other than the error of integration.
    pub fn in_doubt(&mut self, id: ModuleId, atom: usize) -> Error {
        let index = self.world.rule_and_clause(id).0.unwrap_or(0);
        let rule = &self.setup.model.rules[index];
        self.world.rebase(id, self.instant.at);
        let site = self.world.site(self.setup.model, id, index, rule.atoms[atom], self.instant.at);
        let mut sides = vec![0.0; rule.sides.outputs()];
        if let Some(state) = self.world.state(id) {
            self.world.variables(rule, id, &state.context, self.instant.at, &mut self.scratch.variables);
            rule.sides.eval(&self.scratch.variables, &mut self.scratch.registers, &mut sides);
        }
        let gap = (sides[2 * atom] - sides[2 * atom + 1]).abs();
        let error = self
            .world
            .state(id)
            .map_or(0.0, |state| Path::new(self.world, state, rule, self.instant.at, 0.0).error());
        let boundary = rule.boundaries[atom].to_string();
        Error::InDoubt { site, near: Box::new(Near { boundary, gap, error: error.max(gap) }) }
    }
}
