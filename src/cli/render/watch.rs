//! `dlsys render --watch`: renders again whenever a file of the model changes.
//!
//! Files are polled a few times a second, which works on every file system and with every editor, including those that
//! rename a temporary file. Time of change and length are compared with those before the file was read, so that a
//! change during a render is not missed. An obsolete render is abandoned if it has not written anything.

use std::path::Path;
use std::time::Duration;

use super::once;
use crate::cli::args::RenderArgs;
use crate::cli::common::{Failure, tell};
use crate::session::{Input, Session};

/// Time between two polls.
const LOOK: Duration = Duration::from_millis(150);

/// Renders until the process is ended.
///
/// # Errors
/// Errors in the command line, found by the first render.
pub fn watch(args: &RenderArgs) -> Result<(), Failure> {
    let mut first = true;
    // Whether the directory has the frames of a valid model.
    let mut drawn = false;
    loop {
        let inputs = inputs(args);
        match once(args, &|| inputs.iter().any(Input::is_stale)) {
            Ok(()) => drawn = true,
            Err(Failure::Stale) => {}
            Err(Failure::Usage(message)) if first => return Err(Failure::Usage(message)),
            Err(Failure::Model(message) | Failure::Usage(message)) => {
                tell(&message);
                if drawn {
                    tell(&format!("{} keeps the frames of the last good model\n", args.out.display()));
                }
            }
            Err(Failure::ClosedPipe) => return Err(Failure::ClosedPipe),
        }
        if std::mem::take(&mut first) {
            tell(&format!("watching {}; Ctrl-C ends\n", names(&inputs)));
        }
        let changed = wait(&inputs);
        tell(&format!("{} has changed\n", changed.display()));
    }
}

/// The files of the model in their present state.
fn inputs(args: &RenderArgs) -> Vec<Input> {
    match Session::open_with(&args.shared.model, &args.shared.settings, &args.shared.include.folders) {
        Ok(session) => session.inputs,
        Err(refused) => refused.inputs,
    }
}

/// Waits until a file changes and has stopped changing; returns its path.
fn wait(inputs: &[Input]) -> &Path {
    loop {
        std::thread::sleep(LOOK);
        let Some(changed) = inputs.iter().find(|input| input.is_stale()) else { continue };
        loop {
            let now = Input::now(&changed.path);
            std::thread::sleep(LOOK / 3);
            // An editor may remove a file for an instant.
            if !now.is_stale() && (now.is_there() || !changed.is_there()) {
                return &changed.path;
            }
            if !now.is_stale() && !changed.is_stale() {
                // Unchanged after all.
                break;
            }
            if !now.is_there() {
                std::thread::sleep(5 * LOOK);
                if !now.is_stale() {
                    return &changed.path;
                }
            }
        }
    }
}

fn names(inputs: &[Input]) -> String {
    let mut names: Vec<String> = inputs.iter().map(|input| input.path.display().to_string()).collect();
    names.sort();
    names.dedup();
    match names.len() {
        0..=3 => names.join(", "),
        n => format!("{} and {} more", names[..2].join(", "), n - 2),
    }
}
