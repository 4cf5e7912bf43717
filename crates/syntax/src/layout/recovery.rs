//! Error recovery for incomplete lines: the head of a rule without its colon, and, within a string of modules that
//! continues over lines, a line that cannot belong to the string, such as a misspelt declaration.
//!
//! A missing colon is reported once and inserted, so that the rule is parsed and its other mistakes are found.

use super::{ItemKind, RawItem, Scanner};
use crate::declarations::{self, Body};
use crate::foreign_syntax;
use crate::lexeme::{SUBSCRIPTED, Token};
use crate::suggest::nearest;
use dlsys_diagnostic::{Diagnostic, Span};

type Lexed = (Token, usize, usize);

impl Scanner<'_> {
    /// First and last byte of a head without its colon: on this line, before its first clause or the condition of a discrete
    /// rule, or on the line before this clause. `starts` is the kind of item that the line begins otherwise.
    pub(super) fn head_without_colon(
        &self,
        starts: Option<ItemKind>,
        colon: bool,
        tokens: &[Lexed],
    ) -> Option<(usize, usize)> {
        let current = self.items.last()?.kind;
        let whole = |tokens: &[Lexed]| (tokens[0].1, tokens[tokens.len() - 1].2);
        if starts == Some(ItemKind::Step) && !colon {
            let head = self.head_length(tokens);
            let compares = |t: &Lexed| t.0 == Token::Number || matches!(self.text_of(*t), "=" | "&" | "*");
            let condition = self.before_arrow(&tokens[head..]);
            let begins = condition.first().is_some_and(|t| matches!(t.0, Token::Word | Token::Open))
                && self.first_clause(condition) != Some(0);
            return (head > 0 && begins && condition.iter().any(compares)).then(|| whole(&tokens[..head]));
        }
        let in_string = self.in_string && self.levels.len() == 1;
        match starts {
            Some(ItemKind::Unknown) => {}
            None if current == ItemKind::Unknown => {}
            // Another clause may follow in the successor of a clause.
            None if in_string && (current.has_string() || current == ItemKind::Step) => {}
            _ => return None,
        }
        let clause = self.first_clause(tokens)?;
        if in_string && self.begins_group(tokens, clause) {
            return None;
        }
        // In a drawing, `if` may be meant as a condition of the drawing.
        let acts = |t: &Lexed| matches!(self.word(*t), "solve" | "produce");
        if current.body() == Some(Body::Drawing) && !tokens.iter().any(acts) {
            return None;
        }
        match clause {
            0 => self.head_before,
            _ if self.head_length(&tokens[..clause]) == clause => Some(whole(&tokens[..clause])),
            _ => None,
        }
    }

    /// Reclassifies a rule without clauses that precedes the arrow of a discrete rule: it is the head of that rule, broken
    /// over lines, or a line such as L-Py's `production:`.
    pub(super) fn goes_on_discrete(&mut self, line: usize, arrow_first: bool) {
        let Some(item) = self.items.last_mut().filter(|i| i.kind == ItemKind::Rule) else { return };
        let head = self.text[item.start..line].trim_end();
        let foreign = !arrow_first && foreign_syntax::line(head, item.start).is_some();
        item.kind = if foreign { ItemKind::Unknown } else { ItemKind::Step };
        self.held_break = None;
    }

    /// Reports the missing colon and begins the rule as if the head at these bytes had it.
    pub(super) fn begin_without_colon(&mut self, (from, to): (usize, usize), kind: ItemKind) {
        if self.items.last().is_some_and(|item| item.kind == ItemKind::Unknown && item.start == from) {
            self.items.pop();
        } else {
            self.close_item(from);
        }
        let written = format!("write `{}:`", self.text[from..to].trim_end());
        self.errors.push(
            Diagnostic::error("the head of this rule has no colon")
                .at(Span::new(from, to), "expected `:` after this head")
                .help(match kind {
                    ItemKind::Step => format!("{written}, and the condition behind it"),
                    _ => format!("{written}, and the clauses behind it or below"),
                }),
        );
        let free = self.text.as_bytes().get(to).is_some_and(u8::is_ascii_whitespace);
        if free {
            self.out[to] = b':';
        }
        self.items.push(RawItem { kind, start: from, end: from, after_colon: Some(to + 1), broken: !free });
    }

    /// The bytes of this line if it may be a head without its colon, for the decision on the next line.
    pub(super) fn remembered_head(
        &self,
        starts: Option<ItemKind>,
        in_string: bool,
        tokens: &[Lexed],
    ) -> Option<(usize, usize)> {
        let alone = starts == Some(ItemKind::Unknown) || starts.is_none() && in_string;
        let is_head = alone && self.head_length(tokens) == tokens.len();
        is_head.then(|| (tokens[0].1, tokens[tokens.len() - 1].2))
    }

    /// True if a line within a string of modules cannot belong to the string and begins like a declaration.
    pub(super) fn is_no_string(&self, tokens: &[Lexed]) -> bool {
        if !self.in_string || self.levels.len() > 1 || self.weighted || self.weight_next {
            return false;
        }
        let Some((&first, rest)) = tokens.split_first() else { return false };
        let word = self.word(first);
        if word.is_empty() || word == "or" {
            return false;
        }
        let Some(&next) = rest.first() else { return foreign_syntax::stands_alone(word) };
        // A number behind a name may be the parameter of a module.
        let meant = || nearest(word, declarations::words()).is_some();
        if next.0 == Token::Number && meant() {
            return true;
        }
        let begins =
            matches!(next.0, Token::Word | Token::Text) || matches!(self.text_of(next), "=" | "@" | "/");
        // Within a clause, `=` may be a comparison.
        let end = self.first_clause(tokens).unwrap_or(tokens.len());
        let mut depth = 0usize;
        begins
            && tokens[..end].iter().any(|t| {
                match t.0 {
                    Token::Open => depth += 1,
                    Token::Close => depth = depth.saturating_sub(1),
                    _ => {}
                }
                depth == 0 && (t.0 == Token::Text || self.is_equals(*t))
            })
    }

    fn text_of(&self, token: Lexed) -> &str {
        &self.text[token.1..token.2]
    }

    /// True for an `=` that is not part of `<=`, `>=`, `==` or `!=`.
    fn is_equals(&self, token: Lexed) -> bool {
        let part = |c: char| "<>=!".contains(c);
        self.text_of(token) == "="
            && !self.text[..token.1].ends_with(part)
            && !self.text[token.2..].starts_with(part)
    }

    /// The first token outside parentheses that begins a clause.
    fn first_clause(&self, tokens: &[Lexed]) -> Option<usize> {
        let mut depth = 0usize;
        for (i, &token) in tokens.iter().enumerate() {
            match token.0 {
                Token::Open => depth += 1,
                Token::Close => depth = depth.saturating_sub(1),
                _ => {}
            }
            let next = |n: usize| tokens.get(i + n).map_or("", |t| self.text_of(*t));
            let begins = match self.word(token) {
                "if" | "solve" | "produce" => true,
                "at" => next(1) == "rate",
                "let" => next(2) == "=",
                _ => false,
            };
            if begins && depth == 0 {
                return Some(i);
            }
        }
        None
    }

    fn before_arrow<'t>(&self, tokens: &'t [Lexed]) -> &'t [Lexed] {
        let at = self.arrow_outside_parentheses(tokens);
        let end = tokens.iter().position(|t| Some(t.1) >= at).unwrap_or(tokens.len());
        &tokens[..end]
    }

    /// Number of tokens of the head that the tokens begin with, contexts included; 0 without a head.
    fn head_length(&self, tokens: &[Lexed]) -> usize {
        let left = self.modules(tokens, false);
        let mut at = match tokens.get(left) {
            Some(t) if left > 0 && self.text_of(*t) == "<" => left + 1,
            _ => 0,
        };
        match self.module(&tokens[at..]) {
            0 => return 0,
            length => at += length,
        }
        if tokens.get(at).is_some_and(|t| self.text_of(*t) == ">") {
            let right = self.modules(&tokens[at + 1..], true);
            at += if right > 0 { right + 1 } else { 0 };
        }
        at
    }

    /// Number of tokens of the modules, with bare names as parameters, that the tokens begin with.
    fn modules(&self, tokens: &[Lexed], branches: bool) -> usize {
        let mut at = 0;
        loop {
            let bracket = branches && tokens.get(at).is_some_and(|t| matches!(self.text_of(*t), "[" | "]"));
            match if bracket { 1 } else { self.module(&tokens[at..]) } {
                0 => return at,
                length => at += length,
            }
        }
    }

    /// Number of tokens of the one module, with bare names as parameters, that the tokens begin with.
    fn module(&self, tokens: &[Lexed]) -> usize {
        let Some(&first) = tokens.first() else { return 0 };
        let name = match self.text_of(first) {
            "@" if tokens.get(1).is_some_and(|t| t.0 == Token::Word && t.1 == first.2) => 2,
            "±" | "+" | "-" | "&" | "^" | "\\" | "/" | "|" | "$" | "!" | ";" | "{" | "}" | "." => 1,
            text if text.starts_with(|c| SUBSCRIPTED.contains(c)) && text.contains('_') => 1,
            _ if first.0 == Token::Word && self.first_clause(tokens) != Some(0) => 1,
            _ => return 0,
        };
        if tokens.get(name).is_none_or(|t| t.0 != Token::Open) {
            return name;
        }
        let inside =
            tokens[name + 1..].iter().take_while(|t| matches!(t.0, Token::Word | Token::Comma)).count();
        match tokens.get(name + 1 + inside) {
            Some(t) if t.0 == Token::Close => name + inside + 2,
            _ => 0,
        }
    }
}
