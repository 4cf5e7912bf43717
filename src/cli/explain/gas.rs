//! Gases (`gas`, `@S`): the number of blobs that a scene will have, and the work of following them.

use super::bending::PATIENCE;
use super::scene::ScenePart;
use crate::model::{Gas, Model};
use crate::scene::GasSource;
use crate::sim::{Settings, Simulation, brief};
use crate::surround::{GAS_TICK, MOST_BLOBS};
use crate::tree::ModuleString;
use crate::turtle;

/// The rows of the table of the scene, one for each gas.
pub fn parts(model: &Model) -> Vec<ScenePart> {
    let gases = &model.scenery.gases;
    if gases.is_empty() {
        return Vec::new();
    }
    let t = model.frames.map_or(0.0, |frames| frames.to);
    let found = if turtle::lets_out(model) { sources(model, t) } else { Ok(Vec::new()) };
    let part = |(number, gas): (usize, &Gas)| {
        let name = format!("gas {} ({})", gas.name, number + 1);
        let own = match &found {
            Ok(found) => found.iter().filter(|source| source.gas == number).collect::<Vec<_>>(),
            Err(why) => {
                let why =
                    format!("the number of blobs is unknown, because the model cannot be run so far: {why}");
                return ScenePart::new(name, "in steps", why);
            }
        };
        if own.is_empty() {
            let why = format!("nothing that is drawn at t = {} lets it out", brief(t, 6));
            return ScenePart::new(name, "nothing to do", why);
        }
        ScenePart::new(name, "in steps", why(gas, &own, t, model.scenery.units.time))
    };
    gases.iter().enumerate().map(part).collect()
}

/// Runs the model to a time; the sources that are drawn then.
fn sources(model: &Model, t: f64) -> Result<Vec<GasSource>, String> {
    let settings = Settings { max_seconds: PATIENCE, ..Settings::default() };
    let told = |error: crate::sim::Error| error.diagnostic().message;
    let (mut string, mut scene) = (ModuleString::default(), turtle::blank(model));
    Simulation::new(model, settings).map_err(told)?.at(t, &mut string).map_err(told)?;
    turtle::draw(model, &string, &mut scene).map_err(|error| error.diagnostic().message)?;
    Ok(scene.sources)
}

fn why(gas: &Gas, sources: &[&GasSource], t: f64, second: f64) -> String {
    let (seconds, life) = (t * second, gas.life());
    let rate: f64 = sources.iter().map(|source| source.rate / second).sum();
    let blobs = rate * life.min(seconds);
    let lasts = match life.is_finite() {
        true => format!("each lasts {} s, until a thousandth of its mass is left", brief(life, 3)),
        false => "without `decay` they never end".to_owned(),
    };
    let depth = gas.extinction * gas.mass / (std::f64::consts::TAU * gas.size * gas.size);
    let sources_of = if sources.len() == 1 { "one source makes" } else { "sources make" };
    let many = if blobs > MOST_BLOBS as f64 {
        format!("; that is more than the {MOST_BLOBS} that are possible")
    } else {
        String::new()
    };
    format!(
        "{sources_of} {} blobs in a second at t = {}, {lasts}: about {} at t = {}{many}; a new one takes {} of the light through its middle; \
        the wind carries them in {} ticks of 1/32 s, blobs whose error is too large in parts of these",
        brief(rate, 4),
        brief(t, 6),
        brief(blobs.ceil(), 4),
        brief(t, 6),
        brief(1.0 - (-depth).exp(), 2),
        brief((seconds / GAS_TICK).ceil(), 6),
    )
}
