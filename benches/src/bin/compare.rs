//! Prints one table: `cargo run --release --bin compare [filament] [transport] [restart] [anabaena]`.
//!
//! Both programs are tuned to the same error and then run alternately. Times are medians with quartiles, and ratios are
//! medians of the ratios of each round.

use std::time::{Duration, Instant};

use dlsys::sim::Method as Ours;
use dlsys_benches::anabaena::{self, Anabaena};
use dlsys_benches::filament::{self, Coupling, D_SLOW, D_STIFF, Filament};
use dlsys_benches::measure::{self, Race, Spread, duration};
use dlsys_benches::restart::{self, Best, Differ, EVENTS, Life};
use dlsys_benches::solver::{Candidate, Dlsys, Method};
use dlsys_benches::transport;
use dlsys_benches::tune::{self, Tuned};

/// Rounds of a race.
const ROUNDS: usize = 31;
/// A program that takes longer for one run is left out.
const LIMIT: Duration = Duration::from_secs(5);

/// One line of the table.
struct Row {
    case: String,
    race: Race,
    ours: String,
    theirs: String,
    /// Greatest ratio ours : theirs that is good.
    target: f64,
}

fn main() -> Result<(), String> {
    let chosen: Vec<String> = std::env::args().skip(1).collect();
    let wanted = |name: &str| chosen.is_empty() || chosen.iter().any(|c| c == name);
    let mut rows = Vec::new();
    if wanted("filament") {
        filaments(&mut rows)?;
    }
    if wanted("transport") {
        rows.push(one_way());
    }
    if wanted("restart") {
        restarts(&mut rows)?;
    }
    print(&rows);
    if wanted("anabaena") {
        listing()?;
    }
    Ok(())
}

fn filaments(rows: &mut Vec<Row>) -> Result<(), String> {
    for (coupling, d) in [
        (Coupling::Linear, D_SLOW),
        (Coupling::Linear, D_STIFF),
        (Coupling::Nonlinear, D_SLOW),
        (Coupling::Nonlinear, D_STIFF),
    ] {
        let problem = Filament { coupling, d };
        let reference = problem.reference()?;
        let error = |solver: &dyn dlsys_benches::solver::Solver| reference.error(solver);
        println!("{}: error {:.0e} of {}", problem.name(), filament::TARGET, dlsys_benches::chain::WALL);
        // On a stiff filament an explicit method is out of the question (a million steps).
        let mut candidates: Vec<Candidate> = if d == D_SLOW { problem.explicit() } else { Vec::new() };
        for method in [Method::Bdf, Method::Esdirk34] {
            // The target for the linear filament names a method; for the nonlinear one it is the best of all.
            if coupling == Coupling::Nonlinear || (method == Method::Bdf && d == D_STIFF) {
                candidates.extend(problem.implicit(method));
            }
        }
        let theirs = tune::fastest(&candidates, (7, 14), filament::TARGET, LIMIT, &error, tell);
        let ours = match Dlsys::new(&problem.text(), 1e-6, &filament::TIMES)?.ends_within(LIMIT)? {
            true => {
                let start = Dlsys::new(&problem.text(), 1e-6, &filament::TIMES)?.starting(ROUNDS)?;
                println!("  dlsys: {} of each run for making the string", duration(start));
                tune::fastest(&[problem.dlsys()], (3, 14), filament::TARGET, LIMIT, &error, tell)
            }
            false => {
                println!("  dlsys: one run takes more than {}, left out", duration(LIMIT.as_secs_f64()));
                None
            }
        };
        let target = match (coupling, d == D_SLOW) {
            (Coupling::Linear, true) => 1.0,
            (Coupling::Linear, false) => 1.0 / 40.0,
            (Coupling::Nonlinear, _) => 2.0,
        };
        rows.push(race(problem.name(), ours, theirs, target));
    }
    Ok(())
}

fn one_way() -> Row {
    let reference = transport::reference();
    let error = |solver: &dyn dlsys_benches::solver::Solver| transport::error(&reference, solver);
    println!("transport one way: error {:.0e}", transport::TARGET);
    let theirs = tune::fastest(&transport::explicit(), (7, 14), transport::TARGET, LIMIT, &error, tell);
    let ours = tune::fastest(&[transport::dlsys()], (3, 14), transport::TARGET, LIMIT, &error, tell);
    race("transport one way, 1,000 cells".into(), ours, theirs, 1.0)
}

fn tell(name: &str, found: Option<(&Tuned, Duration)>) {
    match found {
        Some((tuned, time)) => {
            let (time, tol, error) = (duration(time.as_secs_f64()), tuned.tolerance, tuned.error);
            println!("  {name}: {time} at tolerance {tol:.1e}, error {error:.1e}");
        }
        None => println!("  {name}: does not reach the error within {}", duration(LIMIT.as_secs_f64())),
    }
}

fn race(case: String, ours: Option<Tuned>, theirs: Option<Tuned>, target: f64) -> Row {
    let side = |tuned: &Option<Tuned>| match tuned {
        Some(t) => format!("{}, tolerance {:.1e}, error {:.1e}", t.name, t.tolerance, t.error),
        None => "left out".into(),
    };
    let (left, right) = (side(&ours), side(&theirs));
    // All have run without an error before.
    let race = match (ours, theirs) {
        (Some(mut a), Some(mut b)) => {
            measure::race(ROUNDS, &mut || drop(a.solver.run()), &mut || drop(b.solver.run()))
        }
        (Some(mut a), None) => Race { a: alone(&mut a), b: Spread::NONE, ratio: Spread::NONE },
        (None, Some(mut b)) => Race { a: Spread::NONE, b: alone(&mut b), ratio: Spread::NONE },
        (None, None) => Race { a: Spread::NONE, b: Spread::NONE, ratio: Spread::NONE },
    };
    Row { case, race, ours: left, theirs: right, target }
}

/// The time of one program, where the other is left out.
fn alone(tuned: &mut Tuned) -> Spread {
    Spread::of((0..ROUNDS).map(|_| measure::time(&mut || drop(tuned.solver.run()), 1)).collect())
}

fn restarts(rows: &mut Vec<Row>) -> Result<(), String> {
    let logistic = restart::logistic();
    for target in [1e-6, 1e-9] {
        let mut numeric = Vec::new();
        for life in [restart::sine(), restart::short()] {
            let theirs = loops(&life, target)?;
            rows.push(race_restarts(&life, target, &theirs, 1.0, " (alike)")?);
            for (differ, note) in [(Differ::InStart, " (starts differ)"), (Differ::InRate, " (rates differ)")]
            {
                rows.push(race_restarts(&life.differing(differ), target, &theirs, 1.0, note)?);
            }
            numeric.push(theirs);
        }
        // The closed form: against diffsol on the same equation, and on the shorter one that has no closed form.
        let same = loops(&logistic, target)?;
        rows.push(race_restarts(&logistic, target, &same, 0.1, " (closed form)")?);
        rows.push(race_restarts(
            &logistic,
            target,
            &numeric[1],
            0.1,
            " (closed form) against the line without",
        )?);
    }
    Ok(())
}

fn loops(life: &Life, target: f64) -> Result<Best, String> {
    println!("{}, error of a life {target:.0e}", life.name);
    restart::best_loop(life, target, |found, time| {
        let Best { name, tolerance, error, .. } = found;
        println!("  {name}: {} an event at tolerance {tolerance:.1e}, error {error:.1e}", duration(time));
    })
}

fn race_restarts(life: &Life, target: f64, theirs: &Best, good: f64, note: &str) -> Result<Row, String> {
    let session = life.session()?;
    let other = format!("{}, tolerance {:.1e}, error {:.1e}", theirs.name, theirs.tolerance, theirs.error);
    let case = format!("restart {}{note}, {target:.0e}, per event", life.name);
    let Some((tolerance, error)) = restart::tuned_dlsys(&session, life, Ours::Auto, target) else {
        return Ok(Row {
            case,
            race: Race { a: Spread::NONE, b: Spread::NONE, ratio: Spread::NONE },
            ours: "does not reach the error".into(),
            theirs: other,
            target: good,
        });
    };
    if restart::run_dlsys(&session, life, Ours::Auto, tolerance)? != EVENTS as u64 {
        return Err(format!("{}: not {EVENTS} events", life.name));
    }
    let mut a = || drop(restart::run_dlsys(&session, life, Ours::Auto, tolerance));
    let mut b = || drop((theirs.run)(EVENTS));
    let mut race = measure::race(ROUNDS, &mut a, &mut b);
    (race.a, race.b) = (race.a.scaled(1.0 / EVENTS as f64), race.b.scaled(1.0 / EVENTS as f64));
    let ours = format!("dlsys, tolerance {tolerance:.1e}, error {error:.1e}");
    Ok(Row { case, race, ours, theirs: other, target: good })
}

fn print(rows: &[Row]) {
    if rows.is_empty() {
        return;
    }
    println!("\n| case | dlsys | diffsol | ratio | target | |");
    println!("|---|---|---|---|---|---|");
    for row in rows {
        let Row { case, ours, theirs, target, .. } = row;
        let Race { a, b, ratio } = row.race;
        let shown = |s: Spread| match s.median.is_nan() {
            true => "-".into(),
            false => format!("{} ({} to {})", duration(s.median), duration(s.low), duration(s.high)),
        };
        let verdict = match ratio.median {
            r if r.is_nan() => "not measured",
            r if r <= *target => "met",
            _ => "missed",
        };
        println!(
            "| {case} | {}; {ours} | {}; {theirs} | {:.3} ({:.3} to {:.3}) | {target:.3} | {verdict} |",
            shown(a),
            shown(b),
            ratio.median,
            ratio.low,
            ratio.high,
        );
    }
}

/// The Euler run that would reach the error is too long. So its error is measured at step sizes that can be run, and
/// the order 1 at which it falls, and the time of a step; the rest is extrapolated.
fn listing() -> Result<(), String> {
    let anabaena = Anabaena::open()?;
    let state = anabaena.state(anabaena::END).ok_or("no state at the end")?;
    println!("\nAnabaena listing to t = {}, error {:.0e}", anabaena::END, anabaena::TARGET);
    let found = tune::search(3, 12, anabaena::TARGET, |tolerance| {
        let (string, _) = anabaena.run(anabaena::auto(tolerance), anabaena::END).ok()?;
        Some(anabaena.error(&string, state))
    });
    let Some((tolerance, error)) = found else { return Err("dlsys does not reach the error".into()) };
    let mut run = || drop(anabaena.run(anabaena::auto(tolerance), anabaena::END));
    let ours = Spread::of((0..ROUNDS).map(|_| measure::time(&mut run, 3)).collect());
    println!("  dlsys: {} at tolerance {tolerance:.1e}, error {error:.1e}", duration(ours.median));

    let mut last: Option<(f64, f64, f64)> = None;
    let mut step_size = 0.1;
    loop {
        let begin = Instant::now();
        let (string, stats) = anabaena.run(anabaena::euler(step_size), anabaena::END)?;
        let seconds = begin.elapsed().as_secs_f64();
        let error = anabaena.error(&string, state);
        let order = last.map(|(h, e, _)| (e / error).ln() / (h / step_size).ln());
        let order = order.filter(|o| o.is_finite()).map_or("".into(), |o| format!(", order {o:.3}"));
        println!(
            "  Euler, step {step_size}: {}, {} steps, error {error:.2e}{order}",
            duration(seconds),
            stats.steps,
        );
        last = Some((step_size, error, seconds));
        if seconds > LIMIT.as_secs_f64() {
            break;
        }
        step_size /= 2.0;
    }
    let Some((h, e, seconds)) = last else { return Ok(()) };
    let needed = h * anabaena::TARGET / e;
    let euler = seconds * h / needed;
    let ratio = euler / ours.median;
    println!(
        "  Euler at error {:.0e}, extrapolated with order 1: step {needed:.1e}, {}",
        anabaena::TARGET,
        duration(euler)
    );
    let verdict = if ratio >= 1000.0 { "met" } else { "missed" };
    println!("  dlsys is {ratio:.0} times faster; target 1000 times: {verdict}");
    Ok(())
}
