//! Signs of the differences of a rule's atoms: their numbers, and what follows when some of them change.

use smallvec::SmallVec;

use crate::trajectory::Trajectory;
use crate::world::state::State;
use dlsys_expr::{Interval, Scratch, Sign};
use dlsys_model::{Condition, Rule, Solve, Truth};
use dlsys_tree::SimTime;

/// Two numbers are equal if they differ by no more than this part of the larger.
pub const EQUAL: f64 = 8.0 * f64::EPSILON;

/// Sides closer together than this part of the module's size may be equal but for the resolution of time.
pub const NEAR: f64 = 1e-9;

/// 1, -1, or 0 where there is no sign.
pub fn sign_of(sign: Sign) -> f64 {
    match sign {
        Sign::Plus => 1.0,
        Sign::Minus => -1.0,
        _ => 0.0,
    }
}

pub fn opposite(sign: Sign) -> Sign {
    match sign {
        Sign::Plus => Sign::Minus,
        Sign::Minus => Sign::Plus,
        other => other,
    }
}

/// The rate of a parameter where it has a value, as the equation is written; 0 where that is no more than the
/// rounding of it. `variables` are those of the rule with the switches.
pub fn rate_at(
    clause: Option<&Solve>,
    variables: &[f64],
    parameter: usize,
    value: f64,
    scratch: &mut Scratch<f64>,
    rates: &mut Vec<f64>,
) -> f64 {
    let Some(clause) = clause else { return 0.0 };
    let Some(index) = clause.of.iter().position(|p| *p == parameter) else { return 0.0 };
    let mut variables: SmallVec<[f64; 16]> = SmallVec::from_slice(variables);
    rates.resize(clause.rates.outputs(), 0.0);
    let mut rate = |x: f64| {
        variables[parameter] = x;
        clause.rates.eval(&variables, scratch, rates);
        rates[index]
    };
    let here = rate(value);
    // The rate changes by this much over the rounding of the value.
    let nearby = rate(value * (1.0 + 8.0 * f64::EPSILON));
    if here.abs() <= (nearby - here).abs() { 0.0 } else { here }
}

/// Whether a production may follow if an atom's sides meet.
pub fn produces(rule: &Rule, signs: &[Sign], atom: usize) -> bool {
    let holds = |at: Sign| {
        let sign = |i: usize| if i == atom { at } else { signs[i] };
        rule.produces.iter().any(|p| p.guard.judge(sign) == Truth::Yes)
    };
    !holds(signs[atom]) && (holds(Sign::Zero) || holds(opposite(signs[atom])))
}

/// Whether anything follows from the signs at an instant and just after it.
pub fn matters(rule: &Rule, state: &State, at: &[Sign], after: &[Sign]) -> bool {
    let holds = |condition: &Condition, signs: &[Sign]| condition.judge(|i| signs[i]) == Truth::Yes;
    if rule.produces.iter().any(|p| holds(&p.guard, at) || holds(&p.guard, after)) {
        return true;
    }
    // The first `solve` that holds is active.
    if rule.solves.iter().position(|s| holds(&s.guard, after)) != state.solve {
        return true;
    }
    let Some(solve) = state.solve else { return false };
    (rule.solves[solve].switches.iter().zip(&state.switches))
        .any(|(switch, &on)| holds(&switch.condition, after) != on)
}

/// The sign of an atom of a module that comes from nowhere, by its two sides.
pub fn sign_at_birth(a: f64, b: f64) -> Sign {
    let (difference, size) = (a - b, a.abs().max(b.abs()));
    let equal = size.is_finite() && difference.abs() <= EQUAL * size;
    if equal { Sign::Zero } else { Sign::of(difference) }
}

/// NextKind the errors of values, relative, make of the difference of an atom's sides.
pub fn noise(rule: &Rule, atom: usize, values: &[f64], error: f64) -> f64 {
    let around = |x: &f64| Interval { lo: x - error * x.abs(), hi: x + error * x.abs(), partial: false };
    let variables: Vec<Interval> = values.iter().map(around).collect();
    let mut out = vec![Interval::EMPTY; rule.sides.outputs()];
    rule.sides.eval(&variables, &mut Vec::new(), &mut out);
    half_width(out[2 * atom], out[2 * atom + 1])
}

/// When a variable takes a value.
pub enum Reach {
    /// At an instant: the variable is `t`.
    At(SimTime),
    /// At an age: the variable is `age`.
    Age(f64),
    /// So long after its trajectory began.
    After(f64),
}

/// When a variable with a closed form takes a value, if it ever does and moves. `time` is the index of `t`, `start` the
/// value with which the trajectory begins, and `exact` computes the rate at the value from the equation as written.
pub fn reach(
    variable: usize,
    time: usize,
    level: f64,
    trajectory: Option<&Trajectory>,
    start: f64,
    exact: impl FnOnce() -> f64,
) -> Option<Reach> {
    if !level.is_finite() {
        None
    } else if variable == time {
        Some(Reach::At(SimTime::new(level)))
    } else if variable == time + 1 {
        Some(Reach::Age(level))
    } else {
        Some(Reach::After(trajectory?.reach(level - start, exact)?))
    }
}

/// How far the difference of two sides may be from its middle. Zero where a side jumps.
pub fn half_width(a: Interval, b: Interval) -> f64 {
    let width = 0.5 * ((a.hi - a.lo) + (b.hi - b.lo));
    if a.partial || b.partial || !width.is_finite() { 0.0 } else { width }
}
