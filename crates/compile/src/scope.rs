//! Constants, parameters and functions of a model, and the lowering of expressions to the graph.

use std::ops::Range;
use std::sync::Arc;

use rustc_hash::{FxHashMap, FxHashSet};

use crate::advice;
use crate::air::{self, Air};
use crate::call::Call;
use crate::chance::Draws;
use crate::conditions::Sides;
use crate::inputs;
use crate::land::{self, Land};
use dlsys_diagnostic::{Diagnostic, Span};
use dlsys_expr::{Binary, Graph, Integral, Lookup, NodeId, NodeMap, Unary};
use dlsys_model::{Comparison, Fold, Quantity};
use dlsys_syntax::ast::{Aggregate, Expr, ExprId, Expression, Expressions, HeadModule, Name, Operator};
use dlsys_syntax::print;
use dlsys_syntax::suggest::did_you_mean;

/// Variables from this number on are parameters of functions.
pub(super) const FORMAL: u32 = 1 << 24;

/// Names with a fixed meaning in every rule.
pub const RESERVED: [&str; 2] = ["t", "age"];
const CONSTANTS: [(&str, f64); 2] = [("pi", std::f64::consts::PI), ("e", std::f64::consts::E)];

/// A lowered expression: a number, or a condition.
#[derive(Clone, Copy, Debug)]
pub struct Lowered {
    pub node: NodeId,
    pub is_condition: bool,
}

/// A function, as a graph over its formal parameters.
#[derive(Clone, Debug)]
pub(super) struct Function {
    pub parameters: Vec<Arc<str>>,
    /// None if it has errors, which have been reported.
    pub body: Option<Lowered>,
    /// The random numbers that its body draws.
    pub draws: Range<u32>,
    /// True for a function of the library.
    pub library: bool,
    /// Parts of the body with a known antiderivative.
    pub integrals: Vec<(NodeId, Integral)>,
}

/// The names that an expression can use in addition to the global ones.
#[derive(Clone, Default)]
pub struct Variables {
    pub names: FxHashMap<Arc<str>, NodeId>,
    /// Help for `t` or `age` in an expression without them; None if they are in `names`.
    pub no_time: Option<&'static str>,
    /// Names and places of all `let` lines of the rule, including those not yet lowered.
    pub lets: FxHashMap<Arc<str>, Span>,
    /// In a rule: the variable of its first aggregate, and the number of all its variables.
    pub aggregates: Option<(u32, u32)>,
}

/// An aggregate of the current rule.
pub struct Gathered {
    pub fold: Fold,
    pub head: HeadModule,
    /// The parameters of the child are variables from the number of the rule's variables on.
    pub term: NodeId,
}

/// The global names of a model and the graph of its expressions.
#[derive(Default)]
pub struct Scope {
    pub graph: Graph,
    /// Values; None if the declaration has errors, which have been reported.
    pub(super) constants: FxHashMap<Arc<str>, Option<f64>>,
    pub(super) functions: FxHashMap<Arc<str>, Function>,
    /// None if the declaration has errors, as for constants.
    pub(super) curves: FxHashMap<Arc<str>, Option<Lookup>>,
    pub(super) arrays: FxHashMap<Arc<str>, Option<Lookup>>,
    /// Global names that some expression has used.
    pub used: FxHashSet<Arc<str>>,
    pub(super) poisoned: FxHashSet<Arc<str>>,
    /// Unknown names that have been reported.
    pub(super) unknown: FxHashSet<Arc<str>>,
    /// Place and text of the comparisons of the current rule, by node. Rules number their variables alike, so that the nodes
    /// of one rule are not valid in another.
    pub comparisons: NodeMap<(Span, Arc<Sides>)>,
    /// The aggregates of the current rule, in the order of their variables.
    pub gathered: Vec<Gathered>,
    /// Place and text of the comparisons in the bodies of functions, by node.
    pub(super) function_comparisons: NodeMap<(Span, Arc<Sides>)>,
    pub diagnostics: Vec<Diagnostic>,
    /// Names that only comments define, with their values.
    pub(super) commented: FxHashMap<Arc<str>, String>,
    pub draws: Draws,
    /// The wind, if the model declares one.
    pub air: Option<Air>,
    /// The ground.
    pub land: Land,
    /// Errors in the settings, as opposed to the text.
    pub refused_settings: Vec<Diagnostic>,
    pub(super) work: usize,
}

impl Scope {
    /// True if a model cannot declare a name, because it is built in.
    pub fn is_built_in(name: &str) -> bool {
        RESERVED.contains(&name)
            || CONSTANTS.iter().any(|(n, _)| *n == name)
            || Unary::NAMED.iter().any(|(n, _)| *n == name)
            || Binary::NAMED.iter().any(|(n, _)| *n == name)
    }

    pub fn define_constant(&mut self, name: Arc<str>, value: Option<f64>) {
        self.constants.insert(name, value);
    }

    /// True while suggestions are computed: each compares all known names, so they are omitted after many
    /// errors.
    pub(super) fn suggests(&self) -> bool {
        self.diagnostics.len() < 50
    }

    /// Marks a name whose declaration has errors, which have been reported; its uses are not reported.
    pub fn poison(&mut self, name: Arc<str>) {
        self.poisoned.insert(name);
    }

    /// Lowers the body of a function and declares it.
    pub fn define_function(
        &mut self,
        name: &Name,
        parameters: &[Name],
        all: &Expressions,
        body: Expression,
        library: bool,
    ) {
        let mut variables = Variables {
            no_time: Some("a function sees only its parameters: pass it on, as in `G(x, age)`"),
            ..Variables::default()
        };
        for (i, parameter) in parameters.iter().enumerate() {
            let formal = self.graph.var(FORMAL + i as u32);
            if variables.names.insert(parameter.text.clone(), formal).is_some() {
                self.diagnostics.push(
                    Diagnostic::error(format!(
                        "`{}` has two parameters called `{}`",
                        name.text, parameter.text
                    ))
                    .at(parameter.span, "the second one")
                    .help(format!(
                        "give each a name of its own, such as `{}`",
                        advice::numbered(&parameter.text)
                    )),
                );
            }
        }
        let first = self.draws.all.len() as u32;
        // Calls check whether draws are allowed.
        self.draws.allowed = true;
        let body = self.lower(all, body, &variables);
        self.draws.allowed = false;
        self.function_comparisons.extend(self.comparisons.drain());
        let draws = first..self.draws.all.len() as u32;
        let parameters = parameters.iter().map(|p| p.text.clone()).collect();
        let integrals = body.map_or_else(Vec::new, |body| {
            let parts = self.graph.reachable(&[body.node]);
            self.graph.noted_integrals(&parts)
        });
        let function = Function { parameters, body, draws, library, integrals };
        self.functions.insert(name.text.clone(), function);
    }

    /// Lowers an expression that must be a number.
    pub fn number(
        &mut self,
        all: &Expressions,
        expression: Expression,
        variables: &Variables,
    ) -> Option<NodeId> {
        let lowered = self.lower(all, expression, variables)?;
        self.expect_number(all, expression.root, lowered)
    }

    /// Lowers an expression that must be a condition.
    pub fn condition(
        &mut self,
        all: &Expressions,
        expression: Expression,
        variables: &Variables,
    ) -> Option<NodeId> {
        let lowered = self.lower(all, expression, variables)?;
        self.expect(all, expression.root, lowered, true)
    }

    /// The value of an expression of constants.
    pub fn constant_value(&mut self, all: &Expressions, expression: Expression) -> Option<f64> {
        let variables = Variables { no_time: Some("only constants can stand here"), ..Variables::default() };
        let node = self.number(all, expression, &variables)?;
        let value = self.graph.as_constant(node).expect("without variables everything is folded");
        if value.is_finite() {
            return Some(value);
        }
        self.diagnostics.push(
            Diagnostic::error("this has no finite value")
                .at(all.span(expression.root), format!("it is {value}"))
                .help(advice::not_finite(value)),
        );
        None
    }

    pub(super) fn expect_number(
        &mut self,
        all: &Expressions,
        id: ExprId,
        lowered: Lowered,
    ) -> Option<NodeId> {
        self.expect(all, id, lowered, false)
    }

    /// The node of a condition, or of a number; the other of the two is an error.
    fn expect(&mut self, all: &Expressions, id: ExprId, lowered: Lowered, condition: bool) -> Option<NodeId> {
        if lowered.is_condition == condition {
            return Some(lowered.node);
        }
        let (wanted, given, help) = match condition {
            true => ("a condition", "a number", "compare it with something, as in `x > 0`"),
            false => ("a number", "a condition", "a condition becomes a number with `if … then 1 else 0`"),
        };
        self.diagnostics.push(
            Diagnostic::error(format!("{wanted} is expected here"))
                .at(all.span(id), format!("this is {given}"))
                .help(help),
        );
        None
    }

    /// Lowers an expression. None if it has errors, which have been reported.
    fn lower(&mut self, all: &Expressions, expression: Expression, variables: &Variables) -> Option<Lowered> {
        let (first, last) = (expression.first.0, expression.root.0);
        // Operands precede their users, so this is a loop for any depth of the expression.
        let mut done: Vec<Option<Lowered>> = Vec::with_capacity((last - first + 1) as usize);
        let named = self.functional_names(all, expression);
        let inside = terms(all, first, last);
        for id in first..=last {
            // The term of an aggregate has names of its own and is lowered with the aggregate.
            let inside = inside.get((id - first) as usize).is_some_and(|inside| *inside);
            if inside || named.contains(&ExprId(id)) {
                done.push(None);
                continue;
            }
            let lowered = self.lower_node(all, ExprId(id), variables, |o| done[(o.0 - first) as usize]);
            done.push(lowered);
        }
        done.pop().flatten()
    }

    fn lower_node(
        &mut self,
        all: &Expressions,
        id: ExprId,
        variables: &Variables,
        done: impl Fn(ExprId) -> Option<Lowered>,
    ) -> Option<Lowered> {
        let number = |node| Some(Lowered { node, is_condition: false });
        let condition = |node| Some(Lowered { node, is_condition: true });
        let span = all.span(id);
        match all.get(id) {
            Expr::Number(x) => number(self.graph.constant(*x)),
            Expr::Name(name) => number(self.name(name, span, variables)?),
            Expr::Call(name, arguments) => {
                let functional = self.is_functional(name);
                let mut nodes = Vec::with_capacity(arguments.len());
                for &argument in arguments.iter().skip(usize::from(functional)) {
                    nodes.push((argument, done(argument)?));
                }
                match functional {
                    true => self.functional(all, name, span, arguments.first().copied(), &nodes),
                    false => self.call(&Call { all, name, span, arguments: &nodes }, variables),
                }
            }
            Expr::Index(name, index) => {
                let index = self.expect_number(all, *index, done(*index)?)?;
                number(self.element(name, index, span)?)
            }
            Expr::Match(subject, cases, otherwise) => {
                number(self.choice(all, (*subject, cases, *otherwise), done)?)
            }
            Expr::Parenthesis(a) => done(*a),
            Expr::Aggregate(aggregate) => number(self.aggregate(all, aggregate, span, variables)?),
            Expr::Negate(a) => {
                let a = self.expect_number(all, *a, done(*a)?)?;
                number(self.graph.unary(Unary::Neg, a))
            }
            Expr::Not(a) => {
                let a = self.expect(all, *a, done(*a)?, true)?;
                condition(self.graph.unary(Unary::Not, a))
            }
            Expr::Scale(factor, a) => {
                let a = self.expect_number(all, *a, done(*a)?)?;
                let factor = self.graph.constant(*factor);
                number(self.graph.binary(Binary::Mul, factor, a))
            }
            Expr::Binary(operator @ (Operator::And | Operator::Or), a, b) => {
                let (left, right) = (done(*a)?, done(*b)?);
                let left = self.expect(all, *a, left, true);
                let right = self.expect(all, *b, right, true);
                let op = if *operator == Operator::And { Binary::And } else { Binary::Or };
                condition(self.graph.binary(op, left?, right?))
            }
            Expr::Binary(operator, a, b) => {
                let (left, right) = (done(*a)?, done(*b)?);
                let left = self.expect_number(all, *a, left);
                let right = self.expect_number(all, *b, right);
                let op = match operator {
                    Operator::Add => Binary::Add,
                    Operator::Sub => Binary::Sub,
                    Operator::Mul => Binary::Mul,
                    Operator::Div => Binary::Div,
                    _ => Binary::Pow,
                };
                number(self.graph.binary(op, left?, right?))
            }
            Expr::Compare(first, links) => condition(self.chain(all, *first, links, done)?),
            Expr::If(c, a, b) => {
                let (test, then, otherwise) = (done(*c)?, done(*a)?, done(*b)?);
                let test = self.expect(all, *c, test, true);
                let then = self.expect_number(all, *a, then);
                let otherwise = self.expect_number(all, *b, otherwise);
                number(self.graph.select(test?, then?, otherwise?))
            }
        }
    }

    /// `a < b <= c`: all links hold.
    fn chain(
        &mut self,
        all: &Expressions,
        first: ExprId,
        links: &[(Comparison, ExprId)],
        done: impl Fn(ExprId) -> Option<Lowered>,
    ) -> Option<NodeId> {
        let mut a = self.expect_number(all, first, done(first)?);
        let mut a_id = first;
        let mut whole: Option<NodeId> = None;
        for (comparison, operand) in links {
            let b = self.expect_number(all, *operand, done(*operand)?);
            let (Some(left), Some(right)) = (a, b) else { return None };
            let link = self.compare(*comparison, left, right);
            self.comparisons.entry(link).or_insert_with(|| {
                let written = [a_id, *operand].map(|id| print::expression(all, id));
                // A choice has the lowest precedence.
                let written = written.map(|s| if s.starts_with("if ") { format!("({s})") } else { s });
                // The graph has no `>`.
                let turned = matches!(comparison, Comparison::Greater | Comparison::GreaterOrEqual);
                (all.span(a_id).to(all.span(*operand)), Sides { written, turned }.into())
            });
            whole = Some(match whole {
                Some(before) => self.graph.binary(Binary::And, before, link),
                None => link,
            });
            (a, a_id) = (b, *operand);
        }
        whole
    }

    /// The variable of an aggregate.
    fn aggregate(
        &mut self,
        all: &Expressions,
        aggregate: &Aggregate,
        span: Span,
        variables: &Variables,
    ) -> Option<NodeId> {
        let Some((first, count)) = variables.aggregates else {
            let name = aggregate.fold.name();
            self.diagnostics.push(
                Diagnostic::error(format!("`{name}` has no meaning here"))
                    .at(span, "what is attached to a module is known in rules only")
                    .help(format!(
                        "write `{name}` in an equation, a condition or a successor, and hand its value on"
                    )),
            );
            return None;
        };
        let mut names = variables.names.clone();
        for (i, parameter) in aggregate.head.parameters.iter().enumerate() {
            let node = self.graph.var(count + i as u32);
            names.insert(parameter.text.clone(), node);
        }
        let inner = Variables { names, ..Variables::default() };
        let said = self.diagnostics.len();
        // The term is evaluated repeatedly, so it cannot contain numbers that are drawn once.
        let may_draw = std::mem::take(&mut self.draws.allowed);
        let term = match aggregate.term {
            Some(term) => self.number(all, term, &inner),
            None => Some(self.graph.constant(1.0)),
        };
        self.draws.allowed = may_draw;
        // A parameter that the head does not name.
        let said = self.diagnostics.get_mut(said).filter(|said| said.message.starts_with("unknown name"));
        if let (Some(said), true) = (said, aggregate.head.parameters.is_empty()) {
            let (fold, name) = (aggregate.fold.name(), &aggregate.head.name.text);
            said.help = vec![format!("parameters have their names in the aggregate: `{fold}({name}(x): x)`")];
        }
        let term = term?;
        let same = |known: &Gathered| {
            let names = known.head.name.text == aggregate.head.name.text
                && known.head.parameters.len() == aggregate.head.parameters.len();
            known.fold == aggregate.fold && known.term == term && names
        };
        let place = self.gathered.iter().position(same).unwrap_or_else(|| {
            let (fold, head) = (aggregate.fold, aggregate.head.clone());
            self.gathered.push(Gathered { fold, head, term });
            self.gathered.len() - 1
        });
        Some(self.graph.var(first + place as u32))
    }

    pub(super) fn compare(&mut self, comparison: Comparison, a: NodeId, b: NodeId) -> NodeId {
        match comparison {
            Comparison::Less => self.graph.binary(Binary::Lt, a, b),
            Comparison::LessOrEqual => self.graph.binary(Binary::Le, a, b),
            Comparison::Equal => self.graph.binary(Binary::Eq, a, b),
            Comparison::NotEqual => self.graph.binary(Binary::Ne, a, b),
            Comparison::GreaterOrEqual => self.graph.binary(Binary::Le, b, a),
            Comparison::Greater => self.graph.binary(Binary::Lt, b, a),
        }
    }

    fn name(&mut self, name: &Arc<str>, span: Span, variables: &Variables) -> Option<NodeId> {
        if let Some(&node) = variables.names.get(name) {
            return Some(node);
        }
        if let Some(value) = self.constants.get(name).copied() {
            self.used.insert(name.clone());
            return value.map(|x| self.graph.constant(x));
        }
        if let Some((_, value)) = CONSTANTS.iter().find(|(n, _)| **n == **name) {
            return Some(self.graph.constant(*value));
        }
        if self.poisoned.contains(name) || !self.unknown.insert(name.clone()) {
            return None;
        }
        let error = if RESERVED.contains(&&**name) {
            Diagnostic::error(format!("`{name}` has no meaning here"))
                .at(span, "time is known in rules only")
                .help(variables.no_time.unwrap_or("use it in a rule"))
        } else if let Some(quantity) = inputs::named(name) {
            inputs::misplaced(quantity, span)
        } else if self.curves.contains_key(name) {
            Diagnostic::error(format!("`{name}` is a curve"))
                .at(span, "a function of one number")
                .help(format!("give it its argument: `{name}(age)`"))
        } else if self.arrays.contains_key(name) {
            Diagnostic::error(format!("`{name}` is an array"))
                .at(span, "several numbers")
                .help(format!("give the number of an element, the first one being 0: `{name}[0]`"))
        } else if self.functions.contains_key(name) || is_function(name) {
            Diagnostic::error(format!("`{name}` is a function"))
                .at(span, "expected its arguments")
                .help(format!("call it: `{}`", self.call_of(name)))
        } else {
            let known = variables
                .names
                .keys()
                .filter(|_| self.suggests())
                .chain(self.constants.keys().filter(|_| self.suggests()))
                .map(|n| &**n)
                .chain(RESERVED.into_iter().filter(|_| variables.no_time.is_none()))
                .chain(std::iter::once("pi"))
                .chain(Quantity::NAMED.map(Quantity::name));
            let what = match variables.no_time {
                None => "this is no parameter of the rule and no constant",
                Some(_) => "this is no constant",
            };
            let help = self.in_a_comment(name).or_else(|| did_you_mean(name, known));
            Diagnostic::error(format!("unknown name `{name}`"))
                .at(span, what)
                .help(help.unwrap_or_else(|| format!("declare it: `const {name} = …`")))
        };
        let error = match variables.lets.get(name) {
            Some(later) => Diagnostic::error(format!("`{name}` is not known yet"))
                .at(span, "used here")
                .at(*later, "declared here")
                .help("a `let` is known only to the lines after it: change their order"),
            None => error,
        };
        self.diagnostics.push(error);
        None
    }
}

/// By node of an expression: true if it belongs to the term of an aggregate; empty without aggregates.
fn terms(all: &Expressions, first: u32, last: u32) -> Vec<bool> {
    let mut inside = Vec::new();
    for id in first..=last {
        if let Expr::Aggregate(aggregate) = all.get(ExprId(id))
            && let Some(term) = aggregate.term
        {
            inside.resize((last - first + 1) as usize, false);
            inside[(term.first.0 - first) as usize..=(term.root.0 - first) as usize].fill(true);
        }
    }
    inside
}

fn is_function(name: &str) -> bool {
    Unary::NAMED.iter().any(|(n, _)| *n == name)
        || Binary::NAMED.iter().any(|(n, _)| *n == name)
        || air::FUNCTIONS.contains(&name)
        || name == land::FUNCTION
}

/// "no parameters", "1 parameter", "2 parameters"
pub fn plural(n: usize, what: &str) -> String {
    match n {
        0 => format!("no {what}s"),
        1 => format!("1 {what}"),
        n => format!("{n} {what}s"),
    }
}
