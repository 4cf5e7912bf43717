//! Prints the exact cases with their errors and orders, the ball in the net by steps, random passes, and the cost of steps.
//!
//! `cargo run --release -p dlsys-sheet --example cases [PART]`, where PART is `exact`, `net`, `random` or `speed`.

use dlsys_sheet::study::{self, Coupling};
use dlsys_sheet::{Error, Settings};

fn main() -> Result<(), Error> {
    let part = std::env::args().nth(1);
    let is_wanted = |name: &str| part.as_ref().is_none_or(|part| part == name);
    if is_wanted("exact") {
        exact();
    }
    if is_wanted("net") {
        net()?;
    }
    if is_wanted("random") {
        random();
    }
    if is_wanted("speed") {
        for pace in study::paces()? {
            println!(
                "{} points: {:.2} µs a point and step, {:.0} iterations a step, {:.0} steps a second",
                pace.points,
                1e6 * pace.seconds,
                pace.iterations,
                pace.steps
            );
        }
    }
    Ok(())
}

fn exact() {
    for case in study::EXACT_CASES {
        match case() {
            Err(error) => println!("fails: {error}"),
            Ok(rows) => {
                for row in rows {
                    let order = row.order.map_or(String::new(), |order| format!("{order:.2}"));
                    println!(
                        "{:75} {:8.1e} {:13.6e} {:13.6e} {:8.1e} {order}",
                        row.case, row.resolution, row.value, row.expected, row.error
                    );
                }
            }
        }
    }
}

fn net() -> Result<(), Error> {
    for end in [0.1, 0.06] {
        println!("net with an end of radius {end} m, both ways");
        for (step, [ball, net], found) in study::throw_steps(end)? {
            println!(
                "step {step:.5} s: error of the ball {ball:.1e} m, of the net {net:.1e} m; {:?} steps; depth {:.1e}; {:.1?}",
                found.steps,
                found.depth,
                found.table()
            );
        }
        for coupling in [Coupling::TwoWay, Coupling::OneWay] {
            for tolerance in [1e-2, 1e-3, 1e-4] {
                let settings = Settings { tolerance, ..Settings::default() };
                match study::catch(coupling, end, settings) {
                    Ok(found) => println!(
                        "{coupling:?} {tolerance:e}: {:?} steps; depth {:.1e}; {:.1?}",
                        found.steps,
                        found.depth,
                        found.table()
                    ),
                    Err(error) => println!("{coupling:?} {tolerance:e}: {error}"),
                }
            }
        }
    }
    Ok(())
}

fn random() {
    let (mut pierced, mut touched, mut failed, mut steps, mut depth) = (0, 0, 0, 0, 0.0_f64);
    for seed in 0..200 {
        match study::random_pass(seed) {
            Err(error) => {
                failed += 1;
                println!("{seed}: {error}");
            }
            Ok(pass) => {
                if pass.pierced {
                    println!("{pass:?}");
                }
                pierced += u32::from(pass.pierced);
                touched += u32::from(pass.touched);
                depth = depth.max(pass.depth);
                steps += pass.steps[0] + pass.steps[1];
            }
        }
    }
    println!(
        "200 passes: {touched} touched, {pierced} pierced, {failed} failed, depth {depth:.2} radii, {steps} steps"
    );
}
