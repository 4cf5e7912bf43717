//! The interactive session: `dlsys repl [MODEL]`.
//!
//! ```text
//! terminal or script ──input──▶ statements ──┬─ text of the model ──draft──▶ Session, read anew
//!                       grammar, assist      └─ commands ──▶ LoadedModel (a Session and its Replay) ──▶ answers
//! ```
//!
//! - `input`, `grammar`, `assist`: input lines, their classification, completion and hints; `commands`: the list of commands.
//! - `draft`: the text of the model and its changes. A change that cannot be read is rejected as a whole.
//! - `state`: the state of the session beyond a single model. `loaded`: the loaded model, its replay position, and dispatch of
//!   commands.
//! - `navigation`, `show`, `plot`, `picture`, `files`: the commands, by subject. `braille`: pictures made of dots.
//!
//! Answers go to standard output, errors to standard error. Without a terminal the statements of standard input are executed
//! in order, and the exit status is 1 if one of them fails.

mod assist;
mod braille;
mod commands;
mod draft;
mod files;
mod grammar;
mod input;
mod loaded;
mod navigation;
mod picture;
mod plot;
mod show;
mod state;

use std::io::IsTerminal;

use crate::cli::args::ReplArgs;
use crate::cli::common::Failure;
use crate::interrupt;
use grammar::{Statement, StatementKind};
use input::{Input, Next};
use loaded::{LoadedModel, NextStep};
use state::{CommandError, Screen, SessionState};

/// Runs a session to its end.
///
/// # Errors
/// If the terminal fails or, without one, if a statement has failed.
pub fn repl(args: &ReplArgs) -> Result<(), Failure> {
    let interactive = std::io::stdin().is_terminal() && std::io::stdout().is_terminal();
    let screen = Screen::of_process();
    let settings = args.solver.apply(args.budget.settings())?;
    let mut state = SessionState::new(settings, args.include.folders.clone(), screen);
    let mut log = Log { echo: args.echo, interactive, ..Log::default() };
    let mut input = match interactive {
        true => Input::terminal(state.names.clone(), screen.coloured)
            .map_err(|why| Failure::Model(format!("error: the terminal cannot be used: {why}\n")))?,
        false => Input::script(),
    };
    if interactive {
        interrupt::listen();
        let version = env!("CARGO_PKG_VERSION");
        state.say(&format!(
            "dlsys {version}. Type declarations and rules, or commands; `help` lists them.\n"
        ))?;
    }
    let mut start = match &args.model {
        Some(path) => match state.load(path, &args.settings) {
            Ok(flow) => flow,
            Err(error @ (CommandError::OutputClosed | CommandError::OutputFailed(_))) => {
                return Err(error.into());
            }
            // On a terminal the user may correct the file and load it again.
            Err(CommandError::Message(message)) if interactive => {
                state.complain(&message);
                state.begin_empty()?
            }
            Err(CommandError::Message(message)) => return Err(Failure::Model(message)),
        },
        None => state.begin_empty()?,
    };
    // Each iteration is one model; a change of the model begins another.
    while let NextStep::Model { session, time } = start {
        let mut loaded = LoadedModel::new(&session, &state);
        let set = loaded.set(time, &state);
        log.take(set, &mut state, None)?;
        start = play(&mut loaded, &mut state, &mut input, &mut log)?;
    }
    crate::rescue::remember(None);
    if interactive && !state.draft.is_saved() {
        state.say("The model was not saved; the history has what was typed.\n")?;
    }
    log.verdict()
}

/// Executes statements until the model changes or the session ends.
fn play(
    loaded: &mut LoadedModel,
    state: &mut SessionState,
    input: &mut Input,
    log: &mut Log,
) -> Result<NextStep, Failure> {
    let mut cancelled = false;
    loop {
        let statement = match input.next(&state.prompt(loaded)) {
            Next::Statement(statement) => statement,
            Next::Cancelled => {
                if std::mem::replace(&mut cancelled, true) {
                    state.say("Ctrl-D or `quit` ends the session.\n")?;
                    cancelled = false;
                }
                continue;
            }
            Next::End => return Ok(NextStep::Quit),
            Next::Broken(why) => {
                return Err(Failure::Model(format!("error: the input cannot be read: {why}\n")));
            }
        };
        cancelled = false;
        interrupt::clear();
        if log.echo && !log.interactive {
            state.say(&echo(&statement))?;
        }
        crate::rescue::remember((!state.draft.is_saved()).then_some(&state.draft.text));
        let done = loaded.obey(&statement, state);
        if let Some(flow) = log.take(done, state, Some(&statement))?
            && !matches!(flow, NextStep::Continue)
        {
            return Ok(flow);
        }
    }
}

/// A statement in the format of a terminal.
fn echo(statement: &Statement) -> String {
    let mut lines = statement.text.lines();
    let mut text = format!("> {}\n", lines.next().unwrap_or(""));
    lines.for_each(|line| text += &format!("  {line}\n"));
    text
}

/// The failed statements of a session.
#[derive(Debug, Default)]
struct Log {
    echo: bool,
    interactive: bool,
    statements: usize,
    /// Their lines in the input.
    failed: Vec<usize>,
}

impl Log {
    /// Records the result of a statement, and prints its error.
    fn take<T>(
        &mut self,
        done: Result<T, CommandError>,
        state: &mut SessionState,
        statement: Option<&Statement>,
    ) -> Result<Option<T>, Failure> {
        self.statements += usize::from(statement.is_some());
        match done {
            Ok(value) => Ok(Some(value)),
            Err(error @ (CommandError::OutputClosed | CommandError::OutputFailed(_))) => Err(error.into()),
            Err(CommandError::Message(message)) => {
                state.complain(&message);
                if !self.interactive {
                    let line = statement.map_or(0, |statement| statement.line);
                    self.failed.push(line);
                    let what = statement.map_or("", |s| s.text.lines().next().unwrap_or("")).trim();
                    if statement.is_some() {
                        state.complain(&format!("(line {line} of the input: {what})\n"));
                    }
                }
                Ok(None)
            }
        }
    }

    /// The result of a script.
    fn verdict(&self) -> Result<(), Failure> {
        if self.failed.is_empty() || self.interactive {
            return Ok(());
        }
        let lines: Vec<String> = self.failed.iter().take(20).map(usize::to_string).collect();
        let more = if self.failed.len() > lines.len() { " …" } else { "" };
        let noun = if lines.len() == 1 { "line" } else { "lines" };
        Err(Failure::Model(format!(
            "error: {} of {} statements failed, {noun} {}{more}\n",
            self.failed.len(),
            self.statements,
            lines.join(", ")
        )))
    }
}

impl Statement {
    /// The name of a command and its arguments; an argument in quotes may contain spaces.
    fn words(&self) -> Vec<String> {
        debug_assert!(self.kind == StatementKind::Command);
        let text = self.text.trim();
        let text = text.strip_prefix(':').unwrap_or(text).trim();
        let text = text.strip_prefix('?').map_or(text.to_owned(), |rest| format!("help {rest}"));
        let (mut words, mut word, mut quoted, mut any) = (Vec::new(), String::new(), false, false);
        let mut chars = text.chars().peekable();
        while let Some(c) = chars.next() {
            match c {
                '"' => (quoted, any) = (!quoted, true),
                // A comment, but `#3` is a module.
                '#' if !quoted && !any && !chars.peek().is_some_and(char::is_ascii_digit) => break,
                c if c.is_whitespace() && !quoted => {
                    if std::mem::take(&mut any) {
                        words.push(std::mem::take(&mut word));
                    }
                }
                c => {
                    word.push(c);
                    any = true;
                }
            }
        }
        if any {
            words.push(word);
        }
        words
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_of_a_command() {
        let words =
            |text: &str| Statement { kind: StatementKind::Command, text: text.to_owned(), line: 1 }.words();
        assert_eq!(words("plot #3.x 0..9 # a remark"), ["plot", "#3.x", "0..9"]);
        assert_eq!(words("load \"my plants/a b.dls\""), ["load", "my plants/a b.dls"]);
        assert_eq!(words(":run"), ["run"]);
        assert_eq!(words("?plot"), ["help", "plot"]);
        assert!(words(":").is_empty());
    }
}
