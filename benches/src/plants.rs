//! The models of the benchmarks at scale, as text: modules of formulas, filaments, branches.
//!
//! A cascade of productions at t = 0 creates a large string, so that the text is short and its parsing time negligible;
//! only the filaments with random cells are written out.

use std::fmt::Write;

/// Random numbers that are the same on every machine.
pub struct Dice(u64);

impl Dice {
    pub fn new(seed: u64) -> Dice {
        Dice(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1)
    }

    /// A number in low..high.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        // Knuth's MMIX generator; the high bits are good.
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * ((self.0 >> 11) as f64 / (1u64 << 53) as f64)
    }
}

/// `n` times the module that `made` makes of its number `i`: G(i, n) halves itself until one is left.
fn cascade(before: &str, n: usize, made: &str) -> String {
    format!(
        "initial string: {before} G(0, {n})\n\
         G(i, n):\n  if n > 1 produce G(i, floor(n/2)) G(i + floor(n/2), n - floor(n/2))\n  \
         if n = 1 produce {made}\n"
    )
}

/// Modules of which each is replaced by one of its kind, again and again: all of them by formulas.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lives {
    /// All newborns are alike, every life lasts one unit of time.
    Alike,
    /// A logistic growth from 1 to 2, all newborns alike.
    Logistic,
    /// Lives of 1 to 2 units of time, drawn anew by each newborn from its parent's.
    Various,
}

impl Lives {
    pub const ALL: [Lives; 3] = [Lives::Alike, Lives::Logistic, Lives::Various];

    pub fn name(self) -> &'static str {
        match self {
            Lives::Alike => "newborns alike",
            Lives::Logistic => "logistic, newborns alike",
            Lives::Various => "lives that change",
        }
    }

    /// `n` modules with phases of their own.
    pub fn text(self, n: usize) -> String {
        match self {
            Lives::Alike => {
                cascade("", n, &format!("A(i/{n})"))
                    + "A(x):\n  if x < 1 solve dx/dt = 1\n  if x = 1 produce A(0)\n"
            }
            Lives::Logistic => {
                cascade("", n, &format!("A(1 + i/{n})"))
                    + "A(x):\n  if x < 2 solve dx/dt = 2*(1 - x/3)*x\n  if x = 2 produce A(1)\n"
            }
            // The logistic map at 4: no life comes back, and none of them ends at 0 in 52 generations.
            Lives::Various => {
                cascade("", n, &format!("A(0, (i + 0.4567)/{n})"))
                    + "A(x, p):\n  if x < 1 + p solve dx/dt = 1\n  if x = 1 + p produce A(0, 4*p*(1 - p))\n"
            }
        }
    }
}

/// `n` modules of two parameters, each with a life of its own length.
pub fn two_parameters(n: usize) -> String {
    cascade("", n, &format!("A(0, 1 + i/{n})"))
        + "A(x, s):\n  if x < s solve dx/dt = s/2\n  if x = s produce A(0, 1.25*s)\n"
}

/// What sibling branches do, each of which looks at the node that all of them grow from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Branches {
    /// Nothing after they have looked once.
    Rest,
    /// Each is replaced once per unit of time, and the new one looks again.
    Renew,
    /// The node is replaced once per unit of time, and all look again.
    Node,
    /// Each follows the value of the node: their equations are coupled with its one.
    Follow,
}

impl Branches {
    pub const ALL: [Branches; 4] = [Branches::Rest, Branches::Renew, Branches::Node, Branches::Follow];

    pub fn name(self) -> &'static str {
        match self {
            Branches::Rest => "look once",
            Branches::Renew => "renewed one by one",
            Branches::Node => "the node renewed",
            Branches::Follow => "follow the node",
        }
    }

    /// `n` branches on one node.
    pub fn text(self, n: usize) -> String {
        let rules = match self {
            Branches::Rest => "R(y) < B(x): if x < 9 & y < 9 produce E(x + y)\n",
            Branches::Renew => {
                "R(y) < B(x):\n  if x < 1 & y > 0 solve dx/dt = 1\n  if x = 1 & y > 0 produce B(0)\n"
            }
            Branches::Node => {
                "R(y) < B(x): solve dx/dt = 1\nR(y):\n  if y < 2 solve dy/dt = 1\n  if y = 2 produce R(1)\n"
            }
            Branches::Follow => "R(y) < B(x): solve dx/dt = y - x\nR(y): solve dy/dt = y*(2 - y)*(1.5 - y)\n",
        };
        cascade("R(1)", n, &format!("[B(i/{n})]")) + rules
    }
}

/// The reach from one cell to the next, in all filaments.
const D: f64 = 0.03;
const MU: f64 = 0.03;

/// 1,000 cells (or more), each of which halves what it holds and is filled up again, once per unit of time, at a time
/// of its own.
pub fn busy(cells: usize) -> String {
    let mut dice = Dice::new(5);
    let mut string = String::new();
    for _ in 0..cells {
        let (x, c) = (dice.between(0.0, 1.0), dice.between(50.0, 200.0));
        let _ = write!(string, "F_v({x}, {c}) ");
    }
    format!(
        "const D = {D}\nconst mu = {MU}\ninitial string: F_w(0, 255) {string} F_w(0, 255)\n\
         F(u, l) < F_v(x, c) > F(v, r):\n  if x < 1 solve dx/dt = 1, dc/dt = D*(l + r - 2c) - mu*c\n  \
         if x = 1 produce F_v(0, 0.5*c + 60)\n"
    )
}

/// The same with cells that exchange so fast that the equations are stiff.
pub fn busy_and_stiff(cells: usize) -> String {
    busy(cells).replacen(&format!("const D = {D}"), "const D = 10000", 1)
}

/// Cells between two walls with a flow between two in proportion to the mean of what they hold, and no events.
pub fn nonlinear(cells: usize) -> String {
    let mut dice = Dice::new(5);
    let mut string = String::new();
    for _ in 0..cells {
        let _ = write!(string, "F_v({}) ", dice.between(50.0, 200.0));
    }
    format!(
        "const D = {D}\nconst mu = {MU}\nconst w = 255\ninitial string: F_w(w) {string} F_w(w)\n\
         F(l) < F_v(c) > F(r): solve dc/dt = D/(2*w)*(l^2 + r^2 - 2*c^2) - mu*c\n"
    )
}

/// A filament that grows and divides.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Growing {
    /// The listing of the paper: a cell in which the compound runs out becomes a heterocyst.
    Anabaena,
    /// All cells make the compound, so none becomes a heterocyst.
    Vegetative,
}

impl Growing {
    pub const ALL: [Growing; 2] = [Growing::Anabaena, Growing::Vegetative];

    pub fn name(self) -> &'static str {
        match self {
            Growing::Anabaena => "Anabaena",
            Growing::Vegetative => "no heterocysts",
        }
    }

    /// `cells` of random lengths between two heterocysts; in [`Growing::Anabaena`] every tenth is a heterocyst.
    pub fn text(self, cells: usize, seed: u64) -> String {
        let mut dice = Dice::new(seed);
        let mut string = String::new();
        for i in 0..cells {
            // Ages, not lengths, are spread evenly in a tissue that grows.
            let x = 0.37f64.powf(dice.between(0.001, 0.999));
            let c = dice.between(60.0, 240.0);
            let _ = match self {
                Growing::Anabaena if i % 10 == 9 => write!(string, "F_h(1, 255) "),
                _ => write!(string, "F_v({x}, {c}) "),
            };
        }
        let source = if self == Growing::Anabaena { "- mu*c" } else { "+ mu*(100 - c)" };
        format!(
            "const D = {D}\nconst mu = {MU}\nconst r = ln(1.01)\n\
             initial string: F_h(1, 255) {string} F_h(1, 255)\n\
             F(x_l, c_l) < F_v(x, c) > F(x_r, c_r):\n  \
             if x < 1 & c > 5 solve dx/dt = r*x, dc/dt = D*(c_l + c_r - 2c) {source}\n  \
             if x = 1 & c > 5 produce F_v(0.37*x, c) F_v(0.63*x, c)\n  \
             if c = 5 produce F_h(x, c)\n\
             F_h(x, c): solve dx/dt = 0.1*(1 - x), dc/dt = 0.15*(255 - c)\n"
        )
    }
}

/// A text of about `bytes`, of many kinds with the rules of the paper's Anabaena each.
pub fn many_rules(bytes: usize) -> String {
    let mut text = String::from("initial string: F0_v(0.5, 255)\n");
    for i in 0.. {
        let last = text.len() >= bytes;
        let next = if last { 0 } else { i + 1 };
        let _ = write!(
            text,
            "F{i}(x_l, c_l) < F{i}_v(x, c) > F{i}(x_r, c_r):\n  \
             if x < 1 & c > 5 solve dx/dt = ln(1.01)*x, dc/dt = 0.03*(c_l + c_r - 2c) - 0.03*c\n  \
             if x = 1 & c > 5 produce F{i}_v(0.37*x, c) F{next}_v(0.63*x, c)\n  if c = 5 produce F{i}_h(x, c)\n"
        );
        if last {
            break;
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scale;

    #[test]
    fn every_model_runs_and_does_what_it_is_for() {
        let events =
            |text: &str, from, to| scale::work(text, Default::default(), from, to).expect("it runs").events;
        for lives in Lives::ALL {
            let per_unit = events(&lives.text(100), 1.0, 11.0) as f64 / 1000.0;
            assert!((0.6..1.5).contains(&per_unit), "{lives:?}: {per_unit}");
        }
        for branches in Branches::ALL {
            let expected = match branches {
                Branches::Renew => 1000,
                Branches::Node => 10,
                _ => 0,
            };
            assert_eq!(events(&branches.text(100), 0.5, 10.5), expected, "{branches:?}");
        }
        assert_eq!(events(&busy(50), 0.0, 4.0), 200);
        for growing in Growing::ALL {
            assert!(events(&growing.text(50, 1), 0.0, 50.0) > 20, "{growing:?}");
        }
        scale::work(&two_parameters(100), Default::default(), 0.0, 9.0).expect("it runs");
    }
}
