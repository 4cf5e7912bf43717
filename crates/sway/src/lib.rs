//! Mechanics of stems that bend: trees of segments of constant curvature, advanced implicitly in time proportional to their number.
//!
//! ```text
//! Skeleton (rest shape, material, prescribed motion) + State (strain, rate) + Wind ──Solver──▶ State, Steps ──Pose──▶ frames
//! ```
//!
//! - [`Skeleton`]: the rest configuration at an instant: [`Segment`]s with [`Joint`]s, [`Load`]s and [`Plate`]s.
//! - [`State`]: the strain of each segment beyond its rest strain, and its rate. Both are intensive, so cutting a segment changes nothing.
//! - [`Growth`]: gives the skeleton at any time; [`Wind`]: gives the velocity of the air.
//! - [`Solver`]: advances a state with controlled error; [`Step`] is the solution within a step; [`Method`] lists the methods.
//! - [`Pose`]: the frames of all segments under a strain.
//! - [`Solver::equilibrium`], [`Solver::modes`], [`Solver::buckling`], [`Solver::energy`]: static load, natural frequencies, Greenhill's ratio.
//! - [`study`]: exact cases with their errors and orders.
//!
//! All values are in SI units. The crate knows nothing of turtles and productions.
//!
//! # Mechanics
//!
//! The frame of a segment is the exponential of its strain along the arc: a helix, in closed form. The equations of motion are those of
//! Lagrange for the strains, as in super-helices (Bertails, *Linear Time Super-Helices*, 2009), with Kelvin-Voigt material, gravity, drag,
//! and with the terms that prescribed motion of joints, lengths and rest strains brings about. Mass and drag are integrated along a
//! segment by two Gauss points. The equation of each segment is divided by its length, so a length of zero is regular: there
//! `u + τ u' = moment/EI`.
//!
//! A linear system with the matrix `M + γ h D + γ² h² K` is solved by one elimination from the tips to the root, as in articulated-body
//! algorithms (Featherstone, *Rigid Body Dynamics Algorithms*, 2008), because its quadratic form couples a segment with its parent only.
//!
//! # Example
//!
//! A stem of 0.5 m in a breeze of 3 m/s that starts at once:
//!
//! ```
//! use dlsys_sway::{Fixed, Pose, Segment, Settings, Skeleton, Solver, State, Vector};
//!
//! let mut skeleton = Skeleton::new();
//! let mut parent = None;
//! for _ in 0..10 {
//!     let mut segment = Segment::solid(parent, 0.05, 0.004, 2e8, 900.0);
//!     segment.damping = 0.02;
//!     if parent.is_none() {
//!         segment.joint.rotation = dlsys_sway::upright();
//!     }
//!     parent = Some(skeleton.push(segment));
//! }
//! let wind = |_: Vector, _: f64| Vector::new(3.0, 0.0, 0.0);
//! let mut state = State::at_rest(&skeleton);
//! let mut solver = Solver::new(Settings::default());
//! solver.advance(&mut state, 0.0, 5.0, &mut Fixed(&skeleton), &wind, |_step| ())?;
//!
//! let pose = Pose::new(&skeleton, &state.strain);
//! let tip = pose.point(9, 1.0);
//! assert!(tip.x > 0.01 && tip.y > 0.3);
//! # Ok::<(), dlsys_sway::Error>(())
//! ```

#![warn(missing_docs)]

mod air;
mod analysis;
mod arc;
mod carried;
mod energy;
mod equilibrium;
mod error;
mod forces;
mod form;
mod krylov;
mod link;
mod lumped;
mod place;
mod pose;
mod reduced;
mod ros2;
mod ros34pw2;
mod rotary;
mod settings;
mod skeleton;
mod solver;
mod state;
pub mod study;
mod sweep;

pub use air::Air;
pub use analysis::{Mode, cauchy_number};
pub use dlsys_wind::{Still, Wind};
pub use energy::Energy;
pub use error::Error;
pub use pose::{Frame, Pose};
pub use reduced::{Breeze, Reduced};
pub use settings::{Fixed, Growth, Method, Settings};
pub use skeleton::{Joint, Load, Plate, Segment, Skeleton};
pub use solver::{Counts, Solver};
pub use state::{State, Step, Work, hermite};

/// A vector of three components.
pub type Vector = nalgebra::Vector3<f64>;
/// A 3×3 matrix.
pub type Matrix = nalgebra::Matrix3<f64>;

/// The frame of an upright turtle: heading +y, left -x, up +z.
pub fn upright() -> Matrix {
    Matrix::new(0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0)
}
