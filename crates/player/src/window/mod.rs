//! The window of `dlsys view`: a growing plant, with controls for time, view and parameters.
//!
//! ```text
//! Window (widgets) ──Order──▶ worker (simulation, drawing) ──News──▶ Window
//! ```
//!
//! - [`look`]: the camera: direction, centre, size.
//! - [`player`]: the clock of the animation: running, paused, starting again.
//! - [`life`]: numbers of modules over the whole run, for the timeline.
//! - [`worker`]: a thread that reads the model, goes to a time and draws; it can be interrupted.
//! - [`orders`]: the requests to it: when they are sent, and the quality of the picture.
//! - [`app`], [`panel`], [`timeline`]: the widgets.
//! - [`trial`]: the window driven by a script, for tests.
//!
//! Pictures are those of the PNG export, drawn by our own rasteriser, so they are the same on every machine; the graphics processor
//! only shows them.

mod app;
mod life;
mod look;
mod orders;
mod panel;
mod player;
mod timeline;
mod trial;
mod worker;

use crate::Error;
use std::path::PathBuf;

use dlsys_compile::Setting;
use dlsys_sim::Settings;

pub use trial::Trial;

/// The model to show, and how.
#[derive(Clone, Debug)]
pub struct Options {
    /// The model file.
    pub model: PathBuf,
    /// Values of `param`s to begin with.
    pub set: Vec<Setting>,
    /// Folders of files that it names and that are not in its own folder.
    pub include: Vec<PathBuf>,
    /// Settings of the run.
    pub settings: Settings,
    /// First and last time, in the model's unit; `None`: those of its `frames`.
    pub range: Option<[f64; 2]>,
    /// Time to begin with, standing still; `None`: plays from the first.
    pub at: Option<f64>,
    /// Actions of a script, for tests and pictures in documents; none by default.
    pub trial: Trial,
}

/// Opens the window; returns when it is closed.
///
/// # Errors
/// If there is no screen, or what the trial asked for has failed.
pub fn open(options: Options) -> Result<(), Error> {
    use eframe::egui;
    let outcome = trial::Outcome::default();
    let title = format!("{} – dlsys", options.model.display());
    let native = eframe::NativeOptions {
        viewport: egui::ViewportBuilder::default()
            .with_title(title)
            .with_app_id("dlsys")
            .with_inner_size([1180.0, 800.0])
            .with_min_inner_size([480.0, 320.0]),
        // Colours are those of the picture.
        dithering: false,
        ..Default::default()
    };
    let seen = outcome.clone();
    let begin: eframe::AppCreator<'_> =
        Box::new(move |context| Ok(Box::new(app::Window::new(&context.egui_ctx, options, seen))));
    eframe::run_native("dlsys", native, begin).map_err(|error| Error::Screen(error.to_string()))?;
    outcome.result().map_err(Error::Trial)
}
