//! The window of `dlsys view`: a plant that grows while one looks at it and changes it.
//!
//! ```text
//! Window (widgets) ──Order──▶ worker (simulation, drawing) ──News──▶ Window
//! ```
//!
//! - [`look`]: from where the plant is looked at.
//! - [`player`]: time that goes on, stands still, begins again.
//! - [`life`]: the whole of it, for the timeline.
//! - [`worker`]: a thread that reads the model, goes to a time, draws; it can be interrupted.
//! - [`orders`]: what is asked of it, when, and how well drawn.
//! - [`app`], [`panel`], [`timeline`]: what is on the screen.
//!
//! Pictures are those of the PNG export, drawn by our own rasteriser: the same on every machine, whatever it has for a
//! graphics processor, which only brings them to the screen.

mod app;
mod life;
mod look;
mod orders;
mod panel;
mod player;
mod timeline;
mod trial;
mod worker;

use std::path::PathBuf;

use dlsys_compile::Setting;
use dlsys_sim::Settings;

pub use trial::Trial;

/// What is shown, and how.
#[derive(Clone, Debug)]
pub struct Options {
    /// The model file.
    pub model: PathBuf,
    /// Values of `param`s to begin with.
    pub set: Vec<Setting>,
    /// Where files are that it names and that are not in its folder.
    pub include: Vec<PathBuf>,
    pub settings: Settings,
    /// First and last time, in the model's unit; `None`: those of its `frames`.
    pub range: Option<[f64; 2]>,
    /// Time to begin with, standing still; `None`: plays from the first.
    pub at: Option<f64>,
    /// What is done without hands, for tests and documents.
    pub trial: Trial,
}

/// Why there is no window.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    #[error("no window can be opened: {0}")]
    Screen(String),
    #[error("{0}")]
    Trial(String),
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
