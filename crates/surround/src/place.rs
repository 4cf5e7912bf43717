//! Where and when a model lives in a scene: its units, its birth, and its turtle's axes in the world.

use dlsys_model::{Scenery, Units};
use dlsys_sway as sway;
use nalgebra::{Matrix3, Point3, Vector3};

use crate::CLOCK;

/// The place of a model in the scene: its coordinates and its time in terms of the scene's, in SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// What a unit of the model is in SI.
    pub units: Units,
    /// The time of the scene at which the model is at its own t = 0, in s.
    pub birth: f64,
    /// Where the model's origin stands, in m.
    pub origin: Point3<f64>,
    /// From the model's axes to those of the scene: a rotation.
    pub turn: Matrix3<f64>,
    /// The height of the ground of the scene, in m, if there is one.
    pub ground: Option<f64>,
}

impl Place {
    /// The place of the model of the scene itself.
    pub fn of_scene(scenery: &Scenery) -> Place {
        let units = scenery.units;
        let ground = scenery.ground.map(|height| height * units.length);
        Place { units, birth: 0.0, origin: Point3::origin(), turn: Matrix3::identity(), ground }
    }

    /// The time of the scene, in s, at a time of the model.
    pub(crate) fn seconds(&self, t: f64) -> f64 {
        self.birth + t * self.units.time
    }

    /// The time of the model at a time of the scene, in s.
    pub(crate) fn time_at(&self, seconds: f64) -> f64 {
        (seconds - self.birth) / self.units.time
    }

    /// The time of the model at a tick of the scene's clock.
    pub(crate) fn time_of(&self, tick: u64) -> f64 {
        self.time_at(tick as f64 * CLOCK)
    }

    /// The first tick at which the model lives and the scene has begun.
    pub(crate) fn first_tick(&self) -> u64 {
        (self.birth / CLOCK).ceil().max(0.0) as u64
    }

    /// The tick at or before a time of the scene, in s.
    pub(crate) fn tick_at(seconds: f64) -> f64 {
        (seconds / CLOCK).floor()
    }

    /// Gravity in the model's axes, for the settings of a solver.
    pub(crate) fn settings(&self, settings: sway::Settings) -> sway::Settings {
        let mut settings = settings;
        settings.air.gravity = self.turn.transpose() * settings.air.gravity;
        settings
    }

    /// A point of the model (m) in the scene.
    pub(crate) fn point(&self, p: Vector3<f64>) -> Vector3<f64> {
        self.origin.coords + self.turn * p
    }
}
