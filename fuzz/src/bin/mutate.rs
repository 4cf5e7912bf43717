//! Mutates models randomly and runs a target on them: `mutate --seconds 60 --seed 1 front` (README).
//!
//! The corpus consists of the models and the error gallery of the repository; for `files`, of the files in `seeds`. The same
//! seed gives the same inputs; `--count N` stops after N of them. An input that causes a panic or takes longer than ten
//! seconds is written into the folder `found`, and the exit status is 1.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use dlsys_fuzz::{Dice, Options, TARGETS};

/// Inputs that take longer than this count as a hang.
const HANG: Duration = Duration::from_secs(10);
const NUMBERS: [&str; 14] = [
    "0",
    "-1",
    "1e-320",
    "1e-300",
    "1e-18",
    "1e308",
    "1e999",
    "0.1",
    "3",
    "1e16",
    "-0",
    "255",
    "4294967296",
    "1e5",
];
/// Larger inputs are truncated: small ones suffice to find errors.
const MOST: usize = 6000;

/// Adds the files of a folder and those in it that end so and are short enough.
fn collect(folder: &Path, endings: &[&str], corpus: &mut Vec<Vec<u8>>) {
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    let mut paths: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    paths.sort();
    for path in paths {
        if path.is_dir() {
            collect(&path, endings, corpus);
        } else if path.extension().is_some_and(|e| endings.iter().any(|ending| e == *ending)) {
            corpus.extend(std::fs::read(&path).ok().filter(|text| text.len() <= MOST));
        }
    }
}

/// Pieces of a text that are changed as a whole: words, numbers, single signs.
fn tokens(text: &[u8]) -> Vec<(usize, usize)> {
    let (mut found, mut start) = (Vec::new(), 0);
    let word = |b: u8| b.is_ascii_alphanumeric() || b == b'_' || b == b'.' || b >= 0x80;
    for i in 1..=text.len() {
        if i == text.len() || !(word(text[i - 1]) && word(text[i])) {
            found.push((start, i));
            start = i;
        }
    }
    found
}

fn mutate(text: &mut Vec<u8>, other: &[u8], dice: &mut Dice) {
    let all = tokens(text);
    if all.is_empty() {
        return text.extend_from_slice(other);
    }
    let (from, to) = all[dice.roll(all.len())];
    match dice.roll(9) {
        0 => text[from] = dice.roll(256) as u8,
        1 => drop(text.drain(from..to)),
        2 => {
            let copy = text[from..to].to_vec();
            text.splice(to..to, copy);
        }
        3 => {
            // A token of another text.
            let theirs = tokens(other);
            if let Some(&(a, b)) = theirs.get(dice.roll(theirs.len())) {
                text.splice(from..to, other[a..b].iter().copied());
            }
        }
        4 | 5 => {
            let numbers: Vec<_> = all.iter().filter(|(a, _)| text[*a].is_ascii_digit()).collect();
            if let Some(&&(a, b)) = numbers.get(dice.roll(numbers.len())) {
                text.splice(a..b, NUMBERS[dice.roll(NUMBERS.len())].bytes());
            }
        }
        6 => {
            let (a, b) = all[dice.roll(all.len())];
            let (mine, theirs) = (text[from..to].to_vec(), text[a..b].to_vec());
            if to <= a {
                text.splice(a..b, mine);
                text.splice(from..to, theirs);
            }
        }
        7 => {
            let mut lines: Vec<Vec<u8>> = text.split(|b| *b == b'\n').map(<[u8]>::to_vec).collect();
            let theirs: Vec<&[u8]> = other.split(|b| *b == b'\n').collect();
            let (at, line) = (dice.roll(lines.len()), theirs[dice.roll(theirs.len())].to_vec());
            match dice.roll(3) {
                0 => drop(lines.remove(at)),
                1 => lines.insert(at, line),
                _ => lines[at] = line,
            }
            *text = lines.join(&b'\n');
        }
        _ => {
            text.truncate(from);
            text.extend_from_slice(&other[dice.roll(other.len())..]);
        }
    }
    text.truncate(MOST);
}

/// The processor time of this program, where the system tells; else the time since it began. The machine may be busy.
fn worked(begun: Instant) -> Duration {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    // Behind the name, which stands in brackets: user and system time in hundredths of a second.
    let fields = stat.rsplit(')').next().unwrap_or_default().split_whitespace().skip(11).take(2);
    let hundredths: Option<u64> = fields.map(|field| field.parse::<u64>().ok()).sum();
    match hundredths.filter(|_| !stat.is_empty()) {
        Some(hundredths) => Duration::from_millis(10 * hundredths),
        None => begun.elapsed(),
    }
}

/// Writes an input that is a finding.
fn keep(target: &str, kind: &str, number: u64, input: &[u8]) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("found");
    let path = folder.join(format!("{target}-{kind}-{number}.dls"));
    let _ = std::fs::create_dir_all(&folder).and_then(|()| std::fs::write(&path, input));
    eprintln!("{kind}: {}", path.display());
}

fn main() {
    let mut name = "front".to_owned();
    let Options { seconds, most, seed } = Options::read(|argument, _| argument.clone_into(&mut name));
    let (name, target) = *TARGETS
        .iter()
        .find(|(known, _)| *known == name)
        .expect("a target: front, format, simulate, draw, files");
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut corpus = Vec::new();
    match name {
        "files" => collect(&root.join("fuzz/seeds"), &["csv", "s", "obj", "mtl", "png", "dls"], &mut corpus),
        _ => {
            collect(&root.join("models"), &["dls"], &mut corpus);
            collect(&root.join("tests/errors"), &["dls"], &mut corpus);
        }
    }
    assert!(!corpus.is_empty(), "the corpus is there");
    println!("{name}: seed {seed}, {} texts", corpus.len());
    let begun = Instant::now();
    // The current input, for the watchdog.
    let current: Arc<Mutex<(u64, Duration, Vec<u8>)>> = Arc::new(Mutex::new((0, worked(begun), Vec::new())));
    let watched = current.clone();
    std::thread::spawn(move || {
        loop {
            std::thread::sleep(Duration::from_millis(500));
            let now = watched.lock().expect("never poisoned: nothing panics while it is held");
            if worked(begun).saturating_sub(now.1) > HANG {
                keep(name, "hang", now.0, &now.2);
                std::process::exit(1);
            }
        }
    });
    let mut dice = Dice::new(seed);
    let (mut count, mut panics) = (0_u64, 0);
    std::panic::set_hook(Box::new(|panic| eprintln!("{panic}")));
    while begun.elapsed().as_secs_f64() < seconds && count < most {
        let mut input = corpus[dice.roll(corpus.len())].clone();
        for _ in 0..1 + dice.roll(4) {
            let other = &corpus[dice.roll(corpus.len())];
            mutate(&mut input, other, &mut dice);
        }
        *current.lock().expect("never poisoned") = (count, worked(begun), input.clone());
        if catch_unwind(AssertUnwindSafe(|| target(&input))).is_err() {
            panics += 1;
            keep(name, "panic", count, &input);
        }
        count += 1;
    }
    let peak = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak = peak.lines().find(|line| line.starts_with("VmHWM")).unwrap_or("").to_owned();
    println!(
        "{count} inputs, {:.0} a second, {panics} panics; {peak}",
        count as f64 / begun.elapsed().as_secs_f64()
    );
    std::process::exit(i32::from(panics > 0));
}
