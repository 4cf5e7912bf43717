//! A random row, or tree, of cells of one kind, or two.

use dlsys::tree::ModuleString;

use super::expression::{Comparison, Condition, Expression, Values, Variable, infix};
use super::shape::{Place, Shape};
use crate::Dice;

/// What the cells read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reads {
    Nothing,
    Left,
    Both,
    /// The cell below, and what is attached: the cells form a tree.
    Tree,
}

/// The age, the value and the number of the kind of a cell.
pub type Cell = [f64; 3];

/// A function that is a root is that of `v + BEND*sin(v) = …`.
const BEND: f64 = 0.3;
/// The names of the kinds.
const KINDS: [&str; 2] = ["F_v", "F_y"];

/// A part of a rate that jumps.
#[derive(Clone, Debug)]
pub struct Step {
    pub sides: [Expression; 2],
    pub values: [f64; 2],
}

/// Cells with an age `x`, a value `c` and sometimes a function `v` of all that they have and read. A cell whose condition becomes true is
/// replaced by none, one or two of age 0.
#[derive(Clone, Debug)]
pub struct Plant {
    pub reads: Reads,
    /// Values at the two ends, which rest. A tree has the first only.
    pub walls: [f64; 2],
    pub shape: Shape,
    /// Age, value and kind, 0 or 1, of each cell.
    pub start: Vec<Cell>,
    /// The rates of a kind or two. The second successor of a cell is of the other kind.
    pub rates: Vec<Expression>,
    /// What the rate is more, where one side is larger than the other, and elsewhere.
    pub step: Option<Step>,
    pub function: Option<Expression>,
    /// The function is the root of an equation.
    pub is_implicit: bool,
    pub condition: Condition,
    /// The equations are given for one side of the condition only, if it is a level.
    pub is_domain: bool,
    /// The values of the successors.
    pub successors: Vec<Expression>,
    /// The second successor is a branch.
    pub forks: bool,
    /// When states are compared.
    pub times: Vec<f64>,
}

impl Plant {
    pub fn random(dice: &mut Dice) -> Plant {
        let reads =
            dice.pick(&[Reads::Nothing, Reads::Left, Reads::Both, Reads::Both, Reads::Tree, Reads::Tree]);
        let neighbours: &[Variable] = match reads {
            Reads::Tree => dice.pick(&[
                &[Variable::Left, Variable::Sum],
                &[Variable::Left, Variable::Largest],
                &[Variable::Left],
                &[Variable::Sum],
            ]),
            Reads::Nothing => &[],
            Reads::Left => &[Variable::Left],
            Reads::Both => &[Variable::Left, Variable::Right],
        };
        // A row of empty cells is filled from its ends.
        let (most, level) = if dice.roll(4) == 0 { (12, 0.0) } else { (6, 1.5) };
        let walls = [dice.between(0.0, 2.0), dice.between(0.0, 2.0)];
        let kinds = 1 + dice.roll(4) / 3;
        let start: Vec<Cell> = (0..1 + dice.roll(most))
            .map(|_| [dice.between(0.0, 1.0), dice.between(0.0, level), dice.roll(kinds) as f64])
            .collect();
        let is_tree = reads == Reads::Tree;
        let shape = if is_tree { Shape::tree(dice, start.len()) } else { Shape::row(start.len()) };
        let rates = (0..kinds).map(|_| rate(dice, neighbours)).collect();
        let jump = (dice.roll(4) == 0).then(|| step(dice, neighbours));
        let function = (dice.roll(3) == 0).then(|| Expression::function(dice, neighbours));
        let is_implicit = function.is_some() && dice.roll(3) == 0;
        let condition = Condition::random(dice, neighbours, function.is_some());
        let is_domain = dice.roll(2) == 0;
        let count = dice.pick(&[1, 1, 1, 1, 2, 2, 0]);
        let successors = (0..count).map(|_| successor(dice)).collect();
        let forks = is_tree && dice.roll(2) == 0;
        let pause = dice.between(0.2, 1.0);
        let times = (1..=4).map(|n| f64::from(n) * pause).collect();
        Plant {
            reads,
            walls,
            shape,
            start,
            rates,
            step: jump,
            function,
            is_implicit,
            condition,
            is_domain,
            successors,
            forks,
            times,
        }
    }

    /// The function of a cell whose other values are these, if it has one.
    pub fn function_at(&self, values: &Values) -> Option<f64> {
        let right = self.function.as_ref()?.at(values);
        let mut v = right;
        if self.is_implicit {
            // Newton's method; the slope is between 0.7 and 1.3.
            for _ in 0..6 {
                v -= (v + BEND * v.sin() - right) / (1.0 + BEND * v.cos());
            }
        }
        Some(v)
    }

    /// The model in the language.
    pub fn text(&self) -> String {
        let has_third = self.function.is_some() || self.reads == Reads::Tree;
        let (more, p, q, v) = if has_third { (", 0", ", p", ", q", ", v") } else { ("", "", "", "") };
        let cell = |[x, c, kind]: &Cell| format!("{}({x}, {c}{more})", KINDS[*kind as usize]);
        let mut cells = self.start.iter().map(cell);
        let cells: Vec<String> = (self.shape.places())
            .map(|place| match place {
                Place::Cell => cells.next().unwrap_or_default(),
                Place::Open => "[".to_owned(),
                Place::Close => "]".to_owned(),
            })
            .collect();
        let (cells, [left, right]) = (cells.join(" "), self.walls);
        let end = if self.reads == Reads::Tree { String::new() } else { format!("F_w(0, {right}{more})") };
        let (before, behind) = (format!("F(u, l{p}) < "), format!(" > F(w, r{q})"));
        let (before, behind) = match self.reads {
            Reads::Nothing => ("", ""),
            Reads::Left | Reads::Tree => (&before[..], ""),
            Reads::Both => (&before[..], &behind[..]),
        };
        let function = self.function.as_ref().map_or(String::new(), |function| match self.is_implicit {
            true => format!(", 0 = v + {BEND}*sin(v) - {function}"),
            false => format!(", v = {function}"),
        });
        let step =
            self.step.as_ref().map_or(String::new(), |Step { sides: [a, b], values: [more, less] }| {
                format!(" + (if {a} > {b} then {more} else {less})")
            });
        // The form of the paper: equations in a domain, and a production at its boundary.
        let domain = match &self.condition.comparisons[..] {
            [Comparison { sides: [a, b], operator: "=" }] if self.is_domain => format!("if {a} < {b} "),
            _ => String::new(),
        };
        let mut text = format!("initial string: F_w(0, {left}{more}) {cells} {end}\n");
        for (kind, rate) in self.rates.iter().enumerate() {
            // A rule that no cell can have is an error.
            if self.successors.len() < 2 && self.start.iter().all(|cell| cell[2] as usize != kind) {
                continue;
            }
            let of_kind = |n: usize| KINDS[(kind + n) % self.rates.len()];
            let successors = self.successors.iter().enumerate();
            let successors = successors.map(|(n, value)| {
                let cell = format!("{}(0, {value}{more})", of_kind(n));
                if n == 1 && self.forks { format!("[ {cell} ]") } else { cell }
            });
            let successors: Vec<String> = successors.collect();
            let successors = if successors.is_empty() { "ε".to_owned() } else { successors.join(" ") };
            text += &format!(
                "{before}{}(x, c{v}){behind}:\n  {domain}solve dx/dt = 1, dc/dt = {rate}{step}{function}\n  if {} produce {successors}\n",
                of_kind(0),
                self.condition
            );
        }
        text
    }

    /// Age, value and function, or 0, of each cell in a string; None if it does not begin and end with a wall.
    pub fn values_of(&self, string: &ModuleString) -> Option<Vec<[f64; 3]>> {
        // Brackets have no parameters.
        let all = string.iter().map(|module| module.parameters.to_vec()).filter(|values| !values.is_empty());
        let mut all: Vec<Vec<f64>> = all.collect();
        let is_wall = |cell: &Vec<f64>, wall: f64| cell.get(1) == Some(&wall);
        if self.reads != Reads::Tree {
            all.pop().filter(|cell| is_wall(cell, self.walls[1]))?;
        }
        all.first().filter(|cell| is_wall(cell, self.walls[0]))?;
        let cells = all[1..].iter();
        Some(cells.map(|cell| [0, 1, 2].map(|n| cell.get(n).copied().unwrap_or(0.0))).collect())
    }
}

/// The value of a successor.
fn successor(dice: &mut Dice) -> Expression {
    let own = || Expression::Of(Variable::Own);
    let constant = Expression::Number(dice.between(0.0, 1.0));
    match dice.roll(3) {
        0 => constant,
        1 => infix('+', constant, infix('*', Expression::Number(0.5), own())),
        _ => infix('*', Expression::Number(dice.between(-0.5, 0.9)), own()),
    }
}

/// A jump at an age, at a value, or where a neighbour is larger.
fn step(dice: &mut Dice, neighbours: &[Variable]) -> Step {
    let (own, age) = (Expression::Of(Variable::Own), Expression::Of(Variable::Age));
    let level = Expression::Number(dice.between(0.2, 1.5));
    let sides = match (dice.roll(3), neighbours) {
        (0, _) => [age, level],
        (1, [first, ..]) => [Expression::Of(*first), own],
        _ => [own, level],
    };
    Step { sides, values: [dice.between(-1.0, 1.0), dice.between(-1.0, 1.0)] }
}

/// A sum of terms. Without a decay most plants leave the numbers.
fn rate(dice: &mut Dice, neighbours: &[Variable]) -> Expression {
    let mut rate = Expression::term(dice, neighbours);
    for _ in 0..dice.roll(3) {
        rate = infix('+', rate, Expression::term(dice, neighbours));
    }
    infix('-', rate, infix('*', Expression::Number(dice.between(0.1, 1.5)), Expression::Of(Variable::Own)))
}
