//! Shapes and places of solids, and the gap between a solid and points, cords and faces.

use crate::error::check;
use crate::nearest::nearest;
use crate::{Attitude, Error, Vector};

/// Where a solid is, and how it moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// The origin of its axes, in m; the centre of mass of a free body.
    pub position: Vector,
    /// Turns vectors of its axes to those of the world.
    pub attitude: Attitude,
    /// Velocity of the origin in m/s.
    pub velocity: Vector,
    /// Angular velocity about the axes of the world, in rad/s.
    pub spin: Vector,
}

impl Place {
    /// At rest at a point (m), not turned.
    pub fn at(position: Vector) -> Place {
        Place { position, attitude: Attitude::identity(), velocity: Vector::zeros(), spin: Vector::zeros() }
    }

    /// The same with a velocity in m/s.
    pub fn moving(self, velocity: Vector) -> Place {
        Place { velocity, ..self }
    }

    /// Velocity in m/s of the point of the solid that is this far from its origin.
    pub fn velocity_at(&self, arm: &Vector) -> Vector {
        self.velocity + self.spin.cross(arm)
    }

    /// The place after a way in m and a turn by a rotation vector about the axes of the world, in rad.
    pub fn after(&self, way: Vector, turn: Vector) -> Place {
        Place { position: self.position + way, attitude: turned(turn) * self.attitude, ..*self }
    }

    /// Checks that it is finite.
    ///
    /// # Errors
    ///
    /// A component that is not a finite number.
    pub fn check(&self) -> Result<(), Error> {
        let vectors = [self.position, self.velocity, self.spin];
        let values = vectors.iter().flat_map(|vector| vector.iter()).chain(self.attitude.coords.iter());
        for value in values {
            check("a component of the place of a solid", *value, true, "a finite number")?;
        }
        Ok(())
    }
}

/// The turn by a rotation vector, with the same bits on all machines.
fn turned(vector: Vector) -> Attitude {
    let angle = vector.norm();
    let half = angle / 2.0;
    // sin(x)/x near 0.
    let factor = if half < 1e-4 { 0.5 - half * half / 12.0 } else { libm::sin(half) / angle };
    let [x, y, z] = (vector * factor).into();
    let quaternion = nalgebra::Quaternion::new(libm::cos(half), x, y, z);
    Attitude::new_unchecked(quaternion / quaternion.norm())
}

/// The shape of a solid: convex.
#[derive(Clone, Debug, PartialEq)]
pub struct Shape(Form);

#[derive(Clone, Debug, PartialEq)]
enum Form {
    /// All points within a radius of the convex hull of some points; the third value is the distance of the farthest one from the origin.
    Round(Vec<Vector>, f64, f64),
    /// All below the plane across the y axis through the origin.
    HalfSpace,
}

/// The gap between a solid and a point, a cord or a face.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gap {
    /// Width in m; negative inside.
    pub width: f64,
    /// Unit vector from the solid outward.
    pub normal: Vector,
    /// Weights of the corners in the nearest point.
    pub weights: [f64; 3],
}

impl Shape {
    /// A ball with a radius in m around the origin.
    ///
    /// # Errors
    ///
    /// A radius that is not above 0.
    pub fn ball(radius: f64) -> Result<Shape, Error> {
        Shape::rounded(vec![Vector::zeros()], radius)
    }

    /// The convex hull of points (m), rounded by a radius in m: all that is no farther from it. The radius bounds how far solid and sheet move
    /// relative to each other in a step, and 0.4 of it how deep the sheet is in the solid.
    ///
    /// # Errors
    ///
    /// No point, coordinates that are not finite, or a radius that is not above 0.
    pub fn rounded(points: Vec<Vector>, radius: f64) -> Result<Shape, Error> {
        check("a radius of a solid (m)", radius, radius > 0.0, "more than 0")?;
        Shape::hull(points, radius)
    }

    /// The convex hull of points (m), rounded by a radius in m that may be 0: a polyhedron then, a polygon, or a line.
    ///
    /// # Errors
    ///
    /// No point, coordinates that are not finite, or a negative radius.
    pub fn hull(points: Vec<Vector>, radius: f64) -> Result<Shape, Error> {
        check("a radius of a solid (m)", radius, radius >= 0.0, "0 or more")?;
        check("a number of points of a solid", points.len() as f64, !points.is_empty(), "at least 1")?;
        for coordinate in points.iter().flat_map(|point| point.iter()) {
            check("a coordinate of a solid (m)", *coordinate, true, "a finite number")?;
        }
        let reach = points.iter().map(Vector::norm).fold(0.0, f64::max);
        Ok(Shape(Form::Round(points, radius, reach)))
    }

    /// All that is below the plane across the y axis of the solid: a floor without end.
    pub fn half_space() -> Shape {
        Shape(Form::HalfSpace)
    }

    /// Distance of the farthest point from the origin, in m; infinite for a half-space.
    pub fn reach(&self) -> f64 {
        match &self.0 {
            Form::Round(_, radius, reach) => radius + reach,
            Form::HalfSpace => f64::INFINITY,
        }
    }

    /// The radius of the rounding in m; infinite for a half-space.
    pub fn radius(&self) -> f64 {
        match &self.0 {
            Form::Round(_, radius, _) => *radius,
            Form::HalfSpace => f64::INFINITY,
        }
    }

    /// The points whose hull is rounded; none for a half-space.
    pub fn core(&self) -> &[Vector] {
        match &self.0 {
            Form::Round(core, ..) => core,
            Form::HalfSpace => &[],
        }
    }

    /// The gap to a point, to the line between two points or to a triangle, whose corners are in the axes of the world. Within the hull that is rounded,
    /// the width is minus the radius and the normal leads away from the origin of the solid.
    pub fn gap(&self, place: &Place, corners: &[Vector]) -> Gap {
        match &self.0 {
            Form::Round(core, radius, _) => {
                let mut local = [Vector::zeros(); 3];
                for (local, corner) in local.iter_mut().zip(corners) {
                    *local = place.attitude.inverse_transform_vector(&(corner - place.position));
                }
                let local = &local[..corners.len().min(3)];
                let found = nearest(local, core);
                let distance = found.way.norm();
                let outward = if distance > 0.0 { found.way / distance } else { middle(local) };
                Gap { width: distance - radius, normal: place.attitude * outward, weights: found.weights }
            }
            Form::HalfSpace => {
                let normal = place.attitude * Vector::y();
                let height = |corner: &Vector| (corner - place.position).dot(&normal);
                let mut best = (f64::INFINITY, 0);
                for (k, corner) in corners.iter().enumerate().take(3) {
                    let height = height(corner);
                    if height < best.0 {
                        best = (height, k);
                    }
                }
                let mut weights = [0.0; 3];
                weights[best.1] = 1.0;
                Gap { width: best.0, normal, weights }
            }
        }
    }

    /// Whether faces and cords are nowhere nearer than their corners.
    pub fn is_flat(&self) -> bool {
        self.0 == Form::HalfSpace
    }
}

/// A unit vector towards the mean of points.
fn middle(points: &[Vector]) -> Vector {
    points.iter().sum::<Vector>().try_normalize(0.0).unwrap_or_else(Vector::y)
}
