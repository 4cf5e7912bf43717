//! The window driven by a script: for tests, and for pictures of it.

use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use eframe::egui::{self, ColorImage, Event, ViewportCommand};

use super::app::Window;
use dlsys_compile::Setting;

/// After so long the trial has failed.
const PATIENCE: Duration = Duration::from_secs(120);

/// The actions, in this order; then the window closes. Without actions the window belongs to the user.
#[derive(Clone, Debug, Default)]
pub struct Trial {
    /// Seconds to wait before anything else, for other programs to change the model or the window.
    pub delay: Option<f64>,
    /// Sliders are moved, one after the other; how long it takes until the new picture is on the screen is printed.
    pub slide: Vec<Setting>,
    /// Plays for so many seconds and prints the pictures a second.
    pub play: Option<f64>,
    /// Waits until all is on the screen and writes a picture (PNG) of the window.
    pub screenshot: Option<PathBuf>,
}

/// How a trial has ended.
#[derive(Clone, Default)]
pub struct Outcome(Arc<Mutex<Option<String>>>);

impl Outcome {
    /// The error, if there was one.
    pub fn result(&self) -> Result<(), String> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).take().map_or(Ok(()), Err)
    }

    fn fail(&self, message: String) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(message);
    }
}

#[derive(Default)]
enum Stage {
    /// Until there is a picture.
    #[default]
    Begin,
    /// The slider with this number is to be moved when the picture is complete.
    Still(usize),
    /// It was moved then; the new picture is not on the screen yet.
    Slid(usize, Instant),
    /// Since when, pictures so far, and the time of the last one.
    Playing(Instant, u32, f64),
    Screenshot,
    Asked,
    Over,
}

/// A trial that is going on.
#[derive(Default)]
pub struct Runner {
    trial: Trial,
    outcome: Outcome,
    stage: Stage,
    begun: Option<Instant>,
}

impl Runner {
    pub fn new(trial: Trial, outcome: Outcome) -> Runner {
        Runner { trial, outcome, stage: Stage::Begin, begun: None }
    }

    /// Called once for each frame of the window, before input is read: the picture drawn last is on the screen then.
    pub fn step(&mut self, window: &mut Window, context: &egui::Context) {
        let Trial { slide, play, screenshot, .. } = &self.trial;
        if slide.is_empty() && play.is_none() && screenshot.is_none() {
            return;
        }
        context.request_repaint();
        if self.begun.get_or_insert_with(Instant::now).elapsed() > PATIENCE {
            self.outcome.fail(format!("the trial was not over after {} s", PATIENCE.as_secs()));
            context.send_viewport_cmd(ViewportCommand::Close);
            return;
        }
        if let Some(next) = self.follow(window, context) {
            self.stage = next;
        }
    }

    /// The stage from the slider with this number on.
    fn slider_or_later(&self, number: usize) -> Stage {
        if number < self.trial.slide.len() {
            Stage::Still(number)
        } else if self.trial.play.is_some() {
            Stage::Playing(Instant::now(), 0, f64::NAN)
        } else {
            Stage::Screenshot
        }
    }

    /// Goes on within a stage; the next stage, if this one is over.
    fn follow(&mut self, window: &mut Window, context: &egui::Context) -> Option<Stage> {
        match &self.stage {
            Stage::Begin => {
                let passed = self.begun.map_or(0.0, |begun| begun.elapsed().as_secs_f64());
                let ready = window.settled || window.shown.is_some() && window.player.playing;
                (ready && passed >= self.trial.delay.unwrap_or(0.0)).then(|| self.slider_or_later(0))
            }
            Stage::Still(number) => {
                let Setting { name, value } = self.trial.slide.get(*number).filter(|_| window.settled)?;
                window.set(name, *value);
                Some(Stage::Slid(*number, Instant::now()))
            }
            Stage::Slid(number, since) => {
                let (_, _, spent) = window.shown.as_ref().filter(|(order, ..)| order.set == window.set)?;
                let Setting { name, value } = self.trial.slide.get(*number)?;
                let [ran, drawn] = spent.map(milliseconds);
                say(&format!(
                    "{name} = {value}: on the screen after {:.1} ms (read and run {ran:.1}, drawn {drawn:.1})",
                    milliseconds(since.elapsed())
                ));
                Some(self.slider_or_later(*number + 1))
            }
            Stage::Playing(since, pictures, last) => {
                let playing = play(window, self.trial.play.unwrap_or(0.0), (*since, *pictures, *last));
                Some(playing.map_or(Stage::Screenshot, |(since, pictures, last)| {
                    Stage::Playing(since, pictures, last)
                }))
            }
            Stage::Screenshot if self.trial.screenshot.is_none() => {
                context.send_viewport_cmd(ViewportCommand::Close);
                Some(Stage::Over)
            }
            Stage::Screenshot => window.settled.then(|| {
                context.send_viewport_cmd(ViewportCommand::Screenshot(egui::UserData::default()));
                Stage::Asked
            }),
            Stage::Asked => {
                let image = context.input(|input| {
                    input.events.iter().find_map(|event| match event {
                        Event::Screenshot { image, .. } => Some(image.clone()),
                        _ => None,
                    })
                })?;
                let path = self.trial.screenshot.as_ref()?;
                if let Err(error) = write(path, &image) {
                    self.outcome.fail(format!("cannot write {}: {error}", path.display()));
                }
                context.send_viewport_cmd(ViewportCommand::Close);
                Some(Stage::Over)
            }
            Stage::Over => None,
        }
    }
}

/// Plays for some seconds, since when so many pictures were seen, the last one of this time; None when they are over.
fn play(
    window: &mut Window,
    seconds: f64,
    (mut since, mut pictures, mut last): (Instant, u32, f64),
) -> Option<(Instant, u32, f64)> {
    if pictures == 0 {
        window.player.play(true);
        since = Instant::now();
    }
    let order = window.shown.as_ref().and_then(|(order, ..)| order.shot.as_ref());
    let time = order.map_or(f64::NAN, |shot| shot.time);
    if time != last {
        (pictures, last) = (pictures + 1, time);
    }
    let passed = since.elapsed().as_secs_f64();
    if passed < seconds {
        return Some((since, pictures, last));
    }
    say(&format!("{:.1} pictures a second", f64::from(pictures) / passed));
    window.player.play(false);
    None
}

/// Writes a line to standard output; errors of writing are ignored.
fn say(line: &str) {
    let _ = writeln!(std::io::stdout(), "{line}");
}

fn milliseconds(duration: Duration) -> f64 {
    duration.as_secs_f64() * 1e3
}

fn write(path: &Path, image: &ColorImage) -> Result<(), String> {
    let text = |error: &dyn std::fmt::Display| error.to_string();
    let file = std::fs::File::create(path).map_err(|error| text(&error))?;
    let mut encoder = png::Encoder::new(BufWriter::new(file), image.width() as u32, image.height() as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let bytes: Vec<u8> = image.pixels.iter().flat_map(|c| [c.r(), c.g(), c.b()]).collect();
    let mut writer = encoder.write_header().map_err(|error| text(&error))?;
    writer.write_image_data(&bytes).map_err(|error| text(&error))?;
    writer.finish().map_err(|error| text(&error))
}
