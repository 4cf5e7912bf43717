//! Nets and sheets that solids drive too far, or hit too fast.

use super::net::hoop_net;
use crate::{Error, Mesh, Place, Settings, Shape, Sheet, Solid, Solver, State, Step, Still, Tissue, Vector};

/// How a hard case ended.
#[derive(Clone, Debug)]
pub struct HardCase {
    /// What happens.
    pub case: &'static str,
    /// Seconds.
    pub span: f64,
    /// Steps that were accepted, and rejected.
    pub steps: [u64; 2],
    /// The shortest step in s.
    pub shortest: f64,
    /// Largest depth of the sheet in the solid, in radii of that.
    pub depth: f64,
    /// The largest distance of a point from where it began, relative to the extent of the sheet, at any time, and in the last tenth of the time.
    pub moved: [f64; 2],
    /// The largest gain of energy after a step, in parts of what the body had, where the body is free.
    pub gain: Option<f64>,
    /// Why it failed.
    pub failure: Option<String>,
}

/// Radius of the ball in m, and its mass in kg.
const RADIUS: f64 = 0.12;
const MASS: f64 = 0.68;
/// A hundred lengths of the ball in a tick of 1/60 s, in m/s.
const FAST: f64 = 100.0 * 2.0 * RADIUS * 60.0;
/// Depth in radii of the ball that is allowed after a step: the bound of the solver.
const DEEPEST: f64 = 0.4;

/// The hard cases: a ball on a path takes a net, and a cloth, along to several times their length, and holds it there; a ball goes through a net at a hundred
/// lengths a frame, on its path and free.
///
/// # Errors
///
/// A sheet that cannot be made, which is a defect.
pub fn hard_cases() -> Result<Vec<HardCase>, Error> {
    let closed = hoop_net(5e-3)?;
    let open = hoop_net(0.06)?;
    let mesh = Mesh::rectangle(Vector::new(-0.5, 0.0, -0.5), [Vector::x(), Vector::z()], [8, 8]);
    let rim = |x: f64| x.abs() == 0.5;
    let cloth = Sheet::new(&mesh, &Tissue::new(1e6, 300.0, 5e-4), |point| rim(point.x) || rim(point.z))?;
    // From above down by a length at a speed, and no further.
    let path = |speed: f64, far: f64| {
        move |time: f64| {
            let (down, is_going) = ((speed * time).min(far), speed * time < far);
            let velocity = if is_going { Vector::y() * -speed } else { Vector::zeros() };
            Place::at(Vector::new(0.0, 0.3 - down, 0.0)).moving(velocity)
        }
    };
    let throw = |slow: f64| Place::at(Vector::new(-0.03, 0.3, 0.02)).moving(Vector::y() * -slow);
    Ok(vec![
        case("closed net, taken 1.5 m down one way and held", &closed, Drive::Path(&path(8.0, 1.8)), 1.0),
        case("cloth, taken 1 m down one way and held", &cloth, Drive::Path(&path(20.0, 1.3)), 1.0),
        case(
            "net of half the width, hit one way at 100 lengths a frame",
            &open,
            Drive::Path(&path(FAST, 50.0)),
            0.2,
        ),
        case(
            "net of half the width, hit both ways at 100 lengths a frame",
            &open,
            Drive::Thrown(throw(FAST)),
            0.05,
        ),
        case(
            "closed net, hit both ways at one length a frame",
            &closed,
            Drive::Thrown(throw(FAST / 100.0)),
            0.5,
        ),
    ])
}

/// How the ball moves.
enum Drive<'a> {
    Path(&'a dyn Fn(f64) -> Place),
    Thrown(Place),
}

fn case(case: &'static str, sheet: &Sheet, drive: Drive, span: f64) -> HardCase {
    let mut found = HardCase {
        case,
        span,
        steps: [0; 2],
        shortest: f64::INFINITY,
        depth: 0.0,
        moved: [0.0; 2],
        gain: None,
        failure: None,
    };
    if let Err(error) = follow(sheet, drive, &mut found) {
        found.failure = Some(error.to_string());
    } else if !(found.depth <= DEEPEST && found.moved[0].is_finite()) {
        found.failure = Some("the sheet is too deep in the solid, or nowhere".to_owned());
    } else if found.gain.is_some_and(|gain| gain > 1e-9) {
        found.failure = Some("energy is created".to_owned());
    }
    found
}

fn follow(sheet: &Sheet, drive: Drive, found: &mut HardCase) -> Result<(), Error> {
    let shape = Shape::ball(RADIUS)?;
    let mut state = State::at_rest(sheet);
    let solids = match drive {
        Drive::Path(path) => [Solid::guided(&shape, path)],
        Drive::Thrown(place) => {
            state.bodies.push(place);
            [Solid::free_ball(&shape, MASS)]
        }
    };
    let mut solver = Solver::new(Settings::default());
    let probe = solver.clone();
    let before = probe.energy(sheet, &state, 0.0, &solids).total();
    let body = state.bodies.first().map(|body| 0.5 * MASS * body.velocity.norm_squared());
    let span = found.span;
    let mut most = f64::NEG_INFINITY;
    let done = solver.advance(sheet, &mut state, 0.0..span, &solids, &Still, |step: &Step| {
        found.shortest = found.shortest.min(step.to - step.from);
        found.depth = found.depth.max(step.depths[0] / RADIUS);
        let far = step.after.positions.iter().zip(sheet.rest()).map(|(here, there)| (here - there).norm());
        let far = far.fold(0.0, f64::max) / sheet.extent();
        found.moved[0] = found.moved[0].max(far);
        if step.to > 0.9 * span {
            found.moved[1] = found.moved[1].max(far);
        }
        most = most.max(probe.energy(sheet, step.after, step.to, &solids).total() - before);
    });
    let counts = solver.counts();
    found.steps = [counts.steps, counts.rejected];
    found.gain = body.map(|body| most / body);
    done.map(|_| ())
}
