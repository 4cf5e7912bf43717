//! The equations of a few modules as columns only, made from their states without a table of rows: a region is integrated
//! once, for an event, and a table of it would take as long to make as its steps.
//!
//! That is enough for explicit steps of integrated components. What partial derivatives need ([`Whole`]) is made when they
//! are asked for, which is when steps fail again and again.

use crate::flow::coupled::equations::Equations;
use crate::flow::coupled::lanes::{LaneColumn, ProgramKey};
use crate::flow::coupled::system::{Membership, System};
use crate::trajectory::Trajectory;
use crate::world::coupled_solution::CoupledSolution;
use crate::world::state::State;
use dlsys_expr::LANES;
use dlsys_model::{Rule, Solve};
use smallvec::SmallVec;

/// The modules of a region and the components of the coupled solution that are integrated there, in order: what a table of
/// its equations is made of.
#[derive(Clone, Copy)]
pub struct Whole<'r> {
    pub modules: Membership<'r>,
    pub components: &'r [u32],
}

impl Whole<'_> {
    /// The equations with their table.
    pub fn system(&self, rules: &[Rule]) -> System {
        let number = |of: u32| self.components.iter().position(|c| *c == of).map(|number| number as u32);
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

/// A module with rates, and the number of the first of them.
type Row<'w> = (ProgramKey, &'w State, u32);

/// True if columns say all that explicit steps need of a clause: neither aggregates, nor the age of the module, nor
/// components that are solved for.
fn is_plain(rule: &Rule, clause: &Solve, numeric_only: bool) -> bool {
    let rates = if numeric_only { clause.of.len() } else { clause.numeric.len() };
    rule.aggregates.is_empty()
        && !clause.stepping.is_aged()
        && clause.stepping.components(numeric_only).len() == rates
}

impl System {
    /// Makes these the equations of some of the coupled modules, with `components` components in all, as columns only; see
    /// [`System::rebuild`]. False if the equations of some module need the table.
    pub fn gather(
        &mut self,
        rules: &[Rule],
        modules: &Membership,
        components: usize,
        unknown: impl Fn(u32) -> Option<u32>,
    ) -> bool {
        self.clear(modules.start);
        let mut rows: SmallVec<[Row; 64]> = SmallVec::new();
        for &id in modules.members {
            let state = modules.world.state(id).expect("members have states");
            let (Some(rule), Some(solve)) = (state.rule, state.solve) else { continue };
            let clause = &rules[rule].solves[solve];
            let key = ProgramKey { rule, solve, numeric_only: state.numeric_only };
            let is_known = rows.last().is_some_and(|(last, ..)| *last == key);
            if !is_known && !is_plain(&rules[rule], clause, state.numeric_only) {
                return false;
            }
            self.table.timed |= clause.stepping.is_timed();
            let first = clause.stepping.components(state.numeric_only).first();
            if let Some(Trajectory::Coupled(component)) = first.and_then(|p| state.trajectories.get(*p)) {
                rows.push((key, state, unknown(*component).expect("a component of a member")));
            }
        }
        self.modules = rows.len() as u64;
        let mut keys: SmallVec<[ProgramKey; 4]> = SmallVec::new();
        for (key, ..) in &rows {
            if !keys.contains(key) {
                keys.push(*key);
            }
        }
        for key in keys {
            let mut same = rows.iter().filter(|row| row.0 == key).peekable();
            while same.peek().is_some() {
                let few: SmallVec<[&Row; LANES]> = same.by_ref().take(LANES).collect();
                self.gather_chunk(rules, modules, &few, (components, &unknown));
            }
        }
        true
    }

    /// Adds a chunk of rows with the same program.
    fn gather_chunk(
        &mut self,
        rules: &[Rule],
        modules: &Membership,
        rows: &[&Row],
        (components, unknown): (usize, &impl Fn(u32) -> Option<u32>),
    ) {
        let (world, key) = (modules.world, rows[0].0);
        let (rule, clause) = (&rules[key.rule], &rules[key.rule].solves[key.solve]);
        let (time, switches) = (rule.time_variable(), rule.variables);
        self.lanes.begin_chunk();
        for &variable in key.program(rules).reads() {
            let column = if variable == time {
                LaneColumn::Time
            } else if let Some(switch) = variable.checked_sub(switches) {
                self.lanes.numbers(rows.iter().map(|row| f64::from(u8::from(row.1.switches[switch]))))
            } else {
                let mut reads = clause.stepping.reads(key.numeric_only).iter();
                let read = reads.find(|read| read.variable == variable).expect("all that steps read");
                let first = self.table.sources.len();
                for (_, state, _) in rows {
                    let (module, moves) = match read.neighbour {
                        None => (state.id, Some(*state)),
                        Some(n) => {
                            let module = state.context.context()[n];
                            (module, world.state(module))
                        }
                    };
                    let x = || world.tree.parameters(module)[read.parameter];
                    let source = self.table.source(moves, read.parameter, x, unknown);
                    self.table.sources.push(source);
                }
                let sources = &self.table.sources[first..];
                self.lanes.column(components, sources)
            };
            self.lanes.push_column(variable, column);
        }
        let registers = switches + rows[0].1.switches.len();
        self.lanes.end_chunk(key, registers, rows.iter().map(|row| row.2));
    }
}
