//! Measurements of numerical integration: right-hand sides, a busy filament, filaments that grow.

use std::time::Instant;

use cpu_time::ProcessTime as Clock;
use dlsys::sim::{Scheduler, Settings};
use dlsys::tree::ModuleString;
use dlsys_benches::kernels;
use dlsys_benches::measure::duration;
use dlsys_benches::plants::{self, Growing, Lives};
use dlsys_benches::scale::{self, median, with};
use dlsys_benches::solver;

use crate::{Outcome, ROUNDS, line};

pub fn filament() -> Outcome {
    let bare = scale::bare_right_hand_sides();
    for (tolerance, end) in [(1e-6, 200.0), (1e-12, 200.0)] {
        let one = |_| {
            let work = scale::right_hand_sides(tolerance, end)?;
            Ok(work.rhs_evaluations as f64 / work.seconds)
        };
        let speed = median((0..ROUNDS).map(one).collect::<Result<_, String>>()?);
        let measured =
            format!("{:.0} million a second, {:.2} of a bare loop over an array", speed / 1e6, speed / bare);
        let what =
            format!("cell evaluations, whole DOP853 step counted, 1,000 cells, tolerance {tolerance:.0e}");
        line(&what, &measured, "100 million", Some(speed >= 1e8));
    }
    Ok(())
}

pub fn busy() -> Outcome {
    let text = plants::busy(1000);
    let run = |scheduler, tolerance| -> Result<f64, String> {
        let one = |_| Ok(scale::work(&text, with(scheduler, tolerance), 2.0, 12.0)?.seconds / 10.0);
        Ok(median((0..ROUNDS).map(one).collect::<Result<_, String>>()?))
    };
    let (auto, global) = (run(Scheduler::Auto, 1e-6)?, run(Scheduler::Global, 1e-6)?);
    let measured = format!("{} a unit of time; `global` {:.0} times that", duration(auto), global / auto);
    line("busy filament, 1,000 cells and events", &measured, "1.5 ms", Some(auto <= 1.5e-3));
    against_kernel(&text)?;
    many_cells(&text)?;
    stiff()?;
    let times: Vec<f64> = (1..=8).map(|k| 0.37 * f64::from(k)).collect();
    let exact = scale::states(&text, with(Scheduler::Global, 1e-10), &times)?.0;
    for tolerance in [1e-4, 1e-6, 1e-8] {
        errors("busy filament", &text, &times, &exact, tolerance)?;
    }
    Ok(())
}

/// An event of the busy filament, and what the same numerics cost in plain Rust: measured in turns.
fn against_kernel(text: &str) -> Outcome {
    let (mut ours, mut plain, mut ratios) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..ROUNDS {
        ours.push(scale::work(text, with(Scheduler::Auto, 1e-6), 2.0, 12.0)?.per_event());
        plain.push(scale::per_event_of(|| kernels::busy(1000, 1e-6, 12.0).0));
        ratios.push(ours[ours.len() - 1] / plain[plain.len() - 1]);
    }
    let measured =
        format!("{} : {}, ratio {:.1}", duration(median(ours)), duration(median(plain)), median(ratios));
    line("busy filament, an event, dlsys : the same numerics in plain Rust", &measured, "", None);
    Ok(())
}

/// An event among a million cells against one among a thousand, in turns.
fn many_cells(few: &str) -> Outcome {
    let many = plants::busy(1_000_000);
    let (mut costs, mut ratios) = ([Vec::new(), Vec::new()], Vec::new());
    for _ in 0..3 {
        let few = scale::work(few, with(Scheduler::Auto, 1e-6), 2.0, 52.0)?.per_event();
        let many = scale::work(&many, with(Scheduler::Auto, 1e-6), 0.1, 1.1)?.per_event();
        costs[0].push(few);
        costs[1].push(many);
        ratios.push(many / few);
    }
    let ([few, many], ratio) = (costs.map(|costs| duration(median(costs))), median(ratios));
    let measured = format!("{few} and {many}: ratio {ratio:.2}");
    line("busy filament, an event, 10^3 and 10^6 cells", &measured, "1.5", Some(ratio <= 1.5));
    Ok(())
}

/// What two threads gain, in real time and in turns.
pub fn threads() -> Outcome {
    let cases = [
        ("independent modules, 10^6 lives that change", Lives::Various.text(1_000_000), (2.0, 4.0), 1.8),
        ("nonlinear filament of 10^5 cells", plants::nonlinear(100_000), (0.0, 10.0), 1.6),
        ("busy filament of 10^5 cells", plants::busy(100_000), (0.1, 1.1), 1.6),
    ];
    for (what, text, (from, to), target) in cases {
        let session = solver::session(&text)?;
        let one = |threads| -> Result<f64, String> {
            let settings = Settings { threads, ..Settings::default() };
            let mut simulation = session.simulate(settings).map_err(|e| e.to_string())?;
            simulation.pass(from).map_err(|e| e.to_string())?;
            let begin = Instant::now();
            simulation.pass(to).map_err(|e| e.to_string())?;
            Ok(begin.elapsed().as_secs_f64())
        };
        let (mut one_thread, mut gains) = (Vec::new(), Vec::new());
        for _ in 0..ROUNDS {
            let (alone, shared) = (one(1)?, one(2)?);
            one_thread.push(alone);
            gains.push(alone / shared);
        }
        let (seconds, gain) = (duration(median(one_thread)), median(gains));
        let measured = format!("{gain:.2} times as fast as one ({seconds})");
        line(&format!("two threads, {what}"), &measured, &format!("{target}"), Some(gain >= target));
    }
    Ok(())
}

/// The busy filament whose cells exchange so fast that its equations are stiff.
fn stiff() -> Outcome {
    let text = plants::busy_and_stiff(1000);
    let one = |_| Ok(scale::work(&text, with(Scheduler::Auto, 1e-6), 1.0, 1.2)?.per_event());
    let event = median((0..ROUNDS).map(one).collect::<Result<_, String>>()?);
    line("busy and stiff filament, 1,000 cells, an event", &duration(event), "", None);
    let times = [0.05, 0.1, 0.15, 0.2];
    let text = plants::busy_and_stiff(200);
    let exact = scale::states(&text, with(Scheduler::Global, 1e-10), &times)?.0;
    errors("busy and stiff filament, 200 cells", &text, &times, &exact, 1e-6)
}

/// How far `auto` and `global` are from the reference.
fn errors(what: &str, text: &str, times: &[f64], exact: &[ModuleString], tolerance: f64) -> Outcome {
    let (auto, cost) = scale::states(text, with(Scheduler::Auto, tolerance), times)?;
    let (global, other) = scale::states(text, with(Scheduler::Global, tolerance), times)?;
    let (ours, plain) =
        (scale::distance(&auto, exact) / tolerance, scale::distance(&global, exact) / tolerance);
    let apart = scale::distance(&auto, &global) / tolerance;
    let measured = format!(
        "{ours:.2} TOL (`global` {plain:.2} TOL, apart {apart:.2} TOL); `global` takes {:.1} times as long",
        other.seconds / cost.seconds
    );
    line(&format!("{what}, error of `auto` at {tolerance:.0e}"), &measured, "100 TOL", Some(ours <= 100.0));
    Ok(())
}

/// Growth by 1 % a unit of time: how long it takes from some cells to others.
fn time_between(from: f64, to: f64) -> f64 {
    (to / from).ln() / 1.01f64.ln()
}

pub fn growing() -> Outcome {
    const WINDOW: f64 = 20.0;
    for growing in Growing::ALL {
        let mut costs = Vec::new();
        // With seeds 1 and 7 a cell of Anabaena comes too near the threshold for the tolerance to tell whether it meets it.
        let text = growing.text(100, 3);
        let session = solver::session(&text)?;
        let mut simulation = session.simulate(Settings::default()).map_err(|e| e.to_string())?;
        let mut t = 0.0;
        let mut total = 0.0;
        for wanted in [1e3, 1e4, 1e5] {
            // A window around the wanted number of cells.
            while (simulation.stats().modules as f64) < wanted * 0.95 {
                let missing = time_between(simulation.stats().modules as f64, wanted * 0.96).max(0.5);
                let begin = Clock::now();
                t += missing.min(20.0);
                simulation.pass(t).map_err(|e| e.to_string())?;
                total += begin.elapsed().as_secs_f64();
            }
            // As a whole: common steps are as long as several units of time.
            let cells = simulation.stats().modules as f64;
            let begin = Clock::now();
            t += WINDOW;
            simulation.pass(t).map_err(|e| e.to_string())?;
            let seconds = begin.elapsed().as_secs_f64();
            costs.push(seconds / WINDOW / (0.5 * (cells + simulation.stats().modules as f64)));
            total += seconds;
        }
        let [few, some, many] = costs[..] else { return Err("three sizes".into()) };
        let measured = format!(
            "{} at 1,000, {} at 10,000, {} at 100,000: ratio {:.2}; {} from 100 to 100,000 cells",
            duration(few),
            duration(some),
            duration(many),
            many / few,
            duration(total)
        );
        let what = format!("growing filament, {}, a cell and unit of time", growing.name());
        line(&what, &measured, "1.5", Some(many / few <= 1.5));
    }
    for growing in Growing::ALL {
        let text = growing.text(100, 7);
        let end = time_between(100.0, 2000.0);
        let times: Vec<f64> = (1..=6).map(|k| end * f64::from(k) / 6.0).collect();
        let exact = scale::states(&text, with(Scheduler::Global, 1e-10), &times)?.0;
        errors(&format!("{} to 2,000 cells", growing.name()), &text, &times, &exact, 1e-6)?;
    }
    Ok(())
}
