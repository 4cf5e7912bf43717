//! Geometry independent of file formats, and the turtle that draws strings of modules.
//!
//! - [`scene`]: elements, materials, meshes, patches, bounds.
//! - [`turtle`]: from a string of modules to a scene; its page has an example of a model that is drawn.
//!
//! ```
//! use dlsys_geometry::scene::{Bounds, Color, Palette, Scene};
//!
//! let mut scene = Scene::default();
//! scene.palette = Palette::with([("rose", Color::hex(0xe573a5))], []);
//! assert!(scene.is_empty());
//! // `;(13)` chooses the first colour after the twelve built-in ones.
//! let rose = scene.palette.chosen(13.0, 0.0).map(|id| scene.palette.get(id).color.to_string());
//! assert_eq!(rose.as_deref(), Some("#e573a5"));
//! scene.clear();
//! assert_eq!(Bounds::of(&scene).corners(1.0), None);
//! ```

#![warn(missing_docs)]

pub mod scene;
pub mod turtle;
