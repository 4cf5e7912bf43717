//! Reductions of many values to one.

use crate::{Binary, Value};

/// How the values of many modules are combined into one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Fold {
    /// Their sum.
    Sum,
    /// How many there are; the values are 1.
    Count,
    /// The largest of them.
    Largest,
    /// The smallest of them.
    Smallest,
}

impl Fold {
    /// The word of the language for it.
    pub fn name(self) -> &'static str {
        match self {
            Fold::Sum => "sum",
            Fold::Count => "count",
            Fold::Largest => "largest",
            Fold::Smallest => "smallest",
        }
    }

    /// The result for the values so far, `all`, and one more.
    pub fn add<T: Value>(self, all: Option<T>, one: T) -> T {
        match (all, self) {
            (None, _) => one,
            (Some(all), Fold::Sum | Fold::Count) => T::binary(Binary::Add, all, one),
            (Some(all), Fold::Largest) => T::binary(Binary::Max, all, one),
            (Some(all), Fold::Smallest) => T::binary(Binary::Min, all, one),
        }
    }
}
