//! Fields: functions of time and place that something outside of expressions computes, as the wind is.
//!
//! An expression is compiled before its field exists, so a graph holds a [`FieldSlot`], and the field is put into it later, once.

use std::fmt;
use std::sync::{Arc, OnceLock};

use crate::Interval;

/// Arguments of a field: a time and three coordinates, in this order.
pub const FIELD_ARGUMENTS: usize = 4;

/// A component of a field, or a partial derivative of one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct FieldPart {
    /// The number of the component.
    pub component: u8,
    /// The number of the argument by which it is differentiated.
    pub by: Option<u8>,
}

impl FieldPart {
    /// A component itself.
    pub fn value(component: u8) -> FieldPart {
        FieldPart { component, by: None }
    }

    /// The derivative by an argument; `None` of a part that is one: second derivatives are not known.
    pub fn derivative(self, argument: usize) -> Option<FieldPart> {
        match self.by {
            None => Some(FieldPart { by: Some(argument as u8), ..self }),
            Some(_) => None,
        }
    }
}

/// A function of time and place with its first derivatives.
///
/// It must be pure: equal arguments give equal bits, in whatever order and on whichever thread.
pub trait Field: fmt::Debug + Send + Sync {
    /// A part at an instant and a place. Not a number where it has no value.
    fn value(&self, part: FieldPart, at: [f64; FIELD_ARGUMENTS]) -> f64;

    /// Bounds of a part over a stretch of time and a box. They get as narrow as is wished if the stretch and the box do.
    fn over(&self, part: FieldPart, at: [Interval; FIELD_ARGUMENTS]) -> Interval;

    /// The time within which it changes much: no longer stretch should be searched for zeros at once.
    fn stretch(&self) -> f64 {
        f64::INFINITY
    }
}

/// A place for a field in expressions. Without a field no part has a value.
#[derive(Clone, Debug, Default)]
pub struct FieldSlot(Arc<OnceLock<Arc<dyn Field>>>);

impl FieldSlot {
    /// Puts a field into the slot. One that is there stays: all fields of a slot must be the same function.
    pub fn set(&self, field: Arc<dyn Field>) {
        let _ = self.0.set(field);
    }

    /// The field, if there is one.
    pub fn get(&self) -> Option<&dyn Field> {
        self.0.get().map(|field| &**field)
    }

    pub(crate) fn value(&self, part: FieldPart, at: [f64; FIELD_ARGUMENTS]) -> f64 {
        self.get().map_or(f64::NAN, |field| field.value(part, at))
    }

    pub(crate) fn over(&self, part: FieldPart, at: [Interval; FIELD_ARGUMENTS]) -> Interval {
        let Some(field) = self.get().filter(|_| !at.iter().any(|bound| bound.is_empty())) else {
            return Interval::EMPTY;
        };
        let partial = at.iter().any(|bound| bound.partial);
        let bounds = field.over(part, at);
        Interval { partial: bounds.partial || partial, ..bounds }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Binary, Dual, Graph, Program, Value};

    /// The components t x², y z.
    #[derive(Debug)]
    struct Given;

    impl Field for Given {
        fn value(&self, part: FieldPart, [t, x, y, z]: [f64; 4]) -> f64 {
            match (part.component, part.by) {
                (0, None) => t * x * x,
                (0, Some(0)) => x * x,
                (0, Some(1)) => 2.0 * t * x,
                (1, None) => y * z,
                (1, Some(2)) => z,
                (1, Some(3)) => y,
                _ => 0.0,
            }
        }

        fn over(&self, part: FieldPart, at: [Interval; 4]) -> Interval {
            let ends = [at.map(|bound| bound.lo), at.map(|bound| bound.hi)];
            let [low, high] = ends.map(|at| self.value(part, at));
            Interval::spanned(low, high)
        }
    }

    /// 3 times a component at (t, 2 x, y, z), for the variables t, x, y, z.
    fn tripled(graph: &mut Graph, slot: &FieldSlot, component: u8) -> crate::NodeId {
        let lookup = graph.add_field(slot.clone());
        let variables = [0, 1, 2, 3].map(|v| graph.var(v));
        let [two, three] = [2.0, 3.0].map(|x| graph.constant(x));
        let at = [variables[0], graph.binary(Binary::Mul, two, variables[1]), variables[2], variables[3]];
        let field = graph.field(lookup, FieldPart::value(component), at);
        graph.binary(Binary::Mul, three, field)
    }

    #[test]
    fn a_field_is_evaluated_in_all_types_once_it_is_there() {
        let (mut graph, slot) = (Graph::default(), FieldSlot::default());
        let root = tripled(&mut graph, &slot, 0);
        let slope = graph.derivative(root, 1);
        let program = Program::compile(&graph, &[root, slope], 4);
        assert_eq!(program.reads(), [0, 1, 2, 3]);
        let at = [2.0, 0.5, 7.0, -1.0];
        let mut out = [0.0; 2];
        program.eval(&at, &mut Vec::new(), &mut out);
        assert!(out[0].is_nan(), "there is no field yet");
        slot.set(Arc::new(Given));
        program.eval(&at, &mut Vec::new(), &mut out);
        // 3 t (2x)², and its derivative 24 t x.
        assert_eq!(out, [6.0, 24.0]);
        let mut lanes = at.map(crate::Lanes::all).to_vec();
        let registers: Vec<usize> = program.eval_lanes(&mut lanes).collect();
        assert_eq!(registers.iter().map(|register| lanes[*register][7]).collect::<Vec<_>>(), [6.0, 24.0]);
        let moving = [(2.0, 1.0), (0.5, 3.0), (7.0, 5.0), (-1.0, 0.0)];
        let mut rates = [Dual::constant(0.0); 2];
        program.eval(&moving.map(|(value, rate)| Dual { value, rate }), &mut Vec::new(), &mut rates);
        // d/dt = 3 (2x)² + 24 t x · 3; the rate of a derivative is not known.
        assert!((rates[0].value, rates[0].rate) == (6.0, 75.0) && rates[1].rate.is_nan());
    }

    #[test]
    fn bounds_are_those_of_the_field() {
        let (mut graph, slot) = (Graph::default(), FieldSlot::default());
        let root = tripled(&mut graph, &slot, 1);
        let program = Program::compile(&graph, &[root], 4);
        let at = [(0.0, 1.0), (0.0, 1.0), (1.0, 2.0), (3.0, 4.0)].map(|(lo, hi)| Interval::spanned(lo, hi));
        let mut out = [Interval::EMPTY];
        program.eval(&at, &mut Vec::new(), &mut out);
        assert!(out[0].is_empty(), "there is no field yet");
        slot.set(Arc::new(Given));
        program.eval(&at, &mut Vec::new(), &mut out);
        assert_eq!(out[0], Interval::spanned(9.0, 24.0));
        let mut nowhere = at;
        nowhere[1] = Interval::EMPTY;
        program.eval(&nowhere, &mut Vec::new(), &mut out);
        assert!(out[0].is_empty());
    }
}
