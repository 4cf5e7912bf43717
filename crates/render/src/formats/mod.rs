//! Formats of files: the trait that each implements, and the list of all.
//!
//! **To add a format**: write a file here that implements [`Exporter`], and add its `mod` line and its line in [`EXPORTERS`] below.
//! Flags, help, messages and extensions of files follow from that.

pub(crate) mod obj;
pub(crate) mod png;
mod rows;
pub(crate) mod svg;

use std::fmt;
use std::hash::{Hash, Hasher};
use std::io::{self, Write};

use dlsys_geometry::scene::Scene;

use crate::{Error, FrameWriter};

/// All formats, in the order in which help lists them.
static EXPORTERS: [&dyn Exporter; 3] = [&svg::Svg, &png::Png, &obj::Obj];

/// The content of the files of a format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Content {
    /// Shapes of one view.
    Vectors,
    /// Pixels of one view.
    Pixels,
    /// The scene in space, without a view.
    Mesh,
}

/// What is known of a format without a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Description {
    /// Its name, which is also the extension of its files: `svg`.
    pub name: &'static str,
    /// A description in one line, for help.
    pub about: &'static str,
    /// The content of its files.
    pub content: Content,
}

/// One frame to be written.
#[derive(Clone, Copy)]
pub struct Drawing<'a> {
    /// The scene. Where all of it is drawn, and not what is seen of it, there are no plants in it, its surfaces are meshes of the accuracy that the format needs,
    /// and there are no patches.
    pub scene: &'a Scene,
    /// The scene as it is, with its plants and curved surfaces: for the shadows that it casts.
    pub whole: &'a Scene,
    /// Scale, page, and settings of meshes.
    pub writer: &'a FrameWriter,
    /// Its title for readers: the model and the time. May contain any characters.
    pub title: &'a str,
}

/// Writes scenes in one file format.
pub trait Exporter: Sync {
    /// What is known of the format without a scene.
    fn description(&self) -> Description;

    /// Writes a file.
    ///
    /// # Errors
    ///
    /// Those of `out`, and what the format cannot hold.
    fn write(&self, drawing: Drawing<'_>, out: &mut (dyn Write + Send)) -> io::Result<()>;

    /// The files that all frames refer to.
    fn companions(&self, _scene: &Scene) -> Vec<Companion> {
        Vec::new()
    }
}

/// A file that others refer to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Companion {
    /// Its plain name; it stands beside them.
    pub name: String,
    /// Its content.
    pub bytes: Vec<u8>,
}

/// A file format for frames.
#[derive(Clone, Copy)]
pub struct Format(&'static dyn Exporter);

impl Format {
    /// Scalable Vector Graphics 1.1: the scene seen by a [`Camera`](crate::Camera).
    pub const SVG: Format = Format(&svg::Svg);
    /// Portable Network Graphics: the same in pixels, what is nearer being in front to the pixel.
    pub const PNG: Format = Format(&png::Png);
    /// Wavefront OBJ with a material library: the scene in space.
    pub const OBJ: Format = Format(&obj::Obj);

    /// All formats.
    pub fn all() -> impl Iterator<Item = Format> {
        EXPORTERS.into_iter().map(Format)
    }

    /// Its name, which is also the extension of its files.
    pub fn extension(self) -> &'static str {
        self.0.description().name
    }

    /// A description in one line, for help.
    pub fn about(self) -> &'static str {
        self.0.description().about
    }

    /// The content of its files.
    pub fn content(self) -> Content {
        self.0.description().content
    }

    /// Their names, for people: `svg, png and obj`.
    pub(crate) fn names() -> String {
        let names: Vec<&str> = Format::all().map(Format::extension).collect();
        match &names[..] {
            [first @ .., last] if !first.is_empty() => format!("{} and {last}", first.join(", ")),
            all => all.join(""),
        }
    }

    pub(crate) fn exporter(self) -> &'static dyn Exporter {
        self.0
    }
}

impl PartialEq for Format {
    fn eq(&self, other: &Format) -> bool {
        self.extension() == other.extension()
    }
}

impl Eq for Format {}

impl Hash for Format {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.extension().hash(state);
    }
}

impl fmt::Debug for Format {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "Format({})", self.extension())
    }
}

impl std::str::FromStr for Format {
    type Err = Error;

    fn from_str(name: &str) -> Result<Format, Error> {
        Format::all()
            .find(|format| format.extension() == name)
            .ok_or_else(|| Error::UnknownFormat(name.to_owned()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_are_known_by_name() {
        assert_eq!("svg".parse::<Format>().ok(), Some(Format::SVG));
        assert_eq!("obj".parse().map(Format::extension).ok(), Some("obj"));
        assert_eq!(
            "pdf".parse::<Format>().unwrap_err().to_string(),
            "unknown format `pdf`; known are svg, png and obj"
        );
    }
}
