//! Hash-consed expression graphs: construction with folding of constants, rebuilding, and reachability.

use std::collections::BinaryHeap;
use std::sync::Arc;

use rustc_hash::{FxHashMap, FxHashSet};

use super::{Array, Binary, Curve, FIELD_ARGUMENTS, FieldPart, FieldSlot, Part, Program, Unary, Value};

/// An expression in a [`Graph`]. Two expressions of the same graph that are built alike are equal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct NodeId(u32);

impl NodeId {
    /// Position in [`Graph::nodes`].
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// Something of each of some expressions.
pub type NodeMap<T> = FxHashMap<NodeId, T>;
/// Some expressions.
pub type NodeSet = FxHashSet<NodeId>;

/// One operation; operands always have smaller ids.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Node {
    /// A constant, by its bits, so that it can be hashed.
    Const(u64),
    /// A variable, by number; its meaning is up to the caller.
    Var(u32),
    /// A function or operator of one operand.
    Unary(Unary, NodeId),
    /// A function or operator of two operands, in their order.
    Binary(Binary, NodeId, NodeId),
    /// `Select(condition, then, else)`.
    Select(NodeId, NodeId, NodeId),
    /// A part of a curve at an argument.
    Curve(Lookup, Part, NodeId),
    /// `Piece(curve, part, index, argument)`: one piece of a curve, continued beyond its knots.
    Piece(Lookup, Part, NodeId, NodeId),
    /// An element of an array, by number.
    Element(Lookup, NodeId),
    /// A part of a field at a time and a place.
    Field(Lookup, FieldPart, [NodeId; FIELD_ARGUMENTS]),
}

/// A curve, an array or a field of a [`Graph`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Lookup(u32);

/// An arena of expressions in which equal expressions are stored once.
#[derive(Clone, Debug, Default)]
pub struct Graph {
    nodes: Vec<Node>,
    ids: FxHashMap<Node, NodeId>,
    curves: Vec<Arc<Curve>>,
    arrays: Vec<Arc<Array>>,
    fields: Vec<FieldSlot>,
    /// Expressions whose antiderivative by another one is known.
    integrals: NodeMap<Integral>,
    /// Programs so far, by the number of their variables and by their roots.
    programs: FxHashMap<usize, FxHashMap<Box<[NodeId]>, Program>>,
}

/// An antiderivative of an expression: the expression is the derivative of `whole` by `argument`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Integral {
    /// The antiderivative.
    pub whole: NodeId,
    /// The expression by which it is one.
    pub argument: NodeId,
}

impl Graph {
    /// All nodes, operands before their users.
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// The operation that an expression is. Panics for an id of another graph that is larger.
    pub fn node(&self, id: NodeId) -> Node {
        self.nodes[id.index()]
    }

    fn intern(&mut self, node: Node) -> NodeId {
        if let Some(&id) = self.ids.get(&node) {
            return id;
        }
        let id = NodeId(u32::try_from(self.nodes.len()).expect("bounded by the front end"));
        self.nodes.push(node);
        self.ids.insert(node, id);
        id
    }

    /// The program of these roots ([`Program::compile`]), compiled once for all who ask for it: rules that differ in names only have the
    /// same expressions.
    pub fn program(&mut self, roots: &[NodeId], variables: usize) -> Program {
        if let Some(known) = self.programs.get(&variables).and_then(|known| known.get(roots)) {
            return known.clone();
        }
        let program = Program::compile(self, roots, variables);
        self.programs.entry(variables).or_default().insert(roots.into(), program.clone());
        program
    }

    /// Adds a curve.
    pub fn add_curve(&mut self, curve: Arc<Curve>) -> Lookup {
        self.curves.push(curve);
        Lookup(self.curves.len() as u32 - 1)
    }

    /// Adds an array.
    pub fn add_array(&mut self, array: Arc<Array>) -> Lookup {
        self.arrays.push(array);
        Lookup(self.arrays.len() as u32 - 1)
    }

    /// Adds a place for a field.
    pub fn add_field(&mut self, slot: FieldSlot) -> Lookup {
        self.fields.push(slot);
        Lookup(self.fields.len() as u32 - 1)
    }

    /// The field of a lookup.
    pub fn field_of(&self, lookup: Lookup) -> &FieldSlot {
        &self.fields[lookup.0 as usize]
    }

    /// True if `roots` read a field.
    pub fn reads_field(&self, roots: &[NodeId]) -> bool {
        let is_field = |id: NodeId| matches!(self.node(id), Node::Field(..));
        !self.fields.is_empty() && self.reachable(roots).into_iter().any(is_field)
    }

    /// The curve of a lookup.
    pub fn curve_of(&self, lookup: Lookup) -> &Arc<Curve> {
        &self.curves[lookup.0 as usize]
    }

    /// The array of a lookup.
    pub fn array_of(&self, lookup: Lookup) -> &Arc<Array> {
        &self.arrays[lookup.0 as usize]
    }

    /// All curves, in the order in which they were added.
    pub fn curves(&self) -> &[Arc<Curve>] {
        &self.curves
    }

    /// Notes the antiderivative of an expression.
    pub fn know_integral(&mut self, of: NodeId, integral: Integral) {
        if self.as_constant(of).is_none() {
            self.integrals.insert(of, integral);
        }
    }

    /// The antiderivative of an expression, if it is known: of curves and their slopes, and of what has been noted.
    pub fn integral_of(&mut self, id: NodeId) -> Option<Integral> {
        if let Some(known) = self.integrals.get(&id) {
            return Some(*known);
        }
        let Node::Curve(curve, part, argument) = self.node(id) else { return None };
        let whole = match part {
            Part::Value => Part::Integral,
            // Integrals of derivatives do not contain the jumps.
            Part::Slope | Part::Second if self.curve_of(curve).jumps(Part::Value) => return None,
            Part::Slope => Part::Value,
            Part::Second => Part::Slope,
            Part::PhaseSlope => Part::Phase,
            _ => return None,
        };
        Some(Integral { whole: self.curve(curve, whole, argument), argument })
    }

    /// True if [`Graph::integral_of`] knows an antiderivative.
    pub fn integral_is_known(&self, id: NodeId) -> bool {
        let known = |curve, part| match part {
            Part::Slope | Part::Second => !self.curve_of(curve).jumps(Part::Value),
            part => matches!(part, Part::Value | Part::PhaseSlope),
        };
        self.integrals.contains_key(&id) || matches!(self.node(id), Node::Curve(c, p, _) if known(c, p))
    }

    /// Those of the given expressions for which [`Graph::know_integral`] was called.
    pub fn noted_integrals(&self, among: &[NodeId]) -> Vec<(NodeId, Integral)> {
        if self.integrals.is_empty() {
            return Vec::new();
        }
        among.iter().filter_map(|id| Some((*id, *self.integrals.get(id)?))).collect()
    }

    /// A part of a curve at `x`; folded if `x` is constant.
    pub fn curve(&mut self, curve: Lookup, part: Part, x: NodeId) -> NodeId {
        match self.as_constant(x) {
            Some(x) => self.constant(self.curve_of(curve).eval(part, x)),
            None => self.intern(Node::Curve(curve, part, x)),
        }
    }

    /// A part of one piece of a curve, continued beyond its knots, at `x` ([`Curve::continued`]); folded if both operands are constant.
    pub fn piece(&mut self, curve: Lookup, part: Part, index: NodeId, x: NodeId) -> NodeId {
        match (self.as_constant(index), self.as_constant(x)) {
            (Some(index), Some(x)) => self.constant(self.curve_of(curve).continued(part, index, x)),
            _ => self.intern(Node::Piece(curve, part, index, x)),
        }
    }

    /// The element of an array with a number ([`Array::element`]); folded if the number is constant.
    pub fn element(&mut self, array: Lookup, index: NodeId) -> NodeId {
        match self.as_constant(index) {
            Some(index) => self.constant(self.array_of(array).element(index)),
            None => self.intern(Node::Element(array, index)),
        }
    }

    /// A part of a field at a time and a place. It is never folded: the field may come later.
    pub fn field(&mut self, field: Lookup, part: FieldPart, at: [NodeId; FIELD_ARGUMENTS]) -> NodeId {
        self.intern(Node::Field(field, part, at))
    }

    /// A constant, by its bits: 0 and -0 differ, NaN equals itself.
    pub fn constant(&mut self, x: f64) -> NodeId {
        self.intern(Node::Const(x.to_bits()))
    }

    /// The variable with a number; its meaning is up to the caller.
    pub fn var(&mut self, index: u32) -> NodeId {
        self.intern(Node::Var(index))
    }

    /// The value of a constant expression.
    pub fn as_constant(&self, id: NodeId) -> Option<f64> {
        match self.node(id) {
            Node::Const(bits) => Some(f64::from_bits(bits)),
            _ => None,
        }
    }

    /// A function or operator of one operand; folded if the operand is constant.
    pub fn unary(&mut self, op: Unary, a: NodeId) -> NodeId {
        match self.as_constant(a) {
            Some(x) => self.constant(f64::unary(op, x)),
            None => self.intern(Node::Unary(op, a)),
        }
    }

    /// Constants are folded with the same arithmetic that evaluates them later, and identities are
    /// used only where they hold for every IEEE number, so a value never depends on folding.
    pub fn binary(&mut self, op: Binary, a: NodeId, b: NodeId) -> NodeId {
        match (self.as_constant(a), self.as_constant(b)) {
            (Some(x), Some(y)) => return self.constant(f64::binary(op, x, y)),
            (Some(1.0), None) if op == Binary::Mul => return b,
            (None, Some(1.0)) if matches!(op, Binary::Mul | Binary::Div | Binary::Pow) => return a,
            (None, Some(2.0)) if op == Binary::Pow => return self.intern(Node::Binary(Binary::Mul, a, a)),
            _ => {}
        }
        self.intern(Node::Binary(op, a, b))
    }

    /// `a` where `condition` is true, else `b`; folded if the condition is constant.
    pub fn select(&mut self, condition: NodeId, a: NodeId, b: NodeId) -> NodeId {
        match self.as_constant(condition) {
            Some(c) if c != 0.0 => a,
            Some(_) => b,
            None if a == b => a,
            None => self.intern(Node::Select(condition, a, b)),
        }
    }

    /// Rebuilds `roots` from the operands up. `replace` gets each node as it was (by id) and with its operands already
    /// rebuilt; if it returns an expression, that replaces the node.
    pub fn rewrite(
        &mut self,
        roots: &[NodeId],
        mut replace: impl FnMut(&mut Graph, NodeId, Node) -> Option<NodeId>,
    ) -> Vec<NodeId> {
        let mut new: NodeMap<NodeId> = NodeMap::default();
        for id in self.reachable(roots) {
            let rebuilt = match self.node(id) {
                leaf @ (Node::Const(_) | Node::Var(_)) => leaf,
                Node::Unary(op, a) => Node::Unary(op, new[&a]),
                Node::Binary(op, a, b) => Node::Binary(op, new[&a], new[&b]),
                Node::Select(c, a, b) => Node::Select(new[&c], new[&a], new[&b]),
                Node::Curve(curve, part, x) => Node::Curve(curve, part, new[&x]),
                Node::Piece(curve, part, i, x) => Node::Piece(curve, part, new[&i], new[&x]),
                Node::Element(array, i) => Node::Element(array, new[&i]),
                Node::Field(field, part, at) => Node::Field(field, part, at.map(|of| new[&of])),
            };
            let image = replace(self, id, rebuilt).unwrap_or_else(|| self.add(id, rebuilt));
            new.insert(id, image);
        }
        roots.iter().map(|r| new[r]).collect()
    }

    /// A node with other operands than `id` has: folded like one that is built by its own function.
    pub fn add(&mut self, id: NodeId, node: Node) -> NodeId {
        match node {
            Node::Const(_) | Node::Var(_) => id,
            Node::Unary(op, a) => self.unary(op, a),
            Node::Binary(op, a, b) => self.binary(op, a, b),
            Node::Select(c, a, b) => self.select(c, a, b),
            Node::Curve(curve, part, x) => self.curve(curve, part, x),
            Node::Piece(curve, part, i, x) => self.piece(curve, part, i, x),
            Node::Element(array, i) => self.element(array, i),
            Node::Field(field, part, at) => self.field(field, part, at),
        }
    }

    /// All expressions that `roots` are built from, operands first.
    pub fn reachable(&self, roots: &[NodeId]) -> Vec<NodeId> {
        let mut all: Vec<NodeId> = self.descending(roots).collect();
        all.reverse();
        all
    }

    /// The same, operands last: operands have smaller ids, so the largest that is left has no users left.
    fn descending(&self, roots: &[NodeId]) -> impl Iterator<Item = NodeId> {
        let mut left = Left::from(roots);
        std::iter::from_fn(move || {
            let id = left.pop()?;
            self.node(id).operands().into_iter().flatten().for_each(|operand| left.add(operand));
            Some(id)
        })
    }

    /// The variables that `roots` read, ascending.
    pub fn variables(&self, roots: &[NodeId]) -> Vec<u32> {
        let variable = |id| match self.node(id) {
            Node::Var(v) => Some(v),
            _ => None,
        };
        let mut all: Vec<u32> = self.descending(roots).filter_map(variable).collect();
        all.sort_unstable();
        all
    }
}

/// Expressions that are still to be visited, the largest first, each once. What is added is smaller than what was taken last.
#[expect(
    clippy::large_enum_variant,
    reason = "it stands on the stack, and a box would be an allocation for each of many small searches"
)]
enum Left {
    /// Marks of the first expressions of a graph, of which most models have no more, and the last word that may have one.
    Marks([u64; Left::WORDS], usize),
    Heap(BinaryHeap<NodeId>),
}

impl Left {
    const WORDS: usize = 64;

    fn from(roots: &[NodeId]) -> Left {
        let last = roots.iter().max().map_or(0, |last| last.index() / 64);
        if last >= Left::WORDS {
            return Left::Heap(roots.iter().copied().collect());
        }
        let mut left = Left::Marks([0; Left::WORDS], last);
        roots.iter().for_each(|root| left.add(*root));
        left
    }

    fn add(&mut self, id: NodeId) {
        match self {
            Left::Marks(words, _) => words[id.index() / 64] |= 1 << (id.index() % 64),
            Left::Heap(heap) => heap.push(id),
        }
    }

    fn pop(&mut self) -> Option<NodeId> {
        match self {
            Left::Marks(words, last) => {
                while words[*last] == 0 {
                    *last = last.checked_sub(1)?;
                }
                let bit = words[*last].ilog2();
                words[*last] &= !(1 << bit);
                Some(NodeId(*last as u32 * 64 + bit))
            }
            Left::Heap(heap) => {
                let id = heap.pop()?;
                while heap.peek() == Some(&id) {
                    heap.pop();
                }
                Some(id)
            }
        }
    }
}

impl Node {
    /// The operands in order; absent ones are `None`.
    pub fn operands(self) -> [Option<NodeId>; 4] {
        match self {
            Node::Const(_) | Node::Var(_) => [None; 4],
            Node::Unary(_, a) | Node::Curve(_, _, a) | Node::Element(_, a) => [Some(a), None, None, None],
            Node::Binary(_, a, b) | Node::Piece(_, _, a, b) => [Some(a), Some(b), None, None],
            Node::Select(c, a, b) => [Some(c), Some(a), Some(b), None],
            Node::Field(_, _, at) => at.map(Some),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Small and large expressions are passed through by different means: each reaches what it is built from, once, operands first.
    #[test]
    fn what_an_expression_is_built_from_is_found_in_small_and_large_graphs() {
        let mut graph = Graph::default();
        let mut roots = vec![graph.var(3), graph.var(1)];
        for i in 0..6000 {
            let factor = graph.constant(f64::from(i % 7));
            let [a, b] = [roots[roots.len() - 1], roots[roots.len() * 3 / 4]];
            let product = graph.binary(Binary::Mul, factor, b);
            roots.push(graph.binary(Binary::Add, a, product));
        }
        for root in [roots[0], roots[1], roots[2], roots[100], roots[1000], roots[roots.len() - 1]] {
            let mut expected = NodeSet::from_iter([root]);
            let mut stack = vec![root];
            while let Some(id) = stack.pop() {
                let operands = graph.node(id).operands().into_iter().flatten();
                stack.extend(operands.filter(|operand| expected.insert(*operand)));
            }
            let mut expected: Vec<NodeId> = expected.into_iter().collect();
            expected.sort_unstable();
            assert_eq!(graph.reachable(&[root, root]), expected);
            let variable = |id: &NodeId| match graph.node(*id) {
                Node::Var(v) => Some(v),
                _ => None,
            };
            let mut variables: Vec<u32> = expected.iter().filter_map(variable).collect();
            variables.sort_unstable();
            assert_eq!(graph.variables(&[root]), variables);
        }
        assert!(graph.nodes().len() > Left::WORDS * 64 && graph.reachable(&[]).is_empty());
    }

    #[test]
    fn equal_expressions_are_one_node() {
        let mut g = Graph::default();
        let (x, y) = (g.var(0), g.var(1));
        let a = g.binary(Binary::Add, x, y);
        let b = g.binary(Binary::Add, x, y);
        assert_eq!(a, b);
        assert_eq!(g.variables(&[a]), [0, 1]);
    }

    #[test]
    fn folding_keeps_the_sign_of_zero_and_nan() {
        let mut g = Graph::default();
        let (x, zero) = (g.var(0), g.constant(0.0));
        let sum = g.binary(Binary::Add, x, zero);
        let product = g.binary(Binary::Mul, x, zero);
        assert_ne!(sum, x, "-0 + 0 is +0");
        assert_ne!(product, zero, "NaN * 0 is NaN");
    }
}
