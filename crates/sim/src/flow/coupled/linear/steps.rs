//! The equations in steps, where no method without steps stays within its bound of the error.

use super::Problem;
use crate::flow::integrator::{Integrator, StepRequest};
use crate::world::state::Control;
use crate::{Settings, Stats};
use dlsys_ode::Dense;
use dlsys_ode::Rates;
use dlsys_tree::SimTime;

/// Steps from the start of the trajectory, whose time is zero here. They do not depend on the times that are observed.
#[derive(Clone)]
pub struct LinearSteps {
    integrator: Integrator,
    control: Control,
    /// The state at the start of the last step, and the ends of that; before the first step, the start of the
    /// trajectory.
    y: Vec<f64>,
    from: SimTime,
    end: SimTime,
    /// The dense output of the last step, if it has been evaluated.
    dense: Option<Dense>,
}

impl LinearSteps {
    /// Steps from the start of a problem, beginning with the experience `control`.
    pub fn new(problem: &Problem, settings: &Settings, control: Control) -> LinearSteps {
        let mut integrator = Integrator::default();
        integrator.restart(settings.method, problem.y.len());
        let (from, end) = (SimTime::ZERO, SimTime::ZERO);
        LinearSteps { integrator, control, y: problem.y.clone(), from, end, dense: None }
    }

    /// True if a time lies before the last step, so that it can only be reached from the start.
    pub fn have_passed(&self, tau: f64) -> bool {
        SimTime::new(tau).since(self.from) < 0.0
    }

    /// The state at a time that is not before the last step. None if the steps do not come that far.
    pub fn at(
        &mut self,
        problem: &Problem,
        tau: f64,
        settings: &Settings,
        stats: &mut Stats,
    ) -> Option<Vec<f64>> {
        let at = SimTime::new(tau);
        let LinearSteps { integrator, control, y, from, end, dense } = self;
        let mut flow = LinearRates { problem };
        while end.since(at) < 0.0 {
            if end.since(SimTime::ZERO) > 0.0 {
                integrator.advance(y);
            }
            *from = *end;
            *dense = None;
            let request = StepRequest { settings, y, start: *from, limit: None };
            *end = integrator.step(request, control, &mut flow, stats).ok()?;
        }
        let dense = dense.get_or_insert_with(|| integrator.dense(&mut flow, y));
        let position = dense.position(at);
        Some((0..dense.components()).map(|component| dense.value(component, position)).collect())
    }
}

/// The right-hand side of a linear system.
struct LinearRates<'a> {
    problem: &'a Problem,
}

impl Rates for LinearRates<'_> {
    fn rates(&mut self, _: f64, y: &[f64], out: &mut [f64]) {
        out.copy_from_slice(&self.problem.b);
        for &(row, column, value) in &self.problem.entries {
            out[row as usize] += value * y[column as usize];
        }
    }

    fn couplings(&self) -> Vec<(u32, u32)> {
        self.problem.entries.iter().map(|e| (e.0, e.1)).collect()
    }

    fn partials(&mut self, _: f64, _: &[f64], out: &mut Vec<f64>) {
        out.clear();
        out.extend(self.problem.entries.iter().map(|e| e.2));
    }

    fn is_linear(&self) -> bool {
        true
    }

    fn is_steady(&self) -> bool {
        true
    }

    fn modules(&self) -> u64 {
        self.problem.y.len() as u64
    }
}
