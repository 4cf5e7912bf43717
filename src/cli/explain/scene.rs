//! The parts of a scene: plants of other models, floor, light, sky and camera, with the work that each one makes.

use serde::Serialize;

use crate::model::Model;

/// A part of a scene that is declared.
#[derive(Serialize)]
pub struct ScenePart {
    pub part: String,
    /// How it is computed.
    pub class: &'static str,
    pub why: String,
}

impl ScenePart {
    pub fn row(&self) -> [String; 3] {
        [self.part.clone(), self.class.to_owned(), self.why.clone()]
    }
}

/// The declared parts of a model's scene; empty for a plant alone.
pub fn parts(model: &Model) -> Vec<ScenePart> {
    let scenery = &model.scenery;
    let mut parts = Vec::new();
    let mut add =
        |part: &str, class, why: String| parts.push(ScenePart { part: part.to_owned(), class, why });
    for plant in &scenery.plants {
        let file = &plant.source.name;
        match plant.is_random {
            true => add(
                &plant.name,
                "one simulation a seed",
                format!("{file} draws random numbers; plants of one seed are looked at at all their ages"),
            ),
            false => add(
                &plant.name,
                "one simulation",
                format!("{file} draws no random numbers; all its plants are looked at at their ages"),
            ),
        }
    }
    if let Some(height) = scenery.ground {
        add("ground", "nothing to do", format!("a rigid floor at the height {height}"));
    }
    let of_time = |is_constant: bool| match is_constant {
        true => ("constant", "it reads no time".to_owned()),
        false => ("evaluated at frames", "it follows t".to_owned()),
    };
    if let Some((program, _)) = &scenery.light {
        let (class, why) = of_time(program.reads().is_empty());
        add("light", class, why);
    }
    if scenery.sky.is_some() {
        add("sky", "constant", "two colours".to_owned());
    }
    if let Some(camera) = &scenery.camera {
        let (class, why) = of_time(camera.program.reads().is_empty());
        add("camera", class, why);
    }
    parts
}
