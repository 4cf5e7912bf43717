//! Animations in one file: its path, what it may be written over, and how it is written.

use std::io::Read;
use std::path::{Path, PathBuf};

use super::common::Failure;
use crate::render;

fn usage(message: impl std::fmt::Display) -> Failure {
    Failure::Usage(format!("error: {message}\n"))
}

/// The path of the file: as given, or in a folder under the name of the model.
pub fn file_of(out: &Path, model: &Path, wanted: &str) -> Result<PathBuf, Failure> {
    refuse_stream(out, &format!("a .{wanted} file has a name: `-o {}`", named(model, wanted)))?;
    let text = out.to_string_lossy();
    match out.extension().map(|extension| extension.to_string_lossy().to_lowercase()) {
        Some(extension) if extension == wanted && !out.is_dir() => Ok(out.to_owned()),
        Some(extension) if !out.is_dir() && !text.ends_with('/') => Err(usage(format!(
            "`-o {}` is a .{extension} file, and --format {wanted} writes .{wanted}: `-o {}`",
            out.display(),
            out.with_extension(wanted).display()
        ))),
        _ => Ok(out.join(named(model, wanted))),
    }
}

/// The name of a file that is called like a model.
pub fn named(model: &Path, ending: &str) -> String {
    let stem = model.file_stem().map_or("plant".into(), |stem| stem.to_string_lossy());
    format!("{stem}.{ending}")
}

/// Refuses `-o -` where that is not standard output.
pub fn refuse_stream(out: &Path, help: &str) -> Result<(), Failure> {
    match out == Path::new("-") {
        true => Err(usage(format!("`-o -` is standard output, to which only --format y4m writes; {help}"))),
        false => Ok(()),
    }
}

/// Refuses to write over a file of another kind (`kind`: what it is not, with its article); `is_ours` tells by its first bytes whether it is of this one.
pub fn spare(out: &Path, force: bool, kind: &str, is_ours: impl Fn(&[u8]) -> bool) -> Result<(), Failure> {
    if out.is_dir() {
        return Err(usage(format!("{} is a directory: name another file", out.display())));
    }
    let Ok(mut file) = std::fs::File::open(out) else { return Ok(()) };
    let mut start = [0; 64];
    // An empty file is nobody's work.
    let known = match file.read(&mut start) {
        Ok(0) => true,
        Ok(count) => is_ours(&start[..count]),
        Err(_) => false,
    };
    if force || known || !out.is_file() {
        return Ok(());
    }
    Err(usage(format!(
        "{} is there and is not {kind} file: choose another name, or add --force",
        out.display()
    )))
}

/// Refuses to write a copy of a picture over a file with another content.
pub fn spare_copy(out: &Path, bytes: &[u8], force: bool) -> Result<(), Failure> {
    let is_same = || std::fs::read(out).is_ok_and(|known| known.is_empty() || known == bytes);
    if force || !out.exists() || is_same() {
        return Ok(());
    }
    Err(usage(format!(
        "{} is there and is another file than the picture that would be copied to it: choose another folder, or add --force",
        out.display()
    )))
}

/// The folder and the name of a file; the folder is made if it is not there.
pub fn place_of(out: &Path) -> Result<(&Path, String), Failure> {
    let folder = out.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    std::fs::create_dir_all(folder)
        .map_err(|error| usage(format!("cannot make the directory {}: {error}", folder.display())))?;
    Ok((folder, out.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()))
}

/// Writes the file, whole or not at all.
pub fn save(out: &Path, bytes: &[u8]) -> Result<(), Failure> {
    let (folder, name) = place_of(out)?;
    render::replace(folder, &name, bytes).map_err(|error| Failure::Model(format!("error: {error}\n")))
}
