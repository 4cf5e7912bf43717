//! Prints what a stem of 50, 100 and 300 joints costs, ours and Rapier's: `cargo run --release --bin stems [--all]`, three minutes.
//!
//! With `--all`, Rapier's chain of 100 joints runs to its end (eight minutes more). Its chain of 300 joints would take a day, so that only
//! the cost of a step is measured, together with the step at which the chain of 50 joints is still stable, scaled by the square of the
//! number of joints, as the highest frequency of a chain is.

use dlsys_benches::stems::{Hinge, Run, arcs, rods};

fn print(program: &str, joints: usize, setting: &str, error: Option<f64>, run: &Run) {
    let error = error.map_or("not run to its end".into(), |error| format!("{error:.1e}"));
    let step = run.seconds / run.steps as f64 * 1e3;
    println!(
        "{program:<22} {joints:>6}   {setting:<28} {error:<20} {:>9.4} {:>8} {step:>10.4}",
        run.seconds, run.steps
    );
}

/// The longest stable step of Rapier's chain of 50 joints, in s (5e-5 is not), for another number of joints.
fn stable(joints: usize) -> f64 {
    4e-5 * (50.0 / joints as f64).powi(2)
}

fn main() -> Result<(), dlsys_sway::Error> {
    let all = std::env::args().any(|argument| argument == "--all");
    println!("A level stem of 1 m that is let go, 1 s; error of the tip in m against a fine chain");
    println!(
        "{:<22} {:>6}   {:<28} {:<20} {:>9} {:>8} {:>10}",
        "program", "joints", "setting", "error", "s", "steps", "ms a step"
    );
    for (damping, name) in [(0.0, "not damped"), (0.02, "damped, 0.02 s")] {
        println!("{name}");
        let reference = arcs(200, 1e-6, damping)?;
        for joints in [50, 100, 300] {
            for tolerance in [1e-2, 1e-3, 1e-4] {
                let run = arcs(joints, tolerance, damping)?;
                let error = Some(run.error(&reference));
                print("dlsys", joints, &format!("tolerance {tolerance:e}"), error, &run);
            }
            if damping > 0.0 {
                motors(joints, damping, &reference);
            } else {
                let whole = joints == 50 || joints == 100 && all;
                let most = if whole { usize::MAX } else { 2_000 / joints };
                let run = rods(joints, Hinge::Torque, stable(joints), most);
                let error = whole.then(|| run.error(&reference));
                print("Rapier, torques", joints, &format!("{:.1e} s", stable(joints)), error, &run);
            }
        }
    }
    Ok(())
}

/// Rapier's motors as springs, with more and more work.
fn motors(joints: usize, damping: f64, reference: &Run) {
    for (step, iterations) in [(1.0 / 240.0, 20), (1e-3, 300), (2.5e-4, 300)] {
        if joints > 100 || joints > 50 && step < 1e-3 {
            continue;
        }
        let run = rods(joints, Hinge::Motor { damping, iterations }, step, usize::MAX);
        let setting = format!("{step:.1e} s, {iterations} iterations");
        print("Rapier, motors", joints, &setting, Some(run.error(reference)), &run);
    }
}
