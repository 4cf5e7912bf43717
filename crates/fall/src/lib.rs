//! Falling: rigid plates and small bodies that are let go, flutter or tumble in a wind, land, and lie still.
//!
//! ```text
//! Body (mass, size, contacts) + Release (Motion, time) + Wind + Ground ──Fall──▶ Motion at any time
//! ```
//!
//! - [`Body`]: a plate or a lump, with its mass, its size and the points by which it touches the ground.
//! - [`Motion`]: position, attitude, and their rates, at an instant.
//! - [`Wind`]: gives the velocity of the air; [`Ground`]: a level floor with friction and restitution; [`Soil`]: a height field.
//! - [`Fall`]: the motion of a body after its release, at any time in any order.
//! - [`study`]: exact cases with their errors and orders.
//!
//! All values are in SI units. The crate knows nothing of turtles and productions.
//!
//! # Mechanics
//!
//! Plates obey the equations of Andersen, Pesavento and Wang (*Unsteady aerodynamics of fluttering and tumbling plates*, and *Analysis of
//! transitions between fluttering, tumbling and steady descent of falling cards*, J. Fluid Mech. 541, 2005): inertia of the air that moves
//! with the plate, lift by translation and by rotation, drag, and damping of rotation. Here they stand in vectors: the inertia of the air
//! as Kirchhoff's equations, lift and drag in the plane of the normal and of the velocity relative to the air. In a plane they are the
//! equations of the papers, and nothing is singular where a plate falls broadside.
//!
//! In flight, the pair of orders 3 and 2 of Bogacki and Shampine advances the state with controlled error. Its stages are at halves and
//! quarters of steps, whose lengths are powers of 2 on one grid of time for all bodies: many bodies read the wind at the same instants.
//! A contact is located on the dense output; bounds of the second derivatives show that no point dips into the ground between two
//! samples. An impact is a set of impulses within cones of friction, which never add energy. Where rebounds are too low to be
//! seen, the body is in contact: implicit impulses in short steps (Stewart, Trinkle, *An implicit time-stepping scheme for rigid body dynamics
//! with inelastic collisions and Coulomb friction*, Int. J. Numer. Meth. Eng. 39, 1996), until it rests.
//!
//! # Example
//!
//! A petal that is let go at a height of 1 m in a breeze:
//!
//! ```
//! use dlsys_fall::{Body, Fall, Ground, Motion, Settings, Vector};
//!
//! let petal = Body::plate(2e-5, [0.012, 0.008])?;
//! let release = Motion::at(Vector::new(0.0, 1.0, 0.0));
//! let wind = |_: Vector, _: f64| Vector::new(0.5, 0.0, 0.1);
//! let mut fall = Fall::new(petal, release, 0.0, Some(Ground::at(0.0)), Settings::default())?;
//! let landed = fall.at(20.0, &wind)?;
//! assert!(landed.position.x > 0.3 && landed.position.y < 0.01);
//! assert!(fall.rest().is_some_and(|time| time < 10.0));
//! # Ok::<(), dlsys_fall::Error>(())
//! ```

#![warn(missing_docs)]

mod air;
mod among;
mod approach;
mod body;
mod contact;
mod error;
mod fall;
mod forces;
mod ground;
mod impulse;
mod manifold;
mod motion;
mod obstacles;
mod pairs;
mod settings;
mod soil;
mod step;
pub mod study;
mod underlay;

pub use air::Air;
pub use body::{Body, Contact, Shape};
pub use dlsys_wind::{Still, Wind};
pub use error::Error;
pub use fall::Fall;
pub use ground::Ground;
pub use motion::Motion;
pub use obstacles::{Obstacle, Obstacles, Open, Span, Surface};
pub use settings::Settings;
pub use soil::{Columns, Soil};

/// A vector of three components.
pub type Vector = nalgebra::Vector3<f64>;
/// An attitude: turns vectors from the axes of a body to those of the world.
pub type Attitude = nalgebra::UnitQuaternion<f64>;
