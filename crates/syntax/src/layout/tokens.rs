//! The effect of each token: nesting, and whether an expression can end there.

use super::{ItemKind, Last, Level, MAX_DEPTH, Scanner};
use crate::lexeme::{Lexeme, Token, in_name};
use crate::words::FOLDS;
use dlsys_diagnostic::{Diagnostic, Span};

impl Scanner<'_> {
    /// Advances over one token: updates the nesting, and whether an expression can end here.
    pub(super) fn token(&mut self, (token, start, end): (Token, usize, usize)) {
        let in_expression = !self.in_modules();
        (self.weight_next, self.group) = (false, false);
        let (after_operand, depth) = (self.last == Last::Operand, self.levels.len() - 1);
        let last = match token {
            Token::Word => self.keyword(start, end),
            Token::Number | Token::Text => Last::Operand,
            Token::Open => {
                let word = self.text[..start].trim_end().rsplit(|c| !in_name(c)).next().unwrap_or_default();
                let is_sum = FOLDS.contains(&word);
                let is_string = std::mem::take(&mut self.level().group_next);
                self.group = is_string;
                self.levels.push(Level { at: start, is_sum, is_string, ..Level::default() });
                Last::Operator
            }
            Token::Close => {
                self.close_parenthesis(start, end);
                Last::Operand
            }
            Token::Comma => {
                self.forget_pending();
                Last::Operator
            }
            Token::Colon => {
                self.colon(end);
                Last::Colon
            }
            Token::Symbol => self.symbol(start, end, in_expression),
        };
        self.last = last;
        if let Some(lexemes) = &mut self.lexemes {
            let (in_string, operator) = (!in_expression, last != Last::Operand);
            let group = self.group;
            lexemes.push(Lexeme { token, start, end, in_string, after_operand, operator, group, depth });
        }
        self.check_depth(start, end);
    }

    /// True in a string of modules, outside the parentheses of parameters and the expressions of `for` and `if`.
    pub(super) fn in_modules(&self) -> bool {
        match self.levels.as_slice() {
            [outermost] => self.in_string && !outermost.in_header,
            [.., level] => level.is_string && !level.in_header,
            [] => false,
        }
    }

    fn close_parenthesis(&mut self, start: usize, end: usize) {
        if self.levels.len() > 1 {
            let level = self.levels.pop().expect("two levels");
            self.pending -= level.right + level.ifs;
            self.group = level.is_string;
        } else {
            self.fault(
                Diagnostic::error("this `)` closes nothing")
                    .at(Span::new(start, end), "there is no `(` before it")
                    .help("remove it, or write the `(` that it belongs to"),
            );
        }
    }

    /// Advances over a colon that ends at `end`: that of a head, of a weight, of a `case` or of an aggregate.
    fn colon(&mut self, end: usize) {
        if std::mem::take(&mut self.level().in_header) {
            self.forget_pending();
            self.level().group_next = true;
            return;
        }
        self.level().is_sum = false;
        let weight = self.in_successor();
        self.weighted |= weight;
        if self.levels.len() == 1
            && !self.level().matching
            && !weight
            && let Some(item) = self.items.last_mut()
            && item.after_colon.is_none()
        {
            item.after_colon = Some(end);
            self.in_string = item.kind.has_string();
            self.forget_pending();
        }
    }

    /// Advances over an operator, a bracket or the arrow of a discrete rule.
    fn symbol(&mut self, start: usize, end: usize, in_expression: bool) -> Last {
        let symbol = &self.text[start..end];
        let binary = self.last == Last::Operand;
        if self.is_arrow(start, end)
            && self.levels.len() == 1
            && self.items.last().is_some_and(|i| i.kind == ItemKind::Step)
        {
            (self.in_string, self.weighted, self.weight_next) = (true, false, true);
            self.forget_pending();
            return Last::Operator;
        }
        if in_expression {
            let level = self.levels.last_mut().expect("never empty");
            if symbol == "^" || !binary {
                level.right += 1;
                self.pending += 1;
            } else {
                self.pending -= level.right;
                level.right = 0;
            }
        }
        match symbol {
            "<" | ">" => Last::Angle,
            // The end of an element, or of an array.
            "]" => Last::Operand,
            _ => Last::Operator,
        }
    }

    /// Reports nesting that is deeper than [`MAX_DEPTH`] after the token at these bytes.
    fn check_depth(&mut self, start: usize, end: usize) {
        if self.levels.len() - 1 + self.pending > MAX_DEPTH {
            self.fault(
                Diagnostic::error(format!("this is nested more than {MAX_DEPTH} deep"))
                    .at(Span::new(start, end), "one level too many")
                    .help("name a part of it: `const part = …` or `def part(x) = …`"),
            );
        }
    }
}
