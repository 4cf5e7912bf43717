//! From lines of pieces to text: spaces between pieces, indentation, and columns of actions and comments.

use super::pieces::{Line, Piece, Place};
use crate::layout::ItemKind;
use crate::lexeme::Token;

/// Maximum number of open brackets that indent a line.
const DEEPEST: usize = 20;
/// Guards and lines longer than this, in characters, are not aligned in columns.
const LONG_GUARD: usize = 44;
const LONG_LINE: usize = 80;

/// A line of the output.
#[derive(Default)]
struct Made {
    text: String,
    /// Number of characters of `text`.
    width: usize,
}

impl Made {
    fn push(&mut self, text: &str) {
        self.text.push_str(text);
        self.width += text.chars().count();
    }

    fn pad(&mut self, to: usize) {
        while self.width < to {
            self.push(" ");
        }
    }
}

/// The canonical text of some lines.
pub fn arrange(lines: &[Line<'_>]) -> String {
    let roles = roles(lines);
    let columns = action_columns(lines, &roles);
    let mut cursor = Cursor::default();
    let mut made: Vec<Made> = Vec::with_capacity(lines.len());
    for (i, line) in lines.iter().enumerate() {
        made.push(cursor.line(line, &roles[i], columns[i]));
    }
    indent_comments(lines, &roles, &mut made);
    align_comments(lines, &mut made);
    let mut out = String::new();
    let mut gap = false;
    for line in &made {
        if line.text.is_empty() {
            gap = !out.is_empty();
            continue;
        }
        if std::mem::take(&mut gap) {
            out.push('\n');
        }
        out.push_str(&line.text);
        out.push('\n');
    }
    out
}

/// The kind of beginning of a line, which decides its indentation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Begin {
    /// Empty, or a comment.
    #[default]
    Nothing,
    Item,
    /// A clause, or a `let`.
    Clause,
    /// The action of a guard on an earlier line.
    Action,
    Continuation,
}

/// The clauses and actions on a line.
#[derive(Clone, Debug, Default)]
struct Role {
    begin: Begin,
    /// Indices of the pieces that begin a clause or an action.
    keywords: Vec<usize>,
    /// Index of the action whose guard begins this line.
    action: Option<usize>,
}

fn roles(lines: &[Line<'_>]) -> Vec<Role> {
    let mut guarded = false;
    let mut before: Option<&Piece<'_>> = None;
    let mut ended = true;
    let mut roles = Vec::with_capacity(lines.len());
    for line in lines {
        let mut role = Role::default();
        for (i, piece) in line.pieces.iter().enumerate() {
            let keyword = is_keyword(piece, before);
            if piece.place == Place::Start {
                guarded = false;
            }
            if i == 0 {
                role.begin = match () {
                    () if piece.place == Place::Start => Begin::Item,
                    () if !(keyword || ended && is_body(piece)) => Begin::Continuation,
                    () if guarded && piece.text != "if" => Begin::Action,
                    () => Begin::Clause,
                };
            }
            if keyword {
                role.keywords.push(i);
                if i > 0 && guarded && piece.text != "if" && matches!(line.pieces[0].text, "if" | "at") {
                    role.action.get_or_insert(i);
                }
                guarded = matches!(piece.text, "if" | "at");
            }
            before = Some(piece);
        }
        if !line.pieces.is_empty() {
            ended = line.ends;
        }
        roles.push(role);
    }
    roles
}

fn is_body(piece: &Piece<'_>) -> bool {
    piece.kind == ItemKind::Rule && piece.place == Place::Body && piece.depth == 0
}

/// True if a piece begins a clause or its action, unlike an `if` in an expression.
fn is_keyword(piece: &Piece<'_>, before: Option<&Piece<'_>>) -> bool {
    // `2if x < 1 then 1 else 0` is a product.
    if before.is_some_and(|b| b.factor) {
        return false;
    }
    let begins = match piece.text {
        "solve" | "produce" | "let" => true,
        "if" | "at" => before.is_some_and(|b| b.place == Place::Colon || b.in_string || !b.operator),
        _ => false,
    };
    begins && is_body(piece) && piece.operator
}

/// By line: the column of an action that shares the line with its guard.
fn action_columns(lines: &[Line<'_>], roles: &[Role]) -> Vec<Option<usize>> {
    let mut columns = vec![None; lines.len()];
    let width = |i: usize| {
        let mut made = Made::default();
        made.push("  ");
        for (k, piece) in lines[i].pieces.iter().enumerate().take(roles[i].action.unwrap_or(0)) {
            put(&mut made, piece, k.checked_sub(1).map(|k| &lines[i].pieces[k]));
        }
        made.width
    };
    let together = |i: usize| i < lines.len() && roles[i].begin == Begin::Clause && roles[i].action.is_some();
    let mut start = 0;
    while start < lines.len() {
        let end = (start..).find(|&i| !together(i)).unwrap_or(lines.len());
        let widths: Vec<usize> = (start..end).map(width).collect();
        let common = widths.iter().copied().filter(|&w| w <= LONG_GUARD).max().unwrap_or(0);
        for (i, width) in (start..end).zip(widths) {
            columns[i] = Some(width.max(common) + 2);
        }
        start = end.max(start + 1);
    }
    columns
}

/// The state that indents the following lines.
#[derive(Default)]
struct Cursor {
    /// The column of continuation lines.
    anchor: usize,
    /// Number of open parentheses, and of open brackets in the string.
    open: usize,
    /// The first column of a declared string in the output and in the input.
    string: Option<(usize, usize)>,
    /// True if the lines that continue the string are aligned with its first module; None before the first such line.
    below: Option<bool>,
    /// Number of brackets that were open before the first line at the left margin.
    base: usize,
}

impl Cursor {
    fn line(&mut self, line: &Line<'_>, role: &Role, action: Option<usize>) -> Made {
        let mut made = Made::default();
        let Some(first) = line.pieces.first() else { return made };
        match role.begin {
            Begin::Item | Begin::Nothing => {
                let anchor = if first.kind == ItemKind::Rule { 4 } else { 2 };
                *self = Cursor { anchor, ..Cursor::default() };
            }
            Begin::Clause => made.push("  "),
            Begin::Action => made.push("    "),
            Begin::Continuation => made.pad(self.continuation(line)),
        }
        let indentation = made.width;
        for (i, piece) in line.pieces.iter().enumerate() {
            let before = i.checked_sub(1).map(|i| &line.pieces[i]);
            if role.action == Some(i)
                && let Some(column) = action
            {
                made.pad(column);
                made.push(piece.text);
            } else {
                put(&mut made, piece, before);
            }
            let last = i + 1 == line.pieces.len();
            if role.keywords.contains(&i) || matches!(piece.text, "->" | "-->") {
                let anchor = if last { indentation + 2 } else { made.width + 1 };
                *self = Cursor { anchor, ..Cursor::default() };
            }
            self.follow(piece, before, &made);
        }
        made
    }

    /// Updates the open brackets and the beginning of a declared string.
    fn follow(&mut self, piece: &Piece<'_>, before: Option<&Piece<'_>>, made: &Made) {
        let declared = piece.kind.has_string();
        if declared && before.is_some_and(|before| before.place == Place::Colon) {
            self.string = Some((made.width - piece.text.chars().count(), piece.column));
        }
        match piece.text {
            "[" if piece.in_string => self.open += 1,
            "(" => self.open += 1,
            "]" if piece.in_string => self.open = self.open.saturating_sub(1),
            ")" => self.open = self.open.saturating_sub(1),
            _ => {}
        }
    }

    /// The column of a continuation line.
    fn continuation(&mut self, line: &Line<'_>) -> usize {
        let first = &line.pieces[0];
        let closing = line.pieces.iter().take_while(|piece| matches!(piece.text, "]" | ")")).count();
        let inner = |base: usize| 2 * self.open.saturating_sub(closing + base).min(DEEPEST);
        let mut anchor = self.anchor;
        if let Some((column, written)) = self.string {
            // The input decides between lines below the string's first module and lines at the left.
            let first_line = self.below.is_none();
            let below = *self.below.get_or_insert(first.column.saturating_sub(inner(0)) > written / 2);
            anchor = if below { column } else { 2 };
            if first_line && !below {
                self.base = self.open;
            }
        }
        let inner = inner(self.base);
        if first.text == "or" && first.operator {
            // Below `produce`, so that the successors are aligned.
            anchor = anchor.saturating_sub(3);
        }
        anchor + inner
    }
}

/// Appends a piece, with a space before it if the two pieces need one.
fn put(made: &mut Made, piece: &Piece<'_>, before: Option<&Piece<'_>>) {
    if before.is_some_and(|before| space(before, piece)) {
        made.push(" ");
    }
    made.push(piece.text);
}

/// The spaces around a symbol.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Sides {
    Spaces,
    Tight,
    /// As in the input.
    Kept,
}

fn sides(symbol: &Piece<'_>) -> Sides {
    match symbol.text {
        "->" | "-->" | ".." | "=" | "<" | ">" | "<=" | ">=" | "!=" | "≤" | "≥" | "≠" => Sides::Spaces,
        _ if symbol.grouped => Sides::Kept,
        "+" | "-" | "&" | "|" if symbol.after_operand => Sides::Spaces,
        "*" | "/" | "^" | "·" if symbol.after_operand => Sides::Tight,
        _ => Sides::Kept,
    }
}

/// True if a space stands between two pieces of a line.
fn space(before: &Piece<'_>, after: &Piece<'_>) -> bool {
    let kept = !after.touches;
    let word = |piece: &Piece<'_>| {
        piece.token == Token::Word && piece.operator && !piece.grouped
            || matches!(piece.text, "if" | "solve" | "produce" | "or" | "at" | "rate") && piece.operator
    };
    let bracket = |piece: &Piece<'_>, symbol: &str| piece.text == symbol && !piece.grouped;
    // `for i in 0 .. 3: ( A(i) )`
    if before.group || after.group {
        return true;
    }
    // `2c` is a product, and so is `2if x < 1 then 1 else 0`; `@in` is a name.
    if before.factor || before.text == "@" {
        return false;
    }
    let element = before.token == Token::Word && !before.operator && bracket(after, "[");
    if element || bracket(before, "[") || bracket(after, "]") {
        return false;
    }
    if before.token == Token::Open || matches!(after.token, Token::Close | Token::Comma | Token::Colon) {
        return false;
    }
    if matches!(before.token, Token::Comma | Token::Colon) || word(before) || word(after) {
        return true;
    }
    if after.token == Token::Open && before.token == Token::Word {
        return false;
    }
    let of = |piece: &Piece<'_>| match piece.token {
        Token::Symbol => sides(piece),
        _ => Sides::Kept,
    };
    match (of(before), of(after)) {
        (Sides::Spaces, _) | (_, Sides::Spaces) => true,
        (Sides::Tight, _) | (_, Sides::Tight) => false,
        _ if before.grouped && after.token == Token::Open => false,
        _ if before.grouped || after.grouped => kept,
        // A unary sign touches its operand.
        _ if before.token == Token::Symbol && matches!(before.text, "+" | "-" | "!") => false,
        _ if before.token == Token::Symbol || after.token == Token::Symbol => kept,
        _ => true,
    }
}

/// Indents comment lines like the code that follows or surrounds them.
fn indent_comments(lines: &[Line<'_>], roles: &[Role], made: &mut [Made]) {
    // From the last line up: the code below, and whether an empty line separates it from the comment.
    let (mut below, mut item, mut apart) = (0, true, true);
    for i in (0..lines.len()).rev() {
        let line = &lines[i];
        if !line.pieces.is_empty() {
            below = made[i].width - made[i].text.trim_start_matches(' ').chars().count();
            (item, apart) = (roles[i].begin == Begin::Item, false);
        } else if let Some(comment) = line.comment {
            let column = match () {
                () if !item => below,
                () if apart && line.comment_column > 0 => 2,
                () => 0,
            };
            made[i].pad(column);
            made[i].push(comment);
        } else {
            apart = true;
        }
    }
}

/// Aligns the comments at the ends of the lines of a paragraph in one column.
fn align_comments(lines: &[Line<'_>], made: &mut [Made]) {
    let code = |i: usize| i < lines.len() && !lines[i].pieces.is_empty();
    let mut start = 0;
    while start < lines.len() {
        let end = (start..).find(|&i| !code(i)).unwrap_or(lines.len());
        let trailing = || (start..end).filter(|&i| lines[i].comment.is_some());
        let common = trailing().map(|i| made[i].width).filter(|&w| w <= LONG_LINE).max().unwrap_or(0);
        for i in trailing() {
            let column = made[i].width.max(common) + 2;
            made[i].pad(column);
            made[i].push(lines[i].comment.unwrap_or_default());
        }
        start = end.max(start + 1);
    }
}
