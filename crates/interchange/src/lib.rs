//! Growing plants as files that other programs play: animated glTF 2.0 in one binary file (GLB), and USD in text (USDA).
//!
//! ```text
//! Simulation ──Follower──▶ Sample ──▶ Tracks ──▶ Lives ──▶ glb, usd
//! ```
//!
//! - [`grow`] follows a run ([`Growth`]): each module that draws something has a frame, which moves, and a shape in that frame, which is mostly a
//!   function of its age. Modules with the same shapes at the same ages share one life.
//! - Plants of other models stand in files of a single time only: a mesh for each look, a node for each plant.
//! - [`Growth::file`] writes the file: a mesh for each life, with morph targets, or samples of its points, at ages chosen for the accuracy; a node for each
//!   module, with tracks for translation and rotation, and for the scale, which is 0 before birth and after death.
//!
//! The accuracy bounds the distance of every point of the file from that of the model, at frames and between them. Its parts: triangles in place of curved
//! surfaces 0.36 (an estimate); of frames, what happens between samples 0.18, tracks 0.13; of shapes, differences of modules that share a life, samples included, 0.25, what is between
//! two ages 0.08 (of sheets and ground, which are triangles, 0.4).
//! Stems end in half balls, also where they meet, in place of the joints of OBJ meshes; only where an axis goes on into shoots at its end these begin as wide as
//! that and narrow behind it.
//!
//! ```
//! use dlsys_interchange::{Format, Options, grow};
//! use dlsys_session::Session;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let session = Session::from_text("stem.dls", "initial string: F(1)\nF(x): solve dx/dt = x", &[])?;
//! let options = Options::new(&session.model, 0.05, 7.4);
//! let growth = grow(&session, Default::default(), &[0.0, 1.0, 2.0], &options, &mut |_| true)?;
//! let file = growth.file(Format::Glb)?;
//! assert!(file.starts_with(b"glTF") && growth.nodes() == 1);
//! # Ok(())
//! # }
//! ```

#![warn(missing_docs)]

mod blend;
mod error;
mod follow;
mod gases;
mod glb;
mod life;
mod mesh;
mod motion;
mod part;
mod sample;
mod soil;
mod stand;
mod stem;
mod thin;
mod track;
mod usd;
mod vary;

use std::collections::HashMap;

use dlsys_geometry::scene::{Color, Palette};
use dlsys_model::Model;
use dlsys_render::Companion;
use dlsys_session::{Nursery, Session, sways};
use dlsys_sim::Settings;
pub use error::Error;
use follow::{Closeness, Follower};
use gases::GasTrack;
use life::{Lives, Tolerance};
use mesh::Cutter;
use motion::Clock;
use sample::Sampler;
use stand::Stands;
use track::Tracks;
pub use usd::varying::{Summary, vary_usda};

/// Formats of files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// glTF 2.0 in one binary file.
    Glb,
    /// USD in text.
    Usda,
}

impl Format {
    /// The extension of its files, which is also its name.
    pub fn extension(self) -> &'static str {
        match self {
            Format::Glb => "glb",
            Format::Usda => "usda",
        }
    }

    /// The first bytes of its files.
    pub fn mark(self) -> &'static [u8] {
        match self {
            Format::Glb => b"glTF",
            Format::Usda => b"#usda",
        }
    }
}

/// Bounds of the work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Most nodes, one for each module that draws something.
    pub nodes: usize,
    /// Most numbers that are kept, of four bytes each.
    pub numbers: usize,
    /// Most bytes of a file whose triangles change from frame to frame.
    pub bytes: u64,
}

impl Default for Limits {
    /// As many nodes as programs for scenes still open, and a gigabyte.
    fn default() -> Limits {
        Limits { nodes: 100_000, numbers: 250_000_000, bytes: u64::MAX }
    }
}

/// How a run becomes a file.
#[derive(Clone, Debug)]
pub struct Options {
    /// Width of a line without a width of its own, in units of the model.
    pub default_width: f64,
    /// Whether stems go on into shoots at their ends smoothly: they do in drawings with depth, not in diagrams. See [`Fit::is_grown`](dlsys_render::Fit::is_grown).
    pub grown: bool,
    /// Largest extent of the whole animation, in units of the model.
    pub extent: f64,
    /// Largest distance of a point of the file from that of the model, in parts of the extent.
    pub accuracy: f64,
    /// Seconds of the animation in a unit of time of the model.
    pub seconds: f64,
    /// Metres in a unit of length of the model.
    pub metres: f64,
    /// Height of the floor, if there is one, its middle (x, z), and half of its side, in units of the model.
    pub floor: Option<[f64; 4]>,
    /// Gases are followed, too: at the frames, as points.
    pub gases: bool,
    /// Number of threads; the file does not depend on it.
    pub threads: usize,
    /// Bounds of the work.
    pub limits: Limits,
}

impl Options {
    /// The default accuracy, in parts of the extent.
    pub const ACCURACY: f64 = 5e-4;
    /// The longest animation in seconds: up to there the instants that a file can name are half a millisecond apart at most.
    pub const LONGEST: f64 = 8192.0;

    /// The largest extent in metres: what is as far away has places, and sums of them, that are 32 bit floats.
    pub const WIDEST: f64 = 1e37;

    /// Options with the units of a model, for an animation of this default width and this extent.
    pub fn new(model: &Model, default_width: f64, extent: f64) -> Options {
        let units = model.scenery.units;
        Options {
            default_width,
            grown: true,
            extent,
            accuracy: Options::ACCURACY,
            seconds: units.time,
            metres: units.length,
            floor: None,
            gases: false,
            threads: 1,
            limits: Limits::default(),
        }
    }

    /// Checks that places have 32 bit floats.
    fn check_extent(&self) -> Result<(), Error> {
        let (metres, limit) = (self.extent * self.metres, Options::WIDEST);
        if metres > limit {
            return Err(Error::TooWide { metres, limit });
        }
        match self.floor.map(|[height, ..]| height * self.metres) {
            Some(metres) if metres.abs() > limit => Err(Error::GroundTooFar { metres, limit }),
            _ => Ok(()),
        }
    }

    /// The accuracy in metres.
    fn tolerance(&self) -> f64 {
        let extent = if self.extent > 0.0 { self.extent } else { 1.0 };
        self.accuracy * extent * self.metres
    }
}

/// A run that has been followed.
#[derive(Debug)]
pub struct Growth {
    title: String,
    first: f64,
    last: f64,
    options: Options,
    palette: Palette,
    floor_color: Color,
    contours: Vec<Vec<[f64; 2]>>,
    /// Heads of the rules.
    rules: Vec<String>,
    tracks: Tracks,
    lives: Lives,
    gases: Vec<GasTrack>,
    stands: Stands,
}

/// Seconds within which something that appears without a production may be early or late.
const INSTANT: f64 = 2.5e-4;
/// Parts of the whole time from one sample to the next, at least.
const INTERVALS: f64 = 100.0;
/// Longest time between samples where stems sway, in seconds of the physics.
const SWAY: f64 = 0.04;

/// Follows a run through the frames at these ascending times, of which there is at least one; one makes a file without an animation. `progress` is told the time reached
/// and stops the work by being false.
///
/// # Errors
/// See [`Error`].
pub fn grow(
    session: &Session,
    settings: Settings,
    times: &[f64],
    options: &Options,
    progress: &mut dyn FnMut(f64) -> bool,
) -> Result<Growth, Error> {
    let model = &session.model;
    let (first, last) = (times.first().copied().unwrap_or(0.0), times.last().copied().unwrap_or(0.0));
    let seconds = (last - first) * options.seconds;
    if seconds > Options::LONGEST {
        return Err(Error::TooLong { seconds, limit: Options::LONGEST });
    }
    options.check_extent()?;
    let settings = Settings { log: true, ..settings };
    let nursery = Nursery::new(model, settings).without_gases().with_ground_in_pieces();
    let mut blank = nursery.blank();
    blank.notes_poses = true;
    let tolerance = options.tolerance();
    blank.accuracy = 0.2 * tolerance / options.metres;
    let (palette, contours) = (blank.palette.clone(), blank.contours.to_vec());
    let longest = if sways(model) { SWAY / model.scenery.units.time } else { f64::INFINITY };
    let longest = longest.min(((last - first) / INTERVALS).max(f64::MIN_POSITIVE));
    let instant = INSTANT / options.seconds;
    let Options { default_width, metres, grown, .. } = *options;
    let sampler = Sampler { default_width, metres, grown };
    let mut follower = Follower {
        nursery: &nursery,
        sampler,
        closeness: Closeness { straight: 0.15 * tolerance, thin: 0.03 * tolerance, instant, longest },
        limits: options.limits,
        threads: options.threads,
        blank,
        simulation: session.simulate(settings)?,
        tracks: Tracks::default(),
        births: HashMap::new(),
        falls: dlsys_geometry::turtle::lets_go(model),
        is_still: times.len() < 2,
        planted: Vec::new(),
    };
    follower.follow(times, progress)?;
    let mut tracks = follower.tracks;
    let stands = Stands::new(&follower.planted, options.metres, &mut tracks.catalogue);
    let Limits { nodes, numbers, .. } = options.limits;
    if tracks.phases.len() + stands.stands.len() > nodes {
        return Err(Error::TooMany { time: last, limit: nodes });
    }
    if stands.size() > numbers {
        return Err(Error::TooLarge { time: last, limit: numbers });
    }
    let particles =
        soil::follow(&nursery, (sampler, 0.1 * tolerance), times, options, &mut tracks, progress)?;
    let mut gases = match options.gases && dlsys_geometry::turtle::lets_out(model) {
        true => gases::follow(session, settings, times, options, progress)?,
        false => Vec::new(),
    };
    gases.extend(particles);
    let allowed =
        Tolerance { likeness: 0.25 * tolerance, mix: 0.08 * tolerance, mix_of_nets: 0.4 * tolerance };
    let lives = life::lives(&tracks.phases, allowed, 2.0 * instant, numbers)?;
    Ok(Growth {
        title: model.title.clone().unwrap_or_else(|| session.source.name.clone()),
        first,
        last,
        options: options.clone(),
        palette,
        floor_color: model.scenery.ground_color.map_or(dlsys_render::Page::BACKGROUND, Color::hex),
        contours,
        rules: model.rules.iter().map(|rule| rule.label.clone()).collect(),
        tracks,
        lives,
        gases,
        stands,
    })
}

impl Growth {
    /// Cuts forms into triangles, with an error of a part of the accuracy.
    fn cutter(&self, part: f64) -> Cutter<'_> {
        Cutter {
            catalogue: &self.tracks.catalogue,
            palette: &self.palette,
            contours: &self.contours,
            accuracy: part * self.options.tolerance(),
        }
    }

    /// The seconds of the file.
    fn clock(&self) -> Clock {
        Clock::new(self.first, self.last, self.options.seconds)
    }

    /// Number of nodes of modules, plants of other models included.
    pub fn nodes(&self) -> usize {
        self.tracks.phases.len() + self.stands.stands.len()
    }

    /// Number of different lives, and of looks of plants of other models.
    pub fn lives(&self) -> usize {
        self.lives.lives.len() + self.stands.looks.len()
    }

    /// The file in a format.
    ///
    /// # Errors
    /// If it is larger than a GLB file can be; USD, if there are plants of other models.
    pub fn file(&self, format: Format) -> Result<Vec<u8>, Error> {
        match format {
            Format::Glb => glb::file(self),
            Format::Usda if !self.stands.stands.is_empty() => Err(Error::Plants),
            Format::Usda => Ok(usd::file(self)),
        }
    }

    /// The files that the file in a format refers to, beside it: the pictures on surfaces. A GLB file has them in it.
    pub fn companions(&self, format: Format) -> Vec<Companion> {
        let all = match format {
            Format::Glb => Vec::new(),
            Format::Usda => dlsys_render::pictures(&self.palette),
        };
        all.into_iter().map(|(picture, name)| Companion { name, bytes: picture.file.clone() }).collect()
    }

    /// The floor that the model declares: the corners of a large square, in metres, and its triangles.
    pub(crate) fn floor(&self) -> Option<(Vec<[f32; 3]>, Vec<u32>)> {
        floor_of(&self.options)
    }
}

/// The same of options.
fn floor_of(options: &Options) -> Option<(Vec<[f32; 3]>, Vec<u32>)> {
    let [height, x, z, half] = options.floor?.map(|value| (value * options.metres) as f32);
    let corners = [(-1.0, 1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)];
    let corners = corners.map(|(a, b)| [x + a * half, height, z + b * half]);
    Some((corners.to_vec(), vec![0, 1, 2, 0, 2, 3]))
}

/// Of an sRGB colour, the linear channels that files take.
pub(crate) fn linear(color: Color) -> [f32; 4] {
    let [r, g, b] = color.channels().map(|c| {
        let linear = if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) };
        linear as f32
    });
    [r, g, b, 1.0]
}
