//! Wind: the velocity of the air as a pure function of place and time, in SI.
//!
//! A wind is a mean flow, with a logarithmic profile if it blows over rough ground; simple [flows](Flow) such as sources and vortices; and
//! turbulence, a random field with a given [spectrum](Spectrum). Ground and bodies push it aside. It follows Stam and Fiume,
//! *Turbulent Wind Fields for Gaseous Phenomena* (SIGGRAPH '93), and differs where that improves it:
//!
//! - Turbulence is the curl of a vector potential, whose coefficients are those of a cubic B-spline: it has no divergence to rounding,
//!   between the points of the lattice too.
//! - Three lattices, turned against each other, with periods whose ratio is irrational, hold a band of wave numbers each. No place repeats
//!   another.
//! - Every mode has frequencies of its own, so that large and small eddies decorrelate as the paper's Gaussian says. Eddies
//!   travel with the mean wind.
//! - All of it has random access: the velocity at any place and time depends on the description alone, not on what was evaluated
//!   before, and has the same bits on every thread and machine (as long as functions of the description do).
//!
//! [`Field::at`] sums over frequencies once for an instant (1.5 ms on one core); [`Snapshot::velocity`] then takes about half a
//! microsecond for a place. [`Field::sum_of_modes`] is the reference; [`Eddies`] is for equations that read the wind at any time.
//!
//! # Examples
//!
//! A gusty wind of 5 m/s over a meadow, which repeats after 20 s:
//!
//! ```
//! use dlsys_wind::{Description, Field, Ground, Signal};
//! use nalgebra::Vector3;
//!
//! # fn main() -> Result<(), dlsys_wind::Error> {
//! let field = Field::new(Description {
//!     turbulence: 0.3,
//!     scale: 4.0,
//!     roughness: Some(0.03),
//!     period: Some(20.0),
//!     seed: 7,
//!     ground: Some(Ground::Flat(0.0)),
//!     ..Description::new(Vector3::new(1.0, 0.0, 0.0), Signal::function(|t| 5.0 + (0.1 * std::f64::consts::TAU * t).sin()))
//! })?;
//! let wind = field.at(2.5)?;
//! let velocity = wind.velocity(Vector3::new(3.0, 1.5, -2.0));
//! assert!(velocity.norm() < 15.0);
//!
//! // The next lap is the same, to the last bit; no air passes the ground.
//! assert_eq!(field.at(22.5)?.velocity(Vector3::new(3.0, 1.5, -2.0)), velocity);
//! assert!(wind.velocity(Vector3::new(3.0, 0.0, -2.0)).y.abs() < 1e-12);
//! # Ok(())
//! # }
//! ```

#![warn(missing_docs)]

mod air;
mod between;
mod bodies;
mod description;
mod eddies;
mod error;
mod field;
mod fourier;
mod groups;
mod hull;
mod journey;
mod lanes;
mod lattice;
mod modes;
mod obstacle;
mod primitives;
mod random;
mod snapshot;
mod spectrum;
pub mod study;
mod turns;

pub use air::{Still, Wind};
pub use description::{Description, Signal};
pub use eddies::{Bounds, Eddies, EddyBounds, EddyJet};
pub use error::Error;
pub use field::Field;
pub use hull::Hull;
pub use obstacle::{Ground, Height, Obstacle, Sphere};
pub use primitives::Flow;
pub use random::Draw;
pub use snapshot::{Snapshot, grid};
pub use spectrum::{Spectrum, correlations, von_karman_length};
