//! The physics of a scene: units, wind, and the tissues that give way in it. All values but those of `units` are in SI.

use std::any::Any;
use std::sync::{Arc, OnceLock};

use dlsys_diagnostic::Span;
use dlsys_expr::Program;

use crate::Rgb;

/// `units length M, time S`: what a unit of the model is in SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Units {
    /// Metres in a unit of length.
    pub length: f64,
    /// Seconds in a unit of time.
    pub time: f64,
}

impl Default for Units {
    fn default() -> Units {
        Units { length: 1.0, time: 1.0 }
    }
}

/// `tissue NAME = stiffness E, density D, damping Z`: a material of stems and surfaces.
#[derive(Clone, Debug)]
pub struct Tissue {
    /// The name, which stands for its number (from 1) in expressions.
    pub name: Arc<str>,
    /// Young's modulus in Pa; it reads `t`.
    pub stiffness: Program,
    /// Density in kg/m³.
    pub density: f64,
    /// Damping ratio at 1 Hz.
    pub damping: f64,
    /// Thickness of surfaces in m.
    pub thickness: f64,
    /// True if the drawing is the shape without weight, which weight then bends; else it is the shape under its own weight.
    pub sag: bool,
    /// The place of the declaration in the text.
    pub span: Span,
}

impl Tissue {
    /// The thickness of surfaces if the text gives none, in m.
    pub const THICKNESS: f64 = 2e-4;
    /// The largest Young's modulus in Pa.
    pub const STIFFEST: f64 = 1e15;
    /// The density of surfaces without a tissue, in kg/m³.
    pub const SURFACE_DENSITY: f64 = 1000.0;

    /// Young's modulus in Pa at a time of the model; `None` if it is out of range: greater than 0 and at most [`Tissue::STIFFEST`].
    pub fn stiffness_at(&self, time: f64) -> Option<f64> {
        let value = self.stiffness.eval_one(&[time]);
        (value > 0.0 && value <= Tissue::STIFFEST).then_some(value)
    }

    /// True if its stiffness does not follow the time.
    pub fn is_constant(&self) -> bool {
        self.stiffness.constants().is_some()
    }
}

/// `gas NAME = size S, mass M, extinction X, …`: smoke, steam, mist or pollen, as blobs that the wind carries.
#[derive(Clone, Debug, PartialEq)]
pub struct Gas {
    /// The name, which stands for its number (from 1) in expressions.
    pub name: Arc<str>,
    /// Diffusivity in m²/s.
    pub diffusion: f64,
    /// Rate of decay in 1/s.
    pub decay: f64,
    /// Standard deviation of a new blob in m.
    pub size: f64,
    /// Mass of a new blob in kg.
    pub mass: f64,
    /// Extinction in m²/kg.
    pub extinction: f64,
    /// The part of what is taken from light that is scattered, 0 to 1.
    pub albedo: f64,
    /// Strength of the light that it emits.
    pub glow: f64,
    /// The speed at which it sinks in still air, in m/s; negative: it rises.
    pub fall: f64,
    /// Its colour in full light.
    pub color: Rgb,
    /// The place of the declaration in the text.
    pub span: Span,
}

impl Gas {
    /// The colour if the text gives none.
    pub const COLOR: Rgb = 0xff_ff_ff;
    /// The part of its mass with which a blob ends.
    pub const FAINTEST: f64 = 1e-3;

    /// Seconds that a blob lasts; infinite without decay.
    pub fn life(&self) -> f64 {
        if self.decay > 0.0 { -Gas::FAINTEST.ln() / self.decay } else { f64::INFINITY }
    }
}

/// `wind X, Y, Z speed U turbulence I scale L …`
#[derive(Clone, Debug)]
pub struct Wind {
    /// The direction of the mean flow, of any length but 0.
    pub direction: [f64; 3],
    /// The mean speed in m/s; it reads `t`, in units of the model.
    pub speed: Program,
    /// Root mean square of a component of the turbulence, relative to the speed.
    pub turbulence: f64,
    /// The longitudinal integral scale of the turbulence in m.
    pub scale: f64,
    /// Roughness length of a logarithmic profile in m.
    pub roughness: Option<f64>,
    /// Period after which the wind repeats, in units of the model.
    pub period: Option<f64>,
    /// The seed of the turbulence.
    pub seed: u64,
    /// The spectrum of the turbulence.
    pub spectrum: Spectrum,
    /// The place of the declaration in the text.
    pub span: Span,
}

/// The spectrum of turbulence.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub enum Spectrum {
    /// Von Kármán's, from intensity and scale.
    #[default]
    VonKarman,
    /// Kolmogorov's as in Stam and Fiume 1993: rate of dissipation, smallest wave number, spread of frequencies.
    Kolmogorov([f64; 3]),
}

/// `flow …`: a further part of the large-scale wind (Stam and Fiume 1993, section 3).
#[derive(Clone, Debug)]
pub struct Flow {
    /// Its kind.
    pub primitive: Primitive,
    /// Its values, which read `t`: velocity (3) of a uniform flow; else strength, position (3, in units of the model), and of
    /// a vortex the axis (3).
    pub program: Program,
    /// Distance in units of the model within which a source, sink or vortex decays to 1/e; `None` without decay.
    pub decay: Option<f64>,
    /// The place of the declaration in the text.
    pub span: Span,
}

/// Kinds of flow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Primitive {
    /// The same velocity everywhere.
    Uniform,
    /// Away from a point.
    Source,
    /// Towards a point.
    Sink,
    /// Around an axis.
    Vortex,
}

/// A place for a field that is made of declarations, of the wind or of the ground, once for the model and its copies.
#[derive(Clone, Debug, Default)]
pub struct FieldCache(Arc<OnceLock<Arc<dyn Any + Send + Sync>>>);

impl FieldCache {
    /// The field, made by a function if it has not been made; `None` if it is of another type.
    ///
    /// # Errors
    /// That of the function. Nothing is kept then.
    pub fn get_or_make<T: Any + Send + Sync, E>(
        &self,
        make: impl FnOnce() -> Result<Arc<T>, E>,
    ) -> Result<Option<Arc<T>>, E> {
        if self.0.get().is_none() {
            let made: Arc<dyn Any + Send + Sync> = make()?;
            // Another thread may have been faster; both have made the same.
            let _ = self.0.set(made);
        }
        Ok(self.0.get().cloned().and_then(|made| made.downcast().ok()))
    }
}
