//! `dlsys report --coupling`: which coupling of sheets and solids serves a model.

use std::collections::BTreeMap;
use std::path::Path;

use super::{print, times, write};
use crate::cli::args::ReportArgs;
use crate::cli::common::{Failure, coloured, open};
use crate::cli::progress::Progress;
use crate::compile::Setting;
use crate::session::Session;
use crate::sim::{BendSettings, Settings};
use crate::study::{self, CouplingError, CouplingPlan, Thresholds};

/// Studies the coupling of a model that has been read; `name` is the stem of the files.
pub fn coupling(
    args: &ReportArgs,
    (path, session): (Option<&Path>, &Session),
    name: &str,
) -> Result<(), Failure> {
    let bare = without(args, path)?;
    let mut thresholds = Thresholds::default();
    for (name, value) in &args.limits {
        thresholds.set(name, *value);
    }
    let budget = args.budget.settings();
    let bending = BendSettings { tolerance: args.bend_tolerance, ..budget.bending };
    let plan = CouplingPlan {
        until: times(args, session)?.last().copied().unwrap_or(0.0),
        settings: Settings { bending, ..budget },
        time_limit: args.time_limit,
        masses: args.masses.iter().cloned().collect::<BTreeMap<String, f64>>(),
        without: bare.as_ref().map(|bare| &bare.model),
        thresholds,
    };
    let title = session.model.title.clone().unwrap_or_else(|| session.source.name.clone());
    let mut progress = Progress::new(name, 100);
    let study = study::coupling_study(&session.model, &title, &plan, &mut |what, part| {
        progress.say(format!("{name}: {what}"));
        progress.reach(part);
    });
    drop(progress);
    let study = study.map_err(|error| refused(session, &error))?;
    print(&study::coupling_text(&study))?;
    print("\n")?;
    let Some(out) = &args.out else { return Ok(()) };
    write(out, &format!("{name}-coupling.csv"), &study::coupling_csv(&study))?;
    write(out, &format!("{name}-coupling.json"), &study::coupling_json(&study))
}

/// The model without its stand-in.
fn without(args: &ReportArgs, path: Option<&Path>) -> Result<Option<Session>, Failure> {
    if args.without.is_empty() {
        return Ok(None);
    }
    let Some(path) = path else {
        let message =
            "error: `--without` reads the model's file again: use it on the command line, not in a session\n";
        return Err(Failure::Usage(message.to_owned()));
    };
    let is_set = |setting: &&Setting| !args.without.iter().any(|other| other.name == setting.name);
    let settings: Vec<Setting> = args.settings.iter().filter(is_set).chain(&args.without).cloned().collect();
    open(path, &settings, &args.include).map(Some)
}

fn refused(session: &Session, error: &CouplingError) -> Failure {
    if let CouplingError::Surroundings(error) = error {
        return Failure::Model(error.diagnostic().render(&session.source, coloured()));
    }
    let help = error.help().map_or(String::new(), |help| format!("  = help: {help}\n"));
    let text = format!("error: {}: {error}\n{help}", session.source.name);
    match error {
        CouplingError::NoSuchSolid { .. } | CouplingError::MassIsKnown { .. } | CouplingError::NoStandIn => {
            Failure::Usage(text)
        }
        _ => Failure::Model(text),
    }
}
