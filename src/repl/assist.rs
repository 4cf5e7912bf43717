//! Line editing on a terminal: completion, hints, colours, and whether Enter ends the input.

use std::borrow::Cow;
use std::cell::RefCell;
use std::rc::Rc;

use rustyline::completion::{Completer, FilenameCompleter, Pair};
use rustyline::highlight::{CmdKind, Highlighter};
use rustyline::hint::{Hint, Hinter};
use rustyline::validate::{ValidationContext, ValidationResult, Validator};
use rustyline::{Context, Helper};

use super::commands::{self, Argument};
use super::grammar::{self, StatementKind};
use crate::model::Model;
use crate::syntax::declarations::Declaration;
use crate::syntax::words;

/// Names of the loaded model.
#[derive(Clone, Debug, Default)]
pub struct Names {
    /// Names of modules.
    pub kinds: Vec<String>,
    /// `F.x` for a parameter x of F.
    pub plots: Vec<String>,
    /// Names of params.
    pub parameters: Vec<String>,
    /// All other declared names.
    pub others: Vec<String>,
}

impl Names {
    /// The names of a model and of its text.
    pub fn of(model: &Model, text: &str) -> Names {
        let mut names = Names::default();
        for (id, kind) in model.kinds.iter().filter(|(id, _)| !id.is_bracket()) {
            names.kinds.push(kind.name.clone());
            let own = model.parameter_names(id);
            names.plots.extend(own.iter().map(|parameter| format!("{}.{parameter}", kind.name)));
        }
        names.parameters = model.parameters.iter().map(|p| p.name.clone()).collect();
        let plain = |name: &String| name.chars().all(|c| c.is_alphanumeric() || c == '_');
        names.others =
            crate::syntax::outline::outline(text).into_iter().map(|e| e.name).filter(plain).collect();
        for list in [&mut names.kinds, &mut names.plots, &mut names.others] {
            list.sort();
            list.dedup();
        }
        names
    }
}

/// The helper of rustyline.
pub struct Assistant {
    pub names: Rc<RefCell<Names>>,
    pub coloured: bool,
    files: FilenameCompleter,
}

impl Assistant {
    pub fn new(names: Rc<RefCell<Names>>, coloured: bool) -> Assistant {
        Assistant { names, coloured, files: FilenameCompleter::new() }
    }

    /// Completions at the end of a line, with the start of the word that they complete; `None` for the name of a file.
    fn candidates(&self, line: &str) -> Option<(usize, Vec<String>)> {
        let names = self.names.borrow();
        let owned =
            |words: &mut dyn Iterator<Item = &'static str>| words.map(str::to_owned).collect::<Vec<_>>();
        let stripped = line.strip_prefix(':').unwrap_or(line);
        let (word, _) = grammar::first_word(stripped);
        let first = stripped.trim_start().len() == word.len() && !line.contains('\n');
        let word_start = |extra: &str| {
            let part = |c: char| c.is_alphanumeric() || c == '_' || extra.contains(c);
            line.rfind(|c| !part(c)).map_or(0, |at| at + line[at..].chars().next().map_or(1, char::len_utf8))
        };
        if first {
            let mut all = owned(&mut commands::names());
            if !line.starts_with(':') {
                all.extend(owned(&mut words::declarations()));
                all.extend(names.kinds.iter().cloned());
            }
            return Some((word_start("@"), all));
        }
        if grammar::classify(line) == StatementKind::Command
            && let Some(command) = commands::find(word)
        {
            let all = match command.argument {
                Argument::File => return None,
                Argument::Nothing => Vec::new(),
                Argument::Module => names.kinds.clone(),
                Argument::Parameter => names.parameters.clone(),
                Argument::Plot => {
                    let mut all = owned(&mut ["sum", "mean", "max", "min", "count"].into_iter());
                    all.extend(names.plots.iter().cloned());
                    if line.trim_end().ends_with("count") || line.contains("count ") {
                        all = names.kinds.clone();
                    }
                    all
                }
                Argument::Command => owned(&mut commands::names()),
                Argument::Words(words) => owned(&mut words.iter().copied()),
            };
            return Some((word_start("@."), all));
        }
        // Quotes hold the names of files.
        if line.matches('"').count() % 2 == 1 {
            return None;
        }
        let mut all = owned(
            &mut words::CLAUSES.into_iter().chain(crate::compile::functions()).chain(words::particles(word)),
        );
        all.extend(owned(&mut words::endings(word)));
        all.extend(names.kinds.iter().chain(&names.others).cloned());
        all.extend(owned(&mut words::declarations()));
        Some((word_start("@"), all))
    }
}

impl Completer for Assistant {
    type Candidate = Pair;

    fn complete(&self, line: &str, pos: usize, _: &Context<'_>) -> rustyline::Result<(usize, Vec<Pair>)> {
        let before = &line[..pos];
        let Some((start, mut all)) = self.candidates(before) else {
            return self.files.complete_path(line, pos);
        };
        let word = &before[start..];
        all.retain(|name| name.starts_with(word));
        all.sort();
        all.dedup();
        let pair = |name: String| Pair { display: name.clone(), replacement: name };
        Ok((start, all.into_iter().map(pair).collect()))
    }
}

/// A hint after the cursor: its text, and the part that the right arrow accepts.
pub struct Remark {
    shown: String,
    taken: Option<usize>,
}

impl Hint for Remark {
    fn display(&self) -> &str {
        &self.shown
    }

    fn completion(&self) -> Option<&str> {
        self.taken.map(|length| &self.shown[..length])
    }
}

impl Hinter for Assistant {
    type Hint = Remark;

    fn hint(&self, line: &str, pos: usize, _: &Context<'_>) -> Option<Remark> {
        if pos < line.len() {
            return None;
        }
        let remark = |shown: String| Some(Remark { shown, taken: None });
        if line.contains('\n') {
            let empty = line.ends_with('\n') && !grammar::is_open(line);
            return if empty { remark("   Enter ends the rule".to_owned()) } else { None };
        }
        let (word, rest) = grammar::first_word(line);
        if word.is_empty() || !rest.is_empty() {
            return None;
        }
        let usage = commands::find(word)
            .map_or(Declaration::of_word(word).map_or("", |declaration| declaration.usage), |command| {
                command.usage
            });
        if !usage.is_empty() {
            let space = if line.ends_with(' ') { "" } else { " " };
            return remark(format!("{space}{usage}"));
        }
        // The only completion.
        let mut all = commands::names().chain(words::declarations()).filter(|name| name.starts_with(word));
        match (all.next(), all.next()) {
            (Some(only), None) if line.ends_with(word) && only.len() > word.len() => {
                let missing = only[word.len()..].to_owned();
                Some(Remark { taken: Some(missing.len()), shown: missing })
            }
            _ => None,
        }
    }
}

/// Colours of the terminal, from the basic palette.
mod ink {
    pub const COMMAND: &str = "\x1b[1m";
    pub const WORD: &str = "\x1b[35m";
    pub const NUMBER: &str = "\x1b[36m";
    pub const TEXT: &str = "\x1b[32m";
    pub const FAINT: &str = "\x1b[2m";
    pub const MODULE: &str = "\x1b[34m";
    pub const FUNCTION: &str = "\x1b[33m";
    pub const END: &str = "\x1b[0m";
}

/// Highlights the text of a model, or a command.
pub fn coloured(text: &str, names: &Names) -> String {
    let mut out = String::new();
    let command = grammar::classify(text.lines().next().unwrap_or("")) == StatementKind::Command;
    let mut first = true;
    let mut rest = text;
    while let Some(c) = rest.chars().next() {
        let is_word = words::in_name;
        let (length, ink) = if c == '#' && !(command && rest[1..].starts_with(|c: char| c.is_ascii_digit())) {
            (rest.find('\n').unwrap_or(rest.len()), ink::FAINT)
        } else if c == '"' {
            (rest[1..].find(['"', '\n']).map_or(rest.len(), |at| at + 2).min(rest.len()), ink::TEXT)
        } else if c.is_ascii_digit() {
            (words::number_length(rest), ink::NUMBER)
        } else if c.is_alphabetic() || c == '@' {
            let length =
                rest[c.len_utf8()..].find(|c| !is_word(c)).map_or(rest.len(), |at| at + c.len_utf8());
            let word = &rest[..length];
            let listed = |list: &[String]| list.iter().any(|name| name == word);
            let ink = if first && command {
                ink::COMMAND
            } else if words::declarations().any(|w| w == word) || words::CLAUSES.contains(&word) {
                ink::WORD
            } else if crate::compile::functions().any(|w| w == word) {
                ink::FUNCTION
            } else if listed(&names.kinds) {
                ink::MODULE
            } else {
                ""
            };
            (length, ink)
        } else {
            (c.len_utf8(), "")
        };
        let (token, after) = rest.split_at(length);
        first &= token.trim().is_empty() || token == ":";
        // A colour that spans a line break would colour the prompt of the next line.
        if ink.is_empty() {
            out += token;
        } else {
            out.push_str(ink);
            out += token;
            out.push_str(ink::END);
        }
        rest = after;
    }
    out
}

impl Highlighter for Assistant {
    fn highlight<'l>(&self, line: &'l str, _: usize) -> Cow<'l, str> {
        if !self.coloured {
            return Cow::Borrowed(line);
        }
        Cow::Owned(coloured(line, &self.names.borrow()))
    }

    fn highlight_hint<'h>(&self, hint: &'h str) -> Cow<'h, str> {
        if !self.coloured {
            return Cow::Borrowed(hint);
        }
        Cow::Owned(format!("{}{hint}{}", ink::FAINT, ink::END))
    }

    fn highlight_char(&self, _: &str, _: usize, kind: CmdKind) -> bool {
        self.coloured && kind != CmdKind::MoveCursor
    }
}

impl Validator for Assistant {
    fn validate(&self, context: &mut ValidationContext<'_>) -> rustyline::Result<ValidationResult> {
        Ok(if grammar::is_complete(context.input()) {
            ValidationResult::Valid(None)
        } else {
            ValidationResult::Incomplete
        })
    }
}

impl Helper for Assistant {}

#[cfg(test)]
mod tests {
    use super::*;
    use rustyline::history::MemHistory;

    fn assistant() -> Assistant {
        let names = Names {
            kinds: vec!["F_a".to_owned(), "F_i".to_owned(), "@L".to_owned()],
            plots: vec!["F_a.n".to_owned(), "F_a.x".to_owned()],
            parameters: vec!["rate".to_owned(), "rest".to_owned()],
            others: vec!["rate".to_owned(), "limit".to_owned()],
        };
        Assistant::new(Rc::new(RefCell::new(names)), true)
    }

    fn completed(line: &str) -> Vec<String> {
        let history = MemHistory::new();
        let found = assistant().complete(line, line.len(), &Context::new(&history)).expect("candidates");
        found.1.into_iter().map(|pair| format!("{}{}", &line[..found.0], pair.replacement)).collect()
    }

    #[test]
    fn everything_is_completed_by_what_may_stand_there() {
        assert_eq!(completed("ex"), ["explain", "export"]);
        assert_eq!(completed("par"), ["param"]);
        assert_eq!(completed("set ra"), ["set rate"]);
        assert_eq!(completed("plot F_a."), ["plot F_a.n", "plot F_a.x"]);
        assert_eq!(completed("plot count F"), ["plot count F_a", "plot count F_i"]);
        assert_eq!(completed("inspect @"), ["inspect @L"]);
        assert_eq!(completed("F_a(x): solve dx/dt = lim"), ["F_a(x): solve dx/dt = limit"]);
        assert_eq!(completed("F_a(x):\n  pro"), ["F_a(x):\n  produce"]);
        assert_eq!(completed("help pl"), ["help plot"]);
        assert_eq!(completed("wind 1, 0, 0 speed 3 tu"), ["wind 1, 0, 0 speed 3 turbulence"]);
        assert_eq!(completed("tissue wood = stif"), ["tissue wood = stiffness"]);
        assert_eq!(completed("F_a(x): solve dx/dt = tu"), [""; 0]);
        assert!(completed("load Cargo.t").contains(&"load Cargo.toml".to_owned()));
    }

    #[test]
    fn hints_say_how_to_go_on() {
        let history = MemHistory::new();
        let hint = |line: &str| assistant().hint(line, line.len(), &Context::new(&history)).map(|h| h.shown);
        assert_eq!(hint("ins").as_deref(), Some("pect"));
        assert_eq!(hint("run").as_deref(), Some(" [T | +DT]"));
        assert_eq!(hint("param ").as_deref(), Some("NAME = VALUE in LOW .. HIGH"));
        assert_eq!(hint("run 5"), None);
        assert_eq!(hint("F(x):\n  solve dx/dt = 1\n").as_deref(), Some("   Enter ends the rule"));
    }

    #[test]
    fn colours_change_nothing_else() {
        let names = assistant().names.borrow().clone();
        for text in
            ["F_a(x): if x < 1..2 solve dx/dt = sin(\"ä\") # é", "plot #3.x 0..9", "a \"", "1..", "@", "ε±"]
        {
            let shown = coloured(text, &names);
            let mut plain = String::new();
            let mut inside = false;
            for c in shown.chars() {
                match c {
                    '\x1b' => inside = true,
                    'm' if inside => inside = false,
                    c if !inside => plain.push(c),
                    _ => {}
                }
            }
            assert_eq!(plain, text);
        }
    }
}
