//! A study of coupling for a terminal.

use std::fmt::Write;

use dlsys_sim::brief;

use super::{Active, Coupling, CouplingStudy, Feet, Range, Row, Trial};
use crate::table::{Table, duration};

fn number(value: f64) -> String {
    if value != 0.0 && value.abs() < 1e-3 { format!("{value:.1e}") } else { brief(value, 3) }
}

/// A range in three cells; empty ones if it is not known.
fn cells(range: Option<Range>) -> [String; 3] {
    range.map_or_else(Default::default, |range| [range.least, range.most, range.mean].map(number))
}

/// The whole study.
pub fn coupling_text(study: &CouplingStudy) -> String {
    let mut out = format!("{}: coupling up to t = {}", study.title, brief(study.until, 6));
    if study.ticks > 0 {
        let _ = write!(out, ", {} ticks of 1/64 s", study.ticks);
    }
    out.push('\n');
    if !study.rows.is_empty() {
        forces(study, &mut out);
        costs(study, &mut out);
    }
    for active in &study.actives {
        decision(active, &mut out);
    }
    feet(&study.feet, &mut out);
    if !study.notes.is_empty() {
        out.push_str("\nnot measured\n");
        for note in &study.notes {
            let _ = writeln!(out, "  {note}");
        }
    }
    out
}

fn forces(study: &CouplingStudy, out: &mut String) {
    out.push_str("\nforces and accelerations by the passive parts on the active ones, in ticks in which they touch (table I of the paper)\n");
    let mut table = Table::default();
    let heads = [
        "",
        "kg",
        "by",
        "kg",
        "coupling",
        "touch",
        "least N",
        "most N",
        "mean N",
        "least m/s²",
        "most",
        "mean",
        "",
    ];
    table.push(heads.map(str::to_owned));
    let mut before = "";
    for Row { active, passive, passive_mass, coupling, touching, force, acceleration } in &study.rows {
        let found = study.actives.iter().find(|found| found.name == *active);
        let mass = found.and_then(|active| active.mass).map_or("?".to_owned(), number);
        let (name, mass) = if before == active { Default::default() } else { (active.clone(), mass) };
        before = active;
        let [least, most, mean] = cells(Some(*force));
        let [least_a, most_a, mean_a] = cells(*acceleration);
        let by = passive.clone().unwrap_or_else(|| "all".to_owned());
        let (coupling, touch) = (coupling.name().to_owned(), format!("{} s", number(*touching)));
        let passive_mass = number(*passive_mass);
        let end = String::new();
        table.push([
            name,
            mass,
            by,
            passive_mass,
            coupling,
            touch,
            least,
            most,
            mean,
            least_a,
            most_a,
            mean_a,
            end,
        ]);
    }
    for active in &study.actives {
        let Some(own) = active.own else { continue };
        let [least, most, mean] = cells(Some(own));
        let mut row: [String; 13] = Default::default();
        (row[0], row[2]) = (active.name.clone(), "all else".to_owned());
        (row[9], row[10], row[11]) = (least, most, mean);
        table.push(row);
    }
    table.write("  ", out);
    for Active { name, count, mass, is_measured, .. } in &study.actives {
        let source = match (mass, is_measured) {
            (Some(_), true) => "its mass follows from its equations",
            (Some(_), false) => "its mass is that of `--mass`",
            (None, _) => {
                "its mass is not known: equations that read no force have none (`--mass NAME=KG` gives it)"
            }
        };
        let plural = if *count == 1 { "module" } else { "modules" };
        let _ = writeln!(out, "  {name}: {count} {plural}; {source}");
    }
}

fn costs(study: &CouplingStudy, out: &mut String) {
    let _ = match study.reference {
        Some(tolerance) => writeln!(
            out,
            "\nwhat each coupling costs; distances are those of the active part from where it is both ways at a tolerance of {tolerance:e}"
        ),
        None => writeln!(
            out,
            "\nwhat each coupling costs; nothing runs both ways to tell how far the active part is off"
        ),
    };
    let mut table = Table::default();
    table.push(
        ["", "time", "steps", "rejected", "stretch", "aside", "at the end", "of size", ""].map(str::to_owned),
    );
    let mut alone: [String; 9] = Default::default();
    (alone[0], alone[1]) = ("growth alone".to_owned(), duration(study.alone));
    table.push(alone);
    for trial in &study.trials {
        let Trial { coupling, is_own, seconds, steps, stretch, apart, failed } = trial;
        let mut row: [String; 9] = Default::default();
        row[0] = format!("{}{}", coupling.name(), if *is_own { " (as it is)" } else { "" });
        row[1] = duration(*seconds);
        (row[2], row[3]) = (steps[0].to_string(), steps[1].to_string());
        row[4] = format!("{} %", number(stretch * 100.0));
        let several = study.actives.len() > 1;
        let farthest = study.actives.iter().filter_map(|active| Some((active, apart.get(&active.name)?)));
        let farthest = farthest.max_by(|a, b| (a.1.most / a.0.size).total_cmp(&(b.1.most / b.0.size)));
        if let Some((active, apart)) = farthest {
            row[5] = metres(apart.most);
            row[6] = metres(apart.end);
            row[7] = number(apart.most / active.size);
            if several {
                row[8].clone_from(&active.name);
            }
        }
        if let Some((why, time)) = failed {
            row[8] = format!("fails at t = {}: {why}", brief(*time, 6));
        }
        table.push(row);
    }
    table.write("  ", out);
    let feeds: Vec<&str> = study
        .actives
        .iter()
        .filter(|active| active.has_feedback && active.coupling == Coupling::OneWay)
        .map(|active| &*active.name)
        .collect();
    if !feeds.is_empty() {
        let _ = writeln!(
            out,
            "  the equations of {} depend on place or velocity: if that is a stand-in for a sheet, the model is hybrid; `--without NAME=VALUE` sets the `param` that takes it out, and tells what it does",
            feeds.join(", ")
        );
    }
}

/// A distance in mm, or in m.
fn metres(distance: f64) -> String {
    if distance < 1.0 { format!("{} mm", number(distance * 1e3)) } else { format!("{} m", number(distance)) }
}

fn decision(active: &Active, out: &mut String) {
    let _ = writeln!(out, "\nwhich coupling serves for {} (figure 17 of the paper)", active.name);
    let mut table = Table::default();
    for question in &active.decision.questions {
        let answer = match question.answer {
            Some(true) => "yes",
            Some(false) => "no",
            None => "not known",
        };
        // The first column is set to the left, and so is the last.
        table.push([format!("{:<46}", question.question), format!("{answer:<9}"), question.measured.clone()]);
    }
    table.write("  ", out);
    let _ = writeln!(out, "  {}", active.decision.verdict);
}

fn feet(feet: &[Feet], out: &mut String) {
    if feet.is_empty() {
        return;
    }
    out.push_str("\nstems that give way: the moment that they pass on to what holds them, beyond that at rest, at ticks of 1/30 s\n");
    let mut table = Table::default();
    table.push(["", "least N·m", "most", "mean", "most strain", ""].map(str::to_owned));
    for Feet { name, moment, strain, readers } in feet {
        let [least, most, mean] = cells(Some(*moment));
        let way = match &readers[..] {
            [] => "one-way: no rule reads `strain`, and growth, which holds them, has no mass".to_owned(),
            names => format!("two-way: rules of {} read `strain`", names.join(", ")),
        };
        table.push([name.clone(), least, most, mean, number(*strain), way]);
    }
    table.write("  ", out);
    out.push_str("  the force that they pass on is not measured\n");
}
