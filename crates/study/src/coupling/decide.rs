//! The decision tree of figure 17, as the paper's section VI tells it, with measured numbers in place of judgement.
//!
//! ```text
//! Is the effect on the active part negligible, or overwhelmed, or not to be seen?
//! ├─ yes ─ Is the passive part stable when it is driven? ── yes ──▶ one-way
//! └─ no ┐                                           └─ no ─┐
//!       └──────────────────────────────────────────────────┴─ Can both ways be afforded? ── yes ──▶ two-way
//!                                                             └─ no ─ Is there a stand-in? ── yes ──▶ hybrid
//!                                                                     └─ no ──▶ none
//! ```

use dlsys_sim::brief;

use super::{Active, Coupling, CouplingStudy, Row, Trial};

/// Limits of the decision. The paper gives the first one; the others are ours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thresholds {
    /// Accelerations in m/s² below which an effect is negligible: 1, as of the paper's clothing.
    pub negligible: f64,
    /// Mean acceleration by the passive part, relative to that by all else, below which it is overwhelmed: 0.1.
    pub overwhelmed: f64,
    /// Distance that the active part gets aside in one-way coupling, relative to its size, below which it is not to be seen: 0.05.
    pub unseen: f64,
    /// Stretch of a sheet above which a one-way coupling drives it too far: 0.3, a little more than at which fibres of nylon break.
    pub stretch: f64,
    /// Seconds of computing that both ways may take: 60.
    pub patience: f64,
}

impl Thresholds {
    /// Their names, for options and files.
    pub const NAMES: [&str; 5] = ["negligible", "overwhelmed", "unseen", "stretch", "patience"];

    /// The values in the order of the names.
    pub fn values(&self) -> [f64; 5] {
        let Thresholds { negligible, overwhelmed, unseen, stretch, patience } = *self;
        [negligible, overwhelmed, unseen, stretch, patience]
    }

    /// The same with the value of a name; false if there is none.
    pub fn set(&mut self, name: &str, value: f64) -> bool {
        let place = match name {
            "negligible" => &mut self.negligible,
            "overwhelmed" => &mut self.overwhelmed,
            "unseen" => &mut self.unseen,
            "stretch" => &mut self.stretch,
            "patience" => &mut self.patience,
            _ => return false,
        };
        *place = value;
        true
    }
}

impl Default for Thresholds {
    fn default() -> Thresholds {
        Thresholds { negligible: 1.0, overwhelmed: 0.1, unseen: 0.05, stretch: 0.3, patience: 60.0 }
    }
}

/// A question of the tree.
#[derive(Clone, Debug)]
pub struct Question {
    /// In words.
    pub question: &'static str,
    /// The number that answers it, with its unit, and the limit.
    pub measured: String,
    /// `None` if the number is not known.
    pub answer: Option<bool>,
}

/// The way through the tree.
#[derive(Clone, Debug, Default)]
pub struct Decision {
    /// In the order in which they are put.
    pub questions: Vec<Question>,
    /// The coupling that serves; `None` if none does, or if it is not known.
    pub serves: Option<Coupling>,
    /// What follows, in a sentence.
    pub verdict: String,
}

/// Numbers for people.
fn number(value: f64) -> String {
    brief(value, 3)
}

/// Goes through the tree for an active part.
pub(super) fn decide(active: &Active, study: &CouplingStudy) -> Decision {
    let mut decision = Decision::default();
    match is_insignificant(active, study, &mut decision) {
        None => {
            let most = rows(active, study).map(|row| row.force.most).fold(0.0, f64::max);
            let Thresholds { negligible, .. } = study.thresholds;
            decision.verdict = format!(
                "not decided, because the mass of {} is not known: a mass of more than {} kg would be accelerated by less than {} m/s². Give it with `--mass {}=KG`",
                active.name,
                number(most / negligible),
                number(negligible),
                active.name
            );
            return decision;
        }
        Some(true) => {
            if is_stable(study, &mut decision) {
                decision.serves = Some(Coupling::OneWay);
            }
        }
        Some(false) => (),
    }
    if decision.serves.is_none() && is_affordable(study, &mut decision) {
        decision.serves = Some(Coupling::TwoWay);
    }
    if decision.serves.is_none() && has_stand_in(active, study, &mut decision) {
        decision.serves = Some(Coupling::Hybrid);
    }
    decision.verdict = verdict(active, decision.serves);
    decision
}

/// The rows of all that touches it: two-way if there are some, as in the paper.
fn rows<'a>(active: &'a Active, study: &'a CouplingStudy) -> impl Iterator<Item = &'a Row> {
    let of = |coupling: Coupling| move |row: &&Row| row.active == active.name && row.coupling == coupling;
    let is_both = study.rows.iter().any(|row| of(Coupling::TwoWay)(&row));
    let coupling = if is_both { Coupling::TwoWay } else { Coupling::OneWay };
    let sum = study.rows.iter().filter(of(coupling)).any(|row| row.passive.is_none());
    study.rows.iter().filter(of(coupling)).filter(move |row| row.passive.is_none() == sum)
}

fn trial(study: &CouplingStudy, coupling: Coupling) -> Option<&Trial> {
    study.trials.iter().find(|trial| trial.coupling == coupling)
}

/// Whether the effect on an active part is small, overwhelmed, or not to be seen.
fn is_insignificant(active: &Active, study: &CouplingStudy, decision: &mut Decision) -> Option<bool> {
    let limits = study.thresholds;
    let mut put = |question, measured, answer| {
        decision.questions.push(Question { question, measured, answer });
        answer
    };
    let found = rows(active, study).find_map(|row| row.acceleration);
    let Some(acceleration) = found else {
        return put(
            "Is the effect on the active part negligible?",
            format!("no mass, no acceleration; below {} m/s²", number(limits.negligible)),
            None,
        );
    };
    let is_small = acceleration.most < limits.negligible;
    let measured = format!("{} m/s² at most; below {}", number(acceleration.most), number(limits.negligible));
    if put("Is the effect on the active part negligible?", measured, Some(is_small)) == Some(true) {
        return Some(true);
    }
    if let Some(own) = active.own {
        let limit = limits.overwhelmed * own.mean;
        let measured = format!(
            "{} m/s² in the mean; below {} of the {} by all else",
            number(acceleration.mean),
            number(limits.overwhelmed),
            number(own.mean)
        );
        if put("Is it overwhelmed by other accelerations?", measured, Some(acceleration.mean < limit))
            == Some(true)
        {
            return Some(true);
        }
    }
    let apart = trial(study, Coupling::OneWay).and_then(|trial| trial.apart.get(&active.name));
    let answer = apart.map(|apart| apart.most < limits.unseen * active.size);
    let measured = match apart {
        Some(apart) => format!(
            "one-way, {} of its size aside at most; below {}",
            number(apart.most / active.size),
            number(limits.unseen)
        ),
        None => "not known, because nothing runs both ways to compare with".to_owned(),
    };
    put("Is the difference too small to be seen?", measured, answer);
    Some(answer == Some(true))
}

/// Whether sheets are not driven too far one way.
fn is_stable(study: &CouplingStudy, decision: &mut Decision) -> bool {
    let limit = study.thresholds.stretch;
    let (measured, answer) = match trial(study, Coupling::OneWay) {
        Some(Trial { failed: Some((_, time)), .. }) => {
            (format!("it fails at t = {}", brief(*time, 6)), false)
        }
        Some(trial) => (
            format!(
                "stretched by {} % at most; up to {}",
                number(100.0 * trial.stretch),
                number(100.0 * limit)
            ),
            trial.stretch <= limit,
        ),
        None => ("it was not run".to_owned(), false),
    };
    let question = "Is the passive part stable when it is driven?";
    decision.questions.push(Question { question, measured, answer: Some(answer) });
    answer
}

/// Whether both ways can be had.
fn is_affordable(study: &CouplingStudy, decision: &mut Decision) -> bool {
    let limit = study.thresholds.patience;
    let (measured, answer) = match trial(study, Coupling::TwoWay) {
        Some(Trial { failed: Some((_, time)), .. }) => {
            (format!("it fails at t = {}", brief(*time, 6)), false)
        }
        Some(trial) => (
            format!("{} s of computing; up to {}", number(trial.seconds), number(limit)),
            trial.seconds <= limit,
        ),
        None => ("it was not run".to_owned(), false),
    };
    let question = "Can both ways be afforded?";
    decision.questions.push(Question { question, measured, answer: Some(answer) });
    answer
}

/// Whether a cheap model of the passive part is there.
fn has_stand_in(active: &Active, study: &CouplingStudy, decision: &mut Decision) -> bool {
    let (measured, answer) = match trial(study, Coupling::Hybrid) {
        Some(Trial { failed: Some((_, time)), .. }) => {
            (format!("with it, the scene fails at t = {}", brief(*time, 6)), false)
        }
        Some(trial) => match trial.apart.get(&active.name) {
            Some(apart) => {
                (format!("with it, {} of its size aside at most", number(apart.most / active.size)), true)
            }
            None => ("there is one; its error is not known".to_owned(), true),
        },
        None if active.has_feedback => ("its equations hold forces that may be one".to_owned(), true),
        None => ("its equations hold none".to_owned(), false),
    };
    decision.questions.push(Question { question: "Is there a stand-in?", measured, answer: Some(answer) });
    answer
}

fn verdict(active: &Active, serves: Option<Coupling>) -> String {
    let has = active.coupling.name();
    match serves {
        None => format!(
            "none serves as the model is ({has}): write a stand-in for the passive part into the rules of {}, a damping field or a spring",
            active.name
        ),
        Some(serves) if serves == active.coupling => format!("{has} serves, and the model has it"),
        Some(serves) => {
            let how = match serves {
                Coupling::OneWay => "leave the force out of its rules",
                Coupling::TwoWay => "let its rules read `force_x`, `force_y`, `force_z`",
                Coupling::Hybrid => "write a stand-in into its rules",
            };
            format!("{} serves, and the model is {has}: {how}", serves.name())
        }
    }
}
