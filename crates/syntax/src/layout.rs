//! First pass over the text: the boundaries of declarations and the significant line breaks.
//!
//! Comments, line breaks that end nothing, tabs and the like become spaces; all other bytes keep their places, so that every position
//! in the result is a position in the file. The text is cut into items (declarations and rules), so that a mistake in
//! one does not hide those in the others, and so that the parser's memory is bounded by an item, not by the file.
//! Nesting is bounded here, before any recursive pass.
//!
//! A line break ends an expression or a condition, except inside parentheses, after an operator or a
//! comma, or before `then` and `else` (LANGUAGE, "Text"). Inside a string of modules it has no meaning.

mod ahead;
mod keywords;
mod recovery;
mod tokens;

use crate::declarations::{Begins, Body, Declaration};
use crate::lexeme::{Lexeme, SUBSCRIPTED, Token, has_subscript, name_end, number_length};
use ahead::is_space;
use dlsys_diagnostic::{Diagnostic, Span};

/// Deepest nesting of parentheses, signs, powers and `if` that an expression may have.
pub const MAX_DEPTH: usize = 100;

/// Maximum size of one declaration or rule other than the initial string, in bytes.
const MAX_ITEM: usize = 1 << 20;

/// The kind of an item, determined by its first word, its colon or its arrow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ItemKind {
    Declaration(&'static Declaration),
    Rule,
    /// A discrete rule, recognised by its arrow.
    Step,
    /// A line that begins neither a declaration nor a rule.
    Unknown,
}

impl ItemKind {
    pub fn declaration(self) -> Option<&'static Declaration> {
        match self {
            ItemKind::Declaration(declaration) => Some(declaration),
            _ => None,
        }
    }

    /// The body of a declaration.
    pub fn body(self) -> Option<Body> {
        self.declaration().map(|declaration| declaration.body)
    }

    /// True for a declaration that ends with a string of modules.
    pub fn has_string(self) -> bool {
        self.declaration().is_some_and(Declaration::has_string)
    }
}

/// One declaration or rule.
#[derive(Clone, Copy, Debug)]
pub struct RawItem {
    pub kind: ItemKind,
    pub start: usize,
    pub end: usize,
    /// Byte after the first `:` outside parentheses.
    pub after_colon: Option<usize>,
    /// True if an error in it has been reported; the item is not parsed.
    pub broken: bool,
}

/// The text cut into items.
#[derive(Debug)]
pub struct Layout {
    pub text: String,
    pub items: Vec<RawItem>,
    pub errors: Vec<Diagnostic>,
}

/// The class of the last significant token, which decides the meaning of line breaks and signs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Last {
    /// A token that can end an expression.
    Operand,
    /// A token that cannot end an expression.
    Operator,
    /// `<` or `>`: cannot end an expression, and may stand at the end of a line in a rule's head.
    Angle,
    Colon,
}

/// An open parenthesis and the recursion that is pending inside it.
#[derive(Clone, Copy, Debug, Default)]
struct Level {
    at: usize,
    /// Signs and powers waiting for their right operand.
    right: usize,
    /// `if` without its `else`.
    ifs: usize,
    /// True if a `match` has begun, so that `case` may continue it.
    matching: bool,
    /// True if opened by an aggregate such as `sum(`, which contains a colon.
    is_sum: bool,
    /// True for the group of a repetition or a condition in a string: its content is a string.
    is_string: bool,
    /// True between the `for` or `if` of a string and its colon, where expressions stand.
    in_header: bool,
    /// True if the next parenthesis is that of a group.
    group_next: bool,
}

struct Scanner<'t> {
    text: &'t str,
    out: Vec<u8>,
    items: Vec<RawItem>,
    errors: Vec<Diagnostic>,
    /// True in a string of modules, where line breaks have no meaning.
    in_string: bool,
    /// True in successors with weights, such as `produce 2: F or 1: G`.
    weighted: bool,
    /// True if a weight may follow the last token: `produce`, or an `or` between successors.
    weight_next: bool,
    last: Last,
    levels: Vec<Level>,
    /// Sum of the pending operands and `if`s over `levels`.
    pending: usize,
    /// A line break that is significant unless the next line begins with `then` or `else`.
    held_break: Option<usize>,
    /// Start of a run of lines that each end with `<` or `>`.
    run_of_angles: Option<usize>,
    /// The line before, if it may be the head of a rule that lacks its colon.
    head_before: Option<(usize, usize)>,
    /// True if the present token is a parenthesis or a word of a repetition or a condition in a string.
    group: bool,
    /// The token after the present one on its line.
    next: Option<Token>,
    /// True if the expression before the last line break has a `match`.
    matching: bool,
    /// All tokens, if requested.
    lexemes: Option<Vec<Lexeme>>,
}

/// Cuts a text into items. Time and memory are linear in the text.
pub fn layout(text: &str) -> Layout {
    scan(text, None).0
}

/// Cuts a text into items and lists all tokens.
pub fn lexemes(text: &str) -> (Layout, Vec<Lexeme>) {
    let (layout, lexemes) = scan(text, Some(Vec::new()));
    (layout, lexemes.unwrap_or_default())
}

fn scan(text: &str, lexemes: Option<Vec<Lexeme>>) -> (Layout, Option<Vec<Lexeme>>) {
    let mut scanner = Scanner {
        text,
        out: text.as_bytes().to_vec(),
        items: Vec::new(),
        errors: Vec::new(),
        in_string: false,
        weighted: false,
        weight_next: false,
        last: Last::Operand,
        levels: vec![Level::default()],
        pending: 0,
        held_break: None,
        run_of_angles: None,
        head_before: None,
        group: false,
        next: None,
        matching: false,
        lexemes,
    };
    let mut tokens = Vec::new();
    let mut start = 0;
    while start < text.len() {
        let end = memchr_newline(text, start);
        scanner.tokenize(start, end, &mut tokens);
        scanner.line(start, end, &tokens);
        start = end + 1;
    }
    scanner.close_item(text.len());
    let Scanner { out, mut items, mut errors, lexemes, .. } = scanner;
    for item in &mut items {
        if item.end - item.start > MAX_ITEM && item.kind.body() != Some(Body::String) && !item.broken {
            item.broken = true;
            let message = format!("this declaration is longer than {} KiB", MAX_ITEM >> 10);
            errors.push(
                Diagnostic::error(message)
                    .at(Span::new(item.start, item.start + first_char(text, item.start)), "it begins here")
                    .help("cut it into several: constants, functions, or rules with a head each"),
            );
        }
    }
    // Whole characters have been replaced with ASCII spaces and colons only.
    let text = String::from_utf8(out).expect("whole characters were replaced");
    (Layout { text, items, errors }, lexemes)
}

/// A text in which all that stands for a space is one, at the same places. Not for texts with strings in quotes.
pub fn with_spaces(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match is_space(c) {
            true => out.extend(std::iter::repeat_n(' ', c.len_utf8())),
            false => out.push(c),
        }
    }
    out
}

fn memchr_newline(text: &str, from: usize) -> usize {
    text[from..].find('\n').map_or(text.len(), |i| from + i)
}

fn first_char(text: &str, at: usize) -> usize {
    text[at..].chars().next().map_or(0, char::len_utf8)
}

impl<'t> Scanner<'t> {
    /// Collects a line's tokens and blanks its comment.
    fn tokenize(&mut self, start: usize, end: usize, tokens: &mut Vec<(Token, usize, usize)>) {
        tokens.clear();
        let line = &self.text[start..end];
        let bytes = line.as_bytes();
        let mut next = 0;
        while let Some(&byte) = bytes.get(next) {
            let i = next;
            let (token, to) = match byte {
                b' ' => {
                    next += 1;
                    continue;
                }
                b'#' => {
                    self.out[start + i..end].fill(b' ');
                    break;
                }
                b'"' => (Token::Text, line[i + 1..].find('"').map_or(line.len(), |length| i + length + 2)),
                b'0'..=b'9' => (Token::Number, i + number_length(&line[i..])),
                b'(' => (Token::Open, i + 1),
                b')' => (Token::Close, i + 1),
                b',' => (Token::Comma, i + 1),
                b':' => (Token::Colon, i + 1),
                b'a'..=b'z' | b'A'..=b'Z' => (Token::Word, name_end(line, i + 1)),
                _ => {
                    let c = line[i..].chars().next().expect("a character begins here");
                    let to = i + c.len_utf8();
                    if c.is_whitespace() {
                        if is_space(c) {
                            self.out[start + i..start + to].fill(b' ');
                        }
                        next = to;
                        continue;
                    }
                    // A symbol with a subscript: `+_l`.
                    let subscribed = SUBSCRIPTED.contains(c) && has_subscript(&line[to..]);
                    let token = if c.is_alphabetic() { Token::Word } else { Token::Symbol };
                    (token, if subscribed || token == Token::Word { name_end(line, to) } else { to })
                }
            };
            tokens.push((token, start + i, start + to));
            next = to;
        }
    }

    fn word(&self, token: (Token, usize, usize)) -> &'t str {
        if token.0 == Token::Word { &self.text[token.1..token.2] } else { "" }
    }

    fn line(&mut self, start: usize, end: usize, tokens: &[(Token, usize, usize)]) {
        let Some(&first) = tokens.first() else {
            self.line_break(end);
            return;
        };
        let word = self.word(first);
        let in_sum = self.levels.last().is_some_and(|level| level.is_sum);
        let colon = !in_sum && self.has_colon(tokens) && !self.goes_on_with_weight(tokens);
        let arrow = self.arrow_outside_parentheses(tokens);
        if arrow == Some(first.1) || arrow.is_some() && self.goes_on() {
            // The item before is the head of a discrete rule, broken over lines.
            self.goes_on_discrete(start, arrow == Some(first.1));
        }
        let in_string = self.in_string && self.levels.len() == 1;
        let starts = self.starts_item(word, colon, arrow.is_some(), tokens);
        if let Some(head) = self.head_without_colon(starts, colon, tokens) {
            let kind = if starts == Some(ItemKind::Step) { ItemKind::Step } else { ItemKind::Rule };
            self.begin_without_colon(head, kind);
            (self.in_string, self.weighted, self.weight_next) = (false, false, false);
            self.last = Last::Colon;
            self.held_break = None;
        } else if let Some(kind) = starts {
            let mut from = first.1;
            if matches!(kind, ItemKind::Rule | ItemKind::Step)
                && self.last == Last::Angle
                && self.levels.len() == 1
            {
                // The head is broken over lines: the item begins on the first of them.
                from = self.run_of_angles.unwrap_or(from);
            }
            self.close_item(from);
            if kind == ItemKind::Unknown
                && first.0 == Token::Symbol
                && let Some(cut) = self.items.last_mut()
            {
                // The item before continues here by mistake; the error points at this line only.
                cut.broken = true;
            }
            self.items.push(RawItem { kind, start: from, end: from, after_colon: None, broken: false });
            (self.in_string, self.weighted, self.weight_next) = (false, false, false);
            self.last = Last::Operator;
            self.held_break = None;
        } else if let Some(at) = self.held_break.take()
            && (matches!(word, "then" | "else") || word == "case" && self.matching)
        {
            // `then`, `else` and `case` remove the break before them, and any empty lines.
            for byte in &mut self.out[at..start] {
                if *byte == b'\n' {
                    *byte = b' ';
                }
            }
        }
        self.head_before = self.remembered_head(starts, in_string, tokens);
        for (i, &token) in tokens.iter().enumerate() {
            self.next = tokens.get(i + 1).map(|next| next.0);
            self.token(token);
        }
        self.run_of_angles = match (self.last, self.run_of_angles) {
            // A run does not reach back beyond the item that is open.
            (Last::Angle, Some(run)) if starts.is_none() => Some(run),
            (Last::Angle, _) => Some(first.1),
            _ => None,
        };
        self.line_break(end);
    }

    /// The kind of item that a line begins, if it begins one.
    fn starts_item(
        &self,
        word: &str,
        colon: bool,
        arrow: bool,
        tokens: &[(Token, usize, usize)],
    ) -> Option<ItemKind> {
        let declared = Declaration::of_word(word);
        let inside = self.levels.len() > 1;
        let follows = |i: usize| tokens.get(i).map(|t| t.0);
        let plain = !colon && matches!(follows(1), Some(Token::Word | Token::Text));
        let begins = |declared: &&'static Declaration| match declared.begins {
            Begins::Always => true,
            Begins::BeforeName => plain,
            Begins::BeforeValue => plain || !colon && self.begins_value(tokens),
        };
        if let Some(declared) = declared.filter(begins) {
            // A declaration begins an item even inside parentheses that were never closed; an
            // identifier named `angle` does not.
            let next_is_word = matches!(tokens.get(1), Some((Token::Word | Token::Text, ..)));
            if !inside || next_is_word || colon || arrow {
                return Some(ItemKind::Declaration(declared));
            }
        }
        // A clause with an extra colon is still a clause.
        let is_let = word == "let"
            && follows(1) == Some(Token::Word)
            && tokens.get(2).is_some_and(|t| &self.text[t.1..t.2] == "=");
        let case = word == "case" && (self.matching || self.level_matches());
        let clause = matches!(word, "if" | "solve" | "produce") && !self.items.is_empty() || is_let || case;
        let clause = clause || tokens.first().is_some_and(|t| self.is_at_rate(t.1, t.2));
        // The same holds for an extra arrow; and the head of a discrete rule may be on the line before.
        let goes_on = self.items.last().is_some_and(|i| i.kind == ItemKind::Step) && !self.in_string;
        if arrow && !clause && !goes_on {
            return Some(ItemKind::Step);
        }
        if colon && !clause {
            return Some(ItemKind::Rule);
        }
        let Some(current) = self.items.last() else { return Some(ItemKind::Unknown) };
        if self.is_no_string(tokens) {
            return Some(ItemKind::Unknown);
        }
        if inside || self.in_string || self.last != Last::Operand {
            return None;
        }
        let continues = match current.kind {
            // Lines after an unknown line yield no further errors.
            ItemKind::Rule | ItemKind::Unknown => clause || matches!(word, "then" | "else"),
            ItemKind::Step => true,
            kind if kind.has_string() => true,
            _ => case || matches!(word, "then" | "else"),
        };
        (!continues).then_some(ItemKind::Unknown)
    }

    fn close_item(&mut self, end: usize) {
        if self.levels.len() > 1 {
            let at = self.levels.last().expect("two levels").at;
            self.fault(
                Diagnostic::error("this `(` is never closed")
                    .at(Span::new(at, at + 1), "expected `)` for it")
                    .help("write the `)` where the parameters or the term end"),
            );
        }
        self.levels.truncate(1);
        self.levels[0] = Level::default();
        self.pending = 0;
        if let Some(item) = self.items.last_mut() {
            item.end = end;
        }
    }

    fn fault(&mut self, error: Diagnostic) {
        if let Some(item) = self.items.last_mut() {
            if !item.broken {
                self.errors.push(error);
            }
            item.broken = true;
        }
    }
}
