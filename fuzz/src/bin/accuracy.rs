//! Random models against another way of solving them: `accuracy --seconds 60 --seed 1` (README).
//!
//! `--count N` stops after N models, `--only N` judges the model with that number and prints it. A model with a wrong result, or a
//! panic, is written into the folder `found`, and the exit status is 1. Errors in place of results are counted by their first words.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::time::Instant;

use dlsys_fuzz::Options;
use dlsys_fuzz::accuracy::{Verdict, random};

/// Numbers of models for one seed.
const NUMBERS: u64 = 1 << 32;

fn main() {
    let mut only = None;
    let Options { seconds, most, seed } = Options::read(|argument, value| match argument {
        "--only" => only = Some(value().parse::<u64>().expect("--only N")),
        other => panic!("`{other}` is none of --seconds, --count, --seed, --only"),
    });
    let trial = |number: u64| random(seed.wrapping_mul(NUMBERS).wrapping_add(number));
    if let Some(number) = only {
        let trial = trial(number);
        println!("{}\n# {}\n# {:?}", trial.text(), trial.command("FILE"), trial.judge());
        return;
    }
    let begun = Instant::now();
    let (mut count, mut right, mut states, mut open, mut wrong) = (0_u64, 0_u64, 0, 0_u64, 0_u64);
    let mut refused: BTreeMap<String, (u64, u64)> = BTreeMap::new();
    while begun.elapsed().as_secs_f64() < seconds && count < most {
        let trial = trial(count);
        let verdict = catch_unwind(AssertUnwindSafe(|| trial.judge()))
            .unwrap_or_else(|_| Verdict::Wrong("it panicked".to_owned()));
        match verdict {
            Verdict::Right(known) => (right, states) = (right + 1, states + known),
            Verdict::Open => open += 1,
            Verdict::Refused(message) => {
                // Messages name places and numbers behind their first words.
                let line = message.lines().next().unwrap_or_default();
                let words =
                    line.split(|c: char| c.is_ascii_digit()).map(str::trim).find(|words| !words.is_empty());
                refused.entry(words.unwrap_or(line).to_owned()).or_insert((0, count)).0 += 1;
            }
            Verdict::Wrong(why) => {
                wrong += 1;
                let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("found");
                let path = folder.join(format!("accuracy-{seed}-{count}.dls"));
                let text = format!("# {why}\n# {}\n{}", trial.command("FILE"), trial.text());
                let _ = std::fs::create_dir_all(&folder).and_then(|()| std::fs::write(&path, text));
                eprintln!("wrong: {}\n  {why}", path.display());
            }
        }
        count += 1;
    }
    println!(
        "{count} models: {right} right in {states} states, {open} that hang on less than the errors, {wrong} wrong"
    );
    for (message, (times, first)) in &refused {
        println!("  {times} ended with an error, first number {first}: {message}");
    }
    std::process::exit(i32::from(wrong > 0));
}
