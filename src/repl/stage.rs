//! A model in time, and who does what with it.

use super::commands;
use super::desk::{Desk, Fault};
use super::grammar::{Line, Statement, first_word};
use crate::cli::embedded;
use crate::interrupt;
use crate::replay::{Replay, Stop};
use crate::session::Session;
use crate::sim::{self, brief};
use crate::syntax::{suggest::did_you_mean, words};
use crate::tree::ModuleString;

/// What comes after a statement.
#[derive(Debug)]
pub enum Flow {
    On,
    Quit,
    /// Another model, to be shown at a time.
    Model {
        session: Box<Session>,
        time: f64,
    },
}

/// A model and its time.
pub struct Stage<'m> {
    pub session: &'m Session,
    /// None if the model cannot start, or if there is nothing to start.
    replay: Option<Replay<'m>>,
    /// Why it cannot.
    fault: Option<sim::Error>,
}

impl<'m> Stage<'m> {
    /// Starts the model.
    pub fn new(session: &'m Session, desk: &Desk) -> Stage<'m> {
        let empty = session.model.axiom.kinds.is_empty();
        let (replay, fault) = match Replay::new(&session.model, desk.settings) {
            _ if empty => (None, None),
            Ok(mut replay) => {
                replay.stop_when(interrupt::flag());
                (Some(replay), None)
            }
            Err(fault) => (None, Some(fault)),
        };
        Stage { session, replay, fault }
    }

    /// Goes to the time at which the model is to be shown.
    pub fn set(&mut self, time: f64, desk: &Desk) -> Result<(), Fault> {
        if let Some(fault) = &self.fault {
            return Err(self.drawn(fault, desk));
        }
        if time > 0.0
            && let Ok(replay) = self.replay()
        {
            let gone = replay.seek(time);
            self.arrive(gone, desk)?;
        }
        Ok(())
    }

    /// The present, if there is something to be seen.
    pub fn time(&self) -> Option<f64> {
        self.replay.as_ref().map(Replay::time)
    }

    /// The running model.
    ///
    /// # Errors
    /// If there is none.
    pub fn replay(&mut self) -> Result<&mut Replay<'m>, Fault> {
        let why = match &self.fault {
            Some(fault) => format!("the model does not start: {fault}"),
            None if self.session.model.rules.is_empty() => {
                "there is no model yet: `load FILE`, or type an initial string, such as `initial string: A(0)`".to_owned()
            }
            None => "there is no initial string yet: type one, such as `initial string: A(0)`".to_owned(),
        };
        self.replay.as_mut().ok_or_else(|| Fault::new(why))
    }

    /// An error of the run, drawn.
    pub fn drawn(&self, error: &sim::Error, desk: &Desk) -> Fault {
        Fault::Said(error.diagnostic().render(&self.session.source, desk.screen.coloured))
    }

    /// What came of a way to another time.
    pub fn arrive(&mut self, gone: Result<Stop, sim::Error>, desk: &Desk) -> Result<Stop, Fault> {
        let present = self.time().unwrap_or(0.0);
        match gone {
            Ok(Stop::Interrupted) => {
                desk.say(&format!("stopped at t = {}; `run T` goes on from there\n", brief(present, 12)))?;
                Ok(Stop::Interrupted)
            }
            Ok(stop) => Ok(stop),
            Err(error) => {
                let Fault::Said(mut text) = self.drawn(&error, desk) else { return Err(Fault::Closed) };
                text = format!("{}\n(the session stays at t = {})\n", text.trim_end(), brief(present, 12));
                Err(Fault::Said(text))
            }
        }
    }

    /// Goes the way to the present, if nobody wanted to see it before.
    pub fn settle(&mut self, desk: &Desk) -> Result<(), Fault> {
        let gone = self.replay()?.settle();
        self.arrive(gone, desk).map(|_| ())
    }

    /// The structure at present.
    pub fn string(&mut self, desk: &Desk) -> Result<&ModuleString, Fault> {
        self.settle(desk)?;
        if let Err(error) = self.replay()?.string() {
            return Err(self.drawn(&error, desk));
        }
        let formed = self.replay()?.string();
        Ok(formed.expect("it was formed"))
    }

    /// Does what a statement says.
    pub fn obey(&mut self, statement: &Statement, desk: &mut Desk) -> Result<Flow, Fault> {
        let time = self.time().unwrap_or(0.0);
        match statement.kind {
            Line::Command => self.command(&statement.words(), desk),
            Line::Model => {
                let change = desk.draft.with(&statement.text);
                desk.change(change, time)
            }
            Line::Clause => match desk.draft.with_clause(&statement.text) {
                Some(change) => desk.change(change, time),
                None => Err(Fault::new(
                    "a clause belongs to a rule, and none was typed yet; a rule begins with its head: `A(x): if x < 1 solve dx/dt = 1`",
                )),
            },
            Line::Unknown | Line::Blank => Err(unknown(&statement.text)),
        }
    }

    fn command(&mut self, words: &[String], desk: &mut Desk) -> Result<Flow, Fault> {
        let Some((name, rest)) = words.split_first() else {
            return Err(Fault::new("there is no command after the `:`; `help` lists them"));
        };
        let Some(command) = commands::find(name) else { return Err(unknown(name)) };
        let time = self.time().unwrap_or(0.0);
        let nothing = |flow: Flow| match rest.first() {
            None => Ok(flow),
            Some(word) => {
                Err(Fault::new(format!("`{}` takes nothing more, but `{word}` follows", command.name)))
            }
        };
        if ["run", "step", "plot", "render", "save"].contains(&command.name) && self.replay.is_some() {
            desk.warn();
        }
        match command.name {
            "quit" => return nothing(Flow::Quit),
            "help" => desk.say(&commands::help(&rest.join(" ")).map_err(Fault::new)?)?,
            "load" => {
                let [file] = rest else { return Err(misused(command)) };
                return desk.load(std::path::Path::new(file), &[]);
            }
            "reload" => {
                nothing(Flow::On)?;
                return desk.reload(time);
            }
            "new" => {
                nothing(Flow::On)?;
                return Ok(desk.begin_empty());
            }
            "undo" => {
                nothing(Flow::On)?;
                return desk.undo(time);
            }
            "save" => self.save(rest, desk)?,
            "list" => self.list(rest, desk)?,
            "set" => return self.set_parameter(rest, desk),
            "run" => self.run(rest, desk)?,
            "step" => self.step(rest, desk)?,
            "back" => self.back(rest, desk)?,
            "time" => return self.clock(rest, desk),
            "show" => self.show(rest, desk)?,
            "inspect" => self.inspect(rest, desk)?,
            "events" => self.events(rest, desk)?,
            "plot" => self.plot(rest, desk)?,
            "draw" => self.draw(rest, desk)?,
            "export" => self.export(rest, desk)?,
            "explain" | "report" | "render" => self.embedded(command.name, rest)?,
            other => return Err(Fault::new(format!("`{other}` cannot be done"))),
        }
        Ok(Flow::On)
    }

    /// Commands that the command line has, too.
    fn embedded(&mut self, name: &str, rest: &[String]) -> Result<(), Fault> {
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

    fn set_parameter(&mut self, rest: &[String], desk: &mut Desk) -> Result<Flow, Fault> {
        let text = rest.join(" ").replace('=', " ");
        let words: Vec<&str> = text.split_whitespace().collect();
        let all = &self.session.model.parameters;
        let shown = |p: &crate::model::Parameter| {
            let range = p.range.map_or(String::new(), |(lo, hi)| format!("   in {lo} .. {hi}"));
            format!("  {} = {}{range}\n", p.name, p.value)
        };
        match words[..] {
            [] if all.is_empty() => {
                desk.say("this model has no params; `param r = 0.1 in 0 .. 1` declares one\n")?;
            }
            [] => desk.say(&all.iter().map(shown).collect::<String>())?,
            [name] => match all.iter().find(|p| p.name == name) {
                Some(parameter) => desk.say(&shown(parameter))?,
                None => {
                    let hint = did_you_mean(name, all.iter().map(|p| p.name.as_str()));
                    let hint = hint.map_or(String::new(), |hint| format!("; {hint}"));
                    return Err(Fault::new(format!("there is no param `{name}`{hint}")));
                }
            },
            [name, value] => {
                let value: f64 = match value.parse() {
                    Ok(x) if f64::is_finite(x) => x,
                    _ => return Err(Fault::new(format!("`{value}` is not a number"))),
                };
                return desk.set(name, value, self.time().unwrap_or(0.0));
            }
            _ => return Err(misused(commands::find("set").expect("it is one"))),
        }
        Ok(Flow::On)
    }
}

/// A command with too much or too little after it.
pub fn misused(command: &commands::Command) -> Fault {
    let example = command
        .examples
        .first()
        .map_or(String::new(), |(line, does)| format!("\n  for example: {line}   ({does})"));
    Fault::new(format!("it is used as `{} {}`{example}", command.name, command.usage))
}

/// A line that is nothing.
fn unknown(text: &str) -> Fault {
    let line = text.lines().next().unwrap_or("").trim();
    let (word, _) = first_word(line);
    let shown: String = if word.is_empty() { line.chars().take(20).collect() } else { word.to_owned() };
    let hint = did_you_mean(word, commands::names().chain(words::declarations()));
    let hint = hint.map_or(String::new(), |hint| format!("\n  {hint}"));
    Fault::new(format!(
        "`{shown}` begins no command, declaration or rule{hint}\n  `help` lists the commands; the head of a rule ends with `:`, as in `A(x): solve dx/dt = 1`"
    ))
}
