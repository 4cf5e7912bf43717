//! The operations of an expression, and what a type must offer to be computed with.
//!
//! Truth values are numbers: 1 is true, 0 is false. A comparison with NaN is false, as in IEEE 754.

use super::{Array, Curve, Part};

/// Functions and operators of one operand.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Unary {
    Neg,
    /// What a product of something with itself is compiled to: bounds of it are narrower than those of a product.
    Square,
    /// Logical negation of a truth value.
    Not,
    Sqrt,
    Exp,
    Ln,
    Log10,
    Abs,
    /// -1, 0 or 1; NaN stays NaN.
    Sign,
    Floor,
    Ceil,
    Sin,
    Cos,
    Tan,
    Asin,
    Acos,
    Atan,
    Sinh,
    Cosh,
    Tanh,
}

/// Functions and operators of two operands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Binary {
    Add,
    Sub,
    Mul,
    Div,
    Pow,
    Min,
    Max,
    Atan2,
    Lt,
    Le,
    Eq,
    Ne,
    And,
    Or,
}

impl Unary {
    /// The functions that a model can call by name.
    pub const NAMED: [(&'static str, Unary); 17] = [
        ("sqrt", Unary::Sqrt),
        ("exp", Unary::Exp),
        ("ln", Unary::Ln),
        ("log10", Unary::Log10),
        ("abs", Unary::Abs),
        ("sign", Unary::Sign),
        ("floor", Unary::Floor),
        ("ceil", Unary::Ceil),
        ("sin", Unary::Sin),
        ("cos", Unary::Cos),
        ("tan", Unary::Tan),
        ("asin", Unary::Asin),
        ("acos", Unary::Acos),
        ("atan", Unary::Atan),
        ("sinh", Unary::Sinh),
        ("cosh", Unary::Cosh),
        ("tanh", Unary::Tanh),
    ];
}

impl Binary {
    /// The functions of two arguments that a model can call by name.
    pub const NAMED: [(&'static str, Binary); 3] =
        [("min", Binary::Min), ("max", Binary::Max), ("atan2", Binary::Atan2)];
}

/// A number-like type that a [`Program`](super::Program) can be evaluated in.
pub trait Value: Copy {
    fn constant(x: f64) -> Self;
    fn unary(op: Unary, a: Self) -> Self;
    fn binary(op: Binary, a: Self, b: Self) -> Self;
    /// `a` where `condition` is true, else `b`.
    fn select(condition: Self, a: Self, b: Self) -> Self;
    /// A part of a curve.
    fn curve(curve: &Curve, part: Part, x: Self) -> Self;
    /// The same of one piece, continued beyond its knots; see [`Curve::continued`].
    fn piece(curve: &Curve, part: Part, index: Self, x: Self) -> Self;
    /// An element of an array.
    fn element(array: &Array, index: Self) -> Self;
}

fn truth(b: bool) -> f64 {
    f64::from(u8::from(b))
}

impl Value for f64 {
    #[inline]
    fn constant(x: f64) -> f64 {
        x
    }

    #[inline]
    fn unary(op: Unary, a: f64) -> f64 {
        match op {
            Unary::Neg => -a,
            Unary::Square => a * a,
            Unary::Not => 1.0 - a,
            Unary::Sqrt => a.sqrt(),
            Unary::Exp => a.exp(),
            Unary::Ln => a.ln(),
            Unary::Log10 => a.log10(),
            Unary::Abs => a.abs(),
            Unary::Sign => {
                if a > 0.0 {
                    1.0
                } else if a < 0.0 {
                    -1.0
                } else {
                    a
                }
            }
            Unary::Floor => a.floor(),
            Unary::Ceil => a.ceil(),
            Unary::Sin => a.sin(),
            Unary::Cos => a.cos(),
            Unary::Tan => a.tan(),
            Unary::Asin => a.asin(),
            Unary::Acos => a.acos(),
            Unary::Atan => a.atan(),
            Unary::Sinh => a.sinh(),
            Unary::Cosh => a.cosh(),
            Unary::Tanh => a.tanh(),
        }
    }

    #[inline]
    fn binary(op: Binary, a: f64, b: f64) -> f64 {
        match op {
            Binary::Add => a + b,
            Binary::Sub => a - b,
            Binary::Mul => a * b,
            Binary::Div => a / b,
            Binary::Pow => a.powf(b),
            // Unlike `f64::min`, NaN on either side is NaN: an undefined operand is never hidden.
            Binary::Min => {
                if a.is_nan() || a < b {
                    a
                } else {
                    b
                }
            }
            Binary::Max => {
                if a.is_nan() || a > b {
                    a
                } else {
                    b
                }
            }
            Binary::Atan2 => a.atan2(b),
            Binary::Lt => truth(a < b),
            Binary::Le => truth(a <= b),
            Binary::Eq => truth(a == b),
            Binary::Ne => truth(a != b),
            Binary::And => a * b,
            Binary::Or => a.max(b),
        }
    }

    #[inline]
    fn select(condition: f64, a: f64, b: f64) -> f64 {
        if condition != 0.0 { a } else { b }
    }

    fn curve(curve: &Curve, part: Part, x: f64) -> f64 {
        curve.eval(part, x)
    }

    fn piece(curve: &Curve, part: Part, index: f64, x: f64) -> f64 {
        curve.continued(part, index, x)
    }

    fn element(array: &Array, index: f64) -> f64 {
        array.element(index)
    }
}
