//! Bodies that are thrown at solids, and solids that are moved through bodies, at random: none may pass through another.

use super::contact::block;
use super::courses::{Course, Courses};
use super::landing::{chance, vacuum};
use crate::motion::turn;
use crate::{Body, Error, Fall, Motion, Settings, Still, Surface, Vector};

/// The end of a random pass.
#[derive(Clone, Debug, PartialEq)]
pub struct RandomContact {
    /// Its number.
    pub seed: u64,
    /// Lengths of the body by which body and solid move towards each other in a frame of 1/60 s.
    pub lengths: f64,
    /// Whether a contact of the body was on the other side of a thin plate while over it, at any instant.
    pub pierced: bool,
    /// Largest depth of a contact of the body in a box, in half-extents of the body.
    pub depth: f64,
    /// Whether they touched.
    pub touched: bool,
    /// Largest gain of energy by contact with solids that stand still, in parts of the energy at the release; 0 with solids that move.
    pub gain: f64,
    /// Steps of the body.
    pub steps: u64,
}

/// Half the side of a plate in m.
const PLATE: f64 = 0.3;

/// A plate, a ball or a block meets a thin plate, a post or a box in any attitude, straight or grazing, at 0.1 to 100 of its lengths in a frame. In half
/// of the passes the body is at rest and the solid moves and turns; then it is followed for half a second.
///
/// # Errors
///
/// An error of the fall, which is a defect.
pub fn random_contact(seed: u64, tolerance: f64) -> Result<RandomContact, Error> {
    let x = |purpose: u64| chance(seed, purpose);
    let spread = |purpose: u64, size: f64| (2.0 * x(purpose) - 1.0) * size;
    let body = match seed % 3 {
        0 => Body::plate(2e-4, [0.01 + 0.03 * x(0), 0.01 + 0.02 * x(1)])?,
        1 => Body::ball(0.01, 0.005 + 0.03 * x(0))?,
        _ => block()?,
    };
    let size = body.size();
    let surface = Surface { friction: x(2), restitution: 0.9 * x(3), rolling: 0.02 };
    let (kind, moves) = (seed / 3 % 3, seed / 9 % 2 == 1);
    let solid = match kind {
        0 => Course::plate(PLATE, surface),
        1 => Course::new(vec![Vector::x() * -0.2, Vector::x() * 0.2], 0.004 + 0.01 * x(4), surface),
        _ => Course::cuboid(Vector::new(0.05 + 0.1 * x(4), 0.02 + 0.05 * x(5), 0.05 + 0.1 * x(6)), surface),
    };
    let lengths = libm::pow(10.0, 3.0 * x(7) - 1.0);
    // Every fourth one grazes.
    let slope = if (seed / 18).is_multiple_of(4) { 0.05 } else { 1.0 };
    let way = Vector::new(spread(8, 1.0), -slope * (0.3 + x(9)), spread(10, 1.0)).normalize();
    let velocity = way * (lengths * 2.0 * size * 60.0);
    let spin = Vector::new(spread(11, 60.0), spread(12, 60.0), spread(13, 60.0));
    let start = Vector::new(spread(14, 0.1), 0.0, spread(15, 0.1)) - way * (0.15 / way.y.abs()).min(0.6);
    let axis = Vector::new(spread(16, 1.0), spread(17, 1.0), spread(18, 1.0)).normalize();
    let (angle, turning) = (spread(19, 0.3), if moves { spread(20, 20.0) } else { 0.0 });
    let mut motion = Motion::at(start);
    motion.attitude = turn(motion.attitude, Vector::new(spread(21, 1.8), spread(22, 1.8), spread(23, 1.8)));
    motion.spin = spin;
    let solid = if moves {
        solid.on(axis, move |time| (-velocity * time, angle + turning * time))
    } else {
        motion.velocity = velocity;
        solid.on(axis, move |_| (Vector::zeros(), angle))
    };
    let courses = Courses(vec![solid]);
    let settings = Settings { steps: 1_000_000, ..vacuum(tolerance) };
    let mut fall = Fall::new(body.clone(), motion, 0.0, None, settings)?;
    let energy = |fall: &Fall, motion: &Motion| fall.energy(motion).iter().sum::<f64>();
    let begin = fall.energy(&motion)[0].max(1e-9);
    let (mut pierced, mut depth, mut gain, mut touched) = (false, 0.0_f64, 0.0_f64, false);
    // On which side of a thin plate each contact was, while it is over it.
    let mut sides: Vec<f64> = vec![0.0; body.contacts.len()];
    while let Some(part) = fall.part(0.5, &Still, &courses)? {
        touched |= !part.flight || part.within != part.after;
        if !moves {
            let change = if part.flight { [part.within, part.after] } else { [part.before, part.after] };
            let [before, after] = change.map(|motion| energy(&fall, &motion));
            gain = gain.max((after - before) / begin);
        }
        for (contact, side) in body.contacts.iter().zip(&mut sides) {
            let place = courses.0[0].local(part.after.point(contact.point), fall.reached());
            match kind {
                0 if place.x.abs().max(place.z.abs()) < PLATE => {
                    pierced |= *side * place.y < 0.0;
                    *side = place.y.signum();
                }
                0 => *side = 0.0,
                _ => depth = depth.max(-courses.0[0].distance(&place) + contact.radius),
            }
        }
    }
    Ok(RandomContact { seed, lengths, pierced, depth: depth / size, touched, gain, steps: fall.steps() })
}
