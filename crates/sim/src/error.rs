//! Errors of a run, and the messages that explain them.

use crate::memory::Shortage;
use crate::surroundings::Failure;
use dlsys_diagnostic::{Diagnostic, Span};
use dlsys_model::{Distribution, Remedy};
use dlsys_tree::Lineage;

/// The place of an error: a module, its rule and the time.
#[derive(Clone, Debug)]
pub struct Site {
    /// The module with its parameters, as in a string.
    pub module: String,
    /// The module itself, whatever its parameters are.
    pub lineage: Lineage,
    /// The head of its rule.
    pub rule: String,
    /// The place in the text to point at.
    pub span: Span,
    /// The instant, in the model's unit of time.
    pub time: f64,
}

impl Site {
    /// The time as people read it; the float is in `time`.
    fn when(&self) -> String {
        super::brief(self.time, 12)
    }
}

/// Two sides of a comparison that are nearer each other than the error of integration.
#[derive(Clone, Debug)]
pub struct Near {
    /// Where they meet, as written; empty if that is not known.
    pub boundary: String,
    /// How far they are apart.
    pub gap: f64,
    /// The estimated error of their difference.
    pub error: f64,
}

/// The reason why a parameter cannot be solved for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Unsolved {
    /// The equations are singular at the values that were found.
    Singular,
    /// Newton's method has found no values.
    Nothing,
    /// The equations have no finite values.
    NotFinite,
    /// The equations become singular along the trajectory.
    Fading,
    /// The values change faster than they can be followed.
    Rough,
    /// Two solutions meet.
    Meeting,
}

impl Unsolved {
    fn message(self) -> &'static str {
        match self {
            Unsolved::Singular => "is not determined by its equations, which are singular,",
            Unsolved::Nothing => "has no value that solves its equations",
            Unsolved::NotFinite => "has no value: its equations are undefined",
            Unsolved::Fading => "is hardly determined any more by its equations, which become singular,",
            Unsolved::Rough => "changes too fast to be followed",
            Unsolved::Meeting => "is not determined any more by its equations, two solutions of which meet,",
        }
    }
}

/// An error of a run. All name the rule, the module with its lineage, and the time.
#[derive(Clone, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// No clause of the rule holds, and no production applies.
    #[error(
        "{} {} its domain at t = {} and no production applies", .site.module,
        if *.born { "is born outside" } else { "left" }, .site.when()
    )]
    OutsideDomain {
        /// The module that has no equations.
        site: Site,
        /// It never was inside.
        born: bool,
        /// The comparisons that fail, with their places and suggested remedies.
        failing: Vec<(Span, Option<Remedy>)>,
    },
    /// Each of two clauses leads into the domain of the other, or equations change without end at one instant.
    #[error("the equations of {} push against each other at t = {}", .site.module, .site.when())]
    Chattering {
        /// The module whose equations contradict each other.
        site: Site,
    },
    /// Productions follow one another at one instant more than [`MAX_ROUNDS`](crate::MAX_ROUNDS) times.
    #[error("productions go on without end at t = {}", .site.when())]
    Cascade {
        /// The next production.
        site: Site,
        /// Rounds of productions so far.
        rounds: usize,
    },
    /// Lives become as short as the resolution of time: events accumulate (Zeno's paradox).
    #[error("events pile up before t = {}", .site.when())]
    Zeno {
        /// A module with such a life.
        site: Site,
    },
    /// The period of derivation steps is shorter than the resolution of time.
    #[error("steps that are {period} apart cannot be told apart at t = {}", .site.when())]
    PeriodTooShort {
        /// A module to which discrete rules may apply.
        site: Site,
        /// The period, in the model's unit of time.
        period: f64,
    },
    /// A value or a rate is infinite or undefined.
    #[error("{what} of {} is not finite at t = {}", .site.module, .site.when())]
    NotFinite {
        /// The module with the value.
        site: Site,
        /// The value, as a message names it.
        what: String,
    },
    /// A distribution has parameters that it cannot have.
    #[error("`{}` cannot be drawn from at t = {}: {why}", .distribution.name(), .site.when())]
    BadDraw {
        /// The module that is replaced, at the draw in its successor.
        site: Site,
        /// The distribution.
        distribution: Distribution,
        /// The reason, as a message gives it.
        why: Box<str>,
    },
    /// The weights of several successors are no weights.
    #[error("no successor can be chosen for {} at t = {}: {why}", .site.module, .site.when())]
    BadWeights {
        /// The module that is replaced.
        site: Site,
        /// The reason, as a message gives it.
        why: String,
    },
    /// The bounds of a repetition in a string are none.
    #[error("a repetition cannot be made for {} at t = {}: {why}", .site.module, .site.when())]
    BadBounds {
        /// The module that is replaced, at the bounds.
        site: Site,
        /// The reason, as a message gives it.
        why: String,
    },
    /// The rate of a random event became negative.
    #[error("the rate of an event of {} is negative at t = {}", .site.module, .site.when())]
    NegativeRate {
        /// The module, at the clause with the rate.
        site: Site,
    },
    /// Two sides came nearer each other than the error of integration and parted again: whether they met decides a production.
    #[error(
        "{} has come near {} and turned back at t = {}: whether it met it, the error of integration does not tell",
        .site.module, if .near.boundary.is_empty() { "a boundary" } else { &.near.boundary }, .site.when()
    )]
    InDoubt {
        /// The module, at the comparison.
        site: Site,
        /// The distance of the two sides.
        near: Box<Near>,
    },
    /// The surroundings cannot go on: [`Failure`](crate::Failure).
    #[error("the surroundings of {} fail at t = {}: {}", .site.module, .site.when(), .failure.why)]
    Surroundings {
        /// The module that the surroundings name, or the first one.
        site: Site,
        /// The reason.
        failure: Box<Failure>,
    },
    /// No step of the integration goes on.
    #[error("the step size fell to nothing at t = {}", .site.when())]
    StepTooSmall {
        /// The module with the component that limits the step.
        site: Site,
    },
    /// An algebraic parameter has no value.
    #[error("{} of {} {} at t = {}", .unknown.0, .site.module, .unknown.1.message(), .site.when())]
    Unsolved {
        /// The module with the parameter.
        site: Site,
        /// The parameter that is solved for, and why that fails.
        unknown: Box<(String, Unsolved)>,
    },
    /// More modules than [`Settings::max_modules`](crate::Settings::max_modules).
    #[error("more than {limit} modules at t = {}", .site.when())]
    TooManyModules {
        /// The production that is one too many.
        site: Site,
        /// The limit.
        limit: usize,
        /// Productions that had followed one another at this instant.
        rounds: usize,
    },
    /// More productions and steps than [`Settings::max_events`](crate::Settings::max_events), or far more foreseen.
    #[error("{}", too_many(*.limit, .foreseen, .site))]
    TooManyEvents {
        /// The next module.
        site: Site,
        /// The limit.
        limit: u64,
        /// The number that is foreseen up to some time at the present pace, and that time.
        foreseen: Option<Box<(f64, f64)>>,
    },
    /// More seconds than [`Settings::max_seconds`](crate::Settings::max_seconds).
    #[error("{limit} seconds are over at t = {}", .site.when())]
    OutOfTime {
        /// The next module.
        site: Site,
        /// The limit, in seconds.
        limit: f64,
    },
    /// The system, or [`Settings::max_memory`](crate::Settings::max_memory), refuses memory.
    #[error("no memory for more than {modules} modules at t = {}", .site.when())]
    OutOfMemory {
        /// The production that needs it.
        site: Site,
        /// Modules that there are.
        modules: usize,
        /// The bytes wanted and available.
        shortage: Box<Shortage>,
    },
}

fn too_many(limit: u64, foreseen: &Option<Box<(f64, f64)>>, site: &Site) -> String {
    match foreseen {
        None => format!("more than {limit} productions and steps up to t = {}", site.when()),
        Some(pace) => format!(
            "time hardly goes on at t = {}: up to t = {} it would take {:.0e} productions and steps",
            site.when(),
            super::brief(pace.1, 12),
            pace.0
        ),
    }
}

impl Error {
    /// The name of the kind of error, as the enum has it.
    pub fn name(&self) -> &'static str {
        match self {
            Error::OutsideDomain { .. } => "OutsideDomain",
            Error::Chattering { .. } => "Chattering",
            Error::Cascade { .. } => "Cascade",
            Error::Zeno { .. } => "Zeno",
            Error::NotFinite { .. } => "NotFinite",
            Error::BadDraw { .. } => "BadDraw",
            Error::BadWeights { .. } => "BadWeights",
            Error::BadBounds { .. } => "BadBounds",
            Error::NegativeRate { .. } => "NegativeRate",
            Error::Surroundings { .. } => "Surroundings",
            Error::StepTooSmall { .. } => "StepTooSmall",
            Error::InDoubt { .. } => "InDoubt",
            Error::Unsolved { .. } => "Unsolved",
            Error::PeriodTooShort { .. } => "PeriodTooShort",
            Error::TooManyModules { .. } => "TooManyModules",
            Error::TooManyEvents { .. } => "TooManyEvents",
            Error::OutOfTime { .. } => "OutOfTime",
            Error::OutOfMemory { .. } => "OutOfMemory",
        }
    }

    /// The place of the error.
    pub fn site(&self) -> &Site {
        match self {
            Error::OutsideDomain { site, .. }
            | Error::Chattering { site }
            | Error::Cascade { site, .. }
            | Error::Zeno { site }
            | Error::PeriodTooShort { site, .. }
            | Error::NotFinite { site, .. }
            | Error::BadDraw { site, .. }
            | Error::BadWeights { site, .. }
            | Error::BadBounds { site, .. }
            | Error::NegativeRate { site }
            | Error::Surroundings { site, .. }
            | Error::StepTooSmall { site }
            | Error::InDoubt { site, .. }
            | Error::Unsolved { site, .. }
            | Error::TooManyModules { site, .. }
            | Error::TooManyEvents { site, .. }
            | Error::OutOfTime { site, .. }
            | Error::OutOfMemory { site, .. } => site,
        }
    }

    /// The error of surroundings that cannot begin.
    pub fn of_beginning(failure: Failure) -> Error {
        let site = crate::world::site_of_axiom(0.0);
        let span = failure.span.unwrap_or(site.span);
        Error::Surroundings { site: Site { span, ..site }, failure: Box::new(failure) }
    }

    /// The message as it is drawn.
    pub fn diagnostic(&self) -> Diagnostic {
        let site = self.site();
        let mut d = Diagnostic::error(self.to_string());
        if site.span != Span::default() {
            d = d.at(site.span, self.remark());
        }
        if let Error::OutsideDomain { failing, born, .. } = self {
            let fails = if *born { "this does not hold" } else { "this no longer holds" };
            for (span, _) in failing {
                d = d.at(*span, fails);
            }
        }
        let descent = match site.lineage.generation {
            0 => format!("module {} of the initial string", site.lineage),
            n => format!("lineage {}, {n} productions after the initial string", site.lineage),
        };
        d = d.note(format!("{} is {descent}; its rule is {}", site.module, site.rule));
        match self {
            Error::OutsideDomain { failing, .. } => {
                let remedies = || failing.iter().filter_map(|(_, remedy)| remedy.as_ref());
                let clauses = |part: fn(&Remedy) -> &Option<String>| {
                    let quoted = remedies().filter_map(|r| part(r).as_ref()).map(|clause| format!("`{clause}`"));
                    quoted.collect::<Vec<_>>().join(" or ")
                };
                let (produce, rest) = (clauses(|r| &r.produce), clauses(|r| &r.rest));
                if produce.is_empty() && rest.is_empty() {
                    return d.help("write a clause for what happens there: `if … = … produce …`");
                }
                let made = format!("say what it becomes there, in a clause of this rule such as {produce}");
                let d = d.help_opt((!produce.is_empty()).then_some(made));
                d.help_opt((!rest.is_empty()).then(|| format!("or let it stay as it is: {rest}")))
            }
            Error::Chattering { .. } => d.help(
                "let one side hold at the boundary with an equation of its own, for example `dx/dt = 0`",
            ),
            Error::Cascade { rounds, .. } => d
                .note(format!("{rounds} productions followed one another without time going on"))
                .help("a successor that meets the condition again is replaced again at once: change the condition, or the successor's parameters"),
            Error::Zeno { .. } => {
                d.help("each life is shorter than the one before, and all of them end before this time: stop the production below some size")
            }
            Error::PeriodTooShort { .. } => {
                d.help("times have 16 digits: choose a longer `period`, or stop the discrete rules before this time")
            }
            Error::NotFinite { .. } => {
                d.help("look for a division by zero, a root or logarithm of a negative number, an element or an inverse that is not there, or growth without bound")
            }
            Error::BadDraw { distribution, .. } => {
                d.help(distribution.demand())
            }
            Error::BadWeights { .. } => d.help(
                "weights are at least 0, and one of them is greater; they need not add up to 1. To replace nothing at some values, say so in the clause's condition: `if … produce …`",
            ),
            Error::BadBounds { .. } => {
                d.help("bounds are whole numbers, at most a million apart: round them with `floor(…)` or `ceil(…)`")
            }
            Error::NegativeRate { .. } => {
                d.help("a rate is at least 0: bound it, as in `at rate max(0, …)`, or say when there is none: `if … at rate … produce …`")
            }
            Error::Surroundings { failure, .. } => match &failure.help {
                Some(help) => d.help(help.clone()),
                None => d.help("compare stiffness, widths and loads of the stems, and the units of the model"),
            },
            Error::InDoubt { near, .. } => d
                .note(format!(
                    "the two sides are {} apart there, and may be wrong by {}",
                    super::brief(near.gap, 2),
                    super::brief(near.error, 2)
                ))
                .help("if it does not get there, a smaller `--tolerance` shows it; if it is meant to, let what comes near count: `if x >= 1 - 1e-5` in place of `if x = 1`"),
            Error::StepTooSmall { .. } => d.help(
                "the solution may become infinite here, or the equations jump in a way that no `if` shows; a fixed step (`--method rk4 --step-size H`) shows how it behaves",
            ),
            Error::Unsolved { unknown, .. } => d.help(match unknown.1 {
                Unsolved::Singular | Unsolved::Fading | Unsolved::Meeting => "there the equations do not say how the parameter goes on: a double root, or two solutions that meet. Change the equations before this, or end the module's life at a condition that holds earlier",
                Unsolved::Nothing => "the search begins with the value that the module was written with, or had just before: write one closer to the solution, or see whether there is one",
                Unsolved::NotFinite => "look for a division by zero, or a root or logarithm of a negative number, at the written value too: the search begins there",
                Unsolved::Rough => "it jumps, or turns without end, in a way that no `if` shows",
            }),
            Error::TooManyModules { rounds, .. } if *rounds > 8 => d
                .note(format!("{rounds} productions followed one another without time going on"))
                .help("a successor that meets the condition again is replaced again at once: change the condition, or the successor's parameters"),
            Error::TooManyEvents { limit, foreseen: None, .. } => {
                d.help(format!("if this is meant, allow more: `--max-events {}`", limit.saturating_mul(10)))
            }
            Error::TooManyEvents { foreseen: Some(pace), .. } => d
                .help("a life, a rate or a step size is out of proportion to the times that are observed: compare their units")
                .help_opt(
                    // A time of years is no useful suggestion.
                    (pace.0 < 1e15).then(|| format!("if this is meant, allow more: `--max-events {:.0e}`", pace.0)),
                ),
            Error::OutOfTime { limit, .. } => {
                d.help(format!("if it is worth waiting for, allow more: `--max-seconds {}`", limit * 10.0))
            }
            Error::OutOfMemory { shortage, .. } => {
                d.note(shortage.note())
                    .help_opt(shortage.help())
                    .help("if this structure is not meant to be so large, bound its growth, or stop it earlier: `--max-modules N` says where it gets too large")
            }
            Error::TooManyModules { limit, .. } => {
                d.help(format!("if this is meant, allow more: `--max-modules {}`", limit.saturating_mul(10)))
            }
        }
    }

    fn remark(&self) -> &'static str {
        match self {
            Error::OutsideDomain { born: true, .. } => "no equation of this rule holds",
            Error::OutsideDomain { .. } => "no equation of this rule holds any more",
            Error::Chattering { .. } => "on each side of the boundary the equations lead to the other",
            Error::Cascade { .. } => "this production applies again and again",
            Error::Zeno { .. } => "this production comes sooner and sooner",
            Error::PeriodTooShort { .. } => "a discrete rule, which applies at the multiples of the period",
            Error::NotFinite { .. } => "computed here",
            Error::BadDraw { .. } => "drawn here",
            Error::BadWeights { .. } => "by the weights of this clause",
            Error::BadBounds { .. } => "from the first to the second",
            Error::NegativeRate { .. } => "the rate of this clause",
            Error::Surroundings { .. } => "computed for this",
            Error::StepTooSmall { .. } => "these equations",
            Error::InDoubt { .. } => "met, or only nearly?",
            Error::Unsolved { .. } => "solved for here",
            Error::TooManyModules { .. } => "this production made the last of them",
            Error::TooManyEvents { .. } | Error::OutOfTime { .. } => "the run was here",
            Error::OutOfMemory { .. } => "the run was here",
        }
    }
}
