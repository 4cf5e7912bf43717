//! `dlsys completions` and `dlsys man`: what shells and manual pages want to know of the command line, from clap.

use std::io::Write;

use clap::{Args, CommandFactory};
use clap_complete::Shell;

use super::args::Command;
use super::common::{Failure, out_error};

/// Where each shell looks for completions.
pub const WHERE: &str = "\
Examples:
  bash        dlsys completions bash > ~/.local/share/bash-completion/completions/dlsys
  zsh         dlsys completions zsh > ~/.zfunc/_dlsys      with `fpath+=~/.zfunc` before `compinit` in ~/.zshrc
  fish        dlsys completions fish > ~/.config/fish/completions/dlsys.fish
  powershell  dlsys completions powershell >> $PROFILE
  elvish      dlsys completions elvish > ~/.config/elvish/lib/dlsys.elv      and `use dlsys` in rc.elv";

#[derive(Debug, Args)]
pub struct CompletionsArgs {
    /// The shell to complete in
    pub shell: Shell,
}

#[derive(Debug, Args)]
pub struct ManArgs {
    /// The page of this command, such as render, instead of that of dlsys itself
    pub command: Option<String>,
}

/// Prints a script that completes commands and flags.
pub fn completions(args: &CompletionsArgs) -> Result<(), Failure> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Command::command(), "dlsys", &mut script);
    say(&script)
}

/// Prints a manual page, as `man` reads it.
pub fn man(args: &ManArgs) -> Result<(), Failure> {
    let mut whole = Command::command();
    whole.build();
    let command = match &args.command {
        None => whole,
        Some(name) => {
            let names: Vec<&str> = whole.get_subcommands().map(clap::Command::get_name).collect();
            let found = whole.get_subcommands().find(|command| command.get_name() == name);
            let Some(found) = found else {
                return Err(Failure::Usage(format!(
                    "error: there is no command `{name}`\n\n  = help: there are {}\n",
                    names.join(", ")
                )));
            };
            found.clone()
        }
    };
    let mut page = Vec::new();
    clap_mangen::Man::new(command).render(&mut page).map_err(out_error)?;
    say(&page)
}

fn say(bytes: &[u8]) -> Result<(), Failure> {
    let mut out = std::io::stdout().lock();
    out.write_all(bytes).and_then(|()| out.flush()).map_err(out_error)
}
