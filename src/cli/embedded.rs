//! The commands `render`, `explain` and `report` in an interactive session, with all flags of the command line, applied to
//! the loaded model.

use clap::Parser;

use super::args::{Action, Command};
use super::common::{Failure, ModelRun};
use super::{explain, render, report, tips};
use crate::session::Session;

/// Runs a command; `words` are its name and arguments, without the model.
///
/// # Errors
/// As on the command line; `--help` is not an error.
pub fn run(session: &Session, words: &[String]) -> Result<(), Failure> {
    if words.iter().any(|word| word == "--set" || word.starts_with("--set=")) {
        let message = "error: params are set by the command `set NAME = VALUE` here, not by `--set`\n";
        return Err(Failure::Usage(message.to_owned()));
    }
    let mut line = vec!["dlsys".to_owned()];
    line.extend(words.iter().take(1).cloned());
    // A name that begins with a dash must not look like a flag.
    line.push(format!("./{}", session.source.name).replace(".//", "/"));
    line.extend(words.iter().skip(1).cloned());
    let mut command = match Command::try_parse_from(&line) {
        Ok(command) => command,
        Err(error) => {
            let error = tips::improved(error);
            return match error.use_stderr() {
                true => Err(Failure::Usage(error.to_string())),
                false => error.print().map_err(super::common::out_error),
            };
        }
    };
    command.action.complete();
    match &command.action {
        Action::Render(args) => {
            render::render_run(args, ModelRun::of(session.clone(), &args.shared)?, &|| false)
        }
        Action::Explain(args) => explain::show(args, session),
        Action::Report(args) => {
            let stem = std::path::Path::new(&session.source.name).file_stem();
            let name = stem.map_or("model".to_owned(), |s| s.to_string_lossy().into_owned());
            match report::of(args, (None, session), &name)? {
                true => Ok(()),
                false => Err(Failure::Model(format!("error: {name} not verified\n"))),
            }
        }
        _ => Err(Failure::Usage(format!("error: `{}` is no command of a session\n", words[0]))),
    }
}
