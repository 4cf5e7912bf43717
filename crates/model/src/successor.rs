//! Strings of modules whose arguments are computed when a production applies: successors, the axiom, and drawings.
//!
//! A string without repetitions and conditions is one [`Stretch`]: its modules are known when the model is read. In others
//! stretches are parts of [`Repeat`]s and [`Choice`]s, which depend on the values of the predecessor; [`Successor::expand`]
//! visits the stretches that there are.

use crate::{Draw, KindId, NewClock};
use dlsys_diagnostic::Span;
use dlsys_expr::{Program, Scratch, Value};

/// A string of modules without repetitions and conditions.
#[derive(Clone, Debug, Default)]
pub struct Stretch {
    /// The modules and brackets in string order.
    pub kinds: Vec<KindId>,
    /// The arguments of all modules in string order, with inputs and without clocks. They read the variables of the rule, then the indices of
    /// the repetitions around them from the outermost on, then the draws.
    pub arguments: Program,
    /// The random numbers that the arguments read.
    pub draws: Vec<Draw>,
    /// The clocks, in the order of their modules.
    pub clocks: Vec<NewClock>,
    /// The first [`PLACES`](Stretch::PLACES) modules, brackets left out, and their places in the text.
    pub places: Vec<(KindId, Span)>,
}

impl Stretch {
    /// Maximum number of `places`: as many modules as a lineage distinguishes.
    pub const PLACES: usize = 254;

    /// Number of parameters of all its modules, hidden ones included.
    pub fn width(&self) -> usize {
        self.arguments.outputs() + self.clocks.len()
    }

    /// Appends the arguments of a stretch without draws and clocks.
    pub fn evaluate<T: Value>(&self, variables: &[T], scratch: &mut Scratch<T>, out: &mut Vec<T>) {
        let first = out.len();
        out.resize(first + self.arguments.outputs(), T::constant(0.0));
        self.arguments.eval(variables, scratch, &mut out[first..]);
    }

    /// True if the values of the predecessor determine its arguments: it has no draws and no clocks.
    fn is_certain(&self) -> bool {
        self.draws.is_empty() && self.clocks.is_empty()
    }
}

/// `for i in A .. B: ( … )`
#[derive(Clone, Debug)]
pub struct Repeat {
    /// The first and the last value of the index, as two outputs.
    pub bounds: Program,
    /// The string that is repeated.
    pub body: Vec<Part>,
    /// The place of the bounds in the text.
    pub span: Span,
}

/// `if C: ( … ) else ( … )`
#[derive(Clone, Debug)]
pub struct Choice {
    /// The condition: not 0 where it holds.
    pub condition: Program,
    /// The string where it holds.
    pub then: Vec<Part>,
    /// The string where it does not hold.
    pub otherwise: Vec<Part>,
}

/// A part of a string.
#[derive(Clone, Debug)]
pub enum Part {
    /// Modules.
    Stretch(Stretch),
    /// A repetition.
    Repeat(Repeat),
    /// A condition.
    Choice(Choice),
}

/// A string of modules whose arguments, and with repetitions and conditions also modules, are computed when it is made.
#[derive(Clone, Debug)]
pub enum Successor {
    /// Without repetitions and conditions.
    Plain(Stretch),
    /// With some.
    Parts(Vec<Part>),
}

impl Default for Successor {
    fn default() -> Successor {
        Successor::Plain(Stretch::default())
    }
}

/// The bounds of a repetition that are none.
#[derive(Clone, Debug, PartialEq)]
pub struct BadBounds {
    /// The place of the bounds in the text.
    pub span: Span,
    /// The reason, as a part of a sentence.
    pub why: String,
}

impl Successor {
    /// Maximum number of repetitions of one `for`.
    pub const REPETITIONS: f64 = 1e6;
    /// Maximum number of repetitions in one string, those of nested ones multiplied.
    const STEPS: usize = 20_000_000;
    /// Bounds nearer to a whole number than this are that number.
    const WHOLE: f64 = 1e-9;

    /// All its stretches as they are written: those of repetitions once, those of both branches of a condition.
    pub fn stretches(&self) -> impl Iterator<Item = &Stretch> {
        let (plain, parts) = match self {
            Successor::Plain(stretch) => (Some(stretch), [].iter()),
            Successor::Parts(parts) => (None, parts.iter()),
        };
        let mut stack = vec![parts];
        let inner = std::iter::from_fn(move || {
            loop {
                match stack.last_mut()?.next() {
                    None => drop(stack.pop()),
                    Some(Part::Stretch(stretch)) => return Some(stretch),
                    Some(Part::Repeat(repeat)) => stack.push(repeat.body.iter()),
                    Some(Part::Choice(choice)) => {
                        stack.push(choice.otherwise.iter());
                        stack.push(choice.then.iter());
                    }
                }
            }
        });
        plain.into_iter().chain(inner)
    }

    /// The kinds of all modules that it may have, brackets included; a kind may occur several times.
    pub fn kinds(&self) -> impl Iterator<Item = KindId> {
        self.stretches().flat_map(|stretch| stretch.kinds.iter().copied())
    }

    /// True if it has neither modules nor parts.
    pub fn is_empty(&self) -> bool {
        matches!(self, Successor::Plain(stretch) if stretch.kinds.is_empty())
    }

    /// The place in the text of the module at an index, brackets not counted, if it is of this kind; None where repetitions or
    /// conditions come before it.
    pub fn place_of(&self, place: usize, kind: KindId) -> Option<Span> {
        let Successor::Plain(stretch) = self else { return None };
        stretch.places.get(place).filter(|(known, _)| *known == kind).map(|(_, span)| *span)
    }

    /// True if the values of the predecessor determine its arguments: it has no draws and no clocks.
    pub fn is_certain(&self) -> bool {
        self.stretches().all(Stretch::is_certain)
    }

    /// All programs of its parts. They also read variables behind those of the rule: indices and draws.
    pub fn programs(&self) -> impl Iterator<Item = &Program> {
        let stretches = self.stretches().flat_map(|stretch| {
            let draws = stretch.draws.iter().map(|draw| &draw.parameters);
            draws.chain([&stretch.arguments])
        });
        let mut controls = Vec::new();
        if let Successor::Parts(parts) = self {
            collect_controls(parts, &mut controls);
        }
        stretches.chain(controls)
    }

    /// Visits its stretches in string order, those of repetitions as often as they repeat, with the variables: those of the rule,
    /// and behind them the indices of the repetitions around it. A visitor that adds variables removes them again.
    ///
    /// # Errors
    /// Bounds that are no whole numbers or too far apart, and those of the visitor.
    pub fn expand<E: From<BadBounds>>(
        &self,
        variables: &mut Vec<f64>,
        scratch: &mut Scratch<f64>,
        visit: &mut impl FnMut(&Stretch, &mut Vec<f64>, &mut Scratch<f64>) -> Result<(), E>,
    ) -> Result<(), E> {
        match self {
            Successor::Plain(stretch) => visit(stretch, variables, scratch),
            Successor::Parts(parts) => {
                let mut left = Successor::STEPS;
                expand(parts, variables, scratch, &mut left, visit)
            }
        }
    }
}

fn collect_controls<'p>(parts: &'p [Part], out: &mut Vec<&'p Program>) {
    for part in parts {
        match part {
            Part::Stretch(_) => {}
            Part::Repeat(repeat) => {
                out.push(&repeat.bounds);
                collect_controls(&repeat.body, out);
            }
            Part::Choice(choice) => {
                out.push(&choice.condition);
                collect_controls(&choice.then, out);
                collect_controls(&choice.otherwise, out);
            }
        }
    }
}

/// See [`Successor::expand`]; `left` is the number of repetitions that may follow.
fn expand<E: From<BadBounds>>(
    parts: &[Part],
    variables: &mut Vec<f64>,
    scratch: &mut Scratch<f64>,
    left: &mut usize,
    visit: &mut impl FnMut(&Stretch, &mut Vec<f64>, &mut Scratch<f64>) -> Result<(), E>,
) -> Result<(), E> {
    for part in parts {
        match part {
            Part::Stretch(stretch) => visit(stretch, variables, scratch)?,
            Part::Choice(choice) => {
                let mut holds = [0.0];
                choice.condition.eval(variables, scratch, &mut holds);
                let branch = if holds[0] != 0.0 { &choice.then } else { &choice.otherwise };
                expand(branch, variables, scratch, left, visit)?;
            }
            Part::Repeat(repeat) => {
                let [from, to] = bounds(repeat, variables, scratch)?;
                let mut index = from;
                while index <= to {
                    let Some(fewer) = left.checked_sub(1) else {
                        let why = format!("more than {} repetitions in one string", Successor::STEPS);
                        return Err(BadBounds { span: repeat.span, why }.into());
                    };
                    *left = fewer;
                    variables.push(index);
                    let done = expand(&repeat.body, variables, scratch, left, visit);
                    variables.pop();
                    done?;
                    index += 1.0;
                }
            }
        }
    }
    Ok(())
}

/// The bounds of a repetition, as whole numbers.
fn bounds(repeat: &Repeat, variables: &[f64], scratch: &mut Scratch<f64>) -> Result<[f64; 2], BadBounds> {
    /// Beyond this the next whole number is not always 1 further.
    const LARGEST: f64 = 9e15;
    let mut values = [0.0; 2];
    repeat.bounds.eval(variables, scratch, &mut values);
    let bad = |why: String| BadBounds { span: repeat.span, why };
    for value in &mut values {
        let whole = value.round();
        // Not a number is not near either.
        if !((*value - whole).abs() <= Successor::WHOLE && whole.abs() <= LARGEST) {
            return Err(bad(format!("{value} is not a whole number")));
        }
        *value = whole;
    }
    let [from, to] = values;
    if to - from >= Successor::REPETITIONS {
        return Err(bad(format!("more than a million repetitions, from {from} to {to}")));
    }
    Ok(values)
}

#[cfg(test)]
mod tests {
    use super::*;
    use dlsys_expr::Graph;

    fn program(graph: &Graph, roots: &[dlsys_expr::NodeId], variables: usize) -> Program {
        Program::compile(graph, roots, variables)
    }

    /// `for i in 1 .. x: ( if i <= 2: ( A(i) ) )`
    fn nested() -> Successor {
        let mut graph = Graph::default();
        let (x, i) = (graph.var(0), graph.var(1));
        let (one, two) = (graph.constant(1.0), graph.constant(2.0));
        let small = graph.binary(dlsys_expr::Binary::Le, i, two);
        let body =
            Stretch { kinds: vec![KindId::OPEN], arguments: program(&graph, &[i], 2), ..Stretch::default() };
        let choice = Choice {
            condition: program(&graph, &[small], 2),
            then: vec![Part::Stretch(body)],
            otherwise: vec![],
        };
        let bounds = program(&graph, &[one, x], 1);
        Successor::Parts(vec![Part::Repeat(Repeat {
            bounds,
            body: vec![Part::Choice(choice)],
            span: Span::default(),
        })])
    }

    fn values(of: &Successor, x: f64) -> Result<Vec<f64>, BadBounds> {
        let mut out = Vec::new();
        let mut visit = |stretch: &Stretch, variables: &mut Vec<f64>, scratch: &mut Scratch<f64>| {
            stretch.evaluate(variables, scratch, &mut out);
            Ok::<(), BadBounds>(())
        };
        of.expand(&mut vec![x], &mut Scratch::default(), &mut visit).map(|()| out)
    }

    #[test]
    fn stretches_are_visited_as_often_as_they_repeat() {
        assert_eq!(values(&nested(), 5.0), Ok(vec![1.0, 2.0]));
        assert_eq!(values(&nested(), 1.0 + 1e-10), Ok(vec![1.0]));
        assert_eq!(values(&nested(), 0.0), Ok(vec![]));
        assert_eq!((nested().stretches().count(), nested().kinds().count()), (1, 1));
    }

    #[test]
    fn bounds_that_are_no_whole_numbers_are_errors() {
        for bad in [1.5, f64::NAN, f64::INFINITY, 1e17, 1.00001, 2e6] {
            assert!(values(&nested(), bad).is_err(), "{bad}");
        }
    }
}
