//! The explanation as text of at most 100 columns.

use std::fmt::Write;

use super::curves::CurvePlan;
use super::plan::{ClausePlan, ConditionPlan, Explanation, KindPlan, RulePlan, Work};
use super::scene::ScenePart;
use super::words::SUM;

const COLUMNS: usize = 100;

/// Rows of three columns; the last one is broken into lines.
#[derive(Default)]
struct Table(Vec<[String; 3]>);

impl Table {
    fn show(&self, indent: usize, out: &mut String) {
        let width = |i: usize| self.0.iter().map(|row| row[i].chars().count()).max().unwrap_or(0);
        let widths = [width(0).min(26), width(1).min(40)];
        let left = indent + widths[0] + widths[1] + 4;
        for [a, b, c] in &self.0 {
            let mut line = format!("{:indent$}{}  {}", "", padded(a, widths[0]), padded(b, widths[1]));
            // Below a long entry, if there is no space beside it.
            if line.chars().count() > left - 2 {
                let _ = writeln!(out, "{}", line.trim_end());
                line = " ".repeat(left - 2);
            }
            for word in c.split_whitespace() {
                let used = line.chars().count();
                if used > left && used + 1 + word.chars().count() > COLUMNS {
                    let _ = writeln!(out, "{}", line.trim_end());
                    line = " ".repeat(left - 1);
                }
                line += if line.chars().count() == left - 2 { "  " } else { " " };
                line += word;
            }
            let _ = writeln!(out, "{}", line.trim_end());
        }
    }
}

/// Words in lines of the width of the page; those after the first are indented by two more.
pub fn wrapped(indent: usize, text: &str, out: &mut String) {
    let mut line = " ".repeat(indent);
    let mut is_empty = true;
    for word in text.split(' ') {
        if !is_empty && line.chars().count() + 1 + word.chars().count() > COLUMNS {
            let _ = writeln!(out, "{line}");
            line = " ".repeat(indent + 2);
            is_empty = true;
        }
        line += if is_empty { "" } else { " " };
        line += word;
        is_empty = false;
    }
    let _ = writeln!(out, "{line}");
}

fn padded(text: &str, width: usize) -> String {
    text.to_owned() + &" ".repeat(width.saturating_sub(text.chars().count()))
}

/// A line, wrapped at the width of the page.
fn line(text: &str, out: &mut String) {
    if text.chars().count() > COLUMNS {
        out.extend(text.chars().take(COLUMNS - 1).chain(['…']));
    } else {
        out.push_str(text);
    }
    out.push('\n');
}

fn clause(action: &str, clause: &ClausePlan, out: &mut String) {
    let condition = match clause.condition.as_str() {
        "" => "always".to_owned(),
        rate if rate.starts_with("at rate ") => rate.to_owned(),
        condition => format!("if {condition}"),
    };
    let choice = clause.successors.map_or(String::new(), |n| format!(", one of {n} successors"));
    line(&format!("    {action}, line {}, {condition}{choice}", clause.line), out);
}

fn kind_line(plan: &Explanation, group: &[&KindPlan]) -> String {
    let shown: Vec<String> = (group.iter())
        .map(|kind| match plan.kinds.iter().filter(|other| other.name == kind.name).count() {
            1 => kind.name.clone(),
            _ => format!("{} with {} parameters", kind.name, kind.arity),
        })
        .collect();
    let work = match group[0].work {
        Work::NoRules => "no rules",
        Work::AtRest => "nothing but productions",
        Work::InSteps => "replaced step by step, by discrete rules",
        Work::Formulas => "never stepped: formulas only",
        Work::Alone => "integrated alone",
        Work::Coupled => "integrated together with its neighbours",
    };
    format!("{}: {work}", shown.join(", "))
}

fn rule(rule: &RulePlan, out: &mut String) {
    line(&format!("  line {}: {}", rule.line, rule.head), out);
    for solve in &rule.solves {
        clause("solve", &solve.clause, out);
        let rows = solve.parameters.iter().map(|p| {
            let why = match &p.law {
                Some(law) => format!("{law}: {}", p.why),
                None => p.why.clone(),
            };
            [p.name.clone(), p.class.to_owned(), why]
        });
        Table(rows.collect()).show(6, out);
    }
    for produce in &rule.produces {
        clause("produce", produce, out);
    }
    if !rule.conditions.is_empty() {
        let _ = writeln!(out, "    how their instants are found");
        Table(rule.conditions.iter().flat_map(condition).collect()).show(6, out);
    }
}

/// A row for each method by which the instant is located.
fn condition(condition: &ConditionPlan) -> Vec<[String; 3]> {
    let mut rows: Vec<(Vec<usize>, &str, &str)> = Vec::new();
    for found in &condition.found {
        match rows.iter_mut().find(|row| (row.1, row.2) == (found.class, found.why.as_str())) {
            Some(row) => row.0.extend(found.line),
            None => rows.push((found.line.into_iter().collect(), found.class, &found.why)),
        }
    }
    let several = rows.len() > 1;
    (rows.into_iter().enumerate())
        .map(|(i, (lines, class, why))| {
            let lines: Vec<String> = lines.iter().map(usize::to_string).collect();
            let under = if several { format!("under line {}: ", lines.join(", ")) } else { String::new() };
            let boundary = if i == 0 { condition.boundary.clone() } else { String::new() };
            [boundary, class.to_owned(), format!("{under}{why}")]
        })
        .collect()
}

/// The whole explanation.
pub fn show(plan: &Explanation) -> String {
    let mut out = String::new();
    let title = plan.title.as_ref().map_or(String::new(), |title| format!(": {title}"));
    let _ = writeln!(out, "{}{title}\n", plan.model);
    let ruled = plan.kinds.iter().filter(|kind| !kind.rules.is_empty());
    let mut groups: Vec<Vec<&KindPlan>> = Vec::new();
    for kind in ruled {
        match groups.iter_mut().find(|group| group[0].rules == kind.rules && group[0].work == kind.work) {
            Some(group) => group.push(kind),
            None => groups.push(vec![kind]),
        }
    }
    for group in &groups {
        line(&kind_line(plan, group), &mut out);
        for &index in &group[0].rules {
            rule(&plan.rules[index], &mut out);
        }
        if !group[0].drawn_only.is_empty() {
            let only = group[0].drawn_only.join(", ");
            let when = match group[0].work {
                Work::Formulas => ": evaluated at frames only",
                _ => "",
            };
            let reader = if group[0].is_drawn { "only drawing" } else { "nothing" };
            let _ = writeln!(out, "    {reader} reads {only}{when}");
        }
        out.push('\n');
    }
    if !plan.curves.is_empty() {
        let _ = writeln!(out, "Curves");
        Table(plan.curves.iter().map(CurvePlan::row).collect()).show(2, &mut out);
        out.push('\n');
    }
    if !plan.scene.is_empty() {
        let _ = writeln!(out, "Scene");
        Table(plan.scene.iter().map(ScenePart::row).collect()).show(2, &mut out);
        out.push('\n');
    }
    for bending in plan.bending.iter().chain(&plan.bending_of_plants) {
        out += &bending.text();
    }
    for falling in &plan.falling {
        out += &falling.text();
    }
    let _ = writeln!(out, "Summary");
    let summary = &plan.summary;
    let row = |label: &str, says: &str, list: &[String]| [label.to_owned(), says.to_owned(), list.join(" ")];
    let rows = [
        row("formulas", "never stepped", &summary.formulas),
        row("alone", "stepped each by itself", &summary.alone),
        row("coupled", "stepped together with neighbours", &summary.coupled),
        row("at rest", "productions, no equations", &summary.at_rest),
        row("in steps", "discrete rules", &summary.in_steps),
        row("no rules", "never change", &summary.no_rules),
    ];
    Table(rows.into_iter().filter(|row| !row[2].is_empty()).collect()).show(2, &mut out);
    let uses = |law: &str| {
        let solves = plan.rules.iter().flat_map(|rule| &rule.solves);
        { solves }.flat_map(|solve| &solve.parameters).any(|p| p.law.as_deref().is_some_and(|l| l == law))
    };
    let mut notes = Vec::new();
    if uses(SUM) {
        notes.push(
            "A sum of exponentials is refused where two of its rates nearly agree (resonance): its digits \
             would cancel. The module is then integrated.",
        );
    }
    if !summary.coupled.is_empty() {
        notes.push(
            "In coupled modules, parameters in closed form stay formulas. Their events are found as listed, \
             but end the common step.",
        );
    }
    for note in notes {
        Table(vec![["Note".to_owned(), String::new(), note.to_owned()]]).show(0, &mut out);
    }
    out
}
