//! Particles: volume is counted all the way, bodies shed along the exponential, and nothing depends on threads, tiles or what happens far away.

use std::sync::Arc;

use dlsys_ground::study::sphere;
use dlsys_ground::{
    Body, Description, Error, Extent, Flight, Ground, Place, Pour, Relief, Settings, Soil, Vector,
};

type Outcome = Result<(), Error>;

const CELL: f64 = 0.01;
const TICK: f64 = 1.0 / 120.0;

/// Sand that sticks.
fn sticky() -> Soil {
    Soil { stick: 0.002, shed: 0.1, ..Soil::sand() }
}

fn uneven(soil: Soil, settings: Settings) -> Result<Ground, Error> {
    let description = Description {
        cell: CELL,
        extent: Extent { x: [-80, 300], z: [-60, 60] },
        soil,
        bed: Relief::Level(0.0),
        depth: Relief::function(|x, z| 0.1 + 0.01 * (7.0 * x).sin() * (5.0 * z).cos()),
    };
    Ground::new(description, settings)
}

/// A ball of 16 cm that dips into the ground by 5 cm, comes out again at 3 m/s while it moves along x at 1 m/s, and is gone after half a second.
fn dipping(id: u64, at: [f64; 2], tick: u32) -> Option<Body> {
    let (_, triangles) = sphere(Vector::zeros(), 0.08, 24);
    let place = |tick: u32| -> Arc<[Vector]> {
        let t = f64::from(tick) * TICK;
        let up = if t < 0.1 { 0.15 - t } else { 0.05 + 3.0 * (t - 0.1) };
        sphere(Vector::new(at[0] + t, up + 0.08, at[1]), 0.08, 24).0
    };
    (tick < 60).then(|| Body {
        from: place(tick),
        to: place(tick + 1),
        ..Body::still(id, "a ball", triangles, place(0))
    })
}

/// Columns, and particles, of a state as bits.
fn bits(ground: &Ground, x: [i32; 2]) -> Vec<u64> {
    let columns = (x[0]..=x[1]).flat_map(|i| (-60..=60).map(move |k| (i, k)));
    let mut all: Vec<u64> = columns.map(|(i, k)| ground.column(i, k).to_bits()).collect();
    for Flight { place, volume, .. } in ground.flights(ground.time() + 0.4 * TICK) {
        if (f64::from(x[0])..=f64::from(x[1])).contains(&(place.x / CELL)) {
            all.extend([place.x, place.y, place.z, volume].map(f64::to_bits));
        }
    }
    all
}

#[test]
fn volume_is_counted_on_the_ground_on_bodies_and_in_the_air() -> Outcome {
    let loam = Soil { cohesion: 2.0, swell: 0.25, ..sticky() };
    for soil in [sticky(), loam, Soil { stick: 1.0, grain: Some(0.02), ..sticky() }] {
        let mut ground = uneven(soil, Settings::default())?;
        let snow = Pour { id: 1, place: Place::Everywhere, rate: 1e-3 };
        let (mut stuck, mut thrown) = (0.0_f64, 0.0_f64);
        for tick in 0..240 {
            let bodies: Vec<Body> = dipping(1, [0.0; 2], tick).into_iter().collect();
            ground.advance(&[snow], &bodies)?;
            assert_eq!(ground.imbalance(), 0, "tick {tick} of {soil:?}");
            (stuck, thrown) = (stuck.max(ground.sticking()), thrown.max(ground.airborne()));
        }
        assert!(stuck > 2e-5 && thrown > 1e-5, "{stuck} {thrown}");
        assert_eq!((ground.sticking(), ground.airborne(), ground.particles()), (0.0, 0.0, 0));
    }
    Ok(())
}

/// A ball of 40 cm, pressed in to its middle: how much less sticks than on a half of its surface. It loses nothing as long as it does not move.
fn lack(cell: f64) -> Result<f64, Error> {
    let columns = (0.4 / cell).round() as i32;
    let description = Description {
        cell,
        extent: Extent::around(columns),
        soil: Soil { stick: 0.001, ..Soil::snow() },
        bed: Relief::Level(-0.5),
        depth: Relief::Level(0.5),
    };
    let mut ground = Ground::new(description, Settings::default())?;
    let (points, triangles) = sphere(Vector::zeros(), 0.2, 96);
    let still = Body::still(1, "a ball", triangles, points);
    ground.advance(&[], std::slice::from_ref(&still))?;
    let found = ground.sticking();
    for _ in 0..5 {
        ground.advance(&[], std::slice::from_ref(&still))?;
    }
    assert_eq!((ground.sticking(), ground.particles(), ground.imbalance()), (found, 0, 0));
    Ok(1.0 - found / (2.0 * std::f64::consts::PI * 0.2 * 0.2 * 0.001))
}

#[test]
fn what_sticks_is_the_area_that_touches() -> Outcome {
    // A patch touches a quarter of a column above the ground, too.
    let [coarse, fine] = [lack(0.01)?, lack(0.005)?];
    assert!(coarse.abs() < 0.04 && fine.abs() < 0.02, "{coarse} {fine}");
    Ok(())
}

#[test]
fn bits_depend_neither_on_tiles_nor_on_threads_nor_on_what_is_far_away() -> Outcome {
    let run = |settings: Settings, both: bool| -> Result<Vec<u64>, Error> {
        let mut ground = uneven(sticky(), settings)?;
        let mut all = Vec::new();
        for tick in 0..80 {
            let mut bodies: Vec<Body> = dipping(1, [0.0; 2], tick).into_iter().collect();
            bodies.extend(dipping(2, [2.0, 0.1], tick.saturating_sub(3)).filter(|_| both));
            ground.advance(&[], &bodies)?;
            if tick % 9 == 4 {
                all.extend(bits(&ground, [-80, 140]));
            }
        }
        Ok(all)
    };
    let plain = run(Settings::default(), false)?;
    assert_eq!(plain, run(Settings { side: 16, threads: 4, ..Settings::default() }, false)?);
    assert_eq!(plain, run(Settings::default(), true)?);
    Ok(())
}

#[test]
fn a_copy_goes_on_as_the_original_does() -> Outcome {
    let mut ground = uneven(sticky(), Settings::default())?;
    let mut copy = None;
    for tick in 0..70 {
        let bodies: Vec<Body> = dipping(1, [0.0; 2], tick).into_iter().collect();
        if tick == 30 {
            copy = Some(ground.clone());
        }
        ground.advance(&[], &bodies)?;
        if let Some(copy) = &mut copy {
            copy.advance(&[], &bodies)?;
            assert_eq!(bits(&ground, [-80, 140]), bits(copy, [-80, 140]));
        }
    }
    Ok(())
}

#[test]
fn nothing_sticks_without_a_value_for_it() -> Outcome {
    let run = |soil: Soil| -> Result<(Vec<u64>, u64), Error> {
        let mut ground = uneven(soil, Settings::default())?;
        for tick in 0..80 {
            let bodies: Vec<Body> = dipping(1, [0.0; 2], tick).into_iter().collect();
            ground.advance(&[], &bodies)?;
            assert_eq!((ground.sticking(), ground.particles()), (0.0, 0));
        }
        Ok((bits(&ground, [-80, 140]), ground.updates()))
    };
    assert_eq!(run(Soil::sand())?, run(Soil { shed: 0.01, grain: Some(0.1), ..Soil::sand() })?);
    Ok(())
}

/// A ball is lifted at one speed, and then faster and faster: it keeps all, then sheds the part that its acceleration shakes off.
#[test]
fn what_holds_is_shed_by_acceleration() -> Outcome {
    for (hold, exponent) in [(8.0, 1.0), (8.0, 2.0), (2.0, 3.0)] {
        let soil =
            Soil { stick: 0.002, shed: 0.1, hold: Some(hold), exponent, grain: Some(2e-3), ..Soil::snow() };
        let mut ground = uneven(soil, Settings::default())?;
        let (lift, wait, shake) = (2_u32, 12_u32, 24_u32);
        let place = |tick: u32| -> Arc<[Vector]> {
            let after = |first: u32| f64::from(tick.saturating_sub(first)) * TICK;
            // From when it is shaken on with 4 m/s².
            let up = 3.0 * after(lift) + 0.5 * 4.0 * after(wait).powi(2);
            sphere(Vector::new(0.0, 0.13 + up, 0.0), 0.08, 24).0
        };
        let (_, triangles) = sphere(Vector::zeros(), 0.08, 24);
        let mut kept = Vec::new();
        for tick in 0..shake {
            let still = Body::still(1, "a ball", triangles.clone(), place(tick));
            ground.advance(&[], &[Body { to: place(tick + 1), ..still }])?;
            kept.push(ground.sticking());
            assert_eq!(ground.imbalance(), 0);
        }
        let [first, last] = [kept[lift as usize + 2], kept[wait as usize - 1]];
        assert!(first > 1e-5 && first == last, "{kept:?}");
        let pace = (4.0 / hold).powf(exponent).min(1.0);
        // The first tick with an acceleration has half of it: the mean over the tick before and itself.
        let time = f64::from(shake - wait - 1) * TICK * pace + TICK * (2.0 / hold).powf(exponent).min(1.0);
        let part = kept[shake as usize - 1] / last;
        assert!((part / (-time / 0.1).exp() - 1.0).abs() < 0.02, "{hold} {exponent}: {part} {time}");
    }
    Ok(())
}

#[test]
fn particles_come_to_lie_on_shelves() -> Outcome {
    let mut ground = uneven(sticky(), Settings::default())?;
    let corner = |x: f64, z: f64| Vector::new(x, 0.2, z);
    let points: Arc<[Vector]> =
        [corner(0.0, -0.3), corner(0.0, 0.3), corner(1.0, 0.3), corner(1.0, -0.3)].into();
    let shelf = Body { shelf: true, ..Body::still(9, "a shelf", [[0, 1, 2], [0, 2, 3]].into(), points) };
    for tick in 0..240 {
        // A shelf that comes in below what is in the air.
        let mut bodies: Vec<Body> = dipping(1, [0.0; 2], tick).into_iter().collect();
        bodies.extend(Some(shelf.clone()).filter(|_| tick > 40));
        ground.advance(&[], &bodies)?;
        assert_eq!(ground.imbalance(), 0);
    }
    assert!(ground.carried() > 1e-6 && ground.particles() == 0, "{}", ground.carried());
    Ok(())
}

#[test]
fn impossible_values_and_too_many_particles_are_errors() -> Outcome {
    for soil in [
        Soil { stick: -0.001, ..Soil::sand() },
        Soil { stick: f64::NAN, ..Soil::sand() },
        Soil { shed: 0.0, ..sticky() },
        Soil { grain: Some(0.0), ..sticky() },
        Soil { hold: Some(0.0), ..sticky() },
        Soil { hold: Some(f64::NAN), ..sticky() },
        Soil { exponent: 0.0, ..sticky() },
    ] {
        assert!(matches!(uneven(soil, Settings::default()), Err(Error::Value { .. })), "{soil:?}");
    }
    let mut ground = uneven(Soil { stick: 0.05, grain: Some(2e-4), ..sticky() }, Settings::default())?;
    let mut failed = None;
    for tick in 0..60 {
        let bodies: Vec<Body> = dipping(1, [0.0; 2], tick).into_iter().collect();
        if let Err(error) = ground.advance(&[], &bodies) {
            failed = Some(error);
            break;
        }
    }
    assert!(matches!(failed, Some(Error::Particles { .. })), "{failed:?}");
    Ok(())
}
