//! Conditions as logic over the signs of differences.
//!
//! A comparison `a < b` holds if `a - b` is negative. The simulation follows the signs of these differences along the
//! trajectory; at an event it *knows* that a difference is zero, though the rounded numbers differ in their last place.
//! So conditions are evaluated on signs and not on numbers.

use dlsys_expr::{Comparison, Sign, Truth};
use smallvec::SmallVec;

/// One step of a condition in postfix order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ConditionStep {
    /// Compares the sides of the rule's atom of this number.
    Atom(u32, Comparison),
    /// A constant truth value.
    Constant(bool),
    /// The conjunction (minimum) of the two values before it.
    And,
    /// The disjunction (maximum) of the two values before it.
    Or,
    /// The negation of the value before it.
    Not,
}

/// A condition over the atoms of a rule; empty means always.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub struct Condition(pub Vec<ConditionStep>);

impl Condition {
    /// True if there is no condition.
    pub fn is_always(&self) -> bool {
        self.0.is_empty()
    }

    /// The truth value of the condition, given the sign of each atom.
    pub fn judge(&self, sign: impl Fn(usize) -> Sign) -> Truth {
        // Most conditions have one or two comparisons.
        if let [ConditionStep::Atom(atom, comparison)] = self.0[..] {
            return comparison.judge(sign(atom as usize));
        }
        let mut stack: SmallVec<[Truth; 16]> = SmallVec::new();
        for step in &self.0 {
            let truth = match *step {
                ConditionStep::Atom(atom, comparison) => comparison.judge(sign(atom as usize)),
                ConditionStep::Constant(true) => Truth::Yes,
                ConditionStep::Constant(false) => Truth::No,
                ConditionStep::Not => match stack.pop().expect("well formed") {
                    Truth::No => Truth::Yes,
                    Truth::Maybe => Truth::Maybe,
                    Truth::Yes => Truth::No,
                },
                ConditionStep::And | ConditionStep::Or => {
                    let (b, a) = (stack.pop().expect("well formed"), stack.pop().expect("well formed"));
                    if *step == ConditionStep::And { a.min(b) } else { a.max(b) }
                }
            };
            stack.push(truth);
        }
        stack.pop().unwrap_or(Truth::Yes)
    }

    /// The atoms in it, each with its comparison.
    pub fn atoms(&self) -> impl Iterator<Item = (usize, Comparison)> + '_ {
        self.0.iter().filter_map(|step| match *step {
            ConditionStep::Atom(atom, comparison) => Some((atom as usize, comparison)),
            _ => None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kleene_logic_preserves_certain_results() {
        let either = Condition(vec![
            ConditionStep::Atom(0, Comparison::Less),
            ConditionStep::Atom(1, Comparison::Equal),
            ConditionStep::Or,
        ]);
        let judge = |a, b| either.judge(|i| [a, b][i]);
        assert_eq!(judge(Sign::Minus, Sign::Any), Truth::Yes);
        assert_eq!(judge(Sign::Plus, Sign::Any), Truth::Maybe);
        assert_eq!(judge(Sign::Zero, Sign::Undefined), Truth::No);
        assert_eq!(Condition::default().judge(|_| Sign::Any), Truth::Yes);
    }
}
