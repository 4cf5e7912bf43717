//! The equations of the coupled modules between two changes of structure.

use crate::flow::coupled::aggregates::{Partial, TermBatch};
use crate::flow::coupled::algebra::Algebra;
use crate::flow::coupled::lanes::{LaneBatches, ProgramKey};
use crate::flow::coupled::rows::{
    ComponentPlace, EquationRow, EquationTable, FormulaInput, RowAggregate, VariableSource,
};
use crate::flow::coupled::sections::Section;
use crate::world::World;
use crate::world::prefetch::prefetch;
use crate::world::state::State;
use crate::world::trajectories::Law;
use dlsys_model::{Model, Rule, Solve};
use dlsys_tree::{ModuleId, SimTime, Tree};
use smallvec::SmallVec;

/// The equations of the coupled modules: a table, and the orders in which it is evaluated.
#[derive(Clone, Debug, Default)]
pub struct System {
    /// The rows of the equations.
    pub table: EquationTable,
    /// The algebraic components, in the order in which they are solved for.
    pub algebra: Algebra,
    /// The rates, in batches of rows with the same program.
    pub lanes: LaneBatches,
    /// The terms of aggregates, in batches of children with the same term.
    pub terms: Vec<TermBatch>,
    /// The number of modules with equations.
    pub modules: u64,
    /// All rates are linear, with constant coefficients, in all that moves.
    pub is_linear: bool,
    /// The rates are there in batches only, the table has no rows.
    pub is_bare: bool,
    /// The same equations in sections, where several threads evaluate them: then `lanes` has none.
    pub sections: Vec<Section>,
}

/// More modules than this are not likely to be in the processor's caches.
pub(super) const REGION: usize = 256;

/// No closed form is shared: in a table each row has its own.
const NONE: usize = usize::MAX;

/// The modules whose equations form a system.
#[derive(Clone, Copy)]
pub struct Membership<'w> {
    /// The world at the start of the step.
    pub world: &'w World,
    /// The modules, in the order of their rows.
    pub members: &'w [ModuleId],
    /// The start of the step.
    pub start: SimTime,
    /// Neighbours keep the values that they have at the start.
    pub frozen: bool,
}

impl System {
    /// A system of rows that are complete.
    pub fn new(table: EquationTable, rules: &[Rule]) -> System {
        let mut system = System { table, ..System::default() };
        system.finish(rules);
        system.prepare_rates(rules);
        system
    }

    /// Makes these the equations of some of the coupled modules, in the memory of the equations before. `unknown` gives
    /// the number here of a component of the coupled solution, in the order of the members; None if it is not
    /// integrated here. Rates can be evaluated after [`System::prepare_rates`].
    pub fn rebuild(&mut self, rules: &[Rule], modules: &Membership, unknown: impl Fn(u32) -> Option<u32>) {
        self.table.clear(modules.start);
        self.is_bare = false;
        self.sections.clear();
        self.table.rows.reserve_exact(modules.members.len());
        for (at, &id) in modules.members.iter().enumerate() {
            // The modules of a region have just been visited.
            if modules.members.len() > REGION {
                prefetch(modules.world, modules.members, at);
            }
            self.table.push_member(rules, modules.world, id, modules.frozen, &unknown);
        }
        self.finish(rules);
    }

    /// Removes all equations.
    pub(super) fn clear(&mut self, start: SimTime) {
        self.table.clear(start);
        self.lanes.clear();
        self.terms.clear();
        (self.algebra, self.modules, self.is_linear) = (Algebra::default(), 0, false);
    }

    /// Derives the orders of evaluation from the table.
    fn finish(&mut self, rules: &[Rule]) {
        self.modules = self.table.rows.len() as u64;
        self.algebra = Algebra::new(&self.table, rules);
        self.table.batch_terms(&mut self.terms);
        let is_linear = |row: &EquationRow| is_linear(rules, row.key());
        self.is_linear = self.algebra.is_empty()
            && self.table.aggregates.is_empty()
            && self.table.rows.iter().all(is_linear);
    }

    /// True if nothing moves that the rates read, besides the components.
    pub fn is_steady(&self) -> bool {
        let EquationTable { inputs, formulas, timed, aged, .. } = &self.table;
        !self.is_bare && !timed && !aged && inputs.is_empty() && formulas.is_empty()
    }

    /// Puts the rates into batches. Equations that are solved without steps need none.
    pub fn prepare_rates(&mut self, rules: &[Rule]) {
        self.lanes.fill(&self.table, rules);
    }

    /// Moves the start of the step, from which time is counted.
    pub fn advance(&mut self, start: SimTime) {
        self.table.advance(start);
        self.sections.iter_mut().for_each(|section| section.advance(start));
    }

    /// The module, and its parameter, that a component belongs to.
    pub fn owner(&self, component: usize, tree: &Tree) -> Option<(ModuleId, usize)> {
        self.table.owner(component, tree)
    }

    /// Calls a function with the number of the rate, and the partial derivative, for each partial derivative of a row's
    /// rates by an integrated component.
    pub fn row_partials(&self, rules: &[Rule], row: &EquationRow, mut each: impl FnMut(u32, Partial)) {
        let solve = &rules[row.rule].solves[row.solve];
        self.table.visit_partials(rules, row, &solve.jacobian, |partial| {
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
}

impl EquationTable {
    /// Adds the row of a module, unless it has no component.
    #[inline]
    fn push_member(
        &mut self,
        rules: &[Rule],
        world: &World,
        id: ModuleId,
        frozen: bool,
        unknown: &impl Fn(u32) -> Option<u32>,
    ) {
        let state = world.state(id).expect("members have states");
        let first = world.tree.places(id).start;
        let (Some(rule), Some(solve)) = (state.rule.get(), state.solve.get()) else { return };
        let (compiled, clause) = (&rules[rule], &rules[rule].solves[solve]);
        self.timed |= clause.stepping.is_timed();
        self.aged |= clause.stepping.is_aged();
        let first_rate = self.places.len();
        for &parameter in clause.stepping.components(state.numeric_only) {
            if let Some(Law::Coupled(_)) = state.trajectories.get(parameter) {
                self.places.push(ComponentPlace::new(first, id, parameter));
            }
        }
        let count = self.places.len() - first_rate;
        if count == 0 {
            return;
        }
        let first_source = self.sources.len();
        self.push_sources(compiled, world, state, frozen, unknown);
        self.push_aggregates(compiled, world, state, frozen, unknown);
        self.sources.resize(first_source + compiled.variables - 2, VariableSource::Fixed(0.0));
        let integrated = rates(clause, state.numeric_only);
        let first_switch = self.switches.len();
        self.switches.extend(state.marks.switch_values());
        // Births stand elsewhere in memory.
        let birth = if clause.stepping.is_aged() { world.tree.birth(id) } else { self.start };
        self.rows.push(EquationRow {
            rule,
            solve,
            numeric_only: state.numeric_only,
            first_source,
            sources: self.sources.len() - first_source,
            first_switch,
            switches: self.switches.len() - first_switch,
            first_rate,
            rates: integrated,
            algebraic: count - integrated,
            first_given: self.given.len(),
            birth,
            age: self.start.since(birth),
        });
        let solved = |place: &usize| clause.algebraic.is_solved(*place, state.numeric_only);
        let given = (0..clause.algebraic.of.len()).filter(solved);
        self.given.extend(given.map(|place| place as u32));
    }

    /// Adds the sources of the parameters that a module reads, its own and those of its context.
    #[inline]
    fn push_sources(
        &mut self,
        rule: &Rule,
        world: &World,
        state: &State,
        frozen: bool,
        unknown: &impl Fn(u32) -> Option<u32>,
    ) {
        let id = state.id;
        if frozen || !rule.aggregates.is_empty() {
            for &module in std::iter::once(&id).chain(state.context.context()) {
                let sources = self.sources_of(world, module, frozen && module != id, unknown);
                self.sources.extend(sources);
            }
            return;
        }
        // A variable that is not read may have any value.
        let first_source = self.sources.len();
        self.sources.resize(first_source + rule.variables - 2, VariableSource::Fixed(0.0));
        let clause = &rule.solves[state.solve.get().expect("a module with equations")];
        for read in clause.stepping.reads(state.numeric_only) {
            let (module, moves) = match read.neighbour.map(|n| state.context.context()[n]) {
                None => (id, Some(state)),
                Some(module) => (module, world.state(module)),
            };
            let place = || world.tree.places(module).start + read.parameter;
            let source = self.source(moves, read.parameter, (world.tree.values(), place), NONE, unknown);
            self.sources[first_source + read.variable] = source;
        }
    }

    /// Adds the aggregates of a module, with the sources of their children.
    #[inline]
    fn push_aggregates(
        &mut self,
        rule: &Rule,
        world: &World,
        state: &State,
        frozen: bool,
        unknown: &impl Fn(u32) -> Option<u32>,
    ) {
        let row = self.rows.len() as u32;
        for aggregate in 0..rule.aggregates.len() {
            let children = state.context.children(aggregate);
            let first = self.children.len();
            for &child in children {
                let sources = self.sources_of(world, child, frozen, unknown);
                self.children.extend(sources);
            }
            self.aggregates.push(RowAggregate { row, aggregate, first, count: children.len() });
            self.sources.push(VariableSource::Aggregate(self.aggregates.len() as u32 - 1));
        }
    }

    /// The source of a parameter of a module with this state, at a place in the values of the tree. Closed forms from number `shared` on
    /// are there for all who read them.
    #[inline(always)]
    pub(super) fn source(
        &mut self,
        state: Option<&State>,
        parameter: usize,
        (values, place): (&[f64], impl Fn() -> usize),
        shared: usize,
        unknown: impl Fn(u32) -> Option<u32>,
    ) -> VariableSource {
        let x = || values[place()];
        let Some((state, law)) = state.and_then(|s| Some((s, s.trajectories.get(parameter)?))) else {
            return VariableSource::Fixed(x());
        };
        match law {
            Law::Rest | Law::Step(_) => VariableSource::Fixed(x()),
            Law::Coupled(component) => match unknown(component) {
                Some(number) => VariableSource::State(number),
                None => {
                    self.inputs.push(component);
                    VariableSource::Input(self.inputs.len() as u32 - 1)
                }
            },
            Law::Formula(trajectory) => {
                let place = place() as u32;
                let mut known = self.formulas.iter().skip(shared);
                if let Some(number) = known.position(|formula| formula.place == place) {
                    return VariableSource::Formula((shared + number) as u32);
                }
                let (trajectory, x) = (trajectory.clone(), x());
                let (since, offset) = (state.since, self.start.since(state.since));
                self.formulas.push(FormulaInput { place, trajectory, x, since, offset });
                VariableSource::Formula(self.formulas.len() as u32 - 1)
            }
        }
    }

    /// The sources of all parameters of a module; their values at the start, if they are frozen.
    fn sources_of(
        &mut self,
        world: &World,
        module: ModuleId,
        frozen: bool,
        unknown: impl Fn(u32) -> Option<u32>,
    ) -> SmallVec<[VariableSource; 8]> {
        if frozen {
            let mut then = Vec::new();
            world.values(module, self.start, &mut then);
            return then.into_iter().map(VariableSource::Fixed).collect();
        }
        let (places, state) = (world.tree.places(module).enumerate(), world.state(module));
        let values = world.tree.values();
        places.map(|(i, place)| self.source(state, i, (values, || place), NONE, &unknown)).collect()
    }
}

/// True if the rates of a clause that are integrated are linear, with constant coefficients.
fn is_linear(rules: &[Rule], key: ProgramKey) -> bool {
    let clause = &rules[key.rule].solves[key.solve];
    clause.linear.is_some() && (!key.numeric_only || clause.is_all_numeric())
}

/// The number of components of a clause that are integrated.
fn rates(solve: &Solve, numeric_only: bool) -> usize {
    if numeric_only { solve.of.len() } else { solve.numeric.len() }
}

/// The parameters of a coupled module that are integrated, then those that are solved for, in the order of their
/// components.
pub fn integrated<'m>(model: &'m Model, state: &State) -> &'m [usize] {
    let Some((rule, solve)) = state.rule.get().zip(state.solve.get()) else { return &[] };
    model.rules[rule].solves[solve].stepping.components(state.numeric_only)
}
