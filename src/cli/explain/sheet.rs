//! Sheets (`sheet`): what they are made of, the work of following them, and how they are coupled to the model.

use super::scene::ScenePart;
use crate::model::{Model, Quantity, Sheet};
use crate::sim::brief;
use crate::surround::SHEET_TICK;
use crate::turtle;

/// The rows of the table of the scene, one for each sheet.
pub fn parts(model: &Model) -> Vec<ScenePart> {
    let drapes = turtle::drapes(model);
    let part = |sheet: &std::sync::Arc<Sheet>| {
        let name = format!("sheet {}", sheet.name);
        if !drapes || model.kinds.find(&sheet.name, 0).is_none() {
            return ScenePart::new(name, "nothing to do", "no string and no drawing places it");
        }
        ScenePart::new(name, "in steps", why(model, sheet))
    };
    model.scenery.sheets.iter().map(part).collect()
}

fn why(model: &Model, sheet: &Sheet) -> String {
    let scenery = &model.scenery;
    let tissue = &scenery.tissues[sheet.tissue];
    let held = sheet.pinned.iter().filter(|held| **held).count();
    let seconds = model.frames.map_or(0.0, |frames| frames.to) * scenery.units.time;
    let mut meets = Vec::new();
    if scenery.wind.is_some() || !scenery.flows.is_empty() {
        meets.push("the wind");
    }
    if !scenery.solids.is_empty() {
        meets.push("solids");
    }
    if scenery.ground.is_some() {
        meets.push("the ground");
    }
    let meets = if meets.is_empty() { String::new() } else { format!(" and {}", meets.join(", ")) };
    format!(
        "{} points, {} faces and {} cords of {}, held at {held}; implicit steps of controlled error under weight{meets}, \
        in {} ticks of 1/64 s; {}",
        sheet.points.len(),
        sheet.faces.len(),
        sheet.cords.len(),
        tissue.name,
        brief((seconds / SHEET_TICK).ceil(), 6),
        ways(model),
    )
}

/// Whether sheets act on growth.
fn ways(model: &Model) -> String {
    let mut names: Vec<&str> = Vec::new();
    let mut forces: Vec<Quantity> = Vec::new();
    for (_, kind) in model.kinds.iter().filter(|(_, kind)| kind.reads_force()) {
        names.push(&kind.name);
        forces.extend(kind.read_inputs().map(|(quantity, _)| quantity));
    }
    if names.is_empty() {
        let solids = model.scenery.solids.iter().map(|(kind, _)| &*model.kinds.get(*kind).name);
        let mut may: Vec<&str> = solids.filter(|name| crate::study::has_feedback(model, name)).collect();
        may.dedup();
        let one_way = "one way: no rule reads what it does";
        return match &may[..] {
            [] => one_way.to_owned(),
            names => format!(
                "{one_way}; hybrid, if what the equations of {} do with places or velocities stands in for it (`dlsys report --coupling`)",
                names.join(", ")
            ),
        };
    }
    forces.sort();
    forces.dedup();
    let forces: Vec<String> = forces.iter().map(|quantity| format!("`{}`", quantity.name())).collect();
    format!(
        "two ways: rules of {} read {}, and growth and sheets go on together, each tick in as many parts as the tolerance needs",
        names.join(", "),
        forces.join(", ")
    )
}
