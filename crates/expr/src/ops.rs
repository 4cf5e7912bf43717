//! The operations of expressions, and the trait of types in which they are evaluated. To add a function of models, begin here.
//!
//! Truth values are numbers: 1 is true, 0 is false. A comparison with NaN is false, as in IEEE 754.

use super::{Array, Curve, FIELD_ARGUMENTS, FieldPart, FieldSlot, Part};

/// Functions and operators of one operand.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Unary {
    /// -a
    Neg,
    /// The product of an expression with itself: its bounds are narrower than those of a product.
    Square,
    /// Logical negation of a truth value.
    Not,
    /// Square root; NaN below 0.
    Sqrt,
    /// e to the power a.
    Exp,
    /// Natural logarithm; -∞ at 0, NaN below.
    Ln,
    /// Logarithm to base 10; -∞ at 0, NaN below.
    Log10,
    /// e to the power a, minus 1: with all digits where a is small.
    Expm1,
    /// Natural logarithm of 1 + a, with all digits where a is small; -∞ at -1, NaN below.
    Ln1p,
    /// Absolute value.
    Abs,
    /// -1, 0 or 1; NaN stays NaN.
    Sign,
    /// Greatest whole number that is not above a.
    Floor,
    /// Least whole number that is not below a.
    Ceil,
    /// Sine of an angle in radians.
    Sin,
    /// Cosine of an angle in radians.
    Cos,
    /// Sine of π times a: exactly 0 at whole numbers.
    SinPi,
    /// Cosine of π times a: exactly 0 half way between whole numbers.
    CosPi,
    /// Tangent of an angle in radians.
    Tan,
    /// Arcus sine in radians, from -π/2 to π/2; NaN beyond ±1.
    Asin,
    /// Arcus cosine in radians, from 0 to π; NaN beyond ±1.
    Acos,
    /// Arcus tangent in radians, from -π/2 to π/2.
    Atan,
    /// Hyperbolic sine.
    Sinh,
    /// Hyperbolic cosine.
    Cosh,
    /// Hyperbolic tangent.
    Tanh,
}

/// Functions and operators of two operands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Binary {
    /// a + b.
    Add,
    /// a - b.
    Sub,
    /// a times b.
    Mul,
    /// a divided by b, as IEEE 754 has it: ±∞ or NaN for b = 0.
    Div,
    /// a to the power b; NaN for a negative a and a b that is not whole.
    Pow,
    /// The lesser; NaN if one is NaN.
    Min,
    /// The greater; NaN if one is NaN.
    Max,
    /// The angle of the point (b, a) in radians, from -π to π.
    Atan2,
    /// a < b.
    Lt,
    /// a ≤ b.
    Le,
    /// a = b.
    Eq,
    /// a ≠ b; true with NaN.
    Ne,
    /// Both are true.
    And,
    /// One is true, or both.
    Or,
}

impl Unary {
    /// True for functions that end at an edge, beyond which they are not defined.
    pub fn is_partial(self) -> bool {
        use Unary::{Acos, Asin, Ln, Ln1p, Log10, Sqrt};
        matches!(self, Sqrt | Ln | Log10 | Ln1p | Asin | Acos)
    }

    /// The functions that a model can call by name.
    pub const NAMED: [(&'static str, Unary); 19] = [
        ("sqrt", Unary::Sqrt),
        ("exp", Unary::Exp),
        ("ln", Unary::Ln),
        ("log10", Unary::Log10),
        ("expm1", Unary::Expm1),
        ("ln1p", Unary::Ln1p),
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

/// Registers that a byte can name.
pub(crate) const REGISTERS: usize = 1 << u8::BITS;

/// A number-like type that a [`Program`](super::Program) can be evaluated in.
pub trait Value: Copy {
    /// A number, as a value of the type.
    fn constant(x: f64) -> Self;
    /// A function or operator of one operand.
    fn unary(op: Unary, a: Self) -> Self;
    /// A function or operator of two operands.
    fn binary(op: Binary, a: Self, b: Self) -> Self;
    /// `a` where `condition` is true, else `b`.
    fn select(condition: Self, a: Self, b: Self) -> Self;
    /// A part of a curve.
    fn curve(curve: &Curve, part: Part, x: Self) -> Self;
    /// The same of one piece, continued beyond its knots; see [`Curve::continued`].
    fn piece(curve: &Curve, part: Part, index: Self, x: Self) -> Self;
    /// An element of an array.
    fn element(array: &Array, index: Self) -> Self;
    /// A part of a field at a time and a place.
    fn field(field: &FieldSlot, part: FieldPart, at: [Self; FIELD_ARGUMENTS]) -> Self;

    /// The registers that the type's own interpreter takes; 0 if it has none.
    const REGISTERS: usize = 0;

    /// So many registers as plain numbers, if they are: these have an interpreter of their own.
    #[inline(always)]
    fn numbers(_registers: &mut [Self]) -> Option<&mut [f64; REGISTERS]> {
        None
    }
}

/// A number less the nearest even one, exactly.
pub(crate) fn in_period(a: f64) -> f64 {
    a - 2.0 * (0.5 * a).round()
}

/// The sine of π r, for r from -1 to 1.
fn sin_of_half_turns(r: f64) -> f64 {
    let quarter = if r.abs() > 0.5 { 1.0 - r.abs() } else { r.abs() };
    (std::f64::consts::PI * quarter).sin().copysign(r)
}

fn truth(b: bool) -> f64 {
    f64::from(u8::from(b))
}

impl Value for f64 {
    #[inline]
    fn constant(x: f64) -> f64 {
        x
    }

    const REGISTERS: usize = REGISTERS;

    #[inline(always)]
    fn numbers(registers: &mut [f64]) -> Option<&mut [f64; REGISTERS]> {
        registers.first_chunk_mut()
    }

    // Interpreters call it in one place each.
    #[inline(always)]
    fn unary(op: Unary, a: f64) -> f64 {
        match op {
            Unary::Neg => -a,
            Unary::Square => a * a,
            Unary::Not => 1.0 - a,
            Unary::Sqrt => a.sqrt(),
            Unary::Exp => a.exp(),
            Unary::Ln => a.ln(),
            Unary::Log10 => a.log10(),
            Unary::Expm1 => a.exp_m1(),
            Unary::Ln1p => a.ln_1p(),
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
            Unary::SinPi => sin_of_half_turns(in_period(a)),
            Unary::CosPi => sin_of_half_turns(0.5 - in_period(a).abs()),
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

    fn field(field: &FieldSlot, part: FieldPart, at: [f64; FIELD_ARGUMENTS]) -> f64 {
        field.value(part, at)
    }
}
