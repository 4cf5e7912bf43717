//! The equations of modules as columns only, made from their states without a table of rows. A region is integrated once, for
//! an event, and a table of it would take as long to make as its steps; that of the common step would be the largest part
//! of what is kept of a coupled module.
//!
//! That is enough for explicit steps of integrated components. What partial derivatives need ([`Whole`]) is made when they
//! are asked for, which is when steps fail again and again.

use crate::flow::coupled::equations::Equations;
use crate::flow::coupled::lanes::{LaneColumn, ProgramKey};
use crate::flow::coupled::system::{Membership, REGION, System};
use crate::world::coupled_solution::CoupledSolution;
use crate::world::prefetch::prefetch;
use crate::world::state::State;
use crate::world::trajectories::Law;
use dlsys_expr::LANES;
use dlsys_model::{Rule, Solve};
use smallvec::SmallVec;

/// What a table of equations is made of: the modules, and of a region the components of the coupled solution that are
/// integrated there, in order. None for all of them, as they are numbered.
#[derive(Clone, Copy)]
pub struct Whole<'r> {
    pub modules: Membership<'r>,
    pub components: Option<&'r [u32]>,
}

impl Whole<'_> {
    /// The equations with their table.
    pub fn system(&self, rules: &[Rule]) -> System {
        let number = |of: u32| match self.components {
            Some(components) => components.iter().position(|c| *c == of).map(|number| number as u32),
            None => Some(of),
        };
        let mut system = System::default();
        system.rebuild(rules, &self.modules, number);
        system.prepare_rates(rules);
        system
    }

    /// Calls a function with the equations with their table, whose inputs follow `solution`.
    pub fn ask<T>(
        &self,
        rules: &[Rule],
        solution: Option<&CoupledSolution>,
        ask: impl FnOnce(&mut Equations) -> T,
    ) -> T {
        ask(&mut Equations::new(&self.system(rules), rules, solution))
    }
}

/// By component of the coupled solution: its number in a region, or [`NOT_HERE`].
#[derive(Clone, Default)]
pub struct Numbers(Vec<u32>);

/// The number of a component outside the region.
const NOT_HERE: u32 = u32::MAX;

impl Numbers {
    /// Gives components their places in this list for numbers.
    pub fn put(&mut self, components: &[u32]) {
        for (number, &component) in components.iter().enumerate() {
            if self.0.len() <= component as usize {
                self.0.resize(component as usize + 1, NOT_HERE);
            }
            self.0[component as usize] = number as u32;
        }
    }

    /// Takes these numbers back.
    pub fn take_back(&mut self, components: &[u32]) {
        components.iter().for_each(|component| self.0[*component as usize] = NOT_HERE);
    }

    /// The number of a component; None outside the region.
    pub fn of(&self, component: u32) -> Option<u32> {
        self.0.get(component as usize).copied().filter(|number| *number != NOT_HERE)
    }

    /// All of them.
    pub fn all(&self) -> &[u32] {
        &self.0
    }
}

/// A module with rates, and the number of the first of them.
type Row<'w> = (&'w State, u32);

/// Rows with the same program that wait for others, to fill the lanes.
type Waiting<'w> = (ProgramKey, SmallVec<[Row<'w>; LANES]>);

/// True if columns say all that explicit steps need of a clause: neither aggregates, nor the age of the module, nor
/// components that are solved for.
fn is_plain(rule: &Rule, clause: &Solve, numeric_only: bool) -> bool {
    let rates = if numeric_only { clause.of.len() } else { clause.numeric.len() };
    rule.aggregates.is_empty()
        && !clause.stepping.is_aged()
        && clause.stepping.components(numeric_only).len() == rates
}

impl System {
    /// Adds to no equations those of some of the coupled modules, with `components` components in all, as columns only; see
    /// [`System::rebuild`]. False if the equations of some module need the table.
    pub fn gather(
        &mut self,
        rules: &[Rule],
        modules: &Membership,
        components: usize,
        unknown: impl Fn(u32) -> Option<u32>,
    ) -> bool {
        self.is_bare = true;
        let mut waiting: SmallVec<[Waiting; 2]> = SmallVec::new();
        for (at, &id) in modules.members.iter().enumerate() {
            if modules.members.len() > REGION {
                prefetch(modules.world, modules.members, at);
            }
            let state = modules.world.state(id).expect("members have states");
            let (Some(rule), Some(solve)) = (state.rule.get(), state.solve.get()) else { continue };
            let clause = &rules[rule].solves[solve];
            let key = ProgramKey { rule, solve, numeric_only: state.numeric_only };
            let place = waiting.iter().position(|(known, _)| *known == key).unwrap_or(waiting.len());
            if place == waiting.len() {
                if !is_plain(&rules[rule], clause, state.numeric_only) {
                    return false;
                }
                self.table.timed |= clause.stepping.is_timed();
                waiting.push((key, SmallVec::new()));
            }
            let first = clause.stepping.components(state.numeric_only).first();
            if let Some(Law::Coupled(component)) = first.and_then(|p| state.trajectories.get(*p)) {
                self.modules += 1;
                let rows = &mut waiting[place].1;
                rows.push((state, unknown(component).expect("a component of a member")));
                if rows.len() == LANES {
                    self.gather_chunk(rules, modules, (key, rows), (components, &unknown));
                    rows.clear();
                }
            }
        }
        for (key, rows) in waiting.iter().filter(|(_, rows)| !rows.is_empty()) {
            self.gather_chunk(rules, modules, (*key, rows), (components, &unknown));
        }
        true
    }

    /// Adds a chunk of rows with the same program.
    fn gather_chunk(
        &mut self,
        rules: &[Rule],
        modules: &Membership,
        (key, rows): (ProgramKey, &[Row]),
        (components, unknown): (usize, &impl Fn(u32) -> Option<u32>),
    ) {
        let world = modules.world;
        let (rule, clause) = (&rules[key.rule], &rules[key.rule].solves[key.solve]);
        let (time, switches) = (rule.time_variable(), rule.variables);
        self.lanes.begin_chunk();
        // Mostly two modules read a neighbour, one as its left neighbour and the other as its right one.
        let shared = self.table.formulas.len();
        for &variable in key.program(rules).reads() {
            let column = if variable == time {
                LaneColumn::Time
            } else if let Some(switch) = variable.checked_sub(switches) {
                self.lanes.numbers(
                    rows.iter()
                        .map(|row| row.0.marks.switch_values().nth(switch).expect("a switch of the clause")),
                )
            } else {
                let mut reads = clause.stepping.reads(key.numeric_only).iter();
                let read = reads.find(|read| read.variable == variable).expect("all that steps read");
                let System { table, lanes, .. } = &mut *self;
                let sources = rows.iter().map(|(state, _)| {
                    let (module, moves) = match read.neighbour {
                        None => (state.id, Some(*state)),
                        Some(n) => {
                            let module = state.context.context()[n];
                            (module, world.state(module))
                        }
                    };
                    let place = || world.tree.places(module).start + read.parameter;
                    table.source(moves, read.parameter, (world.tree.values(), place), shared, unknown)
                });
                lanes.column(components, sources)
            };
            self.lanes.push_column(variable, column);
        }
        let registers = switches + rows[0].0.marks.switch_values().count();
        self.lanes.end_chunk(key, registers, rows.iter().map(|row| row.1));
    }
}
