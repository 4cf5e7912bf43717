//! Compilation of expressions to straight-line code with registers, which is evaluated for one row (`row.rs`) or many (`lanes.rs`).

mod lanes;
mod plain;
mod row;

pub use lanes::{LANES, Lanes};

use std::collections::{BTreeSet, HashMap};
use std::sync::Arc;

use plain::Plain;

use super::{
    Array, Binary, Curve, FIELD_ARGUMENTS, FieldPart, FieldSlot, Graph, Lookup, Node, NodeId, NodeMap, Part,
    Unary,
};

/// A register: variables come first, then temporaries.
type Register = u32;

/// One instruction. The destination may be one of the operands' registers.
#[derive(Clone, Copy, Debug)]
enum Instruction {
    Const(Register, f64),
    Unary(Unary, Register, Register),
    Binary(Binary, Register, Register, Register),
    /// With a constant on the left, or on the right.
    Left(Binary, Register, f64, Register),
    Right(Binary, Register, Register, f64),
    /// A sum or difference whose second operand is a product of registers, a square, or a multiple. Rounded twice, as two
    /// instructions would.
    Product(Binary, Register, Register, [Register; 2]),
    Squared(Binary, Register, Register, Register),
    Scaled(Binary, Register, Register, f64, Register),
    Select(Register, Register, Register, Register),
    /// The first number says which of the program's curves, or arrays.
    Curve(u32, Part, Register, Register),
    Piece(u32, Part, Register, Register, Register),
    Element(u32, Register, Register),
    Field(u32, FieldPart, Register, [Register; FIELD_ARGUMENTS]),
}

impl Instruction {
    fn destination(self) -> Register {
        match self {
            Instruction::Const(to, _)
            | Instruction::Unary(_, to, _)
            | Instruction::Binary(_, to, ..)
            | Instruction::Left(_, to, ..)
            | Instruction::Right(_, to, ..)
            | Instruction::Product(_, to, ..)
            | Instruction::Squared(_, to, ..)
            | Instruction::Scaled(_, to, ..)
            | Instruction::Select(to, ..)
            | Instruction::Curve(_, _, to, _)
            | Instruction::Piece(_, _, to, ..)
            | Instruction::Element(_, to, _)
            | Instruction::Field(_, _, to, _) => to,
        }
    }

    fn operands(self) -> [Option<Register>; 4] {
        match self {
            Instruction::Const(..) => [None; 4],
            Instruction::Unary(_, _, a)
            | Instruction::Left(.., a)
            | Instruction::Right(_, _, a, _)
            | Instruction::Curve(.., a)
            | Instruction::Element(.., a) => [Some(a), None, None, None],
            Instruction::Binary(_, _, a, b)
            | Instruction::Squared(_, _, a, b)
            | Instruction::Scaled(_, _, a, _, b)
            | Instruction::Piece(.., a, b) => [Some(a), Some(b), None, None],
            Instruction::Product(_, _, a, [b, c]) => [Some(a), Some(b), Some(c), None],
            Instruction::Select(_, c, a, b) => [Some(c), Some(a), Some(b), None],
            Instruction::Field(.., at) => at.map(Some),
        }
    }
}

/// A sum or difference right after the product that is its second operand, as one instruction; `None` if these are not. The
/// product is not kept.
fn joined(product: Instruction, sum: Instruction) -> Option<Instruction> {
    let Instruction::Binary(op @ (Binary::Add | Binary::Sub), to, a, b) = sum else { return None };
    let made = product.destination();
    if b != made || a == made {
        return None;
    }
    match product {
        Instruction::Unary(Unary::Square, _, x) => Some(Instruction::Squared(op, to, a, x)),
        Instruction::Binary(Binary::Mul, _, x, y) => Some(Instruction::Product(op, to, a, [x, y])),
        Instruction::Left(Binary::Mul, _, x, y) => Some(Instruction::Scaled(op, to, a, x, y)),
        _ => None,
    }
}

/// Registers of an evaluation, kept from one to the next so that nothing is allocated.
pub type Scratch<T> = Vec<T>;

/// Code that computes a few expressions of one [`Graph`] from its variables. Copies share it.
#[derive(Clone, Debug, Default)]
pub struct Program(Arc<Code>);

#[derive(Debug, Default)]
struct Code {
    code: Vec<Instruction>,
    outputs: Vec<Register>,
    variables: usize,
    registers: usize,
    /// The variables that it reads, ascending.
    reads: Vec<usize>,
    /// The outputs, if they depend on nothing.
    constants: Option<Vec<f64>>,
    curves: Vec<Arc<Curve>>,
    arrays: Vec<Arc<Array>>,
    fields: Vec<FieldSlot>,
    /// The code for plain numbers.
    plain: Option<Plain>,
}

/// The curves, arrays or fields that a program reads, each once.
struct Table<T> {
    all: Vec<T>,
    numbers: HashMap<Lookup, u32>,
}

impl<T> Default for Table<T> {
    fn default() -> Table<T> {
        Table { all: Vec::new(), numbers: HashMap::new() }
    }
}

impl<T: Clone> Table<T> {
    /// The number of an item, which is added if it is new.
    fn number(&mut self, lookup: Lookup, item: &T) -> u32 {
        *self.numbers.entry(lookup).or_insert_with(|| {
            self.all.push(item.clone());
            self.all.len() as u32 - 1
        })
    }
}

/// The number that a node is.
fn constant(graph: &Graph, id: NodeId) -> f64 {
    match graph.node(id) {
        Node::Const(bits) => f64::from_bits(bits),
        _ => unreachable!("only constants stand in instructions"),
    }
}

/// The operands of a node that are read from registers: a constant operand stands in the instruction.
fn in_registers(graph: &Graph, id: NodeId) -> [Option<NodeId>; 4] {
    let node = graph.node(id);
    let is_constant = |id: NodeId| matches!(graph.node(id), Node::Const(_));
    match node {
        Node::Binary(_, a, b) if is_constant(a) && !is_constant(b) => [None, Some(b), None, None],
        Node::Binary(_, a, b) if is_constant(b) && !is_constant(a) => [Some(a), None, None, None],
        _ => node.operands(),
    }
}

/// How often each expression is an operand in a register. An output has one use that never ends, so that its register is not given
/// away.
fn uses(graph: &Graph, order: &[NodeId], roots: &[NodeId]) -> NodeMap<usize> {
    let mut uses: NodeMap<usize> = NodeMap::default();
    for &id in order {
        for operand in in_registers(graph, id).into_iter().flatten() {
            *uses.entry(operand).or_default() += 1;
        }
    }
    for root in roots {
        *uses.entry(*root).or_default() += 1;
    }
    uses
}

/// The state of a compilation.
struct Compiler<'g> {
    graph: &'g Graph,
    /// Uses of each expression that are still to come.
    uses: NodeMap<usize>,
    /// Where values are.
    place: NodeMap<Register>,
    /// Registers whose values are no longer used.
    free: Vec<Register>,
    /// Number of registers so far.
    registers: Register,
    curves: Table<Arc<Curve>>,
    arrays: Table<Arc<Array>>,
    fields: Table<FieldSlot>,
}

impl Compiler<'_> {
    /// True if nothing uses an operand after the expression that has just been compiled.
    fn is_last_use(&self, operand: Option<NodeId>) -> bool {
        operand.is_some_and(|operand| self.uses.get(&operand) == Some(&0))
    }

    /// The instruction for an expression whose operands have been compiled.
    fn instruction(&mut self, id: NodeId) -> Instruction {
        let graph = self.graph;
        let operands = in_registers(graph, id);
        for operand in operands.into_iter().flatten() {
            let left = self.uses.get_mut(&operand).expect("counted before");
            *left -= 1;
            if *left == 0 && !matches!(graph.node(operand), Node::Var(_)) {
                self.free.push(self.place[&operand]);
            }
        }
        let to = self.free.pop().unwrap_or_else(|| {
            self.registers += 1;
            self.registers - 1
        });
        let operands = operands.map(|o| o.map(|o| self.place[&o]));
        self.place.insert(id, to);
        match (graph.node(id), operands) {
            (Node::Const(bits), _) => Instruction::Const(to, f64::from_bits(bits)),
            (Node::Unary(op, _), [Some(a), ..]) => Instruction::Unary(op, to, a),
            (Node::Binary(Binary::Mul, ..), [Some(a), Some(b), ..]) if a == b => {
                Instruction::Unary(Unary::Square, to, a)
            }
            (Node::Binary(op, ..), [Some(a), Some(b), ..]) => Instruction::Binary(op, to, a, b),
            (Node::Binary(op, x, _), [None, Some(b), ..]) => Instruction::Left(op, to, constant(graph, x), b),
            (Node::Binary(op, _, x), [Some(a), None, ..]) => {
                Instruction::Right(op, to, a, constant(graph, x))
            }
            (Node::Select(..), [Some(c), Some(a), Some(b), _]) => Instruction::Select(to, c, a, b),
            (Node::Curve(curve, part, _), [Some(a), ..]) => {
                Instruction::Curve(self.curves.number(curve, graph.curve_of(curve)), part, to, a)
            }
            (Node::Piece(curve, part, ..), [Some(i), Some(a), ..]) => {
                Instruction::Piece(self.curves.number(curve, graph.curve_of(curve)), part, to, i, a)
            }
            (Node::Element(array, _), [Some(i), ..]) => {
                Instruction::Element(self.arrays.number(array, graph.array_of(array)), to, i)
            }
            (Node::Field(field, part, _), [Some(t), Some(x), Some(y), Some(z)]) => {
                let number = self.fields.number(field, graph.field_of(field));
                Instruction::Field(number, part, to, [t, x, y, z])
            }
            _ => unreachable!("a node has the operands of its kind"),
        }
    }
}

impl Program {
    /// Compiles `roots`, which may read the variables `0..variables`.
    ///
    /// # Panics
    /// If a root reads a variable beyond that range: a mistake of the caller, not of a model.
    pub fn compile(graph: &Graph, roots: &[NodeId], variables: usize) -> Program {
        let order = graph.reachable(roots);
        let mut compiler = Compiler {
            graph,
            uses: uses(graph, &order, roots),
            place: NodeMap::default(),
            free: Vec::new(),
            registers: variables as Register,
            curves: Table::default(),
            arrays: Table::default(),
            fields: Table::default(),
        };
        let mut code: Vec<Instruction> = Vec::new();
        for id in order {
            match graph.node(id) {
                Node::Var(v) => {
                    assert!((v as usize) < variables, "variable {v} of {variables}");
                    compiler.place.insert(id, v);
                }
                // A constant that stands in the instructions of its users.
                Node::Const(_) if !compiler.uses.contains_key(&id) => {}
                node => {
                    let instruction = compiler.instruction(id);
                    let last = code.last().copied().filter(|_| compiler.is_last_use(node.operands()[1]));
                    match last.and_then(|last| joined(last, instruction)) {
                        Some(both) => *code.last_mut().expect("seen above") = both,
                        None => code.push(instruction),
                    }
                }
            }
        }
        let constants = roots.iter().map(|root| graph.as_constant(*root)).collect();
        let outputs: Vec<Register> = roots.iter().map(|r| compiler.place[r]).collect();
        let operands = code.iter().flat_map(|instruction: &Instruction| instruction.operands()).flatten();
        let mut reads: Vec<usize> = (operands.chain(outputs.iter().copied()))
            .map(|register| register as usize)
            .filter(|register| *register < variables)
            .collect();
        reads.sort_unstable();
        reads.dedup();
        let Compiler { curves, arrays, fields, registers, .. } = compiler;
        let (curves, arrays, fields, registers) = (curves.all, arrays.all, fields.all, registers as usize);
        let plain = Plain::new(&code, registers);
        let parts =
            Code { constants, curves, arrays, fields, plain, code, outputs, variables, registers, reads };
        Program(Arc::new(parts))
    }

    /// The number of variables that the roots may read.
    pub fn variables(&self) -> usize {
        self.0.variables
    }

    /// Number of values that an evaluation gives.
    pub fn outputs(&self) -> usize {
        self.0.outputs.len()
    }

    /// The variables that it reads, ascending.
    pub fn reads(&self) -> &[usize] {
        &self.0.reads
    }

    /// The least time within which a field that it reads changes much ([`Field::stretch`](crate::Field::stretch)); infinite if it reads none.
    pub fn stretch(&self) -> f64 {
        let fields = self.0.fields.iter().filter_map(FieldSlot::get);
        fields.map(|field| field.stretch()).fold(f64::INFINITY, f64::min)
    }

    /// The outputs, if they depend on nothing.
    pub fn constants(&self) -> Option<&[f64]> {
        self.0.constants.as_deref()
    }

    /// The value of one output, if it is a number that the code contains.
    pub fn constant_output(&self, output: usize) -> Option<f64> {
        let register = *self.0.outputs.get(output)?;
        // Registers are used again, but not that of an output.
        self.0.code.iter().rev().find(|i| i.destination() == register).and_then(|i| match *i {
            Instruction::Const(_, x) => Some(x),
            _ => None,
        })
    }

    /// The variable that one output is, if it is no more than that.
    pub fn variable_output(&self, output: usize) -> Option<usize> {
        let register = *self.0.outputs.get(output)? as usize;
        (register < self.0.variables).then_some(register)
    }

    /// The variables that one output depends on, ascending.
    pub fn output_reads(&self, output: usize) -> Vec<usize> {
        let wanted = self.trace(output, |_| {});
        (0..self.0.variables).filter(|variable| wanted[*variable]).collect()
    }

    /// Visits the instructions that an output is made by, from the last to the first. By register: true if the output depends on what is in it
    /// before the first one.
    fn trace(&self, output: usize, mut visit: impl FnMut(&Instruction)) -> Vec<bool> {
        let mut wanted = vec![false; self.0.registers];
        if let Some(&register) = self.0.outputs.get(output) {
            wanted[register as usize] = true;
        }
        for instruction in self.0.code.iter().rev() {
            if std::mem::take(&mut wanted[instruction.destination() as usize]) {
                visit(instruction);
                let operands = instruction.operands().into_iter().flatten();
                operands.for_each(|operand| wanted[operand as usize] = true);
            }
        }
        wanted
    }

    /// The variables that decide over something that jumps: a whole part or a sign, a comparison, the element of an array or the piece
    /// of a curve; ascending.
    pub fn jump_reads(&self) -> Vec<usize> {
        self.reads_through(|instruction| self.jumps_over(instruction))
    }

    /// The variables that decide whether an operation is defined that is not so for all numbers, and has an edge where it ends: a root, a
    /// logarithm, an inverse sine; ascending.
    pub fn partial_reads(&self) -> Vec<usize> {
        self.reads_through(|instruction| match *instruction {
            Instruction::Unary(op, _, a) if op.is_partial() => [Some(a), None],
            Instruction::Binary(Binary::Pow, _, a, _) => [Some(a), None],
            Instruction::Right(Binary::Pow, _, a, exponent) if exponent.fract() != 0.0 => [Some(a), None],
            _ => [None; 2],
        })
    }

    /// True if all roots are defined for all numbers, though they may jump: there are no operations with edges, poles or gaps.
    pub fn is_total(&self) -> bool {
        self.0.code.iter().all(|instruction| match *instruction {
            Instruction::Unary(op, ..) => !op.is_partial() && op != Unary::Tan,
            Instruction::Binary(op, ..) | Instruction::Left(op, ..) => {
                !matches!(op, Binary::Div | Binary::Pow)
            }
            Instruction::Right(Binary::Pow, .., exponent) => exponent >= 0.0 && exponent.fract() == 0.0,
            Instruction::Curve(_, part, ..) | Instruction::Piece(_, part, ..) => part != Part::Inverse,
            Instruction::Element(..) | Instruction::Field(..) => false,
            _ => true,
        })
    }

    /// The variables that some operands of the instructions depend on, ascending.
    fn reads_through(&self, operands: impl Fn(&Instruction) -> [Option<Register>; 2]) -> Vec<usize> {
        let mut all: BTreeSet<Register> = BTreeSet::new();
        for (place, instruction) in self.0.code.iter().enumerate() {
            let mut wanted: BTreeSet<Register> = operands(instruction).into_iter().flatten().collect();
            for before in self.0.code[..place].iter().rev() {
                if wanted.is_empty() {
                    break;
                }
                if wanted.remove(&before.destination()) {
                    wanted.extend(before.operands().into_iter().flatten());
                }
            }
            all.extend(wanted);
        }
        all.into_iter().map(|register| register as usize).filter(|r| *r < self.0.variables).collect()
    }

    /// True if one output is made of something that jumps.
    pub fn output_jumps(&self, output: usize) -> bool {
        let mut jumps = false;
        self.trace(output, |instruction| {
            jumps |= self.jumps_over(instruction).iter().any(Option::is_some);
        });
        jumps
    }

    /// The operands over which an instruction jumps.
    fn jumps_over(&self, instruction: &Instruction) -> [Option<Register>; 2] {
        let compares = |op| matches!(op, Binary::Lt | Binary::Le | Binary::Eq | Binary::Ne);
        match *instruction {
            Instruction::Unary(Unary::Floor | Unary::Ceil | Unary::Sign, _, a) => [Some(a), None],
            Instruction::Binary(op, _, a, b) if compares(op) => [Some(a), Some(b)],
            Instruction::Left(op, .., a) | Instruction::Right(op, _, a, _) if compares(op) => [Some(a), None],
            Instruction::Select(_, c, ..) => [Some(c), None],
            Instruction::Element(.., a) | Instruction::Piece(.., a, _) => [Some(a), None],
            Instruction::Curve(curve, part, _, a) if self.0.curves[curve as usize].jumps(part) => {
                [Some(a), None]
            }
            _ => [None; 2],
        }
    }
}
