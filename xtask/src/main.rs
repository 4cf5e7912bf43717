//! Chores of development, started as `cargo run -p xtask -- TASK`.

mod same;

use std::process::ExitCode;

const USAGE: &str = "usage: cargo run -p xtask -- same BASE [--only TEXT] [--jobs N]

same   builds the commit BASE and the work tree in release mode, runs both programs on every model of the
       repository, and compares what they print and write, byte for byte. BASE may also be the path of a
       program. --only TEXT: models and commands that contain TEXT";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.split_first() {
        Some((task, rest)) if task == "same" => match same::run(rest) {
            Ok(true) => ExitCode::SUCCESS,
            Ok(false) => ExitCode::FAILURE,
            Err(error) => {
                eprintln!("{error}");
                ExitCode::from(2)
            }
        },
        _ => {
            eprintln!("{USAGE}");
            ExitCode::from(2)
        }
    }
}
