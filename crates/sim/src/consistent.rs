//! Consistent values: what is given by a value or an equation, at an instant.
//!
//! When modules are born, change their equations or get other neighbours, their algebraic parameters are solved for
//! before anything is judged, together with those of all modules that depend on them. What nobody but the drawing and
//! successors read is not kept up to date: it is computed when somebody looks.

use std::collections::HashMap;

use super::algebra::Fault;
use super::around::Around;
use super::equations::Equations;
use super::error::{Error, Unsolved};
use super::lookup::NEAR;
use super::simulation::Simulation;
use super::system::{Source, Sum, System};
use dlsys_expr::{Dual, eliminate};
use dlsys_model::{Model, Truth};
use dlsys_tree::{ModuleId, SimTime, Visit};

/// Values that differ by more than so many tolerances have jumped; less is what they may err by.
const JUMP: f64 = 10.0;
/// Most times at one instant that values change, and what they decide with them.
const MAX_ROUNDS: usize = 100;

/// What is known of a model's algebraic parameters.
#[derive(Clone, Debug, Default)]
pub struct Consistency {
    /// There are some.
    pub any: bool,
    /// Some are computed only when somebody looks.
    lazy: bool,
    /// Times that values have changed at the present instant.
    rounds: usize,
}

impl Consistency {
    pub fn new(model: &Model) -> Consistency {
        let mut all = model.rules.iter().flat_map(|rule| &rule.solves).map(|solve| &solve.algebraic);
        let lazy = all.clone().any(|a| (0..a.of.len()).any(|place| a.is_lazy(place)));
        Consistency { any: all.any(|a| !a.is_empty()), lazy, rounds: 0 }
    }
}

impl Simulation<'_> {
    /// Says that another instant begins.
    pub(super) fn begin_levelling(&mut self) {
        self.algebra.rounds = 0;
    }

    /// Makes the algebraic parameters consistent of all modules that the instant concerns. `chosen`: they have their
    /// equations, and what has been followed may have jumped. True if something has changed that conditions may read.
    pub(super) fn level(&mut self, chosen: bool) -> Result<bool, Error> {
        if !self.algebra.any {
            return Ok(false);
        }
        self.algebra.rounds += 1;
        let mut wanted: Vec<ModuleId> = Vec::new();
        for &id in self.opened.iter().chain(&self.ready) {
            let Some(state) = self.plant.state_mut(id) else { continue };
            let Some(rule) = state.rule.map(|r| &self.model.rules[r]) else { continue };
            let elsewhere = state.open.as_ref().is_none_or(|open| open.flow.is_none());
            if !chosen && !elsewhere {
                continue;
            }
            if state.solve.is_none() && !chosen {
                // The equations that it is going to have, as far as can be told.
                let signs = &state.signs;
                let may = |guard: &dlsys_model::Condition| guard.judge(|i| signs[i]) != Truth::No;
                state.solve = rule.solves.iter().position(|s| may(&s.guard));
                let switches = state.solve.map_or(&[][..], |s| &rule.solves[s].switches);
                state.switches = switches.iter().map(|s| may(&s.condition)).collect();
            }
            wanted.push(id);
        }
        // One that has got several rules at the instant is there several times.
        let mut once = std::collections::HashSet::new();
        wanted.retain(|id| once.insert(*id));
        // And whoever depends on them.
        let mut known: std::collections::HashSet<ModuleId> = wanted.iter().copied().collect();
        let mut at = 0;
        while at < wanted.len() {
            let mut found = Vec::new();
            self.readers(wanted[at], |reader, _| found.push(reader));
            found.retain(|id| self.is_algebraic(*id) && known.insert(*id));
            wanted.append(&mut found);
            at += 1;
        }
        wanted.retain(|id| self.is_algebraic(*id));
        if wanted.is_empty() {
            return Ok(false);
        }
        let (system, y) = self.instant_system(&wanted, false);
        let mut solved = y.clone();
        let answer = Equations::new(&system, &self.model.rules, None).make_consistent(0.0, &mut solved);
        if let Err(fault) = answer {
            return Err(self.unsolved(fault, system.owner(fault.component()), self.now));
        }
        let mut changed: Vec<ModuleId> = Vec::new();
        for ((&(_, id, parameter), &before), &value) in system.places.iter().zip(&y).zip(&solved) {
            let state = self.plant.state(id).expect("wanted");
            let in_question = self.ready.contains(&id) && state.open.is_none();
            let elsewhere = in_question || state.open.as_ref().is_some_and(|open| open.flow.is_none());
            let size = value.abs().max(before.abs()).max(1.0);
            let step = (value - before).abs();
            let jumps = step > JUMP * self.settings.tolerance * size;
            if !(jumps || elsewhere && value.to_bits() != before.to_bits()) {
                continue;
            }
            self.plant.materialise(id, self.now);
            let place = self.plant.tree.places(id).start + parameter;
            self.plant.tree.set_value(place, value);
            if jumps || step > 1e-12 * size {
                changed.push(id);
            }
        }
        changed.dedup();
        if changed.is_empty() {
            return Ok(false);
        }
        let mut again = changed.clone();
        for &id in &changed {
            self.readers(id, |reader, _| again.push(reader));
        }
        again.sort_unstable();
        again.dedup();
        let mut matters = false;
        for id in again {
            matters |= self.place_again(id, changed.contains(&id));
        }
        if matters && self.algebra.rounds > MAX_ROUNDS {
            let id = changed[0];
            let rule = self.plant.state(id).and_then(|s| s.rule).unwrap_or(0);
            let site = self.site_of(id, rule, self.model.rules[rule].span, self.now.to_f64());
            return Err(Error::Chattering { site });
        }
        Ok(matters)
    }

    /// Judges the signs of a module anew by its values; true if it has any.
    fn place_again(&mut self, id: ModuleId, own: bool) -> bool {
        let Some(state) = self.plant.state(id) else { return false };
        let Some(rule) = state.rule else { return false };
        let compiled = &self.model.rules[rule];
        let is_open = state.open.is_some();
        // What was followed here has its signs, unless it has jumped itself.
        if !own && is_open && state.open.as_ref().is_some_and(|open| open.flow.is_some()) {
            return false;
        }
        if compiled.atoms.is_empty() {
            if own && !is_open && !self.ready.contains(&id) {
                self.ready.push(id);
            }
            return false;
        }
        self.plant.materialise(id, self.now);
        let around = self.plant.state(id).expect("seen above").context.clone();
        let (signs, clear) = self.signs_of_values(id, compiled, &around, None);
        let now = self.now;
        let state = self.plant.state_mut(id).expect("seen above");
        state.pass_changes(now);
        let same = is_open && state.signs == signs && state.open.as_ref().is_some_and(|o| o.at == signs);
        state.signs = signs;
        state.place(clear);
        if !is_open {
            self.opened.push(id);
            self.ready.retain(|other| *other != id);
        }
        !same
    }

    fn is_algebraic(&self, id: ModuleId) -> bool {
        let Some(state) = self.plant.state(id) else { return false };
        let Some((rule, solve)) = state.rule.zip(state.solve) else { return false };
        let algebraic = &self.model.rules[rule].solves[solve].algebraic;
        (0..algebraic.of.len()).any(|place| !algebraic.is_lazy(place))
    }

    /// The equations of the algebraic parameters of some modules at the present instant, with everything else as it is;
    /// and their values. `lazy`: of those that are computed when somebody looks.
    fn instant_system(&self, modules: &[ModuleId], lazy: bool) -> (System, Vec<f64>) {
        let rules = &self.model.rules;
        let mut system = System::at(self.now);
        let mut number: HashMap<(ModuleId, usize), u32> = HashMap::new();
        let (mut y, mut values) = (Vec::new(), Vec::new());
        let mut given: Vec<Vec<u32>> = Vec::new();
        for &id in modules {
            let state = self.plant.state(id).expect("a module with equations");
            let (rule, solve) = state.rule.zip(state.solve).expect("a module with equations");
            let algebraic = &rules[rule].solves[solve].algebraic;
            let first = self.plant.tree.places(id).start;
            values.clear();
            self.plant.values(id, self.now, &mut values);
            let mut places = Vec::new();
            for (place, &parameter) in algebraic.of.iter().enumerate() {
                if algebraic.is_lazy(place) == lazy {
                    number.insert((id, parameter), y.len() as u32);
                    system.places.push((first + parameter, id, parameter));
                    y.push(values[parameter]);
                    places.push(place as u32);
                }
            }
            given.push(places);
        }
        let mut component = 0;
        for (&id, given) in modules.iter().zip(&given) {
            let state = self.plant.state(id).expect("seen above");
            let (rule, solve) = state.rule.zip(state.solve).expect("seen above");
            let compiled = &rules[rule];
            let sources_of = |module: ModuleId| -> Vec<Source> {
                let mut values = Vec::new();
                self.plant.values(module, self.now, &mut values);
                let source = |(i, x): (usize, &f64)| match number.get(&(module, i)) {
                    Some(component) => Source::State(*component),
                    None => Source::Fixed(*x),
                };
                values.iter().enumerate().map(source).collect()
            };
            let first_source = system.sources.len();
            for &module in std::iter::once(&id).chain(state.context.context()) {
                system.sources.extend(sources_of(module));
            }
            let row = system.rows.len() as u32;
            for aggregate in 0..compiled.aggregates.len() {
                let children = state.context.children(aggregate);
                let first = system.children.len();
                children.iter().for_each(|child| system.children.extend(sources_of(*child)));
                system.sums.push(Sum { row, aggregate, first, count: children.len() });
                system.sources.push(Source::Sum(system.sums.len() as u32 - 1));
            }
            system.sources.resize(first_source + compiled.variables - 2, Source::Fixed(0.0));
            let switches = state.switches.iter().map(|&on| f64::from(u8::from(on)));
            let birth = self.plant.tree.birth(id);
            let sources = compiled.variables - 2;
            let shape = (first_source, sources);
            system.push_instant((rule, solve), shape, switches, (component, given), birth);
            component += given.len();
        }
        system.finish(rules);
        (system, y)
    }

    /// Brings up to date what is computed only when somebody looks, of all modules, at an instant.
    pub(super) fn refresh(&mut self, at: SimTime) -> Result<(), Error> {
        if !self.algebra.lazy {
            return Ok(());
        }
        let lazy = |id: ModuleId| {
            let state = self.plant.state(id)?;
            let algebraic = &self.model.rules[state.rule?].solves[state.solve?].algebraic;
            (0..algebraic.of.len()).any(|place| algebraic.is_lazy(place)).then_some(id)
        };
        let wanted: Vec<ModuleId> = (self.plant.tree.walk())
            .filter_map(|visit| match visit {
                Visit::Module(id) => lazy(id),
                _ => None,
            })
            .collect();
        let now = std::mem::replace(&mut self.now, at);
        let (system, mut y) = self.instant_system(&wanted, true);
        self.now = now;
        let answer = Equations::new(&system, &self.model.rules, None).make_consistent(0.0, &mut y);
        if let Err(fault) = answer {
            return Err(self.unsolved(fault, system.owner(fault.component()), at));
        }
        for (&(place, ..), &value) in system.places.iter().zip(&y) {
            self.plant.tree.set_value(place, value);
        }
        Ok(())
    }

    /// True if a successor of a rule may read what is computed only when somebody looks.
    pub(super) fn reads_lazily(&self) -> bool {
        self.algebra.lazy
    }

    /// An error of the algebraic parameters of a module.
    pub(super) fn unsolved(&self, fault: Fault, owner: Option<(ModuleId, usize)>, at: SimTime) -> Error {
        let (id, parameter) = owner.unwrap_or_else(|| (self.anyone(), 0));
        let state = self.plant.state(id);
        let rule = state.and_then(|s| s.rule).unwrap_or(0);
        let compiled = &self.model.rules[rule];
        let span = state.and_then(|s| s.solve).and_then(|solve| {
            let algebraic = &compiled.solves[solve].algebraic;
            let place = algebraic.of.iter().position(|p| *p == parameter)?;
            algebraic.spans.get(place).copied()
        });
        let mut site = self.site_of(id, rule, span.unwrap_or(compiled.span), at.to_f64());
        let mut values = Vec::new();
        self.plant.values(id, at, &mut values);
        site.module = super::describe(self.model, self.plant.tree.kind(id), &values);
        let what = compiled.parameters.get(parameter).cloned().unwrap_or_default();
        let fault = match fault {
            Fault::Singular(_) => Unsolved::Singular,
            Fault::None(_) => Unsolved::Nothing,
            Fault::NotFinite(_) => Unsolved::NotFinite,
            Fault::Fading(_) => Unsolved::Fading,
            Fault::Rough(_) => Unsolved::Rough,
        };
        Error::Unsolved { site, unknown: Box::new((what, fault)) }
    }

    /// Adds the rates of a module's algebraic parameters to those of the others: by differentiating their equations.
    pub(super) fn algebraic_rates(&mut self, id: ModuleId, tau: f64, depth: usize, out: &mut [f64]) {
        let model = self.model;
        let Some(state) = self.plant.state(id) else { return };
        let (Some(rule), Some(solve)) = (state.rule, state.solve) else { return };
        let (compiled, switches) = (&model.rules[rule], state.switches.clone());
        let algebraic = &compiled.solves[solve].algebraic;
        let around: Around = state.context.clone();
        if algebraic.is_empty() || depth == 0 {
            return;
        }
        if let Some(known) = self.known_rates.get(id, tau) {
            for (&parameter, rate) in algebraic.of.iter().zip(known) {
                out[parameter] = *rate;
            }
            return;
        }
        self.known_rates.begin(id, tau, algebraic.of.len(), &around);
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
            algebraic.jacobian.values.eval(&point, &mut self.scratch, &mut partials);
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
        self.known_rates.set(id, tau, algebraic.of.iter().map(|&parameter| out[parameter]));
    }
}
