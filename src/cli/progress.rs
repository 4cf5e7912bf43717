//! Progress of long work on standard error: position, rate and remaining time.
//!
//! Work of less than a second shows no progress. If standard error is not a terminal, progress is shown only with
//! `--progress`, as a line every few seconds, suitable for logs.

use std::io::IsTerminal;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::common::tell;
use crate::sim::brief;

/// Time before progress is shown.
const PATIENCE: Duration = Duration::from_secs(1);
/// Time between lines if standard error is not a terminal.
const BETWEEN: Duration = Duration::from_secs(5);

/// `--progress` was given.
static ASKED: AtomicBool = AtomicBool::new(false);

/// Shows progress even if standard error is not a terminal.
pub fn ask() {
    ASKED.store(true, Ordering::Relaxed);
}

/// The progress of work with a known number of parts.
pub struct Progress {
    bar: ProgressBar,
    begun: Instant,
    /// Time of the last output.
    shown: Option<Instant>,
    quiet: bool,
}

impl Progress {
    /// Begins; `what` names the work, such as “writing”.
    pub fn new(what: impl Into<String>, count: usize) -> Progress {
        let style = ProgressStyle::with_template("{msg} {bar:40} {pos}/{len} {per_sec}, {eta} left");
        let bar = ProgressBar::with_draw_target(Some(count as u64), ProgressDrawTarget::hidden())
            .with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
            .with_message(what.into());
        Progress { bar, begun: Instant::now(), shown: None, quiet: false }
    }

    /// For work that prints its results as it proceeds: on a terminal these show the progress.
    pub fn of_printed(what: impl Into<String>, count: usize) -> Progress {
        if std::io::stdout().is_terminal() { Progress::quiet() } else { Progress::new(what, count) }
    }

    /// For work that never shows progress.
    pub fn quiet() -> Progress {
        let mut progress = Progress::new("", 0);
        progress.quiet = true;
        progress
    }

    /// Changes the name of the work.
    pub fn say(&mut self, what: impl Into<String>) {
        self.bar.set_message(what.into());
        self.show();
    }

    /// One more part is done.
    pub fn inc(&mut self) {
        self.bar.inc(1);
        self.show();
    }

    /// Sets the part that is done, from 0 to 1.
    pub fn reach(&mut self, part: f64) {
        let all = self.bar.length().unwrap_or(0);
        self.bar.set_position((part.clamp(0.0, 1.0) * all as f64) as u64);
        self.show();
    }

    /// Hides the progress bar while something else is printed.
    pub fn suspend<R>(&self, print: impl FnOnce() -> R) -> R {
        self.bar.suspend(print)
    }

    fn show(&mut self) {
        if self.quiet || self.begun.elapsed() < PATIENCE {
            return;
        }
        let is_terminal = std::io::stderr().is_terminal();
        match self.shown {
            None if is_terminal => self.bar.set_draw_target(ProgressDrawTarget::stderr()),
            Some(_) if is_terminal => return,
            Some(last) if last.elapsed() < BETWEEN => return,
            _ if ASKED.load(Ordering::Relaxed) => tell(&self.line()),
            _ => return,
        }
        self.shown = Some(Instant::now());
    }

    /// A line such as `writing 120/800, 41.7/s, 16 s left`.
    fn line(&self) -> String {
        let (done, all) = (self.bar.position(), self.bar.length().unwrap_or(0));
        let rate = done as f64 / self.begun.elapsed().as_secs_f64().max(1e-9);
        let left = if done > 0 {
            format!(", {}/s, {:.0} s left", brief(rate, 3), all.saturating_sub(done) as f64 / rate)
        } else {
            String::new()
        };
        format!("{} {done}/{all}{left}\n", self.bar.message())
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_tells_rate_and_rest() {
        let mut progress = Progress::new("writing", 10);
        progress.begun = Instant::now() - Duration::from_secs(2);
        assert_eq!(progress.line(), "writing 0/10\n");
        (0..4).for_each(|_| progress.bar.inc(1));
        let line = progress.line();
        assert!(line.starts_with("writing 4/10, ") && line.ends_with("/s, 3 s left\n"), "{line}");
    }
}
