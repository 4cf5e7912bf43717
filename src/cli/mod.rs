//! The command line: `dlsys check`, `explain`, `run`, `render`, `view`, `gallery`, `report` and `repl`; `new`, `fmt`; `completions`,
//! `man`.
//!
//! Exit status: 0 success; 1 an error in the model or the run; 2 an error in the command line; 101 a bug in dlsys.

mod album;
pub(crate) mod args;
pub(crate) mod common;
mod continuity;
pub(crate) mod embedded;
mod events;
mod explain;
mod export;
mod field;
mod fmt;
mod frame_source;
mod gallery;
mod new;
mod one_file;
mod output;
mod parallel;
mod progress;
mod render;
mod report;
pub(crate) mod run;
mod shared;
mod shell;
mod specimens;
mod tips;
mod values;
mod verify;
mod view;

use clap::Parser;

use crate::rescue;
use args::{Action, Command};
use common::{Failure, tell};

/// Runs the command line of this process; returns its exit status.
pub fn main() -> u8 {
    rescue::guarded(&std::env::temp_dir(), command_line).unwrap_or_else(|message| {
        tell(&message);
        rescue::STATUS
    })
}

fn command_line() -> u8 {
    #[cfg(debug_assertions)]
    if std::env::var_os("DLSYS_PANIC").is_some_and(|what| what == "at once") {
        panic!("asked for");
    }
    let mut command = match Command::try_parse() {
        Ok(command) => command,
        Err(error) => {
            let error = tips::improved(error);
            // Help and version are answers, not errors; clap knows which stream they belong on.
            if let Err(Failure::Model(message)) = error.print().map_err(common::out_error) {
                tell(&message);
                return 1;
            }
            return u8::try_from(error.exit_code()).unwrap_or(2);
        }
    };
    if command.progress {
        progress::ask();
    }
    command.action.complete();
    let done = match &command.action {
        Action::New(args) => new::new(args),
        Action::Fmt(args) => fmt::fmt(args),
        Action::Check(args) => run::check(args),
        Action::Explain(args) => explain::explain(args),
        Action::Run(args) => run::run(args),
        Action::Render(args) => render::render(args),
        Action::View(args) => view::view(args),
        Action::Gallery(args) => gallery::gallery(args),
        Action::Report(args) => report::report(args),
        Action::Completions(args) => shell::completions(args),
        Action::Man(args) => shell::man(args),
        Action::Repl(args) => crate::repl::repl(args),
    };
    match done {
        Ok(()) | Err(Failure::ClosedPipe | Failure::Stale) => 0,
        Err(Failure::Model(message)) => {
            tell(&message);
            1
        }
        Err(Failure::Usage(message)) => {
            tell(&message);
            2
        }
    }
}
