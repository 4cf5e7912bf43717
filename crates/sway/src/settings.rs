//! Settings of a solver, its methods by name, and the source of skeletons.

use crate::{Air, Skeleton};

/// A method of integration. All are linearly implicit: one matrix a step, no iteration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// ROS2: order 2 with any approximation of the Jacobian, L-stable with γ = 1 - 1/√2 (Verwer, Spee, Blom, Hundsdorfer, *A second-order
    /// Rosenbrock method applied to photochemical dispersion problems*, SIAM J. Sci. Comput. 20, 1999).
    #[default]
    Ros2,
    /// ROS34PW2: order 3 with any approximation of the Jacobian, L-stable, four stages (Rang, Angermann, *New Rosenbrock W-methods of order 3
    /// for partial differential algebraic equations of index 1*, BIT 45, 2005). For small tolerances; about four times the work a step.
    Ros34Pw2,
    /// The implicit Euler method with one iteration: order 1. For comparison.
    Euler,
}

impl Method {
    /// Order of convergence for a skeleton that does not change. With one that grows, none is above 2.
    pub fn order(self) -> u32 {
        match self {
            Method::Ros2 => 2,
            Method::Ros34Pw2 => 3,
            Method::Euler => 1,
        }
    }
}

/// How a solver works.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Method of integration.
    pub method: Method,
    /// Largest error of a step: displacement of any end of a segment relative to the extent of the skeleton. The error of the velocity counts
    /// as the displacement that it makes in the longest step: on the scale of the step itself, any velocity would pass once steps are short.
    pub tolerance: f64,
    /// Longest step H, in s. Steps have the length H/2^m and end at multiples of it.
    pub longest: f64,
    /// Largest m.
    pub deepest: u32,
    /// Largest number of steps tried in a time of H.
    pub most: u64,
    /// δ: the moment of inertia of a stem about its own axis is at least about δ² of that across its root. It bounds the frequency of torsion;
    /// planar motion does not depend on it. 0 for the sections' own inertia alone.
    pub rotary: f64,
    /// Air and gravity.
    pub air: Air,
    /// Whether steps are of one length H, whatever their error. For measurements of order.
    pub fixed: bool,
}

impl Default for Settings {
    /// ROS2 with a tolerance of 1e-3 and steps of 1/30 s at most.
    fn default() -> Settings {
        Settings {
            method: Method::Ros2,
            tolerance: 1e-3,
            longest: 1.0 / 30.0,
            deepest: 40,
            most: 50_000,
            rotary: 0.1,
            air: Air::default(),
            fixed: false,
        }
    }
}

/// The source of skeletons: the growth that a solver follows.
pub trait Growth {
    /// Writes the skeleton at a time (s) into `skeleton`, which holds the result of the last call during this advance and is empty before
    /// the first. Returns whether it differs from that.
    ///
    /// The number and order of segments must stay the same during one call of [`Solver::advance`](crate::Solver::advance). It is called for
    /// the middle of each step tried, so times may go back when a step is retried.
    fn skeleton(&mut self, time: f64, skeleton: &mut Skeleton) -> bool;
}

/// A skeleton that does not change.
#[derive(Clone, Copy, Debug)]
pub struct Fixed<'a>(pub &'a Skeleton);

impl Growth for Fixed<'_> {
    fn skeleton(&mut self, _: f64, skeleton: &mut Skeleton) -> bool {
        if !skeleton.is_empty() {
            return false;
        }
        skeleton.clone_from(self.0);
        true
    }
}

impl<F: FnMut(f64, &mut Skeleton) -> bool> Growth for F {
    fn skeleton(&mut self, time: f64, skeleton: &mut Skeleton) -> bool {
        self(time, skeleton)
    }
}
