//! Convex rounded solids: their shapes, their places on paths, and the gaps between them and other things.
//!
//! - [`Shape`]: the convex hull of points, rounded by a radius, or a half-space; [`parts`] makes some of them of balls.
//! - [`Place`]: where a solid is, and how it moves; [`Path`]: a place as a polynomial of time, with bounds of its derivatives.
//! - [`Gap`]: between a shape and a point, a cord or a face; [`Meeting`]: between the hulls of two sets of points.
//!
//! What is flexible (`sheet`) and what falls (`fall`) meets solids by the same shapes. All values are in SI units.
//!
//! # Example
//!
//! A ball is 3 cm above a box:
//!
//! ```
//! use dlsys_solid::{Meeting, Shape, Vector};
//!
//! let corner = |k: usize| Vector::new((k & 1) as f64, (k >> 1 & 1) as f64, (k >> 2) as f64) * 0.2;
//! let cube = Shape::hull((0..8).map(corner).collect(), 0.0)?;
//! let middle = Vector::new(0.1, 0.28, 0.1);
//! let meeting = Meeting::of(&[middle], cube.core());
//! assert!((meeting.way.norm() - 0.05 - 0.03).abs() < 1e-12);
//! # Ok::<(), dlsys_solid::Error>(())
//! ```

#![warn(missing_docs)]

mod error;
mod nearest;
mod parts;
mod path;
mod shape;

pub use error::Error;
pub use nearest::Meeting;
pub use parts::parts;
pub use path::Path;
pub use shape::{Gap, Place, Shape};

/// A vector of three components.
pub type Vector = nalgebra::Vector3<f64>;
/// An attitude: turns vectors from the axes of a solid to those of the world.
pub type Attitude = nalgebra::UnitQuaternion<f64>;
