//! Bounds of expressions in which fields are held: each has the value that it has in the middle of the set.

use super::{Array, Binary, Curve, FIELD_ARGUMENTS, FieldPart, FieldSlot, Interval, Part, Unary, Value};

/// An interval of everything but fields, for sets over which these vary as little as is resolved anyway.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Held(pub Interval);

impl Value for Held {
    fn constant(x: f64) -> Held {
        Held(Interval::constant(x))
    }

    fn unary(op: Unary, a: Held) -> Held {
        Held(Interval::unary(op, a.0))
    }

    fn binary(op: Binary, a: Held, b: Held) -> Held {
        Held(Interval::binary(op, a.0, b.0))
    }

    fn select(condition: Held, a: Held, b: Held) -> Held {
        Held(Interval::select(condition.0, a.0, b.0))
    }

    fn curve(curve: &Curve, part: Part, x: Held) -> Held {
        Held(Interval::curve(curve, part, x.0))
    }

    fn piece(curve: &Curve, part: Part, index: Held, x: Held) -> Held {
        Held(Interval::piece(curve, part, index.0, x.0))
    }

    fn element(array: &Array, index: Held) -> Held {
        Held(Interval::element(array, index.0))
    }

    fn field(field: &FieldSlot, part: FieldPart, at: [Held; FIELD_ARGUMENTS]) -> Held {
        let value = field.value(part, at.map(|of| 0.5 * (of.0.lo + of.0.hi)));
        Held(if value.is_nan() { Interval::EMPTY } else { Interval::constant(value) })
    }
}
