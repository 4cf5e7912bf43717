//! The state of a session beyond a single model: the text, the params that were set, the screen.

use std::cell::RefCell;
use std::collections::HashSet;
use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::rc::Rc;

use super::assist::Names;
use super::draft::{Draft, TextChange};
use super::loaded::{LoadedModel, NextStep};
use crate::cli::common::Failure;
use crate::compile::Setting;
use crate::diagnostic::{Diagnostic, Severity};
use crate::session::{LoadError, Session};
use crate::sim::{Settings, brief};

/// Largest number of messages printed for one text.
const MOST_SHOWN: usize = 20;

/// Why a statement failed.
#[derive(Debug)]
pub enum CommandError {
    /// The rendered message.
    Message(String),
    /// The reader of standard output has closed the pipe.
    OutputClosed,
    /// Answers cannot be written, for instance to a full disk; the message.
    OutputFailed(String),
}

impl CommandError {
    /// A message in one line, without the line break.
    pub fn new(message: impl std::fmt::Display) -> CommandError {
        CommandError::Message(format!("error: {message}\n"))
    }
}

impl From<Failure> for CommandError {
    fn from(failure: Failure) -> CommandError {
        match failure {
            Failure::Model(message) | Failure::Usage(message) => CommandError::Message(message),
            Failure::ClosedPipe | Failure::Stale => CommandError::OutputClosed,
        }
    }
}

impl From<CommandError> for Failure {
    fn from(error: CommandError) -> Failure {
        match error {
            CommandError::Message(message) => Failure::Model(message),
            CommandError::OutputClosed => Failure::ClosedPipe,
            CommandError::OutputFailed(message) => Failure::Model(message),
        }
    }
}

/// The screen for answers.
#[derive(Clone, Copy, Debug)]
pub struct Screen {
    pub coloured: bool,
    /// Size in characters.
    pub columns: usize,
    pub rows: usize,
}

impl Screen {
    /// The screen of this process. Without a terminal it has a fixed size, so that transcripts are reproducible.
    pub fn of_process() -> Screen {
        let plain = Screen { coloured: false, columns: 80, rows: 24 };
        if !std::io::stdout().is_terminal() {
            return plain;
        }
        let size = terminal_size::terminal_size();
        let (columns, rows) = size.map_or((80, 24), |(w, h)| (usize::from(w.0), usize::from(h.0)));
        let coloured = std::env::var_os("NO_COLOR").is_none();
        Screen { coloured, columns: columns.clamp(40, 200), rows: rows.clamp(12, 100) }
    }
}

/// The state of a session; it outlives the loaded model.
pub struct SessionState {
    pub draft: Draft,
    /// Values of params.
    pub set: Vec<Setting>,
    /// Folders that are searched besides the model's own.
    include: Vec<PathBuf>,
    pub settings: Settings,
    pub screen: Screen,
    /// Names for completion.
    pub names: Rc<RefCell<Names>>,
    /// Files that this session has written and may overwrite.
    pub written: HashSet<PathBuf>,
    /// Keys of warnings that were shown, and pending warnings with their keys. Warnings wait until the model is run, because
    /// the next lines often resolve them.
    warned: HashSet<String>,
    waiting: Vec<(String, String)>,
}

impl SessionState {
    pub fn new(settings: Settings, include: Vec<PathBuf>, screen: Screen) -> SessionState {
        let (draft, set, names, written, warned) = Default::default();
        SessionState { draft, set, include, settings, screen, names, written, warned, waiting: Vec::new() }
    }

    /// Prints an answer.
    ///
    /// # Errors
    /// Standard output is closed or cannot be written.
    pub fn say(&self, text: &str) -> Result<(), CommandError> {
        let mut out = std::io::stdout().lock();
        out.write_all(text.as_bytes()).and_then(|()| out.flush()).map_err(|error| {
            match crate::cli::common::out_error(error) {
                Failure::Model(message) => CommandError::OutputFailed(message),
                _ => CommandError::OutputClosed,
            }
        })
    }

    /// Prints an error.
    pub fn complain(&self, text: &str) {
        let text = text.trim_end();
        crate::cli::common::tell(&format!("{text}\n"));
    }

    /// The prompt of a terminal.
    pub fn prompt(&self, loaded: &LoadedModel) -> String {
        match loaded.time() {
            Some(t) => format!("t={}> ", brief(t, 6)),
            None => "> ".to_owned(),
        }
    }

    /// Begins without a model.
    pub fn begin_empty(&mut self) -> Result<NextStep, CommandError> {
        (self.draft, self.set) = Default::default();
        self.warned.clear();
        self.waiting.clear();
        let session = Session::from_text("typed", "initial string: ε", &[])
            .map_err(|refused| self.refusal(&refused))?;
        *self.names.borrow_mut() = Names::of(&session.model, "");
        Ok(NextStep::Model { session: Box::new(session), time: 0.0 })
    }

    /// Reads a model file.
    pub fn load(&mut self, path: &Path, set: &[Setting]) -> Result<NextStep, CommandError> {
        let session =
            Session::open_with(path, set, &self.include).map_err(|refused| self.refusal(&refused))?;
        self.draft = Draft::of_file(path, session.source.own_text().to_owned());
        self.set = set.to_vec();
        self.warned.clear();
        self.welcome(&session)?;
        Ok(self.begin(session, 0.0))
    }

    /// Reads the file again; changes since then are lost.
    pub fn reload(&mut self, time: f64) -> Result<NextStep, CommandError> {
        let Some(path) = self.draft.path.clone() else {
            return Err(CommandError::new(
                "this model has no file yet; `save FILE` gives it one, `load FILE` reads one",
            ));
        };
        let session =
            Session::open_with(&path, &self.set, &self.include).map_err(|refused| self.refusal(&refused))?;
        let text = session.source.own_text().to_owned();
        if text != self.draft.text {
            let change = TextChange::whole(text);
            self.draft.accept(change);
        }
        self.draft.set_saved(&path);
        self.welcome(&session)?;
        Ok(self.begin(session, time))
    }

    /// Reads a changed text, and keeps it if it is valid.
    pub fn change(&mut self, change: TextChange, time: f64) -> Result<NextStep, CommandError> {
        let session = self.read(&change.text, &self.set)?;
        self.note_warnings(&session);
        let done = change.done.join(", ");
        self.draft.accept(change);
        if !done.is_empty() {
            self.say(&format!("{done}\n"))?;
        }
        Ok(self.begin(session, time))
    }

    /// Reverts the last change.
    pub fn undo(&mut self, time: f64) -> Result<NextStep, CommandError> {
        let Some(text) = self.draft.previous().map(str::to_owned) else {
            let set = if self.set.is_empty() { "" } else { "; params go back with `set`" };
            return Err(CommandError::new(format!("the text was not changed yet{set}")));
        };
        let session = self.read(&text, &self.set)?;
        self.draft.undo();
        self.say("the last change is taken back; `list` shows the text\n")?;
        Ok(self.begin(session, time))
    }

    /// Gives a param another value.
    pub fn set(&mut self, name: &str, value: f64, time: f64) -> Result<NextStep, CommandError> {
        let mut set = self.set.clone();
        set.retain(|setting| setting.name != name);
        set.push(Setting { name: name.to_owned(), value });
        let session = self.read(&self.draft.text, &set)?;
        self.set = set;
        self.say(&format!("{name} = {}\n", brief(value, 12)))?;
        Ok(self.begin(session, time))
    }

    fn read(&self, text: &str, set: &[Setting]) -> Result<Session, CommandError> {
        // Without an initial string the model has the empty one.
        let whole = match Draft::has_axiom(text) {
            true => text.to_owned(),
            false => format!("{text}\ninitial string: ε\n"),
        };
        // Values of params that no longer exist are dropped.
        let declared = |setting: &&Setting| {
            // It may be declared in a file that the text includes.
            let mut entries = crate::syntax::outline::outline(text).into_iter();
            entries.any(|entry| entry.name == setting.name || entry.name.starts_with("include "))
        };
        let kept: Vec<Setting> = set.iter().filter(declared).cloned().collect();
        let set = if text == self.draft.text { set } else { &kept[..] };
        let name = self.draft.name();
        let read = Session::from_text_in(&self.draft.folder(), &self.include, &name, &whole, set);
        read.map_err(|refused| self.refusal(&refused))
    }

    fn begin(&mut self, session: Session, time: f64) -> NextStep {
        *self.names.borrow_mut() = Names::of(&session.model, &self.draft.text);
        NextStep::Model { session: Box::new(session), time }
    }

    fn welcome(&mut self, session: &Session) -> Result<(), CommandError> {
        self.note_warnings(session);
        self.warn();
        let model = &session.model;
        let title = model.title.as_ref().map_or(String::new(), |title| format!("{title}: "));
        let plural = |n: usize, word: &str| format!("{n} {word}{}", if n == 1 { "" } else { "s" });
        let frames = model.frames.map_or(String::new(), |f| {
            format!(", frames {} .. {} step {}", brief(f.from, 6), brief(f.to, 6), brief(f.step, 6))
        });
        self.say(&format!(
            "{title}{}, {}{frames}\n",
            plural(model.rules.len(), "rule"),
            plural(model.parameters.len(), "param")
        ))
    }

    /// Keeps the warnings that were not shown before.
    fn note_warnings(&mut self, session: &Session) {
        self.waiting.clear();
        for warning in session.warnings.iter().take(MOST_SHOWN) {
            let place = warning.labels.first().map(|(span, _)| session.source.slice(*span));
            let key = format!("{} {}", warning.message, place.unwrap_or(""));
            if !self.warned.contains(&key) {
                self.waiting.push((key, warning.render(&session.source, self.screen.coloured)));
            }
        }
    }

    /// Prints the pending warnings.
    pub fn warn(&mut self) {
        for (key, text) in std::mem::take(&mut self.waiting) {
            self.complain(&text);
            self.warned.insert(key);
        }
    }

    /// The errors of a text.
    pub fn refusal(&self, refused: &LoadError) -> CommandError {
        let wrong = |d: &&Diagnostic| d.severity == Severity::Error;
        let all: Vec<&Diagnostic> =
            refused.diagnostics.iter().filter(wrong).chain(&refused.settings).collect();
        let draw = |d: &&Diagnostic| d.render(&refused.source, self.screen.coloured);
        let mut text: String = all.iter().take(MOST_SHOWN).map(draw).collect();
        if all.len() > MOST_SHOWN {
            text += &format!("… and {} more\n", all.len() - MOST_SHOWN);
        }
        CommandError::Message(text)
    }
}
