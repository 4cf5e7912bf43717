//! The law of a class of lives whose end puts one module in the place of another: what a chain needs of the model to go on from one life to
//! the next.

use dlsys_model::{Comparison, KindId, Model, Produce, Rule, Solve, Stretch, Successor, ZeroCrossing};

use crate::world::life::{End, LifeClass, Lives};

/// The law of one class.
#[derive(Clone, Debug)]
pub struct Law<'m> {
    pub rule: &'m Rule,
    pub solve: Option<usize>,
    /// Index of the production.
    pub produce: usize,
    /// The parameter that takes a level at the event, if it is one.
    pub meets: Option<usize>,
    /// The arguments of the successor.
    pub stretch: &'m Stretch,
    /// The kind of the successor.
    pub successor: KindId,
    /// The rule of the successor; None if it has none, so that the chain ends.
    pub next: Option<&'m Rule>,
    /// The key of the production.
    pub key: u64,
    /// The atoms of which the residual is the largest difference.
    pub at_boundary: Vec<usize>,
}

impl<'m> Law<'m> {
    /// The laws of all classes, by label; None for classes of which chains are not made.
    pub fn all(model: &'m Model, lives: &Lives) -> Vec<Option<Law<'m>>> {
        let classes = (0..lives.len()).map(|label| lives.get(label as u16));
        classes.map(|class| class.and_then(|class| Law::of(model, lives, class))).collect()
    }

    fn of(model: &'m Model, lives: &Lives, class: &LifeClass) -> Option<Law<'m>> {
        let Some(End::Crossing { produce, atom, .. }) = class.end else { return None };
        let rule = &model.rules[class.rule];
        let clause: &Produce = &rule.produces[produce];
        let [Successor::Plain(stretch)] = &clause.outcome.successors[..] else { return None };
        let [successor] = stretch.kinds[..] else { return None };
        let is_certain = !clause.is_fault && !clause.outcome.is_random() && stretch.clocks.is_empty();
        if !is_certain || successor.is_bracket() || !is_simple(rule, class.solve) {
            return None;
        }
        let next = lives.rule(successor);
        if next.is_none() && !model.kinds.get(successor).has_no_rules() {
            return None;
        }
        let ZeroCrossing::Formula { variable, .. } = rule.zero_crossings(class.solve)[atom] else {
            return None;
        };
        let at_boundary = (clause.guard.atoms())
            .filter(|(of, comparison)| *comparison == Comparison::Equal || *of == atom)
            .map(|(of, _)| of)
            .collect();
        let meets = (variable < rule.time_variable()).then_some(variable);
        let next = next.map(|next| &model.rules[next]);
        let (solve, key) = (class.solve, clause.key);
        Some(Law { rule, solve, produce, meets, stretch, successor, next, key, at_boundary })
    }
}

/// True if lives under a clause are polynomials and solutions of quadratic equations, and their events formulas.
pub fn is_simple(rule: &Rule, solve: Option<usize>) -> bool {
    use dlsys_model::SolutionForm::{Polynomial, Quadratic};
    let clause = solve.map(|solve| &rule.solves[solve]);
    let has_formulas = |clause: &Solve| {
        let mut laws = clause.solution_forms.iter();
        clause.switches.is_empty() && laws.all(|law| matches!(law, Polynomial(_) | Quadratic(_)))
    };
    let is_searched = |watch: &ZeroCrossing| matches!(watch, ZeroCrossing::Search { .. });
    clause.is_none_or(has_formulas) && !rule.zero_crossings(solve).iter().any(is_searched)
}
