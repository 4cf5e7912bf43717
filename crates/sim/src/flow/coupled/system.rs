//! The equations of the coupled modules between two changes of structure.

use crate::flow::coupled::aggregates::Partial;
use crate::flow::coupled::algebra::Algebra;
use crate::flow::coupled::lanes::LaneBatches;
use crate::flow::coupled::prefetch::prefetch;
use crate::trajectory::Trajectory;
use crate::world::World;
use crate::world::coupled_solution::CoupledSolution;
use crate::world::state::State;
use dlsys_model::{Rule, Solve};
use dlsys_tree::{ModuleId, SimTime};
use smallvec::SmallVec;

/// A rule and one of its aggregates.
type Term = (usize, usize);

/// Where a variable of a rule comes from.
#[derive(Clone, Copy, Debug)]
pub enum Source {
    /// It does not change before the next event.
    Fixed(f64),
    /// A component of the state vector.
    State(u32),
    /// A formula.
    Formula(u32),
    /// A component of the coupled modules that is no unknown here: it is known already how it moves.
    Input(u32),
    /// An aggregate.
    Sum(u32),
}

/// The equations of the coupled modules.
#[derive(Clone, Debug, Default)]
pub struct System {
    pub rows: Vec<Row>,
    pub sources: Vec<Source>,
    pub formulas: Vec<Formula>,
    /// Aggregates, and what their children are.
    pub sums: Vec<Sum>,
    pub children: Vec<Source>,
    /// Numbers of aggregates with their children, as many as are worked on together, by rule and number of the aggregate.
    pub folds: Vec<(Term, Vec<(u32, u32)>)>,
    pub algebra: Algebra,
    /// Of each algebraic component of each row: its place among the algebraic parameters of the clause.
    given: Vec<u32>,
    /// Components of the coupled modules that are read.
    inputs: Vec<u32>,
    pub columns: LaneBatches,
    pub switches: Vec<f64>,
    /// Place in the tree's values, and owner with its parameter, of each component.
    pub places: Vec<(usize, ModuleId, usize)>,
    pub start: SimTime,
    /// Some rates read the time of the simulation.
    pub timed: bool,
}

/// A parameter that follows a formula, as an input.
#[derive(Clone, Debug)]
pub struct Formula {
    pub trajectory: Trajectory,
    pub x: f64,
    since: SimTime,
    /// Time since then, at the start of the step.
    pub offset: f64,
}

/// The equations of one module.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    pub rule: usize,
    pub solve: usize,
    pub numeric_only: bool,
    pub first_source: usize,
    pub sources: usize,
    first_switch: usize,
    switches: usize,
    pub first_rate: usize,
    /// Components that are integrated; after them come those that are solved for.
    pub rates: usize,
    pub algebraic: usize,
    first_given: usize,
    birth: SimTime,
    pub age: f64,
}

/// An aggregate of a row.
#[derive(Clone, Copy, Debug)]
pub struct Sum {
    pub row: u32,
    /// Number among the aggregates of the rule.
    pub aggregate: usize,
    /// Where the parameters of the children begin, one child after another.
    pub first: usize,
    pub count: usize,
}

/// More modules than this are not likely to be in the processor's caches.
const REGION: usize = 256;

impl System {
    /// Makes these the equations of some of the coupled modules. `unknown` gives the number here of a component, in the
    /// order of the members; None if it is not integrated here. If `frozen`, neighbours are taken as they are at the
    /// start.
    pub fn rebuild(
        &mut self,
        rules: &[Rule],
        world: &World,
        members: &[ModuleId],
        start: SimTime,
        unknown: impl Fn(u32) -> Option<u32>,
        frozen: bool,
    ) {
        let system = self;
        system.start = start;
        system.timed = false;
        system.rows.clear();
        system.sources.clear();
        system.formulas.clear();
        system.inputs.clear();
        system.switches.clear();
        system.places.clear();
        system.sums.clear();
        system.children.clear();
        system.given.clear();
        for (at, &id) in members.iter().enumerate() {
            // A region has just been visited.
            if members.len() > REGION {
                prefetch(world, members, at);
            }
            let state = world.state(id).expect("members have states");
            let first = world.tree.places(id).start;
            let (Some(rule), Some(solve)) = (state.rule, state.solve) else { continue };
            let (compiled, clause) = (&rules[rule], &rules[rule].solves[solve]);
            system.timed |= clause.stepping.is_timed();
            let first_rate = system.places.len();
            for &parameter in clause.stepping.components(state.numeric_only) {
                if let Some(Trajectory::Coupled(_)) = state.trajectories.get(parameter) {
                    system.places.push((first + parameter, id, parameter));
                }
            }
            let count = system.places.len() - first_rate;
            if count == 0 {
                continue;
            }
            let first_source = system.sources.len();
            if frozen || !compiled.aggregates.is_empty() {
                for &module in std::iter::once(&id).chain(state.context.context()) {
                    let sources = system.sources_of(world, module, frozen && module != id, &unknown);
                    system.sources.extend(sources);
                }
            } else {
                // NextKind is not read may be any number.
                system.sources.resize(first_source + compiled.variables - 2, Source::Fixed(0.0));
                for read in clause.stepping.reads() {
                    let (module, moves) = match read.neighbour.map(|n| state.context.context()[n]) {
                        None => (id, Some(state)),
                        Some(module) => (module, world.state(module)),
                    };
                    let x = || world.tree.parameters(module)[read.parameter];
                    let source = system.source(moves, read.parameter, x, &unknown);
                    system.sources[first_source + read.variable] = source;
                }
            }
            let row = system.rows.len() as u32;
            for aggregate in 0..compiled.aggregates.len() {
                let children = state.context.children(aggregate);
                let first = system.children.len();
                for &child in children {
                    let sources = system.sources_of(world, child, frozen, &unknown);
                    system.children.extend(sources);
                }
                system.sums.push(Sum { row, aggregate, first, count: children.len() });
                system.sources.push(Source::Sum(system.sums.len() as u32 - 1));
            }
            system.sources.resize(first_source + compiled.variables - 2, Source::Fixed(0.0));
            let integrated = rates(clause, state.numeric_only);
            let first_switch = system.switches.len();
            system.switches.extend(state.switches.iter().map(|&on| f64::from(u8::from(on))));
            let birth = world.tree.birth(id);
            system.rows.push(Row {
                rule,
                solve,
                numeric_only: state.numeric_only,
                first_source,
                sources: system.sources.len() - first_source,
                first_switch,
                switches: system.switches.len() - first_switch,
                first_rate,
                rates: integrated,
                algebraic: count - integrated,
                first_given: system.given.len(),
                birth,
                age: start.since(birth),
            });
            let solved = |place: &usize| clause.algebraic.is_solved(*place, state.numeric_only);
            let given = (0..clause.algebraic.of.len()).filter(solved);
            system.given.extend(given.map(|place| place as u32));
        }
        system.finish(rules);
    }

    /// Where a parameter comes from that has the value `x()` in the tree, of a module with this state.
    #[inline]
    fn source(
        &mut self,
        state: Option<&State>,
        parameter: usize,
        x: impl Fn() -> f64,
        unknown: impl Fn(u32) -> Option<u32>,
    ) -> Source {
        let Some((state, trajectory)) = state.and_then(|s| Some((s, s.trajectories.get(parameter)?))) else {
            return Source::Fixed(x());
        };
        match trajectory {
            Trajectory::Rest | Trajectory::Step(_) => Source::Fixed(x()),
            Trajectory::Coupled(component) => match unknown(*component) {
                Some(number) => Source::State(number),
                None => {
                    self.inputs.push(*component);
                    Source::Input(self.inputs.len() as u32 - 1)
                }
            },
            trajectory => {
                let (since, offset) = (state.since, self.start.since(state.since));
                self.formulas.push(Formula { trajectory: trajectory.clone(), x: x(), since, offset });
                Source::Formula(self.formulas.len() as u32 - 1)
            }
        }
    }

    /// Where all parameters of a module come from; what they are at the start, if they are frozen.
    fn sources_of(
        &mut self,
        world: &World,
        module: ModuleId,
        frozen: bool,
        unknown: impl Fn(u32) -> Option<u32>,
    ) -> SmallVec<[Source; 8]> {
        if frozen {
            let mut then = Vec::new();
            world.values(module, self.start, &mut then);
            return then.into_iter().map(Source::Fixed).collect();
        }
        let (values, state) = (world.tree.parameters(module).iter().enumerate(), world.state(module));
        values.map(|(i, &x)| self.source(state, i, || x, &unknown)).collect()
    }

    /// A system without rows.
    pub fn at(start: SimTime) -> System {
        System { start, ..System::default() }
    }

    /// Completes a system of rows.
    pub fn finish(&mut self, rules: &[Rule]) {
        self.algebra = Algebra::new(self, rules);
        self.put_together();
        let mut columns = std::mem::take(&mut self.columns);
        columns.fill(self, rules);
        self.columns = columns;
    }

    /// Adds the equations of algebraic parameters of a module alone, of which are given their first component and their
    /// places. The sources of the row, and the children, have been added.
    pub fn push_instant(
        &mut self,
        (rule, solve): (usize, usize),
        (first_source, sources): (usize, usize),
        switches: impl Iterator<Item = f64>,
        (first_rate, given): (usize, &[u32]),
        birth: SimTime,
    ) {
        let first_switch = self.switches.len();
        self.switches.extend(switches);
        self.rows.push(Row {
            rule,
            solve,
            numeric_only: false,
            first_source,
            sources,
            first_switch,
            switches: self.switches.len() - first_switch,
            first_rate,
            rates: 0,
            algebraic: given.len(),
            first_given: self.given.len(),
            birth,
            age: self.start.since(birth),
        });
        self.given.extend_from_slice(given);
    }

    /// The place of each algebraic component of a row among the algebraic parameters of its clause.
    pub fn given(&self, row: &Row) -> &[u32] {
        &self.given[row.first_given..row.first_given + row.algebraic]
    }

    /// The switches of a row.
    pub fn switches_of(&self, row: &Row) -> &[f64] {
        &self.switches[row.first_switch..row.first_switch + row.switches]
    }

    /// NextKind the components that are read are at a time after the start; NaN where that is not known.
    pub fn read(&self, solution: Option<&CoupledSolution>, tau: f64, out: &mut Vec<f64>) {
        out.clear();
        if self.inputs.is_empty() {
            return;
        }
        let at = self.start.after(tau);
        for &component in &self.inputs {
            out.push(solution.and_then(|c| c.value(component as usize, at)).unwrap_or(f64::NAN));
        }
    }

    /// NextKind a source is; an aggregate is none.
    pub fn value(&self, source: Source, tau: f64, y: &[f64], inputs: &[f64]) -> f64 {
        match source {
            Source::Sum(_) => 0.0,
            Source::Input(i) => inputs[i as usize],
            Source::Fixed(x) => x,
            Source::State(component) => y[component as usize],
            Source::Formula(i) => {
                let Formula { trajectory, x, offset, .. } = &self.formulas[i as usize];
                x + trajectory.value(offset + tau)
            }
        }
    }

    /// `t`, or the age of a row's module.
    pub fn time(&self, row: &Row, which: usize, tau: f64) -> f64 {
        if which == 0 { self.start.to_f64() + tau } else { row.age + tau }
    }

    /// Moves the start of the step.
    pub fn advance(&mut self, start: SimTime) {
        self.start = start;
        for row in &mut self.rows {
            row.age = start.since(row.birth);
        }
        for formula in &mut self.formulas {
            formula.offset = start.since(formula.since);
        }
    }

    /// The variables of a row's rule, `inputs` being what it reads besides.
    pub fn variables(
        &self,
        rules: &[Rule],
        row: &Row,
        tau: f64,
        y: &[f64],
        inputs: &[f64],
        out: &mut Vec<f64>,
    ) {
        out.clear();
        let sources = &self.sources[row.first_source..row.first_source + row.sources];
        out.extend(sources.iter().map(|source| self.value(*source, tau, y, inputs)));
        out.extend([self.start.to_f64() + tau, row.age + tau]);
        self.gather(rules, row, tau, y, inputs, out);
        out.extend_from_slice(self.switches_of(row));
    }

    /// Calls a function with each partial derivative of one module's rates by a component that is integrated.
    pub fn row_partials(&self, rules: &[Rule], row: &Row, mut each: impl FnMut(u32, Partial)) {
        let solve = &rules[row.rule].solves[row.solve];
        self.visit_partials(rules, row, &solve.jacobian, |partial| {
            let position = solve.jacobian.entries[partial.entry].0;
            let rate = if row.numeric_only {
                Some(position)
            } else {
                solve.numeric.iter().position(|p| *p == position)
            };
            if let Some(rate) = rate
                && !self.algebra.is_solved(partial.component)
            {
                each((row.first_rate + rate) as u32, partial);
            }
        });
    }

    /// The module, and its parameter, that a component belongs to.
    pub fn owner(&self, component: usize) -> Option<(ModuleId, usize)> {
        self.places.get(component).map(|&(_, id, parameter)| (id, parameter))
    }
}

/// The number of components of a clause that are integrated.
fn rates(solve: &Solve, numeric_only: bool) -> usize {
    if numeric_only { solve.of.len() } else { solve.numeric.len() }
}
