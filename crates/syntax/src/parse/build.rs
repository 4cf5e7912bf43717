//! From pest's pairs to the syntax tree.

use std::collections::HashSet;
use std::sync::{Arc, LazyLock};

use rustc_hash::FxHashSet;

use crate::ast;
use crate::ast::{
    Action, Alternative, Clause, Conditional, ContextPart, Equation, Expr, ExprId, Expression, Expressions,
    HeadModule, Item, Module, Name, Part, Repetition, Text,
};
use crate::grammar::{Pair, Rule};
use crate::notation;
use dlsys_diagnostic::{Diagnostic, Span};

/// Maximum number of symbols and names of a weight outside parentheses.
const MAX_WEIGHT: usize = 200;

pub(crate) type Built<T> = Result<T, Box<Diagnostic>>;

/// Stores one copy of each name.
#[derive(Default)]
pub struct Interner(FxHashSet<Arc<str>>);

impl Interner {
    pub(super) fn get(&mut self, text: &str) -> Arc<str> {
        if let Some(known) = self.0.get(text) {
            return known.clone();
        }
        let new: Arc<str> = text.into();
        self.0.insert(new.clone());
        new
    }
}

pub struct Builder<'d> {
    pub expressions: &'d mut Expressions,
    pub interner: &'d mut Interner,
    /// Byte of the file at which the parsed piece begins.
    pub offset: usize,
    /// Names of the functions that the model declares.
    pub defined: Option<&'d HashSet<String>>,
}

impl Builder<'_> {
    pub(crate) fn span(&self, pair: &Pair) -> Span {
        let span = pair.as_span();
        // pest's spans of non-atomic rules may include trailing white space.
        let len = span.as_str().trim_end().len();
        Span::new(self.offset + span.start(), self.offset + span.start() + len)
    }

    pub(crate) fn name(&mut self, pair: &Pair) -> Name {
        Name { text: self.interner.get(pair.as_str()), span: self.span(pair) }
    }

    pub(crate) fn text(&self, pair: &Pair) -> Text {
        let inside = pair.as_str();
        Text { text: inside[1..inside.len() - 1].to_owned(), span: self.span(pair) }
    }

    /// A declaration or a rule.
    pub fn item(&mut self, pair: Pair) -> Built<Item> {
        match pair.as_rule() {
            Rule::rule_item => self.rule(pair),
            Rule::step_item => self.discrete_rule(pair),
            _ => notation::read(self, pair),
        }
    }

    fn rule(&mut self, pair: Pair) -> Built<Item> {
        let mut inner = pair.into_inner().filter(|p| !is_punctuation(p.as_rule()));
        let head = inner.next().expect("the grammar has a head here");
        let first = self.expressions.next();
        let mut rule = self.head(head);
        for part in inner {
            if part.as_rule() == Rule::local {
                let mut inner = part.into_inner().filter(|p| !is_punctuation(p.as_rule()));
                let mut next = || inner.next().expect("a name and its meaning");
                let name = self.name(&next());
                rule.locals.push((name, self.expression(next())?));
            } else {
                rule.clauses.push(self.clause(part)?);
            }
        }
        rule.nodes = (first, self.expressions.next());
        Ok(Item::Rule(rule))
    }

    fn discrete_rule(&mut self, pair: Pair) -> Built<Item> {
        let mut inner = pair.into_inner().filter(|p| !is_punctuation(p.as_rule()));
        let head = inner.next().expect("the grammar has a head here");
        let first = self.expressions.next();
        let mut rule = self.head(head);
        rule.discrete = true;
        let (mut guard, mut made) = (None, Vec::new());
        let mut span = rule.head;
        for part in inner {
            span = span.to(self.span(&part));
            match part.as_rule() {
                Rule::expr => guard = Some(self.expression(part)?),
                Rule::successor | Rule::choice => made = self.alternatives(part)?,
                _ => {}
            }
        }
        rule.clauses.push(Clause { guard, hazard: None, action: Action::Produce(made), span });
        rule.nodes = (first, self.expressions.next());
        Ok(Item::Rule(rule))
    }

    pub(crate) fn point(&mut self, pair: Pair) -> Built<[Expression; 2]> {
        let mut ends = pair.into_inner().filter(|p| p.as_rule() == Rule::expr);
        let mut coordinate = || self.expression(ends.next().expect("a point has two coordinates"));
        Ok([coordinate()?, coordinate()?])
    }

    pub(crate) fn formals(&mut self, pair: Pair) -> Vec<Name> {
        pair.into_inner().filter(|p| p.as_rule() == Rule::ident).map(|p| self.name(&p)).collect()
    }

    pub(crate) fn head_module(&mut self, pair: Pair) -> HeadModule {
        let span = self.span(&pair);
        let mut inner = pair.into_inner();
        let name = self.name(&inner.next().expect("a module has a name"));
        let parameters = inner.next().map(|formals| self.formals(formals)).unwrap_or_default();
        HeadModule { name, parameters, span }
    }

    fn head(&mut self, pair: Pair) -> ast::Rule {
        let head = self.span(&pair);
        let (mut left, mut right, mut predecessor) = (Vec::new(), Vec::new(), None);
        let mut right_shape = Vec::new();
        for part in pair.into_inner() {
            match part.as_rule() {
                Rule::context | Rule::step_context => {
                    left.extend(part.into_inner().map(|module| self.head_module(module)));
                }
                Rule::right_context | Rule::step_right => {
                    for part in part.into_inner() {
                        right_shape.push(match part.as_rule() {
                            Rule::bracket_open => ContextPart::Open,
                            Rule::bracket_close => ContextPart::Close,
                            _ => {
                                right.push(self.head_module(part));
                                ContextPart::Module
                            }
                        });
                    }
                }
                Rule::plus_minus | Rule::head_module => predecessor = Some(self.head_module(part)),
                _ => {}
            }
        }
        let predecessor = predecessor.expect("the grammar has a predecessor here");
        with_head(left, predecessor, (right, right_shape), head)
    }

    fn clause(&mut self, pair: Pair) -> Built<Clause> {
        let span = self.span(&pair);
        let mut guard = None;
        let mut hazard = None;
        let mut action = None;
        for part in pair.into_inner() {
            match part.as_rule() {
                Rule::expr => guard = Some(self.expression(part)?),
                Rule::solve => {
                    let mut equations = Vec::new();
                    for equation in part.into_inner().filter(|p| p.as_rule() == Rule::equation) {
                        equations.push(self.equation(equation)?);
                    }
                    action = Some(Action::Solve(equations));
                }
                Rule::hazard => {
                    let rate = part.into_inner().find(|p| p.as_rule() == Rule::expr);
                    hazard = Some(self.expression(rate.expect("the grammar has a rate here"))?);
                }
                Rule::produce => {
                    let mut inner = part.into_inner();
                    let successor = inner.find(|p| matches!(p.as_rule(), Rule::successor | Rule::choice));
                    action = Some(Action::Produce(self.alternatives(successor.expect("a successor"))?));
                }
                _ => {}
            }
        }
        Ok(Clause { guard, hazard, action: action.expect("a clause solves or produces"), span })
    }

    /// The successors of a clause: one, or several with weights.
    pub fn alternatives(&mut self, pair: Pair) -> Built<Vec<Alternative>> {
        if pair.as_rule() == Rule::successor {
            return Ok(vec![Alternative { weight: None, modules: self.successor(pair)? }]);
        }
        let mut all = Vec::new();
        for weighted in pair.into_inner().filter(|p| p.as_rule() == Rule::weighted) {
            let mut inner = weighted.into_inner().filter(|p| !is_punctuation(p.as_rule()));
            let mut next = || inner.next().expect("the grammar has a part here");
            let weight = next();
            // The layout bounds nesting in expressions only, and treats this as a part of a string.
            let symbols = weight.clone().into_inner().count();
            if symbols > MAX_WEIGHT {
                return Err(Box::new(
                    Diagnostic::error("this weight is too long")
                        .at(self.span(&weight), format!("more than {MAX_WEIGHT} symbols"))
                        .help("name it: `const w = …` or `def w(x) = …`"),
                ));
            }
            let weight = Some(self.expression(weight)?);
            all.push(Alternative { weight, modules: self.successor(next())? });
        }
        Ok(all)
    }

    /// A head and the expression behind its colon.
    pub fn measure(&mut self, pair: Pair) -> Built<(HeadModule, Option<Expression>)> {
        let mut inner = pair.into_inner().filter(|p| matches!(p.as_rule(), Rule::head_module | Rule::expr));
        let head = self.head_module(inner.next().expect("the grammar has a head here"));
        let expression = inner.next().map(|expression| self.expression(expression)).transpose()?;
        Ok((head, expression))
    }

    fn equation(&mut self, pair: Pair) -> Built<Equation> {
        let span = self.span(&pair);
        let mut inner = pair.into_inner().filter(|p| !is_punctuation(p.as_rule()));
        let side = inner.next().expect("an equation has a left side");
        let mut right = || inner.next().expect("an equation has a right side");
        match side.as_rule() {
            Rule::zero => {
                let residual = self.expression(right())?;
                let unknown = inner.next().map(|name| self.name(&name));
                return Ok(Equation::Zero { residual, unknown, span });
            }
            Rule::ident => {
                return Ok(Equation::Value { parameter: self.name(&side), value: self.expression(right())? });
            }
            _ => {}
        }
        let rate = side.into_inner().next().expect("a derivative has a name");
        let whole = self.span(&rate);
        let parameter = Name {
            text: self.interner.get(&rate.as_str()[1..]),
            span: Span { start: whole.start + 1, end: whole.end },
        };
        Ok(Equation::Rate { parameter, rate: self.expression(right())? })
    }

    /// The parts of a string, of an alternative or of a group.
    pub(crate) fn successor(&mut self, pair: Pair) -> Built<Vec<Part>> {
        let mut parts = Vec::new();
        for pair in pair.into_inner() {
            parts.extend(self.part(pair)?);
        }
        Ok(parts)
    }

    /// A part of a string; None for signs between parts.
    pub fn part(&mut self, pair: Pair) -> Built<Option<Part>> {
        Ok(Some(match pair.as_rule() {
            Rule::module => Part::Module(self.module(pair)?),
            Rule::repetition => Part::Repeat(Box::new(self.repetition(pair)?)),
            Rule::conditional => Part::If(Box::new(self.conditional(pair)?)),
            _ => return Ok(None),
        }))
    }

    fn repetition(&mut self, pair: Pair) -> Built<Repetition> {
        let span = self.span(&pair);
        let mut inner = pair.into_inner().filter(|p| !is_punctuation(p.as_rule()));
        let mut next = || inner.next().expect("the grammar has a part here");
        let index = self.name(&next());
        let (from, to) = (self.expression(next())?, self.expression(next())?);
        Ok(Repetition { index, from, to, body: self.successor(next())?, span })
    }

    fn conditional(&mut self, pair: Pair) -> Built<Conditional> {
        let span = self.span(&pair);
        let mut inner = pair.into_inner().filter(|p| !is_punctuation(p.as_rule()));
        let mut next = || inner.next().expect("the grammar has a part here");
        let condition = self.expression(next())?;
        let then = self.successor(next())?;
        let otherwise = match inner.next() {
            Some(other) if other.as_rule() == Rule::conditional => {
                vec![Part::If(Box::new(self.conditional(other)?))]
            }
            Some(other) => self.successor(other)?,
            None => Vec::new(),
        };
        Ok(Conditional { condition, then, otherwise, span })
    }

    pub fn module(&mut self, pair: Pair) -> Built<Module> {
        let span = self.span(&pair);
        let mut inner = pair.into_inner();
        let name = self.interner.get(inner.next().expect("a module has a name").as_str());
        let mut arguments = Vec::new();
        if let Some(list) = inner.next() {
            for argument in list.into_inner() {
                match argument.as_rule() {
                    Rule::literal => {
                        let span = self.span(&argument);
                        let value = self.number(&argument)?;
                        let root = self.expressions.push(Expr::Number(value), span);
                        arguments.push(Expression { first: root, root });
                    }
                    Rule::expr => arguments.push(self.expression(argument)?),
                    _ => {}
                }
            }
        }
        Ok(Module { name, span, arguments })
    }
}

/// A continuous rule that has its head alone so far.
pub(super) fn with_head(
    left: Vec<HeadModule>,
    predecessor: HeadModule,
    (right, right_shape): (Vec<HeadModule>, Vec<ContextPart>),
    head: Span,
) -> ast::Rule {
    let nodes = (ExprId(0), ExprId(0));
    let (locals, clauses) = (Vec::new(), Vec::new());
    ast::Rule { left, predecessor, right, right_shape, head, discrete: false, locals, clauses, nodes }
}

/// True for signs and words that carry no information after parsing.
pub(crate) fn is_punctuation(rule: Rule) -> bool {
    matches!(rule, Rule::equals | Rule::colon | Rule::close | Rule::range | Rule::EOI)
        || keyword(rule).is_some()
}

/// The keyword of a grammar rule, in backquotes; such rules have names of the form `kw_…`.
pub(super) fn keyword(rule: Rule) -> Option<&'static str> {
    static WORDS: LazyLock<Vec<Option<String>>> = LazyLock::new(|| {
        let mut words = Vec::new();
        for rule in Rule::all_rules() {
            let word = format!("{rule:?}").strip_prefix("kw_").map(|word| format!("`{word}`"));
            words.resize(words.len().max(*rule as usize + 1), None);
            words[*rule as usize] = word;
        }
        words
    });
    WORDS.get(rule as usize)?.as_deref()
}
