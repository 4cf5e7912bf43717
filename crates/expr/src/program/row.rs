//! Evaluation of a program for one row, in any number-like type.

use super::{Instruction, Program, Register, Scratch};
use crate::{Binary, Unary, Value};

impl Program {
    /// Evaluates all roots, in the order in which they were compiled.
    ///
    /// `variables` gives the variables from 0 on; `out` takes as many values as there are roots.
    pub fn eval<T: Value>(&self, variables: &[T], scratch: &mut Scratch<T>, out: &mut [T]) {
        debug_assert!(variables.len() >= self.0.variables && out.len() == self.0.outputs.len());
        if let Some(constants) = &self.0.constants {
            for (value, x) in out.iter_mut().zip(constants) {
                *value = T::constant(*x);
            }
            return;
        }
        if self.0.code.is_empty() {
            // Nothing but variables.
            for (value, register) in out.iter_mut().zip(&self.0.outputs) {
                *value = variables[*register as usize];
            }
            return;
        }
        if scratch.len() < self.0.registers {
            scratch.resize(self.0.registers, T::constant(0.0));
        }
        scratch[..self.0.variables].copy_from_slice(&variables[..self.0.variables]);
        self.eval_in(scratch, out);
    }

    /// Evaluates all roots, as [`Program::eval`] does, with the variables in the first registers, which stay there.
    #[inline]
    pub fn eval_in<T: Value>(&self, registers: &mut Scratch<T>, out: &mut [T]) {
        // What a module that is integrated alone does dozens of times a step.
        match (&self.0.plain, T::numbers(registers)) {
            (Some(plain), Some(numbers)) => plain.run(self, numbers),
            _ => self.run_long(registers),
        }
        match (&self.0.outputs[..], out) {
            ([register], [value]) => *value = registers[*register as usize],
            (outputs, out) => {
                for (value, register) in out.iter_mut().zip(outputs) {
                    *value = registers[*register as usize];
                }
            }
        }
    }

    /// Carries out all instructions; makes room for the registers, at the first time for those that the short forms take.
    #[inline(never)]
    fn run_long<T: Value>(&self, registers: &mut Scratch<T>) {
        // What earlier evaluations have left in the other registers is overwritten before it is read.
        let places =
            if self.0.plain.is_some() { self.0.registers.max(T::REGISTERS) } else { self.0.registers };
        if registers.len() < places {
            registers.resize(places, T::constant(0.0));
        }
        let registers = &mut registers[..self.0.registers];
        for &instruction in &self.0.code {
            let (to, value) = self.value(instruction, registers);
            registers[to as usize] = value;
        }
    }

    /// The destination of an instruction, and the value that it gives it.
    #[inline(always)]
    pub(super) fn value<T: Value>(&self, instruction: Instruction, registers: &[T]) -> (Register, T) {
        match instruction {
            Instruction::Const(to, x) => (to, T::constant(x)),
            Instruction::Unary(op, to, a) => (to, T::unary(op, registers[a as usize])),
            Instruction::Binary(op, to, a, b) => {
                (to, T::binary(op, registers[a as usize], registers[b as usize]))
            }
            Instruction::Left(op, to, x, b) => (to, T::binary(op, T::constant(x), registers[b as usize])),
            Instruction::Right(op, to, a, x) => (to, T::binary(op, registers[a as usize], T::constant(x))),
            Instruction::Product(op, to, a, [b, c]) => {
                let product = T::binary(Binary::Mul, registers[b as usize], registers[c as usize]);
                (to, T::binary(op, registers[a as usize], product))
            }
            Instruction::Squared(op, to, a, b) => {
                (to, T::binary(op, registers[a as usize], T::unary(Unary::Square, registers[b as usize])))
            }
            Instruction::Scaled(op, to, a, x, b) => {
                let product = T::binary(Binary::Mul, T::constant(x), registers[b as usize]);
                (to, T::binary(op, registers[a as usize], product))
            }
            Instruction::Select(to, c, a, b) => {
                (to, T::select(registers[c as usize], registers[a as usize], registers[b as usize]))
            }
            Instruction::Curve(curve, part, to, a) => {
                (to, T::curve(&self.0.curves[curve as usize], part, registers[a as usize]))
            }
            Instruction::Piece(curve, part, to, i, a) => {
                let (i, a) = (registers[i as usize], registers[a as usize]);
                (to, T::piece(&self.0.curves[curve as usize], part, i, a))
            }
            Instruction::Element(array, to, i) => {
                (to, T::element(&self.0.arrays[array as usize], registers[i as usize]))
            }
            Instruction::Field(field, part, to, at) => {
                (to, T::field(&self.0.fields[field as usize], part, at.map(|of| registers[of as usize])))
            }
        }
    }

    /// Evaluates a program of one root; convenient where speed does not matter.
    pub fn eval_one(&self, variables: &[f64]) -> f64 {
        let mut out = [f64::NAN];
        self.eval(variables, &mut Vec::new(), &mut out);
        out[0]
    }
}
