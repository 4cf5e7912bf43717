//! Clouds: births, splits, ends, threads, instants between ticks, errors.

use dlsys_gas::{Blob, Cloud, Error, Gas, Settings, Source, Vector};
use dlsys_wind::Still;

const SMOKE: Gas = Gas { diffusion: 4e-4, decay: 0.4, size: 0.02, mass: 1e-6, fall: -0.2 };

const SETTINGS: Settings = Settings {
    tick: 1.0 / 32.0,
    tolerance: 0.01,
    deepest: 10,
    fixed: false,
    split: f64::INFINITY,
    most_split: 10_000_000,
    seed: 0,
    most: 10_000_000,
    threads: 1,
};

/// Eddies of many sizes, and a jump at x = 1.
fn wind(point: Vector, time: f64) -> Vector {
    let jump = if point.x > 1.0 { 0.5 } else { 0.0 };
    let eddy = |k: f64| {
        Vector::new((k * point.y + time).sin(), (k * point.z).cos(), (k * point.x - 2.0 * time).sin())
    };
    eddy(1.0) * 0.4 + eddy(7.0) * 0.2 + eddy(40.0) * 0.1 + Vector::new(0.5, jump, 0.0)
}

fn sources(tick: u64) -> [Source; 2] {
    let moved = |tick: u64| Vector::new(0.01 * tick as f64, 0.0, 0.0);
    [
        Source { to: moved(tick + 1), ..Source::at(7, moved(tick), 0.1, 900.0) },
        Source::at(8, Vector::new(0.5, 0.5, 0.0), 0.0, 133.3),
    ]
}

fn cloud(threads: usize, ticks: u64) -> Result<Cloud, Error> {
    let mut cloud = Cloud::new(SMOKE, Settings { threads, split: 0.05, ..SETTINGS })?;
    for tick in 0..ticks {
        cloud.advance(&sources(tick), &wind)?;
    }
    Ok(cloud)
}

fn all(cloud: &Cloud) -> Vec<Blob> {
    cloud.blobs().collect()
}

#[test]
fn threads_and_pictures_between_do_not_matter() -> Result<(), Error> {
    let expected = all(&cloud(1, 150)?);
    assert!(expected.len() > 10_000, "{}", expected.len());
    assert!(all(&cloud(2, 150)?) == expected && all(&cloud(5, 150)?) == expected);
    let mut looked = Cloud::new(SMOKE, Settings { threads: 2, split: 0.05, ..SETTINGS })?;
    for tick in 0..150 {
        looked.shown(looked.time() + 0.3 * looked.tick(), &sources(tick), &wind)?;
        looked.advance(&sources(tick), &wind)?;
    }
    assert!(all(&looked) == expected);
    Ok(())
}

/// From picture to picture nothing jumps: not at ticks, and what has begun stays.
#[test]
fn motion_is_continuous() -> Result<(), Error> {
    let gas = Gas { diffusion: 0.0, ..SMOKE };
    let mut cloud = Cloud::new(gas, SETTINGS)?;
    let mut before: Vec<Blob> = Vec::new();
    for tick in 0..40 {
        for part in 0..16 {
            let time = cloud.time() + f64::from(part) / 16.0 * cloud.tick();
            let now = all(&cloud.shown(time, &sources(tick)[1..], &wind)?);
            assert!(now.len() >= before.len());
            for (a, b) in before.iter().zip(&now) {
                assert!((a.centre - b.centre).norm() < 3.0 * cloud.tick() / 16.0 && a.mass > b.mass);
            }
            before = now;
        }
        cloud.advance(&sources(tick)[1..], &wind)?;
    }
    assert!(before.len() > 160);
    Ok(())
}

/// Places at a time between ticks, in ticks of 1/32 s, are those of ticks an eighth as long.
#[test]
fn places_between_ticks_are_those_of_shorter_ticks() -> Result<(), Error> {
    let gas = Gas { diffusion: 0.0, ..SMOKE };
    let source = [Source::at(8, Vector::new(0.5, 0.5, 0.0), 0.0, 133.3)];
    let smooth = |point: Vector, time: f64| wind(Vector::new(point.x - 1e3, point.y, point.z), time);
    let mut short = Cloud::new(gas, Settings { tick: 1.0 / 256.0, tolerance: 1e-4, ..SETTINGS })?;
    while short.time() < 39.5 / 32.0 {
        short.advance(&source, &smooth)?;
    }
    let mut long = Cloud::new(gas, SETTINGS)?;
    for _ in 0..39 {
        long.advance(&source, &smooth)?;
    }
    let long = long.shown(39.5 / 32.0, &source, &smooth)?;
    assert_eq!(long.len(), short.len());
    for (a, b) in long.blobs().zip(short.blobs()) {
        assert!((a.centre - b.centre).norm() < 0.05 * gas.size, "{a:?} {b:?}");
        assert!((a.mass - b.mass).abs() < 1e-12 * b.mass);
    }
    Ok(())
}

/// What a source makes does not depend on the length of ticks.
#[test]
fn births_are_even_in_time_and_uniform_in_place() -> Result<(), Error> {
    let gas = Gas { diffusion: 0.0, decay: 0.0, fall: 0.0, ..SMOKE };
    let source = [Source::at(3, Vector::new(1.0, 2.0, 3.0), 0.5, 777.7)];
    let born = |tick: f64| -> Result<Vec<Blob>, Error> {
        let mut cloud = Cloud::new(gas, Settings { tick, ..SETTINGS })?;
        while cloud.time() < 8.0 {
            cloud.advance(&source, &Still)?;
        }
        Ok(all(&cloud))
    };
    let (long, short) = (born(0.5)?, born(1.0 / 64.0)?);
    assert_eq!(long.len(), 6221);
    assert!(
        long.len() == short.len()
            && long.iter().zip(&short).all(|(a, b)| (a.centre - b.centre).norm() < 1e-12)
    );
    let mean = long.iter().map(|blob| blob.centre).sum::<Vector>() / long.len() as f64;
    assert!((mean - Vector::new(1.0, 2.0, 3.0)).norm() < 0.02, "{mean}");
    assert!(long.iter().all(|blob| (blob.centre - Vector::new(1.0, 2.0, 3.0)).norm() <= 0.5));
    Ok(())
}

/// Blobs end when a thousandth is left: the number becomes constant.
#[test]
fn blobs_end() -> Result<(), Error> {
    let gas = Gas { decay: 10.0, ..SMOKE };
    let mut cloud = Cloud::new(gas, SETTINGS)?;
    let source = [Source::at(3, Vector::zeros(), 0.0, 1000.0)];
    for _ in 0..96 {
        cloud.advance(&source, &Still)?;
    }
    let expected = 1000.0 * gas.life();
    assert!((cloud.len() as f64 - expected).abs() < 1000.0 * cloud.tick(), "{} {expected}", cloud.len());
    assert!(cloud.blobs().all(|blob| blob.mass >= 1e-9));
    Ok(())
}

/// The density after a split is near to that before: the four hold its moments up to the second.
#[test]
fn a_split_is_hardly_seen() -> Result<(), Error> {
    let gas = Gas { diffusion: 1e-3, decay: 0.0, size: 0.02, mass: 1.0, fall: 0.0 };
    let mut cloud = Cloud::new(gas, Settings { split: 0.05, ..SETTINGS })?;
    cloud.add(Vector::zeros(), 1.0)?;
    while cloud.len() == 1 {
        cloud.advance(&[], &Still)?;
    }
    assert_eq!(cloud.len(), 4);
    let whole = Blob { centre: Vector::zeros(), variance: 4e-4 + 2e-3 * cloud.time(), mass: 1.0 };
    let mut worst = 0.0_f64;
    for k in 0..4000 {
        let share = |factor: f64| (f64::from(k) * factor).fract() * 0.4 - 0.2;
        let place = Vector::new(share(0.754_877_666), share(0.569_840_291), share(0.430_159_709));
        let density: f64 = cloud.blobs().map(|blob| blob.density(&place)).sum();
        worst = worst.max((density - whole.density(&place)).abs());
    }
    assert!(worst < 0.4 * whole.density(&Vector::zeros()), "{}", worst / whole.density(&Vector::zeros()));
    Ok(())
}

#[test]
fn bad_values_are_refused() -> Result<(), Error> {
    let refused =
        |gas: Gas, settings: Settings| Cloud::new(gas, settings).err().map(|error| error.to_string());
    let message = refused(Gas { size: 0.0, ..SMOKE }, SETTINGS);
    assert_eq!(message.as_deref(), Some("a size of a blob (m) of 0 is out of range: expected more than 0"));
    assert!(refused(Gas { decay: f64::NAN, ..SMOKE }, SETTINGS).is_some());
    assert!(refused(SMOKE, Settings { split: 0.03, ..SETTINGS }).is_some());
    assert!(refused(SMOKE, Settings { most: 1_000_000_000, ..SETTINGS }).is_some());
    let mut cloud = Cloud::new(SMOKE, SETTINGS)?;
    let flood = [Source::at(1, Vector::zeros(), 0.1, 1e9)];
    assert!(matches!(cloud.advance(&flood, &Still), Err(Error::Blobs { most: 10_000_000, .. })));
    let mut cloud = Cloud::new(SMOKE, Settings { most: 3000, split: 0.05, ..SETTINGS })?;
    let end = (0..400).try_for_each(|tick| cloud.advance(&sources(tick), &wind));
    assert!(matches!(end, Err(Error::Blobs { most: 3000, .. })) && cloud.len() <= 3000);
    let mut cloud = Cloud::new(SMOKE, SETTINGS)?;
    cloud.advance(&sources(0), &wind)?;
    let storm = |_: Vector, _: f64| Vector::repeat(f64::NAN);
    assert!(matches!(cloud.advance(&sources(1), &storm), Err(Error::Wind { .. })));
    assert!(cloud.shown(5.0, &sources(1), &wind).is_err());
    Ok(())
}
