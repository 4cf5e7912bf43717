//! Domains that a module can leave without a production.

use rustc_hash::FxHashSet;

use dlsys_diagnostic::Diagnostic;
use dlsys_model::{Comparison, Condition, Model, Remedy, Rule, Sign, Solve, Truth, ZeroCrossing};

/// Warns of domains that a module can leave without a production.
pub fn coverage(model: &Model, diagnostics: &mut Vec<Diagnostic>) {
    for rule in &model.rules {
        if rule.produces.iter().any(|p| p.guard.is_always()) {
            continue;
        }
        for (i, solve) in rule.solves.iter().enumerate() {
            let (mut said, mut gaps) = (FxHashSet::default(), FxHashSet::default());
            for (atom, comparison) in solve.guard.atoms() {
                let others = rule.solves.iter().enumerate().filter(|(j, s)| *j != i && !s.guard.is_always());
                let covered = rule.produces.iter().any(|p| p.guard.atoms().any(|(a, _)| a == atom))
                    || rule.solves.iter().any(|s| s.guard.is_always())
                    || others.into_iter().any(|(_, s)| s.guard.atoms().any(|(a, _)| a == atom));
                if solve.unreachable[atom] {
                    continue;
                }
                if !covered && said.insert(atom) {
                    // What never changes is not left at the boundary, but a module may be born beyond it.
                    let (why, sign) = match is_constant(solve, atom) {
                        true => {
                            ("a module for which this is false has no equation and no production", Sign::Any)
                        }
                        false => {
                            ("when this stops being true, there is no equation and no production", Sign::Zero)
                        }
                    };
                    let clause = clause(model, rule, (atom, comparison), sign);
                    let clause = clause.unwrap_or_else(|| "if … = … produce …".to_owned());
                    diagnostics.push(
                        Diagnostic::warning("no production covers this boundary of the domain")
                            .at(rule.atoms[atom], why)
                            .help(format!("add a clause for it, such as `{clause}`")),
                    );
                }
                if covered
                    && !is_constant(solve, atom)
                    && let Some(other) = gap(rule, solve, atom)
                    && gaps.insert(other)
                {
                    let clause = clause(model, rule, (atom, comparison), Sign::Zero);
                    let clause = clause.unwrap_or_else(|| "if … produce …".to_owned());
                    diagnostics.push(
                        Diagnostic::warning("productions cover only a part of a boundary of the domain")
                            .at(rule.atoms[other], "where this is false, there is none")
                            .at(
                                rule.atoms[atom],
                                "when this stops being true, there is no equation and no other production",
                            )
                            .help(format!(
                                "add a clause for the rest, behind the others, such as `{clause}`"
                            )),
                    );
                }
            }
        }
    }
}

/// True if the difference of an atom does not change while a clause is active.
fn is_constant(solve: &Solve, atom: usize) -> bool {
    matches!(solve.zero_crossings[atom], ZeroCrossing::Constant)
}

/// A clause for the case that a comparison of a domain fails, as it is written.
fn clause(model: &Model, rule: &Rule, (atom, comparison): (usize, Comparison), sign: Sign) -> Option<String> {
    let remedy = Remedy::new(&model.kinds, rule, atom, comparison, sign)?;
    remedy.produce.or(remedy.rest)
}

/// A comparison in the conditions of productions that hold where an atom of a domain becomes zero, such that none holds, and no equations do,
/// on the other side of the comparison, its boundary included. It compares what does not change meanwhile, such as a counter: of what moves, the
/// side may follow from where the module has come (`if x = 0 & v < 0`). Comparisons besides these two may have any outcome.
fn gap(rule: &Rule, solve: &Solve, atom: usize) -> Option<usize> {
    let may_hold = |guard: &Condition, own: Sign, (other, sign): (usize, Sign)| {
        let judged = guard.judge(|i| match i {
            _ if i == atom => own,
            _ if i == other => sign,
            _ => Sign::Any,
        });
        judged != Truth::No
    };
    let sides = [(Sign::Minus, Sign::Plus), (Sign::Plus, Sign::Minus)];
    let about = |guard: &Condition| guard.atoms().any(|(a, _)| a == atom);
    let produces = rule.produces.iter().filter(|produce| about(&produce.guard));
    let mut others = produces.flat_map(|produce| produce.guard.atoms()).map(|(other, _)| other);
    others.find(|&other| {
        let is_gap = |(inside, outside): (Sign, Sign), (near, far): (Sign, Sign)| {
            let guards = || {
                let solves = rule.solves.iter().map(|solve| &solve.guard);
                rule.produces.iter().map(|produce| &produce.guard).chain(solves)
            };
            let is_covered = |sign: Sign| {
                [Sign::Zero, outside]
                    .into_iter()
                    .any(|own| guards().any(|guard| may_hold(guard, own, (other, sign))))
            };
            let is_open = |sign: Sign| may_hold(&solve.guard, inside, (other, sign)) && !is_covered(sign);
            !may_hold(&solve.guard, outside, (other, near))
                && is_covered(near)
                && is_open(Sign::Zero)
                && is_open(far)
        };
        other != atom
            && is_constant(solve, other)
            && sides.iter().any(|own| sides.iter().any(|sign| is_gap(*own, *sign)))
    })
}
