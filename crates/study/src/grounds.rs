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
