//! Quadratic forms of a rigid frame's velocity: inertia and damping as one body shows them to its carrier.

use crate::{Matrix, Vector};

/// A velocity field at a frame: angular, and linear at its origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Twist {
    pub angular: Vector,
    pub linear: Vector,
}

/// Force and moment about a frame's origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Wrench {
    pub moment: Vector,
    pub force: Vector,
}

impl Twist {
    pub(crate) const ZERO: Twist = Twist { angular: ZERO, linear: ZERO };

    /// The velocity of a point at `place`.
    #[inline(always)]
    pub(crate) fn at(&self, place: &Vector) -> Vector {
        self.linear + self.angular.cross(place)
    }
}

impl Wrench {
    pub(crate) const ZERO: Wrench = Wrench { moment: ZERO, force: ZERO };

    /// Adds a force at a place.
    #[inline(always)]
    pub(crate) fn push(&mut self, place: &Vector, force: &Vector) {
        self.moment += place.cross(force);
        self.force += force;
    }
}

const ZERO: Vector = Vector::new(0.0, 0.0, 0.0);
pub(crate) const ZEROS: Matrix = Matrix::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0);

/// A symmetric form of a twist: `½ (ωᵀ aa ω + 2 ωᵀ al v + vᵀ ll v)`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Inertia {
    pub aa: Matrix,
    pub al: Matrix,
    pub ll: Matrix,
}

/// The matrix of `place ×`.
#[inline(always)]
pub(crate) fn cross(place: &Vector) -> Matrix {
    Matrix::new(0.0, -place.z, place.y, place.z, 0.0, -place.x, -place.y, place.x, 0.0)
}

/// `place × matrix`, column by column.
#[inline(always)]
pub(crate) fn cross_columns(place: &Vector, matrix: &Matrix) -> Matrix {
    let column = |k: usize| place.cross(&Vector::new(matrix[(0, k)], matrix[(1, k)], matrix[(2, k)]));
    Matrix::from_columns(&[column(0), column(1), column(2)])
}

/// `matrix · [place]`.
#[inline(always)]
pub(crate) fn times_cross(matrix: &Matrix, place: &Vector) -> Matrix {
    -cross_columns(place, &matrix.transpose()).transpose()
}

impl Inertia {
    pub(crate) const ZERO: Inertia = Inertia { aa: ZEROS, al: ZEROS, ll: ZEROS };

    /// The same form in the axes of a frame that sees this one turned.
    #[inline(always)]
    pub(crate) fn turned(&self, turn: &Matrix) -> Inertia {
        let back = turn.transpose();
        Inertia { aa: turn * self.aa * back, al: turn * self.al * back, ll: turn * self.ll * back }
    }

    /// Multiplies the form by a number.
    #[inline(always)]
    pub(crate) fn scale(&mut self, factor: f64) {
        for matrix in [&mut self.aa, &mut self.al, &mut self.ll] {
            *matrix *= factor;
        }
    }

    /// The same form for the twist at an origin from which this one's is at `place`.
    #[inline(always)]
    pub(crate) fn shifted(&self, place: &Vector) -> Inertia {
        // v here is v there + ω × place: ωᵀ al (-[r] ω) twice, symmetrised, and -[r] ll [r].
        let forward = cross_columns(place, &self.ll);
        let mixed = times_cross(&(self.al + forward * 0.5), place);
        Inertia { aa: self.aa - mixed - mixed.transpose(), al: self.al + forward, ll: self.ll }
    }
}

impl std::ops::AddAssign<&Inertia> for Inertia {
    #[inline(always)]
    fn add_assign(&mut self, other: &Inertia) {
        self.aa += other.aa;
        self.al += other.al;
        self.ll += other.ll;
    }
}

/// The form of a segment with all that it carries, in the twist of its base and in its strain's rate x times its length:
/// `½ Vᵀ inertia V + l Vᵀ (moment x, force x) + ½ l² xᵀ own x`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Form {
    pub inertia: Inertia,
    pub moment: Matrix,
    pub force: Matrix,
    pub own: Matrix,
}

impl Form {
    pub(crate) const ZERO: Form = Form { inertia: Inertia::ZERO, moment: ZEROS, force: ZEROS, own: ZEROS };

    /// Adds a mass at a place that x moves by `shift`.
    #[inline(always)]
    pub(crate) fn mass(&mut self, mass: f64, place: &Vector, shift: &Matrix) {
        let heavy = shift * mass;
        let lever = place * mass;
        self.inertia.al += cross(&lever);
        let square = lever.dot(place);
        self.inertia.aa -= lever * place.transpose();
        for k in 0..3 {
            self.inertia.ll[(k, k)] += mass;
            self.inertia.aa[(k, k)] += square;
        }
        self.force += heavy;
        self.moment += cross_columns(place, &heavy);
        self.own += shift.tr_mul(&heavy);
    }

    /// Adds a symmetric form of the velocity of a place that x moves by `shift`.
    #[inline(always)]
    pub(crate) fn damper(&mut self, damper: &Matrix, place: &Vector, shift: &Matrix) {
        let heavy = damper * shift;
        let forward = cross_columns(place, damper);
        self.inertia.al += forward;
        self.inertia.ll += damper;
        self.inertia.aa -= times_cross(&forward, place);
        self.force += heavy;
        self.moment += cross_columns(place, &heavy);
        self.own += shift.tr_mul(&heavy);
    }

    /// Adds a symmetric form of the angular velocity of a section that x turns by `turning`.
    #[inline(always)]
    pub(crate) fn spin(&mut self, spin: &Matrix, turning: &Matrix) {
        let heavy = spin * turning;
        self.inertia.aa += spin;
        self.moment += heavy;
        self.own += turning.tr_mul(&heavy);
    }

    /// Adds a form of the twist of a frame at `place` that x turns by `turning` and moves by `shift`.
    #[inline(always)]
    pub(crate) fn carry(&mut self, carried: &Inertia, place: &Vector, turning: &Matrix, shift: &Matrix) {
        let moment = carried.aa * turning + carried.al * shift;
        let force = carried.al.tr_mul(turning) + carried.ll * shift;
        self.inertia += &carried.shifted(place);
        self.moment += moment + cross_columns(place, &force);
        self.force += force;
        self.own += turning.tr_mul(&moment) + shift.tr_mul(&force);
    }
}

impl Form {
    /// The product with a twist of the base and a rate of strain times the length: moment, force, and pull on the strain.
    #[inline(always)]
    pub(crate) fn times(&self, twist: &Twist, long: &Vector) -> (Vector, Vector, Vector) {
        let Twist { angular, linear } = twist;
        let moment = self.inertia.aa * angular + self.inertia.al * linear + self.moment * long;
        let force = self.inertia.al.tr_mul(angular) + self.inertia.ll * linear + self.force * long;
        let pull = self.moment.tr_mul(angular) + self.force.tr_mul(linear) + self.own * long;
        (moment, force, pull)
    }

    /// Multiplies the form by a number.
    pub(crate) fn scale(&mut self, factor: f64) {
        self.inertia.scale(factor);
        self.moment *= factor;
        self.force *= factor;
        self.own *= factor;
    }
}
