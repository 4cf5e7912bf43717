//! What soil does to a body that moves in it: a resistance that gives way, like friction, and the drag of what is set in motion.
//!
//! The resistance has a limit and no direction of its own: it is whatever keeps the body at rest, up to the limit. All of it follows from the power that soil takes up from a body
//! with velocity u at each part of its surface,
//!
//! ```text
//! D(u) = Σ (w·u)₊ + b|u_h| + s|u_y|,   force ∈ -∂D(u)
//! ```
//!
//! with the limits w, b, s of [`Bearing`](crate::Bearing), u_h along x and z. D is convex, so a body with a mass has one velocity after a span h of time, that which minimises
//! ½|u - u₀|² / W + h D(u), where u₀ is its velocity without soil: an implicit step, in which a body comes to rest exactly and stays so. No energy is gained: the power
//! of the force is -D(u), and D ≥ 0 for a body that does not turn.
//!
//! The minimum is found with cuts: D is at least each of its tangents, and few of them hold at the minimum, in three dimensions four (the bundle method: Kiwiel, *Methods of Descent for
//! Nondifferentiable Optimization*, 1985). A polyhedron ends after finitely many.

use nalgebra::{DMatrix, DVector, Matrix3};

use crate::Vector;

/// Most tangents on the way to a minimum, most of them at a time, and the gap relative to the power at which it is found.
const MOST_CUTS: usize = 200;
const KEPT: usize = 6;
const GAP: f64 = 1e-13;

/// A part of the surface of a body in soil, at one pose.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Facet {
    /// The limit of what it pushes against, in N, outward.
    pub push: Vector,
    /// The area that sets soil in motion, in m², outward.
    pub swept: Vector,
    /// Limits of friction along the horizontal and along the vertical, in N.
    pub base: f64,
    pub shaft: f64,
    /// Its place from the middle of the body, in m.
    pub arm: Vector,
}

/// The resistance of soil to a body at one pose.
#[derive(Clone, Debug, Default)]
pub(crate) struct Resistance {
    pub facets: Vec<Facet>,
    /// Drag by swept area and speed, in kg/m³.
    pub density: f64,
}

/// A tangent of the power: force and offset.
#[derive(Clone, Copy)]
struct Cut {
    force: Vector,
    offset: f64,
}

impl Resistance {
    /// The power that soil takes up from a body with this velocity (m/s) and spin (1/s), in W, and the force against its motion, in N. The force is a subgradient.
    pub fn power(&self, velocity: &Vector, spin: &Vector) -> (f64, Vector) {
        let (mut power, mut force) = (0.0, Vector::zeros());
        for facet in &self.facets {
            let at = velocity + spin.cross(&facet.arm);
            let push = facet.push.dot(&at);
            if push > 0.0 {
                power += push;
                force += facet.push;
            }
            let level = libm::hypot(at.x, at.z);
            if level > 0.0 {
                power += facet.base * level;
                force += Vector::new(at.x, 0.0, at.z) * (facet.base / level);
            }
            if at.y != 0.0 {
                power += facet.shaft * at.y.abs();
                force.y += facet.shaft * at.y.signum();
            }
        }
        (power, force)
    }

    /// The volume of soil that a body sets in motion in a second, in m³/s.
    pub fn swept(&self, velocity: &Vector, spin: &Vector) -> f64 {
        let at = |facet: &Facet| facet.swept.dot(&(velocity + spin.cross(&facet.arm))).max(0.0);
        self.facets.iter().map(at).sum()
    }

    /// The velocity after a span of time in s of a body with an inverse mass (1/kg), which without soil would have the velocity `free`, and had another one `before`; and the impulse of
    /// the soil, in N s.
    pub fn slow(
        &self,
        (before, free): (&Vector, &Vector),
        light: &Matrix3<f64>,
        spin: &Vector,
        length: f64,
    ) -> (Vector, Vector) {
        if self.facets.is_empty() {
            return (*free, Vector::zeros());
        }
        // Drag is linear in the velocity at the end, so that it never turns the motion round.
        let drag = length * self.density * self.swept(before, spin);
        let damped = (Matrix3::identity() + light * drag).try_inverse().unwrap_or_else(Matrix3::identity);
        let (light, free) = (damped * light, damped * free);
        let (velocity, force) = self.least(&free, &light, spin, length);
        (velocity, -(force * length + velocity * drag))
    }

    /// The velocity of least ½|u - free|²/W + h D(u), and the force there.
    fn least(&self, free: &Vector, light: &Matrix3<f64>, spin: &Vector, length: f64) -> (Vector, Vector) {
        let (mut at, mut found) = (*free, Vector::zeros());
        let (mut model, mut most) = (f64::NEG_INFINITY, 0.0_f64);
        let mut cuts: Vec<Cut> = Vec::with_capacity(KEPT + 1);
        for _ in 0..MOST_CUTS {
            let (power, force) = self.power(&at, spin);
            most = most.max(power.abs());
            if cuts.is_empty() && light.iter().all(|part| *part == 0.0) {
                return (at, force);
            }
            // A power that is no number ends the search, too.
            let gap = power - model;
            if gap.is_nan() || gap <= GAP * most {
                break;
            }
            cuts.push(Cut { force, offset: power - force.dot(&at) });
            let Some(active) = active(&cuts, free, light, length) else { break };
            (at, found, model) = (active.velocity, active.force, active.power);
            // Those that hold, and the youngest of the others.
            let mut number = 0;
            let spare = cuts.len().saturating_sub(KEPT);
            let mut dropped = 0;
            cuts.retain(|_| {
                let holds = active.members >> number & 1 == 1;
                number += 1;
                let drops = !holds && dropped < spare;
                dropped += usize::from(drops);
                !drops
            });
        }
        (at, found)
    }
}

/// The minimum over the largest of some tangents.
struct Active {
    velocity: Vector,
    force: Vector,
    power: f64,
    /// A bit for each tangent that holds.
    members: u32,
}

/// The best mixture of at most four tangents: with weights a ≥ 0 of sum 1 the dual value h(g·u₀ + e) - ½h² g·W g, g = Σ a g_j.
fn active(cuts: &[Cut], free: &Vector, light: &Matrix3<f64>, length: f64) -> Option<Active> {
    let mut best: Option<(f64, Active)> = None;
    for members in 1_u32..1 << cuts.len() {
        let count = members.count_ones() as usize;
        if count > 4 {
            continue;
        }
        let chosen: Vec<&Cut> = (0..cuts.len()).filter(|n| members >> n & 1 == 1).map(|n| &cuts[n]).collect();
        let Some(weights) = weights(&chosen, free, light, length) else { continue };
        if weights.iter().any(|weight| *weight < 0.0) {
            continue;
        }
        let force: Vector = chosen.iter().zip(&weights).map(|(cut, weight)| cut.force * *weight).sum();
        let offset: f64 = chosen.iter().zip(&weights).map(|(cut, weight)| cut.offset * *weight).sum();
        let slowed = light * force * length;
        let value = force.dot(free) + offset - 0.5 * force.dot(&slowed);
        if value.is_finite() && best.as_ref().is_none_or(|(known, _)| value > *known) {
            let velocity = free - slowed;
            let power = force.dot(&velocity) + offset;
            best = Some((value, Active { velocity, force, power, members }));
        }
    }
    best.map(|(_, active)| active)
}

/// The weights with which some tangents have one value where their mixture has its minimum; `None` if they do not determine any.
fn weights(cuts: &[&Cut], free: &Vector, light: &Matrix3<f64>, length: f64) -> Option<Vec<f64>> {
    let count = cuts.len();
    if count == 1 {
        return Some(vec![1.0]);
    }
    // Relative to the first one, so that what they have in common is not lost in rounding.
    let first = cuts[0];
    let apart: Vec<Vector> = cuts[1..].iter().map(|cut| cut.force - first.force).collect();
    let matrix = DMatrix::from_fn(count - 1, count - 1, |i, j| length * apart[i].dot(&(light * apart[j])));
    let there = free - light * first.force * length;
    let right = DVector::from_fn(count - 1, |i, _| apart[i].dot(&there) + cuts[i + 1].offset - first.offset);
    let scale = matrix.diagonal().max();
    let factored = matrix.full_piv_lu();
    let least = (0..count - 1).map(|n| factored.u()[(n, n)].abs()).fold(f64::INFINITY, f64::min);
    if least.is_nan() || scale.is_nan() || least <= 1e-12 * scale {
        return None;
    }
    let rest = factored.solve(&right)?;
    let mut all = vec![1.0 - rest.sum()];
    all.extend(rest.iter());
    Some(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn facet(push: [f64; 3]) -> Facet {
        Facet {
            push: Vector::from(push),
            swept: Vector::zeros(),
            base: 0.0,
            shaft: 0.0,
            arm: Vector::zeros(),
        }
    }

    /// A closed body of many facets with pressures that grow downward, with friction.
    fn body(count: u32) -> Resistance {
        let mut facets = Vec::new();
        for n in 0..count {
            let y = 1.0 - (2.0 * f64::from(n) + 1.0) / f64::from(count);
            let turn = f64::from(n) * 2.399_963_229_728_653;
            let level = (1.0 - y * y).sqrt();
            let out = Vector::new(level * libm::cos(turn), y, level * libm::sin(turn));
            let push = out * ((1.5 - y) / f64::from(count) * 100.0);
            let (base, shaft) = (0.4 * (-push.y).max(0.0), 0.1 * level);
            facets.push(Facet { push, swept: out * 0.01, base, shaft, arm: out });
        }
        Resistance { facets, density: 500.0 }
    }

    fn random(seed: &mut u64) -> f64 {
        *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*seed >> 11) as f64 / (1_u64 << 53) as f64 * 2.0 - 1.0
    }

    #[test]
    fn one_direction_is_friction() {
        let all = Resistance { facets: vec![facet([0.0, -10.0, 0.0])], density: 0.0 };
        let light = Matrix3::identity() * 0.5;
        let zero = Vector::zeros();
        let after = |free: f64| {
            let (velocity, impulse) = all.slow((&zero, &Vector::new(0.0, free, 0.0)), &light, &zero, 0.1);
            (velocity.y, impulse.y)
        };
        // The limit of 10 N stops a mass of 2 kg from 0.5 m/s in 0.1 s, and never pushes it up.
        assert!((after(-0.8).0 + 0.3).abs() < 1e-15 && (after(-0.8).1 - 1.0).abs() < 1e-15);
        assert!(after(-0.3).0.abs() < 1e-16 && (after(-0.3).1 - 0.6).abs() < 1e-15);
        assert_eq!(after(0.2), (0.2, 0.0));
    }

    #[test]
    fn the_minimum_is_one() {
        let all = body(400);
        let mut seed = 7;
        let zero = Vector::zeros();
        for light in [
            Matrix3::identity() * 0.3,
            Matrix3::from_diagonal(&Vector::new(0.3, 0.1, 0.0)),
            Matrix3::from_diagonal(&Vector::new(0.0, 0.2, 0.0)),
        ] {
            for turns in [0.0, 3.0] {
                for _ in 0..20 {
                    let spin = Vector::new(random(&mut seed), random(&mut seed), random(&mut seed)) * turns;
                    let free = Vector::new(random(&mut seed), random(&mut seed), random(&mut seed))
                        * 30.0
                        * random(&mut seed);
                    let (length, mut worst) = (0.05, 0.0_f64);
                    let (velocity, force) = all.least(&free, &light, &spin, length);
                    assert!((free - light * force * length - velocity).norm() < 1e-12 * (1.0 + free.norm()));
                    let cost = |at: &Vector| {
                        let way = at - free;
                        let mut cost = length * all.power(at, &spin).0;
                        for axis in 0..3 {
                            let light = light[(axis, axis)];
                            cost += if light > 0.0 { 0.5 * way[axis] * way[axis] / light } else { 0.0 };
                        }
                        cost
                    };
                    let here = cost(&velocity);
                    for _ in 0..200 {
                        let step = Vector::new(random(&mut seed), random(&mut seed), random(&mut seed));
                        let step =
                            step.zip_map(&light.diagonal(), |way, light| if light > 0.0 { way } else { 0.0 });
                        for scale in [1e-6, 1e-3, 1.0] {
                            worst = worst.max((here - cost(&(velocity + step * scale))) / (1.0 + here));
                        }
                    }
                    assert!(worst < 1e-9, "{worst} at {velocity}");
                    let gained = velocity.dot(&force);
                    assert!(turns > 0.0 || gained >= -1e-9, "soil gives {gained} W");
                }
            }
        }
        // What it can hold rests to rounding.
        let (velocity, _) =
            all.slow((&zero, &Vector::new(0.01, -0.1, 0.02)), &(Matrix3::identity() * 0.3), &zero, 0.05);
        assert!(velocity.norm() < 1e-14, "{velocity}");
    }

    #[test]
    fn drag_slows_and_never_turns_round() {
        let facets = vec![Facet { swept: -Vector::y(), ..facet([0.0; 3]) }];
        let all = Resistance { facets, density: 1000.0 };
        let (light, zero) = (Matrix3::identity(), Vector::zeros());
        let before = Vector::new(0.0, -5.0, 0.0);
        let (velocity, impulse) = all.slow((&before, &before), &light, &zero, 1e-3);
        assert!((velocity.y + 5.0 / 6.0).abs() < 1e-14 && (impulse.y - (5.0 - 5.0 / 6.0)).abs() < 1e-14);
        let (velocity, _) = all.slow((&before, &before), &light, &zero, 1e3);
        assert!(velocity.y < 0.0);
        assert_eq!(all.slow((&zero, &-before), &light, &zero, 1.0).0, -before);
    }
}
