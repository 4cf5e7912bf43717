//! Solids that are led: their equations of motion are integrated here, by formulas, from tick to tick, and the sheet has their mass only.

use dlsys_sheet::{
    Air, Drive, Error, Grip, Led, Matrix, Mesh, Place, Settings, Shape, Sheet, Solid, Solver, State, Still,
    Tissue, Vector,
};

const MASS: f64 = 0.1;
const GRAVITY: Vector = Vector::new(0.0, -9.81, 0.0);
/// 1/64 s: a multiple of the solver's own steps.
const TICK: f64 = 1.0 / 64.0;

fn settings(tolerance: f64) -> Settings {
    Settings { tolerance, longest: TICK, ..Settings::default() }
}

/// A cloth of 1 by 1 m.
fn cloth(held: bool) -> Result<Sheet, Error> {
    let mesh = Mesh::rectangle(Vector::zeros(), [Vector::x(), Vector::z()], [8, 8]);
    Sheet::new(&mesh, &Tissue::new(1e6, 1000.0, 1e-3), |point| held && (point.x == 0.0 || point.x == 1.0))
}

/// A force that is linear in time, from a beginning on, with an impulse and an integral of it over a time h.
fn line([impulse, integral]: [Vector; 2], h: f64) -> [Vector; 2] {
    let rate = (impulse * (h / 2.0) - integral) * (12.0 / (h * h * h));
    [impulse / h - rate * (h / 2.0), rate]
}

/// The way of a body through ticks of 1/64 s, and the state of the sheet at the end of each.
fn follow(
    (sheet, shape): (&Sheet, &Shape),
    (mut place, gravity): (Place, Vector),
    inverse_mass: &Matrix,
    (tolerance, ticks): (f64, usize),
) -> Result<Vec<(Place, State)>, Error> {
    let air = Air { gravity, ..Air::default() };
    let mut solver = Solver::new(Settings { air, ..settings(tolerance) });
    let mut state = State::at_rest(sheet);
    let mut track = Vec::new();
    for tick in 0..ticks {
        let (begin, end) = (tick as f64 * TICK, (tick + 1) as f64 * TICK);
        // Some force is assumed, right or wrong.
        let [guess, rate] = [Vector::new(0.0, 0.4, 0.1), Vector::new(0.0, -20.0, 7.0)];
        let path = |time: f64| {
            let t = time - begin;
            let (acceleration, jerk) = (gravity + inverse_mass * guess, inverse_mass * rate);
            let way = place.velocity * t + acceleration * (t * t / 2.0) + jerk * (t * t * t / 6.0);
            let speed = place.velocity + acceleration * t + jerk * (t * t / 2.0);
            Place { position: place.position + way, velocity: speed, ..place }
        };
        let led = Led::new(&path, inverse_mass)?.assuming(begin, guess, rate);
        state.bodies = vec![Led::start()];
        let mut pushed = [Vector::zeros(); 2];
        let pushes =
            solver.advance(sheet, &mut state, begin..end, &[Solid::led(shape, led)], &Still, |step| {
                let impulse = step.pushes[0].impulse;
                pushed[0] += impulse;
                pushed[1] += impulse * (end - 0.5 * (step.from + step.to));
            })?;
        assert_eq!(pushes[0].impulse, pushed[0]);
        let h = TICK;
        let assumed = [guess * h + rate * (h * h / 2.0), guess * (h * h / 2.0) + rate * (h * h * h / 6.0)];
        let more = led.effect(&state.bodies[0], [pushed[0] - assumed[0], pushed[1] - assumed[1]]);
        let [force, rate] = line([assumed[0] + more[0], assumed[1] + more[1]], h);
        let (acceleration, jerk) = (gravity + inverse_mass * force, inverse_mass * rate);
        let there = led.place(end, &state.bodies[0]);
        place.position += place.velocity * h + acceleration * (h * h / 2.0) + jerk * (h * h * h / 6.0);
        place.velocity += acceleration * h + jerk * (h * h / 2.0);
        assert!(
            (there.position - place.position).norm() < 1e-12
                && (there.velocity - place.velocity).norm() < 1e-10
        );
        track.push((place, state.clone()));
    }
    Ok(track)
}

/// A ball that falls onto a cloth beside its middle does what a free ball does that friction does not turn.
#[test]
fn a_led_ball_does_what_a_free_ball_does() -> Result<(), Error> {
    let (sheet, shape) = (cloth(true)?, Shape::ball(0.1)?);
    let start = Place::at(Vector::new(0.45, 0.3, 0.52));
    let free = |tolerance: f64| -> Result<Vec<Vector>, Error> {
        let mut state = State::at_rest(&sheet).with(vec![start]);
        let mut solver = Solver::new(settings(tolerance));
        let drive = Drive::Free { mass: MASS, inertia: [1e9; 3] };
        let solids = [Solid { shape: &shape, drive, grip: Grip::default() }];
        (0..40)
            .map(|tick| {
                let span = tick as f64 * TICK..(tick + 1) as f64 * TICK;
                solver.advance(&sheet, &mut state, span, &solids, &Still, |_| ())?;
                Ok(state.bodies[0].position)
            })
            .collect()
    };
    let exact = free(1e-6)?;
    let light = Matrix::from_diagonal_element(1.0 / MASS);
    let mut errors = Vec::new();
    for tolerance in [1e-3, 1e-4, 1e-5] {
        let led = follow((&sheet, &shape), (start, GRAVITY), &light, (tolerance, 40))?;
        let apart = exact.iter().zip(&led).map(|(a, (b, _))| (a - b.position).norm());
        errors.push(apart.fold(0.0, f64::max));
    }
    let allowed = [1e-2, 2e-3, 2e-4];
    assert!(errors.iter().zip(allowed).all(|(error, most)| *error < most), "{errors:?}");
    let lowest = exact.iter().map(|place| place.y).fold(f64::INFINITY, f64::min);
    let aside = exact.iter().map(|place| (place.x - 0.45).abs()).fold(0.0, f64::max);
    assert!(lowest < 0.0 && aside > 5e-4, "it reaches the cloth, and is pushed aside: {lowest} {aside}");
    Ok(())
}

/// Without weight and air, a led body and a free sheet exchange momentum, and none is lost; along a direction in which nothing moves the body, it goes on.
#[test]
fn momentum_is_kept_where_the_body_moves() -> Result<(), Error> {
    let mesh = Mesh::rectangle(Vector::new(-0.5, 0.0, -0.5), [Vector::x(), Vector::z()], [8, 8]);
    let sheet = Sheet::new(&mesh, &Tissue::new(1e6, 200.0, 5e-4), |_| false)?;
    let shape = Shape::ball(0.1)?;
    let start = Place::at(Vector::new(0.12, 0.15, 0.05)).moving(Vector::new(0.4, -2.0, 0.1));
    let light = Matrix::from_diagonal(&Vector::new(0.0, 1.0 / MASS, 1.0 / MASS));
    let mut solver = Solver::new(Settings { air: Air::none(), ..settings(1e-3) });
    let (mut state, mut place, mut pushed) = (State::at_rest(&sheet), start, Vector::zeros());
    for tick in 0..20 {
        let (begin, end) = (tick as f64 * TICK, (tick + 1) as f64 * TICK);
        let path = |time: f64| Place { position: place.position + place.velocity * (time - begin), ..place };
        let led = Led::new(&path, &light)?;
        state.bodies = vec![Led::start()];
        pushed +=
            solver.advance(&sheet, &mut state, begin..end, &[Solid::led(&shape, led)], &Still, |_| ())?[0]
                .impulse;
        place = led.place(end, &state.bodies[0]);
    }
    let gained: Vector = state.velocities.iter().zip(sheet.masses()).map(|(v, m)| v * *m).sum();
    let change = (place.velocity - start.velocity) * MASS;
    assert!(change.y > 0.05 && change.x == 0.0, "{change}");
    assert!((gained + pushed).norm() < 1e-9, "{gained} {pushed}");
    assert!((change - pushed).yz().norm() < 1e-9, "{change} {pushed}");
    assert!(pushed.x.abs() > 1e-4, "friction acts along x, too");
    Ok(())
}

#[test]
fn inverse_masses_are_symmetric_and_positive() {
    let path = |_: f64| Place::at(Vector::zeros());
    let with =
        |rows: [[f64; 3]; 3]| Led::new(&path, &Matrix::from_fn(|i, j| rows[i][j])).map(|led| led.root());
    assert!(with([[4.0, 0.0, 0.0], [0.0, 9.0, 0.0], [0.0, 0.0, 0.0]]).is_ok_and(|root| root[(1, 1)] == 3.0));
    assert!(with([[0.0; 3]; 3]).is_ok_and(|root| root == Matrix::zeros()));
    assert!(with([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 0.0]]).is_err());
    assert!(with([[1.0, 0.5, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]).is_err());
    assert!(with([[1.0, f64::NAN, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]).is_err());
}
