//! Recording of a run: tracks of all things that are drawn, from frame to frame.

use std::collections::HashMap;

use super::Error;
use super::clouds::Clouds;
use super::forms::Forms;
use super::history::History;
use super::stage::{Form, Item, Key, Stage};
use super::track::Track;
use dlsys_geometry::scene::{Palette, Point, Scene, Surroundings};
use dlsys_model::{Model, Parameter};
use dlsys_render::{Fit, Spoke, cross_section};

/// A recorded run.
#[derive(Clone, Debug)]
pub struct Recording {
    /// Title of the model, or the name of its file.
    pub title: String,
    /// The model file.
    pub source: String,
    /// Parameters of the model with the values of the run.
    pub parameters: Vec<Parameter>,
    /// Of the frames, in the model's unit of time.
    pub times: Vec<f64>,
    /// Modules in each frame, brackets not counted.
    pub modules: Vec<u64>,
    /// Productions, for the list beside the plant.
    pub history: History,
    /// The materials that finishes name.
    pub palette: Palette,
    /// The forms that things are placed copies of.
    pub forms: Forms,
    /// In the order in which things first appear.
    pub tracks: Vec<Track>,
    /// The blobs of gases.
    pub clouds: Clouds,
    /// Opposite corners of the box around everything, and their middle.
    pub bounds: [Point; 2],
    /// The middle of the bounds, in scene units.
    pub centre: Point,
    /// Largest side of the box around all points, and how far what is shown may be from what is recorded; in scene units.
    pub extent: f64,
    /// Largest distance between what is shown and what was recorded, in scene units.
    pub accuracy: f64,
    /// Scene units in one step of the tracks' samples.
    pub unit: f64,
    /// The model's contours.
    pub contours: Vec<Vec<[f64; 2]>>,
    /// Light, sky and camera of the first frame.
    pub surroundings: Surroundings,
}

/// A recording that is being made.
#[derive(Debug)]
pub struct Recorder {
    recording: Recording,
    /// Tracks of what was there in the frame before.
    open: HashMap<Key, usize>,
    numbers: usize,
}

/// Steps in the extent: an eighth of a pixel of a picture of 30,000.
const STEPS: f64 = 262_144.0;
/// How far a line between two samples may be from the motion, in steps: a tenth of a pixel of a picture of a thousand.
const SLACK: i32 = 26;

impl Recorder {
    /// Most numbers that a recording may hold before it is thinned: 300 MB.
    pub const MOST_NUMBERS: usize = 75_000_000;

    /// A recording without frames. `blank` is a scene with the materials of all frames, `fit` is of all frames that will follow.
    pub fn new(model: &Model, blank: &Scene, source: &str, fit: &Fit) -> Recorder {
        let bounds = fit.bounds.unwrap_or([Point::new(-0.5, -0.5, -0.5), Point::new(0.5, 0.5, 0.5)]);
        let extent = if fit.extent > 0.0 { fit.extent } else { 1.0 };
        let recording = Recording {
            title: model.title.clone().unwrap_or_else(|| source.to_owned()),
            source: source.to_owned(),
            parameters: model.parameters.clone(),
            times: Vec::new(),
            modules: Vec::new(),
            history: History::default(),
            palette: blank.palette.clone(),
            forms: Forms::default(),
            tracks: Vec::new(),
            clouds: Clouds::default(),
            bounds,
            centre: nalgebra::center(&bounds[0], &bounds[1]),
            extent,
            accuracy: fit.accuracy.max(extent * 1e-9),
            unit: extent / STEPS,
            contours: blank.contours.to_vec(),
            surroundings: Surroundings::default(),
        };
        Recorder { recording, open: HashMap::new(), numbers: 0 }
    }

    /// The list of productions, to be added to between frames.
    pub fn history(&mut self) -> &mut History {
        &mut self.recording.history
    }

    /// Sets light, sky and camera, which a page shows as they are in one frame.
    pub fn surround(&mut self, surroundings: &Surroundings) {
        self.recording.surroundings = surroundings.clone();
    }

    /// Sets how many blobs of gases are to be expected, before the first frame.
    pub fn expect(&mut self, clouds: Clouds) {
        self.recording.clouds = clouds;
    }

    /// Takes in a frame. Times increase.
    ///
    /// # Errors
    /// If it is more than fits into memory or a page.
    pub fn add(&mut self, time: f64, modules: u64, stage: &Stage) -> Result<(), Error> {
        let recording = &mut self.recording;
        let frame = recording.times.len() as u32;
        recording.times.push(time);
        recording.modules.push(modules);
        let mut open = HashMap::with_capacity(stage.items.len());
        let [meshes, cuts] = recording.forms.adopt(stage);
        for item in &stage.items {
            let Item { mut key, mut finish, .. } = *item;
            match &mut key.form {
                Form::Mesh(number) | Form::Stretched(number) | Form::Net(number, _) => {
                    *number = meshes[*number as usize]
                }
                Form::Polygon(_) => finish.variant = cuts[finish.variant as usize],
                Form::Stem(_) | Form::Patch => {}
            }
            let number = *open.entry(key).or_insert_with(|| {
                self.open.remove(&key).unwrap_or_else(|| {
                    recording.tracks.push(Track {
                        form: key.form,
                        first: frame,
                        last: frame,
                        finishes: Vec::new(),
                        samples: Vec::new(),
                        stride: 1,
                    });
                    recording.tracks.len() - 1
                })
            });
            let track = &mut recording.tracks[number];
            track.last = frame;
            if track.finishes.last().is_none_or(|(_, known)| *known != finish) {
                track.finishes.push((frame, finish));
            }
            let steps = stage.numbers_of(item).iter().enumerate().map(|(i, x)| {
                let from = if is_point(key.form, i) { recording.centre[i % 3] } else { 0.0 };
                ((x - from) / recording.unit).round() as i32
            });
            track.samples.extend(steps);
        }
        recording.clouds.add(&stage.puffs, recording.centre, recording.unit);
        self.numbers += stage.numbers.len();
        // What is left is gone.
        for (_, number) in std::mem::replace(&mut self.open, open) {
            self.close(number);
        }
        if self.numbers > Recorder::MOST_NUMBERS { Err(Error::TooLong { time }) } else { Ok(()) }
    }

    fn close(&mut self, number: usize) {
        let track = &mut self.recording.tracks[number];
        let before = track.samples.len();
        track.thin(SLACK);
        self.numbers -= before - track.samples.len();
    }

    /// The recording.
    pub fn finish(mut self) -> Recording {
        for (_, number) in std::mem::take(&mut self.open) {
            self.close(number);
        }
        self.recording
    }
}

/// Whether a number of a form is one of a point; else it is one of a difference of points.
pub(super) fn is_point(form: Form, number: usize) -> bool {
    match form {
        Form::Stem(_) | Form::Mesh(_) => number % 9 < 3,
        Form::Stretched(_) => number < 3,
        Form::Patch | Form::Polygon(_) | Form::Net(..) => true,
    }
}

impl Recording {
    /// The outline of the cross-sections of a stem that is nowhere thicker than this radius (scene units).
    pub(super) fn outline(&self, contour: Option<u32>, radius: f64) -> Vec<Spoke> {
        let contour = contour.and_then(|i| self.contours.get(i as usize));
        cross_section(contour.map(Vec::as_slice), radius, self.accuracy)
    }
}
