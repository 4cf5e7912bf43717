//! `--events FILE`: the productions of a run, one JSON object per line.
//!
//! ```text
//! {"t":1,"group":1,"lineage":"3","id":"2x0…","module":"F_r","rule":"F_r(x, s)","clause":1,"line":22,"residual":0}
//! ```
//!
//! | field | |
//! |---|---|
//! | `t` | time, in the model's unit |
//! | `group` | number of the instant, from 1: productions with the same number are simultaneous |
//! | `lineage` | the module that was replaced: its place in the initial string, then in each successor |
//! | `id` | its name: 13 characters, the same that exported frames use |
//! | `module` | the name of its kind |
//! | `rule` | the head of the rule |
//! | `clause` | number of the `produce` clause in the rule, from 1 |
//! | `successor` | for a clause with several successors, the number of the chosen one, from 1 |
//! | `line` | the clause's line in the model file |
//! | `residual` | difference of the two sides of the condition at the located instant; `null` if not finite |

use std::fmt::Write as _;
use std::path::Path;

use super::common::{Failure, ModelRun};
use super::output::Output;
use super::run::number;
use crate::sim::Event;

/// An event log that is being written.
pub struct EventLog {
    file: Output,
    /// Per rule: its head as a JSON string, and the lines of its `produce` clauses.
    rules: Vec<(String, Vec<usize>)>,
    /// Per kind: its name as a JSON string.
    kinds: Vec<String>,
    /// The simulation's number of the last instant, which also counts changes of equations, and the number in the log.
    group: (u64, u64),
    text: String,
}

fn json(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}

impl EventLog {
    /// Creates the file, if a path is given.
    pub fn create(path: Option<&Path>, run: &ModelRun) -> Result<Option<EventLog>, Failure> {
        let Some(path) = path else { return Ok(None) };
        let (model, source) = (&run.session.model, &run.session.source);
        let lines = |rule: &crate::model::Rule| {
            rule.produces.iter().map(|p| source.position(p.span.start).0).collect::<Vec<_>>()
        };
        Ok(Some(EventLog {
            file: Output::create(path)?,
            rules: model.rules.iter().map(|r| (json(&r.label), lines(r))).collect(),
            kinds: model.kinds.iter().map(|(_, kind)| json(&kind.name)).collect(),
            group: (0, 0),
            text: String::new(),
        }))
    }

    /// Writes productions.
    pub fn write(&mut self, events: &[Event]) -> Result<(), Failure> {
        for event in events {
            self.line(event);
            self.file.write(&self.text)?;
        }
        Ok(())
    }

    /// Flushes the file.
    pub fn finish(self) -> Result<(), Failure> {
        self.file.finish()
    }

    fn line(&mut self, event: &Event) {
        if event.group != self.group.0 {
            self.group = (event.group, self.group.1 + 1);
        }
        let (rule, lines) = &self.rules[event.rule];
        let successor = event.successor.map(|s| format!("\"successor\":{},", s + 1)).unwrap_or_default();
        let out = &mut self.text;
        out.clear();
        out.push_str("{\"t\":");
        number(event.time, out);
        // Writing to a string does not fail.
        let _ = write!(
            out,
            ",\"group\":{},\"lineage\":\"{}\",\"id\":\"{}\",\"module\":{},\"rule\":{rule},\"clause\":{},{successor}\"line\":{},\"residual\":",
            self.group.1,
            event.lineage,
            event.lineage.name(),
            self.kinds[event.kind.index()],
            event.clause + 1,
            lines[event.clause],
        );
        if event.residual.is_finite() {
            number(event.residual, out);
        } else {
            out.push_str("null");
        }
        out.push_str("}\n");
    }
}
