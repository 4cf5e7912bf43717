//! A verification for people.

use std::fmt::Write;

use super::super::error::Error;
use super::super::record::{Accuracy, EarlyEnd, Setup};
use super::super::table::Table;
use super::{Gap, PROMISED, Pair, Split, Verification};
use dlsys_model::Model;
use dlsys_session::Session;
use dlsys_sim::{Event, Method, Scheduler, Settings, brief};

/// Digits of values and times that are compared by eye.
const DIGITS: usize = 12;

/// How a run is made, as in `radau at tolerance 1e-8, scheduler global, reference path`.
pub fn way(settings: &Settings) -> String {
    let accuracy = match settings.method.is_fixed_step() {
        true => Accuracy::StepSize(settings.step_size),
        false => Accuracy::Tolerance(settings.tolerance),
    };
    let scheduler = match settings.scheduler {
        Scheduler::Auto => String::new(),
        Scheduler::Global => ", scheduler global".to_owned(),
        Scheduler::Local { slice } => format!(", scheduler local at slice {slice}"),
    };
    let path = if settings.slow { ", reference path" } else { "" };
    format!("{}{scheduler}{path}", Setup { method: settings.method, accuracy })
}

/// A difference in tolerances.
fn tolerances(found: &Verification, error: f64) -> String {
    brief(found.in_tolerances(error), 3)
}

/// The parameter of a gap, as in `F_v(x, c): x`.
fn parameter(model: &Model, gap: &Gap) -> String {
    let names = model.parameter_names(gap.kind);
    let kind = &model.kinds.get(gap.kind).name;
    match names.get(gap.parameter) {
        Some(name) if !model.kinds.get(gap.kind).has_no_rules() => {
            format!("{kind}({}): {name}", names.join(", "))
        }
        _ => format!("{kind}: parameter {}", gap.parameter + 1),
    }
}

/// The module of a production, and by which clause.
fn who(model: &Model, event: &Event) -> String {
    let kind = &model.kinds.get(event.kind).name;
    let several = model.rules.get(event.rule).is_some_and(|rule| rule.produces.len() > 1);
    let which = if several { format!(" by its produce no. {}", event.clause + 1) } else { String::new() };
    format!("{kind} {}{which}", event.lineage)
}

/// All that was compared.
pub fn verification_table(model: &Model, found: &Verification) -> String {
    let mut out = format!("checked  {}\nagainst  {}\n", way(&found.checked), way(&found.other));
    for (other, stop) in &found.refused {
        let _ = writeln!(out, "         not {}: {}", way(other), stop_text(stop));
    }
    if found.has_same_method {
        out.push_str(
            "         (stiff equations are solved by one method in both: what it gets wrong itself does not show)\n",
        );
    }
    let _ = match found.times {
        1 => writeln!(out, "at       t = {}\n", brief(found.end, 6)),
        n => writeln!(out, "at       {n} times up to t = {}\n", brief(found.end, 6)),
    };
    let mut table = Table::default();
    table.push(["largest difference", "in TOL", "at t", "here", "there", "of"].map(str::to_owned));
    for gap in &found.parameters {
        table.push([
            parameter(model, gap),
            tolerances(found, gap.error),
            brief(gap.t, 6),
            brief(gap.ours, DIGITS),
            brief(gap.theirs, DIGITS),
            format!("module {}", gap.lineage),
        ]);
    }
    if let Some(worst) = &found.productions.worst {
        table.push([
            "time of a production".to_owned(),
            tolerances(found, worst.error()),
            brief(worst.theirs, 6),
            brief(worst.ours, DIGITS),
            brief(worst.theirs, DIGITS),
            who(model, &worst.event),
        ]);
    }
    table.write("", &mut out);
    out.push('\n');
    out.push_str(&productions_text(model, found));
    if found.compared < found.times {
        let _ = writeln!(
            out,
            "parameters were compared at {} of {} times: at the others the modules are not the same",
            found.compared, found.times
        );
    }
    if found.passes() {
        let _ = writeln!(out, "verified: no difference is larger than {PROMISED} TOL");
    }
    out
}

/// How many productions there are, and whether they are the same, in one order.
fn productions_text(model: &Model, found: &Verification) -> String {
    let all = &found.productions;
    let order = match &all.swapped {
        None => "in one order".to_owned(),
        Some((a, b)) => format!(
            "in another order: first {} at t = {} and {} at t = {}, there {} and {}",
            who(model, &a.event),
            brief(a.ours, DIGITS),
            who(model, &b.event),
            brief(b.ours, DIGITS),
            brief(a.theirs, DIGITS),
            brief(b.theirs, DIGITS)
        ),
    };
    let mut out = match (all.ours, all.theirs) {
        (0, 0) => "no productions\n".to_owned(),
        (1, 1) => "1 production in both\n".to_owned(),
        (n, m) if n == m => format!("{n} productions in both, {order}\n"),
        (n, m) => format!("{n} productions here and {m} there; those of both {order}\n"),
    };
    if all.at_the_end > 0 {
        let _ = writeln!(
            out,
            "{} within {PROMISED} TOL of the end has taken place in one of the runs only",
            all.at_the_end
        );
    }
    out
}

/// What is wrong, as an error message; None if all is well.
pub fn complaint(model: &Model, found: &Verification) -> Option<String> {
    if found.passes() {
        return None;
    }
    let worst = found.worst().filter(|gap| found.in_tolerances(gap.error) > PROMISED);
    let late = found.productions.worst.as_ref().filter(|p| found.in_tolerances(p.error()) > PROMISED);
    let mut out = String::from("error: not verified: ");
    if let Some(split) = &found.productions.split {
        out.push_str(&split_text(model, split));
    } else if let Some(pair) = late.filter(|pair| worst.is_none_or(|gap| pair.error() >= gap.error)) {
        out.push_str(&late_text(model, found, pair));
    } else if let Some(gap) = worst {
        let _ = writeln!(
            out,
            "`{}` of module {} is {} here and {} there at t = {}: {} TOL, where {PROMISED} are promised",
            parameter(model, gap),
            gap.lineage,
            brief(gap.ours, DIGITS),
            brief(gap.theirs, DIGITS),
            brief(gap.t, DIGITS),
            tolerances(found, gap.error)
        );
    } else if let Some((t, ours, theirs)) = found.modules {
        let t = brief(t, DIGITS);
        let _ = match ours == theirs {
            true => writeln!(out, "there are other modules, or in another order, at t = {t}"),
            false => writeln!(out, "there are {ours} modules here and {theirs} there at t = {t}"),
        };
    } else {
        out.push_str("at some times the modules are not the same\n");
    }
    let _ = writeln!(out, "\n  = note: the other way is {}", way(&found.other));
    if found.checked.method == Method::Auto && model.is_closed_form() {
        out.push_str(
            "  = note: `auto` has formulas for all of this model; the other way integrates it, and is more likely to be wrong\n",
        );
    }
    let _ = writeln!(out, "  = help: {}\n", help(&found.checked));
    Some(out)
}

fn late_text(model: &Model, found: &Verification, pair: &Pair) -> String {
    format!(
        "the production of {} is at t = {} here and {} there: {} TOL, where {PROMISED} are promised\n",
        who(model, &pair.event),
        brief(pair.ours, DIGITS),
        brief(pair.theirs, DIGITS),
        tolerances(found, pair.error())
    )
}

fn split_text(model: &Model, split: &Split) -> String {
    let at = |event: &Event| format!("{} at t = {}", who(model, event), brief(event.time, DIGITS));
    let mut out = match (&split.ours, &split.theirs) {
        (Some(ours), Some(theirs)) => {
            format!(
                "the first production that differs is {} here, and {} there; they are {} apart\n",
                at(ours),
                at(theirs),
                brief((ours.time - theirs.time).abs(), 2)
            )
        }
        (Some(ours), None) => format!("the production of {} is here, but not there\n", at(ours)),
        (None, Some(theirs)) => format!("the production of {} is there, but not here\n", at(theirs)),
        (None, None) => "productions differ\n".to_owned(),
    };
    if let Some(rival) = &split.rival {
        let _ = write!(
            out,
            "\n  = note: {} comes so near to it (t = {} here, {} there) that the tolerance does not tell which is first",
            who(model, &rival.event),
            brief(rival.ours, DIGITS),
            brief(rival.theirs, DIGITS)
        );
    }
    out
}

/// What to do about it.
fn help(checked: &Settings) -> &'static str {
    match (checked.scheduler, checked.method) {
        (Scheduler::Local { .. }, _) => {
            "the scheduler `local` has an error of the order of its slice: a shorter `--slice`, or `--scheduler auto`"
        }
        (_, method) if method.is_fixed_step() => {
            "a fixed step knows of no tolerance: a smaller `--step-size`, a `--tolerance` that suits it, or `--method auto`"
        }
        _ => {
            "see whether a smaller `--tolerance` brings both together; if not, the model amplifies the least error, or something in it is decided by rounding"
        }
    }
}

fn stop_text(stop: &EarlyEnd) -> String {
    match stop {
        EarlyEnd::Error(error) => format!("it ends with an error: {error}"),
        stop => stop.to_string(),
    }
}

/// The message if no other way came to the end.
pub fn unverified(refused: &[(Settings, EarlyEnd)]) -> String {
    let mut out = String::from("error: not verified: no other way comes to the last time\n");
    for (other, stop) in refused {
        let _ = write!(out, "\n  = note: {}: {}", way(other), stop_text(stop));
    }
    let late = refused.iter().any(|(_, stop)| matches!(stop, EarlyEnd::Overtime { .. }));
    out.push_str(match late {
        true => "\n  = help: give them more time: `--time-limit S`; or look at earlier times, `--at` or `--to`\n\n",
        false => "\n  = help: where the other ways meet errors, look at the model there; up to an earlier time it can be verified\n\n",
    });
    out
}

/// Verifications of one model in several ways, a line for each: what was checked, the largest differences in tolerances, the
/// verdict, and the other way.
pub fn verification_rows(
    session: &Session,
    times: &[f64],
    rows: &[(Settings, Result<Verification, Error>)],
) -> String {
    let model = &session.model;
    let title = model.title.as_ref().unwrap_or(&session.source.name);
    let end = brief(times.last().copied().unwrap_or(0.0), 6);
    let mut out = match times.len() {
        1 => format!("{title}, at t = {end}\n\n"),
        n => format!("{title}, at {n} times up to t = {end}\n\n"),
    };
    let mut table = Table::default();
    table.push(["", "parameters", "productions", "number", "verdict", "against"].map(str::to_owned));
    for (settings, found) in rows {
        let [parameters, productions, number, verdict, against] = match found {
            Ok(found) => cells(model, found),
            Err(_) => ["-", "-", "-", "NOT: nothing to compare with", "-"].map(str::to_owned),
        };
        table.push([way(settings), parameters, productions, number, verdict, against]);
    }
    table.write("", &mut out);
    out.push_str(
        "\nlargest differences of parameters, and of times of productions, in units of the tolerance\n",
    );
    out
}

fn cells(model: &Model, found: &Verification) -> [String; 5] {
    let largest = |error: Option<f64>| error.map_or("-".to_owned(), |error| tolerances(found, error));
    let verdict = match found.worst() {
        _ if found.passes() => "verified".to_owned(),
        _ if found.productions.split.is_some() || found.modules.is_some() => {
            "NOT: other productions".to_owned()
        }
        Some(gap) if found.in_tolerances(gap.error) > PROMISED => format!("NOT: {}", parameter(model, gap)),
        _ => "NOT: times of productions".to_owned(),
    };
    [
        largest(found.worst().map(|gap| gap.error)),
        largest(found.productions.worst.as_ref().map(Pair::error)),
        found.productions.ours.to_string(),
        verdict,
        way(&found.other),
    ]
}
