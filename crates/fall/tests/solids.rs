//! Contact with solids: what rests, what is carried, what is hit, what overlaps; any order of times gives the same bits.

use std::sync::Arc;

use dlsys_fall::{
    Body, Error, Fall, Ground, Motion, Obstacle, Obstacles, Settings, Span, Still, Surface, Vector,
};
use dlsys_solid::{Attitude, Path, Shape};

const TICK: f64 = 1.0 / 64.0;

/// A box with half-extents on a way: its place, and its angle about z, at a time.
struct Board<F: Fn(f64) -> (Vector, f64)> {
    half: Vector,
    way: F,
    /// From when to when it is there.
    there: [f64; 2],
}

impl<F: Fn(f64) -> (Vector, f64)> Obstacles for Board<F> {
    fn span(&self, time: f64) -> Result<Option<Arc<Span>>, Error> {
        let begin = (time / TICK).floor() * TICK;
        let [from, to] = self.there;
        if begin < from || begin >= to {
            return Ok(Some(Arc::new(Span::new(begin, begin + TICK, Vec::new())?)));
        }
        let (_, first) = (self.way)(begin);
        let sign = |k: u32, bit: u32| if k >> bit & 1 == 1 { 1.0 } else { -1.0 };
        let corner = |k| self.half.component_mul(&Vector::new(sign(k, 0), sign(k, 1), sign(k, 2)));
        let turn = Attitude::from_scaled_axis(Vector::z() * first);
        let shape = Shape::hull((0..8).map(|k| turn * corner(k)).collect(), 0.0)?;
        let places = Path::INSTANTS.map(|part| (self.way)(begin + part * TICK));
        let turns = places.map(|(_, angle)| Vector::z() * (angle - first));
        let path = Path::through((begin, TICK), places.map(|place| place.0), turns);
        let is_new = begin == from && from > 0.0;
        let board =
            Obstacle { number: 7, parts: Arc::from([shape]), path, surface: Surface::default(), is_new };
        Ok(Some(Arc::new(Span::new(begin, begin + TICK, vec![board])?)))
    }
}

fn board<F: Fn(f64) -> (Vector, f64)>(way: F) -> Board<F> {
    Board { half: Vector::new(0.3, 0.01, 0.3), way, there: [0.0, f64::INFINITY] }
}

fn dropped(body: Body, height: f64) -> Result<Fall, Error> {
    Fall::new(body, Motion::at(Vector::new(0.0, height, 0.0)), 0.0, None, Settings::default())
}

fn petal() -> Result<Body, Error> {
    Body::plate(2e-5, [0.012, 0.008])
}

#[test]
fn what_lies_on_a_board_rests_and_costs_nothing() -> Result<(), Error> {
    let still = board(|_| (Vector::zeros(), 0.0));
    let mut fall = dropped(petal()?, 0.1)?;
    let rests = fall.among(3.0, &Still, &still)?;
    assert!((rests.position.y - 0.01).abs() < 1e-4 && rests.velocity == Vector::zeros(), "{rests:?}");
    let steps = fall.steps();
    assert_eq!(fall.among(13.0, &Still, &still)?, rests);
    assert!(fall.steps() - steps <= 641, "one step a span: {}", fall.steps() - steps);
    Ok(())
}

/// A board that begins to move after what lies on it has come to rest: the petal is carried, and falls when the board is turned over, or is gone.
#[test]
fn what_rests_wakes_up() -> Result<(), Error> {
    let moves = |t: f64| 0.1 * (t - 4.0).max(0.0).powi(2).min(1.0);
    let carried = board(move |t| (Vector::new(moves(t), 2.0 * moves(t), 0.0), 0.0));
    let mut fall = dropped(petal()?, 0.1)?;
    let before = fall.among(4.0, &Still, &carried)?;
    let after = fall.among(4.9, &Still, &carried)?;
    let way = Vector::new(1.0, 2.0, 0.0) * moves(4.9);
    assert!((after.position - before.position - way).norm() < 1e-4, "{}", after.position - before.position);

    let turned = board(|t| (Vector::zeros(), 2.0 * (t - 4.0).clamp(0.0, 1.5)));
    let mut fall = dropped(petal()?, 0.1)?;
    assert!(fall.among(4.0, &Still, &turned)?.position.y > 0.0);
    assert!(fall.among(6.5, &Still, &turned)?.position.y < -0.2);

    let vanishes = Board { there: [0.0, 4.0], ..board(|_| (Vector::zeros(), 0.0)) };
    let mut fall = dropped(petal()?, 0.1)?;
    assert!(fall.among(4.0, &Still, &vanishes)?.position.y > 0.0);
    assert!(fall.among(5.5, &Still, &vanishes)?.position.y < -0.5);
    Ok(())
}

/// A ball that lies on the ground is hit by a bat: it leaves at (1 + e) times the speed of the bat.
#[test]
fn a_bat_hits_what_rests() -> Result<(), Error> {
    let bat = Board {
        half: Vector::new(0.02, 0.3, 0.3),
        ..board(|t| (Vector::new(-0.5 + 5.0 * (t - 3.0).clamp(0.0, 0.15), 0.0, 0.0), 0.0))
    };
    let air = dlsys_fall::Air { density: 0.0, ..Default::default() };
    let settings = Settings { air, ..Settings::default() };
    let release = Motion::at(Vector::new(0.0, 0.1, 0.0));
    let ground = Ground { friction: 0.0, ..Ground::at(0.0) };
    let mut fall = Fall::new(Body::ball(0.05, 0.03)?, release, 0.0, Some(ground), settings)?;
    let lies = fall.among(3.0, &Still, &bat)?;
    assert!(lies.velocity == Vector::zeros() && lies.position.x.abs() < 1e-9, "{lies:?}");
    let hit = fall.among(3.12, &Still, &bat)?;
    assert!((hit.velocity.x - 1.2 * 5.0).abs() < 0.05, "{hit:?}");
    Ok(())
}

/// What overlaps a solid at its release, or where one appears, falls through it, and lands on it when it comes again.
#[test]
fn what_overlaps_passes_until_it_has_left() -> Result<(), Error> {
    let thick = Board { half: Vector::new(0.3, 0.1, 0.3), ..board(|_| (Vector::zeros(), 0.0)) };
    let mut fall = dropped(Body::ball(0.01, 0.02)?, 0.05)?;
    let mut speed = 0.0_f64;
    for k in 1..40 {
        let motion = fall.among(f64::from(k) * 0.01, &Still, &thick)?;
        speed = speed.max(motion.velocity.norm());
    }
    assert!(fall.among(0.4, &Still, &thick)?.position.y < -0.5);
    assert!(speed < 9.81 * 0.41, "nothing pushes it: {speed}");
    // A board that appears around a ball, below which there is ground.
    let appears = Board { there: [1.0, f64::INFINITY], ..board(|_| (Vector::new(0.0, 0.02, 0.0), 0.0)) };
    let release = Motion::at(Vector::new(0.0, 0.1, 0.0));
    let mut fall =
        Fall::new(Body::ball(0.01, 0.02)?, release, 0.0, Some(Ground::at(0.0)), Settings::default())?;
    for k in 0..100 {
        let motion = fall.among(0.9 + f64::from(k) * 0.02, &Still, &appears)?;
        assert!((motion.position.y - 0.02).abs() < 1e-3, "{motion:?}");
    }
    Ok(())
}

/// A board that presses a ball against the ground goes through it, and neither hangs nor throws it.
#[test]
fn what_is_squeezed_slips_through() -> Result<(), Error> {
    let press = board(|t| (Vector::new(0.0, 0.2 - 0.1 * t.min(4.0), 0.0), 0.0));
    let release = Motion::at(Vector::new(0.0, 0.021, 0.0));
    let mut fall =
        Fall::new(Body::ball(0.01, 0.02)?, release, 0.0, Some(Ground::at(0.0)), Settings::default())?;
    for k in 1..60 {
        let motion = fall.among(f64::from(k) * 0.1, &Still, &press)?;
        assert!(motion.velocity.norm() < 2.0 && motion.position.norm() < 0.5, "{motion:?}");
    }
    assert!(fall.steps() < 100_000, "{}", fall.steps());
    Ok(())
}

#[test]
fn any_order_of_times_gives_the_same_bits() -> Result<(), Error> {
    let swings = board(|t| (Vector::new(0.1 * (3.0 * t).sin(), 0.0, 0.0), 0.9 * (2.0 * t).sin()));
    let times: Vec<f64> = (0..200).map(|k| 0.017 * f64::from(k)).collect();
    let mut straight = dropped(petal()?, 0.2)?;
    let all: Vec<Motion> =
        times.iter().map(|time| straight.among(*time, &Still, &swings)).collect::<Result<_, _>>()?;
    assert!(all[199].position.y < -1.0, "it has slid off: {:?}", all[199]);
    let mut mixed = dropped(petal()?, 0.2)?;
    mixed.keep_steps(50);
    for k in (0..200).map(|k| k * 77 % 200) {
        assert_eq!(mixed.among(times[k], &Still, &swings)?, all[k], "{k}");
    }
    Ok(())
}
