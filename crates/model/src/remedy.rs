//! The clauses that a rule lacks where its domain ends, ready to be put under its head.
//!
//! A module that reaches the boundary of its legal domain needs a production there (section 3.1 of the paper). Which
//! one, only the author knows; how it is written with the rule's own names, the model does.

use super::{Class, Comparison, Kinds, Rule, Sign, base_of, class_of};

/// The two sides of a comparison as they are written.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Boundary {
    left: String,
    right: String,
    /// The atom has its sides the other way round.
    turned: bool,
}

impl Boundary {
    /// The sides as written; `turned` if the atom has them the other way round.
    pub fn new(left: &str, right: &str, turned: bool) -> Boundary {
        Boundary { left: left.to_owned(), right: right.to_owned(), turned }
    }

    /// The sides with a comparison of the atom between them.
    fn compared(&self, comparison: Comparison) -> String {
        let comparison = if self.turned { comparison.mirrored() } else { comparison };
        format!("{} {} {}", self.left, comparison.symbol(), self.right)
    }

    /// True if the text is not known.
    pub fn is_empty(&self) -> bool {
        self.left.is_empty()
    }
}

/// Where the sides meet, as in `x = s`.
impl std::fmt::Display for Boundary {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        if self.is_empty() { Ok(()) } else { f.write_str(&self.compared(Comparison::Equal)) }
    }
}

/// What can be written for the case that a comparison of a rule's domain fails.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Remedy {
    /// `if x = x_max produce F_end(x)`, if the module's name can have an ending.
    pub produce: Option<String>,
    /// `if x >= x_max solve dx/dt = 0`, if the rule has equations.
    pub rest: Option<String>,
}

impl Remedy {
    /// The clauses for a comparison that stands in the condition of a `solve` clause and fails with this sign of the
    /// difference. None if they cannot be written.
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
        // At the boundary the paper writes an equation; somewhere behind it only the inequality holds.
        let at = match (sign, comparison) {
            (Sign::Zero, Comparison::Less | Comparison::Greater) => boundary.to_string(),
            _ => beyond.clone(),
        };
        let name = kinds.iter().map(|(_, kind)| kind).find(|k| k.all_rules().any(|i| i == rule.index));
        let name = name.map(|kind| kind.name.as_str()).filter(|name| class_of(name) == Class::Word);
        // Clocks of events at a rate are nothing that can be written.
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

/// A name for what a module becomes, drawn and met in contexts like itself: `F_end` for `F` and `F_v`.
fn ending(kinds: &Kinds, name: &str) -> String {
    let base = base_of(name);
    let taken = |name: &str| kinds.iter().any(|(_, kind)| kind.name == name);
    let numbers = (2..).map(|n| format!("{base}_end_{n}"));
    std::iter::once(format!("{base}_end")).chain(numbers).find(|name| !taken(name)).expect("kinds are finite")
}
