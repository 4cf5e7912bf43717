//! The nearest values at which the sides of conditions are equal.
//!
//! Where `x + y` meets 3.4, the numbers of the instant are a rounding off; where a value `v = f(x, y)` meets it, or two modules are taken
//! together, they are off by an error of integration. A successor that asks for the same sum once more would find 3.3999999. So the
//! variables of a production are moved by the least that makes the sides equal: first Newton's method in what is integrated,
//! relative to its size, then a search among the numbers next to these. A variable that meets a level alone is the plainest case.

use crate::detect::signs::opposite;
use crate::scratch::Scratch;
use crate::world::state::{Level, Open};
use dlsys_expr::{Dual, Scratch as Registers, Value};
use dlsys_model::{Rule, Sign, Solve};
use smallvec::SmallVec;

/// Most steps of rounding by which a variable is moved.
const MOST_ULPS: u32 = 8;

/// The same where two are moved together.
const MOST_ULPS_OF_PAIRS: u32 = 4;

/// Most variables that are tried in pairs.
const MOST_VARIABLES: usize = 6;

/// Most steps of Newton's method.
const STEPS: usize = 4;

/// Sides that differ by no more than this part of their size differ by rounding.
const ROUNDING: f64 = 16.0 * f64::EPSILON;

/// What follows a formula is moved by no more than this part of its size.
const FORMULA_ERROR: f64 = 1e-12;

/// What is smaller than this part of the largest variable is moved as if it were as large, if it has to be.
const LEAST_SIZE: f64 = 1e-3;

/// A gradient of which no more than this part is left beside the others follows from them.
const DEPENDENT: f64 = 1e-6;

/// Variables that are moved together, and the most by which one of them is, as a part of its size or of 1.
#[derive(Clone, Debug, Default)]
struct Sort {
    variables: SmallVec<[usize; 4]>,
    limit: f64,
}

/// Sides that meet at an instant, and the variables that may be moved so that they are equal.
pub struct Meeting<'r> {
    rule: &'r Rule,
    clause: Option<&'r Solve>,
    open: &'r Open,
    /// Own parameters that are integrated or solved for; own ones with formulas; those of the context; all others. The first sort that can
    /// make the sides equal does.
    sorts: [Sort; 4],
    /// Values that follow from what the module moves, by their places among those of the clause.
    dependent: SmallVec<[usize; 4]>,
    /// Equations `0 = g` of unknowns that the sides read.
    implicit: SmallVec<[usize; 2]>,
}

/// How an equation of a meeting depends on the variables that may be moved: one row, with what is left of it.
type Row = SmallVec<[f64; 8]>;

impl<'r> Meeting<'r> {
    /// The levels that a module has met whose parameters have an error of no more than `error`, as a part of their sizes or of 1.
    pub fn new(rule: &'r Rule, open: &'r Open, numeric_only: bool, error: f64) -> Meeting<'r> {
        let clause = open.flow.as_ref().and_then(|(solve, _)| *solve).map(|solve| &rule.solves[solve]);
        let read = |variable: &usize| open.levels.iter().any(|l| rule.atom_reads[l.atom].contains(variable));
        let (mut integrated, mut formulas) = (SmallVec::new(), SmallVec::new());
        let (mut dependent, mut implicit) = (SmallVec::new(), SmallVec::new());
        if let Some(clause) = clause {
            for (place, &parameter) in clause.of.iter().enumerate() {
                let is_numeric = numeric_only || clause.numeric.contains(&place);
                if is_numeric { &mut integrated } else { &mut formulas }.push(parameter);
            }
            let algebraic = &clause.algebraic;
            for (place, parameter) in algebraic.of.iter().enumerate() {
                if !algebraic.explicit[place] {
                    implicit.extend(read(parameter).then_some(place));
                } else if !algebraic.is_lazy(place) {
                    let reads = algebraic.values.output_reads(place);
                    dependent.extend(reads.iter().any(|read| clause.of.contains(read)).then_some(place));
                }
            }
            integrated.extend(implicit.iter().map(|place| algebraic.of[*place]));
        }
        let context = rule.moving_context.iter().copied().filter(&read).collect();
        let others = (rule.first_aggregate.max(rule.parameters.len())..rule.variables).filter(&read);
        let sorts = [
            Sort { variables: integrated, limit: error },
            Sort { variables: formulas, limit: FORMULA_ERROR },
            Sort { variables: context, limit: error },
            Sort { variables: others.collect(), limit: error },
        ];
        Meeting { rule, clause, open, sorts, dependent, implicit }
    }

    /// The same with its own parameters alone, if some of these can make the sides equal: those of neighbours go on as they are.
    pub fn alone(mut self) -> Meeting<'r> {
        let mut own = self.sorts[..2].iter().flat_map(|sort| &sort.variables);
        let read = |v: &usize| self.open.levels.iter().any(|l| self.rule.atom_reads[l.atom].contains(v));
        if own.any(read) {
            self.sorts[2].variables.clear();
            self.sorts[3].variables.clear();
        }
        self
    }

    /// True if the module integrates what meets, or what that follows from.
    pub fn is_integrated(&self) -> bool {
        let reads = |variable: &usize| {
            let read = |other| self.open.levels.iter().any(|l| self.rule.atom_reads[l.atom].contains(&other));
            let through = |place: &usize| {
                let algebraic = &self.clause.expect("it has values").algebraic;
                read(algebraic.of[*place]) && algebraic.values.output_reads(*place).contains(variable)
            };
            read(*variable) || self.dependent.iter().any(through)
        };
        self.sorts[0].variables.iter().any(reads)
    }

    /// Moves the variables of the rule so that the sides are equal. `exists` tells whether the production has a successor, given these:
    /// where rounding makes sides unequal everywhere, that decides on which side they are.
    pub fn settle(&self, scratch: &mut Scratch, mut exists: impl FnMut(&[f64]) -> bool) {
        let Scratch { variables, registers, .. } = scratch;
        let known = variables.len();
        let switches = self.open.flow.iter().flat_map(|(_, switches)| switches.iter());
        variables.extend(switches.map(|&on| f64::from(u8::from(on))));
        let start = variables.clone();
        let numbers = 0..self.open.levels.len();
        let is_met = self.differences(variables, registers).iter().all(|[a, b]| a == b);
        if is_met && { numbers }.all(|number| self.moving(number).len() <= 1) {
            // A level, of one variable: there are no other numbers at which it is met.
            variables.truncate(known);
            return;
        }
        for sort in &self.sorts {
            // What is small beside the others keeps its own digits, unless it alone can be moved: `x*y` is 0 where y passes 0.
            for least in [0.0, LEAST_SIZE] {
                if !self.is_near(variables, registers) {
                    self.approach(sort, least, variables, registers);
                }
            }
        }
        // Values that are known less well than what they follow from are left as they were followed.
        if !self.dependent.is_empty() && !self.is_near(variables, registers) {
            *variables = start;
            variables.truncate(known);
            return;
        }
        let last = self.open.levels.len() - 1;
        for number in 0..last {
            self.settle_one(number, variables, registers, |_| true);
        }
        self.settle_one(last, variables, registers, |variables| exists(&variables[..known]));
        variables.truncate(known);
    }

    /// Computes the values that follow from what the module moves.
    fn follow<T: Value>(&self, variables: &mut [T], registers: &mut Registers<T>) {
        let (Some(clause), false) = (self.clause, self.dependent.is_empty()) else { return };
        let algebraic = &clause.algebraic;
        let mut values: SmallVec<[T; 8]> = SmallVec::from_elem(T::constant(0.0), algebraic.values.outputs());
        algebraic.values.eval(variables, registers, &mut values);
        self.dependent.iter().for_each(|place| variables[algebraic.of[*place]] = values[*place]);
    }

    /// The sides that meet, then the equations of unknowns.
    fn differences<T: Value>(
        &self,
        variables: &mut [T],
        registers: &mut Registers<T>,
    ) -> SmallVec<[[T; 2]; 4]> {
        self.follow(variables, registers);
        let mut sides: SmallVec<[T; 16]> = SmallVec::from_elem(T::constant(0.0), self.rule.sides.outputs());
        self.rule.sides.eval(variables, registers, &mut sides);
        let of = |level: &Level| [sides[2 * level.atom], sides[2 * level.atom + 1]];
        let mut found: SmallVec<[[T; 2]; 4]> = self.open.levels.iter().map(of).collect();
        if let (Some(clause), false) = (self.clause, self.implicit.is_empty()) {
            let program = &clause.algebraic.values;
            let mut values: SmallVec<[T; 8]> = SmallVec::from_elem(T::constant(0.0), program.outputs());
            program.eval(variables, registers, &mut values);
            found.extend(self.implicit.iter().map(|place| [values[*place], T::constant(0.0)]));
        }
        found
    }

    /// True if the sides differ by rounding only.
    fn is_near(&self, variables: &mut [f64], registers: &mut Registers<f64>) -> bool {
        let differences = self.differences(variables, registers);
        let is_near = |(number, [a, b]): (usize, &[f64; 2])| {
            let reads = self.open.levels.get(number).map_or(&[][..], |l| &self.rule.atom_reads[l.atom]);
            let size =
                reads.iter().fold(a.abs().max(b.abs()), |m, variable| m.max(variables[*variable].abs()));
            (a - b).abs() <= ROUNDING * size
        };
        differences.iter().enumerate().all(is_near)
    }

    /// Newton's method in one sort of variables, each relative to its size, or to this part of the largest one: the least changes with which
    /// the sides are equal. Without effect if these are larger than the error.
    fn approach(&self, sort: &Sort, least: f64, variables: &mut [f64], registers: &mut Registers<f64>) {
        if sort.variables.is_empty() {
            return;
        }
        let start: SmallVec<[f64; 8]> = sort.variables.iter().map(|variable| variables[*variable]).collect();
        let largest = start.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        let sizes: SmallVec<[f64; 8]> = start.iter().map(|x| x.abs().max(least * largest)).collect();
        let mut dual_registers = Vec::new();
        for _ in 0..STEPS {
            let now = self.differences(variables, registers);
            let mut rows: SmallVec<[(Row, f64); 4]> = now.iter().map(|[a, b]| (Row::new(), b - a)).collect();
            for (&variable, &size) in sort.variables.iter().zip(&sizes) {
                let mut duals: Vec<Dual<f64>> = variables.iter().map(|x| Dual::constant(*x)).collect();
                duals[variable].rate = size;
                let slopes = self.differences(&mut duals, &mut dual_registers);
                rows.iter_mut().zip(slopes).for_each(|(row, [a, b])| row.0.push(a.rate - b.rate));
            }
            let moves = least_solution(rows, sort.variables.len());
            for ((variable, size), part) in sort.variables.iter().zip(&sizes).zip(&moves) {
                variables[*variable] += part * size;
            }
            if self.is_near(variables, registers) {
                break;
            }
        }
        let stays = |(variable, start): (&usize, &f64)| {
            (variables[*variable] - start).abs() <= sort.limit * start.abs().max(1.0)
        };
        if !sort.variables.iter().zip(&start).all(stays) {
            sort.variables.iter().zip(&start).for_each(|(variable, start)| variables[*variable] = *start);
            self.follow(variables, registers);
        }
    }

    /// Makes the sides of one level equal to the last bit, if they can be, and keeps those before it so; else they are on the side that
    /// comes, or on the other one.
    fn settle_one(
        &self,
        number: usize,
        variables: &mut [f64],
        registers: &mut Registers<f64>,
        mut exists: impl FnMut(&[f64]) -> bool,
    ) {
        let mut is = |variables: &mut [f64], registers: &mut Registers<f64>, sign: Sign| {
            let sides = self.differences(variables, registers);
            let sign_of = |place: usize| Sign::of(sides[place][0] - sides[place][1]);
            let is_so = sign_of(number) == sign && (0..number).all(|other| sign_of(other) == Sign::Zero);
            is_so && exists(variables)
        };
        if is(variables, registers, Sign::Zero) {
            return;
        }
        let moving = self.moving(number);
        let start: SmallVec<[f64; 8]> = moving.iter().map(|variable| variables[*variable]).collect();
        if alone(&mut is, (&moving, &start), variables, registers, Sign::Zero) {
            return;
        }
        // What is small beside the others goes in larger steps.
        let slopes = self.slopes(number, &moving, variables);
        let left = |variables: &mut [f64], registers: &mut Registers<f64>| {
            let [a, b] = self.differences(variables, registers)[number];
            a - b
        };
        let count = moving.len().min(MOST_VARIABLES);
        for (one, other) in (0..count).flat_map(|one| (0..count).map(move |other| (one, other))) {
            if one == other || !slopes[other].is_normal() {
                continue;
            }
            for value in std::iter::once(start[one]).chain(around(start[one], MOST_ULPS_OF_PAIRS)) {
                (variables[moving[one]], variables[moving[other]]) = (value, start[other]);
                let step = left(variables, registers) / slopes[other];
                if step.abs() > FORMULA_ERROR * start[other].abs().max(1.0) {
                    continue;
                }
                let nearest = start[other] - step;
                for value in std::iter::once(nearest).chain(around(nearest, MOST_ULPS_OF_PAIRS)) {
                    variables[moving[other]] = value;
                    if is(variables, registers, Sign::Zero) {
                        return;
                    }
                }
            }
            (variables[moving[one]], variables[moving[other]]) = (start[one], start[other]);
        }
        let after = self.open.levels[number].after;
        let mut is_on = |sign: Sign, variables: &mut [f64], registers: &mut Registers<f64>| {
            is(variables, registers, sign) || alone(&mut is, (&moving, &start), variables, registers, sign)
        };
        if !is_on(after, variables, registers) && !is_on(opposite(after), variables, registers) {
            self.follow(variables, registers);
        }
    }

    /// The partial derivatives of the difference of one level.
    fn slopes(&self, number: usize, moving: &[usize], variables: &[f64]) -> SmallVec<[f64; 8]> {
        let mut registers = Vec::new();
        let slope = |&variable: &usize| {
            let mut duals: Vec<Dual<f64>> = variables.iter().map(|x| Dual::constant(*x)).collect();
            duals[variable].rate = 1.0;
            let [a, b] = self.differences(&mut duals, &mut registers)[number];
            a.rate - b.rate
        };
        moving.iter().map(slope).collect()
    }

    /// The variables that decide over a level, those first that are rather moved.
    fn moving(&self, number: usize) -> SmallVec<[usize; 8]> {
        let Level { atom, level, .. } = &self.open.levels[number];
        let reads = &self.rule.atom_reads[*atom];
        let algebraic = self.clause.map(|clause| &clause.algebraic);
        let is_dependent = |variable: usize| {
            let of = |place: &usize| algebraic.expect("it has values").of[*place];
            self.dependent.iter().any(|place| of(place) == variable)
        };
        let decides = |variable: &usize| {
            let through = |place: &usize| {
                let algebraic = algebraic.expect("it has values");
                reads.contains(&algebraic.of[*place])
                    && algebraic.values.output_reads(*place).contains(variable)
            };
            reads.contains(variable) || self.dependent.iter().any(through)
        };
        let mut moving: SmallVec<[usize; 8]> = SmallVec::new();
        moving.extend(level.map(|(variable, _)| variable).filter(|variable| !is_dependent(*variable)));
        let all = self.sorts.iter().flat_map(|sort| &sort.variables).copied();
        for variable in all.filter(decides) {
            if !moving.contains(&variable) {
                moving.push(variable);
            }
        }
        moving
    }
}

/// Moves one of the variables by rounding so that `is` holds, and tells whether that can be done.
fn alone(
    mut is: impl FnMut(&mut [f64], &mut Registers<f64>, Sign) -> bool,
    (moving, start): (&[usize], &[f64]),
    variables: &mut [f64],
    registers: &mut Registers<f64>,
    sign: Sign,
) -> bool {
    moving.iter().zip(start).any(|(&variable, &value)| {
        let found = around(value, MOST_ULPS).any(|near| {
            variables[variable] = near;
            is(variables, registers, sign)
        });
        if !found {
            variables[variable] = value;
        }
        found
    })
}

/// The numbers next to one, so many in each direction, the nearest first.
fn around(value: f64, most: u32) -> impl Iterator<Item = f64> {
    let (mut up, mut down) = (value, value);
    (0..most).flat_map(move |_| {
        (up, down) = (up.next_up(), down.next_down());
        [up, down]
    })
}

/// The least numbers for which each row gives its right side; rows that follow from others are left out.
fn least_solution(rows: SmallVec<[(Row, f64); 4]>, count: usize) -> Row {
    let dot = |a: &Row, b: &Row| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let mut solution = Row::from_elem(0.0, count);
    let mut basis: SmallVec<[Row; 4]> = SmallVec::new();
    for (row, right) in rows {
        let mut rest = row.clone();
        for other in &basis {
            let part = dot(&rest, other);
            rest.iter_mut().zip(other).for_each(|(x, y)| *x -= part * y);
        }
        let [whole, left] = [dot(&row, &row).sqrt(), dot(&rest, &rest).sqrt()];
        if left.is_nan() || left <= DEPENDENT * whole || !right.is_finite() {
            continue;
        }
        rest.iter_mut().for_each(|x| *x /= left);
        // The other rows are satisfied whatever is added along this direction.
        let missing = (right - dot(&row, &solution)) / left;
        solution.iter_mut().zip(&rest).for_each(|(x, y)| *x += missing * y);
        basis.push(rest);
    }
    solution
}
