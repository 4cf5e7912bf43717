//! What is let go (`@D`): the bodies that fall, and the work of following them.

use std::fmt::Write;

use serde::Serialize;

use super::bending::{PATIENCE, Range, length, mass, range, values};
use super::scene::ScenePart;
use super::text::wrapped;
use crate::model::Model;
use crate::sim::{Settings, Simulation, brief};
use crate::surround::{CLOCK, Loose};
use crate::tree::ModuleString;
use crate::turtle;

/// Most groups of parts in the text.
const MOST_SHOWN: usize = 8;

/// Parts that are let go. Field names are those of the JSON.
#[derive(Serialize)]
pub struct FallingPlan {
    /// The plant of another model whose parts they are; none for those of the model itself.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plant: Option<String>,
    /// The time at which the parts are listed: that of the last frame, or 0; the age of a plant of another model.
    pub t: f64,
    pub parts: Vec<PartPlan>,
    /// Why there are no parts, if the model could not be run to that time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
    /// The row of the table of the scene.
    #[serde(skip)]
    pub row: ScenePart,
}

/// Parts of one shape that modules of one kind let go.
#[derive(Serialize)]
pub struct PartPlan {
    pub kind: String,
    pub shape: &'static str,
    pub count: usize,
    /// In kg.
    pub mass: Range,
    /// Largest extent in m.
    pub size: Range,
    /// Speed in m/s at which weight and drag are equal, of a plate broadside on.
    pub speed: Range,
    /// The mass ratio I* of plates.
    pub ratio: Option<Range>,
}

impl FallingPlan {
    /// Of a model and of the plants of other models that stand in it.
    pub fn all(scene: &Model) -> Vec<FallingPlan> {
        fn add(scene: &Model, outer: &Model, place: &str, plans: &mut Vec<FallingPlan>) {
            for plant in &outer.scenery.plants {
                let name = format!("{}{place}", plant.name);
                plans.extend(FallingPlan::of(scene, &plant.model, Some(name.clone())));
                add(scene, &plant.model, &format!(" in {name}"), plans);
            }
        }
        let mut plans: Vec<FallingPlan> = FallingPlan::of(scene, scene, None).into_iter().collect();
        add(scene, scene, "", &mut plans);
        plans
    }

    /// `None` for a model without `@D`.
    fn of(scene: &Model, model: &Model, plant: Option<String>) -> Option<FallingPlan> {
        if !turtle::lets_go(model) {
            return None;
        }
        let t = model.frames.map_or(0.0, |frames| frames.to);
        let (found, error) = match look(model, t) {
            Ok(found) => (found, None),
            Err(message) => (Vec::new(), Some(message)),
        };
        let parts = groups(model, &found);
        let row = row(scene, plant.as_deref(), (t, model.scenery.units.time), &parts, error.is_some());
        Some(FallingPlan { plant, t, parts, error, row })
    }

    /// The section of the text.
    pub fn text(&self) -> String {
        let when = brief(self.t, 6);
        let mut out = match &self.plant {
            Some(plant) => format!("Let go by {plant} up to its age {when}\n"),
            None => format!("Let go up to t = {when}\n"),
        };
        if let Some(error) = &self.error {
            let _ = writeln!(out, "  unknown, because the model cannot be run so far: {error}");
        } else if self.parts.is_empty() {
            let _ = writeln!(out, "  nothing that is drawn then");
        }
        for part in self.parts.iter().take(MOST_SHOWN) {
            wrapped(2, &part.line(), &mut out);
        }
        if let Some(more @ 1..) = self.parts.len().checked_sub(MOST_SHOWN) {
            let _ = writeln!(out, "  … and {more} more sorts of parts (all with `--format json`)");
        }
        out.push('\n');
        out
    }
}

impl PartPlan {
    fn line(&self) -> String {
        let each = if self.count == 1 { "" } else { " each" };
        let plural = if self.count == 1 { "" } else { "s" };
        let ratio = self.ratio.map_or(String::new(), |ratio| {
            let way = match ratio {
                [_, most] if most < 1.0 => "it flutters",
                [least, _] if least > 1.0 => "it tumbles",
                _ => "it flutters or tumbles",
            };
            format!(", mass ratio I* {}: {way}", values(ratio, 1.0))
        });
        format!(
            "{}: {} {}{plural}, {}{each}, {} long, falls at {} m/s{ratio}",
            self.kind,
            self.count,
            self.shape,
            mass(self.mass),
            length(self.size),
            values(self.speed, 1.0)
        )
    }
}

/// Runs the model to a time; what has been let go and is drawn then.
fn look(model: &Model, t: f64) -> Result<Vec<Loose>, String> {
    let settings = Settings { max_seconds: PATIENCE, ..Settings::default() };
    let told = |error: crate::sim::Error| error.diagnostic().message;
    let mut string = ModuleString::default();
    Simulation::new(model, settings).map_err(told)?.at(t, &mut string).map_err(told)?;
    Loose::all(model, &string).map_err(|error| error.diagnostic().message)
}

fn groups(model: &Model, found: &[Loose]) -> Vec<PartPlan> {
    let name = |loose: &Loose| model.kinds.get(loose.origin.kind).name.clone();
    let mut names: Vec<(String, bool)> = Vec::new();
    for loose in found {
        let key = (name(loose), loose.is_plate());
        if !names.contains(&key) {
            names.push(key);
        }
    }
    let plan = |(kind, is_plate): (String, bool)| {
        let air = crate::fall::Air::default();
        let of = |value: &dyn Fn(&Loose) -> f64| {
            let group = found.iter().filter(|loose| name(loose) == kind && loose.is_plate() == is_plate);
            (group.clone().count(), range(group.map(value)).unwrap_or_default())
        };
        let (count, mass) = of(&|loose| loose.body.mass);
        PartPlan {
            shape: if is_plate { "plate" } else { "lump" },
            count,
            mass,
            size: of(&|loose| 2.0 * loose.body.size()).1,
            speed: of(&|loose| loose.body.terminal_speed(&air)).1,
            ratio: is_plate.then(|| of(&|loose| loose.body.mass_ratio(&air)).1),
            kind,
        }
    };
    names.into_iter().map(plan).collect()
}

/// How the parts are followed, and why.
fn row(
    scene: &Model,
    plant: Option<&str>,
    (t, second): (f64, f64),
    parts: &[PartPlan],
    failed: bool,
) -> ScenePart {
    let name = plant.map_or("@D".to_owned(), |plant| format!("@D of {plant}"));
    if parts.is_empty() && !failed {
        let when = format!("{} = {}", if plant.is_some() { "the age" } else { "t" }, brief(t, 6));
        return ScenePart::new(
            name,
            "nothing to do",
            format!("nothing that has been let go is drawn at {when}"),
        );
    }
    let has_ground = scene.scenery.ground.is_some() || scene.scenery.bed.is_some();
    let moves = scene.scenery.bed.is_some() && !scene.scenery.pours.is_empty();
    let ends = match (scene.scenery.solids.is_empty(), has_ground) {
        (true, true) if moves => {
            "until it lies still on the soil; while no soil goes from below it there is nothing to do"
        }
        (true, true) => "until it lies still on the ground; from then on there is nothing to do",
        (true, false) => "without end, because there is no `ground`",
        (false, true) => {
            "until it lies still on the ground or on a body that is `solid`; while that stands still there is nothing to do"
        }
        (false, false) => {
            "until it lies still on a body that is `solid`, while that stands still; beside them without end, because there is no `ground`"
        }
    };
    let ticks = brief((t * second / CLOCK).ceil(), 6);
    let why = format!(
        "weight and air move each part by itself, a plate or a lump that does not act on growth; its steps, of 1/32 s or less as the error needs, go on \
        {ends}; releases are found on the way of growth, in {ticks} ticks of 1/30 s"
    );
    ScenePart::new(name, "in steps", why)
}
