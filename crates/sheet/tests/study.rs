//! The exact cases: errors and orders of the study.

use dlsys_sheet::study::{self, Coupling};
use dlsys_sheet::{Error, Method, Settings};
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

/// The method of order 2 is nearer with as many steps, and each gets nearer with the tolerance.
#[test]
fn the_method_of_order_two_is_worth_its_work() -> Result<(), Error> {
    let rows = study::methods(&study::METHOD_CASES[0])?;
    let (two, one) = rows.split_at(3);
    assert!(
        two.iter().all(|row| row.method == Method::Sdirk2)
            && one.iter().all(|row| row.method == Method::Euler)
    );
    for pair in two.windows(2).chain(one.windows(2)) {
        assert!(pair[1].error < 0.5 * pair[0].error && pair[1].steps[0] > pair[0].steps[0], "{pair:?}");
    }
    for (two, one) in two.iter().zip(one) {
        assert!(two.error < 0.3 * one.error && two.steps[0] < 2 * one.steps[0], "{two:?} {one:?}");
    }
    assert!(two[2].error < 1e-4 && one[2].error > 1e-3, "{rows:?}");
    Ok(())
}

/// One way, nets are driven to several times their length; both ways, they are hit at a hundred lengths a frame.
#[test]
fn nets_that_are_driven_too_far_stay_stable() -> Result<(), Error> {
    for case in study::hard_cases()? {
        assert!(case.failure.is_none(), "{case:?}");
        assert!(case.steps[0] + case.steps[1] < 20_000, "{case:?}");
        if case.case.contains("held") {
            assert!(
                case.moved[0] > 1.0 && (case.moved[1] - case.moved[0]).abs() < 0.2 * case.moved[0],
                "{case:?}"
            );
        }
    }
    Ok(())
}
