//! The world: the modules of the structure and how their parameters move.
//!
//! - [`World`]: the tree, the states of materialised modules, the lives of lazy ones, the solution of the coupled ones
//! - [`state`], [`states`]: rule, clause, signs and switches ([`marks`], [`short`]), trajectories and next event of one module, and of all of them
//! - [`trajectories`]: how the parameters of one module move
//! - [`path`], [`course`]: the variables of a rule along a stretch of time, and at one instant after another
//! - [`prefetch`]: memory that is asked for before it is read
//! - [`context`], [`neighbours`]: the modules that a rule reads, and the modules that read one
//! - [`life`]: lazy modules

pub mod context;
pub mod coupled_solution;
pub mod course;
pub mod life;
mod marks;
pub mod neighbours;
pub mod new_modules;
pub mod path;
pub mod prefetch;
mod short;
pub mod state;
pub mod states;
pub mod trajectories;

use crate::error::{Error, Site};
use context::{Context, gather};
use coupled_solution::CoupledSolution;
use dlsys_diagnostic::Span;
use dlsys_model::{KindId, Model, Rule};
use dlsys_tree::{Lineage, ModuleId, SimTime, Tree, Visit};
use life::Lives;
use smallvec::SmallVec;
use state::State;
use states::States;
use trajectories::Law;

/// The instant under examination: that of the last event, or that of an observation.
#[derive(Clone, Copy, Debug, Default)]
pub struct Instant {
    pub at: SimTime,
    /// Number of the last instant at which something happened.
    pub number: u64,
}

/// The growing structure with the trajectories of its parameters.
#[derive(Clone, Debug)]
pub struct World {
    /// Its values are those at the start of each trajectory.
    pub tree: Tree,
    /// Modules without rules have none, and lazy ones.
    pub states: States,
    /// Lazy modules: their labels in the tree are numbers of life classes.
    pub lives: Lives,
    /// How the coupled modules move.
    pub coupled: Option<CoupledSolution>,
    /// Number of changes of the structure.
    pub structure: u64,
    /// The number of the heights of the ground that hold now, for modules that read them.
    pub ground: f64,
    /// The time within which a field changes much that some rule reads; infinite if none does.
    pub stretch: f64,
}

impl World {
    /// A world without modules.
    pub fn new(model: &Model, kinds_with_context: &[bool]) -> World {
        let kinds = || model.kinds.iter().map(|(_, kind)| kind);
        let (widths, arities) = (kinds().map(|k| k.width() as u32), kinds().map(|k| k.arity as u32));
        World {
            tree: Tree::new(widths.collect(), arities.collect()),
            states: States::default(),
            lives: Lives::new(model, kinds_with_context),
            coupled: None,
            structure: 0,
            ground: 0.0,
            stretch: model.stretch(),
        }
    }

    /// The instant up to which a step of equations that read fields may go; `None` if no rule reads one.
    pub fn resolved(&self, from: SimTime) -> Option<SimTime> {
        /// In parts of the time within which a field changes much.
        const STEP: f64 = 8.0;
        self.stretch.is_finite().then(|| from.after(STEP * self.stretch))
    }

    /// The state of a living module that has one.
    pub fn state(&self, id: ModuleId) -> Option<&State> {
        self.states.get(id.slot()).filter(|s| s.id == id && s.is_alive)
    }

    pub fn state_mut(&mut self, id: ModuleId) -> Option<&mut State> {
        self.states.get_mut(id.slot()).filter(|s| s.id == id && s.is_alive)
    }

    /// The memory for a module's state; it may be that of another, dead one.
    pub fn make_state(&mut self, id: ModuleId) -> &mut State {
        self.states.make(id)
    }

    /// Gives a module an empty state.
    pub fn new_state(&mut self, id: ModuleId) -> &mut State {
        if let Some(state) = self.states.get_mut(id.slot()) {
            *state = State::new(id);
        }
        self.make_state(id)
    }

    /// True for a module that is alive and lazy.
    pub fn is_lazy(&self, id: ModuleId) -> bool {
        self.tree.label_if_alive(id).is_some_and(|label| self.lives.get(label).is_some())
    }

    /// The rule and the clause that a module lives under.
    pub fn rule_and_clause(&self, id: ModuleId) -> (Option<usize>, Option<usize>) {
        match self.lives.get(self.tree.label(id)) {
            Some(class) => (Some(class.rule), class.solve),
            None => self.state(id).map_or((None, None), |s| (s.rule.get(), s.solve.get())),
        }
    }

    /// A parameter, moving since `state.since` from the value `x`, at an instant.
    #[inline]
    fn moved(&self, state: &State, law: Law, x: f64, at: SimTime) -> f64 {
        match law {
            Law::Rest => x,
            Law::Step(component) => match state.trajectories.step().filter(|s| s.live) {
                Some(step) => step.dense.value(component as usize, step.dense.position(at)),
                None => x,
            },
            Law::Coupled(component) => match &self.coupled {
                Some(solution) => solution.value(component as usize, at).unwrap_or(x),
                None => x,
            },
            Law::Formula(formula) => formula.at(x, at.since(state.since).max(0.0)),
        }
    }

    /// The parameters of a module at an instant, appended to `out`; not of a lazy one, whose trajectories are not stored.
    pub fn values(&self, id: ModuleId, at: SimTime, out: &mut Vec<f64>) {
        debug_assert!(self.lives.get(self.tree.label(id)).is_none_or(|class| class.is_over_at_birth()));
        let values = self.tree.parameters(id);
        match self.state(id).filter(|s| !s.trajectories.is_empty()) {
            None => out.extend_from_slice(values),
            Some(state) => {
                let laws = state.trajectories.iter();
                out.extend(values.iter().zip(laws).map(|(&x, law)| self.moved(state, law, x, at)));
            }
        }
    }

    /// One parameter of a module at an instant.
    pub fn value(&self, id: ModuleId, parameter: usize, at: SimTime) -> f64 {
        let x = self.tree.parameters(id)[parameter];
        let moving = self.state(id).and_then(|s| Some((s, s.trajectories.get(parameter)?)));
        moving.map_or(x, |(state, law)| self.moved(state, law, x, at))
    }

    /// Makes the values at an instant those of the tree, and the trajectories begin there, all at rest.
    pub fn rebase(&mut self, id: ModuleId, at: SimTime) {
        self.rebase_except(id, at, &[]);
    }

    /// The same, but for parameters whose values then are given.
    pub fn rebase_except(&mut self, id: ModuleId, at: SimTime, given: &[(usize, f64)]) {
        let places = self.tree.places(id);
        let mut moved: SmallVec<[(usize, f64); 4]> = SmallVec::new();
        let Some(state) = self.state(id) else { return };
        for ((i, place), law) in places.enumerate().zip(state.trajectories.iter()) {
            if let Some(&(_, value)) = given.iter().find(|(parameter, _)| *parameter == i) {
                moved.push((place, value));
            } else if !matches!(law, Law::Rest) {
                moved.push((place, self.moved(state, law, self.tree.values()[place], at)));
            }
        }
        for (place, value) in moved {
            self.tree.set_value(place, value);
        }
        let Some(state) = self.state_mut(id) else { return };
        (state.since, state.horizon) = (at, f64::NAN);
        state.trajectories.rest();
    }

    /// The end of the stretch, from an instant on, in which all coupled components that a module reads follow one polynomial.
    pub fn knot(&self, state: &State, solution: &CoupledSolution, from: SimTime) -> SimTime {
        let mut knot = solution.end;
        if solution.is_whole() {
            return knot;
        }
        for &id in std::iter::once(&state.id).chain(&state.context) {
            for component in self.state(id).into_iter().flat_map(|s| s.trajectories.coupled()) {
                let end = solution.knot(component as usize, from);
                if end.since(knot) < 0.0 {
                    knot = end;
                }
            }
        }
        knot
    }

    /// The variables of a rule at an instant: parameters, those of the context, aggregates, `t` and `age`.
    pub fn variables(&self, rule: &Rule, id: ModuleId, around: &Context, at: SimTime, out: &mut Vec<f64>) {
        out.clear();
        self.values(id, at, out);
        for module in around.context() {
            self.values(*module, at, out);
        }
        let time = [at.to_f64(), at.since(self.tree.birth(id))];
        if rule.aggregates.is_empty() {
            out.resize(rule.variables - 2, 0.0);
            out.extend(time);
            return;
        }
        let values = |child, out: &mut Vec<f64>| self.values(child, at, out);
        gather(rule, around, time, out, &mut Vec::new(), |_| true, values);
    }

    /// The same where only some variables are read: the others may be any number.
    pub fn variables_read(
        &self,
        (rule, reads): (&Rule, &[bool]),
        id: ModuleId,
        around: &Context,
        at: SimTime,
        out: &mut Vec<f64>,
    ) {
        if !rule.aggregates.is_empty() {
            return self.variables(rule, id, around, at, out);
        }
        out.clear();
        self.values(id, at, out);
        let context = reads.get(out.len()..rule.variables - 2).unwrap_or_default();
        if context.contains(&true) {
            around.context().iter().for_each(|module| self.values(*module, at, out));
        }
        out.resize(rule.variables - 2, 0.0);
        out.extend([at.to_f64(), at.since(self.tree.birth(id))]);
    }

    /// The modules of the kinds that are marked, in string order.
    pub fn modules_of<'w>(&'w self, kinds: &'w [bool]) -> impl Iterator<Item = ModuleId> + 'w {
        self.tree.walk().filter_map(|visit| match visit {
            Visit::Module(id) if kinds[self.tree.kind(id).index()] => Some(id),
            _ => None,
        })
    }

    /// The place of an error: a module with the values of the tree, and a rule.
    pub fn site(&self, model: &Model, id: ModuleId, rule: usize, span: Span, at: SimTime) -> Site {
        Site {
            module: describe(model, self.tree.kind(id), self.tree.parameters(id)),
            lineage: self.tree.lineage(id),
            rule: model.rules[rule].label.clone(),
            span,
            time: at.to_f64(),
        }
    }

    /// The error of a parameter that is no finite number.
    pub fn not_finite(&self, model: &Model, id: ModuleId, parameter: usize, at: SimTime) -> Error {
        self.no_number(model, id, parameter, at, str::to_owned)
    }

    /// The error of a parameter the rate of which is no finite number.
    pub fn rate_not_finite(&self, model: &Model, id: ModuleId, parameter: usize, at: SimTime) -> Error {
        self.no_number(model, id, parameter, at, |name| format!("the rate of {name}"))
    }

    fn no_number(
        &self,
        model: &Model,
        id: ModuleId,
        parameter: usize,
        at: SimTime,
        what: impl Fn(&str) -> String,
    ) -> Error {
        let (rule, solve) = self.rule_and_clause(id);
        let rule_index = rule.unwrap_or(0);
        let compiled = &model.rules[rule_index];
        let span = solve.map_or(compiled.span, |s| compiled.solves[s].span);
        let site = self.site(model, id, rule_index, span, at);
        if let Some(clock) = compiled.clocks.iter().find(|clock| clock.parameter == parameter) {
            let span = compiled.produces[clock.produce].span;
            return Error::NotFinite { site: Site { span, ..site }, what: "the rate of an event".to_owned() };
        }
        let name = compiled.parameters.get(parameter).map_or("", String::as_str);
        Error::NotFinite { site, what: what(name) }
    }

    /// The place of a module with the clause that it follows, or the production that it is about to make, as far as it is
    /// known.
    pub fn site_of_module(&self, model: &Model, id: ModuleId, at: SimTime) -> Site {
        if let Some(class) = self.lives.get(self.tree.label(id)) {
            let rule = &model.rules[class.rule];
            let span = class.produce().map_or(rule.span, |p| rule.produces[p].span);
            return self.site(model, id, class.rule, span, at);
        }
        let kind = model.kinds.get(self.tree.kind(id));
        let own = self.state(id).and_then(|state| Some((state.rule.get()?, state.solve.get())));
        let first = || kind.rules.first().or(kind.steps.first()).copied().unwrap_or(0);
        let (rule, solve) = own.unwrap_or_else(|| (first(), None));
        let Some(found) = model.rules.get(rule) else { return site_of_axiom(at.to_f64()) };
        let span = solve.map_or(found.span, |solve| found.solves[solve].span);
        self.site(model, id, rule, span, at)
    }

    /// The place of an error that concerns no module in particular: the first one, if there is one.
    pub fn site_of_first(&self, model: &Model, at: SimTime) -> Site {
        let first = self.tree.walk().find_map(|visit| match visit {
            Visit::Module(id) => Some(id),
            _ => None,
        });
        match first {
            Some(id) => self.site_of_module(model, id, at),
            None => site_of_axiom(at.to_f64()),
        }
    }

    /// The place of an error in the rule that a module lives under.
    pub fn site_of_rule(&self, model: &Model, id: ModuleId, at: SimTime) -> Site {
        let rule = self.rule_and_clause(id).0.unwrap_or(0);
        self.site(model, id, rule, model.rules[rule].span, at)
    }
}

/// The place of an error where no module can be named.
pub fn site_of_axiom(time: f64) -> Site {
    Site {
        module: "the initial string".to_owned(),
        lineage: Lineage::of_axiom(0),
        rule: "initial string".to_owned(),
        span: Span::default(),
        time,
    }
}

/// A module as it is written, numbers to six digits, whole ones to all that they have: for people.
pub fn describe(model: &Model, kind: KindId, parameters: &[f64]) -> String {
    let (name, arity) = (&model.kinds.get(kind).name, model.kinds.get(kind).arity);
    // Hidden parameters are no part of how it is written.
    let parameters = &parameters[..parameters.len().min(arity)];
    if parameters.is_empty() {
        return name.clone();
    }
    // A count that looks exact is.
    let is_whole = |x: f64| x != 0.0 && x.fract() == 0.0 && x.abs() < 1e15;
    let shown: Vec<String> =
        parameters.iter().map(|x| if is_whole(*x) { x.to_string() } else { brief(*x, 6) }).collect();
    format!("{name}({})", shown.join(", "))
}

/// A number to some digits, with an exponent where that is shorter: for people.
pub fn brief(x: f64, digits: usize) -> String {
    let rounded: f64 = format!("{x:.*e}", digits - 1).parse().unwrap_or(x);
    let (plain, exponent) = (rounded.to_string(), format!("{rounded:e}"));
    if plain.len() <= digits + 6 { plain } else { exponent }
}
