//! Comparisons of two numbers, judged by the sign of their difference.

use crate::Sign;

/// A relation between two numbers, `a ? b`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Comparison {
    /// `a < b`
    Less,
    /// `a <= b`
    LessOrEqual,
    /// `a = b`
    Equal,
    /// `a != b`; it holds where a side is NaN.
    NotEqual,
    /// `a >= b`
    GreaterOrEqual,
    /// `a > b`
    Greater,
}

impl Comparison {
    /// The sign of the language for it.
    pub fn symbol(self) -> &'static str {
        match self {
            Comparison::Less => "<",
            Comparison::LessOrEqual => "<=",
            Comparison::Equal => "=",
            Comparison::NotEqual => "!=",
            Comparison::GreaterOrEqual => ">=",
            Comparison::Greater => ">",
        }
    }

    /// The comparison with its sides exchanged.
    pub fn mirrored(self) -> Comparison {
        match self {
            Comparison::Less => Comparison::Greater,
            Comparison::LessOrEqual => Comparison::GreaterOrEqual,
            Comparison::GreaterOrEqual => Comparison::LessOrEqual,
            Comparison::Greater => Comparison::Less,
            same => same,
        }
    }

    /// The comparison that holds where this one does not.
    pub fn negated(self) -> Comparison {
        match self {
            Comparison::Less => Comparison::GreaterOrEqual,
            Comparison::LessOrEqual => Comparison::Greater,
            Comparison::Equal => Comparison::NotEqual,
            Comparison::NotEqual => Comparison::Equal,
            Comparison::GreaterOrEqual => Comparison::Less,
            Comparison::Greater => Comparison::LessOrEqual,
        }
    }

    /// Whether it holds for a difference `a - b` of this sign.
    pub fn judge(self, sign: Sign) -> Truth {
        use Comparison::*;
        let holds = match sign {
            Sign::Any => return Truth::Maybe,
            Sign::Undefined => self == NotEqual,
            Sign::Minus => matches!(self, Less | LessOrEqual | NotEqual),
            Sign::Zero => matches!(self, LessOrEqual | Equal | GreaterOrEqual),
            Sign::Plus => matches!(self, GreaterOrEqual | Greater | NotEqual),
        };
        if holds { Truth::Yes } else { Truth::No }
    }
}

/// A value of Kleene's three-valued logic, in the order in which `and` takes the least and `or` the greatest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Truth {
    /// It does not hold.
    No,
    /// Not known: a sign is [`Sign::Any`].
    Maybe,
    /// It holds.
    Yes,
}
