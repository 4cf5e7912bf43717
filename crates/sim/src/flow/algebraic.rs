//! Algebraic parameters at an instant: the equations that determine them, their values and rates.

use std::collections::HashMap;

use super::FlowStage;
use super::coupled::algebra::AlgebraicError;
use super::coupled::equations::Equations;
use super::coupled::rows::{ComponentPlace, EquationTable, RowAggregate, VariableSource};
use super::coupled::system::System;
use crate::detect::signs::NEAR;
use crate::error::{Error, Unsolved};
use crate::world::context::Context;
use crate::world::{World, describe};
use dlsys_expr::{Dual, eliminate};
use dlsys_model::Model;
use dlsys_tree::{ModuleId, SimTime, Visit};

/// Algebraic parameters at an instant: where each belongs, their values before, and those that solve the equations.
pub struct Solved {
    pub places: Vec<ComponentPlace>,
    pub before: Vec<f64>,
    pub values: Vec<f64>,
}

/// True for a module with algebraic parameters that are kept consistent, not only computed on observation.
pub fn is_algebraic(model: &Model, world: &World, id: ModuleId) -> bool {
    let Some(state) = world.state(id) else { return false };
    let Some((rule, solve)) = state.rule.get().zip(state.solve.get()) else { return false };
    let algebraic = &model.rules[rule].solves[solve].algebraic;
    (0..algebraic.of.len()).any(|place| !algebraic.is_lazy(place))
}

/// The equations of the algebraic parameters of some modules at an instant, with everything else as it is, and their
/// values. `lazy`: of those that are computed only on observation.
fn instant_system(
    model: &Model,
    world: &World,
    at: SimTime,
    modules: &[ModuleId],
    lazy: bool,
) -> (System, Vec<f64>) {
    let rules = &model.rules;
    let mut table = EquationTable::at(at);
    table.is_complete = true;
    let mut number: HashMap<(ModuleId, usize), u32> = HashMap::new();
    let (mut y, mut values) = (Vec::new(), Vec::new());
    let mut given: Vec<Vec<u32>> = Vec::new();
    for &id in modules {
        let state = world.state(id).expect("a module with equations");
        let (rule, solve) = state.rule.get().zip(state.solve.get()).expect("a module with equations");
        let algebraic = &rules[rule].solves[solve].algebraic;
        let first = world.tree.places(id).start;
        values.clear();
        world.values(id, at, &mut values);
        let mut places = Vec::new();
        for (place, &parameter) in algebraic.of.iter().enumerate() {
            if algebraic.is_lazy(place) == lazy {
                number.insert((id, parameter), y.len() as u32);
                table.places.push(ComponentPlace::new(first, id, parameter));
                y.push(values[parameter]);
                places.push(place as u32);
            }
        }
        given.push(places);
    }
    let mut component = 0;
    for (&id, given) in modules.iter().zip(&given) {
        let state = world.state(id).expect("seen above");
        let (rule, solve) = state.rule.get().zip(state.solve.get()).expect("seen above");
        let compiled = &rules[rule];
        let sources_of = |module: ModuleId| -> Vec<VariableSource> {
            let mut values = Vec::new();
            world.values(module, at, &mut values);
            let source = |(i, x): (usize, &f64)| match number.get(&(module, i)) {
                Some(component) => VariableSource::State(*component),
                None => VariableSource::Fixed(*x),
            };
            values.iter().enumerate().map(source).collect()
        };
        let first_source = table.sources.len();
        for &module in std::iter::once(&id).chain(state.context.context()) {
            table.sources.extend(sources_of(module));
        }
        let row = table.rows.len() as u32;
        for aggregate in 0..compiled.aggregates.len() {
            let children = state.context.children(aggregate);
            let first = table.children.len();
            children.iter().for_each(|child| table.children.extend(sources_of(*child)));
            table.aggregates.push(RowAggregate { row, aggregate, first, count: children.len() });
            table.sources.push(VariableSource::Aggregate(table.aggregates.len() as u32 - 1));
        }
        table.sources.resize(first_source + compiled.variables - 2, VariableSource::Fixed(0.0));
        let switches = state.marks.switch_values();
        let birth = world.tree.birth(id);
        let sources = compiled.variables - 2;
        let shape = (first_source, sources);
        table.push_algebraic((rule, solve), shape, switches, (component, given), birth);
        component += given.len();
    }
    (System::new(table, rules), y)
}

impl FlowStage<'_, '_> {
    /// Solves for the algebraic parameters of some modules at the present instant.
    pub fn solve_algebraic(&self, modules: &[ModuleId]) -> Result<Solved, Error> {
        let (system, before) = instant_system(self.setup.model, self.world, self.instant.at, modules, false);
        let mut values = before.clone();
        let rules = &self.setup.model.rules;
        if let Err(fault) = Equations::new(&system, rules, None).make_consistent(0.0, &mut values) {
            let owner = system.owner(fault.component(), &self.world.tree);
            return Err(self.unsolved(fault, owner, self.instant.at));
        }
        Ok(Solved { places: system.table.places, before, values })
    }

    /// Brings the parameters up to date that are computed only on observation, of all modules, at an instant.
    pub fn refresh(&mut self, at: SimTime) -> Result<(), Error> {
        if !self.flows.lazy_algebra {
            return Ok(());
        }
        let lazy = |id: ModuleId| {
            let state = self.world.state(id)?;
            let algebraic = &self.setup.model.rules[state.rule.get()?].solves[state.solve.get()?].algebraic;
            (0..algebraic.of.len()).any(|place| algebraic.is_lazy(place)).then_some(id)
        };
        let wanted: Vec<ModuleId> = (self.world.tree.walk())
            .filter_map(|visit| match visit {
                Visit::Module(id) => lazy(id),
                _ => None,
            })
            .collect();
        let (system, mut y) = instant_system(self.setup.model, self.world, at, &wanted, true);
        let answer = Equations::new(&system, &self.setup.model.rules, None).make_consistent(0.0, &mut y);
        if let Err(fault) = answer {
            let owner = system.owner(fault.component(), &self.world.tree);
            return Err(self.unsolved(fault, owner, at));
        }
        for (of, &value) in system.table.places.iter().zip(&y) {
            self.world.tree.set_value(of.place as usize, value);
        }
        Ok(())
    }

    /// An error of the algebraic parameters of a module.
    pub fn unsolved(&self, fault: AlgebraicError, owner: Option<(ModuleId, usize)>, at: SimTime) -> Error {
        let (id, parameter) = owner.unwrap_or_else(|| (self.flows.anyone(self.world), 0));
        let state = self.world.state(id);
        let rule = state.and_then(|s| s.rule.get()).unwrap_or(0);
        let compiled = &self.setup.model.rules[rule];
        let span = state.and_then(|s| s.solve.get()).and_then(|solve| {
            let algebraic = &compiled.solves[solve].algebraic;
            let place = algebraic.of.iter().position(|p| *p == parameter)?;
            algebraic.spans.get(place).copied()
        });
        let mut site = self.world.site(self.setup.model, id, rule, span.unwrap_or(compiled.span), at);
        let mut values = Vec::new();
        self.world.values(id, at, &mut values);
        site.module = describe(self.setup.model, self.world.tree.kind(id), &values);
        let what = compiled.parameters.get(parameter).cloned().unwrap_or_default();
        let fault = match fault {
            AlgebraicError::Singular(_) => Unsolved::Singular,
            AlgebraicError::NoSolution(_) => Unsolved::Nothing,
            AlgebraicError::NotFinite(_) => Unsolved::NotFinite,
            AlgebraicError::Fading(_) => Unsolved::Fading,
            AlgebraicError::Rough(_) => Unsolved::Rough,
            AlgebraicError::Meeting(_) => Unsolved::Meeting,
        };
        Error::Unsolved { site, unknown: Box::new((what, fault)) }
    }

    /// Adds the rates of a module's algebraic parameters to those of the others: by differentiating their equations.
    pub fn algebraic_rates(&mut self, id: ModuleId, tau: f64, depth: usize, out: &mut [f64]) {
        let model = self.setup.model;
        let Some(state) = self.world.state(id) else { return };
        let (Some(rule), Some(solve)) = (state.rule.get(), state.solve.get()) else { return };
        let (compiled, switches) = (&model.rules[rule], state.marks.switches());
        let algebraic = &compiled.solves[solve].algebraic;
        let around: Context = state.context.clone();
        if algebraic.is_empty() || depth == 0 {
            return;
        }
        if let Some(known) = self.flows.known_rates.get(id, tau) {
            for (&parameter, rate) in algebraic.of.iter().zip(known) {
                out[parameter] = *rate;
            }
            return;
        }
        self.flows.known_rates.begin(id, tau, algebraic.of.len(), &around);
        let mut variables = Vec::new();
        self.neighbours_ahead(compiled, id, &around, tau, depth, out, &mut variables);
        variables.extend(switches.iter().map(|&on| Dual { value: f64::from(u8::from(on)), rate: 0.0 }));
        let mut left = vec![Dual { value: 0.0, rate: 0.0 }; algebraic.of.len()];
        // First the implicit ones: G z' = -(the rate of g while z stands still).
        let implicit: Vec<usize> =
            (0..algebraic.of.len()).filter(|place| !algebraic.explicit[*place]).collect();
        if !implicit.is_empty() {
            algebraic.values.eval(&variables, &mut Vec::new(), &mut left);
            let point: Vec<f64> = variables.iter().map(|v| v.value).collect();
            let mut partials = vec![0.0; algebraic.jacobian.values.outputs()];
            algebraic.jacobian.values.eval(&point, &mut self.scratch.registers, &mut partials);
            let n = implicit.len();
            let (mut matrix, mut right) = (vec![0.0; n * n], vec![0.0; n]);
            for (i, place) in implicit.iter().enumerate() {
                right[i] = -left[*place].rate;
                for (&(position, variable), value) in algebraic.jacobian.entries.iter().zip(&partials) {
                    let column = implicit.iter().position(|p| algebraic.of[*p] == variable);
                    if let Some(j) = column.filter(|_| position == *place) {
                        matrix[i * n + j] += value;
                    }
                }
            }
            if eliminate(&mut matrix, &mut right) > NEAR {
                for (place, rate) in implicit.iter().zip(right) {
                    out[algebraic.of[*place]] = rate;
                    variables[algebraic.of[*place]].rate = rate;
                }
            }
        }
        algebraic.values.eval(&variables, &mut Vec::new(), &mut left);
        for (place, value) in left.iter().enumerate().filter(|(place, _)| algebraic.explicit[*place]) {
            out[algebraic.of[place]] = if value.rate.is_finite() { value.rate } else { 0.0 };
        }
        self.flows.known_rates.set(id, tau, algebraic.of.iter().map(|&parameter| out[parameter]));
    }
}
