//! Exact cases, hard cases and speed of the surroundings: wind and stems that bend.

use std::hint::black_box;
use std::time::Instant;

use dlsys_sim::brief;
use dlsys_sway::{self as sway, Fixed, Method, Segment, Skeleton, Solver, State, upright};
use dlsys_wind::study::Convergence;
use dlsys_wind::{self as wind, Description, Field};

use super::table::{Table, exact_table};

/// Seconds for a measurement of speed.
const MEASURED: f64 = 0.3;

/// Statistics of the turbulence as a table.
pub fn wind_table(rows: &[wind::study::Row]) -> String {
    let mut out = "wind: statistics of the turbulence\n".to_owned();
    let mut table = Table::default();
    table.push(["", "value", "expected", "error", "bound", ""].map(str::to_owned));
    for row in rows {
        let verdict = if row.holds() { "" } else { "too large" };
        table.push([
            row.name.clone(),
            brief(row.value, 5),
            brief(row.expected, 5),
            format!("{:.1e}", row.error),
            format!("{:.0e}", row.bound),
            verdict.to_owned(),
        ]);
    }
    table.write("  ", &mut out);
    out
}

/// Exact cases of stems as a table. The order is that from the line above.
pub fn exact_stem_table(rows: &[Convergence]) -> String {
    let title = "stems: exact cases, by the number of segments, or what is refined";
    exact_table(title, rows, |resolution| brief(resolution, 4))
}

/// Hard cases of stems as a table.
pub fn hard_stem_table(cases: &[sway::study::HardCase]) -> String {
    let mut out =
        "stems: hard cases at the default tolerance of 1e-3; errors against one a hundred times smaller\n"
            .to_owned();
    let mut table = Table::default();
    table.push(["", "seconds", "steps", "rejected", "shortest", "moved", "error", ""].map(str::to_owned));
    for case in cases {
        table.push([
            case.case.to_owned(),
            brief(case.span, 3),
            case.steps.to_string(),
            case.rejected.to_string(),
            format!("{:.1e} s", case.shortest),
            brief(case.moved, 3),
            case.error.map_or(String::new(), |error| format!("{error:.1e}")),
            if case.failure.is_some() { "fails" } else { "" }.to_owned(),
        ]);
    }
    table.write("  ", &mut out);
    for (case, error) in cases.iter().filter_map(|case| Some((case.case, case.failure.as_ref()?))) {
        out += &format!("  {case}: {error}\n");
    }
    out
}

/// Random trees in random winds, in sum.
pub fn random_stem_table(cases: &[sway::study::RandomCase]) -> String {
    let failed: Vec<_> = cases.iter().filter_map(|case| Some((case.seed, case.failure.as_ref()?))).collect();
    let steps: u64 = cases.iter().map(|case| case.steps + case.rejected).sum();
    let most = cases.iter().map(|case| case.steps + case.rejected).max().unwrap_or(0);
    let shortest = cases.iter().map(|case| case.shortest).fold(f64::INFINITY, f64::min);
    let mut out = format!(
        "stems: {} random trees in random winds for 0.5 s\n  {} failed, {steps} steps, {most} of them in one case, the shortest of {shortest:.1e} s\n",
        cases.len(),
        failed.len()
    );
    for (seed, error) in failed {
        out += &format!("  {seed}: {error}\n");
    }
    out
}

/// The implicit methods on a stem in gusts as a table.
pub fn method_table(rows: &[sway::study::WorkRow]) -> String {
    let mut out = "stems: a stalk in gusts for 2 s, error of its tip against work\n".to_owned();
    let mut table = Table::default();
    table.push(["", "tolerance", "error", "steps", "right-hand sides", ""].map(str::to_owned));
    let mut before = None;
    for row in rows {
        let name = if before == Some(row.method) { "" } else { name(row.method) };
        before = Some(row.method);
        table.push([
            name.to_owned(),
            format!("{:e}", row.tolerance),
            format!("{:.1e}", row.error),
            row.steps.to_string(),
            row.evaluations.to_string(),
            String::new(),
        ]);
    }
    table.write("  ", &mut out);
    out
}

/// The name of a method on the command line.
fn name(method: Method) -> &'static str {
    match method {
        Method::Ros2 => "ros2",
        Method::Ros34Pw2 => "ros34pw2",
        Method::Euler => "euler",
    }
}

/// Time of a step and of a sample of the wind on this machine, as a table.
///
/// # Errors
/// An error of the wind, which is a defect.
pub fn speed_table() -> Result<String, String> {
    let mut out = "speed on one core, plants of 100 segments in a breeze\n".to_owned();
    let mut table = Table::default();
    for method in [Method::Ros2, Method::Ros34Pw2, Method::Euler] {
        for segments in [100, 1000, 10_000] {
            let label = format!("{}, {segments} segments", name(method));
            table.push(match step_time(method, segments) {
                Ok(seconds) => {
                    let each = brief(seconds * 1e6 / segments as f64, 3);
                    [label, each, "µs a segment and step".to_owned()]
                }
                Err(error) => [label, String::new(), format!("fails: {error}")],
            });
        }
    }
    let (instant, [sample, single]) = wind_time().map_err(|error| error.to_string())?;
    table.push(["wind, an instant".to_owned(), brief(instant * 1e3, 3), "ms".to_owned()]);
    table.push(["wind, a place at that instant".to_owned(), brief(sample * 1e9, 3), "ns".to_owned()]);
    table.push(["wind, a place, one of three lattices".to_owned(), brief(single * 1e9, 3), "ns".to_owned()]);
    table.write("  ", &mut out);
    Ok(out)
}

/// Plants of 100 segments: a stem of 1 m, and four branches of 40 cm.
fn plants(segments: usize) -> Skeleton {
    let mut skeleton = Skeleton::new();
    for index in 0..segments {
        let within = index % 100;
        let (axis, place) = (within / 20, within % 20);
        let parent = match (axis, place) {
            (0, 0) => None,
            // Branches leave the stem at a half and above.
            (_, 0) => Some(index - within + 8 + 2 * axis),
            _ => Some(index - 1),
        };
        let (length, width) = if axis == 0 { (0.05, 0.02) } else { (0.02, 0.005) };
        let solid = Segment::solid(parent, length, width, 1e9, 900.0);
        let mut segment = Segment { damping: 0.01, sag: false, ..solid };
        if parent.is_none() {
            segment.joint.rotation = upright();
        } else if place == 0 {
            let turn = sway::Vector::new(1.6 * axis as f64, 0.0, 0.0);
            let lean = nalgebra::Rotation3::from_scaled_axis(sway::Vector::new(0.0, 0.0, 0.8));
            segment.joint.rotation = (nalgebra::Rotation3::from_scaled_axis(turn) * lean).into_inner();
        }
        skeleton.push(segment);
    }
    skeleton
}

/// Seconds of a step at the default tolerance, rejected ones included; the best of some stretches of a tenth of a second.
fn step_time(method: Method, segments: usize) -> Result<f64, sway::Error> {
    let skeleton = plants(segments);
    let settings = sway::Settings { method, ..Default::default() };
    let breeze =
        |point: sway::Vector, time: f64| sway::Vector::new(2.0 + (time + point.x).sin(), 0.0, 0.3 * point.y);
    let (mut solver, mut state) = (Solver::new(settings), State::at_rest(&skeleton));
    let (mut best, begun, mut time) = (f64::INFINITY, Instant::now(), 0.0);
    while begun.elapsed().as_secs_f64() < MEASURED {
        let (before, made) = (Instant::now(), solver.counts());
        solver.advance(&mut state, time, time + 0.1, &mut Fixed(&skeleton), &breeze, |_| ())?;
        let steps = solver.counts().steps + solver.counts().rejected - made.steps - made.rejected;
        best = best.min(before.elapsed().as_secs_f64() / steps.max(1) as f64);
        time += 0.1;
    }
    Ok(best)
}

/// Seconds for an instant of the wind, and for a place at an instant in all lattices and in one, the best of some.
fn wind_time() -> Result<(f64, [f64; 2]), wind::Error> {
    let field = Field::new(Description {
        turbulence: 0.3,
        scale: 4.0,
        roughness: Some(0.03),
        ..Description::new(nalgebra::Vector3::x(), 5.0)
    })?;
    let (mut instant, mut samples) = (f64::INFINITY, [f64::INFINITY; 2]);
    let (begun, mut time) = (Instant::now(), 0.0);
    while begun.elapsed().as_secs_f64() < MEASURED {
        time += 0.1;
        let before = Instant::now();
        let wind = field.at(time)?;
        instant = instant.min(before.elapsed().as_secs_f64());
        for (sample, wind) in samples.iter_mut().zip([&wind, &wind::study::first_lattice(&wind)]) {
            let before = Instant::now();
            for i in 0..2000 {
                let i = f64::from(i);
                let place =
                    nalgebra::Vector3::new((0.37 * i) % 5.0, 1.0 + (0.11 * i) % 2.0, (0.73 * i) % 3.0);
                black_box(wind.velocity(black_box(place)));
            }
            *sample = sample.min(before.elapsed().as_secs_f64() / 2000.0);
        }
    }
    Ok((instant, samples))
}

/// Statistics of the wind, and exact cases of other parts with their names, as CSV.
pub fn surroundings_csv(wind: &[wind::study::Row], exact: &[(&str, &[Convergence])]) -> String {
    let quoted = |name: &str| format!("\"{}\"", name.replace('"', "\"\""));
    let mut out = "part,case,resolution,value,expected,error,bound,order\n".to_owned();
    for row in wind {
        let wind::study::Row { name, value, expected, error, bound } = row;
        out += &format!("wind,{},,{value:e},{expected:e},{error:e},{bound:e},\n", quoted(name));
    }
    for (part, rows) in exact {
        for row in *rows {
            let Convergence { case, resolution, value, expected, error, order } = row;
            let order = order.map_or(String::new(), |order| order.to_string());
            let case = quoted(case);
            out += &format!("{part},{case},{resolution:e},{value:e},{expected:e},{error:e},,{order}\n");
        }
    }
    out
}
