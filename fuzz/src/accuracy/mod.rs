//! Random models against another way of solving them.
//!
//! A model is a row or a tree of cells that are replaced when a condition becomes true ([`plant`]). [`reference`](mod@reference) solves the same equations with
//! small steps of the classical Runge-Kutta method and its own reading of what an event is; nothing of dlsys takes part in
//! that. Where the answer hangs on less than the errors of either, there is no verdict. Rows of cells that are empty at first ([`empty`]) are
//! compared with themselves, for there every sign hangs on less than that.

pub mod empty;
pub mod expression;
pub mod plant;
pub mod reference;
pub mod shape;

use crate::Dice;
use dlsys::session::Session;
use dlsys::sim::{Method, Settings};
use dlsys::tree::ModuleString;

use empty::EmptyRow;
use plant::Plant;
use reference::{Course, solve};

/// Errors of parameters, in units of the tolerance, that are still right; the hard cases and benches ask for the same.
const RIGHT: f64 = 100.0;
/// Start values are changed by this part of themselves, to see what becomes of a difference.
const NUDGE: f64 = 1e-7;
/// Steps of the reference a unit of time, and of the one that tells its error.
const STEPS: [usize; 2] = [2048, 1024];
/// Seconds after which a run is given up.
const LIMIT: f64 = 20.0;

/// What came of a model.
#[derive(Clone, Debug, PartialEq)]
pub enum Verdict {
    /// So many states are right.
    Right(usize),
    /// The reference itself does not tell, from the first time on that would be compared.
    Open,
    /// An error instead of a result: the message.
    Refused(String),
    /// What differs.
    Wrong(String),
}

/// A model, and how it is run, whose result can be judged.
pub trait Judged {
    /// The model in the language.
    fn text(&self) -> String;
    /// The command that shows the result of a file.
    fn command(&self, file: &str) -> String;
    fn judge(&self) -> Verdict;
}

/// A model of any kind, the same for the same seed.
pub fn random(seed: u64) -> Box<dyn Judged> {
    match seed % 4 {
        3 => Box::new(EmptyRow::new(seed)),
        _ => Box::new(Trial::new(seed)),
    }
}

fn dice(seed: u64) -> Dice {
    let mut dice = Dice::new(seed.wrapping_add(1));
    // Seeds that are near each other begin alike.
    for _ in 0..8 {
        dice.roll(2);
    }
    dice
}

/// Method and tolerance of a run.
#[derive(Clone, Copy, Debug)]
pub struct Accuracy {
    pub method: Method,
    pub tolerance: f64,
}

impl Accuracy {
    fn random(dice: &mut Dice) -> Accuracy {
        let method = dice.pick(&[Method::Auto, Method::Auto, Method::Dopri5, Method::Dop853, Method::Radau]);
        let tolerance = dice.pick(&[1e-4, 1e-6, 1e-6, 1e-8]);
        Accuracy { method, tolerance }
    }

    fn command(self, file: &str, times: &[f64]) -> String {
        let times: Vec<String> = times.iter().map(f64::to_string).collect();
        let method = format!("{:?}", self.method).to_lowercase();
        format!(
            "dlsys run {file} --method {method} --tolerance {:e} --at {}",
            self.tolerance,
            times.join(",")
        )
    }

    /// What dlsys gives at some times, and whether it says that it does not know which of two events was first.
    fn run(self, text: &str, times: &[f64]) -> Result<(Vec<ModuleString>, bool), String> {
        let session = Session::from_text("input.dls", text, &[]).map_err(|refused| {
            refused.diagnostics.iter().map(|d| d.render(&refused.source, false)).collect::<String>()
        })?;
        let Accuracy { method, tolerance } = self;
        let settings = Settings { method, tolerance, max_seconds: LIMIT, ..Settings::default() };
        let mut simulation = session.simulate(settings).map_err(|e| e.to_string())?;
        let state = |t: &f64| {
            let mut string = ModuleString::default();
            simulation.at(*t, &mut string).map_err(|e| e.to_string())?;
            Ok(string)
        };
        let states = times.iter().map(state).collect::<Result<_, String>>()?;
        let warns = simulation.remarks().iter().any(|warning| warning.message.contains("which is first"));
        Ok((states, warns))
    }
}

/// A plant with the settings of its run, which is compared with the reference.
pub struct Trial {
    pub plant: Plant,
    pub accuracy: Accuracy,
}

impl Trial {
    pub fn new(seed: u64) -> Trial {
        let mut dice = dice(seed);
        let plant = Plant::random(&mut dice);
        Trial { plant, accuracy: Accuracy::random(&mut dice) }
    }
}

impl Judged for Trial {
    fn text(&self) -> String {
        self.plant.text()
    }

    fn command(&self, file: &str) -> String {
        self.accuracy.command(file, &self.plant.times)
    }

    fn judge(&self) -> Verdict {
        let plant = &self.plant;
        let [best, coarse] = STEPS.map(|steps| solve(plant, steps, 0.0));
        let nudged = solve(plant, STEPS[1], NUDGE);
        // From the first state on that any of them has not reached, or where they differ in more than numbers, nothing is known.
        let known =
            [&best, &coarse, &nudged].into_iter().map(|course| course.states.len()).min().unwrap_or(0);
        let told = |course: &Course, at: usize| (course.events[at], course.states[at].len());
        let alike =
            |at: &usize| told(&best, *at) == told(&coarse, *at) && told(&best, *at) == told(&nudged, *at);
        let known = (0..known).take_while(alike).count();
        if known == 0 {
            return Verdict::Open;
        }
        let (found, warns) = match self.accuracy.run(&plant.text(), &plant.times[..known]) {
            Ok(found) => found,
            // Its condition is not one that the equations hold for: the reference has no such thing.
            Err(message) if message.contains("is born outside its domain") => return Verdict::Open,
            Err(message) => return Verdict::Refused(message),
        };
        let wrong = |why: String| if warns { Verdict::Open } else { Verdict::Wrong(why) };
        for (at, string) in found.iter().enumerate() {
            let (values, wanted) = (plant.values_of(string), best.states[at].len());
            let Some(values) = values.filter(|values| values.len() == wanted) else {
                return wrong(format!("t = {}: there are not {wanted} cells", plant.times[at]));
            };
            if let Some(why) = self.difference(at, &values, [&best, &coarse, &nudged]) {
                return wrong(why);
            }
        }
        Verdict::Right(known)
    }
}

impl Trial {
    /// The first parameter at a time that is wrong.
    fn difference(
        &self,
        at: usize,
        found: &[[f64; 3]],
        [best, coarse, nudged]: [&Course; 3],
    ) -> Option<String> {
        let spread = |other: &Course| {
            let pairs = best.states[at].iter().flatten().zip(other.states[at].iter().flatten());
            pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
        };
        // A difference at the start grows to so many times itself.
        let growth = (spread(nudged) / NUDGE).max(1.0);
        for (cell, (found, wanted)) in found.iter().zip(&best.states[at]).enumerate() {
            for (name, (found, wanted)) in ["x", "c", "v"].iter().zip(found.iter().zip(wanted)) {
                let bound =
                    RIGHT * self.accuracy.tolerance * growth * wanted.abs().max(1.0) + 10.0 * spread(coarse);
                let error = (found - wanted).abs();
                if error.is_nan() || error > bound {
                    return Some(format!(
                        "t = {}, cell {cell}: {name} = {found}, not {wanted}: {:.0} times the tolerance, where a difference grows {growth:.1} times",
                        self.plant.times[at],
                        error / self.accuracy.tolerance
                    ));
                }
            }
        }
        None
    }
}
