//! Ground and bodies, which push the wind aside.
//!
//! The tangential part of the vector potential is ramped to zero at a surface (Bridson, Houriham and Nordenstam 2007, *Curl-Noise for
//! Procedural Fluid Flow*, section 2.4): A becomes αA + (1 - α)n(n·A), with α rising from 0 at the surface to 1 at the end of a
//! layer. No air passes the surface then, and the flow has no divergence, because it still is a curl.

use std::fmt;

use nalgebra::{Matrix3, Vector3};

use crate::Signal;

/// The ramp α at a share of the layer from 0 to 1, its first and its second derivative: (15r - 10r³ + 3r⁵)/8, and 1 beyond. It is odd.
pub(crate) fn ramp(r: f64) -> [f64; 3] {
    if r.abs() >= 1.0 {
        return [r.signum(), 0.0, 0.0];
    }
    let s = r * r;
    [r * (15.0 - s * (10.0 - 3.0 * s)) / 8.0, 15.0 * (1.0 - s) * (1.0 - s) / 8.0, -7.5 * r * (1.0 - s)]
}

/// The largest magnitudes of the first three derivatives of the ramp.
pub(crate) const RAMP_SLOPES: [f64; 3] = [1.875, 2.887, 15.0];

/// A body in the wind. All of its functions must be pure: equal arguments give equal values. Lengths are in metres, times in seconds.
///
/// Layers of two bodies, or of a body and the ground, may overlap, but air leaks through a surface that lies in the layer of another
/// body. A surface that moves otherwise than as a rigid body, such as one that grows, pushes the wind as the rigid body does.
pub trait Obstacle: fmt::Debug + Send + Sync {
    /// The distance of a point from the surface, negative inside.
    fn distance(&self, point: Vector3<f64>, time: f64) -> f64;

    /// The direction away from the surface at a point outside: the gradient of the distance, of length 1.
    fn normal(&self, point: Vector3<f64>, time: f64) -> Vector3<f64>;

    /// [`normal`](Obstacle::normal) and [`normal_gradient`](Obstacle::normal_gradient) at once.
    fn bending(&self, point: Vector3<f64>, time: f64) -> (Vector3<f64>, Matrix3<f64>) {
        (self.normal(point, time), self.normal_gradient(point, time))
    }

    /// The velocity of the centre in m/s.
    fn velocity(&self, time: f64) -> Vector3<f64>;

    /// The velocity of the rotation about the centre in 1/s: its direction is that of the axis. By default, there is none.
    fn spin(&self, _time: f64) -> Vector3<f64> {
        Vector3::zeros()
    }

    /// A point in the middle of the body.
    fn centre(&self, time: f64) -> Vector3<f64>;

    /// The thickness of the layer of air in which the flow turns aside, greater than 0. Air passes a body faster, the thinner its
    /// layer is.
    fn layer(&self) -> f64;

    /// The derivatives of [`normal`](Obstacle::normal): row i, column j is ∂n_i/∂x_j. By default, they are found by central
    /// differences over a thousandth of the layer, and the divergence near the body is of the order of their error.
    fn normal_gradient(&self, point: Vector3<f64>, time: f64) -> Matrix3<f64> {
        let step = 1e-3 * self.layer();
        let columns: [Vector3<f64>; 3] = std::array::from_fn(|j| {
            let offset = Vector3::ith(j, step);
            (self.normal(point + offset, time) - self.normal(point - offset, time)) / (2.0 * step)
        });
        Matrix3::from_columns(&columns)
    }
}

/// A ball.
#[derive(Debug)]
pub struct Sphere {
    /// The centre at a time in seconds.
    pub centre: [Signal; 3],
    /// The velocity in m/s at a time in seconds: the derivative of the centre.
    pub velocity: [Signal; 3],
    /// The radius in metres, greater than 0.
    pub radius: f64,
}

impl Sphere {
    /// A ball that does not move.
    pub fn fixed(centre: Vector3<f64>, radius: f64) -> Sphere {
        Sphere {
            centre: [centre.x.into(), centre.y.into(), centre.z.into()],
            velocity: [0.0.into(), 0.0.into(), 0.0.into()],
            radius,
        }
    }
}

impl Obstacle for Sphere {
    fn distance(&self, point: Vector3<f64>, time: f64) -> f64 {
        (point - self.centre(time)).norm() - self.radius
    }

    fn normal(&self, point: Vector3<f64>, time: f64) -> Vector3<f64> {
        (point - self.centre(time)).try_normalize(0.0).unwrap_or_else(Vector3::y)
    }

    fn velocity(&self, time: f64) -> Vector3<f64> {
        Vector3::from_fn(|i, _| self.velocity[i].at(time))
    }

    fn centre(&self, time: f64) -> Vector3<f64> {
        Vector3::from_fn(|i, _| self.centre[i].at(time))
    }

    /// 5/8 of the radius: the air passes the equator with 3/2 of its speed, as in potential flow.
    fn layer(&self) -> f64 {
        0.625 * self.radius
    }

    fn normal_gradient(&self, point: Vector3<f64>, time: f64) -> Matrix3<f64> {
        let normal = self.normal(point, time);
        (Matrix3::identity() - normal * normal.transpose()) / (point - self.centre(time)).norm()
    }
}

/// The height of an uneven ground and its derivatives [y, ∂y/∂x, ∂y/∂z] at x, z (in metres) and a time in seconds.
pub type Height = Box<dyn Fn(f64, f64, f64) -> [f64; 3] + Send + Sync>;

/// The ground, which the wind follows without passing through it.
///
/// The wind over uneven ground is the wind over flat ground in the coordinates (x, η, z), where η(x, y, z) is 0 on the ground and
/// approaches y above it; velocities are carried over so that a flow without divergence stays one (Piola's transformation).
pub enum Ground {
    /// The plane at this y in metres.
    Flat(f64),
    /// A surface y = h(x, z).
    Uneven {
        /// The height and its derivatives. Motion of the ground itself is left out of account.
        height: Height,
        /// The height H in metres over which the wind forgets the ground: η = y - h exp(-(y - h)/H). It must be greater than the
        /// depth of the deepest hollow below y = 0. Air passes a summit of height h with 1 + h/H of its speed. Infinite: the air
        /// rises and sinks with the ground at all heights.
        fading: f64,
    },
}

impl fmt::Debug for Ground {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Ground::Flat(height) => write!(f, "Flat({height})"),
            Ground::Uneven { fading, .. } => write!(f, "Uneven {{ fading: {fading} }}"),
        }
    }
}

impl Ground {
    /// η and its derivatives at a point.
    #[inline]
    pub(crate) fn level(&self, x: Vector3<f64>, time: f64) -> Level {
        match self {
            Ground::Flat(height) => Level { eta: x.y - height, slope: Vector3::y() },
            Ground::Uneven { height, fading } => {
                let [h, along_x, along_z] = height(x.x, x.z, time);
                let share = libm::exp(-(x.y - h).max(0.0) / fading);
                let steep = share * (1.0 + h / fading);
                Level {
                    eta: x.y - h * share,
                    slope: Vector3::new(-along_x * steep, 1.0 + h / fading * share, -along_z * steep),
                }
                .below(x.y < h)
            }
        }
    }

    /// Whether derivatives of [`Ground::level`] are the same everywhere.
    pub(crate) fn is_flat(&self) -> bool {
        matches!(self, Ground::Flat(_))
    }
}

/// η at a point, and its gradient.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Level {
    pub(crate) eta: f64,
    pub(crate) slope: Vector3<f64>,
}

impl Level {
    /// No level below the ground is positive.
    fn below(self, below: bool) -> Level {
        if below { Level { eta: self.eta.min(-f64::MIN_POSITIVE), ..self } } else { self }
    }

    /// A velocity over flat ground at (x, η, z) as one at (x, y, z).
    #[inline]
    pub(crate) fn carry(&self, v: Vector3<f64>) -> Vector3<f64> {
        let s = self.slope;
        Vector3::new(s.y * v.x, v.y - s.x * v.x - s.z * v.z, s.y * v.z)
    }

    /// A potential over flat ground at (x, η, z) as one at (x, y, z), whose curl is the carried velocity.
    pub(crate) fn carry_potential(&self, a: Vector3<f64>) -> Vector3<f64> {
        Vector3::new(a.x + self.slope.x * a.y, self.slope.y * a.y, a.z + self.slope.z * a.y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ramp_is_smooth_where_it_ends() {
        for r in [0.1, 0.5, 0.999] {
            let ([before, slope_before, _], [after, slope_after, _]) = (ramp(r - 1e-6), ramp(r + 1e-6));
            let [_, slope, bend] = ramp(r);
            assert!(((after - before) / 2e-6 - slope).abs() < 1e-8);
            assert!(((slope_after - slope_before) / 2e-6 - bend).abs() < 1e-8);
        }
        assert_eq!(ramp(0.0)[0], 0.0);
        let [value, slope, bend] = ramp(1.0 - 1e-12);
        assert!((value - 1.0).abs() < 1e-15 && slope.abs() < 1e-15 && bend.abs() < 1e-10);
    }

    #[test]
    fn normals_of_a_sphere_bend_as_differences_say() {
        let ball = Sphere::fixed(Vector3::new(1.0, 2.0, 3.0), 0.5);
        let x = Vector3::new(1.4, 2.3, 3.4);
        let exact = ball.normal_gradient(x, 0.0);
        /// The same ball without derivatives of its own.
        #[derive(Debug)]
        struct Plain(Sphere);
        impl Obstacle for Plain {
            fn distance(&self, x: Vector3<f64>, t: f64) -> f64 {
                self.0.distance(x, t)
            }
            fn normal(&self, x: Vector3<f64>, t: f64) -> Vector3<f64> {
                self.0.normal(x, t)
            }
            fn velocity(&self, t: f64) -> Vector3<f64> {
                Obstacle::velocity(&self.0, t)
            }
            fn centre(&self, t: f64) -> Vector3<f64> {
                Obstacle::centre(&self.0, t)
            }
            fn layer(&self) -> f64 {
                self.0.layer()
            }
        }
        assert!((Plain(ball).normal_gradient(x, 0.0) - exact).norm() < 1e-6);
    }
}
