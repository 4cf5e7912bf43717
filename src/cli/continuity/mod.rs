//! `dlsys check --continuity`: productions at which the drawing jumps.
//!
//! "Correctly specified productions satisfy continuity criteria, which means that they conserve physical entities
//! such as shape, mass, and velocity of modules" (paper, section 4.1; Prusinkiewicz and Lindenmayer 1990, chapter 6).
//! A model is run, and for every production the drawings just before and just after are compared.
//!
//! ```text
//! Simulation ──Transition──▶ measure (turtle before, turtle after, speeds) ──Jump──▶ report (worst of each production)
//! ```

mod measure;
mod report;

use std::io::Write;

use super::args::{CheckArgs, Order};
use super::common::{Failure, coloured, out_error};
use crate::session::Session;
use crate::sim::{Settings, Simulation};
use crate::tree::ModuleString;
use measure::DrawingProbe;
use report::{Report, Verdict};

/// Number of parts of the time range; the log of events is emptied after each.
const PIECES: usize = 256;
/// More modules than this are an error, because each new module leaves a record until the end of a part.
const MAX_MODULES: usize = 1_000_000;

/// Runs a model and reports on the continuity of its productions.
pub fn check(args: &CheckArgs, session: &Session) -> Result<(), Failure> {
    let model = &session.model;
    let end = args.to.or(model.frames.map(|frames| frames.to)).ok_or_else(|| {
        Failure::Usage("error: the model has no `frames`: say how far to run it with `--to T`\n".to_owned())
    })?;
    // Events and values must be more accurate than the threshold for jumps.
    let tolerance = (args.tolerance / 100.0).clamp(1e-12, 1e-4);
    let settings = {
        let given = args.budget.settings();
        let max_modules = given.max_modules.min(MAX_MODULES);
        Settings { tolerance, max_modules, log: true, transitions: true, ..given }
    };
    let mut simulation = session.simulate(settings).map_err(|error| fault(session, &error))?;
    let mut report = Report::new(session, end, args.tolerance);
    let result = observe(&mut simulation, session, end, &mut report);
    // The findings before an error are reported before the error.
    let (text, worst) = report.show();
    std::io::stdout().write_all(text.as_bytes()).map_err(out_error)?;
    result?;
    match args.deny {
        Some(Order::C0) if worst == Verdict::Discontinuous => denied("C0"),
        Some(Order::C1) if worst != Verdict::C1 => denied("C1"),
        _ => Ok(()),
    }
}

fn fault(session: &Session, error: &crate::sim::Error) -> Failure {
    Failure::Model(error.diagnostic().render(&session.source, coloured()))
}

fn denied(order: &str) -> Result<(), Failure> {
    Err(Failure::Model(format!("error: not every production is {order}, which `--deny` asks for\n")))
}

fn observe(
    simulation: &mut Simulation,
    session: &Session,
    end: f64,
    report: &mut Report,
) -> Result<(), Failure> {
    let mut probe = DrawingProbe::new(&session.model);
    let mut string = ModuleString::default();
    for piece in 0..=PIECES {
        let done = simulation.at(end * piece as f64 / PIECES as f64, &mut string);
        for event in simulation.take_events() {
            let jump = event.transition.as_ref().map(|transition| probe.jump(event.time, transition));
            let jump = jump
                .transpose()
                .map_err(|error| Failure::Model(format!("error: at t = {}: {error}\n", event.time)))?;
            report.add(&event, jump);
        }
        done.map_err(|error| fault(session, &error))?;
    }
    Ok(())
}
