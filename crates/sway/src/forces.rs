//! Forces on one segment and what it carries, and its own quadratic forms of mass and damping, in its base frame.

use crate::form::{Form, Inertia, Wrench, ZEROS, cross_columns};
use crate::place::{Local, Motion, Place};
use crate::{Air, Load, Matrix, Plate, Segment, Vector};

/// Gauss points on a segment: fractions of its length. Each has half of it.
pub(crate) const GAUSS: [f64; 2] = [0.211_324_865_405_187_1, 0.788_675_134_594_812_9];
/// Where the matrix sees the drag of a segment: the point that has the right damping of its own bending, ∫₀¹ (ξ²/2)² dξ = 1/20.
const DRAG: f64 = 0.668_740_304_976_422;

/// A segment with what it carries.
#[derive(Clone, Copy)]
pub(crate) struct Part<'a> {
    pub segment: &'a Segment,
    pub loads: &'a [Load],
    pub plates: &'a [Plate],
    pub air: &'a Air,
    /// Moment of inertia about the tangent in addition to that of the sections, in kg m².
    pub rotary: f64,
}

/// Forces on a segment.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Forces {
    /// About the base.
    pub wrench: Wrench,
    /// On the strain, divided by the length: a moment.
    pub pull: Vector,
    /// Sum of place times force, for the whole (about the base), and for the mean joint of the segment, once and weighted by
    /// twice the fraction.
    pub virial: Matrix,
    pub mean: Matrix,
    pub late: Matrix,
    /// Power of the drag, in W.
    pub power: f64,
}

impl Forces {
    pub(crate) const ZERO: Forces = Forces {
        wrench: Wrench::ZERO,
        pull: Vector::new(0.0, 0.0, 0.0),
        virial: ZEROS,
        mean: ZEROS,
        late: ZEROS,
        power: 0.0,
    };

    /// A force at a place that the strain moves by `shift`.
    #[inline(always)]
    pub(crate) fn push(&mut self, place: &Vector, shift: &Matrix, force: &Vector) {
        self.wrench.push(place, force);
        self.pull += shift.tr_mul(force);
    }

    /// A moment on a section that the strain turns by `turning`.
    #[inline(always)]
    pub(crate) fn twist(&mut self, turning: &Matrix, moment: &Vector) {
        self.wrench.moment += moment;
        self.pull += turning.tr_mul(moment);
    }

    /// Geometric terms of forces at places behind a section, whose sum is `force`, and that of place times force `virial`.
    #[inline(always)]
    pub(crate) fn stretch(&mut self, virial: &Matrix, tip: &Vector, xi: f64, force: &Vector) {
        let own = tip * force.transpose();
        self.virial += virial;
        self.mean += virial * xi - own * (0.5 * xi * xi);
        self.late += virial * (xi * xi) - own * (2.0 / 3.0 * xi * xi * xi);
    }
}

/// The two Gauss points of a segment.
pub(crate) struct Stretch {
    pub points: [Motion; 2],
}

impl Stretch {
    #[inline(always)]
    pub(crate) fn new(local: &Local) -> Stretch {
        Stretch { points: GAUSS.map(|xi| local.motion(xi)) }
    }

    /// Place and velocity of the middle, in the base frame: where wind is sampled.
    #[inline(always)]
    pub(crate) fn middle(&self) -> (Vector, Vector) {
        let [a, b] = &self.points;
        ((a.place + b.place) * 0.5, (a.velocity + b.velocity) * 0.5)
    }
}

impl Part<'_> {
    /// Whether air acts on the part.
    #[inline(always)]
    pub(crate) fn feels_air(&self) -> bool {
        self.segment.drag_diameter > 0.0 || !self.plates.is_empty()
    }

    /// Moment of inertia of half the segment's sections, about a tangent: across, then the excess along it.
    #[inline(always)]
    fn section_inertia(&self) -> (f64, f64) {
        let segment = self.segment;
        let spin = segment.mass * segment.length * segment.diameter * segment.diameter / 32.0;
        (spin, spin + 0.5 * self.rotary)
    }

    /// Weight, inertial force, and drag in a wind (base frame).
    #[inline(always)]
    pub(crate) fn forces(&self, local: &Local, place: &Place, stretch: &Stretch, wind: &Vector) -> Forces {
        let mut forces = Forces::ZERO;
        let segment = self.segment;
        let mass = 0.5 * segment.mass * segment.length;
        let area = 0.5 * segment.drag_diameter * segment.length;
        let (spin, polar) = self.section_inertia();
        let mut sum = Vector::zeros();
        for point in &stretch.points {
            let tangent = point.section.tangent();
            let mut force = point.acceleration * -mass;
            if area > 0.0 {
                let drag = self.air.cylinder_drag(area, &tangent, &(point.velocity - wind));
                forces.power += drag.dot(&point.velocity);
                force += drag;
            }
            forces.push(&point.place, &point.shift, &force);
            forces.virial += point.place * force.transpose();
            sum += force;
            let (omega, alpha) = (&point.angular, &point.angular_acceleration);
            let along = tangent * tangent.dot(omega);
            let moment = alpha * -spin - (tangent * tangent.dot(alpha) + omega.cross(&along)) * polar;
            forces.twist(&point.turning, &moment);
        }
        let own = place.tip * sum.transpose();
        forces.mean = own * (1.0 / 6.0);
        forces.late = own * (1.0 / 12.0);
        self.add_carried(local, place, wind, &mut forces);
        forces
    }

    /// Drag alone: wrench and pull of a second wind minus those of the first, at the same place and velocity.
    #[inline(always)]
    pub(crate) fn gust(&self, local: &Local, stretch: &Stretch, winds: [&Vector; 2]) -> (Wrench, Vector) {
        let mut forces = Forces::ZERO;
        let area = 0.5 * self.segment.drag_diameter * self.segment.length;
        if area > 0.0 {
            for point in &stretch.points {
                let tangent = point.section.tangent();
                let [before, after] =
                    winds.map(|wind| self.air.cylinder_drag(area, &tangent, &(point.velocity - wind)));
                forces.push(&point.place, &point.shift, &(after - before));
            }
        }
        self.gust_on_plates(local, winds, &mut forces);
        (forces.wrench, forces.pull)
    }

    /// The form of mass.
    #[inline(always)]
    pub(crate) fn mass_form(&self, local: &Local, stretch: &Stretch) -> Form {
        let mut form = Form::ZERO;
        let mass = 0.5 * self.segment.mass * self.segment.length;
        let (spin, polar) = self.section_inertia();
        for point in &stretch.points {
            form.mass(mass, &point.place, &point.shift);
            let tangent = point.section.tangent();
            let mut round = tangent * (tangent * polar).transpose();
            for k in 0..3 {
                round[(k, k)] += spin;
            }
            form.spin(&round, &point.turning);
        }
        for load in self.loads {
            let motion = local.carrier(load.at);
            let axes = motion.section.rotation();
            let arm = axes * load.centre;
            form.mass(load.mass, &(motion.place + arm), &motion.shift_at(&arm));
            form.spin(&(axes * load.inertia * axes.transpose()), &motion.turning);
        }
        form
    }

    /// The form of mass, and of drag in a wind (base frame) times `damping`.
    pub(crate) fn form(&self, local: &Local, stretch: &Stretch, wind: &Vector, damping: f64) -> Form {
        let mut form = self.mass_form(local, stretch);
        if self.feels_air() {
            let damper = self.damper(local, stretch, wind);
            form.damper(&(damper.damping * damping), &damper.place, &damper.shift);
            self.plate_drag(local, wind).for_each(|drag| drag.put_into(&mut form, damping));
        }
        form
    }

    /// Adds the inertia of levers that change by the square root of `square` (m²) during the step.
    ///
    /// The inertia of a straight stem against twist is next to nothing, and grows with the square of its bend: within a step by orders of
    /// magnitude. A matrix that knows only the start of the step lets twist run away. As the methods keep their order with any matrix, and this
    /// is of second order in the step, it costs no accuracy.
    #[inline(always)]
    pub(crate) fn blur(&self, form: &mut Form, stretch: &Stretch, square: f64) {
        if square > 0.0 {
            let loads: f64 = self.loads.iter().map(|load| load.mass).sum();
            let mass = self.segment.mass * self.segment.length + loads;
            let [_, point] = &stretch.points;
            form.spin(&Matrix::from_diagonal_element(mass * square), &point.turning);
        }
    }

    /// Kinetic energy; mass, and mass times place in the base frame.
    pub(crate) fn motion(&self, local: &Local, stretch: &Stretch) -> (f64, (f64, Vector)) {
        let half = 0.5 * self.segment.mass * self.segment.length;
        let (spin, polar) = self.section_inertia();
        let (mut energy, mut mass, mut first) = (0.0, 0.0, Vector::zeros());
        for point in &stretch.points {
            let along = point.section.tangent().dot(&point.angular);
            energy += 0.5 * half * point.velocity.norm_squared();
            energy += 0.5 * (spin * point.angular.norm_squared() + polar * along * along);
            mass += half;
            first += point.place * half;
        }
        for load in self.loads {
            let motion = local.carrier(load.at);
            let axes = motion.section.rotation();
            let arm = axes * load.centre;
            let omega = axes.tr_mul(&motion.angular);
            energy += 0.5 * load.mass * motion.velocity_at(&arm).norm_squared();
            energy += 0.5 * omega.dot(&(load.inertia * omega));
            mass += load.mass;
            first += (motion.place + arm) * load.mass;
        }
        (energy, (mass, first))
    }

    /// What stands for the drag of the segment in the matrix.
    #[inline(always)]
    pub(crate) fn damper(&self, local: &Local, stretch: &Stretch, wind: &Vector) -> Damper {
        let area = self.segment.drag_diameter * self.segment.length;
        if area <= 0.0 {
            return Damper::ZERO;
        }
        let section = local.section(DRAG);
        let velocity = stretch.points[0].velocity * (1.0 - DRAG) + stretch.points[1].velocity * DRAG;
        Damper {
            place: section.place() * local.length,
            shift: section.shift() * local.length,
            damping: self.air.cylinder_damping(area, &section.tangent(), &(velocity - wind)),
        }
    }
}

/// Linear drag on a point of a segment.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Damper {
    pub place: Vector,
    pub shift: Matrix,
    pub damping: Matrix,
}

impl Damper {
    pub(crate) const ZERO: Damper =
        Damper { place: Vector::new(0.0, 0.0, 0.0), shift: ZEROS, damping: ZEROS };
}

/// The form that a child shows to its parent, and where: the end of the parent's section that carries it.
#[inline(always)]
pub(crate) fn hang(form: &mut Form, parent: &Place, child: &Place, carried: &Inertia) {
    let shift = attachment(parent, child);
    form.carry(&carried.turned(&child.turn), &child.reach, &parent.turning, &shift);
}

/// Derivative by the parent's strain, divided by its length, of the origin of a child.
#[inline(always)]
pub(crate) fn attachment(parent: &Place, child: &Place) -> Matrix {
    let arm = child.reach - parent.tip;
    if arm == Vector::zeros() {
        return parent.shift;
    }
    parent.shift - cross_columns(&arm, &parent.turning)
}
