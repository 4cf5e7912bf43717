//! From pest's pairs to the syntax tree.

use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use super::{Pair, Rule};
use crate::ast;
use crate::ast::{
    Action, Alternative, Clause, Equation, Expr, ExprId, Expression, Expressions, HeadModule, Item, Module,
    Name, Text, Turn,
};
use dlsys_diagnostic::{Diagnostic, Span};
use dlsys_expr::Sort;

/// Most symbols and names of a weight outside parentheses.
const MAX_WEIGHT: usize = 200;

pub(super) type Built<T> = Result<T, Box<Diagnostic>>;

/// Keeps one copy of each name.
#[derive(Default)]
pub struct Interner(HashMap<Box<str>, Arc<str>>);

impl Interner {
    pub(super) fn get(&mut self, text: &str) -> Arc<str> {
        if let Some(known) = self.0.get(text) {
            return known.clone();
        }
        let new: Arc<str> = text.into();
        self.0.insert(text.into(), new.clone());
        new
    }
}

pub struct Builder<'d> {
    pub expressions: &'d mut Expressions,
    pub interner: &'d mut Interner,
    /// Where the parsed piece begins in the file.
    pub offset: usize,
    /// Names of the model's own functions.
    pub defined: Option<&'d HashSet<String>>,
}

impl Builder<'_> {
    pub(super) fn span(&self, pair: &Pair) -> Span {
        let span = pair.as_span();
        // pest's spans of non-atomic rules may end in white space that was skipped in vain.
        let len = span.as_str().trim_end().len();
        Span::new(self.offset + span.start(), self.offset + span.start() + len)
    }

    fn name(&mut self, pair: &Pair) -> Name {
        Name { text: self.interner.get(pair.as_str()), span: self.span(pair) }
    }

    fn text(&self, pair: &Pair) -> Text {
        let inside = pair.as_str();
        Text { text: inside[1..inside.len() - 1].to_owned(), span: self.span(pair) }
    }

    pub fn item(&mut self, pair: Pair) -> Built<Item> {
        let rule = pair.as_rule();
        let mut inner = pair.into_inner().filter(|p| !is_punctuation(p.as_rule())).peekable();
        let mut next = || inner.next().expect("the grammar has a part here");
        Ok(match rule {
            Rule::title_item => {
                let text = next().into_inner().next().expect("the grammar has a text here");
                Item::Title(text.as_str().to_owned())
            }
            Rule::include_item => Item::Include(self.text(&next())),
            Rule::const_item => {
                let (name, value) = (self.name(&next()), next());
                if value.as_rule() == Rule::array {
                    let values = value.into_inner().map(|p| self.expression(p)).collect::<Built<_>>()?;
                    Item::Array { name, values }
                } else {
                    Item::Const { name, value: self.expression(value)? }
                }
            }
            Rule::curve_item => {
                let (sort, name) = self.sorted_name(&mut inner, Sort::Monotone);
                let (mut points, mut periodic) = (Vec::new(), false);
                for part in inner {
                    match part.as_rule() {
                        Rule::point => points.push(self.point(part)?),
                        _ => periodic = true,
                    }
                }
                Item::Curve { name, sort, points, periodic }
            }
            Rule::table_item => {
                let (sort, name) = self.sorted_name(&mut inner, Sort::Linear);
                let file = self.text(&inner.next().expect("the grammar has a file here"));
                let (mut column, mut periodic) = (None, false);
                for part in inner {
                    match part.as_rule() {
                        Rule::text => column = Some(self.text(&part)),
                        _ => periodic = true,
                    }
                }
                Item::Table { name, sort, file, column, periodic }
            }
            Rule::param_item => {
                let (name, value) = (self.name(&next()), self.expression(next())?);
                let range = match inner.next() {
                    Some(from) => {
                        let to = inner.next().expect("a range has two ends");
                        Some((self.expression(from)?, self.expression(to)?))
                    }
                    None => None,
                };
                Item::Param { name, value, range }
            }
            Rule::def_item => Item::Def {
                name: self.name(&next()),
                parameters: self.formals(next()),
                body: self.expression(next())?,
            },
            Rule::angle_item => Item::Angle(self.expression(next())?),
            Rule::period_item => Item::Period(self.expression(next())?),
            Rule::frames_item => Item::Frames {
                from: self.expression(next())?,
                to: self.expression(next())?,
                step: self.expression(next())?,
            },
            Rule::color_item => Item::Color { name: self.name(&next()), value: self.text(&next()) },
            Rule::gradient_item => {
                Item::Gradient { name: self.name(&next()), stops: inner.map(|p| self.text(&p)).collect() }
            }
            Rule::surface_item => Item::Surface { name: self.name(&next()), file: self.text(&next()) },
            Rule::contour_item => {
                let name = self.name(&next());
                Item::Contour { name, points: inner.map(|p| self.point(p)).collect::<Built<Vec<_>>>()? }
            }
            Rule::tropism_item => {
                let direction =
                    [self.expression(next())?, self.expression(next())?, self.expression(next())?];
                let strength = inner.next().map(|p| self.expression(p)).transpose()?;
                Item::Tropism { direction, strength }
            }
            Rule::ignore_item => Item::Ignore(inner.map(|p| self.name(&p)).collect()),
            Rule::consider_item => Item::Consider(inner.map(|p| self.name(&p)).collect()),
            Rule::interpret_item => {
                Item::Interpret { head: self.head_module(next()), drawn: self.successor(next())? }
            }
            Rule::rule_item => {
                let head = next();
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
                Item::Rule(rule)
            }
            Rule::step_item => {
                let head = next();
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
                Item::Rule(rule)
            }
            other => unreachable!("{other:?} is no item"),
        })
    }

    /// The name of a curve, after the word for its sort if there is one.
    fn sorted_name<'i>(&mut self, inner: &mut impl Iterator<Item = Pair<'i>>, default: Sort) -> (Sort, Name) {
        let mut next = || inner.next().expect("the grammar has a name here");
        let first = next();
        let sort = match (first.as_rule(), first.as_str()) {
            (Rule::sort, "linear") => Sort::Linear,
            (Rule::sort, "spline") => Sort::Spline,
            (Rule::sort, _) => Sort::Monotone,
            _ => return (default, self.name(&first)),
        };
        (sort, self.name(&next()))
    }

    fn point(&mut self, pair: Pair) -> Built<[Expression; 2]> {
        let mut ends = pair.into_inner().filter(|p| p.as_rule() == Rule::expr);
        let mut coordinate = || self.expression(ends.next().expect("a point has two coordinates"));
        Ok([coordinate()?, coordinate()?])
    }

    fn formals(&mut self, pair: Pair) -> Vec<Name> {
        pair.into_inner().filter(|p| p.as_rule() == Rule::ident).map(|p| self.name(&p)).collect()
    }

    pub(super) fn head_module(&mut self, pair: Pair) -> HeadModule {
        let span = self.span(&pair);
        let sign = pair.as_rule() == Rule::plus_minus;
        let mut inner = pair.into_inner();
        let name = if sign {
            Name {
                text: self.interner.get("±"), span: Span::new(span.range().start, span.range().start + 2)
            }
        } else {
            self.name(&inner.next().expect("a module has a name"))
        };
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
                            Rule::bracket_open => Turn::Open,
                            Rule::bracket_close => Turn::Close,
                            _ => {
                                right.push(self.head_module(part));
                                Turn::Module
                            }
                        });
                    }
                }
                Rule::plus_minus | Rule::head_module => predecessor = Some(self.head_module(part)),
                _ => {}
            }
        }
        let predecessor = predecessor.expect("the grammar has a predecessor here");
        let nodes = (ExprId(0), ExprId(0));
        let (locals, clauses) = (Vec::new(), Vec::new());
        ast::Rule { left, predecessor, right, right_shape, head, discrete: false, locals, clauses, nodes }
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
            // The layout bounds nesting in expressions, and takes this for a part of a string.
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

    /// A head, and the expression behind its colon.
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

    fn successor(&mut self, pair: Pair) -> Built<Vec<Module>> {
        pair.into_inner().filter(|p| p.as_rule() == Rule::module).map(|p| self.module(p)).collect()
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

pub(super) fn is_punctuation(rule: Rule) -> bool {
    matches!(
        rule,
        Rule::equals
            | Rule::colon
            | Rule::close
            | Rule::range
            | Rule::kw_include
            | Rule::kw_curve
            | Rule::kw_table
            | Rule::kw_column
            | Rule::kw_let
            | Rule::kw_const
            | Rule::kw_param
            | Rule::kw_def
            | Rule::kw_angle
            | Rule::kw_period
            | Rule::kw_frames
            | Rule::kw_step
            | Rule::kw_in
            | Rule::kw_color
            | Rule::kw_gradient
            | Rule::kw_surface
            | Rule::kw_from
            | Rule::kw_contour
            | Rule::kw_tropism
            | Rule::kw_strength
            | Rule::kw_ignore
            | Rule::kw_consider
            | Rule::kw_interpret
            | Rule::kw_for
            | Rule::EOI
    )
}
