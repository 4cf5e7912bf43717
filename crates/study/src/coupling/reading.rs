//! The coupling that a model has, as its equations are written.

use dlsys_geometry::turtle;
use dlsys_model::{KindId, Model, Rule};

use super::{Coupling, CouplingError, CouplingPlan};

/// Masses and a stand-in that do not go with the model are errors.
pub(super) fn check(model: &Model, plan: &CouplingPlan) -> Result<(), CouplingError> {
    for name in plan.masses.keys() {
        let mut kinds = kinds(model, name).peekable();
        if kinds.peek().is_none() {
            let mut solids: Vec<String> = model
                .scenery
                .solids
                .iter()
                .map(|(kind, _)| format!("`{}`", model.kinds.get(*kind).name))
                .collect();
            solids.dedup();
            return Err(CouplingError::NoSuchSolid { name: name.clone(), solids });
        }
        if kinds.any(|kind| model.kinds.get(kind).reads_force()) {
            return Err(CouplingError::MassIsKnown { name: name.clone() });
        }
    }
    if plan.without.is_some() && model.reads_force() {
        return Err(CouplingError::NoStandIn);
    }
    Ok(())
}

/// The solid kinds of a name.
pub(super) fn kinds<'a>(model: &'a Model, name: &'a str) -> impl Iterator<Item = KindId> + 'a {
    let solids = model.scenery.solids.iter().map(|(kind, _)| *kind);
    solids.filter(move |kind| model.kinds.get(*kind).name == name)
}

/// The coupling of the solids of a name: what they read decides, and for what reads nothing whether a stand-in has been named.
pub(super) fn coupling(model: &Model, name: &str, has_stand_in: bool) -> Coupling {
    match kinds(model, name).any(|kind| model.kinds.get(kind).reads_force()) {
        true => Coupling::TwoWay,
        false if has_stand_in => Coupling::Hybrid,
        false => Coupling::OneWay,
    }
}

/// True if the solids of a name have equations with a force that depends on their place or velocity, or other equations from some place or velocity on. Free flight
/// and prescribed motion have none: there, each rate is one of what comes before it.
pub fn has_feedback(model: &Model, name: &str) -> bool {
    let rules = kinds(model, name).flat_map(|kind| model.kinds.get(kind).all_rules());
    rules.map(|rule| &model.rules[rule]).any(|rule| goes_round(rule) || depends_on_state(rule))
}

/// A parameter whose rate depends, over others, on itself.
fn goes_round(rule: &Rule) -> bool {
    rule.solves.iter().any(|solve| {
        let reads: Vec<(usize, usize)> =
            solve.jacobian.entries.iter().map(|&(rate, variable)| (solve.of[rate], variable)).collect();
        let mut reached: Vec<(usize, usize)> = reads.clone();
        // As long as a path may be.
        for _ in 0..solve.of.len() {
            let more = |&(of, over): &(usize, usize)| {
                reads
                    .iter()
                    .filter(move |(next, _)| *next == over)
                    .map(move |(_, to)| (of, *to))
                    .collect::<Vec<_>>()
            };
            reached.extend(reached.iter().flat_map(more).collect::<Vec<_>>());
            reached.sort_unstable();
            reached.dedup();
        }
        reached.iter().any(|(of, to)| of == to)
    })
}

/// A condition on a parameter that changes.
fn depends_on_state(rule: &Rule) -> bool {
    let moves = |variable: usize| rule.solves.iter().any(|solve| solve.of.contains(&variable));
    rule.sides.reads().iter().any(|variable| moves(*variable))
}

/// Passive parts of a model whose forces are not measured.
pub(super) fn notes(model: &Model) -> Vec<String> {
    let scenery = &model.scenery;
    let mut notes = Vec::new();
    let mut names: Vec<String> =
        scenery.solids.iter().map(|(kind, _)| format!("`{}`", model.kinds.get(*kind).name)).collect();
    names.dedup();
    let names = names.join(", ");
    if let Some(bed) = scenery.bed.as_ref().filter(|_| !names.is_empty()) {
        let soil = &scenery.soils[bed.soil].name;
        notes.push(format!(
            "ground of {soil}: {names} press into it; the force of soil on what presses is not measured"
        ));
    }
    if turtle::lets_go(model) {
        notes.push("what is let go (`@D`) is carried by the wind and meets the ground; it touches nothing that is active".to_owned());
    }
    if turtle::lets_out(model) {
        notes.push("gases have no force on anything: blobs are carried by the wind".to_owned());
    }
    if !scenery.plants.is_empty() {
        notes.push(
            "plants of other models: their stems, sheets and solids; measure their own models".to_owned(),
        );
    }
    if turtle::drapes(model) && !names.is_empty() {
        notes.push("moments of sheets on solids: no rule can read them".to_owned());
    }
    notes
}
