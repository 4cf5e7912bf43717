//! Studies and hard cases as tables for a terminal.

use std::fmt::Write;

use super::hard::CaseResult;
use super::record::Accuracy;
use super::study::{Outcome, Series, Study};
use dlsys_sim::brief;
use dlsys_wind::study::Convergence;

/// A table whose columns are as wide as what stands in them. All but the first and last are set to the right.
#[derive(Default)]
pub(super) struct Table {
    rows: Vec<Vec<String>>,
}

impl Table {
    pub fn push<const N: usize>(&mut self, row: [String; N]) {
        self.rows.push(row.into());
    }

    pub fn write(&self, indent: &str, out: &mut String) {
        let width = |column: usize| {
            let cells = self.rows.iter().filter_map(|row| row.get(column));
            cells.map(|cell| cell.chars().count()).max().unwrap_or(0)
        };
        for row in &self.rows {
            let mut line = indent.to_owned();
            for (column, cell) in row.iter().enumerate() {
                let (width, last) = (width(column), column + 1 == row.len());
                let _ = match (column, last) {
                    (_, true) => write!(line, "  {cell}"),
                    (0, _) => write!(line, "{cell:<width$}"),
                    _ => write!(line, "  {cell:>width$}"),
                };
            }
            out.push_str(line.trim_end());
            out.push('\n');
        }
    }
}

/// Exact cases as a table, with a title of its own. The order is that from the line above.
pub(super) fn exact_table(title: &str, rows: &[Convergence], resolution: fn(f64) -> String) -> String {
    let mut table = Table::default();
    table.push(["", "", "value", "exact", "error", "order"].map(str::to_owned));
    let mut before = "";
    for row in rows {
        let name = if row.case == before { "" } else { row.case };
        before = row.case;
        table.push([
            name.to_owned(),
            resolution(row.resolution),
            brief(row.value, 8),
            brief(row.expected, 8),
            format!("{:.1e}", row.error),
            row.order.map_or(String::new(), |order| format!("{order:.2}")),
        ]);
    }
    let mut out = format!("{title}\n");
    table.write("  ", &mut out);
    out
}

/// A whole study.
pub fn study_table(study: &Study) -> String {
    let mut out = study_head(study);
    for series in &study.series {
        out.push_str(&series_table(series));
    }
    out
}

/// What is studied, in a line.
pub fn study_head(study: &Study) -> String {
    let n = study.times.len();
    let (first, last) = (study.times.first().unwrap_or(&0.0), study.times.last().unwrap_or(&0.0));
    let when = match n {
        1 => format!("at t = {}", brief(*last, 6)),
        _ => format!("at {n} times from t = {} to {}", brief(*first, 6), brief(*last, 6)),
    };
    let (events, modules) = (thousands(study.events), thousands(study.modules));
    format!("{}, {when}: {events} productions, {modules} modules at the end\n", study.title)
}

/// The block of a method: its order, a line for each point, and its reference.
pub fn series_table(series: &Series) -> String {
    let mut out = format!("\n{}  {}\n", series.name, order_text(series));
    let mut table = Table::default();
    let accuracy = series.points.first().map_or("", |point| match point.accuracy {
        Accuracy::Tolerance(_) => "tolerance",
        Accuracy::StepSize(_) => "step size",
        Accuracy::Slice(_) => "slice",
    });
    let heads = [accuracy, "error", "time", "spread", "steps", "rejected", "rhs", "events", "modules", ""];
    table.push(heads.map(str::to_owned));
    for point in &series.points {
        let accuracy = point.accuracy.to_string();
        table.push(match &point.result {
            Ok(outcome) => cells(accuracy, outcome),
            Err(seconds) => {
                let mut row: [String; 10] = std::array::from_fn(|_| String::new());
                row[0] = accuracy;
                row[9] = format!("left out: would take about {}", duration(*seconds));
                row
            }
        });
    }
    table.write("  ", &mut out);
    for point in &series.points {
        if let Some(detail) = point.result.as_ref().ok().and_then(|outcome| outcome.agreement.detail()) {
            let _ = writeln!(out, "  {accuracy} {}: {detail}", point.accuracy);
        }
    }
    let _ = writeln!(out, "  reference: {}", series.reference);
    out
}

fn cells(accuracy: String, outcome: &Outcome) -> [String; 10] {
    let Outcome { error, agreement, wall, stats } = outcome;
    let spread = match wall.runs {
        1 => "1 run".to_owned(),
        _ => format!("±{:.0}%", 100.0 * wall.spread()),
    };
    [
        accuracy,
        error.map_or("-".to_owned(), error_text),
        duration(wall.median),
        spread,
        thousands(stats.steps),
        thousands(stats.rejected),
        thousands(stats.rhs_evaluations),
        thousands(stats.events),
        thousands(stats.modules),
        agreement.verdict(),
    ]
}

/// `order 5, observed 4.9`
pub(super) fn order_text(series: &Series) -> String {
    let observed = series.observed.map(|p| format!("observed {p:.1}"));
    let nominal = series.order.map(|p| format!("order {p}"));
    let both: Vec<String> = nominal.into_iter().chain(observed).collect();
    if both.is_empty() { "order not seen".to_owned() } else { both.join(", ") }
}

pub(super) fn error_text(error: f64) -> String {
    if error == 0.0 { "0".to_owned() } else { format!("{error:.1e}") }
}

/// Seconds with three digits and a unit.
pub(super) fn duration(seconds: f64) -> String {
    let (value, unit) = match seconds {
        s if s < 1e-3 => (s * 1e6, "µs"),
        s if s < 1.0 => (s * 1e3, "ms"),
        s => (s, "s"),
    };
    let decimals = if value < 10.0 { 2 } else { usize::from(value < 100.0) };
    format!("{value:.decimals$} {unit}")
}

/// Digits in groups of three, with narrow gaps that no terminal breaks.
fn thousands(n: u64) -> String {
    let digits = n.to_string();
    let mut out = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) && digits.len() > 4 {
            out.push('\u{202f}');
        }
        out.push(digit);
    }
    out
}

/// Hard cases: one line for each run.
pub fn hard_table(rows: &[CaseResult]) -> String {
    let mut table = Table::default();
    let heads =
        ["case", "group", "method", "tolerance", "error", "of allowed", "steps", "events", "time", ""];
    table.push(heads.map(str::to_owned));
    for row in rows {
        table.push([
            row.case.clone(),
            row.group.clone(),
            row.method.to_owned(),
            format!("{:e}", row.tolerance),
            row.error.map_or("-".to_owned(), error_text),
            row.ratio.map_or("-".to_owned(), ratio_text),
            thousands(row.stats.steps),
            thousands(row.stats.events),
            duration(row.seconds),
            if row.mismatches.is_empty() { "pass".to_owned() } else { format!("FAIL: {}", row.summary()) },
        ]);
    }
    let mut out = String::new();
    table.write("", &mut out);
    out
}

fn ratio_text(ratio: f64) -> String {
    match ratio {
        0.0 => "0".to_owned(),
        r if (1e-3..1e3).contains(&r) => brief(r, 2),
        r => format!("{r:.0e}"),
    }
}

/// What was not as it should be in these rows: expected, found, where.
pub fn mismatches(rows: &[CaseResult]) -> String {
    let mut out = String::new();
    for row in rows {
        for mismatch in &row.mismatches {
            let CaseResult { case, method, tolerance, file, .. } = row;
            let _ = writeln!(out, "\n{case}, {method} at tolerance {tolerance:e}: {}", mismatch.what);
            let _ = writeln!(out, "  --> {file}:{}", mismatch.line);
            let _ = writeln!(out, "  expected: {}", mismatch.expected);
            let _ = writeln!(out, "  found:    {}", mismatch.found);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_for_people() {
        assert_eq!([3.2e-6, 0.01234, 12.0].map(duration), ["3.20 µs", "12.3 ms", "12.0 s"]);
        assert_eq!(
            [7, 1234, 12345, 1234567].map(thousands),
            ["7", "1234", "12\u{202f}345", "1\u{202f}234\u{202f}567"]
        );
        assert_eq!([0.0, 0.0312, 12345.6].map(ratio_text), ["0", "0.031", "1e4"]);
    }

    #[test]
    fn columns_are_aligned() {
        let mut table = Table::default();
        table.push(["a", "bb", ""].map(str::to_owned));
        table.push(["ααα", "1", "x"].map(str::to_owned));
        let mut out = String::new();
        table.write("  ", &mut out);
        assert_eq!(out, "  a    bb\n  ααα   1  x\n");
    }
}
