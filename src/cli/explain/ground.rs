//! Ground of soil (`ground SOIL cell …`): its columns, and whether they are followed tick by tick.

use super::scene::ScenePart;
use crate::model::{Bed, Model, Soil};
use crate::sim::brief;
use crate::surround::GROUND_TICKS;

/// The row of the table of the scene, if there is such a ground.
pub fn part(model: &Model) -> Option<ScenePart> {
    let scenery = &model.scenery;
    let bed = scenery.bed.as_ref()?;
    let name = format!("ground {}", scenery.soils[bed.soil].name);
    let columns = columns(bed);
    let kinds = |all: &[(crate::model::KindId, _)]| {
        all.iter().map(|(kind, _)| format!("`{}`", model.kinds.get(*kind).name)).collect::<Vec<_>>()
    };
    let mut reasons = Vec::new();
    let (solids, shelves) = (kinds(&scenery.solids), kinds(&scenery.shelves));
    if !solids.is_empty() {
        reasons.push(format!("{} press into it and carry it", solids.join(", ")));
    }
    if !shelves.is_empty() {
        reasons.push(format!("{} carry what falls", shelves.join(", ")));
    }
    let soil = &scenery.soils[bed.soil];
    if let Some(stick) = soil.stick.filter(|stick| *stick > 0.0 && !solids.is_empty()) {
        let shed = soil.shed.map_or(String::new(), |shed| format!(" within {} s", brief(shed, 3)));
        let hold = soil.hold.map_or(String::new(), |hold| {
            format!(
                " where they are accelerated by {} m/s² or more, and less of it elsewhere",
                brief(hold, 3)
            )
        });
        reasons.push(format!(
            "they take up {} mm of it where they touch it, and shed it as particles{shed}{hold}",
            brief(1000.0 * stick, 3)
        ));
    }
    match scenery.pours.len() {
        0 => (),
        1 => reasons.push("`pour` adds to it".to_owned()),
        count => reasons.push(format!("`pour` adds to it in {count} places")),
    }
    let has_bodies = !solids.is_empty() || !shelves.is_empty();
    let pushed: Vec<String> = (scenery.solids.iter())
        .filter(|(kind, _)| model.kinds.get(*kind).reads_force())
        .map(|(kind, _)| format!("`{}`", model.kinds.get(*kind).name))
        .collect();
    if !pushed.is_empty() {
        reasons.push(format!(
            "rules of {} read the force with which it bears them, up to {} kPa in 1 m, so that growth and ground go on together",
            pushed.join(", "),
            brief(bearing(soil), 3)
        ));
    }
    let read = match model.reads_ground() {
        true if has_bodies => {
            "; rules read its height, so that growth and ground go through each tick until they agree"
        }
        true => "; rules read its height",
        false => "",
    };
    if reasons.is_empty() {
        let why = format!(
            "{columns}; nothing touches it, so it moves only where it is steeper than it can stand at t = 0, until it rests{read}"
        );
        return Some(ScenePart::new(name, "nothing to do", why));
    }
    let t = model.frames.map_or(0.0, |frames| frames.to);
    let ticks = brief((t * scenery.units.time * GROUND_TICKS).ceil(), 9);
    let why = format!(
        "{columns}; {}: {ticks} ticks of 1/{GROUND_TICKS} s up to t = {}, with memory and work for columns that are touched or slip{read}",
        reasons.join("; "),
        brief(t, 6)
    );
    Some(ScenePart::new(name, "in steps", why))
}

/// The pressure in kPa that a soil holds below a body in a depth of 1 m.
fn bearing(soil: &Soil) -> f64 {
    let material = crate::surround::soil(soil);
    material.carries() * material.weight + 6.0 * material.cohesion
}

fn columns(bed: &Bed) -> String {
    let side = 2.0 * (bed.extent / bed.cell).round() + 1.0;
    format!("{side} × {side} columns, {} apart", brief(bed.cell, 6))
}
