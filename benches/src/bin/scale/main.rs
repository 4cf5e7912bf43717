//! Prints the table of ratios at scale: `cargo run --release --bin scale [NAME…]`.
//!
//! Names: parsing, productions, dragon, filament, branches, busy, growing, threads, frames, export, blocks, memory, start; all
//! of them by default. Ratios are those of one run on one machine. Memory, start-up time and files are measured in separate
//! processes, which run this program with other arguments.

mod blocks;
mod cells;
mod export;
mod formulas;

use std::process::{Command, ExitCode};
use std::time::Instant;

use dlsys::sim::Settings;
use dlsys::tree::ModuleString;
use dlsys_benches::measure::duration;
use dlsys_benches::plants;
use dlsys_benches::scale::{self, median};
use dlsys_benches::solver;

/// Measurements of which the middle one counts.
const ROUNDS: usize = 5;

type Outcome = Result<(), String>;
/// The measurements by name.
type Part = (&'static str, fn() -> Outcome);

const PARTS: [Part; 13] = [
    ("parsing", formulas::parsing),
    ("productions", formulas::productions),
    ("dragon", formulas::dragon),
    ("filament", cells::filament),
    ("branches", formulas::branches),
    ("busy", cells::busy),
    ("growing", cells::growing),
    ("threads", cells::threads),
    ("frames", formulas::frames),
    ("export", export::export),
    ("blocks", blocks::blocks),
    ("memory", memory),
    ("start", starting),
];

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let outcome = match arguments.first().map(String::as_str) {
        Some("check" | "render") => return ExitCode::from(dlsys::cli::main()),
        Some("peak") => peak(&arguments[1..]),
        _ => table(&arguments),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("scale: {message}");
            ExitCode::FAILURE
        }
    }
}

fn table(chosen: &[String]) -> Outcome {
    if let Some(name) = chosen.iter().find(|name| PARTS.iter().all(|part| part.0 != **name)) {
        return Err(format!("there is no measurement `{name}`"));
    }
    println!("| what | measured | target | |");
    println!("|---|---|---|---|");
    for (name, part) in PARTS {
        if chosen.is_empty() || chosen.iter().any(|c| c == name) {
            part()?;
        }
    }
    Ok(())
}

/// One line; `met` tells whether a target is met, if there is one.
fn line(what: &str, measured: &str, target: &str, met: Option<bool>) {
    let verdict = met.map_or("", |met| if met { "met" } else { "missed" });
    println!("| {what} | {measured} | {target} | {verdict} |");
}

/// Peak memory of processes of their own.
fn memory() -> Outcome {
    let cases: [(&str, &str, f64, Option<f64>); 4] = [
        ("10^7 modules with two parameters, run to t = 1.5", "modules", 1e7, Some(1e9)),
        ("the same, with a state written out", "modules-written", 1e7, None),
        ("dragon to t = 20, run", "dragon", 2f64.powi(20), Some(2e9)),
        ("dragon to t = 20, with its state written out", "dragon-written", 2f64.powi(20), Some(2e9)),
    ];
    for (what, name, modules, limit) in cases {
        let bytes: f64 = itself(&["peak", name])?.parse().map_err(|_| "no number of bytes")?;
        let measured = format!("{:.2} GB, {:.0} bytes each of {modules}", bytes / 1e9, bytes / modules);
        let target = limit.map_or(String::new(), |l| format!("{} GB", l / 1e9));
        line(&format!("peak memory, {what}"), &measured, &target, limit.map(|l| bytes <= l));
    }
    Ok(())
}

/// Runs a measurement of `memory` and prints the peak of resident memory in bytes.
fn peak(arguments: &[String]) -> Outcome {
    let what = arguments.first().map_or("", String::as_str);
    let (text, end) = match what.trim_end_matches("-written") {
        "modules" => (plants::two_parameters(10_000_000), 1.5),
        "dragon" => (scale::DRAGON.to_string(), 20.0),
        _ => return Err(format!("`{what}` is not measured")),
    };
    let session = solver::session(&text)?;
    let settings = Settings { max_modules: 20_000_000, ..Settings::default() };
    let mut simulation = session.simulate(settings).map_err(|e| e.to_string())?;
    if what.ends_with("-written") {
        let mut string = ModuleString::default();
        simulation.at(end, &mut string).map_err(|e| e.to_string())?;
    } else {
        simulation.pass(end).map_err(|e| e.to_string())?;
    }
    println!("{}", scale::peak_memory().ok_or("this system does not tell the peak of memory")?);
    Ok(())
}

/// `dlsys check` of a small model, the start of the process counted.
fn starting() -> Outcome {
    let model = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/paper-models/anabaena.dls");
    let once = |_| -> Result<f64, String> {
        let begin = Instant::now();
        itself(&["check", model])?;
        Ok(begin.elapsed().as_secs_f64())
    };
    let seconds = median((0..51).map(once).collect::<Result<_, String>>()?);
    line("dlsys check of the Anabaena listing", &duration(seconds), "10 ms", Some(seconds < 0.01));
    Ok(())
}

fn itself(arguments: &[&str]) -> Result<String, String> {
    let program = std::env::current_exe().map_err(|e| e.to_string())?;
    let output = Command::new(program).args(arguments).output().map_err(|e| e.to_string())?;
    match output.status.success() {
        true => Ok(String::from_utf8_lossy(&output.stdout).trim().to_string()),
        false => Err(String::from_utf8_lossy(&output.stderr).into_owned()),
    }
}
