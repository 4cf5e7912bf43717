//! Failures of frames and of their directory, as they are told.

use std::collections::HashMap;

use super::super::common::{Failure, size_of};
use super::super::frame_source::Frame;
use crate::render;
use crate::scene::Scene;

/// The failure for an error of a frame; for one that is too large, with the module that draws most.
pub(super) fn explain(error: render::Error, frame: &Frame, scene: &Scene) -> Failure {
    let render::Error::TooLarge { limit } = error else { return out_of_directory(error) };
    let mut counts: HashMap<&str, usize> = HashMap::new();
    let owners = scene.segments.iter().map(|s| s.owner).chain(scene.polygons.iter().map(|p| p.owner));
    let owners =
        owners.chain(scene.surfaces.iter().map(|s| s.owner)).chain(scene.patches.iter().map(|p| p.owner));
    for owner in owners {
        *counts.entry(&*scene.owner(owner).name).or_default() += 1;
    }
    let most = counts.into_iter().max_by(|a, b| a.1.cmp(&b.1).then(b.0.cmp(a.0)));
    let most = most.map_or(String::new(), |(name, count)| {
        format!(
            "  = note: frame {} at t = {} draws {count} pieces for `{name}`, more than for anything else\n",
            frame.index, frame.time
        )
    });
    Failure::Model(format!(
        "error: the files of this render are larger than {}\n\n{most}  \
         = help: a coarser --accuracy makes surfaces and stems of fewer pieces, fewer frames make fewer files\n  \
         = help: if this is meant, allow more: `--max-output {:.0}GB`\n",
        size_of(limit),
        (limit as f64 / 1e8).ceil().max(1.0)
    ))
}

/// The failure for an error of the directory of frames.
pub(super) fn out_of_directory(error: render::Error) -> Failure {
    let message = format!("error: {error}\n");
    match error {
        render::Error::Io { .. } | render::Error::TooLarge { .. } | render::Error::AnotherView { .. } => {
            Failure::Model(message)
        }
        // The directory was chosen on the command line.
        _ => Failure::Usage(message),
    }
}
