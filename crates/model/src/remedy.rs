//! Suggested clauses for a rule whose domain ends without a production.
//!
//! A module that reaches the boundary of its legal domain needs a production there (section 3.1 of the paper). Messages
//! show the notation of such a clause with the names of the rule; its successor is up to the author of the model.

use super::{Class, Comparison, Kinds, Rule, Sign, base_of, class_of};

/// The two sides of a comparison as written.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Boundary {
    left: String,
    right: String,
    /// True if the atom has its sides in the opposite order.
    turned: bool,
}

impl Boundary {
    /// The sides as written; `turned` if the atom has them in the opposite order.
    pub fn new(left: &str, right: &str, turned: bool) -> Boundary {
        Boundary { left: left.to_owned(), right: right.to_owned(), turned }
    }

    /// The sides with a comparison of the atom between them.
    fn compared(&self, comparison: Comparison) -> String {
        let comparison = if self.turned { comparison.mirrored() } else { comparison };
        format!("{} {} {}", self.left, comparison.symbol(), self.right)
    }

    /// True if the text of the sides is unknown.
    pub fn is_empty(&self) -> bool {
        self.left.is_empty()
    }
}

/// Writes the equality of the sides, as in `x = s`.
impl std::fmt::Display for Boundary {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        if self.is_empty() { Ok(()) } else { f.write_str(&self.compared(Comparison::Equal)) }
    }
}

/// Clauses for the case that a comparison of a rule's domain fails.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Remedy {
    /// `if x = x_max produce F_end(x)`, if the name of the module is a word.
    pub produce: Option<String>,
    /// `if x >= x_max solve dx/dt = 0`, if the rule has equations.
    pub rest: Option<String>,
}

impl Remedy {
    /// The clauses for a comparison in the condition of a `solve` clause that fails with this sign of the difference. None if
    /// there is no such clause.
    pub fn new(
        kinds: &Kinds,
        rule: &Rule,
        atom: usize,
        comparison: Comparison,
        sign: Sign,
    ) -> Option<Remedy> {
        let boundary = &rule.boundaries[atom];
        if boundary.is_empty() || sign == Sign::Undefined {
            return None;
        }
        let beyond = boundary.compared(comparison.negated());
        // The paper's notation at the boundary is an equation; beyond it only the inequality holds.
        let at = match (sign, comparison) {
            (Sign::Zero, Comparison::Less | Comparison::Greater) => boundary.to_string(),
            _ => beyond.clone(),
        };
        let name = kinds.iter().map(|(_, kind)| kind).find(|k| k.all_rules().any(|i| i == rule.index));
        let name = name.map(|kind| kind.name.as_str()).filter(|name| class_of(name) == Class::Word);
        // Clocks of events at a rate have no notation.
        let shown = rule.parameters.len() - rule.hidden;
        let produce = name.map(|name| {
            let ending = ending(kinds, name);
            match &*rule.parameters[..shown].join(", ") {
                "" => format!("if {at} produce {ending}"),
                all => format!("if {at} produce {ending}({all})"),
            }
        });
        let moving = rule.solves.iter().flat_map(|solve| &solve.of).filter(|p| **p < shown).min();
        let rest = moving.map(|&p| format!("if {beyond} solve d{}/dt = 0", rule.parameters[p]));
        (produce.is_some() || rest.is_some()).then_some(Remedy { produce, rest })
    }
}

/// An unused name with the same base, hence the same drawing and contexts: `F_end` for `F` and `F_v`.
fn ending(kinds: &Kinds, name: &str) -> String {
    let base = base_of(name);
    let taken = |name: &str| kinds.iter().any(|(_, kind)| kind.name == name);
    let numbers = (2..).map(|n| format!("{base}_end_{n}"));
    std::iter::once(format!("{base}_end")).chain(numbers).find(|name| !taken(name)).expect("kinds are finite")
}
