//! Curves, tables and arrays: their declarations and their uses in expressions.
//!
//! `slope`, `integral`, `inverse` and `length` take the name of a curve, a function or an array as their first argument.
//! These names are not reserved: a function that the model declares takes precedence.

use std::sync::Arc;

use rustc_hash::FxHashSet;

use crate::functions;
use crate::scope::{FORMAL, Lowered, Scope, plural};
use crate::table::{self, TableError};
use dlsys_diagnostic::{Diagnostic, Span};
use dlsys_expr::{
    Array, Binary, Curve, Error as CurveError, Integral, Lookup, MAX_POINTS, NodeId, Part, Sort, Unary,
};
use dlsys_syntax::Files;
use dlsys_syntax::ast::{Expr, ExprId, Expression, Expressions, Item, Name, Text};
use dlsys_syntax::suggest::did_you_mean;

/// Functions whose first argument is a name, with their notation.
pub const FUNCTIONALS: [(&str, &str); 4] = [
    ("slope", "slope(g, x)"),
    ("integral", "integral(g, a, b)"),
    ("inverse", "inverse(g, y)"),
    ("length", "length(a)"),
];

/// Maximum number of elements of one array.
const MAX_ELEMENTS: usize = 1_000_000;

/// Remedies for jumps of curves.
const JUMP: &str = "a jump is two points with one x: the value before it, and the value from there on";
const END: &str = "beyond its ends a curve keeps its value: put another point before or behind the jump";

impl Scope {
    pub fn define_array(&mut self, name: &Name, all: &Expressions, values: &[Expression]) {
        let known: Vec<Option<f64>> = values.iter().map(|value| self.constant_value(all, *value)).collect();
        let values: Option<Vec<f64>> = known.into_iter().collect();
        let array = values.filter(|values| {
            if values.len() > MAX_ELEMENTS {
                let error = format!("the array `{}` has more than {MAX_ELEMENTS} elements", name.text);
                self.diagnostics.push(
                    Diagnostic::error(error)
                        .at(name.span, "this one")
                        .help("an array of this size is a `table` from a file"),
                );
            }
            values.len() <= MAX_ELEMENTS
        });
        let lookup = array.map(|values| {
            let array = Array { name: name.text.to_string(), values };
            self.graph.add_array(Arc::new(array))
        });
        self.arrays.insert(name.text.clone(), lookup);
    }

    /// Declares a `curve` or a `table`.
    pub fn define_curve(&mut self, item: &Item, span: Span, all: &Expressions, files: &dyn Files) {
        let (name, curve) = match item {
            Item::Curve { name, sort, points, periodic } => {
                let values: Option<Vec<[f64; 2]>> = (points.iter())
                    .map(|[x, y]| self.constant_value(all, *x).zip(self.constant_value(all, *y)))
                    .map(|point| point.map(|(x, y)| [x, y]))
                    .collect();
                let at = |i: usize| {
                    let [x, y] = points[i];
                    all.span(x.root).to(all.span(y.root))
                };
                let curve = values.and_then(|values| {
                    let made = Curve::new(&*name.text, *sort, &values, *periodic);
                    self.curve_or_error(name, span, &at, "point", made)
                });
                (name, curve)
            }
            Item::Function { name, file, item } => {
                (name, self.function_of_cpfg(name, file, item.as_ref(), files))
            }
            Item::Table { name, sort, file, column, periodic } => {
                let read = table::read(&file.text, column.as_ref().map(|c| c.text.as_str()), files);
                let curve = match read {
                    Ok(rows) => {
                        let points: Vec<[f64; 2]> = rows.iter().map(|row| row.point).collect();
                        let lines: Vec<usize> = rows.iter().map(|row| row.line).collect();
                        let made = Curve::new(&*name.text, *sort, &points, *periodic);
                        self.curve_of_file(name, span, file, &lines, ("table", "row"), made)
                    }
                    Err(fault) => {
                        let at =
                            if fault.of_column { column.as_ref().unwrap_or(file).span } else { file.span };
                        self.unreadable(name, (file, at), "table", fault)
                    }
                };
                (name, curve)
            }
            _ => return,
        };
        let lookup = curve.map(|curve| self.graph.add_curve(Arc::new(curve)));
        self.curves.insert(name.text.clone(), lookup);
    }

    /// `curve g from "g.func"`
    fn function_of_cpfg(
        &mut self,
        name: &Name,
        file: &Text,
        item: Option<&Text>,
        files: &dyn Files,
    ) -> Option<Curve> {
        match functions::read(&file.text, &name.text, item.map(|i| i.text.as_str()), files) {
            Ok(points) => {
                let values: Vec<[f64; 2]> = points.iter().map(|row| row.point).collect();
                let lines: Vec<usize> = points.iter().map(|row| row.line).collect();
                let made = Curve::new(&*name.text, Sort::Spline, &values, false);
                self.curve_of_file(name, file.span, file, &lines, ("function", "control point"), made)
            }
            Err(fault) => {
                let at = if fault.of_column { item.unwrap_or(file).span } else { file.span };
                self.unreadable(name, (file, at), "function", fault)
            }
        }
    }

    /// A curve of points from a file; `lines` are their lines there, `words` the words for the whole and for a point.
    fn curve_of_file(
        &mut self,
        name: &Name,
        span: Span,
        file: &Text,
        lines: &[usize],
        (whole, point): (&str, &str),
        made: Result<Curve, CurveError>,
    ) -> Option<Curve> {
        let (line, what, help) = match made {
            Err(CurveError::NotAscending(i)) => (
                lines[i],
                "its first number is less than the one before",
                "the first column is the argument, and must ascend",
            ),
            Err(CurveError::Crowded(i)) => (lines[i], "it is the third with this argument", JUMP),
            Err(CurveError::JumpAtEnd(i)) => (lines[i], "a jump at the end of the curve", END),
            made => return self.curve_or_error(name, span, &|_| file.span, point, made),
        };
        let fault = TableError::new(Some(line), what, help);
        self.unreadable(name, (file, file.span), whole, fault)
    }

    fn unreadable(
        &mut self,
        name: &Name,
        (file, at): (&Text, Span),
        whole: &str,
        fault: TableError,
    ) -> Option<Curve> {
        let place = match fault.line {
            Some(line) => format!("{}, line {line}: {}", file.text, fault.what),
            None => fault.what,
        };
        self.diagnostics.push(
            Diagnostic::error(format!("the {whole} `{}` cannot be read", name.text))
                .at(at, place)
                .help_opt(fault.help),
        );
        None
    }

    fn curve_or_error(
        &mut self,
        name: &Name,
        span: Span,
        at: &dyn Fn(usize) -> Span,
        what: &str,
        made: Result<Curve, CurveError>,
    ) -> Option<Curve> {
        let error = Diagnostic::error(format!("these {what}s make no curve"));
        let error = match made {
            Ok(curve) => return Some(curve),
            Err(CurveError::TooFew(least)) => error
                .at(span, format!("`{}` needs {least} {what}s or more", name.text))
                .help("a spline has four control points or more, a periodic curve three points, any other two"),
            Err(CurveError::TooMany) => error
                .at(name.span, format!("more than {MAX_POINTS} {what}s"))
                .help("every tenth will show the same course"),
            Err(CurveError::NotAscending(i)) => error
                .at(at(i), "its x is less than that of the point before")
                .at(at(i - 1), "the point before")
                .help("order the points by x; two points with the same x are a jump there"),
            Err(CurveError::Crowded(i)) => {
                error.at(at(i), "the third point with this x").at(at(i - 2), "the first one").help(JUMP)
            }
            Err(CurveError::JumpAtEnd(i)) => error.at(at(i), "a jump at the end of the curve").help(END),
            Err(CurveError::NotClosed { first, last }) => error
                .at(span, format!("it begins with {first} and ends with {last}"))
                .help(format!(
                    "a periodic curve ends, one period later, with the value that it begins with: end it with (…, {first})"
                )),
            Err(CurveError::TooLarge) => error
                .at(span, "its slopes or areas are greater than any number")
                .help("choose units in which the numbers are of moderate size"),
            Err(other) => error.at(span, other.to_string()),
        };
        self.diagnostics.push(error);
        None
    }

    /// True for `slope` and its like, unless the model declares a function of that name.
    pub(super) fn is_functional(&self, name: &str) -> bool {
        FUNCTIONALS.iter().any(|(n, _)| *n == name)
            && !self.functions.contains_key(name)
            && !self.curves.contains_key(name)
    }

    /// The nodes of an expression that are first arguments of `slope` and its like: names and not values.
    pub(super) fn functional_names(&self, all: &Expressions, expression: Expression) -> FxHashSet<ExprId> {
        (expression.first.0..=expression.root.0)
            .filter_map(|id| match all.get(ExprId(id)) {
                Expr::Call(name, arguments) if self.is_functional(name) => arguments.first().copied(),
                _ => None,
            })
            .filter(|id| matches!(all.get(*id), Expr::Name(_)))
            .collect()
    }

    /// Lowers `slope(g, x)` and its like: `first` is the name, `rest` the other arguments.
    pub(super) fn functional(
        &mut self,
        all: &Expressions,
        what: &str,
        span: Span,
        first: Option<ExprId>,
        rest: &[(ExprId, Lowered)],
    ) -> Option<Lowered> {
        let mut nodes = Vec::with_capacity(rest.len());
        for &(id, lowered) in rest {
            nodes.push(self.expect_number(all, id, lowered)?);
        }
        let form = FUNCTIONALS.iter().find(|(n, _)| *n == what).map_or("", |(_, form)| form);
        let Some((Expr::Name(name), at)) = first.map(|id| (all.get(id), all.span(id))) else {
            let error = Diagnostic::error(format!("`{what}` begins with a name"));
            let thing = if what == "length" { "an array" } else { "a curve or a function" };
            let at = first.map_or(span, |id| all.span(id));
            self.diagnostics.push(
                error.at(at, format!("expected the name of {thing}")).help(format!("it is written `{form}`")),
            );
            return None;
        };
        let node = if what == "length" {
            let array = self.known_array(name, at)?;
            self.arguments(what, span, nodes.len(), 0)?;
            let length = self.graph.array_of(array).values.len();
            self.graph.constant(length as f64)
        } else if let Some(curve) = self.curves.get(name).copied() {
            self.used.insert(name.clone());
            self.arguments(what, span, nodes.len(), if what == "integral" { 2 } else { 1 })?;
            self.of_curve(what, curve?, &nodes, at)?
        } else {
            self.of_function(what, name, &nodes, span, at)?
        };
        Some(Lowered { node, is_condition: false })
    }

    fn arguments(&mut self, what: &str, span: Span, given: usize, wanted: usize) -> Option<()> {
        if given == wanted {
            return Some(());
        }
        let form = FUNCTIONALS.iter().find(|(name, _)| *name == what);
        self.diagnostics.push(
            Diagnostic::error(format!(
                "`{what}` has {} here, not {}",
                plural(wanted + 1, "argument"),
                given + 1
            ))
            .at(span, format!("{} given", plural(given + 1, "argument")))
            .help_opt(
                form.map(|(_, form)| {
                    format!("it is written `{form}`; of a function the other arguments follow")
                }),
            ),
        );
        None
    }

    fn of_curve(&mut self, what: &str, curve: Lookup, nodes: &[NodeId], at: Span) -> Option<NodeId> {
        match what {
            "slope" => Some(self.graph.curve(curve, Part::Slope, nodes[0])),
            "integral" => {
                let [from, to] = [0, 1].map(|i| self.graph.curve(curve, Part::Integral, nodes[i]));
                Some(self.graph.binary(Binary::Sub, to, from))
            }
            _ => {
                let known = self.graph.curve_of(curve).clone();
                if known.direction().is_some() {
                    return Some(self.graph.curve(curve, Part::Inverse, nodes[0]));
                }
                let why = match known.periodic {
                    true => "it is periodic: it takes each value again and again",
                    false => "it is not monotone: it takes some value more than once",
                };
                self.diagnostics.push(
                    Diagnostic::error(format!("the curve `{}` has no inverse", known.name))
                        .at(at, why)
                        .help("only a curve whose points rise throughout, or fall throughout, has one; an event `if g(age) = y …` needs none"),
                );
                None
            }
        }
    }

    fn of_function(
        &mut self,
        what: &str,
        name: &Arc<str>,
        nodes: &[NodeId],
        span: Span,
        at: Span,
    ) -> Option<NodeId> {
        let Some(function) = self.functions.get(name).cloned() else {
            return self.no_such_function(what, name, at);
        };
        self.used.insert(name.clone());
        if !function.draws.is_empty() {
            self.diagnostics.push(
                Diagnostic::error(format!("`{name}` draws a random number: it has no {what}"))
                    .at(at, "another value at each call is no function of its arguments")
                    .help("draw the number in a successor, and hand it to the function as a parameter"),
            );
            return None;
        }
        let ends = usize::from(what == "integral");
        self.arguments(what, span, nodes.len(), function.parameters.len() + ends)?;
        let related =
            function.library.then(|| self.functions.get(&*format!("{name}_{what}")).cloned()).flatten();
        match (what, related) {
            ("slope", Some(slope)) => {
                let slope = self.inline(&slope, nodes, span)?.node;
                let whole = self.inline(&function, nodes, span)?.node;
                self.graph.know_integral(slope, Integral { whole, argument: nodes[0] });
                Some(slope)
            }
            ("slope", None) => {
                let body = function.body?.node;
                let node = self.graph.derivative(body, FORMAL);
                let body = Some(Lowered { node, is_condition: false });
                let slope = crate::scope::Function { body, ..function.clone() };
                let (slope, whole) =
                    (self.inline(&slope, nodes, span)?, self.inline(&function, nodes, span)?);
                let integral = Integral { whole: whole.node, argument: nodes[0] };
                // The integral of the slope does not contain the jumps of the function.
                if self.is_smooth(integral.whole) {
                    self.graph.know_integral(slope.node, integral);
                }
                Some(slope.node)
            }
            ("integral", Some(integral)) => {
                let at = |me: &mut Scope, i: usize| {
                    let arguments: Vec<NodeId> =
                        std::iter::once(nodes[i]).chain(nodes[2..].iter().copied()).collect();
                    me.inline(&integral, &arguments, span).map(|whole| whole.node)
                };
                let (from, to) = (at(self, 0)?, at(self, 1)?);
                Some(self.graph.binary(Binary::Sub, to, from))
            }
            ("inverse", Some(inverse)) => Some(self.inline(&inverse, nodes, span)?.node),
            _ => {
                let mut error = Diagnostic::error(format!("no formula is known for the {what} of `{name}`"))
                    .at(at, "only for curves, and for functions of the library that have one");
                error = error.help(if what == "integral" {
                    format!("integrate it with an equation of its own: `solve dy/dt = {name}(…)`")
                } else {
                    format!("an event finds the time without it: `if {name}(…) = y produce …`")
                });
                self.diagnostics.push(error);
                None
            }
        }
    }

    /// True if an expression has neither jumps nor kinks.
    fn is_smooth(&self, root: NodeId) -> bool {
        use dlsys_expr::Node;
        !self.graph.reachable(&[root]).into_iter().any(|id| match self.graph.node(id) {
            Node::Select(..)
            | Node::Binary(Binary::Min | Binary::Max | Binary::Atan2, ..)
            | Node::Element(..) => true,
            Node::Unary(op, _) => {
                matches!(op, Unary::Abs | Unary::Sign | Unary::Floor | Unary::Ceil | Unary::Tan)
            }
            _ => false,
        })
    }

    fn no_such_function(&mut self, what: &str, name: &Arc<str>, at: Span) -> Option<NodeId> {
        if self.poisoned.contains(name) || !self.unknown.insert(name.clone()) {
            return None;
        }
        let known = self.curves.keys().chain(self.functions.keys()).filter(|_| self.suggests()).map(|n| &**n);
        let near = did_you_mean(name, known.chain(dlsys_syntax::library_names()));
        let error = Diagnostic::error(format!("`{name}` is no curve and no function of this model"));
        let help = near.or_else(|| Some(format!("declare it: `curve {name} = (0, 0) (1, 0.3) (2, 1)`")));
        self.diagnostics.push(error.at(at, format!("`{what}` needs a curve or a function")).help_opt(help));
        None
    }

    /// Notes the integral of a function of the library at a use of its value.
    pub(super) fn know_library_integral(&mut self, name: &str, of: NodeId, nodes: &[NodeId], span: Span) {
        let Some(integral) = self.functions.get(&*format!("{name}_integral")).cloned() else { return };
        if let (Some(whole), Some(&argument)) = (self.inline(&integral, nodes, span), nodes.first()) {
            self.graph.know_integral(of, Integral { whole: whole.node, argument });
        }
    }

    fn known_array(&mut self, name: &Arc<str>, at: Span) -> Option<Lookup> {
        if let Some(array) = self.arrays.get(name).copied() {
            self.used.insert(name.clone());
            return array;
        }
        if self.poisoned.contains(name) || !self.unknown.insert(name.clone()) {
            return None;
        }
        let near = did_you_mean(name, self.arrays.keys().filter(|_| self.suggests()).map(|n| &**n));
        let help = near.or_else(|| Some(format!("declare it: `const {name} = [1, 2, 3]`")));
        self.diagnostics.push(
            Diagnostic::error(format!("there is no array `{name}`"))
                .at(at, "only arrays have elements")
                .help_opt(help),
        );
        None
    }

    /// Lowers `a[i]`.
    pub(super) fn element(&mut self, name: &Arc<str>, index: NodeId, span: Span) -> Option<NodeId> {
        let array = self.known_array(name, span)?;
        let known = self.graph.array_of(array).clone();
        if let Some(i) = self.graph.as_constant(index)
            && known.element(i).is_nan()
        {
            self.diagnostics.push(
                Diagnostic::error(format!("the array `{name}` has no element {i}"))
                    .at(span, format!("it has {}", plural(known.values.len(), "element")))
                    .help(format!(
                        "elements are counted from 0: the last one is `{name}[{}]`",
                        known.values.len() - 1
                    )),
            );
            return None;
        }
        let index = self.graph.unary(Unary::Floor, index);
        Some(self.graph.element(array, index))
    }
}
