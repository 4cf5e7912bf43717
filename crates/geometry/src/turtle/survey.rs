//! Where the turtle stands at the modules that ask.

use super::{Error, interpret};
use dlsys_model::Model;
use crate::scene::Scene;
use dlsys_tree::{ModuleString, Place};

/// Where the turtle stands at each module of the string that asks something (`?P`, `?H`, …), in string order.
///
/// # Errors
/// As of [`draw`](super::draw), in words.
pub fn survey(model: &Model, string: &ModuleString) -> Result<Vec<Place>, String> {
    let mut scene = Scene::default();
    let asked = interpret::survey(model, string, &mut scene).map_err(|error: Error| error.to_string())?;
    Ok(asked
        .into_iter()
        .map(|pose| Place { position: pose.position.coords.into(), axes: pose.axes.map(Into::into) })
        .collect())
}
