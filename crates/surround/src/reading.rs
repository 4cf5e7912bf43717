//! What rules read of the world around them, as fields of expressions: the turbulence of the wind and the height of soil, in coordinates and times of the model.
//!
//! Mean wind and flows are expressions of the model (`dlsys_compile`), and only the turbulence is computed here, as [`Eddies`]. Bodies do not change it: they
//! may be what grows by it. Growth does not act on the wind, so it is a function of time and place like any other, and no simulation waits for it.

use std::sync::Arc;

use dlsys_expr::{FIELD_ARGUMENTS, Field, FieldPart, Interval};
use dlsys_model::{Model, Units};
use dlsys_sim::GroundRule;
use dlsys_wind::Eddies;
use nalgebra::Vector3;

use crate::columns;
use crate::layers::Layers;
use crate::terrain::TICKS;
use crate::{Error, Place, Weather};

/// Puts the wind and the ground where the expressions of a model read them; [`start`](crate::start) does so, too. Without it they have no value.
///
/// # Errors
/// A wind or a ground whose values are out of range.
pub fn bind(model: &Model) -> Result<(), Error> {
    let scenery = &model.scenery;
    if let Some(slot) = scenery.eddies.as_ref().filter(|slot| slot.get().is_none())
        && let Some(weather) = Weather::around_bodies(scenery)?
    {
        slot.set(Arc::new(Turbulence { eddies: Eddies::new(weather.shared_field()), units: scenery.units }));
    }
    if let Some(slot) = scenery.heights.as_ref().filter(|slot| slot.get().is_none())
        && let Some(layers) = layers(model)?
    {
        slot.set(layers);
    }
    Ok(())
}

/// The heights of soil that rules of a model read, if they do.
///
/// # Errors
/// A ground whose values are out of range.
pub(crate) fn layers(model: &Model) -> Result<Option<Arc<Layers>>, Error> {
    if model.scenery.heights.is_none() {
        return Ok(None);
    }
    let place = Place::of_scene(&model.scenery);
    let Some(ground) = columns::ground(model, &place, (1, TICKS), GroundRule::Law)? else { return Ok(None) };
    let tick = 1.0 / (TICKS * place.units.time);
    model.scenery.layers.get_or_make(|| Ok(Arc::new(Layers::new(ground, (place.units.length, tick)))))
}

/// The turbulence of a scene in m/s, relative to its amplitude, at times and places of its model.
#[derive(Debug)]
struct Turbulence {
    eddies: Eddies,
    units: Units,
}

impl Turbulence {
    /// What a derivative is multiplied by: an argument is so many seconds or metres.
    fn unit(&self, argument: Option<u8>) -> f64 {
        match argument {
            None => 1.0,
            Some(0) => self.units.time,
            Some(_) => self.units.length,
        }
    }
}

impl Field for Turbulence {
    fn value(&self, part: FieldPart, [time, x, y, z]: [f64; FIELD_ARGUMENTS]) -> f64 {
        let seconds = time * self.units.time;
        let place = Vector3::new(x, y, z) * self.units.length;
        let component = usize::from(part.component);
        let found = match part.by {
            None => self.eddies.velocity(seconds, place).map(|velocity| velocity[component]),
            Some(0) => self.eddies.jet(seconds, place).map(|jet| jet.rate[component]),
            Some(by) => {
                self.eddies.jet(seconds, place).map(|jet| jet.gradient[(component, usize::from(by) - 1)])
            }
        };
        // Not a number where the wind has no value: the simulation reports the rate.
        found.map_or(f64::NAN, |value| value * self.unit(part.by))
    }

    fn over(&self, part: FieldPart, at: [Interval; FIELD_ARGUMENTS]) -> Interval {
        let metres = [at[1], at[2], at[3]].map(|of| [of.lo, of.hi].map(|x| x * self.units.length));
        let half = metres.map(|[low, high]| 0.5 * (high - low));
        let middle = Vector3::from(metres.map(|[low, high]| 0.5 * (low + high)));
        let reach = Vector3::from(half).norm();
        let time = [at[0].lo, at[0].hi].map(|time| (time * self.units.time).max(0.0));
        let component = usize::from(part.component);
        let by_place = part.by.is_some_and(|by| by > 0);
        let Ok(bounds) = self.eddies.bounds(time, (middle, reach), by_place) else { return Interval::EMPTY };
        let found = match part.by {
            None => bounds.velocity[component],
            Some(0) => bounds.rate[component],
            Some(by) => bounds.gradient[component][usize::from(by) - 1],
        };
        let [lo, hi] = found.map(|bound| bound * self.unit(part.by));
        // Where the wind has no value, no bound is one.
        match lo <= hi {
            true => Interval { lo, hi, partial: false },
            false => Interval::EMPTY,
        }
    }

    fn stretch(&self) -> f64 {
        self.eddies.step() / self.units.time
    }
}
