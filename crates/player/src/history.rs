//! The list of productions of a run, for display: productions of one instant, rule and clause are one line.

use serde::Serialize;

use dlsys_diagnostic::Source;
use dlsys_model::Model;
use dlsys_sim::Event;

/// Productions that took place at one instant by one clause.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Happening {
    /// Time of the run.
    pub t: f64,
    /// Name of the modules that were replaced.
    pub module: String,
    /// How many modules the clause replaced.
    pub times: u64,
    /// Where the clause stands in the model.
    pub line: usize,
    #[serde(skip)]
    group: u64,
    #[serde(skip)]
    clause: (usize, usize),
}

/// The productions of a run, up to a number of lines.
#[derive(Clone, Debug, Default)]
pub struct History {
    /// The lines, in the order of time.
    pub happenings: Vec<Happening>,
    /// Productions, including those that are not listed.
    pub productions: u64,
    /// Productions that are not listed.
    pub left_out: u64,
}

impl History {
    /// Most lines of the list.
    pub const MOST: usize = 5000;

    /// Adds productions, in the order of time.
    pub fn add(&mut self, events: &[Event], model: &Model, source: &Source) {
        for event in events {
            self.productions += 1;
            let clause = (event.rule, event.clause);
            let same = |h: &&mut Happening| h.group == event.group;
            let instant = self.happenings.iter_mut().rev().take_while(same);
            if let Some(known) = instant.into_iter().find(|h| h.clause == clause) {
                known.times += 1;
                continue;
            }
            if self.happenings.len() >= History::MOST {
                self.left_out += 1;
                continue;
            }
            self.happenings.push(Happening {
                t: event.time,
                module: model.kinds.get(event.kind).name.clone(),
                times: 1,
                line: source.position(model.rules[event.rule].produces[event.clause].span.start).0,
                group: event.group,
                clause,
            });
        }
    }
}
