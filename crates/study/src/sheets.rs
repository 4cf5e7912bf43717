//! Exact cases, the ball in the net, random passes of solids, and speed of sheets, as tables.

use dlsys_sheet::study::{Coupling, RandomPass, catch, paces, random_pass, throw_steps};
use dlsys_sheet::{self as sheet, Settings};
use dlsys_sim::brief;
use dlsys_wind::study::Convergence;

use super::table::{Table, exact_table};

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
    for (step, errors, found) in throw_steps(END)? {
        push(format!("both ways, steps of {} ms", brief(step * 1e3, 3)), Some(errors), &found);
    }
    for (name, coupling) in [("both ways", Coupling::TwoWay), ("one way", Coupling::OneWay)] {
        push(format!("{name}, tolerance 1e-3"), None, &catch(coupling, END, Settings::default())?);
    }
    table.write("  ", &mut out);
    Ok(out)
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
