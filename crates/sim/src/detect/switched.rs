//! Conditions inside equations: those in values (`v = if c > 1 then 2 else 0`) that decide over a production because its condition reads the value, and
//! what those in rates change.

use smallvec::SmallVec;

use crate::detect::signs::opposite;
use crate::world::path::Path;
use dlsys_expr::{Dual, Value};
use dlsys_model::{Rule, Sign, Solve, Truth};

/// The active equations, if a switch in them asks for an atom, and the condition of a production reads a value with such switches.
fn clause<'r>(path: &Path<'r>, atom: usize) -> Option<&'r Solve> {
    let rule: &'r Rule = path.rule;
    let solve = &rule.solves[path.state.solve.get()?];
    (asks(solve, atom) && !solve.algebraic.is_empty() && read(rule, solve).next().is_some()).then_some(solve)
}

/// True if a switch of a clause asks for an atom.
fn asks(solve: &Solve, atom: usize) -> bool {
    solve.switches.iter().any(|s| s.condition.atoms().any(|(other, _)| other == atom))
}

/// Puts the switches of a clause, which stand behind the variables, as signs have them.
fn set(rule: &Rule, solve: &Solve, signs: impl Fn(usize) -> Sign, values: &mut [f64]) {
    for (value, switch) in values[rule.variables..].iter_mut().zip(&solve.switches) {
        *value = f64::from(u8::from(switch.condition.judge(&signs) != Truth::No));
    }
}

/// The atoms of productions that read explicit values of a clause.
fn read<'r>(rule: &'r Rule, solve: &'r Solve) -> impl Iterator<Item = usize> + use<'r> {
    let values = &solve.algebraic;
    let is_explicit = |variable: &usize| {
        let place = values.of.iter().position(|parameter| parameter == variable);
        place.is_some_and(|place| values.explicit[place])
    };
    (0..rule.atoms.len())
        .filter(move |atom| rule.atom_reads[*atom].iter().any(is_explicit) && rule.decides_productions(*atom))
}

/// True if a production may follow, by way of a value, when the sides of an atom meet.
pub fn may_decide(path: &Path, atom: usize) -> bool {
    clause(path, atom).is_some()
}

/// How the rate of the difference of an atom's sides changes at a position, per unit of position, when the atom's sign becomes another; None if
/// more follows from that than other switches of the equations that are active.
pub fn change_of_rate(path: &Path, atom: usize, position: f64, now: &[Sign], after: Sign) -> Option<f64> {
    let (rule, active) = (path.rule, path.state.solve.get()?);
    let solve = &rule.solves[active];
    if !asks(solve, atom) {
        return None;
    }
    let after = |other: usize| if other == atom { after } else { now[other] };
    if rule.solves.iter().position(|s| s.guard.judge(after) == Truth::Yes) != Some(active) {
        return None;
    }
    let mut values = Vec::new();
    path.everything_at(position, &mut values);
    let (mut scratch, mut rates) = (Vec::new(), [(); 2].map(|()| vec![0.0; solve.rates.outputs()]));
    solve.rates.eval(&values, &mut scratch, &mut rates[0]);
    set(rule, solve, after, &mut values);
    solve.rates.eval(&values, &mut scratch, &mut rates[1]);
    values.truncate(rule.variables);
    let mut moved: Vec<Dual<f64>> = values.into_iter().map(Dual::constant).collect();
    for ((parameter, before), after) in solve.of.iter().zip(&rates[0]).zip(&rates[1]) {
        moved[*parameter].rate = after - before;
    }
    let mut sides = vec![Dual::constant(0.0); rule.sides.outputs()];
    rule.sides.eval(&moved, &mut Vec::new(), &mut sides);
    Some((sides[2 * atom].rate - sides[2 * atom + 1].rate) * path.h)
}

/// True if the active equations, with their present switches, have rates at a position.
pub fn is_defined(path: &Path, position: f64) -> bool {
    let Some(solve) = path.state.solve.get().map(|active| &path.rule.solves[active]) else { return true };
    let (mut values, mut rates) = (Vec::new(), vec![0.0; solve.rates.outputs()]);
    path.everything_at(position, &mut values);
    solve.rates.eval(&values, &mut Vec::new(), &mut rates);
    rates.iter().all(|rate| rate.is_finite())
}

/// True if a production holds at a position with the value that comes when the sides of an atom meet, and not with the one before.
pub fn decides(path: &Path, atom: usize, position: f64, now: &[Sign]) -> bool {
    let Some(solve) = clause(path, atom) else { return false };
    let rule = path.rule;
    let holds = |sign: Sign| {
        let mut values = Vec::new();
        path.everything_at(position, &mut values);
        let of_atom = |other: usize| if other == atom { sign } else { now[other] };
        set(rule, solve, of_atom, &mut values);
        let explicit = &solve.algebraic;
        let mut out = vec![0.0; explicit.values.outputs()];
        explicit.values.eval(&values, &mut Vec::new(), &mut out);
        for ((parameter, value), is_explicit) in explicit.of.iter().zip(out).zip(&explicit.explicit) {
            if *is_explicit {
                values[*parameter] = value;
            }
        }
        let mut sides = vec![0.0; rule.sides.outputs()];
        rule.sides.eval(&values, &mut Vec::new(), &mut sides);
        let mut signs: SmallVec<[Sign; 8]> = (0..rule.atoms.len()).map(of_atom).collect();
        for other in read(rule, solve) {
            signs[other] = Sign::of(sides[2 * other] - sides[2 * other + 1]);
        }
        rule.produces.iter().any(|p| p.guard.judge(|i| signs[i]) == Truth::Yes)
    };
    holds(opposite(now[atom])) && !holds(now[atom])
}
