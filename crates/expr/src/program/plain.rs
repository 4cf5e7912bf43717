//! Evaluation of a program in plain numbers, for one row.
//!
//! A module that is integrated alone evaluates a small formula a dozen times a step, one row at a time, and there the interpreter is most of the
//! work. So instructions have a second form, in which the operation is one number, not a kind of instruction with an operator inside, and a
//! register is one byte: among 256 registers every byte is one, so nothing has to be asked. What is rare stays as it is.

use super::{Instruction, Program, Register};
use crate::ops::REGISTERS;
use crate::{Binary, Unary, Value};

/// What an instruction does with its registers `a`, `b` and `c`, and its number `x`.
#[derive(Clone, Copy, Debug, Default)]
enum Operation {
    Constant,
    Add,
    Subtract,
    Multiply,
    Divide,
    /// With the number as one operand: on the right, or on the left.
    AddNumber,
    SubtractNumber,
    SubtractFrom,
    MultiplyNumber,
    DivideByNumber,
    DivideInto,
    AddProduct,
    SubtractProduct,
    AddSquare,
    SubtractSquare,
    AddMultiple,
    SubtractMultiple,
    Negate,
    Square,
    Root,
    Exponential,
    Sine,
    Cosine,
    Select,
    /// As the instruction in its long form says.
    #[default]
    Other,
}

/// An instruction in its short form: 16 bytes.
#[derive(Clone, Copy, Debug, Default)]
struct Short {
    operation: Operation,
    to: u8,
    a: u8,
    b: u8,
    c: u8,
    x: f64,
}

impl Short {
    fn new(instruction: Instruction) -> Short {
        let (operation, operands, x) = match instruction {
            Instruction::Const(_, x) => (Operation::Constant, [0; 3], x),
            Instruction::Unary(op, _, a) => (unary(op), [a, 0, 0], 0.0),
            Instruction::Binary(op, _, a, b) => {
                let operation = match op {
                    Binary::Add => Operation::Add,
                    Binary::Sub => Operation::Subtract,
                    Binary::Mul => Operation::Multiply,
                    Binary::Div => Operation::Divide,
                    _ => Operation::Other,
                };
                (operation, [a, b, 0], 0.0)
            }
            Instruction::Left(op, _, x, a) => {
                let operation = match op {
                    Binary::Add => Operation::AddNumber,
                    Binary::Sub => Operation::SubtractFrom,
                    Binary::Mul => Operation::MultiplyNumber,
                    Binary::Div => Operation::DivideInto,
                    _ => Operation::Other,
                };
                (operation, [a, 0, 0], x)
            }
            Instruction::Right(op, _, a, x) => {
                let operation = match op {
                    Binary::Add => Operation::AddNumber,
                    Binary::Sub => Operation::SubtractNumber,
                    Binary::Mul => Operation::MultiplyNumber,
                    Binary::Div => Operation::DivideByNumber,
                    _ => Operation::Other,
                };
                (operation, [a, 0, 0], x)
            }
            Instruction::Product(op, _, a, [b, c]) => {
                (either(op, Operation::AddProduct, Operation::SubtractProduct), [a, b, c], 0.0)
            }
            Instruction::Squared(op, _, a, b) => {
                (either(op, Operation::AddSquare, Operation::SubtractSquare), [a, b, 0], 0.0)
            }
            Instruction::Scaled(op, _, a, x, b) => {
                (either(op, Operation::AddMultiple, Operation::SubtractMultiple), [a, b, 0], x)
            }
            Instruction::Select(_, c, a, b) => (Operation::Select, [a, b, c], 0.0),
            Instruction::Curve(..)
            | Instruction::Piece(..)
            | Instruction::Element(..)
            | Instruction::Field(..) => (Operation::Other, [0; 3], 0.0),
        };
        let [to, a, b, c] =
            [instruction.destination(), operands[0], operands[1], operands[2]].map(|r: Register| r as u8);
        Short { operation, to, a, b, c, x }
    }
}

fn unary(op: Unary) -> Operation {
    match op {
        Unary::Neg => Operation::Negate,
        Unary::Square => Operation::Square,
        Unary::Sqrt => Operation::Root,
        Unary::Exp => Operation::Exponential,
        Unary::Sin => Operation::Sine,
        Unary::Cos => Operation::Cosine,
        _ => Operation::Other,
    }
}

/// That of a sum or that of a difference.
fn either(op: Binary, sum: Operation, difference: Operation) -> Operation {
    match op {
        Binary::Add => sum,
        Binary::Sub => difference,
        _ => Operation::Other,
    }
}

/// The instructions of a program in their short form.
#[derive(Clone, Debug, Default)]
pub(super) struct Plain {
    code: Vec<Short>,
}

impl Plain {
    /// Those of a program with so many registers; none where these are too many.
    pub fn new(code: &[Instruction], registers: usize) -> Option<Plain> {
        (registers <= REGISTERS).then(|| Plain { code: code.iter().copied().map(Short::new).collect() })
    }

    /// Carries out all instructions of a program: the same numbers as in their long form.
    pub fn run(&self, program: &Program, registers: &mut [f64; REGISTERS]) {
        for (place, short) in self.code.iter().enumerate() {
            let (r, x) = (&*registers, short.x);
            let (a, b, c) = (usize::from(short.a), usize::from(short.b), usize::from(short.c));
            let value = match short.operation {
                Operation::Constant => x,
                Operation::Add => r[a] + r[b],
                Operation::Subtract => r[a] - r[b],
                Operation::Multiply => r[a] * r[b],
                Operation::Divide => r[a] / r[b],
                Operation::AddNumber => r[a] + x,
                Operation::SubtractNumber => r[a] - x,
                Operation::SubtractFrom => x - r[a],
                Operation::MultiplyNumber => r[a] * x,
                Operation::DivideByNumber => r[a] / x,
                Operation::DivideInto => x / r[a],
                Operation::AddProduct => r[a] + r[b] * r[c],
                Operation::SubtractProduct => r[a] - r[b] * r[c],
                Operation::AddSquare => r[a] + r[b] * r[b],
                Operation::SubtractSquare => r[a] - r[b] * r[b],
                Operation::AddMultiple => r[a] + x * r[b],
                Operation::SubtractMultiple => r[a] - x * r[b],
                Operation::Negate => -r[a],
                Operation::Square => r[a] * r[a],
                Operation::Root => r[a].sqrt(),
                Operation::Exponential => r[a].exp(),
                Operation::Sine => r[a].sin(),
                Operation::Cosine => r[a].cos(),
                Operation::Select => f64::select(r[c], r[a], r[b]),
                Operation::Other => other(program, place, r),
            };
            registers[usize::from(short.to)] = value;
        }
    }
}

/// The value of an instruction in its long form. It stays out of the loop above, which would set out with all that this may take.
#[inline(never)]
fn other(program: &Program, place: usize, registers: &[f64; REGISTERS]) -> f64 {
    program.value(program.0.code[place], &registers[..]).1
}
