//! Soil that is a height field: what lies on it, what it covers, what falls again when it is dug away.

use std::sync::Arc;

use dlsys_fall::study::random_hills;
use dlsys_fall::{
    Body, Columns, Error, Fall, Ground, Motion, Obstacles, Settings, Soil, Span, Still, Surface, Vector,
};

const TICK: f64 = 1.0 / 120.0;

/// Columns of 1 cm, heights by place in m and time in s, and how they hold what touches them.
struct Field<F: Fn(f64, f64, f64) -> f64> {
    heights: F,
    surface: Surface,
}

fn field<F: Fn(f64, f64, f64) -> f64>(heights: F) -> Field<F> {
    Field { heights, surface: Surface::default() }
}

#[derive(Debug)]
struct Heights {
    side: i32,
    all: Vec<f64>,
}

impl Columns for Heights {
    fn cell(&self) -> f64 {
        0.01
    }

    fn height(&self, i: i32, k: i32) -> f64 {
        let at = |n: i32| (n.clamp(-self.side, self.side) + self.side) as usize;
        self.all[at(k) * (2 * self.side as usize + 1) + at(i)]
    }

    fn bounds(&self, x: [i32; 2], z: [i32; 2]) -> [f64; 2] {
        let all = (x[0]..=x[1]).flat_map(|i| (z[0]..=z[1]).map(move |k| self.height(i, k)));
        all.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], height| {
            [low.min(height), high.max(height)]
        })
    }
}

impl<F: Fn(f64, f64, f64) -> f64> Obstacles for Field<F> {
    fn span(&self, time: f64) -> Result<Option<Arc<Span>>, Error> {
        let begin = (time / TICK + 1e-9).floor() * TICK;
        let side = 40;
        let at = |n: i32| f64::from(n) * 0.01;
        let all = (-side..=side).flat_map(|k| (-side..=side).map(move |i| (i, k)));
        let all = all.map(|(i, k)| (self.heights)(at(i), at(k), begin)).collect();
        let soil = Soil { columns: Arc::new(Heights { side, all }), surface: self.surface };
        Ok(Some(Arc::new(Span::new(begin, begin + TICK, Vec::new())?.above(soil)?)))
    }
}

fn dropped(body: Body, height: f64) -> Result<Fall, Error> {
    Fall::new(body, Motion::at(Vector::new(0.003, height, 0.002)), 0.0, None, Settings::default())
}

fn petal() -> Result<Body, Error> {
    Body::plate(2e-5, [0.012, 0.008])
}

/// Level soil is a floor: the same place of rest.
#[test]
fn level_soil_is_a_floor() -> Result<(), Error> {
    let level = field(|_, _, _| 0.03);
    let mut on_soil = dropped(petal()?, 0.1)?;
    let motion = Motion::at(Vector::new(0.003, 0.1, 0.002));
    let mut on_floor = Fall::new(petal()?, motion, 0.0, Some(Ground::at(0.03)), Settings::default())?;
    let (a, b) = (on_soil.among(4.0, &Still, &level)?, on_floor.at(4.0, &Still)?);
    assert!((a.position - b.position).norm() < 1e-3 * 0.012, "{} {}", a.position, b.position);
    assert_eq!(a.velocity, Vector::zeros());
    Ok(())
}

/// A petal lies on a slope. Then soil comes onto it and goes again, down to where it was, and the petal stays; then the soil below goes, and it falls.
#[test]
fn what_lies_on_soil_is_covered_and_falls_when_it_is_dug_away() -> Result<(), Error> {
    let soil = field(|x, z, t| {
        let slope = 0.2 * x + 0.1 * z;
        match t {
            t if t < 4.0 => slope,
            t if t < 5.0 => slope + 0.05 * (t - 4.0),
            t if t < 6.0 => slope + 0.05 * (6.0 - t),
            t => slope - 0.1 * (t - 6.0).min(1.0),
        }
    });
    let mut fall = dropped(petal()?, 0.08)?;
    let lies = fall.among(3.9, &Still, &soil)?;
    assert_eq!(lies.velocity, Vector::zeros());
    let height = |motion: &Motion, sunk: f64| {
        motion.position.y - 0.2 * motion.position.x - 0.1 * motion.position.z + sunk
    };
    assert!(height(&lies, 0.0).abs() < 1e-4, "{}", height(&lies, 0.0));
    for time in [4.5, 5.0, 5.9, 6.0] {
        assert_eq!(fall.among(time, &Still, &soil)?, lies, "{time}");
    }
    let dug = fall.among(9.0, &Still, &soil)?;
    assert!(
        height(&dug, 0.1).abs() < 1e-3 && dug.velocity == Vector::zeros(),
        "{dug:?} {}",
        height(&dug, 0.1)
    );
    assert_eq!(fall.among(3.9, &Still, &soil)?, lies);
    Ok(())
}

/// Leaves come to rest on ground that is round, whose columns are much nearer to each other than the places on which a leaf lies: they do not rock from one column
/// to the next for ever.
#[test]
fn leaves_come_to_rest_on_rounded_ground() -> Result<(), Error> {
    for (number, bend) in [0.05, 0.4, -0.3, 1.5, 0.05, 0.2].into_iter().enumerate() {
        let slope = 0.1 * number as f64 - 0.2;
        let soil = field(move |x, z, _| 0.05 - bend * (x * x + 0.5 * z * z) + slope * z);
        // In tests without optimization, fewer contacts than a drawn leaf has.
        let mut motion = Motion::at(Vector::new(0.01 * number as f64, 0.1, 0.02));
        motion.spin = Vector::new(2.0 - number as f64, number as f64, 1.0);
        let body = Body::plate(1e-3, [0.06, 0.035])?;
        let mut fall = Fall::new(body, motion, 0.0, None, Settings::default())?;
        let lies = fall.among(3.0, &Still, &soil)?;
        assert_eq!((lies.velocity, lies.spin), (Vector::zeros(), Vector::zeros()), "{number}");
    }
    Ok(())
}

/// Without friction, columns of a rounded slope do not catch a plate that slides over them: it loses no more energy (J/kg) than the landing on a plane costs.
#[test]
fn columns_do_not_catch_what_slides_over_them() -> Result<(), Error> {
    let lost = |bend: f64| -> Result<f64, Error> {
        let ground = move |x: f64, z: f64| -0.3 * x - bend * (x * x + z * z) / 2.0;
        let surface = Surface { friction: 0.0, restitution: 0.0, rolling: 0.0 };
        let soil = Field { heights: move |x, z, _| ground(x, z), surface };
        let mut settings = Settings::default();
        settings.air.density = 1e-9;
        let mut motion = Motion::at(Vector::new(0.003, ground(0.003, 0.002) + 1e-3, 0.002));
        let tilt = nalgebra::UnitQuaternion::from_axis_angle(&Vector::z_axis(), -0.3_f64.atan());
        motion.attitude = tilt * motion.attitude;
        motion.velocity = tilt * Vector::x();
        let rim = |k: usize| {
            let angle = std::f64::consts::TAU * k as f64 / 34.0;
            let point = Vector::new(0.06 * angle.cos(), 0.04 * angle.sin(), 0.0);
            dlsys_fall::Contact { point, radius: 0.0 }
        };
        let body = Body::plate(1e-3, [0.06, 0.04])?.touching((0..34).map(rim).collect())?;
        let mut fall = Fall::new(body, motion, 0.0, None, settings)?;
        let after = fall.among(0.2, &Still, &soil)?;
        let energy = |motion: &Motion| fall.energy(motion).iter().sum::<f64>() / 1e-3;
        Ok(energy(&motion) - energy(&after))
    };
    let plane = lost(0.0)?;
    for bend in [0.02, 0.1, 0.3] {
        let lost = lost(bend)?;
        assert!(lost > 0.0 && lost < 1.5 * plane, "{bend}: {lost} {plane}");
    }
    Ok(())
}

/// Where a body is let go in soil, it stays at its level; what is let go on it lies there at once.
#[test]
fn what_begins_in_soil_stays_at_its_level() -> Result<(), Error> {
    let soil = field(|x, _, _| 0.1 + 0.3 * x);
    let mut fall = dropped(Body::ball(1e-3, 0.01)?, 0.06)?;
    let lies = fall.among(2.0, &Still, &soil)?;
    assert!((lies.position - Vector::new(0.003, 0.06, 0.002)).norm() < 0.01, "{lies:?}");
    Ok(())
}

/// Plates and lumps at random hills: contacts stay above the surface, and contact does not add energy but that of a part of the error that is allowed.
#[test]
fn nothing_passes_through_hills() -> Result<(), Error> {
    for (tolerance, seeds) in [(1e-2, 0..9), (1e-3, 0..3)] {
        for seed in seeds {
            let found = random_hills(seed, tolerance)?;
            assert!(found.depth <= tolerance, "{found:?}");
            assert!(found.gain < 0.1 * tolerance, "{found:?}");
        }
    }
    Ok(())
}

/// Any times in any order give the same bits, on soil that moves.
#[test]
fn any_order_of_times_gives_the_same_bits() -> Result<(), Error> {
    let soil = field(|x, z, t| 0.02 * (30.0 * x).sin() * (20.0 * z).cos() - 0.01 * (t - 1.0).clamp(0.0, 1.0));
    let times: Vec<f64> = (0..40).map(|n| f64::from(n * 17 % 40) * 0.05).collect();
    let mut fall = dropped(petal()?, 0.1)?;
    let there: Vec<Motion> =
        times.iter().map(|time| fall.among(*time, &Still, &soil)).collect::<Result<_, _>>()?;
    for (time, known) in times.iter().zip(&there) {
        let mut fresh = dropped(petal()?, 0.1)?;
        assert_eq!(fresh.among(*time, &Still, &soil)?, *known, "{time}");
    }
    Ok(())
}
