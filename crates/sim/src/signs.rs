//! Signs of the differences of a rule's atoms: their numbers, and what follows when some of them change.

use smallvec::SmallVec;

use super::state::State;
use dlsys_expr::{Scratch, Sign};
use dlsys_model::{Condition, Rule, Solve, Truth};

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
