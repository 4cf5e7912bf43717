//! Colours of a mesh from its material library (Wavefront MTL): `newmtl` and `Kd`; other lines are ignored.

use std::path::Path;

use super::{SIZE_LIMIT, SurfaceError};
use dlsys_model::NamedColor;
use dlsys_syntax::{Files, is_inside};

/// Maximum number of materials of one mesh.
const LIMIT: usize = 1000;

/// The materials that the faces of a mesh name.
#[derive(Default)]
pub(super) struct Library {
    known: Vec<NamedColor>,
}

impl Library {
    /// Reads a library in the folder of the mesh. A missing file is not an error, as many meshes are distributed without it.
    pub(super) fn add(&mut self, name: &str, mesh: &str, files: &dyn Files) -> Result<(), SurfaceError> {
        let folder = Path::new(mesh).parent().unwrap_or(Path::new(""));
        let path = folder.join(name);
        if !path.to_str().is_some_and(is_inside) {
            return Ok(());
        }
        let Ok(bytes) = files.read(&path, SIZE_LIMIT) else { return Ok(()) };
        self.parse(&String::from_utf8_lossy(&bytes));
        if self.known.len() > LIMIT {
            let what = format!("its material library has more than {LIMIT} materials");
            return Err(SurfaceError::whole(what).help("leave out those that no face uses"));
        }
        Ok(())
    }

    fn parse(&mut self, text: &str) {
        let mut current: Option<&str> = None;
        for line in text.lines() {
            let mut words = line.split_whitespace();
            match words.next() {
                Some("newmtl") => current = words.next(),
                Some("Kd") => {
                    let channels: Vec<f64> = words.take(3).filter_map(|word| word.parse().ok()).collect();
                    if let (Some(name), &[r, g, b]) = (current, &channels[..]) {
                        let byte = |c: f64| (c.clamp(0.0, 1.0) * 255.0).round() as u32;
                        let rgb = byte(r) << 16 | byte(g) << 8 | byte(b);
                        self.known.push(NamedColor { name: name.into(), rgb });
                    }
                }
                _ => {}
            }
        }
    }

    /// The index of a material; of several with the same name, that of the last.
    pub(super) fn find(&self, name: &str) -> Option<u32> {
        self.known.iter().rposition(|material| &*material.name == name).map(|i| i as u32)
    }

    pub(super) fn into_colors(self) -> Vec<NamedColor> {
        self.known
    }
}
