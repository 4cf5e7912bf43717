//! Which comparisons of discrete rules are between exact values.
//!
//! A value that no equation moves, and that is computed from such values only, is exactly what the text says, as in
//! every other interpreter of L-systems: 0.1 added up eight times is less than 0.8 or it is not. Values of equations have
//! errors of an integration, and so has time, which is rounded; these are compared with a tolerance.

use dlsys_model::{KindId, Model, Rule, Successor};

/// For each rule, by atom: both sides are exact. Empty for rules that are not discrete.
pub fn exact_atoms(model: &Model) -> Vec<Vec<bool>> {
    if model.rules.iter().all(|rule| !rule.discrete) {
        return vec![Vec::new(); model.rules.len()];
    }
    let inexact = inexact(model);
    let of_rule = |rule: &Rule| {
        let is_exact =
            |output| rule.sides.output_reads(output).iter().all(|v| !reads(model, &inexact, rule, *v));
        let atoms = 0..if rule.discrete { rule.atoms.len() } else { 0 };
        atoms.map(|atom| is_exact(2 * atom) && is_exact(2 * atom + 1)).collect()
    };
    model.rules.iter().map(of_rule).collect()
}

/// By kind and parameter: an equation moves it, or a value from which it is computed at some birth.
fn inexact(model: &Model) -> Vec<Vec<bool>> {
    let width = |rule: usize| model.rules[rule].parameters.len();
    let mut inexact: Vec<Vec<bool>> = (model.kinds.iter())
        .map(|(_, kind)| {
            let own = kind.all_rules().map(width).max().unwrap_or(0).max(kind.arity);
            let mut moves = vec![false; own];
            for solve in kind.all_rules().flat_map(|rule| &model.rules[rule].solves) {
                solve.of.iter().chain(&solve.algebraic.of).for_each(|p| moves[*p] = true);
            }
            // Where there are discrete rules only, what the surroundings give moves without an equation.
            for (_, parameter) in kind.read_inputs() {
                moves[parameter] = true;
            }
            moves
        })
        .collect();
    // Values computed from inexact ones are inexact, until nothing is added.
    loop {
        let mut news: Vec<(KindId, usize)> = Vec::new();
        for rule in &model.rules {
            let successors = rule.produces.iter().flat_map(|p| &p.outcome.successors);
            for stretch in successors.flat_map(Successor::stretches) {
                let mut output = 0;
                for &kind in &stretch.kinds {
                    for parameter in 0..model.kinds.get(kind).arity {
                        let read = stretch.arguments.output_reads(output + parameter);
                        if !inexact[kind.index()][parameter]
                            && read.iter().any(|v| reads(model, &inexact, rule, *v))
                        {
                            news.push((kind, parameter));
                        }
                    }
                    output += model.kinds.get(kind).computed();
                }
            }
        }
        if news.is_empty() {
            return inexact;
        }
        news.into_iter().for_each(|(kind, parameter)| inexact[kind.index()][parameter] = true);
    }
}

/// Whether a variable of a rule is inexact.
fn reads(model: &Model, inexact: &[Vec<bool>], rule: &Rule, variable: usize) -> bool {
    let of = |kind: KindId, p: usize| inexact[kind.index()].get(p).copied().unwrap_or(false);
    if variable < rule.parameters.len() {
        let own = model.kinds.iter().filter(|(_, kind)| kind.all_rules().any(|r| r == rule.index));
        return { own }.any(|(kind, _)| of(kind, variable));
    }
    let mut first = rule.parameters.len();
    for pattern in rule.left.iter().chain(&rule.right) {
        if variable < first + pattern.width {
            return pattern.kinds.iter().any(|kind| of(*kind, variable - first));
        }
        first += pattern.width;
    }
    // Sums over children and time are inexact; random numbers, behind them, are exact.
    variable < rule.variables
}
