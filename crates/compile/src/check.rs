//! Checks of a compiled model: errors and warnings that need no simulation.

use rustc_hash::{FxHashMap, FxHashSet};

use crate::advice;
use crate::appearance::surface_hint;
use crate::clauses::names_of;
use crate::scene_checks::is_hidden;
use dlsys_diagnostic::{Diagnostic, Span};
use dlsys_model::{
    BUILT_IN_SURFACES, COMMAND_SURFACES, Class, Condition, ConditionStep, ContextPart, DETACH, DRAWN_WORDS,
    ELASTIC, GROUND, KindId, Model, Pattern, Rule, SOURCE, SURFACE_SIZES, base_of, class_of,
};
use dlsys_syntax::ast;
use dlsys_syntax::foreign_syntax;
use dlsys_syntax::print;
use dlsys_syntax::suggest::{meant, nearest};

/// Maximum number of rules of one strict predecessor.
const MAX_RULES: usize = 1000;
/// Maximum number of messages about modules that do nothing.
const MAX_INERT: usize = 20;

/// Reports rules and clauses that can never apply.
pub fn reachability(
    model: &Model,
    rules: &[&ast::Rule],
    occurs: &FxHashMap<KindId, Span>,
    diagnostics: &mut Vec<Diagnostic>,
) {
    let mut kinds_of: Vec<Vec<KindId>> = vec![Vec::new(); model.rules.len()];
    for (id, kind) in model.kinds.iter() {
        for rule in kind.all_rules() {
            kinds_of[rule].push(id);
        }
    }
    for (i, rule) in model.rules.iter().enumerate() {
        let own = &kinds_of[i];
        if let Some(at) = model.kinds.get(own[0]).rules_like(rule).get(MAX_RULES)
            && *at == i
        {
            diagnostics.push(
                Diagnostic::error(format!("more than {MAX_RULES} rules for one module"))
                    .at(rule.span, "this one is too many")
                    .help("write clauses with conditions under fewer heads"),
            );
        }
        shadowed_rule(model, i, own, diagnostics);
        clauses(rule, diagnostics);
        if own.iter().all(|kind| !occurs.contains_key(kind)) {
            diagnostics.extend(never_made(model, rules[i], occurs));
        }
    }
    // The kinds that can develop from the axiom.
    let mut alive: FxHashSet<KindId> = model.axiom.kinds().collect();
    let mut queue: Vec<KindId> = model.axiom.kinds().collect();
    while let Some(kind) = queue.pop() {
        for rule in model.kinds.get(kind).all_rules() {
            let successors = model.rules[rule].produces.iter().flat_map(|p| &p.outcome.successors);
            for made in successors.flat_map(|s| s.kinds()) {
                if alive.insert(made) {
                    queue.push(made);
                }
            }
        }
    }
    for (i, rule) in model.rules.iter().enumerate() {
        let own = &kinds_of[i];
        if own.iter().any(|k| occurs.contains_key(k)) && !own.iter().any(|k| alive.contains(k)) {
            diagnostics.push(
                Diagnostic::warning("this rule is not used")
                    .at(rule.span, "the initial string never grows into this module")
                    .help(match rules[i].predecessor.parameters.is_empty() {
                        true => format!("make it in a successor, `produce … {}`, or begin with it in the initial string", rule.label),
                        false => format!("make it in a successor, `produce … {}(…)`, or begin with it in the initial string", rules[i].predecessor.name.text),
                    }),
            );
        }
    }
}

fn shadowed_rule(model: &Model, index: usize, own: &[KindId], diagnostics: &mut Vec<Diagnostic>) {
    let rule = &model.rules[index];
    // A context that nothing matches is reported elsewhere.
    let wider = |a: &Pattern, b: &Pattern| !b.kinds.is_empty() && b.kinds.iter().all(|k| a.matches(*k));
    let own_rules = model.kinds.get(own[0]).rules_like(rule);
    let earlier = own_rules.iter().take(MAX_RULES).take_while(|j| **j < index);
    // The first discrete rule whose condition also holds applies.
    let holds = |before: &Rule| !rule.discrete || before.produces.iter().all(|p| p.guard.is_always());
    let shadow = earlier.map(|j| (*j, &model.rules[*j])).find(|(j, before)| {
        holds(before)
            && own.iter().all(|k| model.kinds.get(*k).rules_like(rule).contains(j))
            && before.left.len() <= rule.left.len()
            // Contexts with branches may match in several ways.
            && before.right_shape.iter().all(|turn| *turn == ContextPart::Module)
            && rule.right_shape.iter().all(|turn| *turn == ContextPart::Module)
            && before.right.len() <= rule.right.len()
            && before.left.iter().rev().zip(rule.left.iter().rev()).all(|(a, b)| wider(a, b))
            && before.right.iter().zip(&rule.right).all(|(a, b)| wider(a, b))
    });
    if let Some((_, before)) = shadow {
        if before.left.len() == rule.left.len()
            && before.right.len() == rule.right.len()
            && before.label == rule.label
        {
            if rule.discrete {
                diagnostics.push(
                    Diagnostic::warning("this rule can never be reached")
                        .at(rule.span, "it has the head of the rule before it, and that one always holds")
                        .at(before.span, "this rule comes first")
                        .help("give the first one a condition: `A(x) : x > 3 -> …`"),
                );
                return;
            }
            diagnostics.push(
                Diagnostic::error("two rules have the same head")
                    .at(rule.span, "this one is never reached")
                    .at(before.span, "this one comes first")
                    .help("write all clauses under one head"),
            );
            return;
        }
        diagnostics.push(
            Diagnostic::warning("this rule can never be reached")
                .at(rule.span, "whenever its context matches, so does that of the rule before it")
                .at(before.span, "this rule comes first")
                .help("of several rules the first whose context matches applies: put the special one first"),
        );
    }
}

fn clauses(rule: &Rule, diagnostics: &mut Vec<Diagnostic>) {
    let solves: Vec<(&Condition, Span)> = rule.solves.iter().map(|s| (&s.guard, s.span)).collect();
    let produces = rule.produces.iter().filter(|p| !p.is_fault).map(|p| (&p.guard, p.span)).collect();
    for (kind, clauses) in [("solve", solves), ("produce", produces)] {
        for (i, (guard, span)) in clauses.iter().enumerate() {
            if guard.0 == [ConditionStep::Constant(false)] {
                diagnostics.push(
                    Diagnostic::error("this clause can never be reached")
                        .at(*span, "its condition is always false")
                        .help(always_false(rule)),
                );
            }
            let before = clauses[..i].iter().find(|(other, _)| other.is_always() || other == guard);
            if let Some((other, first)) = before {
                let why = if other.is_always() {
                    "this one always holds, and comes first"
                } else {
                    "this one has the same condition, and comes first"
                };
                let message = if kind == "solve" {
                    "two `solve` clauses for the same state"
                } else {
                    "this clause can never be reached"
                };
                diagnostics.push(
                    Diagnostic::error(message).at(*span, "this one is never reached").at(*first, why).help(
                        if kind == "solve" {
                            "write the equations in one clause, with commas: `solve dx/dt = …, dy/dt = …`"
                        } else {
                            "of several productions that hold at once, the first one written applies"
                        },
                    ),
                );
            }
        }
    }
}

/// Help for a condition that is never met: values that change.
fn always_false(rule: &Rule) -> String {
    let own: Vec<String> = rule.parameters.iter().map(|name| format!("`{name}`, ")).collect();
    format!("compare something that changes, such as {}`age` or `t`; or remove the clause", own.concat())
}

/// The error for a rule whose module occurs in no string. None if another check reports it: misspelt words and wrong
/// numbers of parameters are reported at the module.
fn never_made(model: &Model, rule: &ast::Rule, occurs: &FxHashMap<KindId, Span>) -> Option<Diagnostic> {
    let head = &rule.predecessor;
    let name = &*head.name.text;
    let error = Diagnostic::error("this rule can never be reached")
        .at(head.span, format!("no string has a module `{}`", print::head_module(head)));
    let names = names_of(rule);
    let other = (occurs.iter())
        .filter(|(id, _)| names.iter().any(|name| **name == *model.kinds.get(**id).name))
        .min_by_key(|(_, span)| **span);
    if let Some((id, span)) = other {
        let kind = model.kinds.get(*id);
        if kind.class() == Class::Word {
            return None;
        }
        let here = format!("here `{}` has {}", kind.name, crate::scope::plural(kind.arity, "parameter"));
        let right = advice::head_with(head, kind.arity);
        return Some(error.at(*span, here).help(format!("write the head with as many: `{right}`")));
    }
    let known = occurs.keys().map(|id| model.kinds.get(*id).name.as_str());
    let near = nearest(name, known);
    let idle = |near: &str| model.kinds.iter().all(|(_, k)| k.name != near || k.has_no_rules());
    if class_of(name) == Class::Word && near.is_some_and(idle) {
        return None;
    }
    Some(error.help(match near {
        Some(near) => meant(name, near),
        None => format!("put `{name}` into the initial string or a successor, or remove the rule"),
    }))
}

/// Checks the period of the discrete rules.
pub fn period(declared: Option<(f64, Span)>, model: &Model, diagnostics: &mut Vec<Diagnostic>) {
    let Some((period, span)) = declared else { return };
    if period <= 0.0 {
        diagnostics.push(
            Diagnostic::error("this period is invalid")
                .at(span, format!("it is {period}; a period is greater than 0"))
                .help("discrete rules apply at t = P, 2P, …: `period 1`"),
        );
    } else if model.rules.iter().all(|rule| !rule.discrete) {
        diagnostics.push(
            Diagnostic::warning("no rule has a period")
                .at(span, "it applies to discrete rules, and the model has none")
                .help("a discrete rule is written `A(x) : x > 3 -> F(x) A(x/2)`"),
        );
    }
}

/// Warns of modules without any effect: no rule, no drawing, no context. Of those in the drawings of others only surfaces count here.
pub fn inert_modules(
    model: &Model,
    occurs: &FxHashMap<KindId, Span>,
    drawn: &FxHashMap<KindId, Span>,
    diagnostics: &mut Vec<Diagnostic>,
) {
    let in_context: FxHashSet<KindId> = model
        .rules
        .iter()
        .flat_map(|r| r.left.iter().chain(&r.right).chain(r.aggregates.iter().map(|a| &a.pattern)))
        .flat_map(|p| p.kinds.iter().copied())
        .collect();
    let with_rules: FxHashSet<&str> = model
        .kinds
        .iter()
        .filter(|(_, k)| !k.has_no_rules() || k.interpretation.is_some())
        .map(|(_, k)| k.name.as_str())
        .collect();
    let surfaces = drawn.iter().filter(|(kind, _)| model.kinds.get(**kind).class() == Class::Surface);
    let mut all: Vec<(Span, KindId)> =
        occurs.iter().chain(surfaces).map(|(kind, span)| (*span, *kind)).collect();
    all.sort_unstable();
    let mut said = FxHashSet::default();
    for (span, id) in all {
        let kind = model.kinds.get(id);
        let name = kind.name.as_str();
        let known =
            with_rules.contains(name) || in_context.contains(&id) || DRAWN_WORDS.contains(&kind.base());
        let first = || Span { end: span.start + name.len() as u32, ..span };
        if known || !said.insert(name) {
            continue;
        }
        if said.len() > MAX_INERT {
            break;
        }
        match kind.class() {
            Class::Symbol => {}
            Class::Surface
                if BUILT_IN_SURFACES.contains(&kind.base())
                    || COMMAND_SURFACES.iter().any(|(command, _)| *command == name)
                    || name == GROUND
                    || kind.base() == DETACH
                    || kind.base() == ELASTIC
                    || kind.base() == SOURCE
                    || model.scenery.plants.iter().any(|plant| plant.name == name)
                    || model.scenery.sheets.iter().any(|sheet| sheet.name == name)
                    || model.appearance.surfaces.iter().any(|shape| shape.name == name) => {}
            Class::Surface => diagnostics.push(
                Diagnostic::warning(format!("there is no surface `{name}`: nothing is drawn for it"))
                    .at(
                        first(),
                        "built in are @L, a leaf, @K, a flower, @P, a petal, @B, a bud, and @O, a ball",
                    )
                    .help_opt(
                        foreign_syntax::module(name)
                            .map(str::to_owned)
                            .or_else(|| surface_hint(name, &model.appearance)),
                    ),
            ),
            Class::Word => {
                let names: FxHashSet<&str> = with_rules.iter().copied().chain(DRAWN_WORDS).collect();
                if let Some(parts) = split(name, &names) {
                    diagnostics.push(
                        Diagnostic::error(format!("unknown module `{name}`"))
                            .at(first(), "no rule, no drawing")
                            .help(format!("`{name}` is one name: write `{}`", parts.join(" "))),
                    );
                } else if let Some(near) =
                    nearest(name, with_rules.iter().copied().filter(|n| n.chars().count() > 1))
                {
                    diagnostics.push(
                        Diagnostic::error(format!("unknown module `{name}`"))
                            .at(first(), "no rule, no drawing")
                            .help(meant(name, near))
                            .help(format!(
                                "a module that only marks a place is declared with `interpret {name}: ε`"
                            )),
                    );
                } else {
                    diagnostics.push(
                        Diagnostic::warning(format!("module `{name}` does nothing"))
                            .at(first(), "no rule, no drawing, no context mentions it")
                            .help_opt(foreign_syntax::module(name).map(str::to_owned))
                            .help_opt(foreign_syntax::subscript(name))
                            .help(format!(
                                "a module that only marks a place is declared with `interpret {name}: ε`"
                            )),
                    );
                }
            }
        }
    }
}

/// Reports turtle commands with too few parameters.
pub fn commands(model: &Model, diagnostics: &mut Vec<Diagnostic>, places: &FxHashMap<KindId, Span>) {
    for (id, kind) in model.kinds.iter() {
        let mut commands = COMMAND_SURFACES.into_iter().chain([(ELASTIC, 1), (SOURCE, 2)]);
        let Some((name, needed)) = commands.find(|(name, _)| *name == kind.base()) else {
            continue;
        };
        let Some(span) = places.get(&id).filter(|_| kind.arity < needed && !is_hidden(model, kind)) else {
            continue;
        };
        let usage = match name {
            "@W" => "`@W(w)`, w the width to which the stem tapers",
            "@T" => "`@T(e)`, e the strength of the tropism",
            "@C" => "`@C(name)`, name that of a `contour`",
            ELASTIC => "`@E(name)`, name that of a `tissue`, or `@E(0)`: rigid from here",
            SOURCE => {
                "`@S(gas, rate, radius)`: blobs in a unit of t, and the distance within which they begin"
            }
            "@PC" => "`@PC(n, row, column)`: a control point of patch n, row and column from 0 to 3",
            "@PS" => "`@PS(n)`: patch n begins",
            _ => "`@PD(n)`: patch n is drawn",
        };
        diagnostics.push(
            Diagnostic::error(format!(
                "`{name}` needs {}, not {}",
                crate::scope::plural(needed, "parameter"),
                kind.arity
            ))
            .at(*span, format!("{} here", crate::scope::plural(kind.arity, "parameter")))
            .help(format!("write {usage}")),
        );
    }
}

/// Reports surfaces with more parameters than sizes.
pub fn surface_sizes(model: &Model, diagnostics: &mut Vec<Diagnostic>, places: &FxHashMap<KindId, Span>) {
    for (id, kind) in model.kinds.iter() {
        let name = kind.name.as_str();
        let declared = model.appearance.surfaces.iter().any(|shape| shape.name == name);
        if kind.arity <= SURFACE_SIZES || !(declared || BUILT_IN_SURFACES.contains(&name)) {
            continue;
        }
        let Some(span) = places.get(&id).filter(|_| kind.interpretation.is_none()) else { continue };
        let parameters: Vec<String> = (1..=kind.arity).map(|i| format!("x{i}")).collect();
        diagnostics.push(
            Diagnostic::error(format!(
                "`{name}` has at most {}, not {}",
                crate::scope::plural(SURFACE_SIZES, "size"),
                kind.arity
            ))
            .at(*span, format!("{} here", crate::scope::plural(kind.arity, "parameter")))
            .help(format!(
                "write `{name}(s)`, or `{name}(w, l, h)`: width, length and height in parts of the surface's own"
            ))
            .help(format!(
                "a module with other parameters needs a drawing: `interpret {name}({}): {name}(x1)`",
                parameters.join(", ")
            )),
        );
    }
}

/// Splits a word into two or more known names.
fn split<'n>(word: &'n str, names: &FxHashSet<&str>) -> Option<Vec<&'n str>> {
    if word.len() > 60 || base_of(word) != word {
        return None;
    }
    // best[i]: a split of the first i bytes.
    let mut best: Vec<Option<Vec<&str>>> = vec![None; word.len() + 1];
    best[0] = Some(Vec::new());
    for end in 1..=word.len() {
        for start in 0..end {
            let Some(part) = word.get(start..end) else { continue };
            if names.contains(part)
                && let Some(before) = &best[start]
            {
                let mut whole = before.clone();
                whole.push(part);
                best[end] = Some(whole);
                break;
            }
        }
    }
    best.pop().flatten().filter(|parts| parts.len() > 1)
}
