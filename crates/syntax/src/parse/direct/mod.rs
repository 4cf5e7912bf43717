//! Items in the notation that most are written in, from text to syntax tree without pest, which takes ten times as long.
//!
//! `grammars/dlsys.pest` is the notation; what is here is a part of it. Where a function returns None, the text has a mistake or a form
//! that is not read here (a `match`, an aggregate, weights, repetitions, conditions in strings, most declarations). Then
//! the grammar reads the item from its beginning, so that messages come from it alone. In builds with debug assertions the grammar
//! reads every item, and both trees must be the same (`parse/mod.rs`).

mod expression;
mod scan;
#[cfg(test)]
mod tests;

use super::build::{Builder, with_head};
use crate::ast::{
    self, Action, Alternative, Clause, ContextPart, Equation, Expression, HeadModule, Item, Module, Name,
    Part,
};
use crate::grammar::Rule;
use crate::lexeme::SUBSCRIPTED;
use dlsys_diagnostic::Span;
use scan::Cursor;

/// Reads a declaration or a rule; None if the grammar has to.
pub(super) fn item(rule: Rule, text: &str, builder: &mut Builder) -> Option<Item> {
    let mut direct = Direct { cursor: Cursor::new(text), discrete: rule == Rule::step_item, builder };
    direct.cursor.lines();
    let item = match rule {
        Rule::rule_item => direct.rule()?,
        Rule::step_item => direct.discrete_rule()?,
        Rule::const_item => direct.constant()?,
        Rule::param_item => direct.param()?,
        Rule::def_item => direct.function()?,
        Rule::interpret_item => direct.drawing()?,
        _ => return None,
    };
    direct.cursor.lines();
    direct.cursor.is_at_end().then_some(item)
}

/// Reads a piece of the initial string; None if the grammar has to.
pub(super) fn modules(text: &str, builder: &mut Builder) -> Option<Vec<Part>> {
    let mut direct = Direct { cursor: Cursor::new(text), discrete: false, builder };
    let mut parts = Vec::new();
    direct.cursor.lines();
    while let Some(module) = direct.module()? {
        parts.push(Part::Module(module));
        direct.cursor.lines();
    }
    direct.cursor.is_at_end().then_some(parts)
}

/// A reader of one item.
struct Direct<'t, 'b, 'd> {
    cursor: Cursor<'t>,
    /// True in a discrete rule, where an arrow ends an expression and is no turn.
    discrete: bool,
    builder: &'b mut Builder<'d>,
}

impl<'t> Direct<'t, '_, '_> {
    /// The place of what begins at this byte and ends with the last token.
    fn span_from(&self, start: usize) -> Span {
        Span::new(self.builder.offset + start, self.builder.offset + self.cursor.end)
    }

    /// True if an arrow begins at the present place.
    fn is_arrow(&self) -> bool {
        let rest = self.cursor.rest();
        ["->", "-->", "→"].iter().any(|arrow| rest.starts_with(arrow))
    }

    fn interned(&mut self, start: usize, text: &str) -> Name {
        Name { text: self.builder.interner.get(text), span: self.span_from(start) }
    }

    fn name(&mut self) -> Option<Name> {
        self.cursor.next();
        let start = self.cursor.at;
        let text = self.cursor.name()?;
        Some(self.interned(start, text))
    }

    /// What stands between commas, behind a `(` that has been taken, and the `)`.
    fn list<T>(&mut self, mut one: impl FnMut(&mut Self) -> Option<T>) -> Option<Vec<T>> {
        let mut all = Vec::new();
        if self.cursor.next() != b')' {
            all.push(one(self)?);
            while self.cursor.sign(b',').is_some() {
                all.push(one(self)?);
            }
        }
        self.cursor.sign(b')')?;
        Some(all)
    }

    /// The names of parameters, if they come next.
    fn formals(&mut self) -> Option<Option<Vec<Name>>> {
        match self.cursor.sign(b'(') {
            Some(()) => Some(Some(self.list(Self::name)?)),
            None => Some(None),
        }
    }

    /// The name of a module that comes next, with its mark or as a sign; `Some("")` if none does, None where the grammar decides.
    fn module_name(&mut self) -> Option<&'t str> {
        let length = match self.cursor.next() {
            b'[' | b']' | b'{' | b'}' | b'%' => 1,
            b'-' if self.discrete && self.is_arrow() => 0,
            b'.' => usize::from(!self.cursor.rest().starts_with("..")),
            b'@' => {
                let mark = self.cursor.at;
                self.cursor.at += 1;
                // No space behind the mark.
                let word = self.cursor.peek_word();
                self.cursor.at = mark;
                if word.is_empty() || scan::is_reserved(word) {
                    return None;
                }
                1 + word.len()
            }
            sign if sign.is_ascii_punctuation() && SUBSCRIPTED.contains(sign as char) => {
                1 + self.cursor.subscript_length(self.cursor.at + 1)
            }
            _ => match self.cursor.peek_word() {
                "ε" | "epsilon" | "for" | "or" => return None,
                "if" | "solve" | "produce" | "then" | "else" | "at" => 0,
                word => word.len(),
            },
        };
        Some(if length == 0 { "" } else { self.cursor.take(length) })
    }

    /// The module that comes next: `Some(None)` if none does, None where the grammar decides.
    fn module(&mut self) -> Option<Option<Module>> {
        self.cursor.next();
        let start = self.cursor.at;
        let name = self.module_name()?;
        if name.is_empty() {
            return Some(None);
        }
        let arguments = match self.cursor.sign(b'(') {
            Some(()) => self.list(Self::expression)?,
            None => Vec::new(),
        };
        Some(Some(Module { name: self.builder.interner.get(name), span: self.span_from(start), arguments }))
    }

    /// The string of a successor: modules over any number of lines, or a sign for none.
    fn successor(&mut self) -> Option<Vec<Part>> {
        self.cursor.next();
        if matches!(self.cursor.peek_word(), "ε" | "epsilon") {
            self.cursor.name();
            return Some(Vec::new());
        }
        let mut parts = vec![Part::Module(self.module()??)];
        loop {
            self.cursor.lines();
            match self.module()? {
                Some(module) => parts.push(Part::Module(module)),
                None => return Some(parts),
            }
        }
    }

    /// The module of a head that comes next: `Some(None)` if none does, None where the grammar decides.
    fn head_module(&mut self) -> Option<Option<HeadModule>> {
        self.cursor.next();
        let start = self.cursor.at;
        let name = self.module_name()?;
        if name.is_empty() {
            return Some(None);
        }
        let name = self.interned(start, name);
        let parameters = self.formals()?.unwrap_or_default();
        Some(Some(HeadModule { name, parameters, span: self.span_from(start) }))
    }

    fn head_modules(&mut self) -> Option<Vec<HeadModule>> {
        let mut all = Vec::new();
        while let Some(module) = self.head_module()? {
            all.push(module);
        }
        Some(all)
    }

    /// The head of a rule, without branches in its right context.
    fn head(&mut self) -> Option<ast::Rule> {
        let start = self.cursor.at;
        let mut before = self.head_modules()?;
        let mut left = Vec::new();
        if self.cursor.sign(b'<').is_some() {
            left = std::mem::replace(&mut before, self.head_modules()?);
            if left.is_empty() {
                return None;
            }
        }
        let predecessor = before.pop()?;
        if !before.is_empty() {
            return None;
        }
        let mut right = Vec::new();
        if self.cursor.sign(b'>').is_some() {
            right = self.head_modules()?;
            if right.is_empty() || right.iter().any(|module| matches!(&*module.name.text, "[" | "]")) {
                return None;
            }
        }
        let shape = vec![ContextPart::Module; right.len()];
        Some(with_head(left, predecessor, (right, shape), self.span_from(start)))
    }

    fn rule(&mut self) -> Option<Item> {
        let first = self.builder.expressions.next();
        let mut rule = self.head()?;
        self.cursor.sign(b':')?;
        self.cursor.lines();
        while self.cursor.peek_word() == "let" {
            self.cursor.keyword("let")?;
            rule.locals.push(self.definition()?);
            self.cursor.lines();
        }
        while rule.clauses.is_empty() || !self.cursor.is_at_end() {
            rule.clauses.push(self.clause()?);
            self.cursor.lines();
        }
        rule.nodes = (first, self.builder.expressions.next());
        Some(Item::Rule(rule))
    }

    fn discrete_rule(&mut self) -> Option<Item> {
        let first = self.builder.expressions.next();
        let mut rule = self.head()?;
        rule.discrete = true;
        self.cursor.lines();
        let mut guard = None;
        if self.cursor.sign(b':').is_some() {
            self.cursor.lines();
            if self.cursor.sign(b'*').is_none() {
                guard = Some(self.expression()?);
            }
            self.cursor.lines();
        }
        let arrow = ["->", "-->", "→"].into_iter().find(|arrow| self.cursor.rest().starts_with(arrow))?;
        self.cursor.take(arrow.len());
        self.cursor.lines();
        let action = self.production()?;
        let span = self.span_from(rule.head.start as usize - self.builder.offset);
        rule.clauses.push(Clause { guard, hazard: None, action, span });
        rule.nodes = (first, self.builder.expressions.next());
        Some(Item::Rule(rule))
    }

    fn clause(&mut self) -> Option<Clause> {
        let start = self.cursor.at;
        let (mut guard, mut hazard) = (None, None);
        if self.cursor.keyword("if").is_some() {
            guard = Some(self.expression()?);
            self.cursor.lines();
        }
        let action = if self.cursor.keyword("solve").is_some() {
            self.cursor.lines();
            let mut equations = vec![self.equation()?];
            while self.cursor.sign(b',').is_some() {
                self.cursor.lines();
                equations.push(self.equation()?);
            }
            Action::Solve(equations)
        } else {
            if self.cursor.keyword("at").is_some() {
                self.cursor.keyword("rate")?;
                self.cursor.lines();
                hazard = Some(self.expression()?);
                self.cursor.lines();
            }
            self.cursor.keyword("produce")?;
            self.cursor.lines();
            self.production()?
        };
        Some(Clause { guard, hazard, action, span: self.span_from(start) })
    }

    /// A production without weights.
    fn production(&mut self) -> Option<Action> {
        let modules = self.successor()?;
        Some(Action::Produce(vec![Alternative { weight: None, modules }]))
    }

    /// `dx/dt = …` or `x = …`.
    fn equation(&mut self) -> Option<Equation> {
        self.cursor.next();
        let start = self.cursor.at;
        let word = self.cursor.name()?;
        if self.cursor.next() != b'/' {
            let parameter = self.interned(start, word);
            self.cursor.sign(b'=')?;
            return Some(Equation::Value { parameter, value: self.expression()? });
        }
        let name = word.strip_prefix('d').filter(|name| scan::begins_with_letter(name))?;
        let parameter = self.interned(start + 1, name);
        self.cursor.take(1);
        self.cursor.keyword("dt")?;
        self.cursor.sign(b'=')?;
        Some(Equation::Rate { parameter, rate: self.expression()? })
    }

    /// `NAME = VALUE`
    fn definition(&mut self) -> Option<(Name, Expression)> {
        let name = self.name()?;
        self.cursor.sign(b'=')?;
        Some((name, self.expression()?))
    }

    fn constant(&mut self) -> Option<Item> {
        self.cursor.keyword("const")?;
        let (name, value) = self.definition()?;
        Some(Item::Const { name, value })
    }

    fn param(&mut self) -> Option<Item> {
        self.cursor.keyword("param")?;
        let (name, value) = self.definition()?;
        Some(Item::Param { name, value, range: None })
    }

    fn function(&mut self) -> Option<Item> {
        self.cursor.keyword("def")?;
        let name = self.name()?;
        let parameters = self.formals()??;
        self.cursor.sign(b'=')?;
        Some(Item::Def { name, parameters, body: self.expression()? })
    }

    fn drawing(&mut self) -> Option<Item> {
        self.cursor.keyword("interpret")?;
        let head = self.head_module()??;
        self.cursor.sign(b':')?;
        self.cursor.lines();
        Some(Item::Interpret { head, drawn: self.successor()? })
    }
}
