//! Chores of development, started as `cargo run -p xtask -- TASK`.

mod same;
mod svg;

use std::process::ExitCode;

const USAGE: &str = "usage: cargo run -p xtask -- same BASE [--only TEXT] [--jobs N]
       cargo run -p xtask -- svg [--program PATH] [MODELS]

same   builds the commit BASE and the work tree in release mode, runs both programs on every model of the
       repository, and compares what they print and write, byte for byte. BASE may also be the path of a
       program. --only TEXT: models and commands that contain TEXT
svg    draws MODELS (all that the repository shows, if there are none) at three times, from the front and in
       perspective, as PNG and SVG, lets librsvg draw the SVG, and compares the pixels. Fails if they differ by
       more than the bounds. --program PATH: the program to test, instead of a release build";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let result = match arguments.split_first() {
        Some((task, rest)) if task == "same" => same::run(rest),
        Some((task, rest)) if task == "svg" => svg::run(rest),
        _ => Err(USAGE.to_owned()),
    };
    match result {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::from(2)
        }
    }
}
