//! The Anabaena listing up to t = 575, with dlsys's own method and with forward Euler and located events.
//!
//! The reference states are those of the project's tests: one global system, DOP853 at 1e-12, a root search for every
//! event.

use dlsys::session::Session;
use dlsys::sim::{Method, Settings, Stats};
use dlsys::tree::ModuleString;

use crate::solver;

const MODEL: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/paper-models/anabaena.dls");
const STATES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/reference/listings.json");

/// End of the run.
pub const END: f64 = 575.0;
/// The error both are to have, relative to max(1, |value|), as dlsys's tolerance is meant.
pub const TARGET: f64 = 1e-6;

/// A state: names of the modules with their parameters.
pub type State = Vec<(String, Vec<f64>)>;

/// The listing with the reference states.
pub struct Anabaena {
    pub session: Session,
    /// Times with their states.
    pub states: Vec<(f64, State)>,
}

impl Anabaena {
    /// Reads the model and the states.
    pub fn open() -> Result<Anabaena, String> {
        let read = |path: &str| std::fs::read_to_string(path).map_err(|e| format!("{path}: {e}"));
        let all: serde_json::Value = serde_json::from_str(&read(STATES)?).map_err(|e| e.to_string())?;
        let module = |m: &serde_json::Value| -> Option<(String, Vec<f64>)> {
            let parameters = m[1].as_array()?.iter().filter_map(serde_json::Value::as_f64).collect();
            Some((m[0].as_str()?.to_string(), parameters))
        };
        let state = |s: &serde_json::Value| -> Option<(f64, State)> {
            Some((s["t"].as_f64()?, s["modules"].as_array()?.iter().filter_map(module).collect()))
        };
        let states = all["anabaena"]["states"].as_array().into_iter().flatten().filter_map(state).collect();
        Ok(Anabaena { session: solver::session(&read(MODEL)?)?, states })
    }

    /// The timed run: a simulation from its start to `t`.
    pub fn run(&self, settings: Settings, t: f64) -> Result<(ModuleString, Stats), String> {
        let mut simulation = self.session.simulate(settings).map_err(|e| e.to_string())?;
        let mut string = ModuleString::default();
        simulation.at(t, &mut string).map_err(|e| e.to_string())?;
        Ok((string, simulation.stats()))
    }

    /// The reference state at a time.
    pub fn state(&self, t: f64) -> Option<&State> {
        self.states.iter().find(|s| s.0 == t).map(|s| &s.1)
    }

    /// Largest difference from a state, relative to max(1, |value|); infinite if the modules are not the same ones.
    pub fn error(&self, string: &ModuleString, state: &State) -> f64 {
        if string.len() != state.len() {
            return f64::INFINITY;
        }
        let mut worst: f64 = 0.0;
        for (module, (name, parameters)) in string.iter().zip(state) {
            if self.session.model.kinds.get(module.kind).name != *name
                || module.parameters.len() != parameters.len()
            {
                return f64::INFINITY;
            }
            for (x, y) in module.parameters.iter().zip(parameters) {
                worst = worst.max((x - y).abs() / y.abs().max(1.0));
            }
        }
        worst
    }
}

/// Forward Euler with located events.
pub fn euler(step_size: f64) -> Settings {
    Settings { method: Method::Euler, step_size, ..Settings::default() }
}

/// dlsys's own choice.
pub fn auto(tolerance: f64) -> Settings {
    Settings { tolerance, ..Settings::default() }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The run that is timed is the one whose error is measured, and a coarser one is worse.
    #[test]
    fn errors_fall_with_the_step() {
        let anabaena = Anabaena::open().expect("the tests of the project are there");
        let state = anabaena.state(50.0).expect("there is a state at 50");
        let error = |settings| anabaena.error(&anabaena.run(settings, 50.0).expect("it runs").0, state);
        let (coarse, fine, own) = (error(euler(0.02)), error(euler(0.01)), error(auto(1e-8)));
        assert!((1.8..2.2).contains(&(coarse / fine)), "{coarse} {fine}");
        assert!(own < 1e-6 && own < fine, "{own}");
    }
}
