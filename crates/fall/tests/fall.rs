//! Falls as functions of time: any order, limits, errors.

use dlsys_fall::{Body, Contact, Error, Fall, Ground, Motion, Settings, Still, Vector};

fn wind(point: Vector, time: f64) -> Vector {
    Vector::new(1.0 + (2.0 * time + point.x).sin(), 0.2 * point.y.cos(), 0.3)
}

fn petal() -> Result<Fall, Error> {
    let mut release = Motion::at(Vector::new(0.0, 1.0, 0.0));
    release.velocity = Vector::new(0.3, 0.2, -0.1);
    release.spin = Vector::new(1.0, 5.0, 2.0);
    Fall::new(Body::plate(3e-5, [0.012, 0.01])?, release, 0.25, Some(Ground::at(0.0)), Settings::default())
}

#[test]
fn any_order_of_times_gives_the_same_bits() -> Result<(), Error> {
    let times: Vec<f64> = (0..800).map(|k| f64::from(k) * 0.00713).collect();
    let mut forward = petal()?;
    let expected = times.iter().map(|time| forward.at(*time, &wind)).collect::<Result<Vec<_>, _>>()?;
    assert!(forward.rest().is_some() && forward.impacts() > 0);
    let mut jumping = petal()?;
    for k in 0..800 {
        let index = (k * 337 + 500) % 800;
        assert_eq!(jumping.at(times[index], &wind)?, expected[index], "{}", times[index]);
    }
    // With few steps, with all of them, and with another number on the way.
    for most in [1, 7, 1000] {
        let mut keeping = petal()?;
        keeping.keep_steps(most);
        for k in 0..800 {
            let index = (k * 337 + 500) % 800;
            assert_eq!(keeping.at(times[index], &wind)?, expected[index], "{most}: {}", times[index]);
            if k == 400 {
                keeping.keep_steps(most / 2);
            }
        }
    }
    // Those that are kept are not computed again.
    let mut keeping = petal()?;
    keeping.keep_steps(1000);
    let calls = std::cell::Cell::new(0);
    let counted = |point: Vector, time: f64| {
        calls.set(calls.get() + 1);
        wind(point, time)
    };
    keeping.at(times[799], &counted)?;
    let before = calls.replace(0);
    times.iter().try_for_each(|time| keeping.at(*time, &counted).map(drop))?;
    assert!(before > 100 && calls.get() == 0, "{before} and {}", calls.get());
    let mut backward = petal()?;
    for index in (0..800).rev() {
        assert_eq!(backward.at(times[index], &wind)?, expected[index], "{}", times[index]);
    }
    for index in (0..800).step_by(97) {
        assert_eq!(petal()?.at(times[index], &wind)?, expected[index]);
    }
    Ok(())
}

/// Neither position nor attitude jumps: neither at steps nor at impacts.
#[test]
fn motion_is_continuous() -> Result<(), Error> {
    let mut fall = petal()?;
    let mut before = fall.at(0.0, &wind)?;
    for k in 1..60_000 {
        let now = fall.at(f64::from(k) * 1e-4, &wind)?;
        let most = 1e-4 * (before.velocity.norm() + now.velocity.norm() + 1.0);
        assert!((now.position - before.position).norm() < most, "at {k}: {now:?}");
        assert!(now.attitude.angle_to(&before.attitude) < 1e-4 * 300.0, "at {k}: {now:?}");
        before = now;
    }
    assert!(fall.rest().is_some());
    Ok(())
}

/// A wind that does not vary carries a petal as if the air were still in a frame that moves with it.
#[test]
fn a_steady_wind_is_a_moving_frame() -> Result<(), Error> {
    let body = Body::plate(3e-5, [0.012, 0.01])?;
    let mut release = Motion::at(Vector::zeros());
    release.spin = Vector::new(1.0, 5.0, 2.0);
    let settings = Settings { tolerance: 1e-7, ..Settings::default() };
    let mut still = Fall::new(body.clone(), release, 0.0, None, settings)?;
    let carry = Vector::new(2.0, 0.5, -1.0);
    release.velocity += carry;
    let mut carried = Fall::new(body, release, 0.0, None, settings)?;
    let [a, b] = [still.at(1.0, &Still)?, carried.at(1.0, &|_: Vector, _: f64| carry)?];
    assert!((b.position - carry - a.position).norm() < 1e-5, "{a:?} {b:?}");
    assert!(a.attitude.angle_to(&b.attitude) < 1e-3);
    Ok(())
}

/// A rod without thickness, one contact at each end, that crosses the ground and comes back within one longest step.
#[test]
fn no_dip_between_samples_is_missed() -> Result<(), Error> {
    let ends = [-0.1, 0.1].map(|x| Contact { point: Vector::new(x, 0.0, 0.0), radius: 0.0 });
    let body = Body::plate(1e-3, [0.1, 0.001])?.touching(ends.to_vec())?;
    let ground = Ground::at(0.0);
    for k in 0..200 {
        let mut release = Motion::at(Vector::new(0.0, 0.1001 + 1e-4 * f64::from(k % 7), 0.0));
        release.velocity.y = 0.0;
        release.spin.y = 40.0 + f64::from(k);
        let mut fall = Fall::new(body.clone(), release, 0.0, Some(ground), Settings::default())?;
        for sample in 0..400 {
            let motion = fall.at(f64::from(sample) * 2.5e-4, &Still)?;
            for end in &ends {
                assert!(motion.point(end.point).y > -1e-5, "{k} {sample} {motion:?}");
            }
        }
    }
    Ok(())
}

#[test]
fn work_is_bounded() -> Result<(), Error> {
    let settings = Settings { steps: 1000, ..Settings::default() };
    let mut fall = Fall::new(Body::ball(1e-3, 0.01)?, Motion::at(Vector::zeros()), 0.0, None, settings)?;
    assert!(matches!(fall.at(1e6, &Still), Err(Error::Steps { steps: 1001, .. })));
    Ok(())
}

#[test]
fn bad_values_are_refused() -> Result<(), Error> {
    assert!(matches!(Body::plate(0.0, [0.1, 0.1]), Err(Error::Value { .. })));
    assert!(matches!(Body::plate(1.0, [f64::NAN, 0.1]), Err(Error::Value { .. })));
    let body = Body::plate(1e-5, [0.01, 0.01])?;
    let release = Motion::at(Vector::zeros());
    let ground = Ground { restitution: 1.5, ..Ground::at(0.0) };
    let refused = Fall::new(body.clone(), release, 0.0, Some(ground), Settings::default());
    let message = refused.err().map(|error| error.to_string());
    assert_eq!(message.as_deref(), Some("a restitution of 1.5 is out of range: expected 0 to 1"));
    let mut fall = Fall::new(body, release, 0.0, None, Settings::default())?;
    let storm = |_: Vector, time: f64| Vector::repeat(if time > 0.5 { f64::NAN } else { 0.0 });
    assert!(fall.at(0.4, &storm).is_ok());
    assert!(matches!(fall.at(1.0, &storm), Err(Error::Wind { .. })));
    assert!(matches!(fall.at(f64::NAN, &Still), Err(Error::Value { .. })));
    Ok(())
}

/// Part of the body is in the ground when it is let go: it stays where it is drawn.
#[test]
fn a_body_in_the_ground_does_not_jump() -> Result<(), Error> {
    let mut release = Motion::at(Vector::new(0.0, -0.05, 0.0));
    release.velocity.x = 0.1;
    let mut fall = Fall::new(
        Body::plate(1e-5, [0.01, 0.01])?,
        release,
        0.0,
        Some(Ground::at(0.0)),
        Settings::default(),
    )?;
    let end = fall.at(5.0, &Still)?;
    assert!(fall.rest().is_some() && (end.position.y + 0.05).abs() < 1e-6, "{end:?}");
    Ok(())
}

/// Plates of 0.1 mm to 3 m, as light as tissue paper or as heavy as steel, in storms: the fall is followed, or an error says that its steps are
/// too many.
#[test]
fn extreme_bodies_end() -> Result<(), Error> {
    let mut followed = 0;
    for k in 0..60 {
        let x = f64::from(k);
        let half = 1e-4 * 10_f64.powf(4.5 * (x * 0.618).fract());
        let heavy = 0.01 * 10_f64.powf(4.0 * (x * 0.4142).fract());
        let body = Body::plate(heavy * half * half * 2.0, [half, half * (0.2 + (x * 0.732).fract())])?;
        let mut release = Motion::at(Vector::new(0.0, 2.0 + 2.0 * half, 0.0));
        release.spin = Vector::new(x.sin(), 3.0 * x.cos(), 1.0);
        let storm = 40.0 * (x * 0.236).fract();
        let wind = move |p: Vector, t: f64| Vector::new(storm * (t + p.x).sin(), 0.1 * storm * t.cos(), 0.0);
        let settings = Settings { steps: 200_000, ..Settings::default() };
        let mut fall = Fall::new(body, release, 0.0, Some(Ground::at(0.0)), settings)?;
        match fall.at(10.0, &wind) {
            Ok(motion) => {
                followed += 1;
                assert!(motion.position.iter().chain(motion.spin.iter()).all(|value| value.is_finite()));
                assert!(motion.position.y > -1e-5 * half, "{k}: {motion:?}");
            }
            Err(Error::Steps { .. }) => {}
            Err(error) => return Err(error),
        }
    }
    assert!(followed >= 50, "{followed}");
    Ok(())
}

#[test]
fn threads_give_the_same_bits() -> Result<(), Error> {
    let mut alone = petal()?;
    let expected = alone.at(1.5, &wind)?;
    let results = std::thread::scope(|scope| {
        let ask = |first: f64| {
            move || petal().and_then(|mut fall| fall.at(first, &wind).and_then(|_| fall.at(1.5, &wind)))
        };
        let threads = [0.3, 4.0].map(|first| scope.spawn(ask(first)));
        threads.map(|thread| thread.join().ok())
    });
    for result in results {
        assert_eq!(result, Some(Ok(expected)));
    }
    Ok(())
}

/// A plate that lies on three contacts, its centre of mass beside them, tips over until a fourth touches the ground. It does not rest before.
#[test]
fn a_body_that_can_tip_over_does_not_rest() -> Result<(), Error> {
    let corners = [[1e-4, -0.01, 0.0], [1e-4, 0.01, 0.0], [0.01, 0.0, 0.0], [-0.01, 0.0, 0.004]];
    let contacts = corners.map(|[x, y, z]| Contact { point: Vector::new(x, y, z), radius: 0.0 });
    let body = Body::plate(1e-4, [0.01, 0.01])?.touching(contacts.to_vec())?;
    let release = Motion::at(Vector::zeros());
    let mut fall = Fall::new(body, release, 0.0, Some(Ground::at(0.0)), Settings::default())?;
    let end = fall.at(10.0, &Still)?;
    assert!(fall.rest().is_some());
    // About the edge at x = 1e-4, by the angle that brings the fourth contact down.
    let tilt = end.turned(Vector::z()).angle(&Vector::y());
    assert!((tilt - (0.004_f64 / 0.0101).atan()).abs() < 1e-3, "{tilt}");
    Ok(())
}

/// What lies still rests at once, whatever the number of its contacts: it need not be watched.
#[test]
fn a_body_that_lies_rests_at_once() -> Result<(), Error> {
    for count in [3, 8, 64] {
        let rim = (0..count).map(|k| {
            let angle = std::f64::consts::TAU * f64::from(k) / f64::from(count);
            Contact { point: Vector::new(0.02 * angle.cos(), 0.01 * angle.sin(), 0.0), radius: 0.0 }
        });
        let body = Body::plate(1e-4, [0.02, 0.01])?.touching(rim.collect())?;
        let release = Motion::at(Vector::new(0.0, 1e-7, 0.0));
        let mut fall = Fall::new(body, release, 0.0, Some(Ground::at(0.0)), Settings::default())?;
        let end = fall.at(1.0, &Still)?;
        assert!(fall.rest().is_some_and(|time| time < 0.05), "{count}: {:?}", fall.rest());
        assert!(end.position.norm() < 1e-6 && end.turned(Vector::z()).y > 1.0 - 1e-9, "{end:?}");
    }
    Ok(())
}
