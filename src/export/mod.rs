//! Scenes as files: SVG pictures, OBJ meshes, and the directory of an animation.
//!
//! An animation is written in two passes, because all its frames share one scale, one picture area and one
//! default line width:
//!
//! ```text
//! every scene ──▶ Survey ──fit──▶ Fit
//! every scene ──▶ FrameWriter(Fit) ──bytes──▶ FrameDirectory
//! ```
//!
//! Nothing but [`FrameDirectory`] touches the file system.

mod frames;
mod manifest;
mod name;
mod number;
mod obj;
mod svg;
mod triangulate;
mod tube;
mod view;

pub use frames::{Error, FrameDirectory, MANIFEST, replace};
pub use manifest::{FrameRecord, Manifest};
pub use view::{View, ViewError};

use crate::scene::{Bounds, Point, Scene};

/// Who wrote a file.
pub const GENERATOR: &str = concat!("dlsys ", env!("CARGO_PKG_VERSION"));

/// A file format for frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Format {
    /// Scalable Vector Graphics 1.1: the scene seen in a [`View`].
    Svg,
    /// Wavefront OBJ with a material library: the scene in space.
    Obj,
}

impl Format {
    /// All formats, with their names, which are also the extensions of their files.
    pub const NAMED: [(&'static str, Format); 2] = [("svg", Format::Svg), ("obj", Format::Obj)];

    /// The extension of its files.
    pub fn extension(self) -> &'static str {
        match self {
            Format::Svg => "svg",
            Format::Obj => "obj",
        }
    }
}

/// A name that is no [`Format`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown format `{0}`; known are svg and obj")]
pub struct FormatError(pub String);

impl std::str::FromStr for Format {
    type Err = FormatError;

    fn from_str(name: &str) -> Result<Format, FormatError> {
        let known = Format::NAMED.into_iter().find(|(known, _)| *known == name);
        known.map(|(_, format)| format).ok_or_else(|| FormatError(name.to_owned()))
    }
}

/// The first pass: how much space an animation takes up, in space and in its view.
#[derive(Clone, Debug)]
pub struct Survey {
    view: View,
    space: Bounds,
    seen: Bounds,
}

impl Survey {
    pub fn new(view: View) -> Survey {
        Survey { view, space: Bounds::default(), seen: Bounds::default() }
    }

    /// Takes in the scene of a frame. The order does not matter.
    pub fn add(&mut self, scene: &Scene) {
        self.space.add(scene);
        self.seen.add_seen(scene, |p| self.view.see(p));
    }

    /// Takes in another survey in the same view, as of another thread.
    pub fn merge(&mut self, other: &Survey) {
        self.space.merge(&other.space);
        self.seen.merge(&other.seen);
    }

    /// What all frames share.
    pub fn fit(&self) -> Fit {
        let default_width = self.space.default_width();
        Fit {
            view: self.view,
            default_width,
            extent: self.space.extent(),
            accuracy: self.space.extent() * Fit::ACCURACY,
            bounds: self.space.corners(default_width),
            picture: Picture::around(self.seen.corners(default_width)),
        }
    }
}

/// What all frames of an animation share.
#[derive(Clone, Debug, PartialEq)]
pub struct Fit {
    pub view: View,
    /// Width of a line of default width, in scene units.
    pub default_width: f64,
    /// Largest side of the box around all points of all frames, in scene units; 0 if nothing is drawn.
    pub extent: f64,
    /// How far what is written may be from a curved surface or a round stem, in scene units; a fixed part of
    /// the extent unless somebody chooses another.
    pub accuracy: f64,
    /// Opposite corners of the box around everything; `None` if nothing is drawn.
    pub bounds: Option<[Point; 2]>,
    /// The picture area of the view.
    pub picture: Picture,
}

impl Fit {
    /// The default accuracy, in parts of the extent: half a pixel of a picture of a thousand.
    pub const ACCURACY: f64 = 1.0 / 2000.0;

    /// Opposite corners of the box around one scene, lines having their width.
    pub fn bounds_of(&self, scene: &Scene) -> Option<[Point; 2]> {
        Bounds::of(scene).corners(self.default_width)
    }
}

/// The picture area: a rectangle of the view, and the scale at which it is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Picture {
    /// Left, bottom, width and height, in scene units, in the view's coordinates.
    pub area: [f64; 4],
    /// Picture units in one scene unit: a power of ten such that the larger side of the area is between 100
    /// and 1000 picture units. Numbers stay short, and people can still read lengths off them.
    pub scale: f64,
}

impl Picture {
    /// Margin on each side, in parts of the larger side of what is drawn.
    const MARGIN: f64 = 0.04;
    /// The least that the smaller side may be, in parts of the larger one. A filament a thousand times as
    /// long as it is wide should still be a picture.
    const SLIMMEST: f64 = 0.2;

    /// The area around what is drawn.
    fn around(corners: Option<[Point; 2]>) -> Picture {
        let [low, high] = corners.unwrap_or([Point::new(-0.5, -0.5, 0.0), Point::new(0.5, 0.5, 0.0)]);
        let (width, height) = (high.x - low.x, high.y - low.y);
        let larger = match width.max(height) {
            larger if larger > 0.0 => larger,
            _ => 1.0,
        };
        let side = |length: f64| length.max(larger * Picture::SLIMMEST) + 2.0 * Picture::MARGIN * larger;
        let (w, h) = (side(width), side(height));
        let area = [(low.x + high.x - w) / 2.0, (low.y + high.y - h) / 2.0, w, h];
        let scale = 10_f64.powi(2 - w.max(h).log10().floor() as i32);
        Picture { area, scale }
    }

    /// `viewBox` of an SVG: left, top, width and height in picture units, y going down.
    pub fn view_box(&self) -> [f64; 4] {
        let [left, bottom, width, height] = self.area;
        [left, -(bottom + height), width, height].map(|x| number::rounded(x * self.scale, svg::DECIMALS))
    }
}

/// The second pass: one frame after another, each as the bytes of its file.
#[derive(Clone, Debug)]
pub struct FrameWriter {
    pub format: Format,
    pub fit: Fit,
    /// Sides of the tubes that stems are made of (OBJ only); 0 for as many as the accuracy takes, and 8 at least.
    pub sides: usize,
}

impl FrameWriter {
    /// A writer with tubes as round as the accuracy asks.
    pub fn new(format: Format, fit: Fit) -> FrameWriter {
        FrameWriter { format, fit, sides: 0 }
    }

    /// The file of a frame. `title` is for people: what it shows, and at which time.
    pub fn write(&self, scene: &Scene, title: &str) -> Vec<u8> {
        let scene = &*scene.tessellated(self.fit.accuracy);
        match self.format {
            Format::Svg => svg::document(scene, &self.fit, title).into_bytes(),
            Format::Obj => obj::document(scene, &self.fit, self.sides, title),
        }
    }

    /// The file that all frames refer to, if there is one: its name and its bytes.
    pub fn companion(&self, scene: &Scene) -> Option<(&'static str, Vec<u8>)> {
        match self.format {
            Format::Svg => None,
            Format::Obj => Some((obj::MATERIALS, obj::materials(&scene.palette))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_are_known_by_name() {
        assert_eq!("svg".parse(), Ok(Format::Svg));
        assert_eq!("obj".parse::<Format>().map(Format::extension), Ok("obj"));
        assert_eq!(
            "png".parse::<Format>().unwrap_err().to_string(),
            "unknown format `png`; known are svg and obj"
        );
    }

    #[test]
    fn pictures_have_a_margin_and_a_shape() {
        let picture = Picture::around(Some([Point::new(0.0, 0.0, 0.0), Point::new(50.0, 0.0, 0.0)]));
        assert_eq!(picture.area, [-2.0, -7.0, 54.0, 14.0]);
        assert_eq!(picture.scale, 10.0);
        assert_eq!(picture.view_box(), [-20.0, -70.0, 540.0, 140.0]);
        let nothing = Picture::around(None);
        assert!(nothing.area[2] > 0.0);
        assert_eq!(Survey::new(View::FRONT).fit().bounds, None);
    }
}
