//! Loads and plates on the sections of a segment: their forces, and the damping of the plates.
//!
//! What one section carries is rigid, and moves as the section does. So the drag of its plates is summed along the section's own axes, to one force and
//! one moment: a spike with a hundred faces costs its section once.

use crate::forces::{Forces, Part};
use crate::form::{Form, Inertia, Twist, Wrench, ZEROS, cross_columns, times_cross};
use crate::place::{Local, Motion, Place};
use crate::{Matrix, Plate, Vector};

/// Forces on what a section carries, along its axes and about it.
struct OnSection {
    wrench: Wrench,
    /// Sum of arm times force.
    virial: Matrix,
}

impl OnSection {
    const ZERO: OnSection = OnSection { wrench: Wrench::ZERO, virial: ZEROS };

    #[inline(always)]
    fn push(&mut self, arm: &Vector, force: &Vector) {
        self.wrench.push(arm, force);
        self.virial += arm * force.transpose();
    }
}

/// A section that carries plates, with velocities along its axes.
struct Carrier {
    motion: Motion,
    axes: Matrix,
    twist: Twist,
}

impl Carrier {
    #[inline(always)]
    fn new(local: &Local, at: f64) -> Carrier {
        let motion = local.carrier(at);
        let axes = motion.section.rotation();
        let twist = Twist { angular: axes.tr_mul(&motion.angular), linear: axes.tr_mul(&motion.velocity) };
        Carrier { motion, axes, twist }
    }
}

/// The drag of the plates of a section as a form of its twist, in the base frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlateDrag {
    damping: Inertia,
    place: Vector,
    turning: Matrix,
    shift: Matrix,
}

impl PlateDrag {
    pub(crate) const ZERO: PlateDrag =
        PlateDrag { damping: Inertia::ZERO, place: Vector::new(0.0, 0.0, 0.0), turning: ZEROS, shift: ZEROS };

    /// Adds the drag, times `weight`, to the form of the segment.
    #[inline(always)]
    pub(crate) fn put_into(&self, form: &mut Form, weight: f64) {
        let mut damping = self.damping;
        damping.scale(weight);
        form.carry(&damping, &self.place, &self.turning, &self.shift);
    }

    /// The force on the section, about the base, and the pull on the strain, in a field of velocity of the base and a rate of strain times the length.
    #[inline(always)]
    pub(crate) fn force(&self, field: &Twist, long: &Vector) -> (Wrench, Vector) {
        let angular = field.angular + self.turning * long;
        let linear = field.at(&self.place) + self.shift * long;
        let force = -(self.damping.al.tr_mul(&angular) + self.damping.ll * linear);
        let moment = -(self.damping.aa * angular + self.damping.al * linear);
        let pull = self.shift.tr_mul(&force) + self.turning.tr_mul(&moment);
        (Wrench { moment: moment + self.place.cross(&force), force }, pull)
    }
}

/// The plates of each section.
#[inline(always)]
pub(crate) fn by_section(plates: &[Plate]) -> impl Iterator<Item = &[Plate]> {
    plates.chunk_by(|a, b| a.at == b.at)
}

impl Part<'_> {
    /// Adds weight, inertial force and drag of what the segment carries.
    #[inline(always)]
    pub(crate) fn add_carried(&self, local: &Local, place: &Place, wind: &Vector, forces: &mut Forces) {
        for load in self.loads {
            let motion = local.carrier(load.at);
            let axes = motion.section.rotation();
            let arm = axes * load.centre;
            let force = motion.acceleration_at(&arm) * -load.mass;
            let point = motion.place + arm;
            forces.push(&point, &motion.shift_at(&arm), &force);
            forces.stretch(&(point * force.transpose()), &place.tip, load.at, &force);
            let inertia = axes * load.inertia * axes.transpose();
            let turn =
                inertia * motion.angular_acceleration + motion.angular.cross(&(inertia * motion.angular));
            forces.twist(&motion.turning, &-turn);
        }
        for plates in by_section(self.plates) {
            let carrier = Carrier::new(local, plates[0].at);
            let wind = carrier.axes.tr_mul(wind);
            let mut on = OnSection::ZERO;
            for plate in plates {
                let velocity = carrier.twist.at(&plate.centre);
                let drag = self.air.plate_drag(plate.area, &plate.normal, &(velocity - wind));
                forces.power += drag.dot(&velocity);
                on.push(&plate.centre, &drag);
            }
            let force = forces.put(&carrier, &on.wrench);
            let virial = carrier.axes * on.virial * carrier.axes.transpose();
            let virial = virial + carrier.motion.place * force.transpose();
            forces.stretch(&virial, &place.tip, plates[0].at, &force);
        }
    }

    /// Adds the drag on the plates in a second wind minus that in the first.
    #[inline(always)]
    pub(crate) fn gust_on_plates(&self, local: &Local, winds: [&Vector; 2], forces: &mut Forces) {
        for plates in by_section(self.plates) {
            let carrier = Carrier::new(local, plates[0].at);
            let winds = winds.map(|wind| carrier.axes.tr_mul(wind));
            let mut on = Wrench::ZERO;
            for plate in plates {
                let velocity = carrier.twist.at(&plate.centre);
                let [before, after] =
                    winds.map(|wind| self.air.plate_drag(plate.area, &plate.normal, &(velocity - wind)));
                on.push(&plate.centre, &(after - before));
            }
            forces.put(&carrier, &on);
        }
    }

    /// What stands for the drag of the plates in the matrix, section by section.
    #[inline(always)]
    pub(crate) fn plate_drag(&self, local: &Local, wind: &Vector) -> impl Iterator<Item = PlateDrag> {
        by_section(self.plates).map(|plates| {
            let Carrier { motion, axes, twist } = Carrier::new(local, plates[0].at);
            let wind = axes.tr_mul(wind);
            let mut damping = Inertia::ZERO;
            for plate in plates {
                let velocity = twist.at(&plate.centre) - wind;
                let own = self.air.plate_damping(plate.area, &plate.normal, &velocity);
                let forward = cross_columns(&plate.centre, &own);
                damping.ll += own;
                damping.al += forward;
                damping.aa -= times_cross(&forward, &plate.centre);
            }
            let damping = damping.turned(&axes);
            PlateDrag { damping, place: motion.place, turning: motion.turning, shift: motion.shift }
        })
    }
}

impl Forces {
    /// Adds a force and a moment on a section, which are given along its axes; returns the force in the base frame.
    #[inline(always)]
    fn put(&mut self, carrier: &Carrier, wrench: &Wrench) -> Vector {
        let Carrier { motion, axes, .. } = carrier;
        let force = axes * wrench.force;
        self.push(&motion.place, &motion.shift, &force);
        self.twist(&motion.turning, &(axes * wrench.moment));
        force
    }
}
