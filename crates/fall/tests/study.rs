//! The exact cases: errors and orders of the study, and the values of the design.

use dlsys_fall::study;
use dlsys_wind::study::Convergence;

/// Errors fall from row to row, and the last one of a case is below `most`.
fn check(rows: &[Convergence], most: f64) {
    for (index, row) in rows.iter().enumerate() {
        match rows.get(index + 1).filter(|next| next.case == row.case) {
            Some(next) => assert!(next.error <= row.error.max(1e-12), "{next:?}"),
            None => assert!(row.error < most, "{row:?}"),
        }
    }
}

#[test]
fn plates_and_seeds_fall() -> Result<(), dlsys_fall::Error> {
    check(&study::terminal_speed()?, 1e-12);
    check(&study::broadside()?, 1e-6);
    let steps = study::broadside_steps()?;
    check(&steps, 2e-6);
    assert!(steps.iter().all(|row| row.order.is_none_or(|order| (order - 3.0).abs() < 0.15)), "{steps:?}");
    Ok(())
}

#[test]
fn plates_flutter_and_tumble() -> Result<(), dlsys_fall::Error> {
    for rows in [study::flutter()?, study::tumble()?] {
        check(&rows, 2e-5);
        assert!(rows.iter().all(|row| row.order.is_none_or(|order| order > 0.85)), "{rows:?}");
    }
    Ok(())
}

/// The second computation has the values that the design notes give for the planar equations.
#[test]
fn planar_equations_have_the_published_behaviour() {
    let flutter = study::planar_flutter(0.5, 5, 15);
    assert!((flutter.period - 6.38).abs() < 0.005 && (flutter.fall - 0.30).abs() < 0.005, "{flutter:?}");
    for from in 0..4 {
        let turn = study::planar_tumble(1.4, 2 + from, 3 + from);
        assert!((12.65..13.05).contains(&turn.period), "{turn:?}");
    }
}

#[test]
fn bodies_land() -> Result<(), dlsys_fall::Error> {
    check(&study::bounce()?, 1e-8);
    check(&study::slide()?, 2e-4);
    check(&study::slide_in_air()?, 2e-4);
    check(&study::roll()?, 1e-8);
    let energy = study::contact_energy()?;
    for row in &energy {
        let most = if row.case.ends_with("contact") { 1e-12 } else { 0.1 * row.resolution };
        assert!(row.error < most, "{row:?}");
    }
    Ok(())
}

#[test]
fn bodies_touch_solids() -> Result<(), dlsys_fall::Error> {
    check(&study::parabola()?, 1e-12);
    check(&study::moving_plate()?, 1e-9);
    check(&study::bounce_on_plate()?, 1e-8);
    check(&study::carry()?, 1e-4);
    check(&study::slope()?, 1e-4);
    Ok(())
}

/// Plates, balls and blocks against plates, posts and boxes, at up to 100 lengths a frame: none passes through another, and no contact makes energy.
#[test]
fn nothing_passes_through_solids() -> Result<(), dlsys_fall::Error> {
    let mut touched = 0;
    for seed in 0..360 {
        let end = study::random_contact(seed, 1e-3)?;
        assert!(!end.pierced && end.depth < 1e-3 && end.gain < 1e-9, "{end:?}");
        assert!(end.steps < 300_000, "{end:?}");
        touched += usize::from(end.touched);
    }
    assert!(touched > 180, "{touched}");
    Ok(())
}

/// Throws at up to 300 m/s, spins of up to 100 rad/s: every body rests, and none is ever deeper than the tolerance of an impact.
#[test]
fn random_throws_rest_above_ground() -> Result<(), dlsys_fall::Error> {
    for seed in 0..120 {
        let end = study::random_landing(seed, 1e-3)?;
        assert!(end.rest.is_some_and(|time| time < 30.0), "{end:?}");
        assert!(end.depth <= 1e-5, "{end:?}");
        assert!(end.impacts < 1000 && end.steps < 100_000, "{end:?}");
    }
    Ok(())
}

/// Slopes of soil: rolling and sliding at their accelerations, first order as all contact; a block that friction holds stays.
#[test]
fn bodies_roll_and_slide_down_soil() -> Result<(), dlsys_fall::Error> {
    let rows = study::roll_on_soil()?;
    check(&rows, 2e-4);
    assert!(rows.iter().all(|row| row.order.is_none_or(|order| order > 0.35)), "{rows:?}");
    check(&study::slope_of_soil()?, 2e-4);
    Ok(())
}
