//! Measurements of files that are written: frames of SVG and OBJ against `cat` of the same bytes.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use dlsys_benches::measure::duration;
use dlsys_benches::scale::median;

use crate::{Outcome, ROUNDS, itself, line};

/// The whole command, with reading and running the model, on one thread: model, times, format and target.
const CASES: [(&str, &str, &str, f64); 3] = [
    ("models/dragon.dls", "14,15,16", "svg", 10.0),
    ("models/dragon.dls", "14,15,16", "obj", 5.0),
    ("models/lychnis.dls", "10,12,14,16,18", "obj", 5.0),
];

pub fn export() -> Outcome {
    let folder = std::env::temp_dir().join(format!("dlsys-scale-{}", std::process::id()));
    let outcome = CASES.into_iter().try_for_each(|case| against_cat(&folder, case));
    let removed = fs::remove_dir_all(&folder).map_err(|e| e.to_string());
    outcome.and(removed)
}

/// Both write to the same disk, in turns.
fn against_cat(folder: &Path, (model, times, format, target): (&str, &str, &str, f64)) -> Outcome {
    let path = format!("{}/../{model}", env!("CARGO_MANIFEST_DIR"));
    let frames = folder.join("frames");
    let out = frames.to_str().ok_or("the folder for temporary files is not UTF-8")?;
    let (mut ours, mut plain, mut ratios, mut bytes) = (Vec::new(), Vec::new(), Vec::new(), 0);
    for _ in 0..ROUNDS {
        let begin = Instant::now();
        itself(&["render", &path, "--at", times, "--format", format, "--threads", "1", "-o", out])?;
        ours.push(begin.elapsed().as_secs_f64());
        let files = fs::read_dir(&frames).map_err(|e| e.to_string())?.filter_map(|f| Some(f.ok()?.path()));
        let files: Vec<PathBuf> = files.collect();
        let copy = folder.join("copy");
        let begin = Instant::now();
        let all = File::create(&copy).map_err(|e| e.to_string())?;
        let status = Command::new("cat").args(&files).stdout(all).status().map_err(|e| e.to_string())?;
        plain.push(begin.elapsed().as_secs_f64());
        if !status.success() {
            return Err("cat has failed".into());
        }
        bytes = fs::metadata(&copy).map_err(|e| e.to_string())?.len();
        ratios.push(ours[ours.len() - 1] / plain[plain.len() - 1]);
        fs::remove_dir_all(&frames).and_then(|()| fs::remove_file(&copy)).map_err(|e| e.to_string())?;
    }
    let (seconds, ratio) = (median(ours), median(ratios));
    let measured = format!(
        "{:.0} MB, {:.0} MB/s; {} : {}, ratio {ratio:.1}",
        bytes as f64 / 1e6,
        bytes as f64 / 1e6 / seconds,
        duration(seconds),
        duration(median(plain))
    );
    let what = format!("{} of {model} at {times}, dlsys render : cat", format.to_uppercase());
    line(&what, &measured, &format!("{target}"), Some(ratio <= target));
    Ok(())
}
