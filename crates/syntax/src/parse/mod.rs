//! Text to syntax tree.
//!
//! ```text
//! text ──layout──▶ items ──pest──▶ pairs ──build──▶ Document
//!                        └────────direct───────────────▲
//! ```
//!
//! Each item is parsed separately, so that an error in one does not affect the others.

mod advice;
pub(crate) mod build;
mod direct;
mod expected;
mod expression;
mod hints;

use std::collections::HashSet;

use pest::Parser;

use crate::Errors;
use crate::ast::{self, Document, Expression, HeadModule, Item, Part, modules_of};
use crate::declarations::{Body, Named};
use crate::foreign_lines::Stray;
use crate::grammar::{Grammar, Pair, Rule};
use crate::layout::{ItemKind, RawItem, layout, with_spaces};
use crate::lexeme::in_name;
use crate::{foreign_lines, foreign_syntax};
use dlsys_diagnostic::{Diagnostic, Source, Span};

/// Maximum number of errors that are collected from one text.
const MAX_ERRORS: usize = 50;

/// Maximum number of modules of an initial string.
const MAX_AXIOM: usize = 10_000_000;

/// Parses the text of a model. The document contains every item without errors; [`Document::unread`] has the names of
/// global declarations with errors.
///
/// Included texts are not parsed: see [`read`](super::read).
pub fn parse(source: &Source) -> (Document, Vec<Diagnostic>) {
    let mut reader = Reader::default();
    reader.document.items = reader.read(&source.text);
    (reader.document, reader.errors)
}

/// Parses texts one after another into one document.
#[derive(Default)]
pub(super) struct Reader {
    /// The expressions and names so far; the caller adds the items.
    pub document: Document,
    pub errors: Vec<Diagnostic>,
    interner: build::Interner,
    /// Names of the functions that the texts so far declare.
    defined: HashSet<String>,
}

impl Reader {
    /// The items of a text. If there are errors and comments of C, these are the errors, with those in the rest of the text: what is within
    /// a comment says nothing about it.
    pub fn read(&mut self, text: &str) -> Vec<(Item, Span)> {
        let Document { strays, unread, commented, commented_widths, .. } = &self.document;
        let before = [strays.len(), unread.len(), commented.len(), commented_widths.len()];
        let errors = self.errors.len();
        let items = self.read_once(text);
        if self.errors.len() == errors {
            return items;
        }
        let Some((comments, rest)) = foreign_lines::comments(text) else { return items };
        let Document { strays, unread, commented, commented_widths, .. } = &mut self.document;
        strays.truncate(before[0]);
        unread.truncate(before[1]);
        commented.truncate(before[2]);
        commented_widths.truncate(before[3]);
        self.errors.truncate(errors);
        self.errors.extend(comments);
        self.read_once(&rest)
    }

    fn read_once(&mut self, text: &str) -> Vec<(Item, Span)> {
        let cut = layout(text);
        self.errors.extend(cut.errors);
        if text.contains("#define") {
            for (at, name, meaning) in foreign_syntax::commented_definitions(text) {
                let number = self.document.commented.len();
                self.document.commented.push((name.into(), meaning.to_owned()));
                let span = Span::new(at, at + "#define".len());
                self.document.strays.push((span, Stray::Definition(number)));
            }
        }
        for (at, word) in foreign_syntax::directives(text) {
            self.document.strays.push((Span::new(at, at + word.len()), Stray::Directive));
        }
        for (at, inside) in foreign_syntax::commented_widths(text) {
            let in_item = cut.items.iter().rfind(|item| item.start < at).is_some_and(|item| {
                matches!(item.kind, ItemKind::Rule | ItemKind::Step) || item.kind.has_string()
            });
            if in_item {
                let span = Span::new(at, at + inside.len() + 3);
                self.document.commented_widths.push((span, inside.trim().to_owned()));
            }
        }
        for (at, stray) in foreign_lines::strays(text) {
            let item = cut.items.iter().rfind(|item| item.start <= at);
            let item = item.filter(|item| {
                matches!(item.kind, ItemKind::Rule | ItemKind::Step) || item.kind.has_string()
            });
            let is_last = |item: &RawItem| cut.text[at + 1..item.end.max(at + 1)].trim().is_empty();
            if item.is_some_and(|item| is_last(item) == (stray == Stray::End) || stray == Stray::Comment) {
                let length = if stray == Stray::Comment { 2 } else { 1 };
                self.document.strays.push((Span::new(at, at + length), stray));
            }
        }
        let functions = cut.items.iter().filter(|item| {
            item.kind.declaration().is_some_and(|declaration| declaration.named == Named::Function)
        });
        self.defined.extend(functions.filter_map(|item| declared_word(&cut.text, item).map(str::to_owned)));
        let mut items = Vec::new();
        for item in &cut.items {
            if self.errors.len() >= MAX_ERRORS {
                break;
            }
            if item.broken {
                self.document.unread.extend(declared_name(&cut.text, item));
                continue;
            }
            let (expressions, interner) = (&mut self.document.expressions, &mut self.interner);
            let mut builder =
                build::Builder { expressions, interner, offset: 0, defined: Some(&self.defined) };
            let foreign = (item.kind == ItemKind::Step)
                .then(|| foreign_lines::rule(&cut.text[item.start..item.end], item.start))
                .flatten();
            if let Some(error) = foreign {
                self.errors.push(error);
                continue;
            }
            match read_item(&cut.text, item, &mut builder) {
                Ok(read) => items.push((read, trimmed(&cut.text, item))),
                Err(error) => {
                    self.errors.push(*error);
                    self.document.unread.extend(declared_name(&cut.text, item));
                }
            }
        }
        items
    }
}

/// The name that an item declares or appears to declare: `const k …`, but also `cosnt k …` and `k = …`.
fn declared_name(text: &str, item: &RawItem) -> Option<std::sync::Arc<str>> {
    Some(declared_word(text, item)?.into())
}

fn declared_word<'t>(text: &'t str, item: &RawItem) -> Option<&'t str> {
    let line = text[item.start..item.end].lines().next()?;
    let mut words = line.split(|c: char| !(c.is_alphanumeric() || c == '_')).filter(|w| !w.is_empty());
    let first = words.next()?;
    let name = match item.kind {
        ItemKind::Declaration(declaration) => match declaration.named {
            Named::Word | Named::Function => words.next()?,
            Named::AfterOption => words.find(|word| !declaration.has_before_name(word))?,
            _ => return None,
        },
        ItemKind::Unknown if line.strip_prefix(first)?.trim_start().starts_with('=') => first,
        ItemKind::Unknown => words.next()?,
        _ => return None,
    };
    Some(name)
}

/// Parses one expression.
pub fn parse_expression(source: &Source) -> Result<(Document, Expression), Errors> {
    read_alone(source, Rule::lone_expr, Errors::from, |builder, pair| {
        builder.expression(pair.into_inner().next().expect("the grammar has an expression here"))
    })
}

/// Parses a measure: the head of a module and the expression that is summed; without one, modules are counted.
pub fn parse_measure(source: &Source) -> Result<(Document, HeadModule, Option<Expression>), Errors> {
    let unread = |_| Errors::from(Diagnostic::error("this cannot be measured").help(MEASURE));
    let (document, (head, expression)) =
        read_alone(source, Rule::measure, unread, |builder, pair| builder.measure(pair))?;
    Ok((document, head, expression))
}

/// Parses a text that is no model, by an entry rule of the grammar; `unread` makes the error of a text that cannot be
/// cut into tokens.
fn read_alone<T>(
    source: &Source,
    rule: Rule,
    unread: impl FnOnce(Vec<Diagnostic>) -> Errors,
    build: impl FnOnce(&mut build::Builder, Pair) -> build::Built<T>,
) -> Result<(Document, T), Errors> {
    // The layout bounds the nesting.
    let cut = layout(&format!("const it =\n{}", source.text));
    if !cut.errors.is_empty() {
        return Err(unread(cut.errors));
    }
    let mut document = Document::default();
    let mut interner = build::Interner::default();
    let mut builder = build::Builder {
        expressions: &mut document.expressions,
        interner: &mut interner,
        offset: 0,
        defined: None,
    };
    let text = with_spaces(&source.text);
    let pair = pest_parse(rule, &text, 0).map_err(|error| match rule {
        Rule::measure => Errors::from((*error).help(MEASURE)),
        _ => Errors::from(*error),
    })?;
    let built = build(&mut builder, pair).map_err(|error| Errors::from(*error))?;
    Ok((document, built))
}

/// The notation of a measure, for messages.
pub const MEASURE: &str = "a measure is a module, with names for its parameters, and what is added up over all of them: `F(x): x`; without that they are counted: `F(x)`";

fn trimmed(text: &str, item: &RawItem) -> Span {
    let body = text[item.start..item.end].trim_end();
    Span::new(item.start, item.start + body.len())
}

fn pest_parse(rule: Rule, text: &str, offset: usize) -> Result<Pair<'_>, Box<Diagnostic>> {
    match Grammar::parse(rule, text) {
        Ok(mut pairs) => Ok(pairs.next().expect("an entry rule gives one pair")),
        Err(error) => Err(Box::new(expected::explain(rule, &error, text, offset))),
    }
}

fn read_item(text: &str, item: &RawItem, builder: &mut build::Builder) -> Result<Item, Box<Diagnostic>> {
    let rule = match item.kind {
        ItemKind::Declaration(declaration) if declaration.body == Body::String => {
            return read_axiom(text, item, builder);
        }
        ItemKind::Declaration(declaration) => declaration.rule,
        ItemKind::Rule => Rule::rule_item,
        ItemKind::Step => Rule::step_item,
        ItemKind::Unknown => return Err(Box::new(expected::unknown_line(text, item))),
    };
    builder.offset = item.start;
    let text = &text[item.start..item.end];
    directly_or(
        builder,
        |builder| direct::item(rule, text, builder),
        |builder| builder.item(pest_parse(rule, text, item.start)?),
    )
}

/// What `direct` reads, or what the grammar does where that gives up. With debug assertions both read, and must agree.
fn directly_or<T: PartialEq>(
    builder: &mut build::Builder,
    direct: impl FnOnce(&mut build::Builder) -> Option<T>,
    grammar: impl FnOnce(&mut build::Builder) -> build::Built<T>,
) -> build::Built<T> {
    let first = builder.expressions.next();
    let read = direct(builder);
    if !cfg!(debug_assertions)
        && let Some(read) = read
    {
        return Ok(read);
    }
    let nodes = builder.expressions.split_off(first);
    let by_grammar = grammar(builder);
    if read.is_some() {
        assert!(by_grammar.as_ref().ok() == read.as_ref(), "both readers give the same tree");
        assert!(builder.expressions.since(first) == nodes.since(ast::ExprId(0)), "with the same expressions");
    }
    by_grammar
}

/// Parses the initial string piece by piece, so that the parser's memory does not grow with the string.
fn read_axiom(text: &str, item: &RawItem, builder: &mut build::Builder) -> Result<Item, Box<Diagnostic>> {
    const PIECE: usize = 1 << 16;
    let head = text[item.start..item.end].split(':').next().unwrap_or_default().trim_end();
    let words: Vec<&str> = head.split_whitespace().collect();
    let Some(mut at) = item.after_colon.filter(|_| matches!(words[..], ["axiom"] | ["initial", "string"]))
    else {
        let line = text[item.start..item.end].lines().next().unwrap_or_default();
        if let Some(said) = foreign_syntax::line(line, item.start) {
            return Err(Box::new(said));
        }
        return Err(Box::new(
            Diagnostic::error("the initial string is written `initial string: …` or `axiom: …`")
                .at(
                    Span::new(item.start, item.start + head.lines().next().unwrap_or("").len()),
                    if words == ["initial"] {
                        "expected `string:` after this"
                    } else {
                        "expected a `:` after this"
                    },
                )
                .help(advice::initial_string(line)),
        ));
    };
    let mut modules: Vec<Part> = Vec::new();
    let mut empty = false;
    while at < item.end {
        let end = piece_end(&text[..item.end], at, PIECE);
        let piece = &text[at..end];
        if matches!(piece.trim(), "ε" | "epsilon") && modules.is_empty() && end == item.end {
            empty = true;
            break;
        }
        builder.offset = at;
        modules.extend(directly_or(
            builder,
            |builder| direct::modules(piece, builder),
            |builder| builder.successor(pest_parse(Rule::modules, piece, at)?),
        )?);
        if modules.len() > MAX_AXIOM
            && let Some(last) = modules_of(&modules[MAX_AXIOM..]).next()
        {
            return Err(Box::new(
                Diagnostic::error(format!("the initial string has more than {MAX_AXIOM} modules"))
                    .at(last.span, "this one is too many")
                    .help("begin with fewer, and let rules make the others"),
            ));
        }
        at = end;
    }
    if modules.is_empty() && !empty {
        return Err(Box::new(
            Diagnostic::error("the initial string is empty")
                .at(trimmed(text, item), "expected modules after the `:`, such as `F(1) [ +(45) A ]`")
                .help("an initial string that is meant to be empty is written `ε`"),
        ));
    }
    Ok(Item::Axiom(modules))
}

/// The end of a piece of about `size` bytes: white space outside parentheses, and not within a repetition or a condition.
fn piece_end(text: &str, from: usize, size: usize) -> usize {
    let mut depth = 0i64;
    // True from a `for` or `if` to the end of its group, and before an `else`; `in_body` from the `(` of the group.
    let (mut in_part, mut in_body) = (false, false);
    for (i, b) in text.bytes().enumerate().skip(from) {
        match b {
            b'(' => {
                let before = text[from..i].trim_end();
                in_body |= depth == 0 && in_part && (before.ends_with(':') || before.ends_with("else"));
                depth += 1;
            }
            b')' => {
                depth -= 1;
                if depth <= 0 && std::mem::take(&mut in_body) {
                    in_part = text[i + 1..].trim_start().starts_with("else");
                }
            }
            b'f' | b'i' if depth <= 0 && !text[..i].ends_with(in_name) => {
                let word = text[i..].split(|c| !in_name(c)).next();
                in_part |= matches!(word, Some("for" | "if"));
            }
            b' ' | b'\n' | b']' if depth <= 0 && !in_part && i - from >= size => return i,
            _ => {}
        }
    }
    text.len()
}
