//! Evaluation of a program for many rows at once, in lanes of vector registers.

use super::{Instruction, Program, Register};
use crate::{Binary, Unary, Value};
use dlsys_wide::Kernel;
use std::ops::{Deref, DerefMut};

/// Rows that are evaluated at once by [`Program::eval_lanes`].
pub const LANES: usize = 32;

/// One value of each row. The widest registers of a processor take a whole line of its cache at once, if numbers lie there that way: loads
/// and stores across two lines take twice as long.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(64))]
pub struct Lanes(pub [f64; LANES]);

impl Lanes {
    /// The same number in all rows.
    pub const fn all(x: f64) -> Lanes {
        Lanes([x; LANES])
    }
}

impl Default for Lanes {
    fn default() -> Lanes {
        Lanes::all(0.0)
    }
}

impl Deref for Lanes {
    type Target = [f64; LANES];

    #[inline(always)]
    fn deref(&self) -> &[f64; LANES] {
        &self.0
    }
}

impl DerefMut for Lanes {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [f64; LANES] {
        &mut self.0
    }
}

/// Lanes that fit into the processor's registers together, so that the result may overwrite an operand without a copy.
const PART: usize = 8;

/// One part of some lanes. (What goes through `map` of an array is a call where it is not inlined, and that is not built for wide
/// registers.)
#[inline(always)]
fn part(lanes: &Lanes, i: usize) -> [f64; PART] {
    lanes.as_chunks::<PART>().0[i]
}

/// Applies an operation to the first `PARTS` parts of the lanes.
#[inline(always)]
fn each<const PARTS: usize>(registers: &mut [Lanes], [to, a, b]: [Register; 3], f: impl Fn(f64, f64) -> f64) {
    let (to, a, b) = (to as usize, a as usize, b as usize);
    // Looked at once, not for every part.
    assert!(to < registers.len() && a < registers.len() && b < registers.len());
    for i in 0..PARTS {
        let (mut x, y) = (part(&registers[a], i), part(&registers[b], i));
        for (x, y) in x.iter_mut().zip(y) {
            *x = f(*x, y);
        }
        registers[to].as_chunks_mut::<PART>().0[i] = x;
    }
}

/// The same for an operation on three operands.
#[inline(always)]
fn each_of_three<const PARTS: usize>(
    registers: &mut [Lanes],
    [to, a, b, c]: [Register; 4],
    f: impl Fn(f64, f64, f64) -> f64,
) {
    let (to, a, b, c) = (to as usize, a as usize, b as usize, c as usize);
    let all = registers.len();
    assert!(to < all && a < all && b < all && c < all);
    for i in 0..PARTS {
        let (mut x, y, z) = (part(&registers[a], i), part(&registers[b], i), part(&registers[c], i));
        for ((x, y), z) in x.iter_mut().zip(y).zip(z) {
            *x = f(*x, y, z);
        }
        registers[to].as_chunks_mut::<PART>().0[i] = x;
    }
}

/// The same for operations that take so long that all else counts little.
#[inline(never)]
#[expect(clippy::needless_range_loop, reason = "the rows of three registers, two of which may be one")]
fn each_of(
    registers: &mut [Lanes],
    rows: usize,
    [to, a, b]: [Register; 3],
    f: &mut dyn FnMut(f64, f64) -> f64,
) {
    let [to, a, b] = [to, a, b].map(|register| register as usize);
    for row in 0..rows {
        let value = f(registers[a][row], registers[b][row]);
        registers[to][row] = value;
    }
}

/// All instructions of a program, for some rows.
struct Run<'r> {
    program: &'r Program,
    registers: &'r mut Vec<Lanes>,
    rows: usize,
}

impl Kernel for Run<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        // Where the outputs are is asked afterwards.
        let _ = self.program.eval_rows_inside(self.registers, self.rows);
    }
}

impl Program {
    /// Evaluates all roots for many rows at once: register v of `registers` holds variable v of every row. Every
    /// operation runs over all rows before the next, and gives each the same bits as [`Program::eval`]. Returns the
    /// register of each output.
    pub fn eval_lanes(&self, registers: &mut Vec<Lanes>) -> impl ExactSizeIterator<Item = usize> + '_ {
        self.eval_rows(registers, LANES)
    }

    /// The same for the first `rows` only; the other lanes have no meaning afterwards.
    pub fn eval_rows(
        &self,
        registers: &mut Vec<Lanes>,
        rows: usize,
    ) -> impl ExactSizeIterator<Item = usize> + '_ {
        dlsys_wide::run(Run { program: self, registers, rows });
        self.0.outputs.iter().map(|&register| register as usize)
    }

    /// The same with registers of a given width.
    #[cfg(test)]
    pub fn eval_rows_with(
        &self,
        width: dlsys_wide::Width,
        registers: &mut Vec<Lanes>,
        rows: usize,
    ) -> impl ExactSizeIterator<Item = usize> + '_ {
        dlsys_wide::run_with(width, Run { program: self, registers, rows });
        self.0.outputs.iter().map(|&register| register as usize)
    }

    /// The same inside a [`Kernel`], of which it becomes a part.
    #[inline(always)]
    pub fn eval_rows_inside(
        &self,
        registers: &mut Vec<Lanes>,
        rows: usize,
    ) -> impl ExactSizeIterator<Item = usize> + '_ {
        if registers.len() < self.0.registers {
            registers.resize(self.0.registers, Lanes::default());
        }
        // Loops of a length that is known when this is compiled take two thirds of the instructions.
        match rows.div_ceil(PART) {
            0 | 1 => self.run::<1>(registers, rows),
            2 => self.run::<2>(registers, rows),
            _ => self.run::<{ LANES / PART }>(registers, rows),
        }
        self.0.outputs.iter().map(|&register| register as usize)
    }

    /// Carries out all instructions for so many parts of the lanes, of which `rows` lanes count.
    #[inline(always)]
    fn run<const PARTS: usize>(&self, registers: &mut [Lanes], rows: usize) {
        for instruction in &self.0.code {
            match *instruction {
                Instruction::Const(to, x) => each::<PARTS>(registers, [to, to, to], |_, _| x),
                Instruction::Unary(Unary::Neg, to, a) => each::<PARTS>(registers, [to, a, a], |x, _| -x),
                Instruction::Unary(Unary::Square, to, a) => {
                    each::<PARTS>(registers, [to, a, a], |x, _| x * x)
                }
                Instruction::Binary(Binary::Add, to, a, b) => {
                    each::<PARTS>(registers, [to, a, b], |x, y| x + y)
                }
                Instruction::Binary(Binary::Sub, to, a, b) => {
                    each::<PARTS>(registers, [to, a, b], |x, y| x - y)
                }
                Instruction::Binary(Binary::Mul, to, a, b) => {
                    each::<PARTS>(registers, [to, a, b], |x, y| x * y)
                }
                Instruction::Binary(Binary::Div, to, a, b) => {
                    each::<PARTS>(registers, [to, a, b], |x, y| x / y)
                }
                Instruction::Left(Binary::Add, to, x, b) => {
                    each::<PARTS>(registers, [to, b, b], |y, _| x + y)
                }
                Instruction::Left(Binary::Sub, to, x, b) => {
                    each::<PARTS>(registers, [to, b, b], |y, _| x - y)
                }
                Instruction::Left(Binary::Mul, to, x, b) => {
                    each::<PARTS>(registers, [to, b, b], |y, _| x * y)
                }
                Instruction::Left(Binary::Div, to, x, b) => {
                    each::<PARTS>(registers, [to, b, b], |y, _| x / y)
                }
                Instruction::Right(Binary::Add, to, a, y) => {
                    each::<PARTS>(registers, [to, a, a], |x, _| x + y)
                }
                Instruction::Right(Binary::Sub, to, a, y) => {
                    each::<PARTS>(registers, [to, a, a], |x, _| x - y)
                }
                Instruction::Right(Binary::Mul, to, a, y) => {
                    each::<PARTS>(registers, [to, a, a], |x, _| x * y)
                }
                Instruction::Right(Binary::Div, to, a, y) => {
                    each::<PARTS>(registers, [to, a, a], |x, _| x / y)
                }
                Instruction::Product(Binary::Add, to, a, [b, c]) => {
                    each_of_three::<PARTS>(registers, [to, a, b, c], |x, y, z| x + y * z)
                }
                Instruction::Product(_, to, a, [b, c]) => {
                    each_of_three::<PARTS>(registers, [to, a, b, c], |x, y, z| x - y * z)
                }
                Instruction::Squared(Binary::Add, to, a, b) => {
                    each::<PARTS>(registers, [to, a, b], |x, y| x + y * y)
                }
                Instruction::Squared(_, to, a, b) => each::<PARTS>(registers, [to, a, b], |x, y| x - y * y),
                Instruction::Scaled(Binary::Add, to, a, z, b) => {
                    each::<PARTS>(registers, [to, a, b], |x, y| x + z * y)
                }
                Instruction::Scaled(_, to, a, z, b) => each::<PARTS>(registers, [to, a, b], |x, y| x - z * y),
                _ => self.carry_out(*instruction, registers, rows),
            }
        }
    }

    /// Carries out an instruction that is more than arithmetic, row by row.
    #[inline(never)]
    fn carry_out(&self, instruction: Instruction, registers: &mut [Lanes], rows: usize) {
        match instruction {
            Instruction::Const(to, x) => each_of(registers, rows, [to, to, to], &mut |_, _| x),
            Instruction::Unary(op, to, a) => {
                each_of(registers, rows, [to, a, a], &mut |x, _| f64::unary(op, x))
            }
            Instruction::Binary(op, to, a, b) => {
                each_of(registers, rows, [to, a, b], &mut |x, y| f64::binary(op, x, y));
            }
            Instruction::Left(op, to, x, b) => {
                each_of(registers, rows, [to, b, b], &mut |y, _| f64::binary(op, x, y));
            }
            Instruction::Right(op, to, a, y) => {
                each_of(registers, rows, [to, a, a], &mut |x, _| f64::binary(op, x, y));
            }
            Instruction::Product(..) | Instruction::Squared(..) | Instruction::Scaled(..) => {
                unreachable!("they are arithmetic")
            }
            Instruction::Select(to, c, a, b) => {
                let (c, a, b) = (registers[c as usize], registers[a as usize], registers[b as usize]);
                registers[to as usize] = Lanes(std::array::from_fn(|i| f64::select(c[i], a[i], b[i])));
            }
            Instruction::Curve(curve, part, to, a) => {
                let curve = &self.0.curves[curve as usize];
                each_of(registers, rows, [to, a, a], &mut |x, _| curve.eval(part, x));
            }
            Instruction::Piece(curve, part, to, i, a) => {
                let curve = &self.0.curves[curve as usize];
                each_of(registers, rows, [to, i, a], &mut |i, x| curve.continued(part, i, x));
            }
            Instruction::Element(array, to, i) => {
                let array = &self.0.arrays[array as usize];
                each_of(registers, rows, [to, i, i], &mut |i, _| array.element(i));
            }
            Instruction::Field(field, part, to, at) => {
                let (field, at) = (&self.0.fields[field as usize], at.map(|of| registers[of as usize]));
                let value = |i: usize| field.value(part, [at[0][i], at[1][i], at[2][i], at[3][i]]);
                registers[to as usize] =
                    Lanes(std::array::from_fn(|i| if i < rows { value(i) } else { f64::NAN }));
            }
        }
    }
}
