//! Calls of functions: built-in ones, and those of the library and of the model, which are expanded.

use std::sync::Arc;

use crate::advice;
use crate::air;
use crate::chance::DRAW;
use crate::land;
use crate::scope::{FORMAL, Function, Lowered, Scope, Variables, plural};
use dlsys_diagnostic::{Diagnostic, Span};
use dlsys_expr::{Binary, Integral, Node, NodeId, Part, Unary};
use dlsys_model::Distribution;
use dlsys_syntax::ast::{ExprId, Expressions};
use dlsys_syntax::suggest::did_you_mean;
use dlsys_syntax::{foreign_syntax, print};

/// Maximum number of nodes to which the functions of a model may expand.
const MAX_WORK: usize = 20_000_000;
/// Maximum number of nodes of a function that is called. Functions that call one another twice reach it after a few
/// levels; a body written by hand does not.
const MAX_BODY: usize = 200_000;

/// A call as it is written, with its lowered arguments.
pub(super) struct Call<'c> {
    pub all: &'c Expressions,
    pub name: &'c Arc<str>,
    pub span: Span,
    pub arguments: &'c [(ExprId, Lowered)],
}

impl Scope {
    /// Lowers a call of a function of the model, of the library or of the language.
    pub(super) fn call(&mut self, call: &Call, variables: &Variables) -> Option<Lowered> {
        let Call { all, name, span, arguments } = *call;
        let mut nodes = Vec::with_capacity(arguments.len());
        for &(id, lowered) in arguments {
            nodes.push(self.expect_number(all, id, lowered)?);
        }
        let count = |me: &mut Scope, wanted: usize| {
            if nodes.len() == wanted {
                return Some(());
            }
            me.diagnostics.push(
                Diagnostic::error(format!(
                    "`{name}` has {}, not {}",
                    plural(wanted, "parameter"),
                    nodes.len()
                ))
                .at(span, format!("{} given", plural(nodes.len(), "argument")))
                .help(
                    match (&**name, advice::decimal_comma(all, arguments.iter().map(|a| a.0), wanted)) {
                        (_, Some(meant)) => format!("the decimal sign is a point: `{name}({meant})`"),
                        ("min" | "max", _) if nodes.len() > 2 => {
                            let texts: Vec<String> =
                                arguments.iter().map(|(id, _)| print::expression(all, *id)).collect();
                            let nested = |inner: String, next: &String| format!("{name}({inner}, {next})");
                            format!("write `{}`", texts[1..].iter().fold(texts[0].clone(), nested))
                        }
                        _ => format!("it is called as `{}`", me.call_of(name)),
                    },
                ),
            );
            None
        };
        let number = |node| Some(Lowered { node, is_condition: false });
        if let Some(function) = self.functions.get(name).cloned() {
            self.used.insert(name.clone());
            count(self, function.parameters.len())?;
            if !function.draws.is_empty() {
                self.may_draw(name, span)?;
            }
            let whole = self.inline(&function, &nodes, span)?;
            if function.library {
                self.know_library_integral(name, whole.node, &nodes, span);
            }
            return Some(whole);
        }
        if let Some(curve) = self.curves.get(name).copied() {
            self.used.insert(name.clone());
            count(self, 1)?;
            return number(self.graph.curve(curve?, Part::Value, nodes[0]));
        }
        if let Some((_, op)) = Unary::NAMED.iter().find(|(n, _)| **n == **name) {
            count(self, 1)?;
            self.doubt_degrees(call, *op, nodes[0]);
            return number(self.graph.unary(*op, nodes[0]));
        }
        if let Some((_, op)) = Binary::NAMED.iter().find(|(n, _)| **n == **name) {
            count(self, 2)?;
            return number(self.graph.binary(*op, nodes[0], nodes[1]));
        }
        if let Some(component) = air::FUNCTIONS.iter().position(|known| *known == &**name)
            && !self.constants.contains_key(name)
        {
            count(self, 3)?;
            return number(self.flow(component, span, [nodes[0], nodes[1], nodes[2]], variables)?);
        }
        if &**name == land::FUNCTION && !self.constants.contains_key(name) {
            count(self, 2)?;
            return number(self.ground(span, [nodes[0], nodes[1]], variables)?);
        }
        if let Some(distribution) = Distribution::named(name) {
            return self.draw(distribution, span, nodes);
        }
        self.unknown_function(call, variables);
        None
    }

    /// Warns of the sine of a constant that looks like degrees, which are what functions of cpfg take.
    fn doubt_degrees(&mut self, call: &Call, op: Unary, argument: NodeId) {
        let Some(angle) = self.graph.as_constant(argument) else { return };
        // More than a full turn, in steps that no sum of parts of π has.
        let is_of_degrees = angle.abs() > std::f64::consts::TAU && (2.0 * angle).fract() == 0.0;
        let known =
            self.diagnostics.iter().any(|known| known.labels.iter().any(|(span, _)| *span == call.span));
        if !matches!(op, Unary::Sin | Unary::Cos | Unary::Tan) || !is_of_degrees || known {
            return;
        }
        let Call { all, name, span, arguments } = *call;
        let text = print::expression(all, arguments[0].0);
        let is_simple = text.chars().all(|c| c.is_alphanumeric() || matches!(c, '_' | '.'));
        let factor = if is_simple { text.clone() } else { format!("({text})") };
        let turns = (angle / std::f64::consts::TAU).round();
        let sign = if turns < 0.0 { '+' } else { '-' };
        let degrees = (angle.to_degrees() * 10.0).round() / 10.0;
        self.diagnostics.push(
            Diagnostic::warning(format!("`{name}` takes radians"))
                .at(span, format!("of {degrees} degrees; in cpfg of {angle} degrees"))
                .help(format!("for degrees, write `{name}({factor}*pi/180)`"))
                .help(format!(
                    "for radians, leave out whole turns: `{name}({text} {sign} {}*pi)`",
                    2.0 * turns.abs()
                )),
        );
    }

    /// Reports a function without a declaration, once for each name.
    fn unknown_function(&mut self, call: &Call, variables: &Variables) {
        let Call { all, name, span, arguments } = *call;
        if self.poisoned.contains(name) || !self.unknown.insert(name.clone()) {
            return;
        }
        let built_in = Unary::NAMED.iter().map(|(n, _)| *n).chain(Binary::NAMED.iter().map(|(n, _)| *n));
        let own = self.functions.keys().chain(self.curves.keys()).filter(|_| self.suggests());
        let built_in = built_in.chain(Distribution::NAMED.iter().map(|(n, ..)| *n));
        let built_in = built_in.chain(air::FUNCTIONS).chain([land::FUNCTION]);
        let known = own.map(|n| &**n).chain(built_in).chain(dlsys_syntax::library_names());
        let mut error =
            Diagnostic::error(format!("unknown function `{name}`")).at(span, "no function has this name");
        let texts = || arguments.iter().map(|(id, _)| print::expression(all, *id)).collect::<Vec<_>>();
        let elsewhere = self.in_a_comment(name).or_else(|| foreign_syntax::function(name, &texts()));
        error = match elsewhere.or_else(|| did_you_mean(name, known)) {
            _ if &**name == "log" => error.help("the natural logarithm is `ln`, the decimal one `log10`"),
            Some(help) => error.help(help),
            None if self.arrays.contains_key(name) => {
                error.help(format!("`{name}` is an array, and its elements are written `{name}[i]`"))
            }
            None if self.constants.contains_key(name) || variables.names.contains_key(name) => {
                error.help(format!("to multiply, write `{name}*(…)`"))
            }
            None => error.help(format!("declare it: `def {name}(…) = …`")),
        };
        self.diagnostics.push(error);
    }

    /// Help for a name that only a comment such as `#define` defines.
    pub(super) fn in_a_comment(&self, name: &str) -> Option<String> {
        self.commented.get(name).map(|meaning| foreign_syntax::of_definition(name, meaning))
    }

    /// The notation of a call of a function.
    pub(super) fn call_of(&self, name: &str) -> String {
        match self.functions.get(name) {
            Some(function) => format!("{name}({})", function.parameters.join(", ")),
            None if Binary::NAMED.iter().any(|(n, _)| *n == name) => format!("{name}(x, y)"),
            None if air::FUNCTIONS.contains(&name) => format!("{name}(x, y, z)"),
            None if name == land::FUNCTION => format!("{name}(x, z)"),
            None => format!("{name}(x)"),
        }
    }

    /// The body of a function with the arguments substituted for its formal parameters.
    pub(super) fn inline(
        &mut self,
        function: &Function,
        arguments: &[NodeId],
        span: Span,
    ) -> Option<Lowered> {
        let (body, draws) = (function.body?, function.draws.clone());
        let size = self.graph.reachable(&[body.node]).len() + draws.len();
        self.work += size;
        if self.work > MAX_WORK || size > MAX_BODY {
            if self.work < usize::MAX / 2 {
                self.work = usize::MAX / 2;
                self.diagnostics.push(
                    Diagnostic::error("the functions of this model expand without bound")
                        .at(
                            span,
                            format!(
                                "more than {} operations",
                                if size > MAX_BODY { MAX_BODY } else { MAX_WORK }
                            ),
                        )
                        .help("a function that calls another twice doubles it; compute a shared part once"),
                );
            }
            return None;
        }
        let formal = |v: u32| (FORMAL..DRAW).contains(&v).then(|| arguments[(v - FORMAL) as usize]);
        let drawn = self.draw_again(draws, &formal)?;
        let comparisons = &self.function_comparisons;
        let mut moved = Vec::new();
        let known = function.integrals.iter().flat_map(|(of, i)| [*of, i.whole, i.argument]);
        let roots: Vec<NodeId> = std::iter::once(body.node).chain(known).collect();
        let images = self.graph.rewrite(&roots, |graph, id, node| {
            let image = match node {
                Node::Var(v) if v >= DRAW => return drawn.get(&v).copied(),
                Node::Var(v) => return formal(v),
                Node::Binary(op @ (Binary::Lt | Binary::Le | Binary::Eq | Binary::Ne), a, b) => {
                    graph.binary(op, a, b)
                }
                _ => return None,
            };
            if let Some(at) = comparisons.get(&id) {
                moved.push((image, at.clone()));
            }
            Some(image)
        });
        for integral in images[1..].chunks(3) {
            let [of, whole, argument] = integral[..] else { unreachable!("threes") };
            self.graph.know_integral(of, Integral { whole, argument });
        }
        let node = images[0];
        for (image, at) in moved {
            self.comparisons.entry(image).or_insert(at);
        }
        Some(Lowered { node, is_condition: body.is_condition })
    }
}
