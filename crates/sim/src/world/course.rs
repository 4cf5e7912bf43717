//! The variables of a module's equations at one instant of a step after another: which of them move, and how, is looked up once.

use super::World;
use super::path::Path;
use crate::trajectory::Trajectory;
use crate::world::coupled_solution::{CoupledSolution, value_of};
use crate::world::state::State;
use crate::world::trajectories::Law;
use dlsys_expr::Dual;
use dlsys_model::Rule;
use dlsys_ode::Dense;
use dlsys_tree::SimTime;
use smallvec::SmallVec;

/// How a variable moves.
#[derive(Clone, Copy)]
enum Motion<'c> {
    /// It is a component of the module's own step.
    Step(&'c Dense, u32),
    /// It is a component of the coupled modules.
    Coupled(&'c CoupledSolution, u32),
    /// It follows a formula, from a value at an instant.
    Formula(&'c Trajectory, f64, SimTime),
    Time,
    /// The time since the birth of the module.
    Age(SimTime),
}

impl Motion<'_> {
    /// The value at an instant; None for a component that has not been integrated yet.
    fn value(&self, at: SimTime) -> Option<f64> {
        Some(match *self {
            Motion::Step(dense, component) => value_of(dense, component as usize, dense.position(at)),
            Motion::Coupled(solution, component) => solution.value(component as usize, at)?,
            Motion::Formula(trajectory, x, since) => trajectory.at(x, at.since(since)),
            Motion::Time => at.to_f64(),
            Motion::Age(birth) => at.since(birth),
        })
    }
}

/// The variables of a module's equations during a step.
pub struct Course<'c> {
    /// All variables, at the values that those have which rest.
    resting: SmallVec<[f64; 12]>,
    moving: SmallVec<[(usize, Motion<'c>); 6]>,
    /// The module, its rule and its own step, if aggregates are to be computed from the variables of children.
    gathered: Option<(&'c World, &'c State, &'c Rule, Option<&'c Dense>)>,
}

impl<'c> Course<'c> {
    /// The course of a module's equations; along a step of its own, if that is given.
    pub fn new(world: &'c World, state: &'c State, rule: &'c Rule, step: Option<&'c Dense>) -> Course<'c> {
        let (mut resting, mut moving) = (SmallVec::new(), SmallVec::new());
        for &id in std::iter::once(&state.id).chain(state.context.context()) {
            let first = resting.len();
            resting.extend_from_slice(world.tree.parameters(id));
            let Some(other) = world.state(id) else { continue };
            let own = step.filter(|_| id == state.id).or(other.trajectories.step().map(|step| &step.dense));
            for (parameter, law) in other.trajectories.iter().enumerate() {
                let motion = match law {
                    Law::Rest => None,
                    Law::Step(c) => own.map(|dense| Motion::Step(dense, c)),
                    Law::Coupled(c) => world.coupled.as_ref().map(|all| Motion::Coupled(all, c)),
                    Law::Formula(formula) => {
                        Some(Motion::Formula(formula, resting[first + parameter], other.since))
                    }
                };
                moving.extend(motion.map(|motion| (first + parameter, motion)));
            }
        }
        resting.resize(rule.variables, 0.0);
        let time = rule.time_variable();
        moving.push((time, Motion::Time));
        moving.push((time + 1, Motion::Age(world.tree.birth(state.id))));
        resting.extend(state.marks.switch_values());
        let gathered = (!rule.aggregates.is_empty()).then_some((world, state, rule, step));
        Course { resting, moving, gathered }
    }

    /// All variables that the equations read at an instant.
    pub fn at(&self, instant: SimTime, out: &mut Vec<f64>) {
        if let Some((world, state, rule, step)) = self.gathered {
            let path = Path::of_equations(world, state, rule, (instant, 0.0), step);
            return path.everything_at(0.0, out);
        }
        out.clear();
        out.extend_from_slice(&self.resting);
        for (variable, motion) in &self.moving {
            if let Some(value) = motion.value(instant) {
                out[*variable] = value;
            }
        }
    }

    /// The value of an own parameter at an instant, if it follows dense output, and its rate per unit of time.
    pub fn departure(&self, parameter: usize, instant: SimTime) -> Option<Dual<f64>> {
        let (_, motion) = self.moving.iter().find(|(variable, _)| *variable == parameter)?;
        let (dense, component) = match *motion {
            Motion::Step(dense, component) => (dense, component as usize),
            Motion::Coupled(solution, component) => solution.stretch(component as usize, instant)?,
            _ => return None,
        };
        let Dual { value, rate } = dense.departure(component, dense.position(instant));
        Some(Dual { value, rate: rate / dense.h })
    }
}
