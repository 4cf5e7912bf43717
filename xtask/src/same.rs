//! `same`: two versions of the program on every model, compared byte for byte.
//!
//! Each model is checked, explained, laid out, run by all methods, both exact schedulers and two seeds, and drawn in all
//! formats. Compared are standard output, standard error, the exit status, and the files: strings with every
//! digit, event logs, counts of work, pictures. Figures that depend on the clock (wall times) are taken out first.
//! There are no stored results: both programs run on the same machine.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// A command that takes longer is killed, and not compared.
const LIMIT: Duration = Duration::from_secs(60);
/// Commands that differ whose differences are shown.
const SHOWN: usize = 20;

/// A command line of the program, run in a directory of its own. `{model}` is put in.
#[derive(Clone, Debug)]
struct Case {
    model: PathBuf,
    arguments: Vec<String>,
}

/// Everything that a command has produced, by name: "stdout", "stderr", "status", and the names of files.
type Produced = BTreeMap<String, Vec<u8>>;

/// Runs the task. False if something differs.
pub fn run(arguments: &[String]) -> Result<bool, String> {
    let mut base = None;
    let mut only = String::new();
    let mut jobs = std::thread::available_parallelism().map_or(1, usize::from);
    let mut words = arguments.iter();
    while let Some(word) = words.next() {
        let mut value = || words.next().cloned().ok_or(format!("{word} needs a value"));
        match word.as_str() {
            "--only" => only = value()?,
            "--jobs" => jobs = value()?.parse().map_err(|e| format!("--jobs: {e}"))?,
            other => base = Some(other.to_owned()),
        }
    }
    let base = base.ok_or("which BASE? A commit, or the path of a program")?;
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").canonicalize().map_err(|e| e.to_string())?;
    let old = if Path::new(&base).is_file() {
        fs::canonicalize(&base).map_err(|e| e.to_string())?
    } else {
        build_commit(&root, &base)?
    };
    let new = build(&root, &root.join("target"))?;
    let mut cases = cases(&root);
    cases.retain(|case| case.to_string().contains(&only));
    println!("{} commands, {jobs} at a time", cases.len());
    let (next, differing, slow) = (AtomicUsize::new(0), Mutex::new(Vec::new()), AtomicUsize::new(0));
    std::thread::scope(|scope| {
        for _ in 0..jobs {
            scope.spawn(|| {
                while let Some(case) = cases.get(next.fetch_add(1, Ordering::Relaxed)) {
                    match (case.produce(&old), case.produce(&new)) {
                        (Some(a), Some(b)) => {
                            if let Some(difference) = difference(&a, &b) {
                                differing.lock().expect("not poisoned").push(format!("{case}\n{difference}"));
                            }
                        }
                        _ => drop(slow.fetch_add(1, Ordering::Relaxed)),
                    }
                }
            });
        }
    });
    let mut differing = differing.into_inner().expect("not poisoned");
    differing.sort();
    differing.iter().take(SHOWN).for_each(|difference| println!("{difference}\n"));
    let slow = slow.into_inner();
    println!(
        "{} of {} commands differ; {slow} took more than {} s and were not compared",
        differing.len(),
        cases.len(),
        LIMIT.as_secs()
    );
    Ok(differing.is_empty())
}

/// Builds a commit in a work tree of its own, under `target/same`.
fn build_commit(root: &Path, commit: &str) -> Result<PathBuf, String> {
    let tree = root.join("target/same/tree");
    if tree.exists() {
        git(&tree, &["checkout", "--quiet", "--detach", commit])?;
    } else {
        git(root, &["worktree", "prune"])?;
        git(root, &["worktree", "add", "--quiet", "--detach", &tree.to_string_lossy(), commit])?;
    }
    build(&tree, &root.join("target/same/target"))
}

fn git(directory: &Path, arguments: &[&str]) -> Result<(), String> {
    let status = Command::new("git").current_dir(directory).args(arguments).status();
    match status {
        Ok(status) if status.success() => Ok(()),
        Ok(status) => Err(format!("git {}: {status}", arguments.join(" "))),
        Err(error) => Err(format!("git: {error}")),
    }
}

pub fn build(tree: &Path, target: &Path) -> Result<PathBuf, String> {
    println!("building {}", tree.display());
    let status = Command::new(env!("CARGO"))
        .current_dir(tree)
        .args(["build", "--release", "--locked", "--quiet", "--bin", "dlsys", "--target-dir"])
        .arg(target)
        .status()
        .map_err(|e| format!("cargo: {e}"))?;
    // A copy, because the other build may take its place.
    let copy = target.join("same-program");
    match status.success() {
        true => fs::copy(target.join("release/dlsys"), &copy).map_err(|e| e.to_string()).map(|_| copy),
        false => Err(format!("{} does not build", tree.display())),
    }
}

/// All commands for all models, in an order that does not depend on the file system.
fn cases(root: &Path) -> Vec<Case> {
    let mut models = Vec::new();
    for folder in
        ["models", "models/abop", "models/ported", "models/hard", "tests/paper-models", "tests/errors"]
    {
        let entries = fs::read_dir(root.join(folder)).into_iter().flatten();
        models.extend(
            entries
                .filter_map(|e| Some(e.ok()?.path()))
                .filter(|p| p.extension().is_some_and(|e| e == "dls")),
        );
    }
    models.sort();
    models.iter().flat_map(|model| commands(model)).collect()
}

/// What is done with a model.
fn commands(model: &Path) -> Vec<Case> {
    let is_mistake = model.to_string_lossy().contains("tests/errors");
    let mut all = Vec::new();
    let mut add = |line: &str| {
        let arguments = line.split_whitespace().map(str::to_owned).collect();
        all.push(Case { model: model.to_owned(), arguments });
    };
    let bounds = "--max-modules 20000 --max-events 200000";
    add("check {model}");
    add("fmt --check {model}");
    let run = format!("run {{model}} --format json --events events --stats stats {bounds} --at 0,0.5,1.7,4");
    add(&run);
    if is_mistake {
        return all;
    }
    add("explain {model}");
    for method in ["dopri5", "dop853", "radau", "rk4"] {
        add(&format!("{run} --method {method}"));
    }
    for rest in ["--scheduler global", "--scheduler global --method dop853 --tolerance 1e-9", "--seed 1"] {
        add(&format!("{run} {rest}"));
    }
    for format in ["svg", "png", "obj"] {
        add(&format!("render {{model}} --at 0,1.7,4 --format {format} {bounds} --max-output 500MB -o out"));
    }
    all
}

impl std::fmt::Display for Case {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        let model = self.model.to_string_lossy();
        let name =
            model.split_once("/models/").or(model.split_once("/tests/")).map_or(&*model, |(_, name)| name);
        write!(f, "dlsys {}", self.arguments.join(" ").replace("{model}", name))
    }
}

impl Case {
    /// Runs a program in an empty directory; `None` if it takes too long.
    fn produce(&self, program: &Path) -> Option<Produced> {
        let directory = tempfile::tempdir().expect("a directory");
        let place = directory.path();
        let output = |name: &str| fs::File::create(place.join(name)).expect("a file");
        let model = self.model.to_string_lossy();
        let mut child = Command::new(program)
            .current_dir(place)
            .args(self.arguments.iter().map(|a| a.replace("{model}", &model)))
            .stdin(Stdio::null())
            .stdout(output("stdout"))
            .stderr(output("stderr"))
            .spawn()
            .expect("the program starts");
        let begun = Instant::now();
        let status = loop {
            match child.try_wait().expect("a child") {
                Some(status) => break status,
                None if begun.elapsed() > LIMIT => {
                    let _ = child.kill();
                    let _ = child.wait();
                    return None;
                }
                None => std::thread::sleep(Duration::from_millis(2)),
            }
        };
        let mut produced = Produced::from([("status".to_owned(), status.to_string().into_bytes())]);
        collect(place, place, &mut produced);
        Some(produced)
    }
}

fn collect(root: &Path, folder: &Path, produced: &mut Produced) {
    for entry in fs::read_dir(folder).into_iter().flatten().filter_map(Result::ok) {
        let path = entry.path();
        if path.is_dir() {
            collect(root, &path, produced);
        } else {
            let name = path.strip_prefix(root).unwrap_or(&path).to_string_lossy().into_owned();
            let content = fs::read(&path).unwrap_or_default();
            produced.insert(name.clone(), timeless(&name, content));
        }
    }
}

/// Takes out what depends on the clock: wall times in statistics, and the end of "3 frames, 4 kB, in 0.01 s".
fn timeless(name: &str, content: Vec<u8>) -> Vec<u8> {
    if !["stats", "stdout", "stderr"].contains(&name) {
        return content;
    }
    let Ok(text) = String::from_utf8(content.clone()) else { return content };
    let without = |line: &str| {
        let is_time = name == "stats" && line.contains("_s\":");
        match line.find(" in ").filter(|at| line[*at..].contains(" s: ")) {
            _ if is_time => String::new(),
            Some(at) => line[..at].to_owned(),
            None => line.to_owned(),
        }
    };
    text.lines().map(without).collect::<Vec<_>>().join("\n").into_bytes()
}

/// The first difference, as a text.
fn difference(old: &Produced, new: &Produced) -> Option<String> {
    let names = old.keys().chain(new.keys());
    let name = names.into_iter().find(|name| old.get(*name) != new.get(*name))?;
    let (Some(a), Some(b)) = (old.get(name), new.get(name)) else {
        return Some(format!(
            "  {name} is there only {}",
            if old.contains_key(name) { "before" } else { "after" }
        ));
    };
    let (Ok(a), Ok(b)) = (std::str::from_utf8(a), std::str::from_utf8(b)) else {
        return Some(format!("  {name}: {} bytes, {} bytes", a.len(), b.len()));
    };
    let line = a.lines().zip(b.lines()).position(|(a, b)| a != b);
    let line = line.unwrap_or(a.lines().count().min(b.lines().count()));
    let show =
        |text: &str| text.lines().nth(line).unwrap_or("(nothing)").chars().take(300).collect::<String>();
    Some(format!("  {name}, line {}\n  - {}\n  + {}", line + 1, show(a), show(b)))
}
