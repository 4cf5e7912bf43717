//! Errors of the surroundings, with their place in the model.

use dlsys_diagnostic::{Diagnostic, Span};
use dlsys_fall as fall;
use dlsys_gas as gas;
use dlsys_geometry::turtle;
use dlsys_ground as ground;
use dlsys_model::Model;
use dlsys_sheet as sheet;
use dlsys_sim::memory::Shortage;
use dlsys_sim::{self as sim, brief};
use dlsys_sway as sway;
use dlsys_tree::Lineage;
use dlsys_wind as wind;

use crate::advice;
use crate::paths::Meets;

/// The stem with which the mechanics fail.
#[derive(Clone, Debug)]
pub struct FailedStem {
    /// Name of the kind of the module that draws it.
    pub kind: String,
    /// The module itself.
    pub lineage: Lineage,
    /// The place in the text that says how it is drawn.
    pub drawn: Option<Span>,
    /// Its length in m.
    pub length: f64,
    /// Its diameter in m.
    pub width: f64,
    /// Young's modulus of its tissue in Pa.
    pub stiffness: f64,
    /// The declaration of its tissue.
    pub tissue: Span,
    /// The speed of the wind where it stands at rest, in m/s.
    pub wind: f64,
}

/// The part that is let go whose flight fails.
#[derive(Clone, Debug)]
pub struct FallingPart {
    /// Name of the kind of the module that holds its `@D`.
    pub kind: String,
    /// The module itself.
    pub lineage: Lineage,
    /// The place in the text that says how it is drawn.
    pub drawn: Option<Span>,
    /// Its mass in kg, if it is known.
    pub mass: Option<f64>,
    /// Its largest extent in m, if it is known.
    pub size: Option<f64>,
}

/// Why a solid, and the sheets and the soil that push it, cannot be followed.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum CouplingFault {
    /// What its equations do with the force is not what the force does to a mass, in the shortest part of a tick.
    Apart {
        /// How far the ways are apart, in m.
        by: f64,
        /// The largest distance that is allowed, in m.
        allowed: f64,
        /// The length of the part, in s.
        step: f64,
    },
    /// The acceleration by a force is not that of a mass: it points against the force, or depends on forces along other axes in one direction only.
    NoMass,
}

/// Why the surroundings cannot be computed.
#[derive(Clone, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The growth fails.
    #[error("{}", .0.diagnostic().message)]
    Growth(Box<sim::Error>),
    /// A string cannot be drawn.
    #[error(transparent)]
    Turtle(#[from] Box<turtle::Error>),
    /// The declared wind has no meaning.
    #[error("{error}")]
    Wind {
        /// The reason.
        error: wind::Error,
        /// The declaration.
        span: Span,
    },
    /// Stems cannot be advanced in time.
    #[error("{}", advice::bending(.error, .stem.as_deref(), *.time))]
    Bending {
        /// The reason.
        error: sway::Error,
        /// The stem in question, if it is one.
        stem: Option<Box<FailedStem>>,
        /// The time in units of the model.
        time: f64,
        /// The tolerance of the steps.
        tolerance: f64,
    },
    /// A part that is let go cannot be followed.
    #[error("{}", advice::falling(.error, .part, *.time))]
    Falling {
        /// The reason.
        error: fall::Error,
        /// The part.
        part: Box<FallingPart>,
        /// The time in units of the model.
        time: f64,
    },
    /// A tissue whose stiffness is out of range.
    #[error("the stiffness of the tissue `{tissue}` is {value} Pa at t = {time}")]
    Stiffness {
        /// Its name.
        tissue: String,
        /// The value in Pa.
        value: f64,
        /// The time in units of the model.
        time: f64,
        /// The declaration.
        span: Span,
    },
    /// A body that bends or falls, so that its place depends on the wind that it would push.
    #[error("the body of `{kind}` (module {lineage}) cannot {}: it {}", .meets.words(), if *.falls { "falls" } else { "bends in it" })]
    PassiveSolid {
        /// Name of the kind of the module.
        kind: String,
        /// The module itself.
        lineage: Lineage,
        /// It is let go; otherwise it stands on stems that give way, or holds one.
        falls: bool,
        /// What it would meet.
        meets: Meets,
        /// The time in units of the model.
        time: f64,
        /// Its name in the declaration.
        span: Span,
    },
    /// Bodies whose growth depends on the wind that they would push.
    #[error("bodies cannot push the wind of a model whose rules read `strain`")]
    SolidInLoop {
        /// The name of the first body in its declaration.
        span: Span,
    },
    /// Too many bodies.
    #[error("more than {most} bodies {} at t = {}", .meets.words(), brief(*.time, 8))]
    TooManySolids {
        /// The largest number.
        most: usize,
        /// The time in units of the model.
        time: f64,
        /// What they meet.
        meets: Meets,
        /// The name in the declaration of the first one beyond.
        span: Span,
    },
    /// A solid that no body can have for an obstacle.
    #[error("a body cannot be in the way of what falls at t = {}: {error}", brief(*.time, 8))]
    Obstacle {
        /// The reason.
        error: fall::Error,
        /// The time in units of the model.
        time: f64,
        /// The first name in the declaration.
        span: Span,
    },
    /// A gas cannot be followed.
    #[error("the gas `{name}` cannot be followed at t = {}: {error}", brief(*.time, 8))]
    Gas {
        /// Its name.
        name: String,
        /// The reason.
        error: gas::Error,
        /// The time in units of the model.
        time: f64,
        /// The strongest source, or the declaration.
        span: Span,
    },
    /// The ground cannot be followed.
    #[error("{}", advice::pressing(.error, *.time, *.metre))]
    Ground {
        /// The reason, in m.
        error: ground::Error,
        /// The time in units of the model.
        time: f64,
        /// A unit of length of the model in m.
        metre: f64,
        /// The body, what is poured, or the ground.
        span: Span,
    },
    /// What is poured has no rate or no place.
    #[error("what is poured has the rate {rate} at t = {time}")]
    Pour {
        /// The rate in units of the model.
        rate: f64,
        /// The time in units of the model.
        time: f64,
        /// The declaration.
        span: Span,
    },
    /// A sheet cannot be made, or cannot be followed.
    #[error("the sheet `{name}` cannot be followed at t = {}: {error}", brief(*.time, 8))]
    Sheet {
        /// Its name.
        name: String,
        /// The reason.
        error: sheet::Error,
        /// The time in units of the model.
        time: f64,
        /// The place in the text that places it, or the declaration.
        span: Span,
    },
    /// Equations of motion that do not go with what the force of a sheet does to a solid.
    #[error("`{kind}` (module {lineage}) and what pushes it cannot be followed both ways at t = {}: {}", brief(*.time, 8), advice::coupling(.fault))]
    Coupling {
        /// Name of the kind of the module.
        kind: String,
        /// The module itself.
        lineage: Lineage,
        /// The time in units of the model.
        time: f64,
        /// The reason.
        fault: CouplingFault,
        /// The place in the text that says how it is drawn, or its name in the declaration of solids.
        span: Span,
    },
    /// Growth that reads the height of the ground, and the ground that it presses, do not agree on a tick.
    #[error("growth and the ground that it reads and presses do not agree at t = {}", brief(*.time, 8))]
    GroundApart {
        /// How far heights are apart, in units of the model.
        by: f64,
        /// The largest distance that is allowed, in units of the model.
        allowed: f64,
        /// The time in units of the model.
        time: f64,
        /// The declaration of the ground.
        span: Span,
    },
    /// Too many points of sheets.
    #[error("sheets have more than {most} points at t = {}", brief(*.time, 8))]
    TooManySheets {
        /// The largest number.
        most: usize,
        /// The time in units of the model.
        time: f64,
        /// The place in the text of the first one beyond.
        span: Span,
    },
    /// Too many parts are let go.
    #[error("more than {most} parts are let go up to t = {time}")]
    TooManyParts {
        /// The largest number.
        most: usize,
        /// The time in units of the model.
        time: f64,
        /// The place in the text that draws the last one.
        span: Option<Span>,
    },
    /// More seconds than [`Settings::max_seconds`](sim::Settings::max_seconds).
    #[error("the surroundings take more than {limit} s up to t = {time}")]
    OutOfTime {
        /// The limit in s.
        limit: f64,
        /// The time in units of the model.
        time: f64,
        /// The declaration of the first tissue, the first `@D`, the first body, or the first `@S`.
        span: Span,
    },
    /// The system, or [`Settings::max_memory`](sim::Settings::max_memory), refuses memory.
    #[error("no memory for the surroundings at t = {}", brief(*.time, 8))]
    OutOfMemory {
        /// The bytes wanted and available.
        shortage: Shortage,
        /// The time in units of the model.
        time: f64,
        /// As of `OutOfTime`.
        span: Span,
    },
    /// Too many steps up to the time that is asked for.
    #[error("the surroundings take more than {most:e} steps up to t = {time}")]
    TooLong {
        /// The largest number of steps.
        most: f64,
        /// The time in units of the model.
        time: f64,
        /// Seconds in a unit of time.
        seconds: f64,
        /// The declaration of the first tissue, the first `@D`, or the first body.
        span: Span,
    },
}

impl Error {
    /// A flight that fails, at a time in units of the model.
    pub(crate) fn falling(
        model: &Model,
        origin: &turtle::Origin,
        body: Option<&fall::Body>,
        (error, time): (fall::Error, f64),
    ) -> Error {
        let part = Box::new(FallingPart {
            kind: model.kinds.get(origin.kind).name.clone(),
            lineage: origin.lineage,
            drawn: origin.span(model),
            mass: body.map(|body| body.mass),
            size: body.map(|body| 2.0 * body.size()),
        });
        Error::Falling { error, part, time }
    }

    /// The error as a message that quotes the model, with advice.
    pub fn diagnostic(&self) -> Diagnostic {
        match self {
            Error::Growth(error) => error.diagnostic(),
            Error::Turtle(error) => error.diagnostic(),
            Error::Wind { error, span } => Diagnostic::error(format!("this wind cannot blow: {error}"))
                .at(*span, "declared here")
                .help("look at the values of its expressions over time: they may read `t`"),
            Error::Bending { error, stem, tolerance, .. } => {
                let mut diagnostic = Diagnostic::error(self.to_string());
                if let Some(stem) = stem {
                    diagnostic = stem.describe(diagnostic);
                }
                match error {
                    sway::Error::Step { .. } | sway::Error::Steps { .. } => diagnostic
                        .help("a stem is easier to follow if it is wider, if its tissue is stiffer or more damped, and in less wind")
                        .help(format!(
                            "`--bend-tolerance {}` allows larger errors than the present {}",
                            brief((tolerance * 10.0).min(0.1), 3),
                            brief(*tolerance, 3)
                        )),
                    _ => diagnostic
                        .help("look for a width or a length that is far too small or large for the `units`"),
                }
            }
            Error::Falling { error, part, .. } => {
                let mut diagnostic = Diagnostic::error(self.to_string());
                if let Some(span) = part.drawn {
                    diagnostic = diagnostic.at(span, "let go here");
                }
                if let (Some(mass), Some(size)) = (part.mass, part.size) {
                    let (mass, size) = (brief(mass * 1e3, 3), brief(size * 1e3, 3));
                    diagnostic = diagnostic.note(format!("it has {mass} g and is {size} mm large"));
                }
                match error {
                    fall::Error::Value { .. } => diagnostic
                        .help("look for a size, a width or a density that is far too small or large for the `units`"),
                    _ => diagnostic
                        .help("look at its size and mass in `units`, and at the speed of the wind")
                        .help("`--bend-tolerance 0.01` allows larger errors than the default 0.001"),
                }
            }
            Error::Stiffness { tissue, value, time, span } => Diagnostic::error(format!(
                "the stiffness of the tissue `{tissue}` is {} Pa at t = {}",
                brief(*value, 6),
                brief(*time, 8)
            ))
            .at(*span, "it follows t")
            .help("Young's modulus is greater than 0 and at most 1e15 Pa at all times that are computed"),
            Error::PassiveSolid { falls, meets, time, span, .. } => Diagnostic::error(self.to_string())
                .at(*span, format!("declared here, and drawn at t = {}", brief(*time, 8)))
                .note(match meets {
                    Meets::Sheets => "sheets meet bodies that the equations of the model move",
                    Meets::Wind => "the wind is pushed by bodies that the equations of the model move",
                    Meets::Falling => "what falls meets bodies that the equations of the model move",
                })
                .help(match falls {
                    true => "give what is let go a module of its own that is not `solid`",
                    false => "draw the body outside the branch of `@E`, or take its name out of `solid`",
                }),
            Error::SolidInLoop { span } => Diagnostic::error(self.to_string())
                .at(*span, "declared here")
                .note("its growth would follow the wind, and the wind its bodies, at one and the same time")
                .help("leave out `solid`, or let the rules do without `strain`"),
            Error::TooManySolids { span, .. } => Diagnostic::error(self.to_string())
                .at(*span, "of this name is the first one beyond")
                .help("draw several bodies in one module, or name fewer modules"),
            Error::Obstacle { span, .. } => Diagnostic::error(self.to_string())
                .at(*span, "declared here")
                .help("look at the places, the sizes and the speed of what these modules draw"),
            Error::Sheet { error, span, .. } => {
                let diagnostic = Diagnostic::error(self.to_string()).at(*span, "it is placed here");
                advice::on_sheet(error, diagnostic)
            }
            Error::TooManySheets { span, .. } => Diagnostic::error(self.to_string())
                .at(*span, "this one is too many")
                .help("place fewer sheets, or give them coarser meshes: 1,000 points make a smooth flag"),
            Error::GroundApart { by, allowed, span, .. } => Diagnostic::error(self.to_string())
                .at(*span, "this ground")
                .note(format!(
                    "within a tick of 1/120 s heights differ by {} from what rules read, and may by {}",
                    brief(*by, 3),
                    brief(*allowed, 3)
                ))
                .help("a body whose place follows the ground below it at once sinks without end: let it move by a velocity, or read the ground beside it; a larger `--bend-tolerance` allows more"),
            Error::Coupling { fault, span, .. } => {
                advice::of_coupling(*fault, Diagnostic::error(self.to_string()).at(*span, "what is drawn here"))
            }
            Error::Gas { name, error: gas::Error::Blobs { most, .. }, time, span } => Diagnostic::error(format!(
                "the gas `{name}` has more than {most} blobs at t = {}",
                brief(*time, 8)
            ))
            .at(*span, "they begin here")
            .note("a source makes `rate` blobs in a unit of t, and each lasts until a thousandth of its mass is left: 6.9/decay seconds")
            .help("let fewer of a greater `mass` begin: a cloud looks the same, and `size` keeps it smooth")
            .help("`decay` ends them sooner"),
            Error::Gas { error, span, .. } => Diagnostic::error(self.to_string())
                .at(*span, match error {
                    gas::Error::Wind { .. } => "it begins here",
                    _ => "declared here",
                })
                .help("look at its values in `units`, and at the speed of the wind"),
            Error::Ground { error, span, .. } => {
                let (label, help) = advice::on_ground(error);
                Diagnostic::error(self.to_string()).at(*span, label).help(help)
            }
            Error::Pour { rate, time, span } => Diagnostic::error(format!(
                "what is poured has the rate {} at t = {}",
                brief(*rate, 6),
                brief(*time, 8)
            ))
            .at(*span, "it follows t, and so may its place")
            .help("a rate is a finite number and 0 or greater at all times, and its place has finite coordinates: `if t < 3 then 0.5 else 0`"),
            Error::TooManyParts { most, span, .. } => {
                let diagnostic = Diagnostic::error(self.to_string());
                let diagnostic = match span {
                    Some(span) => diagnostic.at(*span, "the last one"),
                    None => diagnostic,
                };
                diagnostic.help(format!("let go of fewer than {most}: larger parts, or of some only"))
            }
            Error::OutOfTime { limit, time, span } => Diagnostic::error(format!(
                "after {limit} s of computing, the surroundings are at t = {} only",
                brief(*time, 8)
            ))
            .at(*span, "this moves")
            .help("`--max-seconds` is the limit; `--bend-tolerance 0.01` makes fewer steps"),
            Error::OutOfMemory { shortage, span, .. } => Diagnostic::error(self.to_string())
                .at(*span, "this moves")
                .note(shortage.note())
                .help_opt(shortage.help())
                .help("each plant that moves takes memory for every stem: let fewer plants, or fewer of their stems, have a tissue"),
            Error::TooLong { most, time, seconds, span } => Diagnostic::error(format!(
                "the surroundings take more than {most:.0e} steps up to t = {}",
                brief(*time, 8)
            ))
            .at(
                *span,
                format!(
                    "this is followed in steps of a thirtieth of a second or less, and a unit of t is {seconds} s"
                ),
            )
            .help("`units time S` is the pace of the film: seconds of motion in a unit of t, such as 1"),
        }
    }
}

impl From<sim::Error> for Error {
    fn from(error: sim::Error) -> Error {
        Error::Growth(Box::new(error))
    }
}

impl From<turtle::Error> for Error {
    fn from(error: turtle::Error) -> Error {
        Error::Turtle(Box::new(error))
    }
}
