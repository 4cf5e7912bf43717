//! Rows of cells that are empty at first and filled by their neighbours, with a condition that asks for less than nothing.
//!
//! No cell is ever below zero: where its value is 0 and those beside it are not less, its rate is not less than 0 either. So the condition
//! never holds, and the run with it is the run without it. Numbers know no such thing: what has not been reached yet is 1e-40 to either side.

use dlsys::tree::ModuleString;

use super::{Accuracy, Judged, RIGHT, Verdict, dice};
use crate::Dice;

/// When states are compared.
const TIMES: [f64; 2] = [0.3, 1.1];

/// A row with a value and sometimes a condition on it.
pub struct EmptyRow {
    /// All but the condition.
    row: String,
    condition: &'static str,
    factor: f64,
    accuracy: Accuracy,
}

/// Conditions that never hold, perhaps with a value behind a stroke, `#` being a positive number.
const NEVER: [&str; 10] = [
    "if c < 0 produce ε",
    "if c < 0 & x > 0.1 produce F_v(0, 0.4, 0)",
    "if v < 0 produce F_v(0, 0.4, 0)|floor(#*c)",
    "if v > 0.5 produce ε|if c < 0 then 1 else 0",
    "if v <= -1 produce ε|floor(#*c)",
    "if #*c < 0 produce ε",
    "if c + r < 0 produce ε",
    "if c < -0*r produce ε",
    "if -c > 0 produce F_v(0, 0.4, 0)",
    "if min(c, r) < 0 produce ε",
];

impl EmptyRow {
    pub fn new(seed: u64) -> EmptyRow {
        let dice = &mut dice(seed);
        let count = 3 + dice.roll(10);
        let rate: Vec<String> = (0..1 + dice.roll(3)).map(|_| term(dice)).collect();
        let loss = dice.between(0.1, 1.5);
        let cell = |dice: &mut Dice| {
            let value = if dice.roll(5) == 0 { dice.between(0.0, 1.0) } else { 0.0 };
            format!("F_v({}, {value}, 0)", dice.between(0.0, 1.0))
        };
        let cells: Vec<String> = (0..count).map(|_| cell(dice)).collect();
        let right = if dice.roll(2) == 0 { dice.between(0.0, 2.0) } else { 0.0 };
        let (left, right) = match dice.roll(4) {
            0 => (right, dice.between(0.0, 2.0)),
            _ => (dice.between(0.0, 2.0), right),
        };
        let condition = dice.pick(&NEVER);
        let factor = dice.between(0.3, 5.0);
        let row = format!(
            "initial string: F_w(0, {left}, 0) {} F_w(0, {right}, 0)\nF(u, l, p) < F_v(x, c, v) > F(w, r, q):\n  solve dx/dt = 1, dc/dt = {} - {loss}*c",
            cells.join(" "),
            rate.join(" + ")
        );
        EmptyRow { row, condition, factor, accuracy: Accuracy::random(dice) }
    }

    /// The model with its value, with or without its condition.
    fn written(&self, has_condition: bool) -> String {
        let (condition, value) = self.condition.split_once('|').unwrap_or((self.condition, ""));
        let factor = self.factor.to_string();
        let value = if value.is_empty() { String::new() } else { format!(", v = {value}") };
        let condition = if has_condition { format!("  {condition}\n") } else { String::new() };
        format!("{}{value}\n{condition}", self.row).replace('#', &factor)
    }
}

/// A term of a rate that is not negative where the value is 0.
fn term(dice: &mut Dice) -> String {
    let factor = dice.between(0.05, 2.0);
    let level = dice.between(0.2, 1.0);
    let term = dice.pick(&[
        "(l + r - 2*c)",
        "max(l - c, 0)",
        "max(r - c, 0)",
        "abs(r - c)",
        "c*(1 - c/#)",
        "(if l > c then l - c else 0)",
        "l/(1 + c*c)",
        "min(r, #)",
        "l*r",
        "c",
    ]);
    format!("{factor}*{}", term.replace('#', &level.to_string()))
}

/// The values of all modules but the walls.
fn values(string: &ModuleString) -> Vec<f64> {
    let all = string.iter().filter(|module| module.parameters.len() == 3);
    all.map(|module| module.parameters[1]).collect()
}

impl Judged for EmptyRow {
    fn text(&self) -> String {
        self.written(true)
    }

    fn command(&self, file: &str) -> String {
        self.accuracy.command(file, &TIMES)
    }

    fn judge(&self) -> Verdict {
        let Ok((without, _)) = self.accuracy.run(&self.written(false), &TIMES) else { return Verdict::Open };
        let with = match self.accuracy.run(&self.written(true), &TIMES) {
            Ok((states, _)) => states,
            Err(message) => return Verdict::Refused(message),
        };
        for ((with, without), time) in with.iter().zip(&without).zip(TIMES) {
            let [with, without] = [with, without].map(values);
            let is_near =
                |(a, b): (&f64, &f64)| (a - b).abs() <= RIGHT * self.accuracy.tolerance * b.abs().max(1.0);
            if with.len() != without.len() || !with.iter().zip(&without).all(is_near) {
                return Verdict::Wrong(format!(
                    "t = {time}: `{}` holds somewhere: {with:?}, without it {without:?}",
                    self.condition
                ));
            }
        }
        Verdict::Right(TIMES.len())
    }
}
