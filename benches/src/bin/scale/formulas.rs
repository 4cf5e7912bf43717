//! What is done by formulas: reading, productions, the dragon curve, branches, frames.

use dlsys::sim::Settings;
use dlsys_benches::measure::{self, duration};
use dlsys_benches::plants::{self, Branches, Growing, Lives};
use dlsys_benches::scale::{self, median};
use dlsys_benches::solver;

use crate::{Outcome, ROUNDS, line};

/// Seconds that cpfg (of L-studio 4) took for the dragon curve to t = 16, in 12.5 million module steps: a note of
/// another run, which this program cannot repeat.
const CPFG_DRAGON: f64 = 1.3;

pub fn parsing() -> Outcome {
    let texts = [
        ("20,000 random cells", Growing::Vegetative.text(20_000, 1)),
        ("rules of 40 kB", plants::many_rules(40_000)),
        ("rules of 160 kB", plants::many_rules(160_000)),
    ];
    for (name, text) in texts {
        solver::session(&text)?;
        let once =
            median((0..ROUNDS).map(|_| measure::time(&mut || drop(solver::session(&text)), 1)).collect());
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
    Ok(())
}

pub fn dragon() -> Outcome {
    let session = solver::session(scale::DRAGON)?;
    for (what, frames, target) in [("state at the end", 1, 40.0), ("1,024 frames formed", 1024, 8.0)] {
        let one = |_| Ok(scale::observed(&session, 16.0, frames)?.0);
        let once = median((0..ROUNDS).map(one).collect::<Result<_, String>>()?);
        let ratio = CPFG_DRAGON / once;
        let measured = format!("{}: cpfg's {CPFG_DRAGON} s is {ratio:.1} times that", duration(once));
        let target = format!("{target} times").replace(".0", "");
        let met = ratio >= if frames == 1 { 40.0 } else { 8.0 };
        line(&format!("dragon to t = 16, {what}"), &measured, &target, Some(met));
    }
    Ok(())
}

pub fn branches() -> Outcome {
    for branches in Branches::ALL {
        let mut costs = [0.0; 2];
        for (cost, n) in costs.iter_mut().zip([250_000, 1_000_000]) {
            let text = branches.text(n);
            let session = solver::session(&text)?;
            let settings = Settings::default();
            let one = |_| -> Result<f64, String> {
                let made = scale::start(&session, settings)?.seconds;
                match branches {
                    Branches::Rest => Ok(made),
                    _ => Ok(scale::work(&text, settings, 0.5, 2.5)?.seconds / 2.0),
                }
            };
            *cost = median((0..3).map(one).collect::<Result<_, String>>()?);
        }
        let [few, many] = costs;
        let unit = if branches == Branches::Rest { "" } else { " a unit of time" };
        let measured = format!("{}{unit}, {:.2} times that of 250,000", duration(many), many / few);
        line(&format!("10^6 branches, {}", branches.name()), &measured, "linear: 4", Some(many / few < 5.0));
    }
    Ok(())
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
