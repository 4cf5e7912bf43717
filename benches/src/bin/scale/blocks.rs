//! The cost of the building blocks of the language: a plant written with them and the same plant simplified by hand.

use cpu_time::ProcessTime as Clock;
use dlsys::sim::Settings;
use dlsys::tree::ModuleString;
use dlsys_benches::blocks::{self, AGREEMENT};
use dlsys_benches::measure::duration;
use dlsys_benches::scale::median;
use dlsys_benches::solver;

use crate::{Outcome, ROUNDS, line};

/// Axes, and how long they grow: 10^5 modules in the end.
const AXES: usize = 2_200;
const END: f64 = 30.0;

pub fn blocks() -> Outcome {
    let texts = [blocks::with_blocks(AXES), blocks::by_hand(AXES)];
    let sessions = [solver::session(&texts[0])?, solver::session(&texts[1])?];
    for (what, frames) in [("run to its end", 1), ("run with 100 frames", 100)] {
        let mut seconds = [Vec::new(), Vec::new()];
        let mut ends = [(0, 0.0); 2];
        // In turns, so that noise of the machine hits both.
        for _ in 0..ROUNDS {
            for i in 0..2 {
                let begin = Clock::now();
                let mut string = ModuleString::default();
                let mut simulation = sessions[i].simulate(Settings::default()).map_err(|e| e.to_string())?;
                for k in 1..=frames {
                    let t = END * f64::from(k) / f64::from(frames);
                    simulation.at(t, &mut string).map_err(|e| e.to_string())?;
                }
                seconds[i].push(begin.elapsed().as_secs_f64());
                ends[i] = blocks::summary(&string);
            }
        }
        let [(modules, sum), (others, other_sum)] = ends;
        if modules != others || (sum - other_sum).abs() > AGREEMENT * sum {
            return Err(format!("the plants differ: {ends:?}"));
        }
        let [with, without] = seconds.map(median);
        let speed = without / with;
        let measured = format!(
            "{} and {} by hand, {modules} modules: {speed:.2} of its speed",
            duration(with),
            duration(without)
        );
        line(&format!("building blocks, {what}"), &measured, "0.5", Some(speed >= 0.5));
    }
    Ok(())
}
