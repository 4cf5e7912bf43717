//! The surroundings of a plant: plants of other models, light, sky, camera, floor.

use std::sync::Arc;

use crate::{Bed, FieldCache, Flow, Gas, KindId, Model, Pour, Rgb, Sheet, Soil, Tissue, Units, Wind};
use dlsys_diagnostic::{Source, Span};
use dlsys_expr::{FieldSlot, Program};

/// The declarations of a model that concern its surroundings: `plant`, `light`, `sky`, `camera`, `ground`, `units`, `wind`, `flow`,
/// `tissue`, `gas`, `sheet`, `solid`, `shelf`, `soil`, `pour`.
#[derive(Clone, Debug, Default)]
pub struct Scenery {
    /// In the order written.
    pub plants: Vec<Arc<Plant>>,
    /// The direction towards the sun, as three outputs; it reads `t`.
    pub light: Option<(Program, Span)>,
    /// The colours of the zenith and of the horizon.
    pub sky: Option<[Rgb; 2]>,
    /// The camera.
    pub camera: Option<Camera>,
    /// The height of a rigid floor without end, in scene units.
    pub ground: Option<f64>,
    /// Its colour, if it is declared.
    pub ground_color: Option<Rgb>,
    /// What a unit of the model is in SI.
    pub units: Units,
    /// The wind.
    pub wind: Option<Wind>,
    /// Further parts of the wind, in the order written.
    pub flows: Vec<Flow>,
    /// In the order written; their names stand for their numbers, from 1.
    pub tissues: Vec<Tissue>,
    /// In the order written; their names stand for their numbers, from 1.
    pub gases: Vec<Gas>,
    /// Flexible surfaces and nets, in the order written.
    pub sheets: Vec<Arc<Sheet>>,
    /// The kinds of modules whose drawings are solid bodies, in the order written, with the places of their names.
    pub solids: Vec<(KindId, Span)>,
    /// The kinds of modules whose drawings carry what falls on them, likewise.
    pub shelves: Vec<(KindId, Span)>,
    /// In the order written.
    pub soils: Vec<Soil>,
    /// Ground that gives way.
    pub bed: Option<Bed>,
    /// What is poured on it, in the order written.
    pub pours: Vec<Pour>,
    /// The field of the wind.
    pub field: FieldCache,
    /// The height of soil in units of the model that rules read, as a field of t, x, the number of its state, and z. Simulations put it there.
    pub heights: Option<FieldSlot>,
    /// The field of the heights.
    pub layers: FieldCache,
    /// The first place in rules and drawings that reads the wind.
    pub flow_reader: Option<Span>,
    /// The turbulence that they read, relative to its amplitude, in m/s at times and places of the model. Simulations put it there.
    pub eddies: Option<FieldSlot>,
}

/// `camera at X, Y, Z towards X, Y, Z angle A`
#[derive(Clone, Debug)]
pub struct Camera {
    /// The eye and the point that it looks at, three outputs each, then the angle of view in degrees; it reads `t`.
    pub program: Program,
    /// The place of the declaration in the text.
    pub span: Span,
}

impl Camera {
    /// The angle of view if the text gives none, in degrees.
    pub const ANGLE: f64 = 40.0;
    /// The least and the greatest angle of view, in degrees.
    pub const ANGLES: [f64; 2] = [1.0, 120.0];
}

/// `plant @NAME from "FILE" with …`: another model, drawn by the module `@NAME(b, seed)` as it is at its own time t - b.
#[derive(Clone, Debug)]
pub struct Plant {
    /// The name with its mark: `@Grass`.
    pub name: String,
    /// The other model, with the params set.
    pub model: Model,
    /// Its text, to which its errors refer.
    pub source: Source,
    /// The place of the declaration in the text of this model.
    pub span: Span,
    /// True if it draws random numbers, so that plants with other seeds differ.
    pub is_random: bool,
}

impl Model {
    /// True if a run of this model depends on the seed.
    pub fn is_random(&self) -> bool {
        !self.axiom.is_certain()
            || self.kinds.iter().any(|(_, kind)| !kind.has_no_rules() && !kind.clocks.is_empty())
            || self.rules.iter().any(|rule| rule.produces.iter().any(|p| p.outcome.is_random()))
            || self.scenery.plants.iter().any(|plant| plant.is_random)
    }
}

impl Scenery {
    /// The height of the ground at a place at the beginning, in units of the model, if there is one.
    pub fn surface(&self, x: f64, z: f64) -> Option<f64> {
        self.ground.or_else(|| self.bed.as_ref().map(|bed| bed.surface(x, z)))
    }
}
