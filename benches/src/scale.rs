//! Measurements at scale: work done between two times, errors against a reference, memory.
//!
//! Seconds are processor time of the process over all threads, which other programs on the machine affect less.

use cpu_time::ProcessTime as Clock;
use dlsys::session::Session;
use dlsys::sim::{Method, Scheduler, Settings, Stats};
use dlsys::tree::ModuleString;

use crate::chain::{MU, WALL};
use crate::filament::{Coupling, D_SLOW, Filament};
use crate::solver;

/// The work of a simulation from one time to another.
#[derive(Clone, Copy, Debug)]
pub struct Work {
    pub seconds: f64,
    pub events: u64,
    pub rhs_evaluations: u64,
    /// Modules alive at the end.
    pub modules: u64,
}

impl Work {
    pub fn per_event(&self) -> f64 {
        self.seconds / self.events as f64
    }
}

/// Runs to `from`, then measures up to `to`.
pub fn work(text: &str, settings: Settings, from: f64, to: f64) -> Result<Work, String> {
    let session = solver::session(text)?;
    let mut simulation = session.simulate(settings).map_err(|e| e.to_string())?;
    simulation.pass(from).map_err(|e| e.to_string())?;
    let before = simulation.stats();
    let begin = Clock::now();
    simulation.pass(to).map_err(|e| e.to_string())?;
    Ok(done(begin, before, simulation.stats()))
}

fn done(begin: Clock, before: Stats, after: Stats) -> Work {
    Work {
        seconds: begin.elapsed().as_secs_f64(),
        events: after.events - before.events,
        rhs_evaluations: after.rhs_evaluations - before.rhs_evaluations,
        modules: after.modules,
    }
}

/// What costs time is the making of the string, from the start.
pub fn start(session: &Session, settings: Settings) -> Result<Work, String> {
    let begin = Clock::now();
    let simulation = session.simulate(settings).map_err(|e| e.to_string())?;
    Ok(done(begin, Stats::default(), simulation.stats()))
}

/// Seconds an event of a run that returns the number of its events.
pub fn per_event_of(run: impl FnOnce() -> u64) -> f64 {
    let begin = Clock::now();
    let events = std::hint::black_box(run());
    begin.elapsed().as_secs_f64() / events as f64
}

/// The middle one of some measurements.
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// The state at each of the times, and what the run cost.
pub fn states(text: &str, settings: Settings, times: &[f64]) -> Result<(Vec<ModuleString>, Work), String> {
    let session = solver::session(text)?;
    let begin = Clock::now();
    let mut simulation = session.simulate(settings).map_err(|e| e.to_string())?;
    let mut strings = Vec::new();
    for &t in times {
        let mut string = ModuleString::default();
        simulation.at(t, &mut string).map_err(|e| e.to_string())?;
        strings.push(string);
    }
    Ok((strings, done(begin, Stats::default(), simulation.stats())))
}

/// Largest difference of parameters, relative to max(1, |value|); infinite if the modules are not the same ones.
pub fn distance(a: &[ModuleString], b: &[ModuleString]) -> f64 {
    let mut worst = 0.0f64;
    for (a, b) in a.iter().zip(b) {
        if a.len() != b.len() {
            return f64::INFINITY;
        }
        for (m, n) in a.iter().zip(b.iter()) {
            if m.kind != n.kind || m.parameters.len() != n.parameters.len() {
                return f64::INFINITY;
            }
            for (x, y) in m.parameters.iter().zip(n.parameters) {
                worst = worst.max((x - y).abs() / y.abs().max(1.0));
            }
        }
    }
    worst
}

pub fn with(scheduler: Scheduler, tolerance: f64) -> Settings {
    Settings { scheduler, tolerance, ..Settings::default() }
}

/// A thousand cells with c' = D (l + r - 2c) - mu c between two walls, integrated as if they had no other solution.
pub fn right_hand_sides(tolerance: f64, end: f64) -> Result<Work, String> {
    let text = Filament { coupling: Coupling::Linear, d: D_SLOW }.text();
    work(&text, Settings { method: Method::Dop853, tolerance, ..Settings::default() }, 0.0, end)
}

/// The same evaluations by a bare loop over an array: what the machine can do. Evaluations per second.
pub fn bare_right_hand_sides() -> f64 {
    let mut c = crate::chain::initial();
    c.insert(0, WALL);
    c.push(WALL);
    let mut rate = vec![0.0; c.len()];
    let rounds = 20_000;
    let begin = Clock::now();
    for _ in 0..rounds {
        let c = std::hint::black_box(&mut c);
        for (out, w) in rate[1..].iter_mut().zip(c.windows(3)) {
            *out = D_SLOW * (w[0] + w[2] - 2.0 * w[1]) - MU * w[1];
        }
        std::hint::black_box(&mut rate);
    }
    f64::from(rounds) * (c.len() - 2) as f64 / begin.elapsed().as_secs_f64()
}

/// The dragon curve of the paper.
pub const DRAGON: &str = include_str!("../../tests/paper-models/dragon.dls");

/// Seconds of a run with `frames` observed, evenly, the last at `end`; and how many modules there are then.
pub fn observed(session: &Session, end: f64, frames: u32) -> Result<(f64, usize), String> {
    let begin = Clock::now();
    let mut simulation = session.simulate(Settings::default()).map_err(|e| e.to_string())?;
    let mut string = ModuleString::default();
    for k in 1..=frames {
        simulation.at(end * f64::from(k) / f64::from(frames), &mut string).map_err(|e| e.to_string())?;
    }
    Ok((begin.elapsed().as_secs_f64(), string.len()))
}

/// Seconds a frame, and modules in it, of `frames` between two times at which nothing is replaced.
pub fn frames(text: &str, from: f64, to: f64, frames: u32) -> Result<(f64, usize), String> {
    let session = solver::session(text)?;
    let mut simulation = session.simulate(Settings::default()).map_err(|e| e.to_string())?;
    let mut string = ModuleString::default();
    simulation.at(from, &mut string).map_err(|e| e.to_string())?;
    // What is integrated is integrated before: frames are to be measured.
    let begin = Clock::now();
    for k in 1..=frames {
        let t = from + (to - from) * f64::from(k) / f64::from(frames);
        simulation.at(t, &mut string).map_err(|e| e.to_string())?;
    }
    Ok((begin.elapsed().as_secs_f64() / f64::from(frames), string.len()))
}

/// Peak resident memory of this process in bytes; Linux only.
pub fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kilobytes: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kilobytes * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_are_relative_and_strangers_infinitely_far() {
        let at = |text: &str, t| states(text, Settings::default(), &[t]).expect("it runs").0;
        let model = "initial string: A(100)\nA(x): solve dx/dt = 1";
        assert!((distance(&at(model, 1.0), &at(model, 0.0)) - 0.01).abs() < 1e-12);
        assert_eq!(distance(&at(model, 1.0), &at("initial string: A(1) A(1)", 1.0)), f64::INFINITY);
    }

    #[test]
    fn evaluations_are_counted_by_cell() {
        let work = right_hand_sides(1e-6, 1.0).expect("it runs");
        assert!(work.rhs_evaluations >= 12_000 && work.rhs_evaluations.is_multiple_of(1000), "{work:?}");
    }
}
