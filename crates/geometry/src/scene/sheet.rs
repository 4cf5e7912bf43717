//! Places of sheets: where a module puts a flexible surface or net into a scene.

use super::{MaterialId, OwnerId, Placement};
use crate::turtle::Origin;

/// The identity of a sheet: the module that places it, and its number among those that this module places.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct SheetKey {
    /// The [`id`](dlsys_tree::Lineage::id) of the module.
    pub module: u64,
    /// From 0, in the order of drawing.
    pub number: u32,
}

/// A sheet that a module places.
#[derive(Clone, Debug)]
pub struct SheetPlace {
    /// Its identity.
    pub key: SheetKey,
    /// The module that places it.
    pub origin: Origin,
    /// Its index among those that the model declares.
    pub sheet: usize,
    /// From the file's coordinates to the scene.
    pub placement: Placement,
    /// Its material, if the model chooses a colour.
    pub tint: Option<MaterialId>,
    /// The module as an owner.
    pub owner: OwnerId,
}
