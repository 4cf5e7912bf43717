//! Expressions, with the strengths of the table in `parse/expression.rs`.

use super::Direct;
use super::scan::is_reserved;
use crate::ast::{Expr, ExprId, Expression};
use crate::words::FOLDS;

/// What binds how strongly; an operand goes on as long as what follows binds more strongly than what stands before it.
mod strength {
    pub const NONE: u8 = 0;
    pub const OR: u8 = 1;
    pub const AND: u8 = 2;
    pub const NOT: u8 = 3;
    pub const COMPARISON: u8 = 4;
    pub const SUM: u8 = 5;
    pub const PRODUCT: u8 = 6;
    pub const NEGATION: u8 = 7;
    pub const COEFFICIENT: u8 = 8;
    pub const POWER: u8 = 9;
}

impl Direct<'_, '_, '_> {
    /// A whole expression.
    pub(super) fn expression(&mut self) -> Option<Expression> {
        let first = self.builder.expressions.next();
        let root = self.binding(strength::NONE)?;
        Some(Expression { first, root })
    }

    /// An operand, and what follows as long as it binds more strongly than `floor`. The layout bounds the recursion.
    fn binding(&mut self, floor: u8) -> Option<ExprId> {
        let mut left = self.operand()?;
        loop {
            let (length, strength) = self.peek_infix();
            if strength <= floor {
                return Some(left);
            }
            let sign = self.cursor.take(length);
            // Powers are grouped from the right.
            let right = self.binding(if strength == strength::POWER { strength - 1 } else { strength })?;
            left = self.builder.infix(left, sign, right);
        }
    }

    /// The length and the strength of the operator that comes next; the least strength if none does.
    fn peek_infix(&mut self) -> (usize, u8) {
        let sign = self.cursor.next();
        let equal = |rest: &str| if rest.as_bytes().get(1) == Some(&b'=') { 2 } else { 1 };
        match sign {
            b'-' if self.discrete && self.is_arrow() => (0, strength::NONE),
            b'+' | b'-' => (1, strength::SUM),
            b'*' | b'/' => (1, strength::PRODUCT),
            b'^' => (1, strength::POWER),
            b'&' => (1, strength::AND),
            b'|' => (1, strength::OR),
            b'=' => (1, strength::COMPARISON),
            b'<' | b'>' => (equal(self.cursor.rest()), strength::COMPARISON),
            b'!' if equal(self.cursor.rest()) == 2 => (2, strength::COMPARISON),
            0x80.. => match self.cursor.rest().chars().next() {
                Some('·') => ('·'.len_utf8(), strength::PRODUCT),
                Some(sign @ ('≤' | '≥' | '≠')) => (sign.len_utf8(), strength::COMPARISON),
                _ => (0, strength::NONE),
            },
            _ => (0, strength::NONE),
        }
    }

    /// A name, a number, a call, a parenthesis, each with the signs before it.
    fn operand(&mut self) -> Option<ExprId> {
        match self.cursor.next() {
            b'-' => {
                let sign = self.sign_before();
                let operand = self.binding(strength::NEGATION - 1)?;
                Some(self.builder.prefixed(sign, Expr::Negate(operand), operand))
            }
            b'!' => {
                let sign = self.sign_before();
                if self.cursor.next() == b'=' {
                    return None;
                }
                let operand = self.binding(strength::NOT - 1)?;
                Some(self.builder.prefixed(sign, Expr::Not(operand), operand))
            }
            b'0'..=b'9' => self.number(),
            b'(' => {
                self.cursor.take(1);
                self.cursor.next();
                let start = self.cursor.at;
                let inner = self.binding(strength::NONE)?;
                let span = self.span_from(start);
                self.cursor.sign(b')')?;
                Some(self.builder.expressions.push(Expr::Parenthesis(inner), span))
            }
            _ => self.named(),
        }
    }

    fn sign_before(&mut self) -> dlsys_diagnostic::Span {
        let start = self.cursor.at;
        self.cursor.take(1);
        self.span_from(start)
    }

    fn number(&mut self) -> Option<ExprId> {
        let (length, multiplies) = self.cursor.number();
        let start = self.cursor.at;
        let value: f64 = self.cursor.take(length).parse().ok()?;
        let span = self.span_from(start);
        if !value.is_finite() {
            return None;
        }
        if !multiplies {
            return Some(self.builder.expressions.push(Expr::Number(value), span));
        }
        let operand = self.binding(strength::COEFFICIENT - 1)?;
        Some(self.builder.prefixed(span, Expr::Scale(value, operand), operand))
    }

    fn named(&mut self) -> Option<ExprId> {
        let start = self.cursor.at;
        let word = self.cursor.peek_word();
        if word == "if" {
            return self.choice();
        }
        if word.is_empty() || word == "match" || is_reserved(word) {
            return None;
        }
        self.cursor.take(word.len());
        let follows = self.cursor.next();
        if follows == b'(' && FOLDS.contains(&word) {
            return None;
        }
        let name = self.builder.interner.get(word);
        let node = match follows {
            b'(' => {
                self.cursor.take(1);
                Expr::Call(name, self.list(|this| this.binding(strength::NONE))?)
            }
            b'[' => {
                self.cursor.take(1);
                let index = self.binding(strength::NONE)?;
                self.cursor.sign(b']')?;
                Expr::Index(name, index)
            }
            _ => Expr::Name(name),
        };
        let span = self.span_from(start);
        Some(self.builder.expressions.push(node, span))
    }

    /// `if c then a else if d then b else e`
    fn choice(&mut self) -> Option<ExprId> {
        let start = self.cursor.at;
        let mut parts = Vec::new();
        while self.cursor.keyword("if").is_some() {
            parts.push(self.binding(strength::NONE)?);
            self.cursor.keyword("then")?;
            parts.push(self.binding(strength::NONE)?);
            self.cursor.keyword("else")?;
        }
        parts.push(self.binding(strength::NONE)?);
        let span = self.span_from(start);
        Some(self.builder.choice(parts, span))
    }
}
