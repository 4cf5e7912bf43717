//! Expressions: from pest's pairs to nodes of the syntax tree, by precedence.

use std::sync::LazyLock;

use pest::pratt_parser::{Assoc, Op, PrattParser};

use super::build::{Builder, Built, is_punctuation};
use crate::ast::{Aggregate, Expr, ExprId, Expression, Operator};
use crate::grammar::{Pair, Rule};
use crate::words::FOLDS;
use dlsys_diagnostic::{Diagnostic, Span};
use dlsys_expr::{Comparison, Fold};

/// In order of increasing binding strength (LANGUAGE, "Text").
static PRATT: LazyLock<PrattParser<Rule>> = LazyLock::new(|| {
    PrattParser::new()
        .op(Op::infix(Rule::or, Assoc::Left))
        .op(Op::infix(Rule::and, Assoc::Left))
        .op(Op::prefix(Rule::not))
        .op(Op::infix(Rule::comparison, Assoc::Left))
        .op(Op::infix(Rule::sum, Assoc::Left))
        .op(Op::infix(Rule::product, Assoc::Left))
        .op(Op::prefix(Rule::neg))
        // `2x^2` is 2(x^2), `x/2c` is x/(2c): a number binds to the factor that it touches.
        .op(Op::prefix(Rule::coefficient))
        .op(Op::infix(Rule::pow, Assoc::Right))
});

impl Builder<'_> {
    /// Builds one whole expression.
    pub fn expression(&mut self, pair: Pair) -> Built<Expression> {
        let first = self.expressions.next();
        let root = self.expr(pair)?;
        Ok(Expression { first, root })
    }

    /// Recursion is bounded by `layout::MAX_DEPTH`.
    fn expr(&mut self, pair: Pair) -> Built<ExprId> {
        let this = std::cell::RefCell::new(self);
        PRATT
            .map_primary(|primary| this.borrow_mut().primary(primary))
            .map_prefix(|op, operand| {
                let operand = operand?;
                let this = &mut *this.borrow_mut();
                let node = match op.as_rule() {
                    Rule::neg => Expr::Negate(operand),
                    Rule::not => Expr::Not(operand),
                    _ => Expr::Scale(this.number(&op)?, operand),
                };
                Ok(this.prefixed(this.span(&op), node, operand))
            })
            .map_infix(|a, op, b| Ok(this.borrow_mut().infix(a?, op.as_str().trim_end(), b?)))
            .parse(pair.into_inner().filter(|p| p.as_rule() != Rule::close))
    }

    /// An operand behind a sign or a number.
    pub(super) fn prefixed(&mut self, sign: Span, node: Expr, operand: ExprId) -> ExprId {
        let span = sign.to(self.expressions.span(operand));
        self.expressions.push(node, span)
    }

    /// Two operands with a sign between them.
    pub(super) fn infix(&mut self, a: ExprId, sign: &str, b: ExprId) -> ExprId {
        let span = self.expressions.span(a).to(self.expressions.span(b));
        let operator = match sign {
            "+" => Operator::Add,
            "-" => Operator::Sub,
            "*" | "·" => Operator::Mul,
            "/" => Operator::Div,
            "^" => Operator::Pow,
            "&" => Operator::And,
            "|" => Operator::Or,
            comparison => return self.compare(a, comparison, b, span),
        };
        self.expressions.push(Expr::Binary(operator, a, b), span)
    }

    /// `if c then a else if d then b else e`, of which the parts are c, a, d, b, e: from the last branch forward.
    pub(super) fn choice(&mut self, mut parts: Vec<ExprId>, span: Span) -> ExprId {
        let mut otherwise = parts.pop().expect("an `if` has an else");
        while let (Some(then), Some(condition)) = (parts.pop(), parts.pop()) {
            let span = self.expressions.span(condition).to(self.expressions.span(otherwise));
            otherwise = self.expressions.push(Expr::If(condition, then, otherwise), span);
        }
        self.expressions.widen(otherwise, span);
        otherwise
    }

    /// A comparison, or one more link of a chain.
    ///
    /// The chain is rebuilt after its last operand, so that operands still precede their users.
    fn compare(&mut self, a: ExprId, sign: &str, b: ExprId, span: Span) -> ExprId {
        let comparison = match sign {
            "<" => Comparison::Less,
            "<=" | "≤" => Comparison::LessOrEqual,
            "=" => Comparison::Equal,
            "!=" | "≠" => Comparison::NotEqual,
            ">=" | "≥" => Comparison::GreaterOrEqual,
            _ => Comparison::Greater,
        };
        let chain = match self.expressions.get_mut(a) {
            // The shorter chain remains in the arena as an unused number.
            Expr::Compare(first, links) => Some((*first, std::mem::take(links))),
            _ => None,
        };
        let node = match chain {
            Some((first, mut links)) => {
                *self.expressions.get_mut(a) = Expr::Number(0.0);
                links.push((comparison, b));
                Expr::Compare(first, links)
            }
            None => Expr::Compare(a, vec![(comparison, b)]),
        };
        self.expressions.push(node, span)
    }

    pub(super) fn number(&mut self, pair: &Pair) -> Built<f64> {
        let value: f64 = pair.as_str().parse().expect("the grammar's numbers are Rust's");
        if value.is_finite() {
            return Ok(value);
        }
        Err(Box::new(
            Diagnostic::error("this number is too large")
                .at(self.span(pair), format!("the greatest number is {:e}", f64::MAX))
                .help("choose larger units of length or time, so that numbers stay small"),
        ))
    }

    fn primary(&mut self, pair: Pair) -> Built<ExprId> {
        let span = self.span(&pair);
        match pair.as_rule() {
            Rule::lone_number => {
                let value = self.number(&pair)?;
                Ok(self.expressions.push(Expr::Number(value), span))
            }
            Rule::ident => {
                let name = self.interner.get(pair.as_str());
                Ok(self.expressions.push(Expr::Name(name), span))
            }
            Rule::call => {
                let mut inner = pair.into_inner().filter(|p| !is_punctuation(p.as_rule()));
                let name = self.interner.get(inner.next().expect("a call has a name").as_str());
                if FOLDS.contains(&&*name) && self.defined.is_some_and(|defined| !defined.contains(&*name)) {
                    return Err(Box::new(
                        Diagnostic::error(format!("`{name}` is not over numbers"))
                            .at(span, "expected a module, with names for its parameters")
                            .help(match &*name {
                                "count" => {
                                    "it counts what is attached to this module: `count(B(x))`".to_owned()
                                }
                                _ => {
                                    format!("it goes over what is attached to this module: `{name}(B(x): x)`")
                                }
                            }),
                    ));
                }
                let arguments = inner.map(|p| self.expr(p)).collect::<Built<Vec<_>>>()?;
                Ok(self.expressions.push(Expr::Call(name, arguments), span))
            }
            Rule::aggregate => self.aggregate(pair),
            Rule::if_expr => {
                let parts = pair.into_inner().filter(|p| p.as_rule() == Rule::expr);
                let parts = parts.map(|p| self.expr(p)).collect::<Built<Vec<_>>>()?;
                Ok(self.choice(parts, span))
            }
            Rule::indexed => {
                let mut inner = pair.into_inner();
                let name = self.interner.get(inner.next().expect("an array has a name").as_str());
                let index = self.expr(inner.next().expect("an element has a number"))?;
                Ok(self.expressions.push(Expr::Index(name, index), span))
            }
            Rule::match_expr => {
                let parts = pair.into_inner().filter(|p| p.as_rule() == Rule::expr);
                let mut parts = parts.map(|p| self.expr(p)).collect::<Built<Vec<_>>>()?.into_iter();
                let subject = parts.next().expect("a `match` has a number");
                let otherwise = parts.next_back().expect("a `match` has an else");
                let mut cases = Vec::new();
                while let (Some(value), Some(then)) = (parts.next(), parts.next()) {
                    cases.push((value, then));
                }
                Ok(self.expressions.push(Expr::Match(subject, cases, otherwise), span))
            }
            // A parenthesis: pest yields only its content.
            Rule::expr => {
                let inner = self.expr(pair)?;
                Ok(self.expressions.push(Expr::Parenthesis(inner), span))
            }
            other => unreachable!("{other:?} is no operand"),
        }
    }
}

impl Builder<'_> {
    /// An aggregate of the modules attached to one.
    fn aggregate(&mut self, pair: Pair) -> Built<ExprId> {
        let span = self.span(&pair);
        let mut inner = pair.into_inner().filter(|p| !is_punctuation(p.as_rule()));
        let mut next = || inner.next().expect("the grammar has a part here");
        let fold = match next().as_str().trim_end() {
            "sum" => Fold::Sum,
            "largest" => Fold::Largest,
            "smallest" => Fold::Smallest,
            _ => Fold::Count,
        };
        let module = next();
        // A function `count` that the model declares takes precedence.
        if fold == Fold::Count && self.defined.is_none_or(|defined| defined.contains("count")) {
            let argument = self.as_call(module)?;
            let name = self.interner.get("count");
            return Ok(self.expressions.push(Expr::Call(name, vec![argument]), span));
        }
        let head = self.head_module(module);
        let term = inner.next().map(|term| self.expression(term)).transpose()?;
        Ok(self.expressions.push(Expr::Aggregate(Box::new(Aggregate { fold, head, term })), span))
    }

    /// Converts a module with the names of its parameters to a name or a function call.
    fn as_call(&mut self, module: Pair) -> Built<ExprId> {
        let span = self.span(&module);
        let head = self.head_module(module);
        let arguments: Vec<ExprId> = head
            .parameters
            .iter()
            .map(|p| self.expressions.push(Expr::Name(p.text.clone()), p.span))
            .collect();
        let bare = arguments.is_empty();
        let node = if bare { Expr::Name(head.name.text) } else { Expr::Call(head.name.text, arguments) };
        Ok(self.expressions.push(node, span))
    }
}
