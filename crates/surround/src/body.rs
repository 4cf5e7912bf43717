//! From the skeleton that the turtle notes to the mechanics: masses and stiffnesses in SI, and the motion of growth.

use dlsys_geometry::scene::{Point, Vector};
use dlsys_geometry::turtle::{self, Form, Piece, Stem, StemKey};
use dlsys_model::{Model, Tissue};
use dlsys_sway::{Joint, Load, Matrix, Plate, Segment, Skeleton};
use std::collections::HashMap;
use std::f64::consts::PI;

use crate::{CLOCK, Error};

/// Most times thicker that a stem becomes from one tick to the next with its curvature. Twice as thick, the same curvature stretches the
/// tissue twice as much: a stem of 1e-16 m that is one of a millimetre at the next tick would be wound up in a thousand turns. Beyond
/// this, it keeps the strain in its tissue.
const MOST_THICKENING: f64 = 2.0;

/// The part of its curvature that a stem keeps which has become thicker.
pub(crate) fn kept(before: f64, now: f64) -> f64 {
    if now > MOST_THICKENING * before { MOST_THICKENING * before / now } else { 1.0 }
}

/// Drag of a ball and of a rod in parts of that of plates that show the same area (1.2): coefficients 0.47 and 1.1.
const DRAG: [f64; 2] = [0.47 / 1.2, 1.1 / 1.2];

/// A skeleton in SI at one instant, with the identity of its stems.
#[derive(Clone, Debug, Default)]
pub(crate) struct Body {
    pub(crate) skeleton: Skeleton,
    pub(crate) stems: Vec<Stem>,
    /// Stems by their identity.
    pub(crate) numbers: HashMap<StemKey, usize>,
    /// Whether the motion that growth prescribes is known, by stem. It is zero where it is not.
    known: Vec<bool>,
}

impl Body {
    /// Of what the turtle noted at a time of the model: a unit of length is `metre` metres.
    ///
    /// # Errors
    /// A tissue whose stiffness is out of range at that time.
    pub(crate) fn new(
        noted: turtle::Skeleton,
        model: &Model,
        (metre, time): (f64, f64),
    ) -> Result<Body, Error> {
        let tissues = &model.scenery.tissues;
        let stiffnesses = tissues.iter().map(|tissue| {
            let failed = || Error::Stiffness {
                tissue: tissue.name.to_string(),
                value: tissue.stiffness.eval_one(&[time]),
                time,
                span: tissue.span,
            };
            tissue.stiffness_at(time).ok_or_else(failed)
        });
        let stiffnesses = stiffnesses.collect::<Result<Vec<f64>, Error>>()?;
        let turtle::Skeleton { stems, loads } = noted;
        let mut carried: Vec<Vec<&turtle::Load>> = vec![Vec::new(); stems.len()];
        for load in &loads {
            carried[load.stem].push(load);
        }
        let mut skeleton = Skeleton::new();
        for (stem, carried) in stems.iter().zip(&carried) {
            let tissue = &tissues[stem.tissue];
            let damping = tissue.damping / PI;
            let parent = stem.parent.map(|parent| &stems[parent]);
            skeleton.push(Segment {
                joint: joint(parent, stem, metre),
                rest: rest(stem) / metre,
                damping,
                sag: tissue.sag,
                ..Segment::solid(
                    stem.parent,
                    stem.length * metre,
                    stem.width * metre,
                    stiffnesses[stem.tissue],
                    tissue.density,
                )
            });
            for load in carried {
                carry(&mut skeleton, stem, &load.piece, tissues, metre);
            }
        }
        let numbers = stems.iter().enumerate().map(|(i, stem)| (stem.key, i)).collect();
        let known = vec![false; stems.len()];
        Ok(Body { skeleton, stems, numbers, known })
    }

    /// Sets the motion that growth prescribes, from the same stems a little earlier.
    pub(crate) fn move_from(&mut self, earlier: &Body, seconds: f64) {
        for (i, segment) in self.skeleton.segments_mut().iter_mut().enumerate() {
            let Some(&before) = earlier.numbers.get(&self.stems[i].key) else { continue };
            let before = &earlier.skeleton.segments()[before];
            let turned = segment.joint.rotation * before.joint.rotation.transpose();
            segment.joint.angular_velocity = rotation_vector(&turned) / seconds;
            segment.joint.velocity = (segment.joint.offset - before.joint.offset) / seconds;
            self.known[i] = true;
            // One that is so young that it is many times thicker at the next tick stays as it is up to then: it would become long,
            // and no stiffer.
            let thicker = segment.diameter + (segment.diameter - before.diameter) * (CLOCK / seconds);
            if thicker > MOST_THICKENING * segment.diameter {
                self.known[i] = false;
                continue;
            }
            segment.length_rate = (segment.length - before.length) / seconds;
            segment.rest_rate = (segment.rest - before.rest) / seconds;
        }
    }

    /// Sets the motion that growth prescribes to that of the same stems at the tick before.
    pub(crate) fn move_as(&mut self, before: &Body) {
        for (i, segment) in self.skeleton.segments_mut().iter_mut().enumerate() {
            let Some(&number) = before.numbers.get(&self.stems[i].key) else { continue };
            self.known[i] = before.known[number];
            let before = &before.skeleton.segments()[number];
            segment.joint.angular_velocity = before.joint.angular_velocity;
            segment.joint.velocity = before.joint.velocity;
            segment.length_rate = before.length_rate;
            segment.rest_rate = before.rest_rate;
        }
    }

    /// Sets the accelerations that growth prescribes, from the motion of the same stems an interval earlier. A stem has none whose
    /// motion is not known at both instants: one that is born at a tick is already growing then, and is not pushed at the next.
    pub(crate) fn accelerate_from(&mut self, earlier: &Body, seconds: f64) {
        for (i, segment) in self.skeleton.segments_mut().iter_mut().enumerate() {
            let Some(&before) = earlier.numbers.get(&self.stems[i].key) else { continue };
            if !self.known[i] || !earlier.known[before] {
                continue;
            }
            let before = &earlier.skeleton.segments()[before];
            let joint = &mut segment.joint;
            joint.angular_acceleration = (joint.angular_velocity - before.joint.angular_velocity) / seconds;
            joint.acceleration = (joint.velocity - before.joint.velocity) / seconds;
            segment.length_acceleration = (segment.length_rate - before.length_rate) / seconds;
            segment.rest_acceleration = (segment.rest_rate - before.rest_rate) / seconds;
        }
    }

    /// The same skeleton, of whose motion nothing is known.
    pub(crate) fn unmoved(&self) -> Body {
        let mut body = self.clone();
        for segment in body.skeleton.segments_mut() {
            segment.joint = Joint::fixed(segment.joint.rotation, segment.joint.offset);
            (segment.length_rate, segment.length_acceleration) = (0.0, 0.0);
            (segment.rest_rate, segment.rest_acceleration) = Default::default();
        }
        body.known.fill(false);
        body
    }

    /// Notes that growth does not move it.
    pub(crate) fn stand(&mut self) {
        self.known.fill(true);
    }

    /// True if it is known that growth moves nothing, and begins to move nothing.
    pub(crate) fn stands(&self) -> bool {
        let zero = dlsys_sway::Vector::zeros();
        self.known.iter().all(|known| *known)
            && !self.moves()
            && self.skeleton.segments().iter().all(|segment| {
                let Joint { angular_acceleration, acceleration, .. } = segment.joint;
                angular_acceleration == zero
                    && acceleration == zero
                    && segment.length_acceleration == 0.0
                    && segment.rest_acceleration == zero
            })
    }

    /// True if growth moves anything.
    pub(crate) fn moves(&self) -> bool {
        self.skeleton.segments().iter().any(|segment| {
            let Joint { angular_velocity, velocity, .. } = segment.joint;
            let zero = dlsys_sway::Vector::zeros();
            angular_velocity != zero
                || velocity != zero
                || segment.length_rate != 0.0
                || segment.rest_rate != zero
        })
    }

    /// The skeleton a time later (s), growth going on as now.
    pub(crate) fn later(&self, by: f64, out: &mut Skeleton) {
        out.clone_from(&self.skeleton);
        for segment in out.segments_mut() {
            let joint = &mut segment.joint;
            let (spin, drift) = (
                joint.angular_velocity * by + joint.angular_acceleration * (by * by / 2.0),
                joint.velocity * by + joint.acceleration * (by * by / 2.0),
            );
            joint.offset += drift;
            joint.rotation = nalgebra::Rotation3::new(spin).matrix() * joint.rotation;
            joint.angular_velocity += joint.angular_acceleration * by;
            joint.velocity += joint.acceleration * by;
            segment.length += segment.length_rate * by + segment.length_acceleration * (by * by / 2.0);
            segment.length = segment.length.max(0.0);
            segment.length_rate += segment.length_acceleration * by;
            segment.rest += segment.rest_rate * by + segment.rest_acceleration * (by * by / 2.0);
            segment.rest_rate += segment.rest_acceleration * by;
        }
    }
}

/// The rotation that a stem's frame is turned about its heading against another, in radians.
pub(crate) fn roll(from: &Stem, to: &Stem) -> f64 {
    let turned = frame(from.axes).transpose() * frame(to.axes);
    // The twist of the swing-twist decomposition about the first axis.
    (turned[(2, 1)] - turned[(1, 2)]).atan2(turned[(1, 1)] + turned[(2, 2)])
}

/// A strain in the frame that is rolled by an angle about the heading.
pub(crate) fn rolled(strain: Vector, angle: f64) -> Vector {
    let (sin, cos) = angle.sin_cos();
    Vector::new(strain.x, cos * strain.y + sin * strain.z, cos * strain.z - sin * strain.y)
}

pub(crate) fn frame(axes: [Vector; 3]) -> Matrix {
    Matrix::from_columns(&axes)
}

/// The place of a stem relative to the end of its parent.
fn joint(parent: Option<&Stem>, stem: &Stem, metre: f64) -> Joint {
    let (axes, origin) = match parent {
        Some(parent) => (frame(parent.end_axes).transpose(), parent.end),
        None => (Matrix::identity(), Point::origin()),
    };
    Joint::fixed(axes * frame(stem.axes), axes * (stem.start - origin) * metre)
}

/// The mean curvature of a stem at rest, per scene unit.
fn rest(stem: &Stem) -> Vector {
    if stem.length == 0.0 || stem.axes == stem.end_axes {
        return Vector::zeros();
    }
    rotation_vector(&(frame(stem.axes).transpose() * frame(stem.end_axes))) / stem.length
}

/// The vector of a rotation: its axis times its angle.
pub(crate) fn rotation_vector(rotation: &Matrix) -> Vector {
    let odd = Vector::new(
        rotation[(2, 1)] - rotation[(1, 2)],
        rotation[(0, 2)] - rotation[(2, 0)],
        rotation[(1, 0)] - rotation[(0, 1)],
    );
    let (sin, cos) = (odd.norm() / 2.0, (rotation.trace() - 1.0) / 2.0);
    if sin > 1e-6 {
        // Without an arc cosine, which is not a number where rounding makes a cosine larger than 1.
        return odd * (sin.atan2(cos) / (2.0 * sin));
    }
    if cos > 0.0 {
        // To second order the odd part is the vector.
        return odd / 2.0;
    }
    // About half a turn, whose axis the odd part does not show.
    let rotation = nalgebra::Rotation3::from_matrix_unchecked(*rotation);
    nalgebra::UnitQuaternion::from_rotation_matrix(&rotation).scaled_axis()
}

/// Mass in kg of a unit of the measure of a piece, where a unit of length is `metre` metres.
pub(crate) fn density(piece: &Piece, tissues: &[Tissue], metre: f64) -> f64 {
    let tissue = piece.tissue.map(|tissue| &tissues[tissue]);
    let density = tissue.map_or(Tissue::SURFACE_DENSITY, |tissue| tissue.density);
    match piece.form {
        Form::Surface(_) => density * thickness(piece, tissues) * metre * metre,
        Form::Ball(_) | Form::Rod(_) => density * metre.powi(3),
    }
}

/// Thickness of a surface in m.
pub(crate) fn thickness(piece: &Piece, tissues: &[Tissue]) -> f64 {
    piece.tissue.map_or(Tissue::THICKNESS, |tissue| tissues[tissue].thickness)
}

/// Adds what a stem carries at its end.
fn carry(skeleton: &mut Skeleton, stem: &Stem, load: &Piece, tissues: &[Tissue], metre: f64) {
    let dense = density(load, tissues, metre);
    let drag = match load.form {
        Form::Surface(_) => 1.0,
        Form::Ball(_) => DRAG[0],
        Form::Rod(_) => DRAG[1],
    };
    let axes = frame(stem.end_axes).transpose();
    let centre = axes * (load.centre - stem.end) * metre;
    let spread = axes * load.spread * axes.transpose() * (dense * metre * metre);
    let inertia = Matrix::identity() * spread.trace() - spread;
    skeleton.load(Load { at: 1.0, mass: load.form.measure() * dense, centre, inertia });
    for face in load.faces {
        let area = face.norm();
        if let Some(normal) = face.try_normalize(1e-300) {
            skeleton.plate(Plate {
                at: 1.0,
                centre,
                normal: axes * normal,
                area: area * metre * metre * drag,
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rotation_has_its_vector() {
        for vector in
            [Vector::new(1e-12, -2e-12, 0.0), Vector::new(0.3, -0.7, 1.1), Vector::new(0.0, 3.0, 0.0)]
        {
            let rotation = *nalgebra::Rotation3::new(vector).matrix();
            assert!(
                (rotation_vector(&rotation) - vector).norm() < 1e-12 * vector.norm().max(1e-3),
                "{vector}"
            );
        }
    }

    #[test]
    fn a_strain_is_carried_over_a_roll() {
        let stem = |roll: f64| {
            let (sin, cos) = roll.sin_cos();
            let (left, up) = (-Vector::x(), Vector::z());
            let axes = [Vector::y(), left * cos + up * sin, up * cos - left * sin];
            let key = StemKey { module: 0, number: 0 };
            let (start, end) = (Point::origin(), Point::new(0.0, 1.0, 0.0));
            Stem {
                key,
                origin: turtle::Origin::new(dlsys_model::KindId::OPEN, dlsys_tree::Lineage::of_axiom(0)),
                parent: None,
                depth: 0,
                start,
                axes,
                end,
                end_axes: axes,
                length: 1.0,
                width: 0.1,
                tissue: 0,
            }
        };
        let (a, b) = (stem(0.4), stem(1.7));
        let strain = Vector::new(0.1, 0.2, -0.5);
        let after = rolled(strain, roll(&a, &b));
        assert!((frame(a.axes) * strain - frame(b.axes) * after).norm() < 1e-14);
    }

    /// Rotations of the size of those in a tick, of half a turn, and between.
    #[test]
    fn rotations_have_their_vectors() {
        let axis = Vector::new(0.3, -0.5, 0.2).normalize();
        for tenths in -170..=5_i32 {
            let angle = (10_f64.powf(f64::from(tenths) / 10.0)).min(std::f64::consts::PI - 1e-12);
            let rotation = nalgebra::Rotation3::new(axis * angle).into_inner();
            // As a product of two frames, whose rounding makes the trace larger than 3 now and then.
            let frame = nalgebra::Rotation3::new(Vector::new(0.7, f64::from(tenths), 1.1)).into_inner();
            let vector = rotation_vector(&(rotation * frame * frame.transpose()));
            assert!((vector - axis * angle).norm() < 1e-9, "{angle}: {vector}");
        }
    }
}
