//! A study of coupling as CSV and JSON.

use serde_json::{Value, json};

use super::{Coupling, CouplingStudy, Range, Thresholds};
use crate::files::line;

/// Rows of table I as comma-separated values (RFC 4180). An empty field means that there is no such number.
pub fn coupling_csv(study: &CouplingStudy) -> String {
    const COLUMNS: [&str; 12] = [
        "active",
        "mass_kg",
        "passive",
        "passive_mass_kg",
        "coupling",
        "touching_s",
        "force_min_n",
        "force_max_n",
        "force_mean_n",
        "acceleration_min_m_s2",
        "acceleration_max_m_s2",
        "acceleration_mean_m_s2",
    ];
    let mut out = line(COLUMNS.map(str::to_owned));
    for row in &study.rows {
        let found = study.actives.iter().find(|found| found.name == row.active);
        let mass = found.and_then(|active| active.mass);
        let number = |value: Option<f64>| value.map_or(String::new(), |value| format!("{value:e}"));
        let parts = |range: Option<Range>| {
            [range.map(|range| range.least), range.map(|range| range.most), range.map(|range| range.mean)]
                .map(number)
        };
        let [force, acceleration] = [parts(Some(row.force)), parts(row.acceleration)];
        let [least, most, mean] = force;
        let [least_a, most_a, mean_a] = acceleration;
        out += &line([
            row.active.clone(),
            number(mass),
            row.passive.clone().unwrap_or_default(),
            number(Some(row.passive_mass)),
            row.coupling.name().to_owned(),
            number(Some(row.touching)),
            least,
            most,
            mean,
            least_a,
            most_a,
            mean_a,
        ]);
    }
    out
}

/// The whole study. Lengths are in m, times in s, forces in N, masses in kg, but `until` and `failed_at` in units of the model.
pub fn coupling_json(study: &CouplingStudy) -> String {
    let range = |range: Option<Range>| {
        range
            .map_or(Value::Null, |range| json!({ "min": range.least, "max": range.most, "mean": range.mean }))
    };
    let rows = study.rows.iter().map(|row| {
        json!({
            "active": row.active,
            "passive": row.passive,
            "passive_mass": row.passive_mass,
            "coupling": row.coupling.name(),
            "touching": row.touching,
            "force": range(Some(row.force)),
            "acceleration": range(row.acceleration),
        })
    });
    let trials = study.trials.iter().map(|trial| {
        let apart = trial
            .apart
            .iter()
            .map(|(name, apart)| (name.clone(), json!({ "max": apart.most, "end": apart.end })));
        json!({
            "coupling": trial.coupling.name(),
            "is_own": trial.is_own,
            "seconds": trial.seconds,
            "steps": trial.steps[0],
            "rejected": trial.steps[1],
            "stretch": trial.stretch,
            "distances": apart.collect::<serde_json::Map<String, Value>>(),
            "failed": trial.failed.as_ref().map(|(why, _)| why),
            "failed_at": trial.failed.as_ref().map(|(_, time)| time),
        })
    });
    let actives = study.actives.iter().map(|active| {
        let questions = active.decision.questions.iter().map(|question| {
            json!({ "question": question.question, "measured": question.measured, "answer": question.answer })
        });
        json!({
            "name": active.name,
            "modules": active.count,
            "size": active.size,
            "mass": active.mass,
            "mass_from_equations": active.is_measured,
            "coupling": active.coupling.name(),
            "has_feedback": active.has_feedback,
            "own_acceleration": range(active.own),
            "questions": questions.collect::<Vec<Value>>(),
            "serves": active.decision.serves.map(Coupling::name),
            "verdict": active.decision.verdict,
        })
    });
    let feet = study.feet.iter().map(|feet| {
        json!({
            "name": feet.name,
            "moment": range(Some(feet.moment)),
            "strain": feet.strain,
            "coupling": if feet.readers.is_empty() { Coupling::OneWay.name() } else { Coupling::TwoWay.name() },
            "readers": feet.readers,
        })
    });
    let thresholds = Thresholds::NAMES.iter().zip(study.thresholds.values());
    let whole = json!({
        "model": study.title,
        "until": study.until,
        "ticks": study.ticks,
        "forces": rows.collect::<Vec<Value>>(),
        "growth_alone": study.alone,
        "couplings": trials.collect::<Vec<Value>>(),
        "reference_tolerance": study.reference,
        "active": actives.collect::<Vec<Value>>(),
        "stems": feet.collect::<Vec<Value>>(),
        "not_measured": study.notes,
        "thresholds": thresholds.map(|(name, value)| ((*name).to_owned(), json!(value))).collect::<serde_json::Map<String, Value>>(),
    });
    format!("{whole:#}\n")
}
