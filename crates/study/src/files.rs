//! Studies and hard cases as CSV and JSON.

use serde_json::{Value, json};

use super::compare::{Agreement, Difference};
use super::hard::CaseResult;
use super::study::{Point, Series, Study};
use dlsys_render::GENERATOR;

/// Columns of the CSV file of a study.
const COLUMNS: [&str; 20] = [
    "model",
    "method",
    "order",
    "observed_order",
    "accuracy",
    "accuracy_value",
    "verdict",
    "error",
    "wall_median_s",
    "wall_min_s",
    "wall_max_s",
    "runs",
    "steps",
    "rejected",
    "rhs_evaluations",
    "events",
    "modules",
    "reference",
    "reference_error",
    "detail",
];

/// A study as comma-separated values (RFC 4180): a line for each point, points left out included. Times are
/// in seconds; an empty field means that there is no such number.
pub fn csv(study: &Study) -> String {
    let mut out = line(COLUMNS.map(str::to_owned));
    for series in &study.series {
        for point in &series.points {
            out += &line(fields(study, series, point));
        }
    }
    out
}

fn fields(study: &Study, series: &Series, point: &Point) -> [String; 20] {
    let outcome = point.result.as_ref().ok();
    let wall =
        |of: fn(&super::study::Wall) -> f64| outcome.map_or(String::new(), |o| of(&o.wall).to_string());
    let count =
        |of: fn(&dlsys_sim::Stats) -> u64| outcome.map_or(String::new(), |o| of(&o.stats).to_string());
    let number = |x: Option<f64>| x.map_or(String::new(), |x| format!("{x:e}"));
    let (verdict, detail) = match &point.result {
        Ok(outcome) if outcome.agreement.is_right() => ("right", String::new()),
        Ok(outcome) => (outcome.agreement.key(), outcome.agreement.to_string()),
        Err(seconds) => ("left_out", format!("would take about {seconds:.3} s")),
    };
    [
        study.name.clone(),
        series.name.to_owned(),
        series.order.map_or(String::new(), |p| p.to_string()),
        series.observed.map_or(String::new(), |p| format!("{p:.3}")),
        point.accuracy.key().to_owned(),
        format!("{:e}", point.accuracy.value()),
        verdict.to_owned(),
        number(outcome.and_then(|o| o.error)),
        wall(|w| w.median),
        wall(|w| w.min),
        wall(|w| w.max),
        outcome.map_or(String::new(), |o| o.wall.runs.to_string()),
        count(|s| s.steps),
        count(|s| s.rejected),
        count(|s| s.rhs_evaluations),
        count(|s| s.events),
        count(|s| s.modules),
        series.reference.setup.to_string(),
        number(series.reference.error),
        detail,
    ]
}

/// One line; fields in quotation marks where they need them.
pub(super) fn line<const N: usize>(fields: [String; N]) -> String {
    let quoted = fields.map(|field| match field.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", field.replace('"', "\"\"")),
        false => field,
    });
    quoted.join(",") + "\n"
}

/// A study as JSON; times in seconds, absent numbers are null.
pub fn json(study: &Study) -> String {
    let series: Vec<Value> = study.series.iter().map(series_value).collect();
    let value = json!({
        "generator": GENERATOR,
        "model": study.name,
        "title": study.title,
        "times": study.times,
        "productions": study.events,
        "modules": study.modules,
        "series": series,
    });
    pretty(&value)
}

fn series_value(series: &Series) -> Value {
    let points: Vec<Value> = series.points.iter().map(point_value).collect();
    json!({
        "method": series.name,
        "order": series.order,
        "observed_order": series.observed,
        "reference": {
            "run": series.reference.setup.to_string(),
            "closed_form": series.reference.is_closed_form,
            "error": series.reference.error,
            "error_is": series.reference.check,
        },
        "points": points,
    })
}

fn point_value(point: &Point) -> Value {
    let mut value = json!({ point.accuracy.key(): point.accuracy.value() });
    let more = match &point.result {
        Err(seconds) => json!({ "verdict": "left_out", "expected_s": seconds }),
        Ok(outcome) => json!({
            "verdict": outcome.agreement.key(),
            "difference": agreement_value(&outcome.agreement),
            "error": outcome.error,
            "wall_s": { "median": outcome.wall.median, "min": outcome.wall.min, "max": outcome.wall.max },
            "runs": outcome.wall.runs,
            "counts": outcome.stats,
        }),
    };
    if let (Value::Object(value), Value::Object(more)) = (&mut value, more) {
        value.extend(more);
    }
    value
}

fn agreement_value(agreement: &Agreement) -> Value {
    let difference =
        |d: &Difference| json!({ "production": d.index, "t": d.t, "expected": d.expected, "found": d.found });
    match agreement {
        Agreement::Right => Value::Null,
        Agreement::WrongEventOrder(first) => difference(first),
        Agreement::WrongModules { t, ours, theirs, first } => json!({
            "t": t, "modules": ours, "expected_modules": theirs, "first": first.as_ref().map(difference),
        }),
        Agreement::Failed(message) => json!({ "message": message }),
    }
}

fn pretty(value: &Value) -> String {
    // Values made of strings, numbers and lists are always JSON; a number that is not finite is null.
    serde_json::to_string_pretty(value).unwrap_or_default() + "\n"
}

/// Hard cases as comma-separated values, a line for each run.
pub fn hard_csv(rows: &[CaseResult]) -> String {
    let columns = [
        "case",
        "group",
        "method",
        "tolerance",
        "verdict",
        "error",
        "ratio",
        "steps",
        "rhs_evaluations",
        "events",
        "wall_s",
        "detail",
    ];
    let number = |x: Option<f64>| x.map_or(String::new(), |x| format!("{x:e}"));
    let mut out = line(columns.map(str::to_owned));
    for row in rows {
        out += &line([
            row.case.clone(),
            row.group.clone(),
            row.method.to_owned(),
            format!("{:e}", row.tolerance),
            if row.mismatches.is_empty() { "pass" } else { "fail" }.to_owned(),
            number(row.error),
            number(row.ratio),
            row.stats.steps.to_string(),
            row.stats.rhs_evaluations.to_string(),
            row.stats.events.to_string(),
            row.seconds.to_string(),
            if row.mismatches.is_empty() { String::new() } else { row.summary() },
        ]);
    }
    out
}

/// Hard cases as JSON, an object for each run.
pub fn hard_json(rows: &[CaseResult]) -> String {
    let rows: Vec<Value> = rows
        .iter()
        .map(|row| {
            let mismatches: Vec<Value> = row
                .mismatches
                .iter()
                .map(|m| json!({ "line": m.line, "what": m.what, "expected": m.expected, "found": m.found }))
                .collect();
            json!({
                "case": row.case,
                "group": row.group,
                "file": row.file,
                "method": row.method,
                "tolerance": row.tolerance,
                "error": row.error,
                "ratio": row.ratio,
                "counts": row.stats,
                "wall_s": row.seconds,
                "pass": row.mismatches.is_empty(),
                "mismatches": mismatches,
            })
        })
        .collect();
    pretty(&json!({ "generator": GENERATOR, "rows": rows }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_with_commas_are_quoted() {
        let fields = ["a", "b, c", "\"d\""].map(str::to_owned);
        assert_eq!(line(fields), "a,\"b, c\",\"\"\"d\"\"\"\n");
    }
}
