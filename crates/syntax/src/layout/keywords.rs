//! Keywords that begin a string or an expression, the nesting that they open, and line breaks that end an expression.

use super::{ItemKind, Last, Level, Scanner};
use crate::declarations::{Begins, Follow, OptionWord, is_before_value_everywhere};
use crate::lexeme::Token;

impl Scanner<'_> {
    /// Advances over a word; the result says whether an expression can end after it.
    pub(super) fn keyword(&mut self, start: usize, end: usize) -> Last {
        let inside = self.levels.len() > 1;
        let in_expression = !self.in_modules();
        let in_rule = self.items.last().is_some_and(|i| i.kind == ItemKind::Rule && i.after_colon.is_some());
        match &self.text[start..end] {
            "for" if !in_expression && self.is_repetition(end) => {
                self.group = true;
                self.level().in_header = true;
                Last::Operator
            }
            "if" if !in_expression && self.is_string_condition(end) => {
                self.group = true;
                self.level().in_header = true;
                Last::Operator
            }
            "else" if !in_expression => {
                self.group = true;
                self.level().group_next = true;
                Last::Operator
            }
            "produce" if in_rule && !inside => {
                self.forget_pending();
                (self.in_string, self.weighted, self.weight_next) = (true, false, true);
                Last::Operator
            }
            "or" if self.weighted && self.in_successor() => {
                self.weight_next = true;
                Last::Operator
            }
            "at" if !inside && self.is_at_rate(start, end) => {
                self.forget_pending();
                self.in_string = false;
                Last::Operator
            }
            "rate" if in_rule && !inside && self.follows_at(start) => Last::Operator,
            word @ ("solve" | "if") if in_rule && !inside && (self.in_string || word == "solve") => {
                self.forget_pending();
                self.in_string = false;
                self.count_if(word == "if");
                Last::Operator
            }
            "if" => {
                self.count_if(true);
                Last::Operator
            }
            "match"
                if in_expression && matches!(self.next, Some(Token::Word | Token::Number | Token::Open)) =>
            {
                self.count_if(true);
                self.level().matching = true;
                Last::Operator
            }
            "case" if in_expression && (self.level_matches() || self.matching) => {
                self.level().matching = true;
                let level = self.level();
                let dropped = std::mem::take(&mut level.right);
                self.pending -= dropped;
                Last::Operator
            }
            "let" if in_rule && !inside && !self.in_string && self.next == Some(Token::Word) => {
                self.forget_pending();
                Last::Operator
            }
            "then" | "else" => {
                let is_else = &self.text[start..end] == "else";
                let level = self.level();
                let dropped = level.right + usize::from(is_else && level.ifs > 0);
                level.right = 0;
                level.ifs -= usize::from(is_else && level.ifs > 0);
                self.pending -= dropped;
                Last::Operator
            }
            "for" if in_rule && !inside && !self.in_string && self.last == Last::Operand => Last::Operator,
            "in" if self.level().in_header => Last::Operator,
            // A sign behind it is that of its value.
            _ if self.begins_before_value(start) => Last::Operator,
            word if self.goes_on_after(word) => Last::Operator,
            _ => Last::Operand,
        }
    }

    /// True for the first word of a declaration whose value follows at once.
    fn begins_before_value(&self, start: usize) -> bool {
        let item = self.items.last().filter(|item| item.start == start);
        item.and_then(|item| item.kind.declaration()).is_some_and(|d| d.begins == Begins::BeforeValue)
    }

    /// True if a word is an option with a value behind it, so that a line break between the two ends nothing.
    fn goes_on_after(&self, word: &str) -> bool {
        let declaration = self.items.last().and_then(|item| item.kind.declaration());
        let is_own = |option: &OptionWord| option.word == word && option.follow == Follow::Value;
        is_before_value_everywhere(word) || declaration.is_some_and(|d| d.options.iter().any(is_own))
    }

    fn count_if(&mut self, yes: bool) {
        if yes {
            self.level().ifs += 1;
            self.pending += 1;
        }
    }

    pub(super) fn forget_pending(&mut self) {
        let level = self.levels.last_mut().expect("never empty");
        self.pending -= level.right + level.ifs;
        (level.right, level.ifs, level.matching) = (0, 0, false);
    }

    /// Keeps the line break at `at` if it ends an expression, and replaces it with a space otherwise.
    pub(super) fn line_break(&mut self, at: usize) {
        if at >= self.out.len() {
            return;
        }
        if self.in_string || self.levels.len() > 1 || self.last != Last::Operand {
            self.out[at] = b' ';
            return;
        }
        if self.held_break.is_none() {
            self.matching = self.level_matches();
        }
        self.forget_pending();
        // A `then` or `else` on a later line removes the first break after the expression.
        self.held_break.get_or_insert(at);
    }

    pub(super) fn level_matches(&self) -> bool {
        self.levels.iter().any(|level| level.matching)
    }

    pub(super) fn level(&mut self) -> &mut Level {
        self.levels.last_mut().expect("never empty")
    }
}
