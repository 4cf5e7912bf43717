//! Where statements come from: a terminal with line editing, or a script.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::io::BufRead;
use std::path::PathBuf;
use std::rc::Rc;

use rustyline::error::ReadlineError;
use rustyline::history::FileHistory;
use rustyline::{CompletionType, Config, Editor};

use super::assist::{Assistant, Names};
use super::grammar::{Splitter, Statement};

/// Lines of history that are kept.
const HISTORY: usize = 2000;
/// A line of a script may have so many bytes.
const LONGEST_LINE: usize = 64 << 20;

enum Origin {
    Terminal { editor: Box<Editor<Assistant, FileHistory>>, history: Option<PathBuf> },
    Script,
}

/// Reads statements, one after another.
pub struct Input {
    origin: Origin,
    splitter: Splitter,
    ready: VecDeque<Statement>,
    /// Lines read so far.
    lines: usize,
    ended: bool,
    coloured: bool,
}

/// What comes next.
#[derive(Debug)]
pub enum Next {
    Statement(Statement),
    /// Ctrl-C at the prompt: what was typed is forgotten.
    Cancelled,
    End,
    /// The input cannot be read.
    Broken(String),
}

impl Input {
    /// Somebody types.
    ///
    /// # Errors
    /// If the terminal cannot be used.
    pub fn terminal(names: Rc<RefCell<Names>>, coloured: bool) -> Result<Input, String> {
        let config = Config::builder()
            .max_history_size(HISTORY)
            .and_then(|config| config.history_ignore_dups(true))
            .map_err(|error| error.to_string())?
            .completion_type(CompletionType::List)
            .auto_add_history(false)
            .build();
        let mut editor = Editor::with_config(config).map_err(|error| error.to_string())?;
        editor.set_helper(Some(Assistant::new(names, coloured)));
        let history = history_file();
        if let Some(path) = &history {
            // The first session has none.
            let _ = editor.load_history(path);
        }
        Ok(Input::of(Origin::Terminal { editor: Box::new(editor), history }, coloured))
    }

    /// Standard input, to its end.
    pub fn script() -> Input {
        Input::of(Origin::Script, false)
    }

    fn of(origin: Origin, coloured: bool) -> Input {
        let (splitter, ready) = Default::default();
        Input { origin, splitter, ready, lines: 0, ended: false, coloured }
    }

    /// The next statement; `prompt` is what a terminal shows before it.
    pub fn next(&mut self, prompt: &str) -> Next {
        loop {
            if let Some(statement) = self.ready.pop_front() {
                return Next::Statement(statement);
            }
            if self.ended {
                return Next::End;
            }
            let text = match self.read(prompt) {
                Ok(text) => text,
                Err(next) => return next,
            };
            let Some(text) = text else {
                self.ended = true;
                self.ready.extend(self.splitter.finish());
                continue;
            };
            for line in text.lines() {
                self.lines += 1;
                self.ready.extend(self.splitter.line(line, self.lines));
            }
            if matches!(self.origin, Origin::Terminal { .. }) {
                self.ready.extend(self.splitter.finish());
            }
        }
    }

    fn read(&mut self, prompt: &str) -> Result<Option<String>, Next> {
        match &mut self.origin {
            Origin::Terminal { editor, history } => {
                let shown =
                    if self.coloured { format!("\x1b[1;32m{prompt}\x1b[0m") } else { prompt.to_owned() };
                match editor.readline(&(prompt, shown)) {
                    Ok(text) => {
                        if !text.trim().is_empty() {
                            let _ = editor.add_history_entry(text.trim_end());
                            // At once, so that a session that is killed loses nothing.
                            if let Some(path) = history {
                                let _ = editor.append_history(path);
                            }
                        }
                        Ok(Some(text))
                    }
                    Err(ReadlineError::Interrupted) => Err(Next::Cancelled),
                    Err(ReadlineError::Eof) => Ok(None),
                    Err(error) => Err(Next::Broken(error.to_string())),
                }
            }
            Origin::Script => {
                let mut bytes = Vec::new();
                let mut limited = std::io::Read::take(std::io::stdin().lock(), LONGEST_LINE as u64);
                let read = limited.read_until(b'\n', &mut bytes);
                let at = self.lines + 1;
                match read {
                    Ok(0) => Ok(None),
                    Ok(LONGEST_LINE..) => {
                        Err(Next::Broken(format!("line {at} has more than {} MB", LONGEST_LINE >> 20)))
                    }
                    Ok(_) => match String::from_utf8(bytes) {
                        Ok(line) => Ok(Some(if line.trim().is_empty() { "\n".to_owned() } else { line })),
                        Err(_) => Err(Next::Broken(format!("line {at} is not valid UTF-8"))),
                    },
                    Err(error) => Err(Next::Broken(error.to_string())),
                }
            }
        }
    }
}

/// Where the history is kept: `$XDG_STATE_HOME/dlsys/history`, or `~/.local/state/dlsys/history`. None if there is
/// no home, or the folder cannot be made.
fn history_file() -> Option<PathBuf> {
    let variable = |name: &str| std::env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let state = variable("XDG_STATE_HOME").or_else(|| Some(variable("HOME")?.join(".local/state")))?;
    let folder = state.join("dlsys");
    std::fs::create_dir_all(&folder).ok()?;
    Some(folder.join("history"))
}
