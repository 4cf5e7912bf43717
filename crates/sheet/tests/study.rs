//! The exact cases: errors and orders of the study.

use dlsys_sheet::study::{self, Coupling};
use dlsys_sheet::{Error, Settings};
use dlsys_wind::study::Convergence;

/// Errors fall from row to row, and the last one of a case is below `most`.
fn check(rows: &[Convergence], most: f64) {
    for (index, row) in rows.iter().enumerate() {
        match rows.get(index + 1).filter(|next| next.case == row.case) {
            Some(next) => assert!(next.error <= row.error.max(1e-8), "{next:?}"),
            None => assert!(row.error < most, "{row:?}"),
        }
    }
}

fn orders(rows: &[Convergence], range: std::ops::Range<f64>) {
    assert!(rows.iter().all(|row| row.order.is_none_or(|order| range.contains(&order))), "{rows:?}");
}

#[test]
fn stiffness_does_not_depend_on_the_mesh() -> Result<(), Error> {
    for rows in [study::stretch()?, study::stretched_cord()?] {
        assert!(rows.iter().all(|row| row.error < 1e-6), "{rows:?}");
    }
    Ok(())
}

#[test]
fn sheets_and_cords_sag_as_formulas_say() -> Result<(), Error> {
    for rows in [study::hanging_cord()?, study::membrane()?, study::cantilever()?] {
        check(&rows, 5e-3);
        orders(&rows, 1.6..2.6);
    }
    Ok(())
}

#[test]
fn sheets_move_as_formulas_say() -> Result<(), Error> {
    let rows = study::vibration()?;
    check(&rows, 2e-3);
    orders(&rows, 1.8..2.4);
    // A cord that no step resolves: order 1.
    check(&study::pendulum()?, 2e-3);
    check(&study::fall()?, 1e-4);
    Ok(())
}

#[test]
fn collisions_keep_momentum_and_make_no_energy() -> Result<(), Error> {
    let rows = study::collision()?;
    let (angular, exact): (Vec<_>, Vec<_>) = rows.into_iter().partition(|row| row.case.contains("angular"));
    assert!(exact.iter().all(|row| row.error < 1e-8), "{exact:?}");
    // Linear momentum is kept to rounding, angular momentum to the tolerance.
    check(&angular, 1e-5);
    Ok(())
}

#[test]
fn a_trampoline_gives_no_more_than_it_got() -> Result<(), Error> {
    let rows = study::trampoline()?;
    assert!(rows.iter().all(|row| row.error < 1e-6), "{rows:?}");
    Ok(())
}

#[test]
fn sheets_rest_on_a_floor() -> Result<(), Error> {
    let rows = study::floor()?;
    assert!(rows.iter().all(|row| row.error < 1e-3), "{rows:?}");
    Ok(())
}

/// Steps of 1/60, 1/240 and 1/960 s: the ball stays within 5 cm of its path, and the error falls.
#[test]
fn a_ball_in_a_net_is_followed_with_long_steps() -> Result<(), Error> {
    let rows = study::throw_steps(Coupling::TwoWay, 0.06)?;
    assert!(rows[0].1[0] < 0.05 && rows[0].1[1] < 0.08, "{:?}", rows[0].1);
    assert!(rows.windows(2).all(|pair| pair[1].1[0] < pair[0].1[0]), "{rows:?}");
    Ok(())
}

/// One way, the ball drives the net as far as it flies; steps are longer than 1/240 s in the mean.
#[test]
fn a_ball_in_a_net_is_followed_both_ways_and_one_way() -> Result<(), Error> {
    for coupling in [Coupling::TwoWay, Coupling::OneWay] {
        for end in [0.1, 0.06] {
            let settings = Settings { tolerance: 1e-2, ..Settings::default() };
            let found = study::catch(coupling, end, settings)?;
            assert!(found.depth <= 0.048 && found.table()[0][1] > 1.0, "{:?}", found.table());
            assert!(found.net.iter().flatten().all(|point| point.norm() < 20.0));
            assert!(found.steps[0] + found.steps[1] <= 168, "{:?}", found.steps);
        }
    }
    Ok(())
}

#[test]
fn nothing_passes_through_a_sheet() -> Result<(), Error> {
    let (mut touched, mut failed) = (0, Vec::new());
    for seed in 0..30 {
        match study::random_pass(seed) {
            Ok(pass) => {
                assert!(!pass.pierced && pass.depth <= 0.4, "{pass:?}");
                touched += u32::from(pass.touched);
            }
            Err(error) => failed.push((seed, error.to_string())),
        }
    }
    assert!(touched > 15 && failed.is_empty(), "{touched} {failed:#?}");
    Ok(())
}
