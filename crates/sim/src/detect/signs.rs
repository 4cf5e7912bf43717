//! Signs of the differences that a rule's atoms compare: at birth, along closed forms, and the consequences of their
//! changes.

use smallvec::SmallVec;

use crate::trajectory::Trajectory;
use crate::world::state::State;
use dlsys_expr::{Interval, Scratch, Sign};
use dlsys_model::{Condition, Rule, Solve, Truth};
use dlsys_tree::SimTime;

/// Two numbers are equal if they differ by no more than this part of the larger one.
pub const EQUAL: f64 = 8.0 * f64::EPSILON;

/// Sides closer together than this part of the module's size may differ only by the resolution of time.
pub const NEAR: f64 = 1e-9;

/// 1, -1, or 0 where there is no sign.
pub fn sign_of(sign: Sign) -> f64 {
    match sign {
        Sign::Plus => 1.0,
        Sign::Minus => -1.0,
        _ => 0.0,
    }
}

/// The sign of the negated difference. Signs other than plus and minus are their own opposites.
#[inline]
pub fn opposite(sign: Sign) -> Sign {
    match sign {
        Sign::Plus => Sign::Minus,
        Sign::Minus => Sign::Plus,
        other => other,
    }
}

/// The rate of a parameter where it has the value `value`, computed from the equation as written; 0 where the rate is no
/// larger than the effect of rounding on it, and for parameters without an equation. `variables` are those of the rule,
/// followed by the switches.
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

/// True if a production may follow when the sides of an atom meet.
pub fn produces(rule: &Rule, signs: &[Sign], atom: usize) -> bool {
    let holds = |at: Sign| {
        let sign = |i: usize| if i == atom { at } else { signs[i] };
        rule.produces.iter().any(|p| p.guard.judge(sign) == Truth::Yes)
    };
    !holds(signs[atom]) && (holds(Sign::Zero) || holds(opposite(signs[atom])))
}

/// True if the signs at an instant, or just after it, have a consequence: a production, other equations, or another
/// switch.
pub fn matters(rule: &Rule, state: &State, at: &[Sign], after: &[Sign]) -> bool {
    let holds = |condition: &Condition, signs: &[Sign]| condition.judge(|i| signs[i]) == Truth::Yes;
    if rule.produces.iter().any(|p| holds(&p.guard, at) || holds(&p.guard, after)) {
        return true;
    }
    // The first `solve` clause whose condition holds is active.
    if rule.solves.iter().position(|s| holds(&s.guard, after)) != state.solve.get() {
        return true;
    }
    let Some(solve) = state.solve.get() else { return false };
    (rule.solves[solve].switches.iter().zip(&state.marks.switches()))
        .any(|(switch, &on)| holds(&switch.condition, after) != on)
}

/// The sign of an atom at the birth of a module, from the values of its two sides.
#[inline]
pub fn sign_at_birth(a: f64, b: f64) -> Sign {
    let (difference, size) = (a - b, a.abs().max(b.abs()));
    let equal = size.is_finite() && difference.abs() <= EQUAL * size;
    if equal { Sign::Zero } else { Sign::of(difference) }
}

/// The effect of a relative error of all variables on the difference of an atom's sides; 0 where the difference jumps.
pub fn noise(rule: &Rule, atom: usize, values: &[f64], error: f64) -> f64 {
    let around = |x: &f64| Interval { lo: x - error * x.abs(), hi: x + error * x.abs(), partial: false };
    let variables: Vec<Interval> = values.iter().map(around).collect();
    let mut out = vec![Interval::EMPTY; rule.sides.outputs()];
    rule.sides.eval(&variables, &mut Vec::new(), &mut out);
    half_width(out[2 * atom], out[2 * atom + 1])
}

/// The time at which a variable takes a level.
pub enum Reach {
    /// An instant: the variable is `t`.
    At(SimTime),
    /// An age of the module: the variable is `age`.
    Age(f64),
    /// A time since the start of the variable's trajectory.
    After(f64),
}

/// The time at which a variable with a closed form takes a level; None if it never does, or does not move. `time` is the
/// index of `t`, `start` the value at the start of the trajectory, and `exact` computes the rate at the level from the
/// equation as written.
#[inline]
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

/// True if a value may be a level but for the rounding of what it was computed from.
pub fn is_at(level: f64, value: f64) -> bool {
    (value - level).abs() <= NEAR * value.abs().max(level.abs()).max(1.0)
}

/// Half the width of the difference of two intervals; 0 where a side jumps or is unbounded.
pub fn half_width(a: Interval, b: Interval) -> f64 {
    let width = 0.5 * ((a.hi - a.lo) + (b.hi - b.lo));
    if a.partial || b.partial || !width.is_finite() { 0.0 } else { width }
}
