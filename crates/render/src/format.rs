//! Formats of files: the trait that each implements, and the list of all.
//!
//! To add one: a file that implements [`Exporter`], and its line in [`EXPORTERS`]. Flags, messages and endings of
//! file names follow from that.

use std::fmt;
use std::hash::{Hash, Hasher};
use std::io::{self, Write};

use dlsys_geometry::scene::Scene;

use crate::{Error, FrameWriter, obj, png, svg};

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

/// Writes scenes in one file format.
pub trait Exporter: Sync {
    /// Its name, which is also the ending of its files: `svg`.
    fn name(&self) -> &'static str;

    /// A description in one line, for help.
    fn about(&self) -> &'static str;

    /// The content of its files.
    fn content(&self) -> Content;

    /// Writes a file. Its surfaces are triangles already, where the accuracy asks for that; `title` is for people.
    ///
    /// # Errors
    /// Those of `out`.
    fn write(
        &self,
        scene: &Scene,
        writer: &FrameWriter,
        title: &str,
        out: &mut (dyn Write + Send),
    ) -> io::Result<()>;

    /// The file that all frames refer to, if there is one: its name and its bytes.
    fn companion(&self, _scene: &Scene) -> Option<(&'static str, Vec<u8>)> {
        None
    }
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
        self.0.name()
    }

    /// A description in one line, for help.
    pub fn about(self) -> &'static str {
        self.0.about()
    }

    /// The content of its files.
    pub fn content(self) -> Content {
        self.0.content()
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
