//! Failures of stems, flights, ground and sheets in words, and what helps.

use dlsys_diagnostic::Diagnostic;
use dlsys_fall as fall;
use dlsys_ground as ground;
use dlsys_sheet as sheet;
use dlsys_sim::brief;
use dlsys_sway as sway;

use crate::error::{CouplingFault, FailedStem, FallingPart};

impl FailedStem {
    /// Adds the places in the text, and the measures.
    pub(crate) fn describe(&self, diagnostic: Diagnostic) -> Diagnostic {
        let drawn = match self.drawn {
            Some(span) => diagnostic.at(span, "drawn by this"),
            None => diagnostic,
        };
        let measure = |metres: f64| match metres {
            0.01.. => format!("{} cm", brief(metres * 100.0, 3)),
            _ => format!("{} mm", brief(metres * 1000.0, 3)),
        };
        let (length, width, wind) = (measure(self.length), measure(self.width), brief(self.wind, 3));
        let is = format!("the stem is {length} long and {width} wide; the wind there blows at {wind} m/s");
        drawn.at(self.tissue, format!("made of this tissue, of {:e} Pa", self.stiffness)).note(is)
    }
}

/// The failure of the mechanics as a message.
pub(crate) fn bending(error: &sway::Error, stem: Option<&FailedStem>, time: f64) -> String {
    let why = match error {
        sway::Error::Step { step, excess, .. } if excess.is_finite() => {
            let (excess, step) = (brief(*excess, 2), brief(*step, 2));
            format!("its error is {excess} times the tolerance even in steps of {step} s")
        }
        sway::Error::Step { step, .. } => {
            format!("its motion is not finite even in steps of {} s", brief(*step, 2))
        }
        sway::Error::Steps { step, most, .. } => {
            format!(
                "it moves so fast that steps of {} s are needed, and more than {most} in a thirtieth of a second",
                brief(*step, 2)
            )
        }
        sway::Error::Value { what, .. } => (*what).to_owned(),
        error => error.to_string(),
    };
    let stem = stem.map_or("stems".to_owned(), |FailedStem { kind, lineage, .. }| {
        format!("the stem of `{kind}` (module {lineage})")
    });
    format!("{stem} cannot be followed at t = {}: {why}", brief(time, 8))
}

/// The failure of a ground as a message, with lengths in units of the model, each of so many metres.
pub(crate) fn pressing(error: &ground::Error, time: f64, metre: f64) -> String {
    let time = brief(time, 8);
    let at = |[x, z]: [f64; 2]| format!("({}, {})", brief(x / metre, 4), brief(z / metre, 4));
    match error {
        ground::Error::Open { name, at: place } => {
            let place = at(*place);
            format!(
                "the surface of `{name}` is not closed at t = {time}: above and below (x, z) = {place}, it is entered and left unequally often"
            )
        }
        ground::Error::Outside { name, at: place } if name == "a pour" => {
            format!("what is poured at (x, z) = {} falls beside the ground at t = {time}", at(*place))
        }
        ground::Error::Outside { name, at: place } => {
            format!("`{name}` reaches (x, z) = {} at t = {time}, where there is no ground", at(*place))
        }
        ground::Error::Body { name, fault } => format!("`{name}` {fault} at t = {time}"),
        ground::Error::Fast { name, way, most, .. } => format!(
            "`{name}` moves {} in a {}th of a second at t = {time}: the most is {} here",
            brief(way / metre, 4),
            crate::GROUND_TICKS,
            brief(most / metre, 4)
        ),
        ground::Error::Height { name, value, most, .. } => format!(
            "{name} is {} high at t = {time}: the most is {} here",
            brief(value / metre, 4),
            brief(most / metre, 4)
        ),
        ground::Error::Memory { most, at: place } => format!(
            "the ground that has been touched needs more than {most} MB at t = {time}, around (x, z) = {}",
            at(*place)
        ),
        error => format!("this ground cannot be followed: {error}"),
    }
}

/// What stands at the place of a failure of a ground, and what helps.
pub(crate) fn on_ground(error: &ground::Error) -> (&'static str, &'static str) {
    match error {
        ground::Error::Open { .. } => (
            "declared here",
            "a body is a closed mesh, or several; a leaf or a plate, which only carries what falls on it, is a `shelf`",
        ),
        ground::Error::Outside { .. } => {
            ("declared here", "the ground goes from -E to E in x and z: `extent E` makes it larger")
        }
        ground::Error::Body { .. } => {
            ("declared here", "look at its size in `units`, and at the width of a `cell`")
        }
        ground::Error::Fast { .. } => (
            "declared here",
            "`units time S` is the pace of the film: S seconds in a unit of t; a larger `cell` allows longer ways",
        ),
        ground::Error::Height { .. } => (
            "declared here",
            "heights are within 65,536 cells: look at the `rate`, at the `height`, and at the `cell`",
        ),
        ground::Error::Memory { .. } => (
            "declared here",
            "a larger `cell` needs less memory, and so does a smaller place that is touched or poured on",
        ),
        ground::Error::Particles { .. } => (
            "declared here",
            "`grain D` in its soil is the diameter of the particles in m; less that sticks (`stick`), or is shed faster (`shed`), are fewer at a time",
        ),
        ground::Error::Value { name, .. } if name.contains("sweeps") => {
            ("declared here", "a larger `cell` needs fewer of them, and so does a smaller `flow` of the soil")
        }
        _ => ("declared here", "look at the values of its soil, and at its `cell` and `extent` in `units`"),
    }
}

/// The failure of a flight as a message.
pub(crate) fn falling(error: &fall::Error, part: &FallingPart, time: f64) -> String {
    let FallingPart { kind, lineage, .. } = part;
    format!("what `{kind}` (module {lineage}) lets go cannot be followed at t = {}: {error}", brief(time, 8))
}

/// The failure of a coupling in words.
pub(crate) fn coupling(fault: &CouplingFault) -> String {
    match fault {
        CouplingFault::Apart { by, allowed, step } => format!(
            "under the force of the sheets its equations lead it {} m away from where they push it, even in {} s; {} m is allowed",
            brief(*by, 2),
            brief(*step, 2),
            brief(*allowed, 2)
        ),
        CouplingFault::NoMass => {
            "its equations do not answer a force as a mass does, along it or along the axes whose forces they read".to_owned()
        }
    }
}

/// Remedies for it.
pub(crate) fn of_coupling(fault: CouplingFault, diagnostic: Diagnostic) -> Diagnostic {
    let newton = "let a force be a part of an acceleration, as in `solve dy/dt = v, dv/dt = -9.81 + force_y/0.68`: a velocity is the rate of a place, and a force over a mass that of a velocity";
    match fault {
        CouplingFault::Apart { .. } => {
            diagnostic.help(newton).help("`--bend-tolerance 0.01` allows larger errors than the default 0.001")
        }
        CouplingFault::NoMass => diagnostic
            .help(newton)
            .help("what a force moves along another axis, too, reads the force along that: both `force_x` and `force_y`"),
    }
}

/// Remedies for a sheet that cannot be followed.
pub(crate) fn on_sheet(error: &sheet::Error, diagnostic: Diagnostic) -> Diagnostic {
    let cause = match error {
        sheet::Error::Step { cause, .. } | sheet::Error::Steps { cause, .. } => cause,
        sheet::Error::Value { .. } => {
            return diagnostic.help("look at the values of its tissue, and at its size in `units`");
        }
        _ => &sheet::Rejection::None,
    };
    match cause {
        sheet::Rejection::Deep { .. } => diagnostic
            .help("a solid squeezes it against another one or against the ground, or drives it farther than it stretches: give it way"),
        sheet::Rejection::Fast { .. } => {
            diagnostic.help("a solid is too fast or too thin: nothing may pass through a sheet within a step")
        }
        _ => diagnostic
            .help("look at the `units`, at the thickness and stiffness of its tissue, and at the speed of the wind")
            .help("`--bend-tolerance 0.01` allows larger errors than the default 0.001"),
    }
}
