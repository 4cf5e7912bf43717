//! Detection of rules that never apply, because the values in their conditions never change and satisfy none of them.
//!
//! In a rule without `solve`, a condition over the module's own parameters is decided when the module is created. That is
//! common and intended; so a warning is given only if every module of the kind is created with constants, and none of
//! them satisfies any condition of the rule.

use crate::globals::mentions;
use dlsys_diagnostic::Diagnostic;
use dlsys_expr::Scratch;
use dlsys_model::{Condition, KindId, Model, Rule, Sign, Stretch, Successor, Truth};
use dlsys_syntax::ast::{self, Action, Document, Expression, Item, modules_of};

/// Maximum number of modules whose parameters are examined; beyond it no warning is given.
const MOST: usize = 1000;

/// Warns of rules that never apply. `written` contains the rules of the model as parsed.
pub fn rules(model: &Model, written: &[&ast::Rule], document: &Document, diagnostics: &mut Vec<Diagnostic>) {
    // A `param` may have another value in the next run.
    let adjustable = document.items.iter().any(|(item, _)| matches!(item, Item::Param { .. }));
    for (index, (rule, text)) in model.rules.iter().zip(written).enumerate() {
        let parameters = compared(rule);
        if parameters.is_empty() || !decided_at_birth(model, index) || adjustable && !is_fixed(text, document)
        {
            continue;
        }
        let Some(births) = births(model, index) else { continue };
        let meets = |values: &Vec<f64>| rule.produces.iter().any(|p| may_hold(rule, &p.guard, values));
        if births.is_empty() || births.iter().any(meets) {
            continue;
        }
        let names: Vec<String> = parameters.iter().map(|p| format!("`{}`", rule.parameters[*p])).collect();
        let (verb, first) =
            if names.len() == 1 { ("changes", parameters[0]) } else { ("change", parameters[0]) };
        let name = &text.predecessor.name.text;
        diagnostics.push(
            Diagnostic::warning("this rule never does anything")
                .at(
                    rule.produces[0].span,
                    format!(
                        "{} never {verb}, and no `{name}` is made for which this holds",
                        names.join(" and ")
                    ),
                )
                .help(format!("is a `solve` missing? Such as `solve d{}/dt = 1`", rule.parameters[first])),
        );
    }
}

/// The module's own parameters that the conditions of a rule read; empty if they read anything else, or if the rule has
/// equations, clocks or a context.
fn compared(rule: &Rule) -> Vec<usize> {
    let moves = rule.discrete || !rule.solves.is_empty() || rule.hidden > 0;
    if moves || !rule.left.is_empty() || !rule.right.is_empty() || rule.produces.is_empty() {
        return Vec::new();
    }
    let mut read: Vec<usize> = (0..rule.sides.outputs()).flat_map(|o| rule.sides.output_reads(o)).collect();
    read.sort_unstable();
    read.dedup();
    let own = rule.parameters.len();
    let conditions = rule.produces.iter().all(|p| p.guard.atoms().next().is_some());
    if conditions && read.iter().all(|v| *v < own) { read } else { Vec::new() }
}

/// True if no other rule applies to the same modules.
fn decided_at_birth(model: &Model, index: usize) -> bool {
    model.kinds.iter().all(|(_, kind)| {
        let mut rules = kind.all_rules();
        rules.all(|r| r == index) || !kind.all_rules().any(|r| r == index)
    })
}

/// True if the rule does not depend on a `param`, neither in its conditions nor in the arguments of its modules.
fn is_fixed(rule: &ast::Rule, document: &Document) -> bool {
    let own = |name: &str| rule.predecessor.parameters.iter().any(|p| &*p.text == name);
    let free = |e: Expression, own: &dyn Fn(&str) -> bool| mentions(document, e).all(|(name, _)| own(name));
    let conditions = rule.clauses.iter().filter_map(|clause| clause.guard).all(|guard| free(guard, &own));
    let head = &rule.predecessor.name.text;
    let made = |parts: &[ast::Part]| {
        let alike = modules_of(parts).filter(|module| module.name == *head || head.starts_with('±'));
        alike.flat_map(|module| &module.arguments).all(|argument| free(*argument, &|_| false))
    };
    conditions
        && document.items.iter().all(|(item, _)| match item {
            Item::Axiom(modules) => made(modules),
            Item::Rule(other) if std::ptr::eq(other, rule) => true,
            Item::Rule(other) => other.clauses.iter().all(|clause| match &clause.action {
                Action::Produce(all) => all.iter().all(|alternative| made(&alternative.modules)),
                Action::Solve(_) => true,
            }),
            _ => true,
        })
}

/// The parameters of all modules to which the rule applies; None if they are not constant. Modules in successors of the
/// rule itself are left out: if it applies to none of the others, it never creates any.
fn births(model: &Model, index: usize) -> Option<Vec<Vec<f64>>> {
    let is_own = |kind: KindId| model.kinds.get(kind).all_rules().any(|r| r == index);
    let others = model.rules.iter().filter(|rule| rule.index != index).flat_map(|rule| &rule.produces);
    let successors = others.flat_map(|p| &p.outcome.successors).chain([&model.axiom]);
    let mut births = Vec::new();
    for successor in successors.flat_map(Successor::stretches) {
        let mut next = 0;
        for &kind in &successor.kinds {
            let first = next;
            next += model.kinds.get(kind).computed();
            if !is_own(kind) {
                continue;
            }
            if births.len() == MOST {
                return None;
            }
            let arity = model.kinds.get(kind).arity;
            births.push((first..first + arity).map(|o| constant(successor, o)).collect::<Option<_>>()?);
        }
    }
    Some(births)
}

fn constant(successor: &Stretch, output: usize) -> Option<f64> {
    let arguments = &successor.arguments;
    arguments.constants().map(|all| all[output]).or_else(|| arguments.constant_output(output))
}

/// True if a condition may hold for a module with these parameters. Sides that are nearly equal count as equal or not.
fn may_hold(rule: &Rule, condition: &Condition, values: &[f64]) -> bool {
    let mut variables = vec![0.0; rule.variables];
    let own = values.len().min(rule.variables);
    variables[..own].copy_from_slice(&values[..own]);
    let mut sides = vec![0.0; rule.sides.outputs()];
    rule.sides.eval(&variables, &mut Scratch::default(), &mut sides);
    let sign = |atom: usize| {
        let (a, b) = (sides[2 * atom], sides[2 * atom + 1]);
        let near = (a - b).abs() <= 1e-9 * (a.abs() + b.abs());
        if near && a != b { Sign::Any } else { Sign::of(a - b) }
    };
    condition.judge(sign) != Truth::No
}
