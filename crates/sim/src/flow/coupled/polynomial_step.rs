//! Common steps of linear equations as polynomials ([`taylor`](super::taylor)), where these lead as far as a step of a pair would.
//!
//! Each begins with the values at the end of the one before, which no integrator knows. Stiffness is not noticed here: so steps of a pair are
//! expected to become longer with each step that the error ends, and are made when they would lead twice as far.

use crate::flow::FlowStage;
use crate::flow::coupled::Coupled;
use crate::flow::coupled::taylor::{LOOSEST, MANY, Members};
use crate::flow::integrator::{CERTAINTY, INNER_TOLERANCE};
use crate::schedule::Owner;
use crate::world::coupled_solution::CoupledSolution;
use crate::{Method, Scheduler};
use dlsys_tree::SimTime;

/// Polynomials of linear equations serve as a common step if they lead to this part of what a step of a pair would, or to its limit;
/// a reach smaller by more than the second factor is not tried again. The third is that by which longer ones of a pair are expected.
const ENOUGH: f64 = 0.5;
const FAR: f64 = 2.0;
const LONGER: f64 = 1.03;
/// The reach, as a part of what is wanted, where there are no polynomials.
const SHORT: f64 = 0.1;

impl FlowStage<'_, '_> {
    /// Makes a common step as polynomials; false if they do not lead far enough, or the equations are not linear.
    pub(super) fn step_by_powers(&mut self, from: SimTime) -> bool {
        let settings = &self.setup.settings;
        let is_explicit = settings.method == Method::Auto && !self.flows.coupled.control.stiff;
        // Without conditions there are no steps at all.
        let is_searched =
            self.setup.has_conditions && !self.setup.has_pulses && settings.tolerance <= LOOSEST;
        if !is_explicit
            || settings.scheduler != Scheduler::Auto
            || !is_searched
            || self.may_go_without_steps()
        {
            return false;
        }
        let Coupled { traffic, members, reintegration, control, y, reach, .. } = &mut self.flows.coupled;
        let limits = [traffic.begin(from, members.len(), None), self.world.resolved(from)];
        let limit = limits.into_iter().flatten().reduce(|a, b| if b < a { b } else { a });
        // What fell short of a step by far the last time does so again.
        let wanted = limit.map_or(control.size, |limit| limit.since(from).min(control.size));
        if y.is_empty() || ENOUGH * wanted > FAR * *reach && *reach > 0.0 {
            *reach *= LONGER;
            return false;
        }
        let tolerance = INNER_TOLERANCE * self.setup.coupled_settings.tolerance;
        let all = Members { world: self.world, rules: &self.setup.model.rules, members, numbers: None };
        let Some(mut dense) = reintegration.taylor.step(all, (y, from), limit, tolerance) else {
            *reach = SHORT * wanted;
            return false;
        };
        *reach = dense.h;
        if ENOUGH * wanted > dense.h {
            return false;
        }
        // Steps of a pair are tried where polynomials end long before anything else does.
        if limit.is_none_or(|limit| limit != dense.end) {
            control.size = dense.h.max(LONGER * control.size);
        }
        control.error = (control.error + dense.error).min(CERTAINTY * self.setup.coupled_settings.tolerance);
        dense.error = control.error;
        self.log.stats.steps += 1;
        let end = dense.end;
        let Coupled { system, integrator, linear, tried, reintegrated, y, .. } = &mut self.flows.coupled;
        system.sections.clear();
        (*tried, *linear) = (false, None);
        integrator.set_unwatched(false);
        integrator.keep_reached(false);
        // The next step begins with the values at the end of this one, which no integrator knows.
        *reintegrated = true;
        if y.len() > MANY {
            // Until then they are nothing but memory.
            *y = Vec::new();
        }
        self.world.coupled = Some(CoupledSolution::new(dense));
        self.search_all(from);
        self.schedule.schedule(Owner::Coupled, end);
        true
    }
}
