//! The window without hands: for tests, and for pictures of it.

use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use eframe::egui::{self, ColorImage, Event, ViewportCommand};

use super::app::Window;
use dlsys_compile::Setting;

/// After so long the trial has failed.
const PATIENCE: Duration = Duration::from_secs(120);

/// What is done, in this order; then the window closes. Nothing: hands do it all.
#[derive(Clone, Debug, Default)]
pub struct Trial {
    /// Seconds to wait before anything else: what other programs do meanwhile to the model or the window is seen.
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
    /// The so-manieth slider is to be moved when all is still.
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

    /// Once for each time that the window is drawn, before anything is taken in: what the window shows then is on the screen, for what it
    /// drew last has been handed over.
    pub fn step(&mut self, window: &mut Window, context: &egui::Context) {
        let Trial { delay, slide, play, screenshot } = &self.trial;
        if slide.is_empty() && play.is_none() && screenshot.is_none() {
            return;
        }
        context.request_repaint();
        if self.begun.get_or_insert_with(Instant::now).elapsed() > PATIENCE {
            self.outcome.fail(format!("the trial was not over after {} s", PATIENCE.as_secs()));
            context.send_viewport_cmd(ViewportCommand::Close);
            return;
        }
        let next = |number: usize| {
            if number < slide.len() {
                Stage::Still(number)
            } else if play.is_some() {
                Stage::Playing(Instant::now(), 0, f64::NAN)
            } else {
                Stage::Screenshot
            }
        };
        match &mut self.stage {
            Stage::Begin => {
                let passed = self.begun.map_or(0.0, |begun| begun.elapsed().as_secs_f64());
                let ready = window.settled || window.shown.is_some() && window.player.playing;
                if ready && passed >= delay.unwrap_or(0.0) {
                    self.stage = next(0);
                }
            }
            Stage::Still(number) => {
                if window.settled {
                    window.set(&slide[*number].name, slide[*number].value);
                    self.stage = Stage::Slid(*number, Instant::now());
                }
            }
            Stage::Slid(number, since) => {
                let new = window.shown.as_ref().filter(|(order, ..)| order.set == window.set);
                if let Some((_, _, spent)) = new {
                    let Setting { name, value } = &slide[*number];
                    let [ran, drawn] = spent.map(milliseconds);
                    say(&format!(
                        "{name} = {value}: on the screen after {:.1} ms (read and run {ran:.1}, drawn {drawn:.1})",
                        milliseconds(since.elapsed())
                    ));
                    self.stage = next(*number + 1);
                }
            }
            Stage::Playing(since, pictures, last) => {
                if *pictures == 0 {
                    window.player.play(true);
                    *since = Instant::now();
                }
                let time = window
                    .shown
                    .as_ref()
                    .and_then(|(order, ..)| order.shot.as_ref())
                    .map_or(f64::NAN, |s| s.time);
                if time != *last {
                    (*pictures, *last) = (*pictures + 1, time);
                }
                let passed = since.elapsed().as_secs_f64();
                if passed >= play.unwrap_or(0.0) {
                    say(&format!("{:.1} pictures a second", f64::from(*pictures) / passed));
                    window.player.play(false);
                    self.stage = Stage::Screenshot;
                }
            }
            Stage::Screenshot => match screenshot {
                Some(_) if window.settled => {
                    context.send_viewport_cmd(ViewportCommand::Screenshot(egui::UserData::default()));
                    self.stage = Stage::Asked;
                }
                Some(_) => {}
                None => {
                    context.send_viewport_cmd(ViewportCommand::Close);
                    self.stage = Stage::Over;
                }
            },
            Stage::Asked => {
                let taken = context.input(|input| {
                    input.events.iter().find_map(|event| match event {
                        Event::Screenshot { image, .. } => Some(image.clone()),
                        _ => None,
                    })
                });
                if let (Some(image), Some(path)) = (taken, screenshot) {
                    if let Err(error) = write(path, &image) {
                        self.outcome.fail(format!("cannot write {}: {error}", path.display()));
                    }
                    context.send_viewport_cmd(ViewportCommand::Close);
                    self.stage = Stage::Over;
                }
            }
            Stage::Over => {}
        }
    }
}

/// Nobody need listen.
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
