//! Elimination over the tree: one segment at a time, from the tips to the roots, and back.

use crate::forces::{Damper, attachment, hang};
use crate::form::{Form, Twist, Wrench, ZEROS};
use crate::place::Place;
use crate::{Matrix, Vector};

/// Weights of mass, damping and stiffness in a matrix.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Weights {
    pub mass: f64,
    pub damping: f64,
    pub stiffness: f64,
    /// Elastic stiffness in addition, without the geometric one.
    pub extra: f64,
    /// Square of the time for which levers of masses are unsure, in s².
    pub blur: f64,
}

/// The working memory of one segment.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Link {
    /// Before the elimination the form of the segment and of all beyond it; after it, `moment` and `force` are multiplied by the inverse
    /// pivot, and `own` is the inverse pivot.
    pub form: Form,
    /// Right-hand side, or wrench of the load: on the base and on the strain.
    pub wrench: Wrench,
    pub pull: Vector,
    /// The same for the second stage, with its own geometry.
    pub late_wrench: Wrench,
    pub late_pull: Vector,
    /// Sum of forces, and sums of place times force.
    pub thrust: Vector,
    pub virial: Matrix,
    pub mean: Matrix,
    pub late: Matrix,
    /// Geometric stiffness, between the turn of the base and the strain, and of the strain.
    pub mixed: Matrix,
    pub stiff: Matrix,
    pub damper: Damper,
    /// Change of the drag by the change of the wind during the step.
    pub gust: (Wrench, Vector),
    /// Wind at the end of the step, in the world.
    pub wind: Vector,
    /// Solution: velocity of the base, rate of the strain.
    pub twist: Twist,
    pub x: Vector,
    /// Solution of the first stage.
    pub first: Vector,
    /// Errors as displacements: of strain, and of its rate times the step.
    pub errors: [Twist; 2],
    pub error_x: [Vector; 2],
}

impl Link {
    pub(crate) const ZERO: Link = {
        let zero = Vector::new(0.0, 0.0, 0.0);
        Link {
            form: Form::ZERO,
            wrench: Wrench::ZERO,
            pull: zero,
            late_wrench: Wrench::ZERO,
            late_pull: zero,
            thrust: zero,
            virial: ZEROS,
            mean: ZEROS,
            late: ZEROS,
            mixed: ZEROS,
            stiff: ZEROS,
            damper: Damper::ZERO,
            gust: (Wrench::ZERO, zero),
            wind: zero,
            twist: Twist::ZERO,
            x: zero,
            first: zero,
            errors: [Twist::ZERO; 2],
            error_x: [zero; 2],
        }
    };

    /// Geometric stiffness from the sums of place times force.
    ///
    /// Forces that stay as they are while frames before them turn by φ and then by χ do the work `φᵀ (Σ r Fᵀ - tr) χ`, second order in the
    /// turns: that is minus the second derivative of their potential.
    #[inline(always)]
    pub(crate) fn stiffen(&mut self, place: &Place) {
        let mut late = (self.late + self.late.transpose()) * -0.5;
        let (mean_trace, late_trace) = (self.mean.trace(), self.late.trace());
        let mut mean = -self.mean;
        for k in 0..3 {
            mean[(k, k)] += mean_trace;
            late[(k, k)] += late_trace;
        }
        self.mixed = mean * place.turning;
        self.stiff = place.turning.tr_mul(&(late * place.turning));
    }

    /// Product of the geometric stiffness with a turn of the base and a strain: added, times `factor`, to the right-hand side.
    #[inline(always)]
    pub(crate) fn press(&mut self, factor: f64, length: f64, turn: &Vector, strain: &Vector) {
        let long = strain * length;
        self.wrench.moment += self.mixed * long * factor;
        self.pull += (self.mixed.tr_mul(turn) + self.stiff * long) * factor;
    }

    /// Eliminates the strain. `material` is the diagonal of springs and dampers; `rigid` segments have no strain. Returns whether the
    /// geometric stiffness could stay.
    #[inline(always)]
    pub(crate) fn eliminate(&mut self, length: f64, material: &Vector, stiffness: f64, rigid: bool) -> bool {
        let form = &mut self.form;
        if rigid {
            form.moment = ZEROS;
            form.force = ZEROS;
            form.own = ZEROS;
            return true;
        }
        let plain = form.own * length + Matrix::from_diagonal(material);
        let mut kept = true;
        let mut inverse = ZEROS;
        if stiffness != 0.0 {
            let pivot = plain + self.stiff * (stiffness * length);
            // A pivot that is nearly singular is as bad for the step as a negative one.
            if let Some(good) = invert(&pivot, &plain) {
                inverse = good;
                form.moment += self.mixed * stiffness;
            } else {
                kept = false;
            }
        }
        if !kept || stiffness == 0.0 {
            self.mixed = ZEROS;
            self.stiff = ZEROS;
            // Neither mass nor stiffness: nothing moves the strain.
            inverse = invert(&plain, &plain).unwrap_or(ZEROS);
        }
        let (moment, force) = (form.moment * inverse, form.force * inverse);
        let long = form.moment.transpose() * length;
        let far = form.force.transpose() * length;
        form.inertia.aa -= moment * long;
        form.inertia.al -= moment * far;
        form.inertia.ll -= force * far;
        form.moment = moment;
        form.force = force;
        form.own = inverse;
        kept
    }

    /// Eliminates the strain from the right-hand side, after [`eliminate`](Link::eliminate).
    #[inline(always)]
    pub(crate) fn reduce(&mut self, length: f64) {
        let pull = self.pull * length;
        self.wrench.moment -= self.form.moment * pull;
        self.wrench.force -= self.form.force * pull;
    }

    /// The rate of the strain from the velocity of the base.
    #[inline(always)]
    pub(crate) fn resolve(&mut self, twist: Twist) {
        self.x = self.form.own * self.pull
            - self.form.moment.tr_mul(&twist.angular)
            - self.form.force.tr_mul(&twist.linear);
        self.twist = twist;
    }

    /// Hands form and geometric sums on to the parent.
    #[inline(always)]
    pub(crate) fn hand_form(&self, parent: &mut Link, behind: &Place, own: &Place) {
        hang(&mut parent.form, behind, own, &self.form.inertia);
        let thrust = own.turn * self.thrust;
        let virial = own.turn * self.virial * own.turn.transpose() + own.reach * thrust.transpose();
        let tip = behind.tip * thrust.transpose();
        parent.thrust += thrust;
        parent.virial += virial;
        parent.mean += virial - tip * 0.5;
        parent.late += virial - tip * (2.0 / 3.0);
    }

    /// Hands a wrench on to the parent: on its base and on its strain.
    #[inline(always)]
    pub(crate) fn hand(wrench: &Wrench, onto: (&mut Wrench, &mut Vector), behind: &Place, own: &Place) {
        let (moment, force) = (own.turn * wrench.moment, own.turn * wrench.force);
        *onto.1 += behind.turning.tr_mul(&moment) + attachment(behind, own).tr_mul(&force);
        onto.0.moment += moment + own.reach.cross(&force);
        onto.0.force += force;
    }
}

/// Velocity of the base of a child from that of the parent's base and the rate x of its strain.
#[inline(always)]
pub(crate) fn transport(twist: &Twist, x: &Vector, length: f64, behind: &Place, own: &Place) -> Twist {
    let x = x * length;
    let angular = twist.angular + behind.turning * x;
    let linear = twist.at(&own.reach) + attachment(behind, own) * x;
    Twist { angular: own.turn.tr_mul(&angular), linear: own.turn.tr_mul(&linear) }
}

/// Whether a value is a number above a bound.
#[inline(always)]
fn above(value: f64, bound: f64) -> bool {
    value > bound
}

/// Inverse of a symmetric matrix by Cholesky's decomposition, if its pivots are positive and not much below the diagonal of `scale`.
#[inline(always)]
fn invert(matrix: &Matrix, scale: &Matrix) -> Option<Matrix> {
    const SMALL: f64 = 1e-13;
    let m = |i: usize, j: usize| matrix[(i, j)];
    let d0 = m(0, 0);
    if !above(d0, SMALL * scale[(0, 0)]) {
        return None;
    }
    let l10 = m(1, 0) / d0;
    let d1 = m(1, 1) - l10 * m(1, 0);
    if !above(d1, SMALL * scale[(1, 1)]) {
        return None;
    }
    let l20 = m(2, 0) / d0;
    let t21 = m(2, 1) - l20 * m(1, 0);
    let l21 = t21 / d1;
    let d2 = m(2, 2) - l20 * m(2, 0) - l21 * t21;
    if !above(d2, SMALL * scale[(2, 2)]) {
        return None;
    }
    // L⁻¹ has these entries below its unit diagonal; the inverse is L⁻ᵀ D⁻¹ L⁻¹.
    let (a, b, c) = (-l10, l10 * l21 - l20, -l21);
    let (r0, r1, r2) = (1.0 / d0, 1.0 / d1, 1.0 / d2);
    let (i01, i02, i12) = (a * r1 + b * c * r2, b * r2, c * r2);
    let inverse =
        Matrix::new(r0 + a * a * r1 + b * b * r2, i01, i02, i01, r1 + c * c * r2, i12, i02, i12, r2);
    inverse.iter().all(|value| value.is_finite()).then_some(inverse)
}

/// The parent of a link, and the link: two elements of one slice.
#[inline(always)]
pub(crate) fn pair<T>(all: &mut [T], parent: usize, index: usize) -> (&mut T, &mut T) {
    let (before, from) = all.split_at_mut(index);
    (&mut before[parent], &mut from[0])
}
