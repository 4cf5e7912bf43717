//! The parts of a scene: plants of other models, floor, light, sky and camera, wind and tissues, with the work that each one makes.

use serde::Serialize;

use crate::model::{Flow, Model, Primitive, Scenery, Spectrum, Tissue, Units, Wind};
use crate::session::sways;
use crate::sim::brief;
use crate::turtle;

/// A part of a scene that is declared.
#[derive(Clone, Serialize)]
pub struct ScenePart {
    pub part: String,
    /// How it is computed.
    pub class: &'static str,
    pub why: String,
}

impl ScenePart {
    pub fn new(part: impl Into<String>, class: &'static str, why: impl Into<String>) -> ScenePart {
        ScenePart { part: part.into(), class, why: why.into() }
    }

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
    physics(scenery, &mut parts);
    parts.extend(solid(model));
    parts
}

/// The bodies that push the wind aside.
fn solid(model: &Model) -> Option<ScenePart> {
    let mut names: Vec<&str> =
        model.scenery.solids.iter().map(|(kind, _)| &*model.kinds.get(*kind).name).collect();
    names.dedup();
    let part = format!("solid {}", names.join(" "));
    match (names.is_empty(), sways(model) || turtle::lets_out(model) || turtle::drapes(model)) {
        (true, _) => None,
        // What is said of the ground names them.
        (_, false) if model.scenery.bed.is_some() => None,
        (_, false) => {
            let why = "nothing in the scene feels the wind: no stem gives way, nothing is let go, and there is no gas or sheet";
            Some(ScenePart::new(part, "nothing to do", why))
        }
        (_, true) => {
            let around = "the wind flows around the convex hull of each body; their places are those of growth at 120 instants a second, \
                with straight lines in between";
            let met = match model.reads_force() {
                true => {
                    "sheets meet the convex hull of each body and push it, and the equations of the model read the force"
                }
                false => {
                    "sheets meet the convex hull of each body on the way on which the equations of the model lead it"
                }
            };
            let falls = match lets_go(model) {
                true => "; what is let go meets the convex hull of each body, and does not push it",
                false => "",
            };
            let unfelt = match lets_go(model) && model.reads_force() {
                true => {
                    ": warning: its rules read the force of sheets and soil, of which what falls is no part"
                }
                false => "",
            };
            let why = match (sways(model) || turtle::lets_out(model), turtle::drapes(model)) {
                (true, true) => format!("{around}; {met}"),
                (true, false) => around.to_owned(),
                (false, _) => met.to_owned(),
            };
            Some(ScenePart::new(part, "in steps", why + falls + unfelt))
        }
    }
}

/// True if a model, or a plant in it, may let go of something (`@D`).
fn lets_go(model: &Model) -> bool {
    turtle::lets_go(model) || model.scenery.plants.iter().any(|plant| lets_go(&plant.model))
}

/// Units, wind, flows and tissues.
fn physics(scenery: &Scenery, parts: &mut Vec<ScenePart>) {
    let Units { length, time } = scenery.units;
    let has_any = scenery.wind.is_some() || !scenery.flows.is_empty() || !scenery.tissues.is_empty();
    if has_any || scenery.units != Units::default() {
        let units = format!("a unit of length is {} m, a unit of t {} s", digits(length), digits(time));
        parts.push(ScenePart::new("units", CONSTANT, units));
    }
    if let Some(wind) = &scenery.wind {
        self::wind(wind, scenery.units, parts);
    }
    parts.extend(scenery.flows.iter().map(flow));
    if scenery.flow_reader.is_some() {
        let why = match scenery.eddies.is_some() {
            true => {
                "rules or drawings read the wind: mean wind and flows as expressions, turbulence with cubics between 128 instants a second; bodies do not change it"
            }
            false => {
                "rules or drawings read the wind, as expressions of time and place; bodies do not change it"
            }
        };
        parts.push(ScenePart::new("flow_x, flow_y, flow_z", FORMULA, why.to_owned()));
    }
    parts.extend(scenery.tissues.iter().zip(1..).map(|(tissue, number)| self::tissue(tissue, number)));
}

/// The class of a part that does not change.
const CONSTANT: &str = "constant";
/// The class of a part whose value follows from place and time.
const FORMULA: &str = "closed form";

/// A number in as few digits as tell it.
fn digits(value: f64) -> String {
    brief(value, 6)
}

/// Three numbers in parentheses.
fn triple(values: &[f64]) -> String {
    let values: Vec<String> = values.iter().map(|value| digits(*value)).collect();
    format!("({})", values.join(", "))
}

fn wind(wind: &Wind, units: Units, parts: &mut Vec<ScenePart>) {
    let speed = match wind.speed.constants() {
        Some(&[speed]) => format!("at {} m/s", digits(speed)),
        _ => format!("at a speed that follows t, {} m/s at t = 0", digits(wind.speed.eval_one(&[0.0]))),
    };
    let towards = triple(&wind.direction);
    parts.push(ScenePart::new("wind", FORMULA, format!("towards {towards} {speed}")));
    let profile = match wind.roughness {
        Some(z0) => format!(
            "logarithmic over the height, with the roughness length {} m: the speed is that at 10 m",
            digits(z0)
        ),
        None => "the same at all heights".to_owned(),
    };
    parts.push(ScenePart::new("wind: profile", FORMULA, profile));
    let seed = wind.seed;
    let (class, turbulence) = match wind.spectrum {
        Spectrum::Kolmogorov(values) => {
            let [dissipation, wave_number, spread] = values.map(digits);
            let spectrum = format!(
                "Kolmogorov's spectrum from the wave number {wave_number} per m on, rate of dissipation {dissipation} m²/s³, \
                spread of frequencies {spread} m/s, seed {seed}"
            );
            (FORMULA, spectrum)
        }
        Spectrum::VonKarman if wind.turbulence == 0.0 => ("nothing to do", "none is declared".to_owned()),
        Spectrum::VonKarman => {
            let (intensity, scale) = (digits(wind.turbulence), digits(wind.scale));
            let spectrum = format!(
                "intensity {intensity}, integral scale {scale} m, von Kármán's spectrum, seed {seed}"
            );
            (FORMULA, spectrum)
        }
    };
    parts.push(ScenePart::new("wind: turbulence", class, turbulence));
    if let Some(period) = wind.period {
        let seconds = digits(period * units.time);
        let repeats = format!("it repeats after {} units of t, which are {seconds} s", digits(period));
        parts.push(ScenePart::new("wind: period", FORMULA, repeats));
    }
}

fn flow(flow: &Flow) -> ScenePart {
    let name = match flow.primitive {
        Primitive::Uniform => "uniform",
        Primitive::Source => "source",
        Primitive::Sink => "sink",
        Primitive::Vortex => "vortex",
    };
    let values = match (flow.primitive, flow.program.constants()) {
        (_, None) => "its values follow t".to_owned(),
        (Primitive::Uniform, Some(velocity)) => {
            format!("the velocity is {} m/s everywhere", triple(velocity))
        }
        (_, Some(values)) => {
            let (strength, place) = (digits(values[0]), triple(&values[1..4]));
            let axis = match &values[4..] {
                [] => String::new(),
                axis => format!(", around the axis {}", triple(axis)),
            };
            format!("strength {strength}, at {place}{axis}")
        }
    };
    let decay =
        flow.decay.map_or(String::new(), |distance| format!("; decays to 1/e within {}", digits(distance)));
    ScenePart::new(format!("flow {name}"), FORMULA, values + &decay)
}

fn tissue(tissue: &Tissue, number: usize) -> ScenePart {
    /// Diameter in m of the stem whose bending stiffness is shown.
    const STEM: f64 = 1e-3;
    let Tissue { name, stiffness, density, damping, thickness, sag, .. } = tissue;
    let now = stiffness.eval_one(&[0.0]);
    let bending = now * std::f64::consts::PI * STEM.powi(4) / 64.0;
    let (class, follows) = match tissue.is_constant() {
        true => (CONSTANT, ""),
        false => (FORMULA, " at t = 0, and follows t"),
    };
    let shape = if *sag { "without weight, which bends it" } else { "at rest under its weight" };
    ScenePart::new(
        format!("tissue {name} ({number})"),
        class,
        format!(
            "{now:e} Pa{follows}, {} kg/m³, damping ratio {} at 1 Hz; surfaces are {} mm thick; the drawing is the shape {shape}; \
            a stem of 1 mm has the bending stiffness {} N·m²",
            digits(*density),
            digits(*damping),
            digits(thickness * 1e3),
            brief(bending, 3)
        ),
    )
}
