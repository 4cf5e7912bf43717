//! What surrounds a plant: light, sky, camera, floor, and other plants.

use std::sync::Arc;

use super::{Bounds, Color, OwnerId, Placement, Point, Scene, Vector};

/// The surroundings that a model declares, at the time of its scene. What is `None` is not declared.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surroundings {
    /// Direction towards the sun, of any length but 0 (`light`).
    pub sun: Option<Vector>,
    /// Colours of the zenith and of the horizon (`sky`).
    pub sky: Option<[Color; 2]>,
    /// The camera (`camera`).
    pub camera: Option<Viewpoint>,
    /// Height of a rigid horizontal floor without end, in scene units (`ground`).
    pub floor: Option<f64>,
    /// The colour of the floor, if it is declared.
    pub floor_color: Option<Color>,
}

/// A camera in perspective.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Viewpoint {
    /// The eye, in scene units.
    pub eye: Point,
    /// The point in the middle of the picture, different from the eye.
    pub aim: Point,
    /// Angle of view across the smaller side of the picture, in degrees, from 1 to 120.
    pub angle: f64,
}

/// A plant of another model that is to be drawn: the turtle does not run models.
#[derive(Clone, Copy, Debug)]
pub struct Seedling {
    /// Its index among the plants that the model declares.
    pub plant: usize,
    /// The time of the scene at which its own time begins.
    pub birth: f64,
    /// Its age: the time of its own model.
    pub age: f64,
    /// Its seed as given, any finite number; `None` for the seed of the scene.
    pub seed: Option<f64>,
    /// See [`Plant::placement`].
    pub placement: Placement,
    /// The module that draws it.
    pub owner: OwnerId,
}

/// A plant of another model, placed in a scene.
#[derive(Clone, Debug)]
pub struct Plant {
    /// What the other model draws, in its own colours; shared by all plants that look the same.
    pub scene: Arc<Scene>,
    /// Where it is placed: its `+X`, `+Y` and `+Z` turn to these axes.
    pub placement: Placement,
    /// The module that drew it.
    pub owner: OwnerId,
    default_width: f64,
    bounds: Option<[Point; 2]>,
}

impl Plant {
    /// A plant that looks like this.
    pub fn new(scene: Arc<Scene>, placement: Placement, owner: OwnerId) -> Plant {
        let all = Bounds::of(&scene);
        let default_width = all.default_width();
        Plant { default_width, bounds: all.corners(default_width), scene, placement, owner }
    }

    /// Another plant of the same look.
    pub fn twin(&self, placement: Placement, owner: OwnerId) -> Plant {
        Plant { placement, owner, ..self.clone() }
    }

    /// Width of its lines of default width, which follows from its own extent, in its own units.
    pub fn default_width(&self) -> f64 {
        self.default_width
    }

    /// Opposite corners of the box around it in its own coordinates; `None` if nothing is drawn.
    pub fn bounds(&self) -> Option<[Point; 2]> {
        self.bounds
    }

    /// The corners of that box in the scene.
    pub fn corners(&self) -> impl Iterator<Item = Point> {
        self.bounds.into_iter().flat_map(|bounds| self.placement.corners(bounds))
    }
}
