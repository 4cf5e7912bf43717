//! The thread that reads the model, goes to a time and draws, so that the window always answers.
//!
//! There is one order at a time, which says all that is wanted; a newer one takes its place. Whoever is in a hurry interrupts
//! the run that is under way. When there is nothing to do, the thread goes through the plant's whole life, for the
//! timeline, and looks whether the files have changed.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use eframe::egui::{Color32, ColorImage};

use super::Options;
use super::life::{Life, Living};
use super::look::{Space, Viewpoint};
use dlsys_compile::Setting;
use dlsys_geometry::scene::Scene;
use dlsys_model::{Frames, Parameter};
use dlsys_render::{self as export, Smoothness};
use dlsys_session::replay::{Replay, Stop};
use dlsys_session::{Nursery, Session};

/// Time between two looks at the files.
const WATCH: Duration = Duration::from_millis(150);
/// So long the life waits after the first picture of a model, which goes to the screen first: and a slider that moves on makes
/// another life.
const REST: Duration = Duration::from_millis(60);
/// Distance from curved surfaces, in pixels, of what moves and of what stands still.
const SLACK: [f64; 2] = [0.8, 0.3];

/// What the window wants.
#[derive(Clone, Debug, PartialEq)]
pub struct Order {
    /// Values of the params that are not the model's own.
    pub set: Vec<Setting>,
    /// `None`: nothing to be drawn yet.
    pub shot: Option<Shot>,
}

/// A picture that is wanted.
#[derive(Clone, Debug, PartialEq)]
pub struct Shot {
    pub time: f64,
    pub look: Viewpoint,
    pub space: Space,
    pub pixels: [u32; 2],
    /// As good as a file; else what is quick.
    pub fine: bool,
}

/// What the window is told.
pub enum News {
    /// The model has been read.
    Read(Box<Facts>),
    /// Something is wrong with the model or the run; a message as `check` prints it.
    Trouble(String),
    Picture(Box<Shown>),
    /// What is known of the whole life.
    Life(Box<Life>),
}

/// What the window must know of a model.
pub struct Facts {
    pub title: String,
    pub parameters: Vec<Parameter>,
    /// First and last time, and from frame to frame.
    pub range: [f64; 2],
    pub step: f64,
}

/// A picture.
pub struct Shown {
    pub order: Order,
    /// Where something is drawn, and where that is, in parts of the picture that was ordered: left, top, right, bottom.
    pub image: ColorImage,
    pub part: [f32; 4],
    /// Brackets not counted.
    pub modules: u64,
    /// Of this model and these params: from the order to the state, and from there to the picture.
    pub spent: [Duration; 2],
}

/// Where orders lie.
#[derive(Default)]
pub struct Desk {
    slot: Mutex<Slot>,
    bell: Condvar,
    hurry: Arc<AtomicBool>,
}

#[derive(Default)]
struct Slot {
    order: Option<Order>,
    closed: bool,
}

impl Desk {
    fn slot(&self) -> MutexGuard<'_, Slot> {
        self.slot.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes the place of what was wanted before; `hurry` interrupts what is under way.
    pub fn put(&self, order: Order, hurry: bool) {
        self.slot().order = Some(order);
        if hurry {
            self.hurry.store(true, Ordering::Relaxed);
        }
        self.bell.notify_one();
    }

    /// Sends the worker home.
    pub fn close(&self) {
        self.slot().closed = true;
        self.hurry.store(true, Ordering::Relaxed);
        self.bell.notify_one();
    }

    fn is_closed(&self) -> bool {
        self.slot().closed
    }

    /// The order that lies there, or comes within some time.
    fn take(&self, within: Duration) -> Option<Order> {
        let (mut slot, _) = self
            .bell
            .wait_timeout_while(self.slot(), within, |slot| slot.order.is_none() && !slot.closed)
            .unwrap_or_else(PoisonError::into_inner);
        slot.order.take()
    }
}

/// What follows when a model is no longer served.
enum Next {
    Read,
    Close,
}

/// Works until the desk is closed.
pub fn work(desk: &Desk, options: &Options, tell: impl Fn(News)) {
    let mut order = Order { set: options.set.clone(), shot: None };
    loop {
        let begun = Instant::now();
        let next = match read(options, &mut order.set) {
            Ok(session) => {
                let mut service = Service { desk, options, tell: &tell, session: &session, order, begun };
                let next = service.serve();
                order = service.order;
                next
            }
            Err(Unread { message, inputs }) => {
                tell(News::Trouble(message));
                let mut next = Next::Close;
                while !desk.is_closed() {
                    let new = desk.take(WATCH);
                    let other = new.as_ref().is_some_and(|new| new.set != order.set);
                    order = new.unwrap_or(order);
                    if other || inputs.iter().any(dlsys_session::Input::is_stale) {
                        next = Next::Read;
                        break;
                    }
                }
                next
            }
        };
        if matches!(next, Next::Close) {
            return;
        }
    }
}

/// Why there is no model.
struct Unread {
    message: String,
    inputs: Vec<dlsys_session::Input>,
}

/// Reads the model. Values of params that it does not have any more, because the file has changed, are forgotten.
fn read(options: &Options, set: &mut Vec<Setting>) -> Result<Session, Unread> {
    let refused = match Session::open_with(&options.model, set, &options.include) {
        Ok(session) => return Ok(session),
        Err(refused) => refused,
    };
    if refused.diagnostics.is_empty()
        && let Ok(session) = Session::open_with(&options.model, &[], &options.include)
    {
        let known = |s: &Setting| session.model.parameters.iter().any(|p| p.name == s.name);
        if !set.iter().all(known) {
            set.retain(known);
            return read(options, set);
        }
    }
    let all = refused.diagnostics.iter().chain(&refused.settings);
    let message = all.take(5).map(|d| d.render(&refused.source, false)).collect();
    Err(Unread { message, inputs: refused.inputs })
}

/// The first and last time, and from frame to frame.
fn range(options: &Options, session: &Session) -> Result<([f64; 2], f64), String> {
    let frames = session.model.frames;
    let step = frames.map_or(0.0, |frames| frames.step);
    match (options.range, frames) {
        (Some([from, to]), _) => Ok(([from, to], if step > 0.0 { step } else { (to - from) / 200.0 })),
        (None, Some(Frames { from, to, step })) => Ok(([from, to], step)),
        (None, None) => Err(
            "error: the model has no `frames`\n  help: add a line such as `frames 0 .. 10 step 0.05`, or start with `--from A --to B --step S`\n"
                .to_owned(),
        ),
    }
}

/// Work on one model, read once.
struct Service<'s, Tell> {
    desk: &'s Desk,
    options: &'s Options,
    tell: &'s Tell,
    session: &'s Session,
    order: Order,
    /// When reading the model began, or the order was taken.
    begun: Instant,
}

impl<Tell: Fn(News)> Service<'_, Tell> {
    fn serve(&mut self) -> Next {
        let session = self.session;
        let model = &session.model;
        let title = model.title.clone().unwrap_or_default();
        let replay = Replay::new(model, self.options.settings);
        let (range, step, mut replay) = match (range(self.options, session), replay) {
            (Ok((range, step)), Ok(replay)) => (range, step, replay),
            (Err(message), _) => return self.wait_with(message),
            (_, Err(error)) => return self.wait_with(error.diagnostic().render(&session.source, false)),
        };
        replay.stop_when(self.desk.hurry.clone());
        (self.tell)(News::Read(Box::new(Facts { title, parameters: model.parameters.clone(), range, step })));
        let mut living = Living::new(session, self.options.settings, range, step);
        let nursery = Nursery::new(model, self.options.settings);
        let mut scene = nursery.blank();
        let mut done = self.order.shot.is_none();
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        let mut watched = Instant::now();
        let mut rest = if done { Duration::ZERO } else { REST };
        loop {
            // Whoever hurries from now on has an order that is taken below, or interrupts.
            self.desk.hurry.store(false, Ordering::Relaxed);
            let wait = match done {
                true if living.is_done() => WATCH,
                true => std::mem::take(&mut rest),
                false => Duration::ZERO,
            };
            if let Some(new) = self.desk.take(wait) {
                let read = new.set != self.order.set;
                self.order = new;
                self.begun = Instant::now();
                done = self.order.shot.is_none();
                if read {
                    return Next::Read;
                }
            }
            if self.desk.is_closed() {
                return Next::Close;
            }
            if watched.elapsed() >= WATCH {
                watched = Instant::now();
                if self.has_changed() {
                    return Next::Read;
                }
            }
            if !done {
                done = self.shoot(&mut replay, &nursery, &mut scene, threads);
            } else if living.advance(&self.desk.hurry) {
                (self.tell)(News::Life(Box::new(living.life())));
            }
        }
    }

    /// Says what is wrong and waits for another order, or another file.
    fn wait_with(&mut self, message: String) -> Next {
        (self.tell)(News::Trouble(message));
        while !self.desk.is_closed() {
            if let Some(new) = self.desk.take(WATCH) {
                let read = new.set != self.order.set;
                self.order = new;
                if read {
                    return Next::Read;
                }
            }
            if self.has_changed() {
                return Next::Read;
            }
        }
        Next::Close
    }

    /// Whether a file is another by now, and whole: editors may remove it for an instant, or write it in pieces.
    fn has_changed(&self) -> bool {
        let Some(stale) = self.session.inputs.iter().find(|input| input.is_stale()) else { return false };
        let now = dlsys_session::Input::now(&stale.path);
        std::thread::sleep(WATCH / 3);
        now.is_there() && !now.is_stale()
    }

    /// Makes the picture that is wanted. False if it was interrupted.
    fn shoot(&self, replay: &mut Replay, nursery: &Nursery, scene: &mut Scene, threads: usize) -> bool {
        let Some(shot) = &self.order.shot else { return true };
        match replay.seek(shot.time) {
            Ok(Stop::Interrupted) => return false,
            Ok(Stop::There | Stop::Nothing) => {}
            Err(error) => {
                (self.tell)(News::Trouble(error.diagnostic().render(&self.session.source, false)));
                return true;
            }
        }
        let there = Instant::now();
        let (fit, page) = shot.look.camera(&shot.space, shot.pixels, SLACK[usize::from(shot.fine)]);
        scene.clear();
        scene.accuracy = fit.accuracy;
        let drawn = match replay.string() {
            Ok(string) => nursery.draw(string, scene).map_err(|error| error.to_string()),
            Err(error) => Err(error.to_string()),
        };
        if let Err(error) = drawn {
            (self.tell)(News::Trouble(format!("error: at t = {}: {error}\n", shot.time)));
            return true;
        }
        let smoothness = if shot.fine { Smoothness::Fine } else { Smoothness::Quick };
        let pixels = export::pixels_by(scene, &fit, &page, smoothness, threads);
        let (image, part) = cropped(&pixels, page.pixels.map(|side| side as usize));
        (self.tell)(News::Picture(Box::new(Shown {
            order: self.order.clone(),
            image,
            part,
            modules: replay.modules() as u64,
            spent: [there - self.begun, there.elapsed()],
        })));
        true
    }
}

/// The part of a picture in which something is drawn, and where it is: left, top, right and bottom in parts of the picture. A plant leaves
/// most of the window empty, and every pixel has to go to the screen.
fn cropped(pixels: &[[u8; 4]], [width, height]: [usize; 2]) -> (ColorImage, [f32; 4]) {
    let drawn = |pixel: &[u8; 4]| pixel[3] > 0;
    let [mut left, mut right, mut top, mut bottom] = [width, 0, height, 0];
    for (y, row) in pixels.chunks_exact(width.max(1)).enumerate() {
        if let (Some(first), Some(last)) = (row.iter().position(drawn), row.iter().rposition(drawn)) {
            (left, right) = (left.min(first), right.max(last + 1));
            (top, bottom) = (top.min(y), y + 1);
        }
    }
    // A texture has a pixel at least; and one that is empty all around, for where it is stretched the edge of a picture is faded.
    let [left, top] = [left, top].map(|first| first.saturating_sub(1));
    let (right, bottom) = ((right + 1).clamp(left + 1, width), (bottom + 1).clamp(top + 1, height));
    let rows = pixels.chunks_exact(width.max(1)).take(bottom).skip(top);
    let colors = rows.flat_map(|row| &row[left..right]);
    let colors = colors.map(|&[r, g, b, a]| Color32::from_rgba_premultiplied(r, g, b, a)).collect();
    let [x, y] = [width, height].map(|side| 1.0 / side as f32);
    let part = [left as f32 * x, top as f32 * y, right as f32 * x, bottom as f32 * y];
    (ColorImage::new([right - left, bottom - top], colors), part)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_empty_around_a_plant_is_left_out() {
        let mut pixels = vec![[0; 4]; 10 * 8];
        for at in [3 * 10 + 4, 5 * 10 + 6] {
            pixels[at] = [1, 2, 3, 255];
        }
        let (image, part) = cropped(&pixels, [10, 8]);
        assert_eq!((image.size, part), ([5, 5], [0.3, 0.25, 0.8, 0.875]));
        assert_eq!(image.pixels.iter().filter(|c| c.a() > 0).count(), 2);
        assert_eq!((image[(1, 1)].a(), image[(3, 3)].a()), (255, 255));
        // At the edges, and nothing at all.
        pixels[0] = [255; 4];
        pixels[79] = [255; 4];
        assert_eq!(cropped(&pixels, [10, 8]).0.size, [10, 8]);
        assert_eq!(cropped(&[[0; 4]; 6], [3, 2]).0.pixels.len(), 1);
    }
}
