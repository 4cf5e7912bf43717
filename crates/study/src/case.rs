//! Hard cases: models whose first lines, which begin with `#=`, state the exact results.
//!
//! ```text
//! #= case: B02                          the name of the case
//! #= group: tangency
//! #= why: both crossings are 2e-6 apart
//! #= source: exact
//! #= at 0.5: A(0.75, 1) within 1e-9     the whole string; `within 10 tol` is a multiple of the run's tolerance
//! #= at 3: relative B(1e-150)           errors relative to |value| instead of max(1, |value|)
//! #= count C by 8.4: 4096               the number of modules of a name; `count *` counts all
//! #= sum C 1 by 575: 314.19 within 1e-12 relative     sum of parameter no. 1 of all modules of a name
//! #= events by 10: 3                    productions up to and including a time
//! #= instants by 10: 2                  distinct instants of productions
//! #= fails Zeno at 2 within 1e-6        the run ends with this error; `NotFinite|StepTooSmall` allows either
//! #= fails Zeno by 3                    the last time of such a run
//! #= tolerances: 1e-6 1e-9              tolerances of the runs; likewise `methods: auto dopri5`
//! #= set r = 0.1                        the value of a param
//! ```

use super::error::Error;
use dlsys_compile::Setting;
use dlsys_sim::Method;

/// Names of the errors that a case may expect.
const FAULTS: [&str; 8] = [
    "OutsideDomain",
    "Chattering",
    "Cascade",
    "Zeno",
    "NotFinite",
    "StepTooSmall",
    "TooManyModules",
    "InDoubt",
];

/// A model with exact answers.
#[derive(Clone, Debug)]
pub struct Case {
    /// Path or name of the file.
    pub file: String,
    /// The whole text of the file, a model.
    pub text: String,
    /// Short name, as for `--case`.
    pub id: String,
    /// Theme, such as `tangency`.
    pub group: String,
    /// Why simulators fail on it.
    pub why: String,
    /// Derivation of the exact results.
    pub source: String,
    /// The exact results, each with the number of its line.
    pub expectations: Vec<(usize, Expectation)>,
    /// Last time of a run that should fail; `None` for 1.5 times the expected time of the error, plus 1.
    pub fails_by: Option<f64>,
    /// Tolerances with which it is run.
    pub tolerances: Vec<f64>,
    /// Methods with which it is run.
    pub methods: Vec<Method>,
    /// Values of params.
    pub settings: Vec<Setting>,
}

/// An exact result. Times are in the model's unit.
#[derive(Clone, Debug, PartialEq)]
pub enum Expectation {
    /// The whole string at a time.
    At {
        /// Time.
        t: f64,
        /// The modules, brackets included.
        string: Vec<PlainModule>,
        /// Allowed error of each parameter.
        within: Within,
    },
    /// The number of modules.
    Count {
        /// Name of the modules; `None` counts all but brackets.
        name: Option<String>,
        /// Time.
        t: f64,
        /// Their number.
        count: u64,
    },
    /// The sum of a parameter (from 0) over all modules of this name.
    Sum {
        /// Name of the modules.
        name: String,
        /// Index of the parameter, from 0.
        parameter: usize,
        /// Time.
        t: f64,
        /// The sum.
        sum: f64,
        /// Allowed error.
        within: Within,
    },
    /// The number of productions.
    Events {
        /// Time, included.
        t: f64,
        /// Their number.
        count: u64,
    },
    /// The number of instants at which there were productions.
    Instants {
        /// Time, included.
        t: f64,
        /// Their number.
        count: u64,
    },
    /// The run ends with one of these errors, at this time.
    Fails {
        /// Names of variants of [`dlsys_sim::Error`].
        faults: Vec<&'static str>,
        /// Time of the error.
        t: f64,
        /// Allowed error of this time.
        within: Within,
    },
}

impl Expectation {
    /// The time at which the result holds.
    pub fn time(&self) -> f64 {
        match self {
            Expectation::At { t, .. }
            | Expectation::Count { t, .. }
            | Expectation::Sum { t, .. }
            | Expectation::Events { t, .. }
            | Expectation::Instants { t, .. }
            | Expectation::Fails { t, .. } => *t,
        }
    }
}

/// A module with its name and parameters, found or expected.
#[derive(Clone, Debug, PartialEq)]
pub struct PlainModule {
    /// Name as in the model.
    pub name: String,
    /// Values of the parameters.
    pub parameters: Vec<f64>,
}

/// An allowed error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Within {
    /// The error allowed; a multiple of the tolerance of the run if `in_tolerances`.
    pub amount: f64,
    /// Whether `amount` is in units of the tolerance of the run.
    pub in_tolerances: bool,
    /// Whether errors are relative to |value| rather than max(1, |value|).
    pub relative: bool,
}

impl Within {
    const DEFAULT: Within = Within { amount: 100.0, in_tolerances: true, relative: false };

    /// The error allowed in a run with this tolerance.
    pub fn allowed(&self, tolerance: f64) -> f64 {
        self.amount * if self.in_tolerances { tolerance } else { 1.0 }
    }

    /// The error of a number.
    pub fn error(&self, found: f64, expected: f64) -> f64 {
        let scale = if self.relative { expected.abs() } else { expected.abs().max(1.0) };
        let difference = (found - expected).abs();
        if difference == 0.0 { 0.0 } else { difference / scale }
    }
}

impl Case {
    /// Reads the `#=` lines of a model. `file` stands for it in messages.
    ///
    /// # Errors
    /// If a line cannot be read, or one that is needed is missing.
    pub fn parse(file: &str, text: &str) -> Result<Case, Error> {
        let fail = |line: usize, message: String| Error::Case { file: file.to_owned(), line, message };
        let mut case = Case {
            file: file.to_owned(),
            text: text.to_owned(),
            id: String::new(),
            group: String::new(),
            why: String::new(),
            source: String::new(),
            expectations: Vec::new(),
            fails_by: None,
            tolerances: Vec::new(),
            methods: Vec::new(),
            settings: Vec::new(),
        };
        let mut header = true;
        for (index, line) in text.lines().enumerate() {
            let Some(rest) = line.trim_start_matches('\u{feff}').strip_prefix("#=") else {
                header = false;
                continue;
            };
            if !header {
                let message = "`#=` lines come first in the file, with nothing between them";
                return Err(fail(index + 1, message.to_owned()));
            }
            case.line(index + 1, rest.trim()).map_err(|message| fail(index + 1, message))?;
        }
        if case.id.is_empty() {
            return Err(fail(0, "no `#= case: ID`".to_owned()));
        }
        if case.expectations.is_empty() {
            return Err(fail(
                0,
                "nothing is expected: no `#= at T: …`, `count`, `sum`, `events` …".to_owned(),
            ));
        }
        if case.tolerances.is_empty() {
            case.tolerances = vec![1e-6, 1e-10];
        }
        if case.methods.is_empty() {
            case.methods = vec![Method::Auto, Method::Dopri5];
        }
        Ok(case)
    }

    fn line(&mut self, number: usize, line: &str) -> Result<(), String> {
        let (word, rest) = line.split_at(line.find([' ', ':']).unwrap_or(line.len()));
        let rest = rest.trim_start();
        match word {
            "at" | "count" | "sum" | "events" | "instants" => {
                let (what, answer) = rest.split_once(':').ok_or("expected `:` and what comes out")?;
                self.expectations.push((number, expectation(word, what.trim(), answer.trim())?));
            }
            "fails" => match fails(rest)? {
                Fails::At(expectation) => self.expectations.push((number, expectation)),
                Fails::By(t) => self.fails_by = Some(t),
            },
            "set" => {
                let (name, value) = rest.split_once('=').ok_or("expected `set NAME = VALUE`")?;
                self.settings.push(Setting { name: name.trim().to_owned(), value: number_of(value.trim())? });
            }
            "case" | "group" | "why" | "source" | "tolerances" | "methods" => {
                let text = rest.strip_prefix(':').ok_or_else(|| format!("expected `{word}: …`"))?;
                self.property(word, text.trim())?;
            }
            _ => return Err(format!("`{word}` means nothing here")),
        }
        Ok(())
    }

    fn property(&mut self, word: &str, text: &str) -> Result<(), String> {
        let to = match word {
            "case" if !self.id.is_empty() || text.is_empty() => {
                return Err("expected one `case: ID`".to_owned());
            }
            "case" => &mut self.id,
            "group" => &mut self.group,
            "why" => &mut self.why,
            "source" => &mut self.source,
            "tolerances" => {
                for word in text.split_whitespace() {
                    let tolerance = number_of(word)?;
                    if !(1e-13..=0.1).contains(&tolerance) {
                        return Err(format!("the tolerance {word} is not between 1e-13 and 0.1"));
                    }
                    self.tolerances.push(tolerance);
                }
                return Ok(());
            }
            _ => {
                for word in text.split_whitespace() {
                    let found = Method::NAMED.iter().find(|(name, _)| *name == word);
                    let (_, method) = found.ok_or_else(|| format!("there is no method `{word}`"))?;
                    if method.is_fixed_step() {
                        return Err(format!("`{word}` has a fixed step, and no tolerance"));
                    }
                    self.methods.push(*method);
                }
                return Ok(());
            }
        };
        if !to.is_empty() {
            to.push(' ');
        }
        to.push_str(text);
        Ok(())
    }
}

/// `at T: …`, `count NAME by T: …` and so on, without the first word.
fn expectation(word: &str, what: &str, answer: &str) -> Result<Expectation, String> {
    if word == "at" {
        let t = time_of(what)?;
        let (answer, within) = within_of(answer)?;
        return Ok(Expectation::At { t, string: string_of(answer)?, within });
    }
    let words: Vec<&str> = what.split_whitespace().collect();
    let whole = || answer.parse::<u64>().map_err(|_| format!("`{answer}` is not a whole number"));
    match (word, &words[..]) {
        ("count", [name, "by", t]) => {
            let name = (*name != "*").then(|| (*name).to_owned());
            Ok(Expectation::Count { name, t: time_of(t)?, count: whole()? })
        }
        ("sum", [name, parameter, "by", t]) => {
            let parameter = parameter.parse::<usize>().ok().and_then(|p| p.checked_sub(1));
            let parameter = parameter.ok_or("parameters are numbered from 1")?;
            let (answer, within) = within_of(answer)?;
            let (name, t, sum) = ((*name).to_owned(), time_of(t)?, number_of(answer)?);
            Ok(Expectation::Sum { name, parameter, t, sum, within })
        }
        ("events", ["by", t]) => Ok(Expectation::Events { t: time_of(t)?, count: whole()? }),
        ("instants", ["by", t]) => Ok(Expectation::Instants { t: time_of(t)?, count: whole()? }),
        ("count", _) => Err("expected `count NAME by T: N` or `count * by T: N`".to_owned()),
        ("sum", _) => Err("expected `sum NAME PARAMETER by T: VALUE`".to_owned()),
        _ => Err(format!("expected `{word} by T: N`")),
    }
}

enum Fails {
    At(Expectation),
    By(f64),
}

/// `KIND|KIND at T within W` or `KIND by T`.
fn fails(rest: &str) -> Result<Fails, String> {
    let (rest, within) = within_of(rest)?;
    let [kinds, word, t] = rest.split_whitespace().collect::<Vec<_>>()[..] else {
        return Err("expected `fails KIND at T` or `fails KIND by T`".to_owned());
    };
    let fault = |name: &str| {
        let known = FAULTS.iter().find(|known| **known == name).copied();
        known.ok_or_else(|| format!("`{name}` is no error of a run; they are {}", FAULTS.join(", ")))
    };
    let faults = kinds.split('|').map(fault).collect::<Result<Vec<_>, _>>()?;
    match word {
        "at" => Ok(Fails::At(Expectation::Fails { faults, t: time_of(t)?, within })),
        "by" => Ok(Fails::By(time_of(t)?)),
        _ => Err(format!("expected `at` or `by`, not `{word}`")),
    }
}

/// Takes `relative`, wherever it stands, and `within …` from the answer.
fn within_of(text: &str) -> Result<(&str, Within), String> {
    let mut within = Within::DEFAULT;
    let mut text = text.trim();
    if let Some(rest) = text.strip_prefix("relative ") {
        (text, within.relative) = (rest.trim_start(), true);
    }
    let strip = |text: &mut &str, within: &mut Within| {
        if let Some(rest) = text.strip_suffix(" relative") {
            (*text, within.relative) = (rest.trim_end(), true);
        }
    };
    strip(&mut text, &mut within);
    if let Some((rest, amount)) = text.rsplit_once(" within ") {
        let plain = amount.trim().strip_suffix(" tol");
        within.in_tolerances = plain.is_some();
        within.amount = number_of(plain.unwrap_or(amount).trim())?;
        if within.amount < 0.0 {
            return Err("`within` needs a number that is not negative".to_owned());
        }
        text = rest.trim_end();
        strip(&mut text, &mut within);
    }
    Ok((text, within))
}

/// A string as `dlsys run` prints it; `ε` is the empty one.
fn string_of(text: &str) -> Result<Vec<PlainModule>, String> {
    let mut pieces = Vec::new();
    let mut rest = text.trim_start();
    if rest.is_empty() {
        return Err("expected a string of modules; `ε` is the empty one".to_owned());
    }
    if rest == "ε" {
        return Ok(pieces);
    }
    while let Some(first) = rest.chars().next() {
        let word = |c: char| c.is_alphanumeric() || c == '_';
        let length = match first {
            '@' => 1 + rest[1..].find(|c| !word(c)).unwrap_or(rest.len() - 1),
            c if c.is_alphabetic() => rest.find(|c| !word(c)).unwrap_or(rest.len()),
            c if c.is_numeric() || "(),".contains(c) => {
                return Err(format!("expected the name of a module before `{}`", excerpt(rest)));
            }
            c => c.len_utf8(),
        };
        let (name, after) = rest.split_at(length);
        let (parameters, after) = match after.strip_prefix('(') {
            Some(inside) => {
                let (list, after) =
                    inside.split_once(')').ok_or_else(|| format!("`)` is missing after `{name}(`"))?;
                (list.split(',').map(|x| number_of(x.trim())).collect::<Result<_, _>>()?, after)
            }
            None => (Vec::new(), after),
        };
        pieces.push(PlainModule { name: name.to_owned(), parameters });
        rest = after.trim_start();
    }
    Ok(pieces)
}

fn excerpt(text: &str) -> String {
    text.chars().take(20).collect()
}

fn number_of(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x.is_finite() => Ok(x),
        _ => Err(format!("`{text}` is not a number")),
    }
}

fn time_of(text: &str) -> Result<f64, String> {
    match number_of(text.trim())? {
        t if t >= 0.0 => Ok(t),
        _ => Err(format!("the time {text} is before 0")),
    }
}

#[cfg(test)]
mod tests;
