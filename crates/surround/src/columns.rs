//! The columns that a model declares: its ground and soil as values of the crate that follows them, in SI.

use dlsys_geometry::scene::Point;
use dlsys_ground::{self as ground, Description, Extent, Ground};
use dlsys_model::{Bed, Model, Soil, SoilBase};
use dlsys_sim::GroundRule;

use crate::Error;
use crate::place::Place;

/// Height of the soil above what does not give way, in columns, where the text gives no `depth`.
const DEEP: f64 = 10_000.0;
/// Memory for columns that have been touched, in MB.
const MEMORY: usize = 1024;

/// Points in m in units of the model.
pub(crate) fn from_metres(points: &[ground::Vector], metre: f64) -> Vec<Point> {
    points.iter().map(|point| Point::from(point / metre)).collect()
}

/// The ground of a model at the beginning, with so many ticks in a second; `None` if none is declared that gives way.
///
/// # Errors
/// Values that are out of range.
pub(crate) fn ground(
    model: &Model,
    place: &Place,
    (threads, ticks): (usize, f64),
    rule: GroundRule,
) -> Result<Option<Ground>, Error> {
    let Some(bed) = &model.scenery.bed else { return Ok(None) };
    let metre = place.units.length;
    let description = describe(bed, &model.scenery.soils[bed.soil], metre);
    let settings = ground::Settings {
        tick: 1.0 / ticks,
        threads: threads.clamp(1, 1024),
        memory: MEMORY,
        slides: bed.texture.is_some(),
        rule: match rule {
            GroundRule::Law => ground::Rule::Law,
            GroundRule::Sumner => ground::Rule::Sumner,
            GroundRule::Sandbox => ground::Rule::Sandbox,
            GroundRule::Li => ground::Rule::Li,
        },
        ..ground::Settings::default()
    };
    let made = Ground::new(description, settings);
    made.map(Some).map_err(|error| Error::Ground { error, time: 0.0, metre, span: bed.span })
}

/// The columns that a declaration describes, in SI.
fn describe(bed: &Bed, soil: &Soil, metre: f64) -> Description {
    let cell = bed.cell * metre;
    let depth = bed.depth.map_or(DEEP * cell, |depth| depth * metre);
    let last = (bed.extent / bed.cell).round() as i32;
    let declared = bed.clone();
    let height = move |x: f64, z: f64| declared.surface(x / metre, z / metre) * metre - depth;
    let flat = bed.height.level().map(|height| ground::Relief::Level(height * metre - depth));
    Description {
        cell,
        extent: Extent::around(last),
        soil: material(soil),
        bed: flat.unwrap_or_else(|| ground::Relief::function(height)),
        depth: ground::Relief::Level(depth),
    }
}

/// How soil holds what lands on it: with a friction that is the tangent of its angle of repose, up to that of 45°, as the soil gives way above; without rebounds; and with
/// the resistance to rolling of sand, 0.3, or with cohesion of medium hard soil, 0.08 (Gillespie, *Fundamentals of Vehicle Dynamics*, 1992, table 4.1).
pub(crate) fn grip(soil: &ground::Soil) -> dlsys_fall::Surface {
    let rolling = if soil.cohesion > 0.0 { 0.08 } else { 0.3 };
    dlsys_fall::Surface { friction: soil.slope().min(1.0), restitution: 0.0, rolling }
}

/// A soil with what it has of its base, in the units of the crate that follows it.
pub fn material(soil: &Soil) -> ground::Soil {
    let base = match soil.base {
        SoilBase::Sand => ground::Soil::sand(),
        SoilBase::Mud => ground::Soil::mud(),
        SoilBase::Snow => ground::Soil::snow(),
        SoilBase::Soil => ground::Soil::earth(),
    };
    let repose = soil.repose.unwrap_or(base.repose);
    ground::Soil {
        repose,
        // What is pressed stands no less steep.
        inner: soil.inner.unwrap_or(base.inner.max(repose)),
        push: soil.push.unwrap_or(base.push),
        rough: soil.rough.unwrap_or(base.rough),
        flow: soil.flow.unwrap_or(base.flow),
        cohesion: soil.cohesion.unwrap_or(base.cohesion),
        weight: soil.weight.unwrap_or(base.weight),
        bearing: soil.bearing.or(base.bearing),
        swell: soil.swell.unwrap_or(base.swell),
        stick: soil.stick.unwrap_or(base.stick),
        shed: soil.shed.unwrap_or(base.shed),
        hold: soil.hold,
        exponent: soil.exponent.unwrap_or(base.exponent),
        grain: soil.grain,
    }
}
