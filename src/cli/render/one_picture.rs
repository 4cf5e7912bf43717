//! `-o plant.png`: the format by the ending of the file; one frame, or a sheet of frames, as a file of that name.

use std::path::{Path, PathBuf};

use super::Failure;
use crate::cli::args::RenderArgs;
use crate::cli::one_file::{save, spare};
use crate::cli::values::RenderFormat;
use crate::render::{Content, Format, Layout};

/// The ending of the file that is to be written; none of a folder.
fn ending(out: &Path) -> Option<String> {
    let is_folder = out.is_dir() || out.to_string_lossy().ends_with('/');
    let ending = out.extension().filter(|_| !is_folder)?;
    Some(ending.to_string_lossy().to_lowercase())
}

/// The format that the file's name says.
pub fn format_of(out: &Path) -> Option<RenderFormat> {
    RenderFormat::named(&ending(out)?)
}

/// The format, if the output is one picture, in a file and not in a folder.
pub fn format(args: &RenderArgs) -> Option<Format> {
    let RenderFormat::Frames(format) = args.format else { return None };
    let is_file = ending(&args.out).is_some_and(|ending| ending == format.extension());
    let is_one = args.layout != Layout::Frames
        || args.orbit.is_none() && args.shared.at.as_ref().is_some_and(|at| at.len() == 1);
    (is_file && is_one && args.seeds.is_none() && format.content() != Content::Mesh).then_some(format)
}

/// Refuses to write over a file of another kind.
pub fn spare_others(args: &RenderArgs, format: Format) -> Result<(), Failure> {
    let kind = if format == Format::PNG { "a PNG" } else { "an SVG" };
    spare(&args.out, args.force, kind, |start| match format.content() {
        Content::Pixels => start.starts_with(b"\x89PNG"),
        _ => start.starts_with(b"<svg") || start.starts_with(b"<?xml"),
    })
}

/// Moves the picture out of the folder in which it has been made.
pub fn put(folder: &Path, args: &RenderArgs, format: Format) -> Result<(), Failure> {
    let failed = |error: std::io::Error| {
        Failure::Model(format!("error: cannot write {}: {error}\n", args.out.display()))
    };
    let files = std::fs::read_dir(folder).map_err(failed)?.flatten().map(|entry| entry.path());
    let of_format = |path: &PathBuf| path.extension().is_some_and(|ending| ending == format.extension());
    let Some(picture) = files.into_iter().find(of_format) else { return Ok(()) };
    save(&args.out, &std::fs::read(picture).map_err(failed)?)
}
