//! The exact cases: errors and orders of the study.

use dlsys_gas::study;
use dlsys_wind::study::Convergence;

/// Errors fall from row to row, and the last one of a case is below `most`.
fn check(rows: &[Convergence], most: f64) {
    for (index, row) in rows.iter().enumerate() {
        match rows.get(index + 1).filter(|next| next.case == row.case) {
            Some(next) => assert!(next.error <= row.error.max(1e-11), "{next:?}"),
            None => assert!(row.error < most, "{row:?}"),
        }
    }
}

fn orders(rows: &[Convergence], range: std::ops::Range<f64>) {
    assert!(rows.iter().all(|row| row.order.is_none_or(|order| range.contains(&order))), "{rows:?}");
}

#[test]
fn variance_mass_and_fall_are_exact() -> Result<(), dlsys_gas::Error> {
    for rows in [study::spreading()?, study::decay()?, study::fall()?] {
        assert!(rows.iter().all(|row| row.error < 1e-11), "{rows:?}");
    }
    Ok(())
}

#[test]
fn blobs_go_with_the_wind() -> Result<(), dlsys_gas::Error> {
    check(&study::gust()?, 1e-6);
    check(&study::strain()?, 1e-6);
    let ticks = study::strain_ticks()?;
    check(&ticks, 1e-5);
    orders(&ticks, 3.7..4.3);
    Ok(())
}

#[test]
fn a_rotation_keeps_the_radius_for_a_thousand_turns() -> Result<(), dlsys_gas::Error> {
    check(&study::rotation()?, 1e-4);
    let ticks = study::rotation_ticks()?;
    let radius = ticks.iter().filter(|row| row.case.contains("radius"));
    let radius: Vec<_> = radius.cloned().collect();
    assert!(radius.last().is_some_and(|row| row.error < 1e-4), "{radius:?}");
    check(&ticks, 1e-4);
    Ok(())
}

#[test]
fn light_is_that_of_the_quadrature() -> Result<(), dlsys_gas::Error> {
    check(&study::transmittance()?, 1e-6);
    let light = study::light()?;
    check(&light, 1e-4);
    orders(&light, 1.7..2.4);
    Ok(())
}
