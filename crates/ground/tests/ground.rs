//! Properties that hold to the last bit: volume, symmetry, and independence of tiles, threads, and what is far away.

use std::sync::Arc;

use dlsys_ground::study::ball;
use dlsys_ground::{Body, Description, Error, Extent, Ground, Place, Pour, Relief, Settings, Soil, Vector};

type Outcome = Result<(), Error>;

/// A number from 0 to 1 for a seed.
fn random(seed: u64) -> f64 {
    let mut bits = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((bits ^ (bits >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}

fn noise(i: i64, k: i64, seed: u64) -> f64 {
    random(
        (i as u64).wrapping_mul(0x1234_5678_9abc_def1)
            ^ (k as u64).wrapping_mul(0xfedc_ba98_7654_3211)
            ^ seed,
    )
}

/// Loose material of random thickness, some of it none, on a random bed.
fn rugged(seed: u64) -> Description {
    let at = |x: f64, z: f64| ((x * 100.0).round() as i64, (z * 100.0).round() as i64);
    Description {
        cell: 0.01,
        extent: Extent::around(40),
        soil: Soil::sand(),
        bed: Relief::function(move |x, z| {
            let (i, k) = at(x, z);
            0.02 * noise(i / 5, k / 5, seed)
        }),
        depth: Relief::function(move |x, z| {
            let (i, k) = at(x, z);
            0.06 * (noise(i, k, seed + 1) - 0.3).max(0.0)
        }),
    }
}

/// All heights in bits.
fn heights(ground: &Ground) -> Vec<u64> {
    let Extent { x, z } = ground.extent();
    (z[0]..=z[1])
        .flat_map(|k| (x[0]..=x[1]).map(move |i| (i, k)))
        .map(|(i, k)| ground.column(i, k).to_bits())
        .collect()
}

fn steps(ground: &mut Ground, ticks: u32) -> Outcome {
    let spout = Place::Disc { centre: [0.031, -0.12], radius: 0.03 };
    for tick in 0..ticks {
        let x = 0.2 - 0.004 * f64::from(tick);
        let mut digger = ball(Vector::new(x, 0.03, 0.1), 0.05, 24);
        let step = Vector::new(-0.004, 0.0, 0.0);
        digger.to = digger.from.iter().map(|point| point + step).collect();
        ground.advance(&[Pour { id: 3, place: spout, rate: 1e-3 }], &[digger])?;
    }
    Ok(())
}

#[test]
fn tiles_threads_and_copies_do_not_matter() -> Outcome {
    let run = |side, threads| {
        let settings = Settings { side, threads, ..Settings::default() };
        let mut description = rugged(5);
        description.extent = Extent { x: [-150, 140], z: [-130, 160] };
        let mut ground = Ground::new(description, settings)?;
        steps(&mut ground, 3)?;
        // A copy that is left alone, and one that goes on.
        let copy = ground.clone();
        let before = heights(&copy);
        steps(&mut ground, 3)?;
        assert_eq!(heights(&copy), before);
        assert_eq!(ground.imbalance(), 0);
        Ok::<_, Error>(heights(&ground))
    };
    let first = run(32, 1)?;
    assert!(first == run(16, 1)?);
    assert!(first == run(32, 2)?);
    assert!(first == run(16, 3)?);
    Ok(())
}

/// Where it is followed how far the surface slides, heights are the same bits; tiles and threads do not matter, and neighbours differ by half a column at most.
#[test]
fn the_surface_slides_with_what_slips() -> Outcome {
    let run = |slides, side, threads| {
        let settings = Settings { side, threads, slides, ..Settings::default() };
        let mut ground = Ground::new(rugged(5), settings)?;
        steps(&mut ground, 6)?;
        Ok::<_, Error>(ground)
    };
    let (plain, first) = (run(false, 32, 1)?, run(true, 32, 1)?);
    assert!(heights(&plain) == heights(&first));
    let slid = |ground: &Ground| {
        let Extent { x, z } = ground.extent();
        let rows = (z[0]..=z[1]).map(|k| (x[0]..=x[1]).map(|i| ground.slid(i, k)).collect::<Vec<_>>());
        rows.collect::<Vec<_>>()
    };
    let all = slid(&first);
    assert!(all == slid(&run(true, 16, 2)?));
    assert!(slid(&plain).into_iter().flatten().all(|slid| slid == [0.0; 2]));
    let cell = first.cell();
    let apart = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).abs().max((a[1] - b[1]).abs());
    let along = all.iter().flat_map(|row| row.windows(2).map(|pair| apart(pair[0], pair[1])));
    let across = all.windows(2).flat_map(|rows| rows[0].iter().zip(&rows[1]).map(|(a, b)| apart(*a, *b)));
    let most = along.chain(across).fold(0.0, f64::max);
    assert!(most > 0.4 * cell && most <= 0.5 * cell * (1.0 + 1e-12), "{}", most / cell);
    // A heap of sand slides outwards on all sides.
    let description = Description {
        cell: 0.01,
        extent: Extent::around(40),
        soil: Soil::sand(),
        bed: Relief::Level(0.0),
        depth: Relief::function(|x, z| if x.hypot(z) < 0.1 { 0.15 } else { 0.0 }),
    };
    let mut ground = Ground::new(description, Settings { slides: true, ..Settings::default() })?;
    ground.settle(100_000)?;
    for (i, k) in [(12, 0), (-12, 0), (0, 12), (0, -12), (9, 9), (-9, 9)] {
        let [x, z] = ground.slid(i, k);
        let outwards = (x * f64::from(i) + z * f64::from(k)) / f64::from(i).hypot(f64::from(k));
        assert!(
            outwards > cell && (x * f64::from(k) - z * f64::from(i)).abs() < outwards,
            "{i} {k}: {x} {z}"
        );
    }
    assert_eq!(ground.slid(39, 39), [0.0; 2]);
    Ok(())
}

#[test]
fn what_happens_far_away_changes_nothing_here() -> Outcome {
    let plane = || Description {
        cell: 0.01,
        extent: Extent::around(300),
        soil: Soil::sand(),
        bed: Relief::Level(-0.1),
        depth: Relief::Level(0.1),
    };
    let here = Pour { id: 1, place: Place::Disc { centre: [0.5, 0.5], radius: 0.02 }, rate: 2e-3 };
    let there = Pour { id: 2, place: Place::Disc { centre: [-1.5, -1.2], radius: 0.05 }, rate: 5e-3 };
    let mut alone = Ground::new(plane(), Settings::default())?;
    let mut both = Ground::new(plane(), Settings::default())?;
    for tick in 0..40 {
        alone.advance(&[here], &[])?;
        let mut fast = ball(Vector::new(-2.0, 0.02, -2.0), 0.05, 16);
        let way = Vector::new(0.3 * f64::from(tick % 3), 0.0, 0.0);
        fast.to = fast.from.iter().map(|point| point + way).collect();
        both.advance(&[here, there], &[fast])?;
    }
    for k in 0..=100 {
        for i in 0..=100 {
            assert_eq!(alone.column(i, k), both.column(i, k));
        }
    }
    assert!(both.column(-150, -120) > 0.0 && alone.column(50, 50) > 0.0);
    assert_eq!((alone.imbalance(), both.imbalance()), (0, 0));
    Ok(())
}

#[test]
fn symmetric_ground_stays_symmetric() -> Outcome {
    let cell = 0.01;
    let folded = move |x: f64, z: f64, seed: u64| {
        let (i, k) = ((x / cell).round() as i64, (z / cell).round() as i64);
        let (i, k) = (i.abs().max(k.abs()), i.abs().min(k.abs()));
        noise(i, k, seed)
    };
    let mut ground = Ground::new(
        Description {
            cell,
            extent: Extent::around(45),
            soil: Soil { rough: 0.0, ..Soil::sand() },
            bed: Relief::function(move |x, z| 0.03 * folded(x, z, 77)),
            depth: Relief::function(move |x, z| 0.1 * (folded(x, z, 78) - 0.2)),
        },
        Settings::default(),
    )?;
    let pour = Pour { id: 0, place: Place::Disc { centre: [0.0; 2], radius: 0.05 }, rate: 1e-3 };
    let mut before = heights(&ground);
    for _ in 0..30 {
        ground.advance(&[pour], &[])?;
        let after = heights(&ground);
        assert!(after != before, "nothing moves");
        before = after;
        for k in 0..=45 {
            for i in 0..=k {
                let height = ground.column(i, k);
                for (a, b) in [(i, k), (k, i)] {
                    for image in [(a, b), (-a, b), (a, -b), (-a, -b)] {
                        assert_eq!(ground.column(image.0, image.1), height, "{image:?} and {:?}", (i, k));
                    }
                }
            }
        }
    }
    assert_eq!(ground.imbalance(), 0);
    Ok(())
}

#[test]
fn flat_ground_stays_flat_and_costs_nothing() -> Outcome {
    let flat = Description {
        cell: 0.01,
        extent: Extent::around(500),
        soil: Soil::sand(),
        bed: Relief::Level(-0.5),
        depth: Relief::Level(0.5),
    };
    let mut ground = Ground::new(flat, Settings::default())?;
    let snow = Pour { id: 0, place: Place::Everywhere, rate: 0.01 };
    for _ in 0..120 {
        ground.advance(&[snow], &[])?;
    }
    assert!((ground.height(1.234, -2.345) - 0.01).abs() < 1e-9);
    assert_eq!(ground.height(1.234, -2.345), ground.height(-4.9, 3.0));
    assert_eq!((ground.stored(), ground.updates(), ground.imbalance()), (0, 0, 0));
    Ok(())
}

#[test]
fn slopes_stand_up_to_the_angle_of_repose_and_slip_down_to_it() -> Outcome {
    let steepness = |degrees: f64, touched: bool| {
        let slope = degrees.to_radians().tan();
        let description = Description {
            cell: 0.01,
            extent: Extent { x: [0, 100], z: [0, 0] },
            soil: Soil::sand(),
            bed: Relief::Level(-1.0),
            depth: Relief::function(move |x, _| 1.0 + slope * x),
        };
        let mut ground = Ground::new(description, Settings::default())?;
        if touched {
            let place = Place::Disc { centre: [0.5, 0.0], radius: 0.0 };
            ground.pour(&Pour { id: 0, place, rate: 1e-8 }, 1.0)?;
        }
        ground.settle(200_000)?;
        let steepest =
            (0..100).map(|i| (ground.column(i + 1, 0) - ground.column(i, 0)) / 0.01).fold(0.0, f64::max);
        assert_eq!(ground.imbalance(), 0);
        Ok::<_, Error>((steepest.atan().to_degrees(), ground.updates()))
    };
    let repose = Soil::sand().repose;
    assert_eq!(steepness(repose - 0.1, false)?.1, 0);
    let (angle, updates) = steepness(repose + 1.0, false)?;
    assert!((angle - repose - 1.0).abs() < 1e-6 && updates == 0, "material that rests stands 2° steeper");
    // Touched, or steeper than that, it slips to the angle of repose.
    for (angle, _) in [steepness(repose + 1.0, true)?, steepness(repose + 4.0, false)?] {
        assert!(angle <= repose + 0.03 && angle > repose - 1.0, "{angle}");
    }
    Ok(())
}

#[test]
fn hard_grounds_come_to_rest() -> Outcome {
    // A film on a steep bed, a spike, a random ground with bare places, snow as steep as it can stand.
    let steep = Description {
        bed: Relief::function(|x, z| 2.0 * x + 0.5 * z),
        depth: Relief::Level(1e-5),
        ..rugged(0)
    };
    let spike = Description {
        bed: Relief::Level(0.0),
        depth: Relief::function(|x, z| if x == 0.0 && z == 0.0 { 10.0 } else { 0.0 }),
        ..rugged(0)
    };
    let snow = Description { soil: Soil::snow(), ..spike.clone() };
    let mut grounds = vec![steep, spike, snow];
    grounds.extend((1..6).map(rugged));
    for (case, description) in grounds.into_iter().enumerate() {
        let mut ground = Ground::new(description, Settings::default())?;
        ground.settle(400_000).unwrap_or_else(|error| panic!("case {case}: {error}"));
        assert_eq!(ground.imbalance(), 0);
        assert!(ground.is_at_rest());
    }
    Ok(())
}

#[test]
fn bounds_hold_the_heights() -> Outcome {
    let mut ground = Ground::new(rugged(9), Settings::default())?;
    steps(&mut ground, 4)?;
    for n in 0..200 {
        let [a, b, c, d] = [0, 1, 2, 3].map(|part| random(4 * n + part) - 0.5);
        let (x, z) = ([a.min(b), a.max(b)], [c.min(d), c.max(d)]);
        let [low, high] = ground.bounds(x, z);
        for part in 0..20 {
            let [u, v] = [0, 1].map(|m| random(1000 + 2 * part + m));
            let height = ground.height(x[0] + u * (x[1] - x[0]), z[0] + v * (z[1] - z[0]));
            assert!(low - 1e-12 <= height && height <= high + 1e-12);
        }
    }
    Ok(())
}

#[test]
fn tiles_that_changed_are_found() -> Outcome {
    let flat = Description {
        bed: Relief::Level(0.0),
        depth: Relief::Level(0.1),
        extent: Extent::around(200),
        ..rugged(0)
    };
    let mut ground = Ground::new(flat, Settings::default())?;
    let before = ground.clone();
    assert!(ground.changed_since(&before).is_empty());
    let pour = Pour { id: 0, place: Place::Disc { centre: [0.5, 0.5], radius: 0.0 }, rate: 1e-4 };
    ground.advance(&[pour], &[])?;
    let changed = ground.changed_since(&before);
    assert!(
        changed.iter().any(|part| part.x[0] <= 50 && 50 <= part.x[1] && part.z[0] <= 50 && 50 <= part.z[1])
    );
    assert!(changed.len() <= 9, "{changed:?}");
    Ok(())
}

#[test]
fn bad_input_is_an_error_that_says_so() {
    let message =
        |result: Result<Ground, Error>| result.map_or_else(|error| error.to_string(), |_| String::new());
    let new = |description| message(Ground::new(description, Settings::default()));
    assert!(new(Description { cell: 0.0, ..rugged(0) }).contains("a size of columns (m) of 0"));
    let steep = Soil { repose: 95.0, ..Soil::sand() };
    assert!(new(Description { soil: steep, ..rugged(0) }).contains("an angle of repose (°) of 95"));
    let hole = Relief::function(|x, _| if x > 0.2 { f64::NAN } else { 0.0 });
    assert!(
        new(Description { bed: hole, ..rugged(0) })
            .contains("the bed of the ground at (0.21, -0.4) m is NaN")
    );
    let run = |pours: &[Pour], bodies: &[Body]| {
        let ground = Ground::new(rugged(0), Settings::default());
        message(ground.and_then(|mut ground| ground.advance(pours, bodies).map(|()| ground)))
    };
    let place = Place::Disc { centre: [0.0; 2], radius: 0.01 };
    assert!(run(&[Pour { id: 0, place, rate: 1e12 }], &[]).contains("what is poured at"));
    let far = Place::Disc { centre: [9.0, 0.0], radius: 0.01 };
    assert!(run(&[Pour { id: 0, place: far, rate: 1.0 }], &[]).contains("a pour reaches (9, 0) m"));
    let mut open = ball(Vector::new(0.0, 0.05, 0.0), 0.1, 16);
    open.triangles = open.triangles.iter().skip(9).copied().collect::<Arc<[_]>>();
    assert!(run(&[], &[open]).contains("the surface of a ball is not closed"));
    assert!(run(&[], &[ball(Vector::new(0.38, 0.0, 0.0), 0.1, 16)]).contains("where there is no ground"));
    let mut fast = ball(Vector::zeros(), 0.1, 16);
    fast.to = fast.from.iter().map(|point| point + Vector::new(1e3, 0.0, 0.0)).collect();
    assert!(run(&[], &[fast]).contains("a ball moves 1000 m in a tick"));
    let mut lost = ball(Vector::zeros(), 0.1, 16);
    lost.to = lost.from.iter().map(|point| point * f64::NAN).collect();
    assert!(run(&[], &[lost]).contains("not a number"));
}

#[test]
fn memory_is_bounded() -> Outcome {
    let wide = Description {
        extent: Extent::around(100_000),
        bed: Relief::Level(0.0),
        depth: Relief::Level(0.0),
        ..rugged(0)
    };
    let mut ground = Ground::new(wide, Settings { memory: 4, ..Settings::default() })?;
    let place = Place::Disc { centre: [0.0; 2], radius: 50.0 };
    let error = ground.advance(&[Pour { id: 0, place, rate: 1.0 }], &[]);
    assert!(error.is_err_and(|error| error.to_string().contains("needs more than 4 MB")));
    Ok(())
}
