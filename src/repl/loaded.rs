//! The loaded model, its replay position, and the dispatch of commands.

use super::commands;
use super::grammar::{Statement, StatementKind, first_word};
use super::state::{CommandError, SessionState};
use crate::cli::embedded;
use crate::interrupt;
use crate::replay::{Replay, Stop};
use crate::session::Session;
use crate::sim::{self, brief};
use crate::syntax::{foreign_lines, foreign_syntax, suggest::did_you_mean, words};
use crate::tree::ModuleString;

/// What the session does after a statement.
#[derive(Debug)]
pub enum NextStep {
    Continue,
    Quit,
    /// Load another model, at a time.
    Model {
        session: Box<Session>,
        time: f64,
    },
}

/// A model and its replay.
pub struct LoadedModel<'m> {
    pub session: &'m Session,
    /// `None` if the model cannot start, or has no initial string.
    replay: Option<Replay<'m>>,
    /// Why it cannot start.
    error: Option<sim::Error>,
}

impl<'m> LoadedModel<'m> {
    /// Starts the model.
    pub fn new(session: &'m Session, state: &SessionState) -> LoadedModel<'m> {
        let empty = session.model.axiom.is_empty();
        let (replay, error) = match Replay::new(&session.model, state.settings) {
            _ if empty => (None, None),
            Ok(mut replay) => {
                replay.stop_when(interrupt::flag());
                (Some(replay), None)
            }
            Err(error) => (None, Some(error)),
        };
        LoadedModel { session, replay, error }
    }

    /// Goes to the initial time.
    pub fn set(&mut self, time: f64, state: &SessionState) -> Result<(), CommandError> {
        if let Some(error) = &self.error {
            return Err(self.drawn(error, state));
        }
        if time > 0.0
            && let Ok(replay) = self.replay()
        {
            let gone = replay.seek(time);
            self.arrive(gone, state)?;
        }
        Ok(())
    }

    /// The present time, if the model has started.
    pub fn time(&self) -> Option<f64> {
        self.replay.as_ref().map(Replay::time)
    }

    /// The replay of the model.
    ///
    /// # Errors
    /// The model has not started.
    pub fn replay(&mut self) -> Result<&mut Replay<'m>, CommandError> {
        let why = match &self.error {
            Some(error) => format!("the model does not start: {error}"),
            None if self.session.model.rules.is_empty() => {
                "there is no model yet: `load FILE`, or type an initial string, such as `initial string: A(0)`".to_owned()
            }
            None => "there is no initial string yet: type one, such as `initial string: A(0)`".to_owned(),
        };
        self.replay.as_mut().ok_or_else(|| CommandError::new(why))
    }

    /// The rendered message of an error of the run.
    pub fn drawn(&self, error: &sim::Error, state: &SessionState) -> CommandError {
        CommandError::Message(error.diagnostic().render(&self.session.source, state.screen.coloured))
    }

    /// Reports the result of a seek.
    pub fn arrive(
        &mut self,
        gone: Result<Stop, sim::Error>,
        state: &SessionState,
    ) -> Result<Stop, CommandError> {
        let present = self.time().unwrap_or(0.0);
        match gone {
            Ok(Stop::Interrupted) => {
                state.say(&format!("stopped at t = {}; `run T` goes on from there\n", brief(present, 12)))?;
                Ok(Stop::Interrupted)
            }
            Ok(stop) => Ok(stop),
            Err(error) => {
                let CommandError::Message(mut text) = self.drawn(&error, state) else {
                    return Err(CommandError::OutputClosed);
                };
                text = format!("{}\n(the session stays at t = {})\n", text.trim_end(), brief(present, 12));
                Err(CommandError::Message(text))
            }
        }
    }

    /// Moves the simulation to the present if that was deferred.
    pub fn settle(&mut self, state: &SessionState) -> Result<(), CommandError> {
        let gone = self.replay()?.settle();
        self.arrive(gone, state).map(|_| ())
    }

    /// The string at present.
    pub fn string(&mut self, state: &SessionState) -> Result<&ModuleString, CommandError> {
        self.settle(state)?;
        if let Err(error) = self.replay()?.string() {
            return Err(self.drawn(&error, state));
        }
        // The same string again: the borrow of the first call would last until the end of this function.
        self.replay()?.string().map_err(CommandError::new)
    }

    /// Executes a statement.
    pub fn obey(
        &mut self,
        statement: &Statement,
        state: &mut SessionState,
    ) -> Result<NextStep, CommandError> {
        let time = self.time().unwrap_or(0.0);
        match statement.kind {
            StatementKind::Command => self.command(&statement.words(), state),
            StatementKind::Model => {
                let change = state.draft.with(&statement.text);
                state.change(change, time)
            }
            StatementKind::Clause => match state.draft.with_clause(&statement.text) {
                Some(change) => state.change(change, time),
                None => Err(CommandError::new(
                    "a clause belongs to a rule, and none was typed yet; a rule begins with its head: `A(x): if x < 1 solve dx/dt = 1`",
                )),
            },
            StatementKind::Unknown | StatementKind::Blank => Err(unknown(&statement.text)),
        }
    }

    fn command(&mut self, words: &[String], state: &mut SessionState) -> Result<NextStep, CommandError> {
        let Some((name, rest)) = words.split_first() else {
            return Err(CommandError::new("there is no command after the `:`; `help` lists them"));
        };
        let Some(command) = commands::find(name) else { return Err(unknown(name)) };
        let time = self.time().unwrap_or(0.0);
        let nothing = |flow: NextStep| match rest.first() {
            None => Ok(flow),
            Some(word) => {
                Err(CommandError::new(format!("`{}` takes nothing more, but `{word}` follows", command.name)))
            }
        };
        if ["run", "step", "plot", "render", "save"].contains(&command.name) && self.replay.is_some() {
            state.warn();
        }
        match command.name {
            "quit" => return nothing(NextStep::Quit),
            "help" => state.say(&commands::help(&rest.join(" ")).map_err(CommandError::new)?)?,
            "load" => {
                let [file] = rest else { return Err(misused(command.name)) };
                return state.load(std::path::Path::new(file), &[]);
            }
            "reload" => {
                nothing(NextStep::Continue)?;
                return state.reload(time);
            }
            "new" => {
                nothing(NextStep::Continue)?;
                return state.begin_empty();
            }
            "undo" => {
                nothing(NextStep::Continue)?;
                return state.undo(time);
            }
            "save" => self.save(rest, state)?,
            "list" => self.list(rest, state)?,
            "set" => return self.set_parameter(rest, state),
            "run" => self.run(rest, state)?,
            "step" => self.step(rest, state)?,
            "back" => self.back(rest, state)?,
            "time" => return self.clock(rest, state),
            "show" => self.show(rest, state)?,
            "inspect" => self.inspect(rest, state)?,
            "events" => self.events(rest, state)?,
            "plot" => self.plot(rest, state)?,
            "draw" => self.draw(rest, state)?,
            "export" => self.export(rest, state)?,
            "explain" | "report" | "render" => self.embedded(command.name, rest)?,
            other => return Err(CommandError::new(format!("`{other}` cannot be done"))),
        }
        Ok(NextStep::Continue)
    }

    /// Commands of the command line.
    fn embedded(&mut self, name: &str, rest: &[String]) -> Result<(), CommandError> {
        if name != "explain" {
            self.replay()?;
        }
        let mut words = vec![name.to_owned()];
        words.extend_from_slice(rest);
        if name == "report" && rest.is_empty() {
            let short = ["--tolerances", "1e-3,1e-6,1e-9", "--runs", "1", "--time-limit", "2"];
            words.extend(short.map(str::to_owned));
            if self.session.model.frames.is_none() {
                let t = self.time().filter(|t| *t > 0.0).unwrap_or(1.0);
                words.extend(["--at".to_owned(), t.to_string()]);
            }
        }
        Ok(embedded::run(self.session, &words)?)
    }

    fn set_parameter(&mut self, rest: &[String], state: &mut SessionState) -> Result<NextStep, CommandError> {
        let text = rest.join(" ").replace('=', " ");
        let words: Vec<&str> = text.split_whitespace().collect();
        let all = &self.session.model.parameters;
        let shown = |p: &crate::model::Parameter| {
            let range = p.range.map_or(String::new(), |(lo, hi)| format!("   in {lo} .. {hi}"));
            format!("  {} = {}{range}\n", p.name, p.value)
        };
        match words[..] {
            [] if all.is_empty() => {
                state.say("this model has no params; `param r = 0.1 in 0 .. 1` declares one\n")?;
            }
            [] => state.say(&all.iter().map(shown).collect::<String>())?,
            [name] => match all.iter().find(|p| p.name == name) {
                Some(parameter) => state.say(&shown(parameter))?,
                None => {
                    let hint = did_you_mean(name, all.iter().map(|p| p.name.as_str()));
                    let hint = hint.map_or(String::new(), |hint| format!("; {hint}"));
                    return Err(CommandError::new(format!("there is no param `{name}`{hint}")));
                }
            },
            [name, value] => {
                let value: f64 = match value.parse() {
                    Ok(x) if f64::is_finite(x) => x,
                    _ => return Err(CommandError::new(format!("`{value}` is not a number"))),
                };
                return state.set(name, value, self.time().unwrap_or(0.0));
            }
            _ => return Err(misused("set")),
        }
        Ok(NextStep::Continue)
    }
}

/// The error for a command with wrong arguments.
pub fn misused(name: &str) -> CommandError {
    let Some(command) = commands::find(name) else { return unknown(name) };
    let example = command
        .examples
        .first()
        .map_or(String::new(), |(line, does)| format!("\n  for example: {line}   ({does})"));
    CommandError::new(format!("it is used as `{} {}`{example}", command.name, command.usage))
}

/// The error for a line that is neither a command nor text of a model.
fn unknown(text: &str) -> CommandError {
    let line = text.lines().next().unwrap_or("").trim();
    let comment = foreign_lines::comments(line).and_then(|(errors, _)| errors.into_iter().next());
    if let Some(said) = comment.or_else(|| foreign_syntax::line(line, 0)) {
        return CommandError::new(format!("{}\n  {}", said.message, said.help.join("\n  ")));
    }
    let (word, _) = first_word(line);
    let shown: String = if word.is_empty() { line.chars().take(20).collect() } else { word.to_owned() };
    let hint = did_you_mean(word, commands::names().chain(words::declarations()));
    let hint = hint.map_or(String::new(), |hint| format!("\n  {hint}"));
    CommandError::new(format!(
        "`{shown}` begins no command, declaration or rule{hint}\n  `help` lists the commands; the head of a rule ends with `:`, as in `A(x): solve dx/dt = 1`"
    ))
}
