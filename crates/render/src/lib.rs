//! Scenes as files: SVG and PNG pictures, OBJ meshes, and the directory of an animation.
//!
//! An animation is written in two passes, because all its frames share one scale, one picture area and one
//! default line width:
//!
//! ```text
//! every scene ──▶ Survey ──fit──▶ Fit
//! every scene ──▶ FrameWriter(Fit) ──bytes──▶ Staging ──file──▶ FrameDirectory
//! ```
//!
//! or, where all frames go on one [`Sheet`],
//!
//! ```text
//! every scene ──▶ SheetWriter(Fit, Sheet) ──part──▶ Assembly ──bytes──▶ FrameDirectory
//! ```
//!
//! Nothing but [`FrameDirectory`] and its [`Staging`] touches the file system.
//!
//! # Examples
//!
//! Three frames of a growing stem, all on one scale:
//!
//! ```
//! use dlsys_geometry::turtle;
//! use dlsys_render::{Format, FrameWriter, Survey, View};
//! use dlsys_session::Session;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let session = Session::from_text("stem.dls", "initial string: F(1)\nF(x): solve dx/dt = x", &[])?;
//! let mut simulation = session.simulate(Default::default())?;
//! let (mut survey, mut scenes) = (Survey::new(View::FRONT), Vec::new());
//! for time in [0.0, 1.0, 2.0] {
//!     let mut string = Default::default();
//!     simulation.at(time, &mut string)?;
//!     let mut scene = turtle::blank(&session.model);
//!     turtle::draw(&session.model, &string, &mut scene)?;
//!     survey.add(&scene);
//!     scenes.push(scene);
//! }
//! let mut writer = FrameWriter::new(Format::SVG, survey.fit());
//! let pictures: Vec<Vec<u8>> = scenes.iter().map(|scene| writer.write(scene, "a stem")).collect();
//! writer.format = Format::OBJ;
//! let mesh = String::from_utf8(writer.write(&scenes[2], "a stem, t = 2"))?;
//! assert!(pictures[0].starts_with(b"<svg") && mesh.contains("\nusemtl stem\n"));
//! # Ok(())
//! # }
//! ```

#![warn(missing_docs)]

mod camera;
mod casters;
mod crowd;
mod draft;
mod error;
mod exposure;
mod extent;
mod field;
mod fit;
mod floor;
mod formats;
mod frames;
mod glyphs;
mod haze;
mod layout;
mod lengths;
mod lens;
mod light;
mod lighting;
mod manifest;
mod mapping;
mod motion;
mod moving;
mod name;
mod number;
mod page;
mod painter;
mod puffs;
mod raster;
mod relay;
mod shadow;
mod sheet;
mod shot;
mod sky;
mod stage;
mod stroke;
mod text;
mod trace;
mod triangles;
mod triangulate;
mod tube;
mod veil;
mod view;

pub use camera::Camera;
pub use error::Error;
pub use exposure::Exposure;
pub use fit::{CAMERA_SHAPE, Fit, Picture, Survey};
pub use formats::{Companion, Content, Description, Drawing, Exporter, Format};
pub use frames::{FrameDirectory, MANIFEST, Staged, Staging, aside, replace};
pub use layout::{Layout, Sheet, Spacing};
pub use lengths::{CrossSection, Length, Neck, cross_section, lengths, necks};
pub use light::Light;
pub use manifest::{FrameRecord, Manifest};
pub use motion::{Motion, Positions};
pub use moving::Moving;
pub use name::{pictures, plain as plain_name};
pub use number::push as push_number;
pub use page::{Page, Size};
pub use puffs::{Puff, puffs};
pub use sheet::{Assembly, Part, SheetWriter};
pub use triangulate::{normal, triangulate};
pub use tube::Spoke;
pub use view::View;

use std::borrow::Cow;
use std::io::{self, Write};
use std::sync::Arc;

use dlsys_geometry::scene::Scene;

/// Name and version of the program, for the header of files.
pub const GENERATOR: &str = concat!("dlsys ", env!("CARGO_PKG_VERSION"));

/// The second pass: one frame after another, each as the bytes of its file.
#[derive(Clone, Debug)]
pub struct FrameWriter {
    /// The format of the files.
    pub format: Format,
    /// The scale and the style that all frames share.
    pub fit: Fit,
    /// The page that pictures are drawn on (SVG and PNG).
    pub page: Page,
    /// Sides of the tubes that stems are made of (OBJ only); 0 for as many as the accuracy takes, and 8 at least.
    pub sides: usize,
    /// Threads that make the file of one frame (OBJ and PNG), at least 1. The bytes do not depend on it.
    pub threads: usize,
    /// For the rasters of one frame after another.
    memory: Arc<trace::Memory>,
}

impl FrameWriter {
    /// A writer of pictures 1000 pixels wide or high on the usual background, or of meshes with tubes as round as the
    /// accuracy requires.
    pub fn new(format: Format, fit: Fit) -> FrameWriter {
        let page = Page::usual(fit.picture);
        let fit = if format.content() == Content::Mesh { fit.of_meshes() } else { fit };
        FrameWriter { format, fit, page, sides: 0, threads: 1, memory: Arc::default() }
    }

    /// The bytes of the file of a frame. `title` is its title for readers: the model and the time.
    pub fn write(&self, scene: &Scene, title: &str) -> Vec<u8> {
        let mut bytes = Vec::new();
        // Memory takes whatever is written to it.
        let _ = self.write_to(scene, title, &mut bytes);
        bytes
    }

    /// Writes the file of a frame, a mesh in large parts as soon as they are made.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn write_to(&self, scene: &Scene, title: &str, out: &mut (dyn Write + Send)) -> io::Result<()> {
        let content = self.format.content();
        // A mesh has no shadows.
        let whole = match content {
            Content::Pixels | Content::Vectors => self.fit.drawn(Cow::Borrowed(scene)),
            Content::Mesh => Cow::Borrowed(scene),
        };
        let flattened;
        let scene = match content {
            // Pixels show no more detail than they have room for.
            Content::Pixels => Cow::Borrowed(&*whole),
            // Nor do regions of them.
            Content::Vectors if self.fit.has_visible_regions() => Cow::Borrowed(&*whole),
            Content::Vectors | Content::Mesh => {
                flattened = scene.flattened();
                self.fit.drawn(flattened.tessellated(self.fit.accuracy))
            }
        };
        self.format.exporter().write(Drawing { scene: &scene, whole: &whole, writer: self, title }, out)
    }

    /// The pixels of the PNG file of a frame, row by row from the top: red, green and blue, and the opacity if the page has no background.
    pub fn pixels(&self, scene: &Scene) -> Vec<u8> {
        let scene = &*self.fit.drawn(Cow::Borrowed(scene));
        let (fit, page) = self.fit.for_frame(scene, &self.page);
        formats::png::drawn(scene, &fit, &page, self.threads)
    }

    /// The PNG file of such pixels.
    pub fn encoded(&self, pixels: &[u8], title: &str) -> Vec<u8> {
        formats::png::file(&self.page, title, pixels)
    }

    /// Where the modules of a scene are in the picture of a frame.
    pub fn positions(&self, scene: &Scene) -> Positions {
        let (fit, page) = self.fit.for_frame(scene, &self.page);
        Positions::new(scene, &fit, &page)
    }

    /// The files that all frames refer to: the material library of OBJ files, and the pictures on surfaces.
    pub fn companions(&self, scene: &Scene) -> Vec<Companion> {
        self.format.exporter().companions(scene)
    }
}

/// How smooth edges are in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Smoothness {
    /// Sixteen samples a pixel, as in files.
    Fine,
    /// Four samples a pixel, for animations on the screen.
    Quick,
}

/// The pixels of a scene on a page, row by row from the top: red, green and blue, each times the opacity, and the opacity;
/// 0 where nothing is drawn, whatever the page's background.
pub fn pixels(scene: &Scene, fit: &Fit, page: &Page) -> Vec<[u8; 4]> {
    pixels_by(scene, fit, page, Smoothness::Fine, 1)
}

/// The same with a choice of smoothness, by `threads` threads; the pixels do not depend on their number.
pub fn pixels_by(
    scene: &Scene,
    fit: &Fit,
    page: &Page,
    smoothness: Smoothness,
    threads: usize,
) -> Vec<[u8; 4]> {
    let scene = &*fit.drawn(Cow::Borrowed(scene));
    formats::png::picture(scene, fit, page.pixels, page.placement(), smoothness, threads).pixels
}
