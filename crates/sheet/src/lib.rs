//! Sheets: flexible surfaces and nets as masses and springs, implicit in time, and their contact with solids.
//!
//! ```text
//! Mesh + Tissue ──Sheet──▶ masses, springs
//! Sheet + State + Solid… + Wind ──Solver──▶ State, Push on each solid, Steps
//! ```
//!
//! - [`Mesh`]: points, faces, cords; [`Tissue`]: stiffness, density, damping, thickness; [`Sheet`]: masses and springs of both.
//! - [`State`]: places and velocities; [`Solver`]: advances it with controlled error; [`Step`] is the solution within a step.
//! - [`Solid`]: a convex [`Shape`] that is guided along a path, free, or [`Led`] by equations of motion that stand elsewhere; a floor is a half-space. [`Push`]: what the sheet does to it.
//! - [`Run`]: a state at any time, in any order.
//! - [`study`]: exact cases with their errors and orders.
//!
//! All values are in SI units. The crate knows nothing of turtles and productions.
//!
//! # Mechanics
//!
//! Masses stand in the points. Springs along the edges of triangles are coupled so that a triangle has the energy of a membrane of its material
//! (Delingette, *Triangular springs for modeling nonlinear membranes*, 2008): stiffness in the plane does not depend on the mesh, and Poisson's ratio
//! is that of the tissue. Springs without such a coupling would be right in meshes of equilateral triangles and for a ratio of 1/3 only. Under strong
//! pressure (above 40 %) a membrane of this kind gets softer. Cords obey the law of Hooke. Bending is a moment across edges and between cords
//! that continue each other. Material is Kelvin-Voigt: stress `E (ε + τ ε')`. Sheets do not touch themselves.
//!
//! A step has two stages, each with all forces at its end, those of contacts and of viscosity too: order 2 and L-stable (Alexander, SIAM J. Numer.
//! Anal. 14, 1977). Where a contact begins or ends, both stages are steps of backward Euler, of order 1, which give back nothing of what they stop:
//!
//! ```text
//! M (v - v̂) = s F(x, v),   x = x̂ + s v
//! ```
//!
//! The equations are solved by Newton's method with a search along each way; contacts are found again in each iteration, free solids are unknowns
//! of the same system: momentum is kept to rounding, angular momentum to a few tolerances. Linear systems are solved by conjugate gradients
//! with symmetric Gauss-Seidel as preconditioner, in one thread and in one order. What would meet within a step is stopped by impulses at its beginning.
//! A step is repeated with half its length or less if its error is too large, if its equations are not solved, if solid and sheet
//! move by more than the solid's radius relative to each other while they are near, or if the sheet gets too deep in a solid.
//!
//! Errors of places and velocities are controlled; but where solids touch, velocities of points jump, and those count as what they move in the step
//! itself. A cord that is so stiff that no step resolves its vibration has order 1.
//!
//! # Example
//!
//! A ball of 0.1 kg drops onto a cloth that is held along two sides:
//!
//! ```
//! use dlsys_sheet::{Mesh, Place, Settings, Shape, Sheet, Solid, Solver, State, Still, Tissue, Vector};
//!
//! let mesh = Mesh::rectangle(Vector::zeros(), [Vector::x(), Vector::z()], [8, 8]);
//! let sheet = Sheet::new(&mesh, &Tissue::new(1e6, 1000.0, 1e-3), |point| point.x == 0.0 || point.x == 1.0)?;
//! let shape = Shape::ball(0.1)?;
//! let solids = [Solid::free_ball(&shape, 0.1)];
//! let mut state = State::at_rest(&sheet).with(vec![Place::at(Vector::new(0.5, 0.3, 0.5))]);
//! let mut solver = Solver::new(Settings::default());
//! let pushes = solver.advance(&sheet, &mut state, 0.0..0.5, &solids, &Still, |_step| ())?;
//! assert!(pushes[0].impulse.y > 0.1 && state.bodies[0].position.y > -0.3);
//! # Ok::<(), dlsys_sheet::Error>(())
//! ```

#![warn(missing_docs)]

pub mod contact;
mod cord;
mod drag;
mod elastic;
mod error;
mod hinge;
mod matrix;
mod membrane;
mod mesh;
mod run;
mod settings;
mod sheet;
mod solve;
mod solver;
mod stage;
mod state;
mod step;
pub mod study;

pub use contact::{Drive, Grip, Led, Place, Push, Shape, Solid};
pub use dlsys_wind::{Still, Wind};
pub use drag::Air;
pub use error::{Error, Rejection};
pub use mesh::{MOST_POINTS, Mesh, Tissue};
pub use run::Run;
pub use settings::{Method, Settings};
pub use sheet::Sheet;
pub use solver::{Counts, Solver};
pub use state::{Energy, State, Step};

/// A vector of three components.
pub type Vector = nalgebra::Vector3<f64>;
/// A 3×3 matrix.
pub type Matrix = nalgebra::Matrix3<f64>;
/// An attitude: turns vectors from the axes of a solid to those of the world.
pub type Attitude = nalgebra::UnitQuaternion<f64>;
