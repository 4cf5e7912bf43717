//! `dlsys run --verify` and `dlsys report --verify`: the results are computed again in an independent way.
//!
//! The table of a run goes to standard error, so that standard output is the same with and without the flag.

use clap::Args;

use super::args::ReportArgs;
use super::common::{Failure, ModelRun, coloured, count_of, tell};
use super::progress::Progress;
use super::values::positive;
use crate::session::Session;
use crate::sim::{Method, Settings};
use crate::study::{self, complaint, unverified, verification_rows, verification_table, verify as compare};

#[derive(Debug, Args)]
pub struct VerifyArgs {
    /// Compute everything again in an independent way and compare; exit with status 1 if something differs by more than
    /// 100 tolerances
    ///
    /// The second run has another method, which integrates even parameters with formulas, a hundredth of the tolerance, and one
    /// clock for all modules. All parameters at the observed times are compared, relative to max(1, |value|), and the times and
    /// the order of all productions. The table of differences, in units of `--tolerance`, goes to standard error. If no
    /// other method reaches the last time, nothing is verified: status 1.
    #[arg(long)]
    pub verify: bool,
    /// With --verify: allowed seconds for each other method
    #[arg(long, value_name = "S", allow_negative_numbers = true, default_value = "60", value_parser = positive, requires = "verify")]
    pub time_limit: f64,
}

fn failure(session: &Session, why: study::Error) -> Failure {
    match why {
        study::Error::Run(error) => Failure::Model(error.diagnostic().render(&session.source, coloured())),
        study::Error::NoOtherMethod(refused) => Failure::Model(unverified(&refused)),
        other => Failure::Model(format!("error: {other}\n")),
    }
}

/// Verifies a completed run.
pub fn verify(args: &VerifyArgs, run: &ModelRun) -> Result<(), Failure> {
    let mut progress = Progress::new("verifying", 0);
    let session = &run.session;
    let found = compare(session, run.settings, &run.times, args.time_limit, &mut |what| progress.say(what));
    drop(progress);
    let found = found.map_err(|why| failure(session, why))?;
    tell(&verification_table(&session.model, &found));
    match complaint(&session.model, &found) {
        Some(message) => Err(Failure::Model(format!("\n{message}"))),
        None => Ok(()),
    }
}

/// Verifies each method of a report at each of its tolerances, and prints the table. False if that fails; the first
/// failure has been printed.
pub fn verify_all(
    args: &ReportArgs,
    session: &Session,
    tolerances: &[f64],
    times: &[f64],
    print: &dyn Fn(&str) -> Result<(), Failure>,
) -> Result<bool, Failure> {
    let methods = args.methods.clone().unwrap_or_else(|| vec![Method::Auto]);
    if let Some(fixed) = methods.iter().find(|m| m.is_fixed_step()) {
        let name = study::method_name(*fixed);
        return Err(Failure::Usage(format!(
            "error: a report is verified at its tolerances, and `{name}` has a fixed step; verify a run: `dlsys run … --verify`\n"
        )));
    }
    let all = methods.iter().flat_map(|&method| {
        tolerances.iter().map(move |&tolerance| Settings { method, tolerance, ..args.budget.settings() })
    });
    let all: Vec<Settings> = all.collect();
    let mut progress = Progress::new("verifying", all.len());
    let (mut rows, mut failed, mut wrong) = (Vec::new(), String::new(), 0);
    for settings in &all {
        match compare(session, *settings, times, args.time_limit, &mut |what| progress.say(what)) {
            Ok(found) => {
                if let Some(message) = complaint(&session.model, &found) {
                    wrong += 1;
                    failed = if failed.is_empty() { message } else { failed };
                }
                rows.push((*settings, Ok(found)));
            }
            Err(why) => {
                wrong += 1;
                rows.push((*settings, Err(why.clone())));
                if let (true, Failure::Model(message)) = (failed.is_empty(), failure(session, why)) {
                    failed = message;
                }
            }
        }
        progress.inc();
    }
    drop(progress);
    print(&verification_rows(session, times, &rows))?;
    tell(&failed);
    if wrong > 1 {
        tell(&format!(
            "error: {wrong} of {} are not verified; this is the first\n\n",
            count_of(rows.len(), "run")
        ));
    }
    Ok(wrong == 0)
}
