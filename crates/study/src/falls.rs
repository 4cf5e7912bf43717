//! Exact cases, random landings and speed of bodies that fall, as tables.

use std::time::Instant;

use dlsys_fall::study::{RandomContact, RandomLanding, random_contact, random_landing};
use dlsys_fall::{self as fall, Body, Fall, Ground, Motion, Settings, Vector};
use dlsys_sim::brief;
use dlsys_wind::study::Convergence;

use super::table::{Table, exact_table};

/// Exact cases of falling as a table. The order is that from the line above.
pub fn exact_fall_table(rows: &[Convergence]) -> String {
    let title = "falling: exact cases, by tolerance or length of a step";
    exact_table(title, rows, |resolution| format!("{resolution:.1e}"))
}

/// Bodies that are thrown at the ground at random.
#[derive(Clone, Debug)]
pub struct Landings {
    ends: Vec<RandomLanding>,
    /// Seconds of computing for a second of the flight of a petal, at the default tolerance.
    pace: f64,
}

/// Deepest place of a contact under the ground that counts as none, in half-extents: the depth at which impacts are located.
const DEEPEST: f64 = 1e-5;

impl Landings {
    /// This many throws, and a measurement of speed.
    ///
    /// # Errors
    /// An error of a fall, which is a defect.
    pub fn new(count: u64) -> Result<Landings, fall::Error> {
        let ends = (0..count).map(|seed| random_landing(seed, 1e-3)).collect::<Result<_, _>>()?;
        Ok(Landings { ends, pace: pace()? })
    }

    /// Number of bodies that do not rest within a minute, or that are too deep in the ground at some instant.
    pub fn failed(&self) -> usize {
        // With some room for rounding.
        self.ends.iter().filter(|end| end.rest.is_none() || end.depth > 1.01 * DEEPEST).count()
    }

    /// One line for each quantity.
    pub fn table(&self) -> String {
        let most = |of: fn(&RandomLanding) -> f64| self.ends.iter().map(of).fold(0.0, f64::max);
        let count = self.ends.len();
        let rested = self.ends.iter().filter(|end| end.rest.is_some()).count();
        let steps = self.ends.iter().map(|end| end.steps).sum::<u64>() as f64 / count.max(1) as f64;
        let mut out =
            "falling: bodies thrown at random, up to 300 m/s, looked at 1000 times a second\n".to_owned();
        let mut table = Table::default();
        let rows = [
            ("at rest within a minute", format!("{rested} of {count}")),
            ("the last one at rest after", format!("{} s", brief(most(|end| end.rest.unwrap_or(60.0)), 3))),
            ("deepest contact under the ground", format!("{:.1e} half-extents", most(|end| end.depth))),
            ("steps until rest, on average", brief(steps, 3)),
            ("steps until rest, at most", brief(most(|end| end.steps as f64), 6)),
            ("time for a second of a petal in the wind", format!("{} µs", brief(self.pace * 1e6, 3))),
        ];
        for (name, value) in rows {
            table.push([name.to_owned(), value]);
        }
        table.write("  ", &mut out);
        out
    }
}

/// Bodies that are thrown at solids, and solids that are moved through bodies, at random.
#[derive(Clone, Debug)]
pub struct Contacts {
    ended: Vec<RandomContact>,
    /// Number of passes that could not be followed.
    refused: usize,
}

/// Largest gain of energy by contact with solids that stand still, in parts of that at the release.
const MOST_GAIN: f64 = 1e-9;
/// Largest depth in a solid, in half-extents: the tolerance.
const MOST_DEPTH: f64 = 1e-3;

impl Contacts {
    /// This many passes. One that cannot be followed counts as failed.
    pub fn new(count: u64) -> Contacts {
        let ended: Vec<_> = (0..count).filter_map(|seed| random_contact(seed, 1e-3).ok()).collect();
        Contacts { refused: count as usize - ended.len(), ended }
    }

    /// Number of bodies that passed through a solid, came too deep into it, or gained energy.
    pub fn failed(&self) -> usize {
        let bad = |end: &&RandomContact| end.pierced || end.depth > MOST_DEPTH || end.gain > MOST_GAIN;
        self.refused + self.ended.iter().filter(bad).count()
    }

    /// One line for each quantity.
    pub fn table(&self) -> String {
        let most = |of: fn(&RandomContact) -> f64| self.ended.iter().map(of).fold(0.0, f64::max);
        let count = self.ended.len() + self.refused;
        let number = |of: fn(&RandomContact) -> bool| self.ended.iter().filter(|end| of(end)).count();
        let mut out = "falling: plates, balls and blocks that meet thin plates, posts and boxes at random, at up to 100 of their lengths in a frame of 1/60 s\n"
            .to_owned();
        let mut table = Table::default();
        let rows = [
            ("touched", format!("{} of {count}", number(|end| end.touched))),
            ("refused", format!("{} of {count}", self.refused)),
            ("passed through", format!("{} of {count}", number(|end| end.pierced))),
            ("deepest contact in a solid", format!("{:.1e} half-extents", most(|end| end.depth))),
            ("largest gain of energy by what stands still", format!("{:.1e}", most(|end| end.gain))),
            ("steps in half a second, at most", brief(most(|end| end.steps as f64), 6)),
        ];
        for (name, value) in rows {
            table.push([name.to_owned(), value]);
        }
        table.write("  ", &mut out);
        out
    }
}

/// Seconds for a second of the flight of a petal in a wind that costs nothing, the best of some.
fn pace() -> Result<f64, fall::Error> {
    let wind = |point: Vector, time: f64| Vector::new(1.0 + (time + point.x).sin(), 0.0, 0.3 * point.y.sin());
    let (seconds, mut best) = (4.0, f64::INFINITY);
    for k in 0..200 {
        let mut release = Motion::at(Vector::new(0.1 * f64::from(k), 100.0, 0.0));
        release.velocity.x = 0.5;
        let petal = Body::plate(2e-5, [0.008, 0.012])?;
        let begun = Instant::now();
        let mut fall = Fall::new(petal, release, 0.0, Some(Ground::at(0.0)), Settings::default())?;
        fall.at(seconds, &wind)?;
        best = best.min(begun.elapsed().as_secs_f64() / seconds);
    }
    Ok(best)
}
