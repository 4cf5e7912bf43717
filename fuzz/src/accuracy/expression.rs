//! Expressions and conditions: printed in the language, and evaluated here.

use std::fmt;

use crate::Dice;

/// What expressions read.
#[derive(Clone, Copy, Debug)]
pub enum Variable {
    Age,
    Own,
    Left,
    Right,
    Time,
    /// The parameter that is a function of the others.
    Function,
    /// That of the cell on the left; 0 of a wall.
    LeftFunction,
    /// The sum of the values of the cells that are attached in a tree.
    Sum,
    /// The largest of these values; 0 of none.
    Largest,
}

/// The values of the variables, in the order of [`Variable`].
pub type Values = [f64; 9];

#[derive(Clone, Debug)]
pub enum Expression {
    Number(f64),
    Of(Variable),
    /// A function of one value, by its name in the language.
    Call(&'static str, Box<Expression>),
    /// A function of two values.
    Pair(&'static str, Box<[Expression; 2]>),
    /// An operator.
    Infix(char, Box<[Expression; 2]>),
    /// The third where the first is larger than the second, otherwise the fourth.
    Where(Box<[Expression; 4]>),
}

use Expression::{Call, Infix, Number, Of, Pair, Where};

pub fn infix(operator: char, a: Expression, b: Expression) -> Expression {
    Infix(operator, Box::new([a, b]))
}

impl Expression {
    pub fn at(&self, values: &Values) -> f64 {
        match self {
            Number(x) => *x,
            Of(variable) => values[*variable as usize],
            Call(name, of) => {
                let x = of.at(values);
                match *name {
                    "sin" => x.sin(),
                    "cos" => x.cos(),
                    "exp" => x.exp(),
                    "abs" => x.abs(),
                    "floor" => x.floor(),
                    _ => unreachable!("a function of one value: {name}"),
                }
            }
            Pair(name, of) => {
                let [a, b] = [of[0].at(values), of[1].at(values)];
                match *name {
                    "max" => a.max(b),
                    "min" => a.min(b),
                    _ => unreachable!("a function of two values: {name}"),
                }
            }
            Infix(operator, of) => {
                let [a, b] = [of[0].at(values), of[1].at(values)];
                match operator {
                    '+' => a + b,
                    '-' => a - b,
                    '*' => a * b,
                    '/' => a / b,
                    _ => unreachable!("an operator: {operator}"),
                }
            }
            Where(of) => of[if of[0].at(values) > of[1].at(values) { 2 } else { 3 }].at(values),
        }
    }

    /// The least difference of the two sides that decide which of two values is taken; infinite if nothing does.
    pub fn least_gap(&self, values: &Values) -> f64 {
        match self {
            Number(_) | Of(_) => f64::INFINITY,
            Call("floor", of) => {
                let x = of.at(values);
                (x - x.round()).abs().min(of.least_gap(values))
            }
            Call(_, of) => of.least_gap(values),
            Pair(_, of) | Infix(_, of) => of[0].least_gap(values).min(of[1].least_gap(values)),
            Where(of) => {
                let inner = of.iter().map(|part| part.least_gap(values)).fold(f64::INFINITY, f64::min);
                inner.min((of[0].at(values) - of[1].at(values)).abs())
            }
        }
    }

    /// One of some terms of rates that stay bounded, times a factor; of the value alone, if there are no `neighbours`.
    pub fn term(dice: &mut Dice, neighbours: &[Variable]) -> Expression {
        let own = || Of(Variable::Own);
        let number = |dice: &mut Dice, lo, hi| Number(dice.between(lo, hi));
        let alone = neighbours.is_empty();
        let other = if alone { Variable::Own } else { dice.pick(neighbours) };
        let term = match dice.roll(if alone { 8 } else { 15 }) {
            0 => Number(1.0),
            1 => own(),
            2 => Call("sin", Box::new(infix('*', number(dice, 0.5, 4.0), own()))),
            3 => {
                let square = infix('/', infix('*', own(), own()), number(dice, 0.5, 3.0));
                infix('*', own(), infix('-', Number(1.0), square))
            }
            4 => Call("cos", Box::new(infix('*', number(dice, 0.5, 6.0), Of(Variable::Time)))),
            5 => Call("sin", Box::new(infix('*', number(dice, 0.5, 6.0), Of(Variable::Age)))),
            6 => Call("exp", Box::new(infix('-', Number(0.0), Of(Variable::Age)))),
            7 => infix('*', own(), infix('-', number(dice, 0.5, 2.0), own())),
            8 | 9 => {
                let all = neighbours.iter().map(|variable| Of(*variable));
                let sum = all.reduce(|a, b| infix('+', a, b)).unwrap_or_else(own);
                infix('-', sum, infix('*', Number(neighbours.len() as f64), own()))
            }
            10 => Pair("max", Box::new([infix('-', Of(other), own()), Number(0.0)])),
            11 => Call("abs", Box::new(infix('-', Of(other), own()))),
            12 => {
                let more = infix('-', Of(other), own());
                Where(Box::new([Of(other), own(), more, Number(0.0)]))
            }
            13 => infix('/', Of(other), infix('+', Number(1.0), infix('*', own(), own()))),
            _ => Pair("min", Box::new([Of(other), Number(dice.between(0.2, 2.0))])),
        };
        infix('*', Number(dice.between(0.05, 2.5)), term)
    }
}

impl Expression {
    /// A function of what a cell has and reads, some of which jump.
    pub fn function(dice: &mut Dice, neighbours: &[Variable]) -> Expression {
        let own = || Of(Variable::Own);
        let other = || if neighbours.is_empty() { Variable::Age } else { neighbours[neighbours.len() - 1] };
        let number = |dice: &mut Dice| Number(dice.between(0.2, 2.0));
        match dice.roll(6) {
            0 => infix('*', own(), Of(other())),
            1 => Call("floor", Box::new(infix('*', Number(dice.between(1.0, 6.0)), own()))),
            2 => Call("floor", Box::new(infix('-', infix('*', Number(4.0), Of(other())), own()))),
            3 => Where(Box::new([own(), number(dice), number(dice), Of(other())])),
            4 => Where(Box::new([Of(other()), own(), number(dice), Number(0.1)])),
            _ => infix('-', Call("exp", Box::new(infix('-', Number(0.0), own()))), Of(other())),
        }
    }
}

impl fmt::Display for Expression {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Number(x) => write!(f, "{x}"),
            Of(variable) => {
                let attached = ["sum(F(y, d, e): d)", "largest(F(y, d, e): d)"];
                let names = ["x", "c", "l", "r", "t", "v", "p", attached[0], attached[1]];
                f.write_str(names[*variable as usize])
            }
            Call(name, of) => write!(f, "{name}({of})"),
            Pair(name, of) => write!(f, "{name}({}, {})", of[0], of[1]),
            Infix(operator, of) => write!(f, "({} {operator} {})", of[0], of[1]),
            Where(of) => write!(f, "(if {} > {} then {} else {})", of[0], of[1], of[2], of[3]),
        }
    }
}

/// A comparison of two sides.
#[derive(Clone, Debug)]
pub struct Comparison {
    pub sides: [Expression; 2],
    pub operator: &'static str,
}

impl Comparison {
    fn random(dice: &mut Dice, neighbours: &[Variable], has_function: bool) -> Comparison {
        let (own, age) = (|| Of(Variable::Own), || Of(Variable::Age));
        let other = if neighbours.is_empty() { Variable::Time } else { dice.pick(neighbours) };
        let left = match dice.roll(9) {
            0 if has_function && !neighbours.is_empty() => Of(Variable::LeftFunction),
            0..3 if has_function => Of(Variable::Function),
            0..3 => own(),
            3 => age(),
            4 => infix('-', own(), Of(other)),
            5 => infix('+', own(), infix('*', Number(dice.between(0.2, 2.0)), Of(other))),
            6 => infix('*', own(), age()),
            7 => Call("sin", Box::new(infix('*', Number(dice.between(0.5, 5.0)), own()))),
            _ => infix('-', infix('*', own(), own()), age()),
        };
        let operator = dice.pick(&[">", ">", "<", ">=", "<=", "="]);
        Comparison { sides: [left, Number(dice.between(-0.5, 2.0))], operator }
    }

    /// The difference of the sides.
    pub fn gap(&self, values: &Values) -> f64 {
        self.sides[0].at(values) - self.sides[1].at(values)
    }

    /// True for a difference of this sign: -1, 0 or 1.
    pub fn holds(&self, sign: f64) -> bool {
        match self.operator {
            ">" => sign > 0.0,
            "<" => sign < 0.0,
            ">=" => sign >= 0.0,
            "<=" => sign <= 0.0,
            _ => sign == 0.0,
        }
    }
}

/// One comparison, or two of which all, or any, have to hold.
#[derive(Clone, Debug)]
pub struct Condition {
    pub comparisons: Vec<Comparison>,
    pub any: bool,
}

impl Condition {
    pub fn random(dice: &mut Dice, neighbours: &[Variable], has_function: bool) -> Condition {
        let count = 1 + dice.roll(3) / 2;
        let comparisons = (0..count).map(|_| Comparison::random(dice, neighbours, has_function)).collect();
        Condition { comparisons, any: dice.roll(3) == 0 }
    }

    pub fn holds(&self, signs: &[f64]) -> bool {
        let mut each = self.comparisons.iter().zip(signs).map(|(comparison, sign)| comparison.holds(*sign));
        if self.any { each.any(|holds| holds) } else { each.all(|holds| holds) }
    }
}

impl fmt::Display for Condition {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        for (n, Comparison { sides, operator }) in self.comparisons.iter().enumerate() {
            let joint = if n == 0 { "" } else { [" & ", " | "][usize::from(self.any)] };
            write!(f, "{joint}{} {operator} {}", sides[0], sides[1])?;
        }
        Ok(())
    }
}
