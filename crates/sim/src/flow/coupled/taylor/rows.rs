//! The rows of linear equations, written from the states of modules: what each reads, with a number for each coefficient.

use crate::flow::coupled::columns::Numbers;
use crate::flow::coupled::linear::chain;
use crate::trajectory::Trajectory;
use crate::world::World;
use crate::world::prefetch::prefetch;
use crate::world::state::State;
use crate::world::trajectories::Law;
use dlsys_expr::Scratch;
use dlsys_model::{Read, Rule};
use dlsys_ode::MAX_DEGREE;
use dlsys_tree::{ModuleId, SimTime};
use std::ops::Range;

/// The memory of smaller systems is kept, and holds all there is of each row and each power: it stays in the caches.
pub const MANY: usize = 4096;
/// A formula, and coefficients, are looked for among so many that were met last: neighbours in the string read the same, and have the
/// same equations.
const RECENT: usize = 4;
/// Entries of a row side by side: those of a cell in a filament.
const SIDE_BY_SIDE: usize = 3;

/// The equation of one parameter of a clause: a constant, and a coefficient for each variable that is read.
#[derive(Clone, Debug)]
pub struct LinearEquation {
    parameter: usize,
    constant: f64,
    terms: Vec<(Read, f64)>,
}

/// What coefficients of a module are made of: the number of the variable, and where its value is found.
#[derive(Clone, Copy, Debug)]
enum Source {
    Parameter(Read),
    Switch(usize, usize),
}

/// The equations of a clause, and what their coefficients depend on, besides the clause.
#[derive(Clone, Debug)]
pub struct LinearClause {
    equations: Box<[LinearEquation]>,
    sources: Box<[Source]>,
}

/// A component outside the region that a row reads.
#[derive(Clone, Copy, Debug)]
pub struct Input {
    row: u32,
    pub component: u32,
    pub coefficient: f64,
    /// Its Taylor coefficients along the piece, times the coefficient.
    pub powers: [f64; MAX_DEGREE + 1],
}

/// The columns of a row of A: no loop is needed over its entries, of which those that are not there are zero.
type Columns = [u32; SIDE_BY_SIDE];

/// The numbers of a row.
#[derive(Clone, Copy, Debug, Default)]
struct Coefficients {
    values: [f64; SIDE_BY_SIDE],
    constant: f64,
}

impl Coefficients {
    /// True if the others are the same, to the last bit.
    #[inline]
    fn are(&self, others: &Coefficients) -> bool {
        let is = |a: f64, b: f64| a.to_bits() == b.to_bits();
        let [a, b, c] = self.values;
        let [of_a, of_b, of_c] = others.values;
        is(b, of_b) && is(a, of_a) && is(c, of_c) && is(self.constant, others.constant)
    }
}

/// Modules whose equations are solved together, in the order of their components.
#[derive(Clone, Copy)]
pub struct Members<'r> {
    pub world: &'r World,
    pub rules: &'r [Rule],
    pub members: &'r [ModuleId],
    /// The numbers of the components here; None if they are those of the coupled solution.
    pub numbers: Option<&'r Numbers>,
}

impl<'r> Members<'r> {
    /// The module that one reads, and its state.
    fn module(&self, state: &'r State, read: Read) -> (ModuleId, Option<&'r State>) {
        match read.neighbour.map(|n| state.context.context()[n]) {
            None => (state.id, Some(state)),
            Some(module) => (module, self.world.state(module)),
        }
    }

    fn number(&self, component: u32) -> Option<u32> {
        match self.numbers {
            Some(numbers) => numbers.of(component),
            None => Some(component),
        }
    }
}

/// What is known of clauses, by rule and clause.
pub type Clauses = Vec<Vec<Option<Option<LinearClause>>>>;

/// The rows of A, those of closed forms last, and what else is in the equations.
#[derive(Clone, Debug, Default)]
pub struct Rows {
    rows: Vec<Columns>,
    coefficients: Vec<Coefficients>,
    /// By row, of many: the number of its coefficients. Most modules share them, and memory is what limits large tissues. Of few rows, each
    /// has its own.
    shared: Vec<u32>,
    /// Entries that the rows have no room for: row, column and value.
    others: Vec<(u32, u32, f64)>,
    /// What is read from outside.
    pub inputs: Vec<Input>,
    /// Closed forms: where the parameter stands in the tree, and its row.
    formulas: Vec<(usize, u32)>,
    /// Decay and inflow of the rows of closed forms; no inflow where the next one flows in.
    links: Vec<(f64, Option<f64>)>,
    /// The variables of a module, its coefficients, and registers.
    variables: Vec<f64>,
    evaluated: Vec<f64>,
    scratch: Scratch<f64>,
    /// The values of all rows: at first those at the start.
    pub y: Vec<f64>,
    /// The number of components, whose rows come first.
    pub components: usize,
    /// The largest row sum of A.
    pub norm: f64,
}

impl Rows {
    /// Writes the equations of modules, given the values of their components; None if some are not linear with constant coefficients.
    pub fn write(&mut self, clauses: &mut Clauses, all: Members, y: &[f64], now: SimTime) -> Option<()> {
        let Members { world, rules, .. } = all;
        let Rows { rows, coefficients, shared, others, inputs, formulas, links, .. } = self;
        rows.clear();
        others.clear();
        coefficients.clear();
        shared.clear();
        inputs.clear();
        formulas.clear();
        links.clear();
        self.components = y.len();
        self.y.clear();
        self.y.extend_from_slice(y);
        self.rows.reserve_exact(y.len());
        for (at, &id) in all.members.iter().enumerate() {
            if all.numbers.is_none() {
                prefetch(world, all.members, at);
            }
            let state = world.state(id)?;
            let Some((rule, solve)) = state.rule.get().zip(state.solve.get()) else { continue };
            if rules[rule].solves[solve].stepping.components(state.numeric_only).is_empty() {
                continue;
            }
            if state.numeric_only {
                return None;
            }
            let clause = known(clauses, rules, rule, solve).as_ref()?;
            let own = !clause.sources.is_empty();
            if own {
                self.evaluate(all, state, clause, (&rules[rule], solve))?;
            }
            let mut first = 0;
            for equation in &clause.equations {
                let count = 1 + equation.terms.len();
                self.push(all, state, equation, own.then_some(first..first + count), now)?;
                first += count;
            }
        }
        for n in 0..self.links.len() {
            let (decay, inflow) = self.links[n];
            let (row, mut count) = (self.begin(inflow.unwrap_or(0.0)), 0);
            self.add(row, &mut count, (row, decay));
            if inflow.is_none() {
                self.add(row, &mut count, (row + 1, 1.0));
            }
            self.finish();
        }
        if self.rows.len() != self.y.len() {
            return None;
        }
        let sum = |of: &Coefficients| of.values.iter().map(|a| a.abs()).sum::<f64>();
        self.norm = self.coefficients.iter().map(sum).fold(0.0, f64::max);
        for others in self.others.chunk_by(|a, b| a.0 == b.0) {
            let more: f64 = others.iter().map(|other| other.2.abs()).sum();
            self.norm = self.norm.max(sum(self.coefficients_of(others[0].0)) + more);
        }
        self.norm.is_finite().then_some(())
    }

    /// Evaluates the coefficients of a module; None if they read what moves.
    fn evaluate(
        &mut self,
        all: Members,
        state: &State,
        clause: &LinearClause,
        (rule, solve): (&Rule, usize),
    ) -> Option<()> {
        self.variables.clear();
        self.variables.resize(rule.variables + rule.solves[solve].switches.len(), 0.0);
        for source in &clause.sources {
            match *source {
                Source::Parameter(read) => {
                    let (module, moves) = all.module(state, read);
                    let law = moves.and_then(|state| state.trajectories.get(read.parameter));
                    if !matches!(law, None | Some(Law::Rest)) {
                        return None;
                    }
                    self.variables[read.variable] = all.world.tree.parameters(module)[read.parameter];
                }
                Source::Switch(variable, switch) => {
                    self.variables[variable] = state.marks.switch_values().nth(switch)?;
                }
            }
        }
        let program = &rule.solves[solve].linear.as_ref()?.coefficients;
        self.evaluated.resize(program.outputs(), 0.0);
        program.eval(&self.variables, &mut self.scratch, &mut self.evaluated);
        Some(())
    }

    /// Adds the row of an equation of a module, with coefficients of its own from some places on if it has such.
    #[inline]
    fn push(
        &mut self,
        all: Members,
        state: &State,
        equation: &LinearEquation,
        own: Option<Range<usize>>,
        now: SimTime,
    ) -> Option<()> {
        let world = all.world;
        let constant = own.as_ref().map_or(equation.constant, |own| self.evaluated[own.start]);
        let (row, mut count) = (self.begin(constant), 0);
        let Law::Coupled(component) = state.trajectories.get(equation.parameter)? else {
            return None;
        };
        if all.number(component) != Some(row) {
            return None;
        }
        for (n, &(read, coefficient)) in equation.terms.iter().enumerate() {
            let coefficient = own.as_ref().map_or(coefficient, |own| self.evaluated[own.start + 1 + n]);
            let (module, moves) = all.module(state, read);
            let place = || world.tree.places(module).start + read.parameter;
            let moves = moves.and_then(|state| Some((state, state.trajectories.get(read.parameter)?)));
            match moves {
                None | Some((_, Law::Rest | Law::Step(_))) => {
                    let more = coefficient * world.tree.values()[place()];
                    self.coefficients.last_mut().expect("the row has been begun").constant += more;
                }
                Some((_, Law::Coupled(component))) => match all.number(component) {
                    Some(column) => self.add(row, &mut count, (column, coefficient)),
                    None => {
                        let powers = [0.0; MAX_DEGREE + 1];
                        self.inputs.push(Input { row, component, coefficient, powers });
                    }
                },
                Some((of, Law::Formula(trajectory))) => {
                    let column = self.formula(trajectory, place(), world, now.since(of.since))?;
                    self.add(row, &mut count, (column, coefficient));
                }
            }
        }
        self.finish();
        Some(())
    }

    /// The row of a closed form, at a place in the values of the tree, that began so long ago.
    fn formula(&mut self, trajectory: &Trajectory, place: usize, world: &World, offset: f64) -> Option<u32> {
        if let Some(known) = self.formulas.iter().rev().take(RECENT).find(|known| known.0 == place) {
            return Some(known.1);
        }
        let row = (self.components + self.links.len()) as u32;
        let chain = chain(trajectory, world.tree.values()[place], offset)?;
        self.y.extend(chain.links.iter().map(|link| link.1));
        let last = chain.links.len() - 1;
        let links = chain.links.iter().enumerate();
        self.links.extend(links.map(|(n, link)| (link.0, (n == last).then_some(chain.inflow))));
        self.formulas.push((place, row));
        Some(row)
    }

    /// Begins the next row with its constant, and gives its number.
    fn begin(&mut self, constant: f64) -> u32 {
        self.rows.push(Columns::default());
        self.coefficients.push(Coefficients { constant, ..Coefficients::default() });
        self.rows.len() as u32 - 1
    }

    /// Adds an entry, by column and value, to the row that was begun last, which has so many.
    #[inline]
    fn add(&mut self, row: u32, count: &mut usize, (column, value): (u32, f64)) {
        match self.coefficients.last_mut() {
            Some(last) if *count < SIDE_BY_SIDE => {
                (self.rows[row as usize][*count], last.values[*count]) = (column, value);
                *count += 1;
            }
            _ => self.others.push((row, column, value)),
        }
    }

    /// Ends the row that was begun last.
    #[inline]
    fn finish(&mut self) {
        if self.components > MANY {
            self.share();
        }
    }

    /// Lets it have the coefficients of an earlier row, if that has the same.
    fn share(&mut self) {
        let Some(own) = self.coefficients.pop() else { return };
        let mut recent = self.coefficients.iter().enumerate().rev().take(RECENT);
        let known = recent.find(|known| known.1.are(&own)).map(|known| known.0);
        self.shared.push(known.unwrap_or(self.coefficients.len()) as u32);
        if known.is_none() {
            self.coefficients.push(own);
        }
    }

    fn coefficients_of(&self, row: u32) -> &Coefficients {
        &self.coefficients[self.shared.get(row as usize).map_or(row, |shared| *shared) as usize]
    }

    /// Makes the Taylor coefficients of the next power after `power`, given those of that; gives the largest of the components, and of all.
    pub fn differentiate(&self, power: usize, last: &[f64], next: &mut [f64], room: f64) -> [f64; 2] {
        let all = &self.coefficients[..];
        match self.shared.is_empty() {
            true => self.differentiate_by(|row| &all[row], power, last, next, room),
            false => self.differentiate_by(|row| &all[self.shared[row] as usize], power, last, next, room),
        }
    }

    /// The same with the coefficients of each row.
    #[inline]
    fn differentiate_by<'c>(
        &self,
        of: impl Fn(usize) -> &'c Coefficients,
        power: usize,
        last: &[f64],
        next: &mut [f64],
        room: f64,
    ) -> [f64; 2] {
        if power == 0 {
            for (row, next) in next.iter_mut().enumerate() {
                *next = of(row).constant;
            }
        } else {
            next.fill(0.0);
        }
        for input in &self.inputs {
            next[input.row as usize] += input.powers.get(power).unwrap_or(&0.0);
        }
        for &(row, column, a) in &self.others {
            next[row as usize] += a * last[column as usize];
        }
        let (factor, first) = (room / (power + 1) as f64, self.components);
        let (components, formulas) = next.split_at_mut(first);
        let (rows, others) = self.rows.split_at(first);
        let size = multiply(rows, &of, last, factor, components);
        let others = multiply(others, |row| of(first + row), last, factor, formulas);
        [size, size.max(others)]
    }
}

/// Adds the products of rows and a vector to what is there, multiplies it by a factor, and gives the largest. `of` gives the coefficients of a
/// row.
#[inline]
fn multiply<'c>(
    rows: &[Columns],
    of: impl Fn(usize) -> &'c Coefficients,
    x: &[f64],
    factor: f64,
    out: &mut [f64],
) -> f64 {
    // Numbers that are not negative have the order of their bits.
    let mut largest = 0;
    for (row, out) in out.iter_mut().enumerate() {
        let ([a, b, c], [of_a, of_b, of_c]) = (&rows[row], &of(row).values);
        let sum = *out + of_a * x[*a as usize] + of_b * x[*b as usize] + of_c * x[*c as usize];
        *out = factor * sum;
        largest = largest.max(out.abs().to_bits());
    }
    f64::from_bits(largest)
}

/// The equations of a clause with numbers in place of programs, made when they are first asked for; None if they are not linear with
/// constant coefficients.
fn known<'k>(
    clauses: &'k mut Clauses,
    rules: &[Rule],
    rule: usize,
    solve: usize,
) -> &'k Option<LinearClause> {
    if clauses.len() <= rule {
        clauses.resize(rules.len(), Vec::new());
    }
    let clauses = &mut clauses[rule];
    if clauses.len() <= solve {
        clauses.resize(rules[rule].solves.len(), None);
    }
    clauses[solve].get_or_insert_with(|| linear_clause(&rules[rule], solve))
}

fn linear_clause(rule: &Rule, solve: usize) -> Option<LinearClause> {
    let clause = &rule.solves[solve];
    let linear = clause.linear.as_ref()?;
    if !rule.aggregates.is_empty() || !clause.algebraic.is_empty() {
        return None;
    }
    let reads = clause.stepping.reads(false);
    let read_of = |variable: usize| reads.iter().find(|read| read.variable == variable).copied();
    let sources =
        linear.coefficients.reads().iter().map(|&variable| match variable.checked_sub(rule.variables) {
            Some(switch) => Some(Source::Switch(variable, switch)),
            None => read_of(variable).map(Source::Parameter),
        });
    let sources: Option<Box<[Source]>> = sources.collect();
    let mut out = vec![0.0; linear.coefficients.outputs()];
    // If any of them is read, each module has coefficients of its own.
    let variables = vec![0.0; rule.variables + clause.switches.len()];
    linear.coefficients.eval(&variables, &mut Vec::new(), &mut out);
    let mut next = out.into_iter();
    let equations = linear.variables.iter().zip(&clause.numeric).map(|(variables, &position)| {
        let constant = next.next()?;
        let terms: Option<Vec<(Read, f64)>> =
            variables.iter().map(|variable| Some((read_of(*variable)?, next.next()?))).collect();
        Some(LinearEquation { parameter: clause.of[position], constant, terms: terms? })
    });
    let equations: Option<Box<[LinearEquation]>> = equations.collect();
    Some(LinearClause { equations: equations?, sources: sources? })
}

#[cfg(test)]
impl Rows {
    /// Filaments that are all alike, of so many cells each, which diffuse; at one end of each is a closed form.
    pub fn of_filaments(filaments: usize, cells: usize) -> Rows {
        let components = filaments * cells;
        let mut rows = Rows { components, norm: 0.16, ..Rows::default() };
        for filament in 0..filaments {
            let start = filament * cells;
            rows.y.extend((0..cells).map(|cell| 120.0 + 90.0 * (cell as f64).sin()));
            for cell in 0..cells {
                let (row, mut count) = (rows.begin(if cell % 7 == 0 { 0.5 } else { 0.0 }), 0);
                let left = if cell == 0 { components + filament } else { start + cell - 1 };
                rows.add(row, &mut count, (left as u32, 0.03));
                rows.add(row, &mut count, (row, -0.09));
                if cell + 1 < cells {
                    rows.add(row, &mut count, (row + 1, 0.03));
                }
                if cell % 5 == 2 {
                    rows.add(row, &mut count, (row - 2, 1e-3));
                }
                rows.finish();
            }
        }
        for _ in 0..filaments {
            let (row, mut count) = (rows.begin(30.0), 0);
            rows.add(row, &mut count, (row, -0.15));
            rows.finish();
            rows.y.push(20.0);
        }
        rows
    }

    /// How many different coefficients are kept.
    pub fn kept(&self) -> usize {
        self.coefficients.len()
    }
}
