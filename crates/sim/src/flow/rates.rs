//! Rates of parameters at an instant, by the equations that are active there, and values a little ahead.

use super::FlowStage;
use crate::error::Error;
use crate::world::context::{Context, gather};
use dlsys_expr::Dual;
use dlsys_model::Rule;
use dlsys_tree::ModuleId;
use smallvec::SmallVec;

/// The number of neighbours in a row whose rates are followed for the rate of a value that depends on them, if none of
/// them is known yet.
const DEPTH: usize = 100;

impl FlowStage<'_, '_> {
    /// The variables of a module's rule with their rates, `tau` ahead of the present by Euler's method.
    pub fn moving_variables(&mut self, id: ModuleId, tau: f64, out: &mut Vec<Dual<f64>>) {
        out.clear();
        let state = self.world.state(id).expect("open modules have a state");
        let rule = &self.setup.model.rules[state.rule.get().expect("open modules have a rule")];
        let around = state.context.clone();
        self.variables_ahead(rule, id, &around, tau, rule.reads_context, DEPTH, out);
    }

    /// The variables of a rule, given the rates of the module's own parameters.
    #[allow(clippy::too_many_arguments)]
    pub fn neighbours_ahead(
        &mut self,
        rule: &Rule,
        id: ModuleId,
        around: &Context,
        tau: f64,
        depth: usize,
        own: &[f64],
        out: &mut Vec<Dual<f64>>,
    ) {
        self.variables_ahead(rule, id, around, tau, rule.reads_context, depth - 1, out);
        for (variable, &rate) in out.iter_mut().zip(own) {
            variable.rate = rate;
        }
    }

    /// The variables of a rule with their rates; those of neighbours are 0 if they are not read.
    #[allow(clippy::too_many_arguments)]
    fn variables_ahead(
        &mut self,
        rule: &Rule,
        id: ModuleId,
        around: &Context,
        tau: f64,
        reads_context: bool,
        depth: usize,
        out: &mut Vec<Dual<f64>>,
    ) {
        out.clear();
        let (mut values, mut rates) = (Vec::new(), Vec::new());
        let mut append = |me: &mut Self, module: ModuleId, out: &mut Vec<Dual<f64>>| {
            if module != id && !reads_context {
                values.clear();
                me.world.values(module, me.instant.at, &mut values);
                out.extend(values.iter().map(|&value| Dual { value, rate: 0.0 }));
                return;
            }
            me.ahead(module, tau, depth, &mut values);
            me.rates_to(module, tau, depth, &mut rates);
            out.extend(values.iter().zip(&rates).map(|(&value, &rate)| Dual { value, rate }));
        };
        for &module in std::iter::once(&id).chain(around.context()) {
            append(self, module, out);
        }
        let now = self.instant.at.to_f64() + tau;
        let age = self.instant.at.since(self.world.tree.birth(id)) + tau;
        let times = [now, age].map(|value| Dual { value, rate: 1.0 });
        let child = |child, out: &mut Vec<Dual<f64>>| append(self, child, out);
        gather(rule, around, times, out, &mut Vec::new(), |_| true, child);
    }

    /// A module's parameters a little ahead.
    fn ahead(&mut self, id: ModuleId, tau: f64, depth: usize, out: &mut Vec<f64>) {
        out.clear();
        self.world.values(id, self.instant.at, out);
        if tau != 0.0 {
            let mut rates = Vec::new();
            self.rates_to(id, 0.0, depth, &mut rates);
            for (value, rate) in out.iter_mut().zip(&rates) {
                *value += tau * rate;
            }
        }
    }

    /// The rates of a module's parameters now, by its present equations and known rates of others.
    pub fn rates_now(&mut self, id: ModuleId, out: &mut Vec<f64>) {
        self.rates_to(id, 0.0, DEPTH, out);
    }

    /// The error of a rate of a module that is no number now, or on the other side of a condition inside the equations, as that of an array
    /// beyond its end: it leads nowhere, and looks like equations that push against each other, or like events without end.
    pub fn undefined_rate(&mut self, id: ModuleId) -> Option<Error> {
        let sides = self.world.state(id)?.marks.switches();
        let mut rates = Vec::new();
        let others = std::iter::once(None).chain((0..sides.len()).map(Some));
        let parameter = others.into_iter().find_map(|other| {
            let mut turned = sides.clone();
            if let Some(side) = other.and_then(|other| turned.get_mut(other)) {
                *side = !*side;
            }
            self.world.state_mut(id)?.marks.set_switches(&turned);
            self.flows.known_rates.forget(id);
            self.rates_now(id, &mut rates);
            rates.iter().position(|rate| !rate.is_finite())
        });
        self.world.state_mut(id)?.marks.set_switches(&sides);
        self.flows.known_rates.forget(id);
        Some(self.world.rate_not_finite(self.setup.model, id, parameter?, self.instant.at))
    }

    /// The rates of a module's parameters a little ahead, by its present equations.
    pub fn rates_ahead(&mut self, id: ModuleId, tau: f64, out: &mut Vec<f64>) {
        self.flows.known_rates.clear();
        self.rates_to(id, tau, DEPTH, out);
    }

    /// The same; rates of algebraic parameters go back to neighbours so many times.
    fn rates_to(&mut self, id: ModuleId, tau: f64, depth: usize, out: &mut Vec<f64>) {
        out.clear();
        out.resize(self.world.tree.parameters(id).len(), 0.0);
        let model = self.setup.model;
        let Some(state) = self.world.state(id) else { return };
        let (Some(rule), Some(solve)) = (state.rule.get(), state.solve.get()) else { return };
        let solve = &model.rules[rule].solves[solve];
        if solve.of.is_empty() {
            return self.algebraic_rates(id, tau, depth, out);
        }
        let mut variables = Vec::new();
        if tau == 0.0 {
            self.world.variables(&model.rules[rule], id, &state.context, self.instant.at, &mut variables);
        } else {
            let around = state.context.clone();
            let mut values = Vec::new();
            for &module in std::iter::once(&id).chain(around.context()) {
                self.ahead(module, tau, depth, &mut values);
                variables.extend_from_slice(&values);
            }
            let times =
                [self.instant.at.to_f64() + tau, self.instant.at.since(self.world.tree.birth(id)) + tau];
            let child = |child, out: &mut Vec<f64>| {
                self.ahead(child, tau, depth, &mut values);
                out.extend_from_slice(&values);
            };
            gather(&model.rules[rule], &around, times, &mut variables, &mut Vec::new(), |_| true, child);
        }
        let state = self.world.state(id).expect("seen above");
        variables.extend(state.marks.switch_values());
        let mut rates: SmallVec<[f64; 4]> = smallvec::smallvec![0.0; solve.rates.outputs()];
        solve.rates.eval(&variables, &mut self.scratch.registers, &mut rates);
        self.log.stats.rhs_evaluations += 1;
        for (&parameter, rate) in solve.of.iter().zip(rates) {
            out[parameter] = rate;
        }
        self.algebraic_rates(id, tau, depth, out);
    }
}
