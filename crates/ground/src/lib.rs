//! Ground: sand, mud, snow and soil as columns that slip, stand, are poured, pressed and pushed.
//!
//! ```text
//! Description (bed, depth, Soil) + Pour + Body ──Ground, tick by tick──▶ heights at a time
//! ```
//!
//! - [`Soil`]: angles of repose, mobility, cohesion and weight of a material.
//! - [`Ground`]: the columns at an instant; a value, whose clones share what has not changed. [`Ground::advance`] makes the next tick.
//! - [`Pour`]: material that is added, on a disc or everywhere.
//! - [`Body`]: a closed mesh that presses, pushes, carries and throws up what sticks to it, or a shelf that only carries.
//! - [`Bearing`]: what the soil does to a body that moves in it, as a force that gives way.
//! - [`Rule`]: the law of slipping, or those of the papers for comparison.
//! - [`Mesh`]: the surface as triangles; [`Piece`]: a part of it whose triangles stay the same at all times.
//! - [`study`]: exact cases with their errors and orders.
//!
//! All values are in SI units; y is up. The crate knows nothing of turtles and productions.
//!
//! # The law of slipping
//!
//! Heights h obey h_t = λ∇·((1 - k/|∇h|)₊∇h): material flows downhill where it is steeper than the tangent k of the angle of repose (Prigozhin,
//! Zaltzman, *On the approximation of the dynamics of sandpile surfaces*, 2003, have its limit of a large mobility λ). On a grid with a distance Δ of columns, each square of four
//! columns has a triangle at each of its corners. With the two differences of height e of its edges, a triangle moves
//! τ(1 - kΔ/|e|)₊e along them, τ = λδt/4Δ². Rules that compare neighbours one by one, as those of the papers, have a bias of the grid that does not go away with smaller columns; this law has
//! none in the limit.
//!
//! Heights and volumes are integers of 2⁻³² of Δ, and so are fluxes: volume is conserved to the last bit, sums do not depend on their order, and symmetric ground
//! stays symmetric.
//!
//! **It ends.** A column gives what it has and takes what it has room for, so fluxes are scaled down. Edges down from a column with
//! nothing loose, and to a full one, are walls. Whatever is scaled down, all fluxes f go downhill and are at most 4τ|e| along an edge; so a sweep changes the potential energy ½Σh²
//! by at most -(1 - 16τ)Σf|e|, which is negative for τ < 1/16. Only triangles that are steeper than k by a thousandth
//! (0.03° or less) move, and only columns with more than a millionth of kΔ give; so a sweep that moves anything lowers the energy by more than a fixed amount, and there
//! are finitely many.
//!
//! **It is local.** Material that rests begins to slip where it is 2° steeper than the angle of repose; next to material that slips, at the angle of
//! repose. What slips, or was changed, since the last sweep is noted for each column, and a sweep computes squares with such columns only. The number of sweeps in a tick is the same
//! everywhere, so events far away change no bit here.
//!
//! # Example
//!
//! Sand that is poured for a second, and comes to rest:
//!
//! ```
//! use dlsys_ground::{Description, Extent, Ground, Place, Pour, Relief, Settings, Soil};
//!
//! let mut ground = Ground::new(
//!     Description {
//!         cell: 0.01,
//!         extent: Extent::around(60),
//!         soil: Soil::sand(),
//!         bed: Relief::Level(0.0),
//!         depth: Relief::Level(0.0),
//!     },
//!     Settings::default(),
//! )?;
//! let spout = Place::Disc { centre: [0.0; 2], radius: 0.02 };
//! let pour = Pour { id: 1, place: spout, rate: 1e-3 };
//! while ground.time() < 1.0 {
//!     ground.advance(&[pour], &[])?;
//! }
//! ground.settle(10_000)?;
//! // A cone with the angle of repose: its height is the cube root of 3 V tan² φ / π.
//! let exact = (3e-3 * ground.soil().slope().powi(2) / std::f64::consts::PI).cbrt();
//! assert!((ground.height(0.0, 0.0) / exact - 1.0).abs() < 0.05);
//! assert_eq!(ground.imbalance(), 0);
//! # Ok::<(), dlsys_ground::Error>(())
//! ```

#![warn(missing_docs)]

mod barrier;
mod bearing;
mod clock;
mod clods;
mod coat;
mod contour;
mod cover;
mod error;
mod graph;
mod ground;
mod heading;
mod heap;
mod kernel;
mod load;
mod marks;
mod material;
mod mesh;
mod noise;
mod order;
mod particles;
mod pattern;
mod pour;
mod press;
mod reader;
mod relief;
mod resist;
mod rules;
mod setup;
mod slide;
mod slip;
mod spans;
mod squares;
pub mod study;
mod tile;
mod way;
mod wedge;

pub use bearing::{Bearing, Drive, Stand};
pub use error::Error;
pub use ground::{Description, Ground, Settings};
pub use material::Soil;
pub use mesh::Mesh;
pub use particles::Flight;
pub use pattern::Piece;
pub use pour::{Place, Pour};
pub use press::Body;
pub use relief::Relief;
pub use rules::Rule;
pub use tile::Extent;

/// A vector of three components.
pub type Vector = nalgebra::Vector3<f64>;
