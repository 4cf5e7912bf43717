//! Exact cases and speed of gases, as tables.

use dlsys_gas as gas;
use dlsys_sim::brief;
use dlsys_wind::study::Convergence;

use super::table::{Table, exact_table};

/// Exact cases of gases as a table. The order is that from the line above.
pub fn exact_gas_table(rows: &[Convergence]) -> String {
    let title = "gas: exact cases, by tolerance, length of a tick, or what is refined";
    exact_table(title, rows, |resolution| format!("{resolution:.1e}"))
}

/// Measures the cost of clouds and of light through them.
///
/// # Errors
/// An error of a cloud, which is a defect.
pub fn gas_speed_table() -> Result<String, gas::Error> {
    let mut out =
        "gas: speed of plumes in turbulence, ticks of 1/64 s, and of light on one thread\n".to_owned();
    let mut table = Table::default();
    for gas::study::Speed { name, value, unit } in gas::study::speeds()? {
        table.push([name, brief(value, 3), unit.to_owned()]);
    }
    table.write("  ", &mut out);
    Ok(out)
}
