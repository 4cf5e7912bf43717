//! Exact cases, the ball in the net, methods side by side, hard cases, random passes of solids, and speed of sheets, as tables.

use dlsys_sheet::study::{
    Coupling, HardCase, METHOD_CASES, RandomPass, catch, methods, paces, random_pass, throw_steps,
};
use dlsys_sheet::{self as sheet, Method, Settings};
use dlsys_sim::brief;
use dlsys_wind::study::Convergence;

use super::table::{Table, duration, exact_table};

/// Radius in m of the open end of the net: half that of the ball.
const END: f64 = 0.06;

/// Exact cases of sheets as a table. The order is that from the line above.
pub fn exact_sheet_table(rows: &[Convergence]) -> String {
    let title = "sheets: exact cases, by number of pieces, steps, or tolerance";
    exact_table(title, rows, |resolution| format!("{resolution:.1e}"))
}

/// The ball of 0.68 kg in the net of 0.03 kg of O'Brien, Zordan and Hodgins: errors by the length of the step, and forces and accelerations as in their
/// table I.
///
/// # Errors
/// An error of the solver, which is a defect.
pub fn net_table() -> Result<String, sheet::Error> {
    let mut out = "sheets: a ball of 0.68 kg in a net of 0.03 kg; errors in mm against a tolerance of 1e-4\n"
        .to_owned();
    let mut table = Table::default();
    let titles = ["", "ball", "net", "steps", "tried", "least N", "most N", "mean N", "m/s²", "most", "mean"];
    table.push(titles.map(str::to_owned));
    let mut push = |name: String, errors: Option<[f64; 2]>, found: &sheet::study::Catch| {
        let [forces, accelerations] = found.table();
        let error = |k: usize| errors.map_or(String::new(), |errors| brief(errors[k] * 1e3, 3));
        let tried = found.steps[0] + found.steps[1];
        let [least, most, mean] = forces.map(|value| brief(value, 3));
        let [least_a, most_a, mean_a] = accelerations.map(|value| brief(value, 3));
        let steps = [found.steps[0].to_string(), tried.to_string()];
        let [steps, tried] = steps;
        table.push([name, error(0), error(1), steps, tried, least, most, mean, least_a, most_a, mean_a]);
    };
    for (name, coupling) in [("both ways", Coupling::TwoWay), ("one way", Coupling::OneWay)] {
        for (step, errors, found) in throw_steps(coupling, END)? {
            push(format!("{name}, steps of {} ms", brief(step * 1e3, 3)), Some(errors), &found);
        }
        for tolerance in [1e-2, 1e-3] {
            let found = catch(coupling, END, Settings { tolerance, ..Settings::default() })?;
            push(format!("{name}, tolerance {tolerance:e}"), None, &found);
        }
    }
    table.write("  ", &mut out);
    Ok(out)
}

/// Error of places against work of the implicit methods, side by side.
///
/// # Errors
/// An error of the solver, which is a defect.
pub fn sheet_method_table() -> Result<String, sheet::Error> {
    let mut out = "sheets: error of places against work, relative to the extent; sdirk2 is the method in use, euler for comparison\n".to_owned();
    let mut table = Table::default();
    table.push(["", "", "tolerance", "error", "steps", "rejected", "time", ""].map(str::to_owned));
    for case in &METHOD_CASES {
        let mut before = "";
        for row in methods(case)? {
            let name = if row.case == before { "" } else { row.case };
            before = row.case;
            let method = match row.method {
                Method::Sdirk2 => "sdirk2",
                Method::Euler => "euler",
            };
            let [steps, rejected] = row.steps.map(|count| count.to_string());
            let (tolerance, error) = (format!("{:e}", row.tolerance), format!("{:.1e}", row.error));
            let last = String::new();
            table.push([
                name.to_owned(),
                method.to_owned(),
                tolerance,
                error,
                steps,
                rejected,
                duration(row.seconds),
                last,
            ]);
        }
    }
    table.write("  ", &mut out);
    Ok(out)
}

/// Hard cases of sheets as a table.
pub fn hard_sheet_table(cases: &[HardCase]) -> String {
    let mut out = "sheets: a ball drives them too far or hits them too fast, at the default tolerance of 1e-3; depth in radii of the ball, ways in extents of the sheet, gain of energy in parts of that of the ball\n".to_owned();
    let mut table = Table::default();
    let heads = ["", "seconds", "steps", "rejected", "shortest", "depth", "moved", "at the end", "gain", ""];
    table.push(heads.map(str::to_owned));
    for case in cases {
        let [steps, rejected] = case.steps.map(|count| count.to_string());
        let [moved, last] = case.moved.map(|way| brief(way, 3));
        table.push([
            case.case.to_owned(),
            brief(case.span, 3),
            steps,
            rejected,
            format!("{:.1e} s", case.shortest),
            brief(case.depth, 2),
            moved,
            last,
            case.gain.map_or(String::new(), |gain| format!("{gain:.0e}")),
            if case.failure.is_some() { "fails" } else { "" }.to_owned(),
        ]);
    }
    table.write("  ", &mut out);
    for (case, error) in cases.iter().filter_map(|case| Some((case.case, case.failure.as_ref()?))) {
        out += &format!("  {case}: {error}\n");
    }
    out
}

/// Solids that move through sheets at random.
#[derive(Clone, Debug)]
pub struct Passes {
    ended: Vec<RandomPass>,
    /// Number of passes that the solver refused.
    refused: usize,
}

/// Largest depth of a sheet in a solid after a step, in radii of its rounding: the bound of the solver.
const DEEPEST: f64 = 0.4;

impl Passes {
    /// This many passes. One that the solver refuses counts as failed.
    pub fn new(count: u64) -> Passes {
        let ended: Vec<_> = (0..count).filter_map(|seed| random_pass(seed).ok()).collect();
        Passes { refused: count as usize - ended.len(), ended }
    }

    /// Number of solids that went through a sheet, or too deep into it.
    pub fn failed(&self) -> usize {
        self.refused + self.ended.iter().filter(|pass| pass.pierced || pass.depth > DEEPEST).count()
    }

    /// One line for each quantity.
    pub fn table(&self) -> String {
        let most = |of: fn(&RandomPass) -> f64| self.ended.iter().map(of).fold(0.0, f64::max);
        let count = self.ended.len() + self.refused;
        let touched = self.ended.iter().filter(|pass| pass.touched).count();
        let pierced = self.ended.iter().filter(|pass| pass.pierced).count();
        let mut out =
            "sheets: balls and boxes that move into a sheet at random, at up to 100 of their lengths in a tick of 1/60 s\n"
                .to_owned();
        let mut table = Table::default();
        let rows = [
            ("touched", format!("{touched} of {count}")),
            ("refused", format!("{} of {count}", self.refused)),
            ("passed through", format!("{pierced} of {count}")),
            ("deepest, in radii of the rounding", brief(most(|pass| pass.depth), 2)),
            ("steps in a pass, at most", brief(most(|pass| (pass.steps[0] + pass.steps[1]) as f64), 6)),
        ];
        for (name, value) in rows {
            table.push([name.to_owned(), value]);
        }
        table.write("  ", &mut out);
        out
    }
}

/// Measures the cost of steps.
///
/// # Errors
/// An error of the solver, which is a defect.
pub fn sheet_speed_table() -> Result<String, sheet::Error> {
    let mut out = "sheets: speed of a flag in the wind at the default tolerance, on one thread\n".to_owned();
    let mut table = Table::default();
    for pace in paces()? {
        let steps = format!("steps a second, {} iterations each", brief(pace.iterations, 3));
        table.push([
            format!("{} points", pace.points),
            brief(pace.seconds * 1e6, 3),
            "µs a point and step".to_owned(),
            brief(pace.steps, 3),
            steps,
        ]);
    }
    table.write("  ", &mut out);
    Ok(out)
}
