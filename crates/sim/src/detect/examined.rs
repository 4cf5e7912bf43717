//! Steps that are examined for pulses, and what their method has seen of them.
//!
//! A pulse can only be excluded where something is known of the places between the stages, so whoever makes steps tells where their
//! stages are ([`Stages`]): of several steps end to end those of each ([`StagesOfSteps`]), for the places of one step stretched over
//! all of them would name places at which no rate has been evaluated.

use crate::Settings;
use crate::flow::integrator::Integrator;
use crate::world::World;
use crate::world::course::Course;
use crate::world::state::State;
use dlsys_expr::{Interval, Smooth};
use dlsys_model::{Rule, Solve};
use dlsys_ode::{Dense, Reached};
use dlsys_tree::{ModuleId, SimTime};

/// The stages of a step, or of several end to end.
#[derive(Clone, Copy)]
pub struct Stages<'p> {
    /// Their positions, as fractions of the whole, from 0 to 1.
    pub nodes: &'p [f64],
    /// The range of the integrated variables there, if it is known.
    pub range: Option<StageRange<'p>>,
}

/// The range of integrated variables at some stages.
#[derive(Clone, Copy)]
pub struct StageRange<'p> {
    pub reached: Reached<'p>,
    /// By component of the coupled solution: its number in the step. Those that are not in the step, with a number beyond, are its inputs along their dense output. None if
    /// they are numbered alike.
    pub numbers: Option<&'p [u32]>,
}

impl StageRange<'_> {
    /// The range of a component whose dense output has these bounds.
    pub fn with(&self, component: u32, bounds: Interval) -> Smooth {
        let number = match self.numbers {
            Some(numbers) => numbers.get(component as usize).copied().unwrap_or(u32::MAX),
            None => component,
        };
        match self.reached.of(number as usize) {
            Some((lo, hi)) => Smooth::spanned(bounds.lo.min(lo), bounds.hi.max(hi)),
            None if self.numbers.is_some() => Smooth::spanned(bounds.lo, bounds.hi),
            None => Smooth::UNKNOWN,
        }
    }
}

impl<'p> Stages<'p> {
    /// Those of the step just made, whose components are numbered as they are known.
    pub fn of(integrator: &'p Integrator) -> Stages<'p> {
        let range = integrator.reached().map(|reached| StageRange { reached, numbers: None });
        Stages { nodes: integrator.nodes(), range }
    }
}

/// The stages of steps end to end.
#[derive(Clone, Default)]
pub struct StagesOfSteps {
    nodes: Vec<f64>,
    least: Vec<f64>,
    greatest: Vec<f64>,
    range_is_known: bool,
}

impl StagesOfSteps {
    /// Begins with the first of other steps.
    pub fn begin(&mut self) {
        self.nodes.clear();
        self.range_is_known = true;
    }

    /// Includes the step just made, given the positions of its start and its end in the whole.
    pub fn add(&mut self, integrator: &Integrator, start: f64, end: f64) {
        if let Some(Reached { least, greatest }) = integrator.reached() {
            if self.nodes.is_empty() {
                self.least.clear();
                self.greatest.clear();
                self.least.extend_from_slice(least);
                self.greatest.extend_from_slice(greatest);
            }
            self.least.iter_mut().zip(least).for_each(|(known, new)| *known = known.min(*new));
            self.greatest.iter_mut().zip(greatest).for_each(|(known, new)| *known = known.max(*new));
        } else {
            self.range_is_known = false;
        }
        self.nodes.extend(integrator.nodes().iter().map(|node| start + node * (end - start)));
    }

    /// All of them, given the numbers of components in the steps.
    pub fn all<'r>(&'r self, numbers: &'r [u32]) -> Stages<'r> {
        let reached = Reached { least: &self.least, greatest: &self.greatest };
        let is_known = self.range_is_known && !self.nodes.is_empty();
        let range = is_known.then_some(StageRange { reached, numbers: Some(numbers) });
        Stages { nodes: &self.nodes, range }
    }
}

/// How steps are made.
#[derive(Clone, Copy)]
pub struct Conditions<'p> {
    /// The rules of the model.
    pub rules: &'p [Rule],
    /// The largest contribution to the values that may be overlooked.
    pub tolerance: f64,
    /// The equations are stiff.
    pub stiff: bool,
    /// Neighbours were constant while the step was made.
    pub sliced: bool,
}

impl<'p> Conditions<'p> {
    pub fn new(rules: &'p [Rule], settings: &Settings, stiff: bool) -> Conditions<'p> {
        Conditions { rules, tolerance: settings.tolerance, stiff, sliced: settings.is_sliced() }
    }
}

/// A step of a module's equations that is to be examined.
#[derive(Clone, Copy)]
pub struct ExaminedStep<'p> {
    /// The world before the step, with the solution of the coupled modules.
    pub world: &'p World,
    pub conditions: Conditions<'p>,
    /// The module, its rule and its active equations.
    pub state: &'p State,
    /// See `state`.
    pub rule: &'p Rule,
    /// See `state`.
    pub solve: &'p Solve,
    /// The instants between which rates are bounded.
    pub start: SimTime,
    /// See `start`.
    pub end: SimTime,
    /// Where the method has evaluated rates.
    pub stages: Stages<'p>,
    /// The dense output, if the module is integrated alone; else it is that of the coupled modules.
    pub own: Option<&'p Dense>,
}

/// The difference of rates that is no surprise, times the length of the step, in tolerances. Smooth rates have differences up to 4, fast waves 12;
/// a step over a pulse has some hundreds.
const DEFECT: f64 = 20.0;

impl<'p> ExaminedStep<'p> {
    /// A step of a coupled module, between two instants. None if it has no equations.
    pub fn coupled(
        world: &'p World,
        id: ModuleId,
        [start, end]: [SimTime; 2],
        stages: Stages<'p>,
        conditions: Conditions<'p>,
    ) -> Option<ExaminedStep<'p>> {
        let state = world.state(id)?;
        let rule = &conditions.rules[state.rule.get()?];
        let solve = &rule.solves[state.solve.get()?];
        Some(ExaminedStep { world, conditions, state, rule, solve, start, end, stages, own: None })
    }

    /// The same of a module that is integrated alone, along its dense output.
    pub fn alone(
        world: &'p World,
        id: ModuleId,
        dense: &'p Dense,
        stages: Stages<'p>,
        conditions: Conditions<'p>,
    ) -> Option<ExaminedStep<'p>> {
        let step = ExaminedStep::coupled(world, id, [dense.start, dense.end], stages, conditions)?;
        Some(ExaminedStep { own: Some(dense), ..step })
    }

    /// The values of the module along the step.
    pub fn course(&self) -> Course<'p> {
        Course::new(self.world, self.state, self.rule, self.own)
    }

    /// True if a value, or a rate times the length of the step, differs from that of the dense output by more than it does where all is smooth.
    pub fn is_far(&self, a: f64, b: f64, size: f64) -> bool {
        exceeds((a - b).abs(), DEFECT * self.conditions.tolerance * size.abs().max(1.0))
    }
}

/// True if a number is larger than another, or one of them is none.
pub fn exceeds(a: f64, b: f64) -> bool {
    a.partial_cmp(&b).is_none_or(|order| order.is_gt())
}
