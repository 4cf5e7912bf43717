//! A text as lines of pieces. A piece is a token of the grammar, so that the formatter never splits one.

use std::collections::HashSet;

use crate::declarations::{Body, Named};
use crate::layout::{ItemKind, RawItem, lexemes};
use crate::lexeme::{Lexeme, Token};

/// Symbols of several characters.
const LONG: [&str; 9] = ["-->", "->", "<=", ">=", "!=", "..", "==", "&&", "||"];

/// A token of the grammar.
#[derive(Clone, Copy, Debug)]
pub struct Piece<'t> {
    pub text: &'t str,
    pub token: Token,
    /// Number of characters before it on its line.
    pub column: usize,
    /// True if it follows the piece before it without a space.
    pub touches: bool,
    /// True outside parentheses in a string of modules, a list of names or a rule's head, where the input decides the spaces.
    pub grouped: bool,
    /// See [`Lexeme`].
    pub in_string: bool,
    pub after_operand: bool,
    pub operator: bool,
    pub depth: usize,
    pub kind: ItemKind,
    pub place: Place,
    /// See [`Lexeme`].
    pub group: bool,
    /// True for a number that multiplies the factor directly behind it.
    pub factor: bool,
}

/// The part of a declaration or rule in which a piece stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// The first piece.
    Start,
    /// Before the colon, or in a declaration that has none.
    Head,
    /// The colon.
    Colon,
    Body,
}

/// A line of the text.
#[derive(Clone, Debug)]
pub struct Line<'t> {
    pub pieces: Vec<Piece<'t>>,
    /// The comment with its `#`, without spaces at its end.
    pub comment: Option<&'t str>,
    /// Number of characters before the comment.
    pub comment_column: usize,
    /// True if its line break ends an expression.
    pub ends: bool,
}

/// The lines of a text.
pub fn lines(text: &str) -> Vec<Line<'_>> {
    let (layout, lexemes) = lexemes(text);
    let functions = functions(text, &layout.items);
    let mut reader = Reader { text, items: &layout.items, lexemes: &lexemes, functions, next: 0, item: 0 };
    let mut lines = Vec::new();
    let mut start = 0;
    while start < text.len() {
        let end = text[start..].find('\n').map_or(text.len(), |i| start + i);
        let mut line = reader.line(start, end);
        line.ends = layout.text.as_bytes().get(end).is_none_or(|&byte| byte == b'\n');
        lines.push(line);
        start = end + 1;
    }
    // The end of the text ends every expression.
    if let Some(last) = lines.iter_mut().rfind(|line| !line.pieces.is_empty()) {
        last.ends = true;
    }
    lines
}

/// The names of the functions that a text declares.
fn functions<'t>(text: &'t str, items: &[RawItem]) -> HashSet<&'t str> {
    let defined = items.iter().filter(|item| {
        item.kind.declaration().is_some_and(|declaration| declaration.named == Named::Function)
    });
    let name = |item: &RawItem| text.get(item.start..item.end)?.split_once('(')?.0.split_whitespace().nth(1);
    defined.filter_map(name).collect()
}

struct Reader<'t, 'l> {
    text: &'t str,
    items: &'l [RawItem],
    lexemes: &'l [Lexeme],
    /// Names of functions that the text declares: `step` is a word of `frames`, and may be one.
    functions: HashSet<&'t str>,
    /// Index of the next lexeme, and number of the current item, from 1.
    next: usize,
    item: usize,
}

impl<'t> Reader<'t, '_> {
    fn line(&mut self, start: usize, end: usize) -> Line<'t> {
        let mut pieces: Vec<Piece<'t>> = Vec::new();
        // Columns are counted along the line, each character once.
        let (mut counted, mut column, mut last) = (start, 0, start);
        while let Some(&first) = self.lexemes.get(self.next).filter(|lexeme| lexeme.start < end) {
            let until = self.whole(first);
            let mut operator = first.operator;
            while let Some(part) = self.lexemes.get(self.next).filter(|lexeme| lexeme.start < until) {
                operator = part.operator;
                self.next += 1;
            }
            column += self.text[counted..first.start].chars().count();
            counted = first.start;
            let touches = last == first.start && !pieces.is_empty();
            let is_call = self.text[until..].starts_with('(')
                && self.functions.contains(&self.text[first.start..until]);
            operator &= !is_call;
            if let Some(number) = pieces.last_mut()
                && touches
                && number.token == Token::Number
                && matches!(first.token, Token::Word | Token::Open)
            {
                number.factor = true;
            }
            pieces.push(Piece { column, touches, operator, ..self.piece(first, until) });
            last = until;
        }
        let rest = &self.text[last..end];
        let comment = rest.find('#').map(|at| rest[at..].trim_end());
        let comment_column = rest.find('#').map_or(0, |at| self.text[start..last + at].chars().count());
        Line { pieces, comment, comment_column, ends: true }
    }

    /// The end, in bytes, of the token of the grammar that begins with a lexeme.
    fn whole(&self, first: Lexeme) -> usize {
        let rest = &self.text[first.start..];
        match first.token {
            Token::Symbol => {
                // In `F&&_i` the second symbol has a subscript.
                let ends_at = |end: usize| self.lexemes[self.next..].iter().take(3).any(|l| l.end == end);
                let long = LONG.iter().find(|l| rest.starts_with(**l) && ends_at(first.start + l.len()));
                long.map_or(first.end, |long| first.start + long.len())
            }
            _ => first.end,
        }
    }

    fn piece(&mut self, first: Lexeme, until: usize) -> Piece<'t> {
        while self.items.get(self.item).is_some_and(|item| item.start <= first.start) {
            self.item += 1;
        }
        let item = self.item.checked_sub(1).map(|i| &self.items[i]);
        let kind = item.map_or(ItemKind::Unknown, |item| item.kind);
        let place = match item {
            Some(item) if item.start == first.start => Place::Start,
            Some(item) => match item.after_colon {
                Some(after) if first.end == after => Place::Colon,
                Some(after) if first.start >= after => Place::Body,
                _ => Place::Head,
            },
            None => Place::Head,
        };
        let names = kind.body() == Some(Body::Names);
        let has_head = kind == ItemKind::Rule || kind.body() == Some(Body::Drawing);
        let head = has_head && place != Place::Body;
        Piece {
            text: &self.text[first.start..until],
            token: first.token,
            column: 0,
            touches: false,
            grouped: first.in_string || first.depth == 0 && (names || head),
            in_string: first.in_string,
            after_operand: first.after_operand,
            operator: first.operator,
            depth: first.depth,
            kind,
            place,
            group: first.group,
            factor: false,
        }
    }
}
