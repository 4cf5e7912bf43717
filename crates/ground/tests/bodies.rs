//! Bodies: nothing tunnels, nothing is lost, what leaves takes nothing along, and everything ends.

use std::sync::Arc;

use dlsys_ground::study::{sphere, vessel};
use dlsys_ground::{Body, Description, Error, Extent, Ground, Place, Pour, Relief, Settings, Soil, Vector};
use nalgebra::Rotation3;

type Outcome = Result<(), Error>;

const CELL: f64 = 0.01;

/// A number from 0 to 1 for a seed.
fn random(seed: u64) -> f64 {
    let mut bits = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((bits ^ (bits >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}

fn level(soil: Soil, depth: f64) -> Result<Ground, Error> {
    let description = Description {
        cell: CELL,
        extent: Extent::around(60),
        soil,
        bed: Relief::Level(0.0),
        depth: Relief::Level(depth),
    };
    Ground::new(description, Settings::default())
}

/// Loose material that stands at any slope.
fn stiff() -> Soil {
    Soil { push: 1.0, ..Soil::snow() }
}

/// A box around the origin as a closed mesh.
fn block(half: Vector) -> (Vec<Vector>, Arc<[[u32; 3]]>) {
    let corner = |n: u32| {
        let side = |bit: u32| if n >> bit & 1 == 0 { -1.0 } else { 1.0 };
        half.component_mul(&Vector::new(side(0), side(1), side(2)))
    };
    let faces = [[0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = faces.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    ((0..8).map(corner).collect(), triangles)
}

fn placed(points: &[Vector], rotation: &Rotation3<f64>, at: Vector) -> Arc<[Vector]> {
    points.iter().map(|point| rotation * point + at).collect()
}

fn body(triangles: &Arc<[[u32; 3]]>, from: Arc<[Vector]>, to: Arc<[Vector]>) -> Body {
    Body { id: 7, name: "a body".to_owned(), triangles: triangles.clone(), from, to, shelf: false }
}

#[test]
fn a_thin_plate_pushes_all_that_it_passes_in_one_tick() -> Outcome {
    let mut ground = level(stiff(), 0.05)?;
    // A tenth of a column thick, between two columns at both ends.
    let (points, triangles) = block(Vector::new(0.0005, 0.1, 0.2));
    let turn = Rotation3::identity();
    let bottom = 0.02;
    let at = |x: f64| placed(&points, &turn, Vector::new(x, 0.1 + bottom, 0.0));
    ground.advance(&[], &[body(&triangles, at(-0.305), at(-0.305))])?;
    ground.advance(&[], &[body(&triangles, at(-0.305), at(0.105))])?;
    for i in -30..=10 {
        for k in -19..=19 {
            assert!(ground.column(i, k) <= bottom + 1e-6, "({i}, {k}): {}", ground.column(i, k));
        }
    }
    assert!((11..20).any(|i| ground.column(i, 0) > 0.06), "nothing lies ahead");
    assert!((-40..-32).all(|i| ground.column(i, 0) == 0.05), "something lies behind");
    assert_eq!(ground.imbalance(), 0);
    Ok(())
}

/// A ball in sand that stands at any slope, moved by 0.3 m in parts of a tick each, turning or not: what lies in its way at the end, and how deep its
/// track is behind it.
fn track(turns: bool) -> Result<[f64; 2], Error> {
    let (radius, sunk) = (0.2, 0.04);
    let mut ground = level(Soil { push: 0.3, ..Soil::snow() }, 0.2)?;
    let (points, triangles) = sphere(Vector::zeros(), radius, 32);
    let at = |x: f64| {
        let turn = if turns { -x / radius } else { 0.0 };
        placed(
            &points,
            &Rotation3::from_axis_angle(&Vector::z_axis(), turn),
            Vector::new(x, 0.2 + radius - sunk, 0.0),
        )
    };
    for tick in 0..60 {
        let [from, to] = [tick, tick + 1].map(|tick| at(f64::from(tick) * 0.005));
        ground.advance(&[], &[body(&triangles, from, to)])?;
    }
    assert_eq!(ground.imbalance(), 0);
    let ahead: f64 = (30..60)
        .flat_map(|i| (-20..=20).map(move |k| (i, k)))
        .map(|(i, k)| (ground.column(i, k) - 0.2).max(0.0))
        .sum();
    Ok([ahead * CELL * CELL, 0.2 - ground.column(10, 0)])
}

/// A ball that rolls without slipping stands still where it touches the ground: it presses its track, and has no wave before it, as one has that is dragged.
#[test]
fn what_rolls_presses_and_does_not_push() -> Outcome {
    let ([rolled, deep], [dragged, _]) = (track(true)?, track(false)?);
    // A track of the depth of the ball holds 6 litres or so; less than a tenth of them is ahead.
    assert!(rolled < 0.0006 && dragged > 3.0 * rolled, "{rolled} {dragged}");
    assert!((deep - 0.04).abs() < 0.006, "{deep}");
    Ok(())
}

#[test]
fn what_is_lifted_moves_nothing() -> Outcome {
    for lean in [0.0, 0.3] {
        let mut ground = level(stiff(), 0.1)?;
        let (points, triangles) = block(Vector::new(0.031, 0.1, 0.123));
        let turn = Rotation3::from_euler_angles(lean, 0.2, lean);
        let at = |y: f64| placed(&points, &turn, Vector::new(0.013, y, 0.002));
        ground.advance(&[], &[body(&triangles, at(0.3), at(0.13))])?;
        ground.advance(&[], &[body(&triangles, at(0.13), at(0.13))])?;
        let before = ground.clone();
        for (from, to) in [(0.13, 0.1301), (0.1301, 0.2), (0.2, 0.5)] {
            ground.advance(&[], &[body(&triangles, at(from), at(to))])?;
        }
        for k in -60..=60 {
            for i in -60..=60 {
                assert_eq!(ground.column(i, k), before.column(i, k), "({i}, {k})");
            }
        }
        assert!(before.column(1, 0) < 0.08);
    }
    Ok(())
}

#[test]
fn a_body_that_leaves_in_one_tick_ends() -> Outcome {
    let mut ground = level(Soil { push: 1.0, ..Soil::sand() }, 0.3)?;
    let (points, triangles) = sphere(Vector::zeros(), 0.1, 24);
    let at = |x: f64, y: f64| placed(&points, &Rotation3::identity(), Vector::new(x, y, 0.0));
    ground.advance(&[], &[body(&triangles, at(0.0, 0.5), at(0.0, 0.02))])?;
    ground.advance(&[], &[body(&triangles, at(0.0, 0.02), at(4.0, 3.0))])?;
    ground.advance(&[], &[])?;
    ground.settle(200_000)?;
    assert_eq!(ground.imbalance(), 0);
    assert_eq!(ground.carried(), 0.0);
    Ok(())
}

#[test]
fn a_buried_body_carries_what_is_above_it() -> Outcome {
    let mut ground = level(stiff(), 0.2)?;
    let (points, triangles) = block(Vector::new(0.055, 0.02, 0.055));
    let at = |y: f64| placed(&points, &Rotation3::identity(), Vector::new(0.0, y, 0.0));
    ground.advance(&[], &[body(&triangles, at(0.1), at(0.1))])?;
    // 11 × 11 columns of 0.08 m.
    let exact = 121.0 * CELL * CELL * 0.08;
    assert!((ground.carried() / exact - 1.0).abs() < 1e-4, "{}", ground.carried());
    let carried = ground.carried();
    ground.advance(&[], &[body(&triangles, at(0.1), at(0.3))])?;
    assert_eq!(ground.carried(), carried);
    // Without the body it lies on the ground again.
    ground.advance(&[], &[])?;
    assert_eq!((ground.carried(), ground.imbalance()), (0.0, 0));
    Ok(())
}

#[test]
fn loads_ride_on_bodies_that_move_and_turn() -> Outcome {
    let mut ground = level(stiff(), 0.02)?;
    let (points, triangles) = block(Vector::new(0.105, 0.02, 0.105));
    let place = Place::Disc { centre: [0.0; 2], radius: 0.02 };
    let at = |x: f64, turn: f64| {
        let turn = Rotation3::from_axis_angle(&Vector::y_axis(), turn);
        placed(&points, &turn, Vector::new(x, 0.06, 0.0))
    };
    ground.advance(&[Pour { id: 1, place, rate: 1e-3 }], &[body(&triangles, at(0.0, 0.0), at(0.0, 0.0))])?;
    let carried = ground.carried();
    assert!(carried > 0.0);
    let mut now = (0.0, 0.0);
    for tick in 1..=60 {
        let next = (0.003 * f64::from(tick), 0.02 * f64::from(tick));
        ground.advance(&[], &[body(&triangles, at(now.0, now.1), at(next.0, next.1))])?;
        now = next;
    }
    assert_eq!(ground.carried(), carried);
    // Where the body is when it is taken away, there the load falls.
    ground.advance(&[], &[])?;
    let highest = (-60..=60).max_by(|a, b| ground.column(*a, 0).total_cmp(&ground.column(*b, 0)));
    assert!(highest.is_some_and(|i| (i - 18).abs() <= 3), "{highest:?}");
    assert_eq!(ground.imbalance(), 0);
    Ok(())
}

#[test]
fn snow_falls_on_bodies_not_under_them() -> Outcome {
    let mut ground = level(Soil { repose: 50.0, ..Soil::snow() }, 0.0)?;
    let (points, triangles) = block(Vector::new(0.105, 0.01, 0.105));
    let at = || placed(&points, &Rotation3::identity(), Vector::new(0.0, 0.04, 0.0));
    let snow = Pour { id: 1, place: Place::Everywhere, rate: 0.01 };
    for _ in 0..120 {
        ground.advance(&[snow], &[body(&triangles, at(), at())])?;
    }
    assert!(ground.column(0, 0) < 1e-6, "{}", ground.column(0, 0));
    assert!((ground.column(50, 50) - 0.01).abs() < 1e-9);
    assert!(ground.carried() > 0.8 * 0.01 * 0.21 * 0.21);
    assert_eq!(ground.imbalance(), 0);
    Ok(())
}

#[test]
fn random_attacks_lose_nothing_and_end() -> Outcome {
    for seed in 0..24 {
        let draw = |n: u64| random(1000 * seed + n);
        let soil = [Soil { push: draw(0), ..Soil::sand() }, Soil::mud(), Soil::snow()][seed as usize % 3];
        let mut ground = level(soil, 0.1)?;
        let (points, triangles) = match seed % 4 {
            0 => block(Vector::new(0.002, 0.06, 0.08)),
            1 => {
                let (points, triangles) = sphere(Vector::zeros(), 0.05 + 0.05 * draw(1), 20);
                (points.to_vec(), triangles)
            }
            2 => vessel(0.1, 0.05, 0.025),
            _ => block(Vector::new(0.1, 0.003, 0.05)),
        };
        let spot = |n: u64| {
            let range = |part: u64| draw(10 * n + part) - 0.5;
            let turn = Rotation3::from_euler_angles(4.0 * range(2), 6.0 * range(3), 4.0 * range(4));
            // Some ticks end where they begin.
            placed(&points, &turn, Vector::new(0.5 * range(5), 0.12 + 0.25 * range(6), 0.5 * range(7)))
        };
        let place = Place::Disc { centre: [0.1 * draw(3), 0.1 * draw(4)], radius: 0.05 };
        let pour = Pour { id: 0, place, rate: 0.01 * draw(5) };
        let mut now = spot(1);
        for n in 1..12 {
            let next = if draw(500 + n) < 0.2 { now.clone() } else { spot(n) };
            ground
                .advance(&[pour], &[body(&triangles, now, next.clone())])
                .unwrap_or_else(|error| panic!("seed {seed}, tick {n}: {error}"));
            assert_eq!(ground.imbalance(), 0, "seed {seed}, tick {n}");
            now = next;
        }
        ground.advance(&[], &[])?;
        ground.settle(400_000).unwrap_or_else(|error| panic!("seed {seed}: {error}"));
        assert_eq!((ground.imbalance(), ground.carried()), (0, 0.0), "seed {seed}");
    }
    Ok(())
}

#[test]
fn the_mesh_has_no_cracks_and_the_height_of_the_ground() -> Outcome {
    let mut ground = level(Soil::sand(), 0.1)?;
    let (points, triangles) = sphere(Vector::zeros(), 0.1, 24);
    let at = placed(&points, &Rotation3::identity(), Vector::new(0.21, 0.12, -0.13));
    ground.advance(&[], &[body(&triangles, at.clone(), at)])?;
    let mesh = ground.mesh();
    // Each edge belongs to two triangles that pass it in opposite directions, but for the edges of the ground.
    let mut edges = std::collections::BTreeMap::new();
    for [a, b, c] in &mesh.triangles {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            *edges.entry((*from, *to)).or_insert(0) += 1;
        }
    }
    let on_edge = |n: u32| {
        let point = mesh.points[n as usize];
        point.x.abs().max(point.z.abs()) > 0.6 - 1e-9
    };
    let mut area = 0.0;
    for ((from, to), count) in &edges {
        assert_eq!(*count, 1);
        assert!(edges.contains_key(&(*to, *from)) || on_edge(*from) && on_edge(*to), "a crack");
    }
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|n| mesh.points[n as usize]);
        let upward = (b - a).cross(&(c - a)).y / 2.0;
        assert!(upward > 0.0);
        area += upward;
    }
    assert!((area - 1.44).abs() < 1e-9, "{area}");
    // Points have the height of the ground, but for those under the ball, where the mesh rises within it to the ground beside it.
    let mut raised = 0;
    for point in &mesh.points {
        let lift = point.y - ground.height(point.x, point.z);
        if lift.abs() < 1e-9 {
            continue;
        }
        raised += 1;
        assert!(lift > 0.0, "{lift}");
        assert!((point - Vector::new(0.21, 0.12, -0.13)).norm() < 0.1, "{point}: beside the ball");
    }
    assert!(raised > 0);
    // Few triangles where nothing has happened.
    assert!(mesh.triangles.len() < 2 * 120 * 120 / 2, "{}", mesh.triangles.len());
    Ok(())
}

#[test]
fn a_shelf_carries_presses_nothing_and_sheds_when_it_is_steep() -> Outcome {
    let mut ground = level(Soil::sand(), 0.05)?;
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let points: Vec<_> = corners.map(|[x, z]| Vector::new(0.105 * x, 0.0, 0.105 * z)).into();
    let triangles: Arc<[[u32; 3]]> = [[0, 2, 1], [0, 3, 2]].into();
    let shelf = |from: (f64, f64), to: (f64, f64)| {
        let at = |(height, lean): (f64, f64)| {
            let turn = Rotation3::from_axis_angle(&Vector::z_axis(), lean);
            placed(&points, &turn, Vector::new(0.0, height, 0.0))
        };
        Body { shelf: true, ..body(&triangles, at(from), at(to)) }
    };
    // Through the ground and up again: nothing is moved.
    let before = ground.clone();
    ground.advance(&[], &[shelf((0.2, 0.0), (-0.02, 0.3))])?;
    ground.advance(&[], &[shelf((-0.02, 0.3), (0.2, 0.0))])?;
    ground.advance(&[], &[shelf((0.2, 0.0), (0.2, 0.0))])?;
    assert!((-60..=60).all(|i| ground.column(i, 0) == before.column(i, 0)));
    // High above the ground, it catches what is poured from then on. As full as it can be: a pyramid with the slope of the sand over all of its width.
    let pour = Pour { id: 0, place: Place::Disc { centre: [0.0; 2], radius: 0.05 }, rate: 0.2 };
    ground.advance(&[pour], &[shelf((0.2, 0.0), (0.2, 0.0))])?;
    ground.settle(200_000)?;
    let exact = ground.soil().slope() * 0.21_f64.powi(3) / 6.0;
    assert!((ground.carried() / exact - 1.0).abs() < 0.03, "{} of {exact}", ground.carried());
    assert_eq!(ground.imbalance(), 0);
    // Steeper than the sand can lie, it is empty.
    for tick in 0..60 {
        let lean = |tick: u32| (0.2, f64::from(tick) / 60.0);
        ground.advance(&[], &[shelf(lean(tick), lean(tick + 1))])?;
    }
    ground.settle(200_000)?;
    assert!(ground.carried() < 1e-3 * exact, "{} of {exact}", ground.carried());
    assert_eq!(ground.imbalance(), 0);
    Ok(())
}

/// A ball that sinks in at the edge: the columns beside it there are lowered by it, and it is beyond the edge all the same.
#[test]
fn a_body_that_sinks_in_beyond_the_edge_is_an_error() -> Outcome {
    let mut ground = level(stiff(), 0.3)?;
    let at = |x: f64, y: f64| sphere(Vector::new(x, y, 0.0), 0.1, 32);
    let triangles = at(0.0, 0.0).1;
    let mut failed = None;
    for tick in 0..40 {
        let height = |tick: i32| 0.45 - 0.005 * f64::from(tick);
        let (from, to) = (at(0.56, height(tick)).0, at(0.56, height(tick + 1)).0);
        if let Err(error) = ground.advance(&[], &[body(&triangles, from, to)]) {
            failed = Some(error);
            break;
        }
    }
    assert!(matches!(&failed, Some(Error::Outside { at, .. }) if at[0] > 0.6), "{failed:?}");
    Ok(())
}

/// More columns than the memory holds are refused before there is a list of them.
#[test]
fn what_is_poured_on_too_many_columns_is_an_error() -> Outcome {
    let description = Description {
        cell: 1e-3,
        extent: Extent::around(1 << 15),
        soil: Soil::sand(),
        bed: Relief::Level(0.0),
        depth: Relief::Level(0.3),
    };
    let mut ground = Ground::new(description, Settings { memory: 16, ..Settings::default() })?;
    let pour = |radius: f64| Pour { id: 1, place: Place::Disc { centre: [1.0, 0.0], radius }, rate: 0.1 };
    assert!(matches!(ground.advance(&[pour(30.0)], &[]), Err(Error::Memory { most: 16, at: [1.0, 0.0] })));
    Ok(())
}
