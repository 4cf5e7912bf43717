//! Expressions over numbered variables: graphs, compiled programs, and evaluation in numbers, intervals and derivatives. Independent
//! of syntax, plants and simulation.
//!
//! ```text
//! Graph ──compile──▶ Program ──eval::<T>──▶ values of type T
//! ```
//!
//! - [`Graph`] holds hash-consed expressions: equal expressions have equal [`NodeId`]s, constants are
//!   folded, and every operand stands before its user, so passes are loops, never recursion.
//! - [`Program`] is straight-line code for a few roots of a graph.
//! - [`Value`] is what a program computes with. One interpreter serves them all: `f64` for states,
//!   [`Interval`] for bounds over a stretch of time, [`Dual`] for derivatives along a trajectory, [`Smooth`] for the distance from polynomials.
//!
//! ```
//! use dlsys_expr::{Binary, Graph, Program};
//!
//! let mut graph = Graph::default();
//! let (x, half) = (graph.var(0), graph.constant(0.5));
//! let y = graph.binary(Binary::Mul, half, x);
//! let program = Program::compile(&graph, &[y], 1);
//! assert_eq!(program.eval_one(&[3.0]), 1.5);
//! ```

#![warn(missing_docs)]

mod comparison;
mod curve;
mod derivative;
mod dual;
mod elimination;
mod error;
mod field;
mod fold;
mod graph;
mod held;
mod interval;
mod ops;
mod polynomial;
mod program;
mod sign;
mod smooth;
#[cfg(test)]
mod tests;
mod time;

pub use comparison::{Comparison, Truth};
pub use curve::{Array, Curve, MAX_POINTS, Part, Sort};
pub use dual::Dual;
pub use elimination::{determinant, eliminate};
pub use error::Error;
pub use field::{FIELD_ARGUMENTS, Field, FieldPart, FieldSlot};
pub use fold::Fold;
pub use graph::{Graph, Integral, Lookup, Node, NodeId, NodeMap, NodeSet};
pub use held::Held;
pub use interval::Interval;
pub use ops::{Binary, Unary, Value};
pub use polynomial::{Monomial, Polynomial};
pub use program::{LANES, Lanes, Program, Scratch};
pub use sign::Sign;
pub use smooth::Smooth;
pub use time::SimTime;
