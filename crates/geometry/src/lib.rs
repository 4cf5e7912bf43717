//! Geometry without a file format, and the turtle that makes it of strings of modules.
//!
//! - [`scene`]: elements, materials, meshes, patches, bounds.
//! - [`turtle`]: strings of modules as a scene.

#![warn(missing_docs)]

pub mod scene;
pub mod turtle;
