//! Exact cases and speed of ground, as tables.

use dlsys_ground as ground;
use dlsys_sim::brief;
use dlsys_wind::study::Convergence;

use super::table::{Table, exact_table};

/// Exact cases of ground as a table. The order is that from the line above.
pub fn exact_ground_table(rows: &[Convergence]) -> String {
    let title = "ground: exact cases, by number of columns or of portions";
    exact_table(title, rows, |resolution| brief(resolution, 4))
}

/// The law of slipping and the rules of the papers side by side.
///
/// # Errors
/// An error of a ground, which is a defect.
pub fn ground_rule_table() -> Result<String, ground::Error> {
    let mut out = format!(
        "ground: the law and the rules of the papers; differences from the exact heaps in volumes, repose {}°\n",
        brief(ground::study::repose(), 4)
    );
    let mut table = Table::default();
    let heads = [
        "",
        "columns",
        "cylinder",
        "cone",
        "in 10 portions",
        "bias at 45°",
        "rests at",
        "and at 45°",
        "volume",
        "column updates",
        "seconds",
    ];
    table.push(heads.map(str::to_owned));
    for row in ground::study::rules()? {
        let ground::study::RuleRow { rule, columns, cylinder, cone, bias, rest, imbalance, updates, seconds } =
            row;
        let error = |value: f64| format!("{value:.1e}");
        let angle = |value: f64| format!("{value:.1}°");
        table.push([
            if columns == 8 { rule.name().to_owned() } else { String::new() },
            columns.to_string(),
            error(cylinder),
            error(cone[0]),
            error(cone[1]),
            format!("{:+.1} %", 100.0 * bias),
            angle(rest[0]),
            angle(rest[1]),
            imbalance.to_string(),
            updates.to_string(),
            brief(seconds, 2),
        ]);
    }
    table.write("  ", &mut out);
    Ok(out)
}

/// The hard cases as a table.
pub fn hard_ground_table(cases: &[ground::study::HardCase]) -> String {
    let mut out = "ground: hard cases, until everything is at rest\n".to_owned();
    let mut table = Table::default();
    table.push(["", "sweeps", "column updates", "volume", "seconds", ""].map(str::to_owned));
    for case in cases {
        table.push([
            case.case.to_owned(),
            case.sweeps.to_string(),
            case.updates.to_string(),
            case.imbalance.to_string(),
            brief(case.seconds, 2),
            if case.failure.is_some() { "fails" } else { "" }.to_owned(),
        ]);
    }
    table.write("  ", &mut out);
    for (case, error) in cases.iter().filter_map(|case| Some((case.case, case.failure.as_ref()?))) {
        out += &format!("  {case}: {error}\n");
    }
    out
}

/// Measures the cost of sweeps and of scenes.
///
/// # Errors
/// An error of a ground, which is a defect.
pub fn ground_speed_table() -> Result<String, ground::Error> {
    let mut out = "ground: speed\n".to_owned();
    let mut table = Table::default();
    for ground::study::Speed { name, value, unit } in ground::study::speeds()? {
        table.push([name, brief(value, 3), unit.to_owned()]);
    }
    table.write("  ", &mut out);
    Ok(out)
}
