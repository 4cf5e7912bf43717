//! What is ordered of the worker, how well it is to be drawn, and whether the window waits for it.

use std::time::{Duration, Instant};

use eframe::egui;

use super::app::Window;
use super::worker::{Order, Shot};

/// After so long, what stands still is drawn as well as can be.
pub(super) const STILL: Duration = Duration::from_millis(180);
/// So long a run may take before a slider that moves on ends it.
const LEAST: Duration = Duration::from_millis(250);
/// So long the window waits for a picture that hands have asked for, if such pictures come in that time: then the picture and the slider
/// are on the screen together, without an older picture before, which costs more than the wait where there is no graphics processor.
const AWAITED: Duration = Duration::from_millis(25);
/// Most pixels of a picture that moves, and of one that stands still; the screen makes up the rest.
const MOST_PIXELS: [f64; 2] = [1.2e6, 8e6];
/// Parts of the screen's pixels, each way, that what moves is drawn with: fewer where drawing takes longer than the first of these
/// times, more where it takes less than the second, for a step doubles the pixels at most.
const COARSE: [f64; 3] = [1.0, 0.7, 0.5];
const TOO_LONG: Duration = Duration::from_millis(28);
const SHORT: Duration = Duration::from_millis(12);

impl Window {
    /// Orders what is to be seen now. True if hands ask for it, who should not wait.
    pub(super) fn order(&mut self, pixels: [f64; 2]) -> bool {
        let shot = self.look.clone().filter(|_| self.facts.is_some()).map(|look| Shot {
            time: self.player.time,
            look,
            space: self.space.clone(),
            pixels: [0; 2],
            fine: false,
        });
        let mut order = Order { set: self.set.clone(), shot };
        let Some((last, since)) = &self.ordered else {
            // The worker has begun with this, and there is no picture to be asked for yet.
            if self.facts.is_some() || order.shot.is_some() {
                self.size(&mut order, pixels);
                self.give(order, false);
            }
            return false;
        };
        // How it is drawn is not what is moved.
        let plain =
            |order: &Order| order.shot.clone().map(|shot| Shot { fine: false, pixels: [0; 2], ..shot });
        let slides = order.set != last.set;
        if slides || order.shot != plain(last) {
            self.moved = Instant::now();
        }
        // What plays takes one picture after the other; hands want the last one only, but a slider that is being dragged
        // should show something on its way.
        let young = since.elapsed() < LEAST;
        let hurry = if slides { !(young && self.waits()) } else { !self.player.playing };
        self.size(&mut order, pixels);
        if self.ordered.as_ref().is_some_and(|(last, _)| *last == order) || !hurry && self.waits() {
            return false;
        }
        let fine = order.shot.as_ref().is_none_or(|shot| shot.fine);
        self.give(order, hurry);
        hurry && !fine
    }

    /// Says how a picture is to be drawn that covers so many pixels of the screen.
    fn size(&self, order: &mut Order, pixels: [f64; 2]) {
        let Some(shot) = &mut order.shot else { return };
        shot.fine = !self.player.playing && self.moved.elapsed() >= STILL;
        let most = MOST_PIXELS[usize::from(shot.fine)];
        let coarse = if shot.fine { 1.0 } else { COARSE[self.coarse] };
        let less = (most / (pixels[0] * pixels[1]).max(1.0)).sqrt().min(1.0) * coarse;
        shot.pixels = pixels.map(|side| (side * less).round().max(1.0) as u32);
    }

    fn give(&mut self, order: Order, hurry: bool) {
        self.desk.put(order.clone(), hurry);
        self.ordered = Some((order, Instant::now()));
    }

    /// Waits for the picture that was ordered just now, if it is likely to come soon.
    pub(super) fn wait(&mut self, context: &egui::Context) {
        if self.quick > AWAITED {
            return;
        }
        let begun = Instant::now();
        while self.waits() {
            let Ok(news) = self.news.recv_timeout(AWAITED.saturating_sub(begun.elapsed())) else {
                // The next one is not waited for; when it comes it says how long it took.
                self.quick = 2 * AWAITED;
                return;
            };
            self.learn(context, news);
        }
    }

    /// Whether a picture is still to come.
    pub(super) fn waits(&self) -> bool {
        let shown = self.shown.as_ref().map(|(order, ..)| order);
        let wanted = self.ordered.as_ref().map(|(order, _)| order).filter(|order| order.shot.is_some());
        self.trouble.is_none() && wanted.is_some() && wanted != shown
    }

    /// Everything that was asked for is on the screen, as good as it gets, and the life is known.
    pub(super) fn is_settled(&self) -> bool {
        let fine = self.shown.as_ref().and_then(|(order, ..)| order.shot.as_ref()).is_some_and(|s| s.fine);
        let known = !self.aged && self.life.as_ref().is_some_and(|l| l.whole);
        self.trouble.is_some() || !self.player.playing && fine && !self.waits() && known
    }
    /// Chooses how what moves is drawn next, by how long it took to run and to draw it.
    pub(super) fn pace(&mut self, [ran, drawn]: [Duration; 2]) {
        self.quick = ran + drawn;
        if drawn > TOO_LONG {
            self.coarse = (self.coarse + 1).min(COARSE.len() - 1);
        } else if drawn < SHORT {
            self.coarse = self.coarse.saturating_sub(1);
        }
    }
}
