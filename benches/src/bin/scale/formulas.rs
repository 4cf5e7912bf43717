//! Measurements without numerical integration: parsing, productions, the dragon curve, branches, frames.

use cpu_time::ProcessTime as Clock;
use dlsys::sim::Settings;
use dlsys_benches::kernels;
use dlsys_benches::measure::duration;
use dlsys_benches::plants::{self, Branches, Growing, Lives};
use dlsys_benches::scale::{self, median};
use dlsys_benches::solver;

use crate::{Outcome, ROUNDS, line};

/// Seconds that a measurement of branches may take.
const LIMIT: f64 = 12.0;

pub fn parsing() -> Outcome {
    let texts = [
        ("20,000 random cells", Growing::Vegetative.text(20_000, 1)),
        ("rules of 40 kB", plants::many_rules(40_000)),
        ("rules of 160 kB", plants::many_rules(160_000)),
    ];
    for (name, text) in texts {
        solver::session(&text)?;
        let one = |_| {
            let begin = Clock::now();
            drop(solver::session(&text));
            begin.elapsed().as_secs_f64()
        };
        let once = median((0..ROUNDS).map(one).collect());
        let speed = text.len() as f64 / once / 1e6;
        line(&format!("reading, {name}"), &format!("{speed:.1} MB/s ({})", duration(once)), "", None);
    }
    Ok(())
}

pub fn productions() -> Outcome {
    for lives in Lives::ALL {
        let mut costs = [0.0; 2];
        for (cost, (n, units)) in costs.iter_mut().zip([(1_000, 1000.0), (1_000_000, 3.0)]) {
            let text = lives.text(n);
            let one = |_| Ok(scale::work(&text, Settings::default(), 2.0, 2.0 + units)?.per_event());
            *cost = median((0..ROUNDS).map(one).collect::<Result<_, String>>()?);
        }
        let [few, many] = costs;
        let what = format!("an event, {}, 10^3 and 10^6 modules", lives.name());
        let measured = format!("{} and {}: ratio {:.2}", duration(few), duration(many), many / few);
        line(&what, &measured, "0.3 µs", Some(few.max(many) <= 0.3e-6));
    }
    for (n, units) in [(1_000, 1000.0), (1_000_000, 3.0)] {
        let text = Lives::Various.text(n);
        let (mut ours, mut heap, mut ratios) = (Vec::new(), Vec::new(), Vec::new());
        for _ in 0..ROUNDS {
            ours.push(scale::work(&text, Settings::default(), 2.0, 2.0 + units)?.per_event());
            heap.push(scale::per_event_of(|| kernels::lives(n, 2.0 + units).0));
            ratios.push(ours[ours.len() - 1] / heap[heap.len() - 1]);
        }
        let (ours, heap, ratio) = (duration(median(ours)), duration(median(heap)), median(ratios));
        let measured = format!("{ours} : {heap}, ratio {ratio:.1}");
        let what = format!("an event, lives that change, {n} modules, dlsys : a heap in plain Rust");
        line(&what, &measured, "2", Some(ratio <= 2.0));
    }
    Ok(())
}

pub fn dragon() -> Outcome {
    let session = solver::session(scale::DRAGON)?;
    for (what, frames) in [("state at the end", 1), ("1,024 frames formed", 1024)] {
        let (mut ours, mut euler, mut ratios) = (Vec::new(), Vec::new(), Vec::new());
        for _ in 0..ROUNDS {
            ours.push(scale::observed(&session, 16.0, frames)?.0);
            let begin = Clock::now();
            std::hint::black_box(kernels::dragon_by_euler(1.0 / 64.0, 16.0));
            euler.push(begin.elapsed().as_secs_f64());
            ratios.push(ours[ours.len() - 1] / euler[euler.len() - 1]);
        }
        let measured =
            format!("{} : {}, ratio {:.2}", duration(median(ours)), duration(median(euler)), median(ratios));
        let what =
            format!("dragon to t = 16, {what}, dlsys : forward Euler with steps of 1/64 in plain Rust");
        line(&what, &measured, "", None);
    }
    Ok(())
}

pub fn branches() -> Outcome {
    for branches in Branches::ALL {
        // Four times as many as long as that does not take too long; up to a million.
        let (mut n, mut last, mut cost) = (16_000, f64::NAN, renewal(branches, 16_000)?);
        while n < 1_000_000 {
            let growth = if last.is_nan() { 16.0 } else { (cost / last).max(4.0) };
            if cost * growth > LIMIT {
                break;
            }
            n *= 4;
            (last, cost) = (cost, renewal(branches, n)?);
        }
        let unit = if branches == Branches::Rest { "" } else { " a unit of time" };
        let measured =
            format!("{} for {n}{unit}, {:.2} times that of {}", duration(cost), cost / last, n / 4);
        let met = n > 1_000_000 && cost / last < 6.0;
        line(&format!("10^6 branches on one node, {}", branches.name()), &measured, "linear: 4", Some(met));
    }
    Ok(())
}

/// Seconds of making so many branches, or of a unit of time of what they do afterwards.
fn renewal(branches: Branches, n: usize) -> Result<f64, String> {
    let session = solver::session(&branches.text(n))?;
    let settings = Settings::default();
    match branches {
        Branches::Rest => Ok(scale::start(&session, settings)?.seconds),
        _ => Ok(scale::work(&branches.text(n), settings, 0.5, 2.5)?.seconds / 2.0),
    }
}

pub fn frames() -> Outcome {
    let cases = [
        ("dragon, t = 15 to 16", scale::DRAGON.to_string(), 15.01, 15.99),
        ("10^6 lives without events", plants::two_parameters(1_000_000), 0.01, 0.5),
        ("filament, 10,000 cells", Growing::Vegetative.text(10_000, 3), 2.0, 2.2),
    ];
    for (what, text, from, to) in cases {
        let (seconds, modules) = scale::frames(&text, from, to, 50)?;
        let measured = format!(
            "{:.0} a second, {:.0} million modules a second",
            1.0 / seconds,
            modules as f64 / seconds / 1e6
        );
        line(&format!("frames, {what}"), &measured, "", None);
    }
    Ok(())
}
