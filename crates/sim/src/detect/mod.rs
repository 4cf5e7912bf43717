//! Detection: the search of a stretch of time for zero crossings, for doubts about them, and for pulses between stages.
//!
//! - [`search`]: the next event of a module on a stretch. Begin here.
//! - [`crossing`]: the crossings of one atom, by formula or by root isolation; [`level`]: the same where it compares an integrated
//!   parameter with a number, as most do
//! - [`doubt`]: crossings that the error of integration may hide or feign; [`limit`]: those that rounding feigns
//! - [`quiet`]: a short test that spares most searches
//! - [`pulse`]: rates that are large between the stages of a step; [`calm`]: a short test that spares most of that;
//!   [`examined`]: what both are told of a step
//! - [`signs`]: signs of the differences that conditions compare, and their consequences; [`switched`]: those by way of a value

pub mod calm;
pub mod crossing;
pub mod doubt;
pub mod examined;
mod level;
mod limit;
pub mod pulse;
pub mod quiet;
pub mod search;
pub mod signs;
pub mod switched;

use std::collections::BTreeMap;

use crate::world::brief;
use crossing::CrossingDetector;
use dlsys_diagnostic::Diagnostic;
use dlsys_model::Model;
use dlsys_tree::SimTime;
use pulse::PulseDetector;

/// The detectors, and the remarks collected from their searches.
#[derive(Clone, Debug, Default)]
pub struct Detector {
    /// Detects events of modules.
    pub crossings: CrossingDetector,
    /// Detects steps that may have overlooked a pulse.
    pub pulses: PulseDetector,
    /// Rules whose rates could not be bounded, by number, with the time at which that first happened.
    pub unbounded: BTreeMap<usize, f64>,
    /// By rule and atom whose sides have come nearer each other than the error of integration: the time at which that
    /// first happened, and the number of modules for which it is still open whether they meet.
    approached: BTreeMap<(usize, usize), (f64, usize)>,
    /// By rule and atom whose event has been taken to be one instant with that of a neighbour, though they are not surely so: the first time.
    joined: BTreeMap<(usize, usize), f64>,
}

impl Detector {
    /// Records the atoms of a rule whose sides a search has left nearer each other than the error of integration:
    /// `found`, one bit for each atom, given those of the search before. `at` is the end of the searched stretch.
    #[inline]
    pub fn note_approach(&mut self, rule: usize, found: u64, before: u64, at: SimTime) {
        if found == before {
            return;
        }
        for atom in (0..64).filter(|atom| (found ^ before) & 1 << atom != 0) {
            if found & 1 << atom != 0 {
                self.approached.entry((rule, atom)).or_insert((at.to_f64(), 0)).1 += 1;
            } else if let Some((_, open)) = self.approached.get_mut(&(rule, atom)) {
                // Their crossing has been found.
                *open -= 1;
                if *open == 0 {
                    self.approached.remove(&(rule, atom));
                }
            }
        }
    }

    /// Records that an atom of a rule has met together with the event of a neighbour, though it may be a little later.
    pub fn note_joined(&mut self, rule: usize, atom: usize, at: SimTime) {
        self.joined.entry((rule, atom)).or_insert(at.to_f64());
    }

    /// Warnings about the run so far: rules whose rates could not be bounded somewhere, so that a pulse may have been
    /// overlooked there; sides of conditions that have come nearer each other than the error of integration, so
    /// that a production may have been due; and events that have been taken to be one instant.
    pub fn remarks(&self, model: &Model) -> Vec<Diagnostic> {
        let remark = |(&rule, &t): (&usize, &f64)| {
            let rule = &model.rules[rule];
            Diagnostic::warning(format!("the rates of {} have no bounds near t = {}", rule.label, brief(t, 6)))
                .at(rule.span, "these equations")
                .help("a rate that is very large there for a very short time may be overlooked: see what is divided by, or taken the logarithm of, or compare with `--method rk4 --step-size H`")
        };
        // `tell` gets the rule and the boundary of the atom.
        let about =
            |(rule, atom): (usize, usize), tell: &dyn Fn(&str, &str) -> String, label: &str, help: &str| {
                let rule = &model.rules[rule];
                let boundary = rule.boundaries[atom].to_string();
                let boundary = if boundary.is_empty() { "a boundary" } else { &boundary };
                Diagnostic::warning(tell(&rule.label, boundary)).at(rule.atoms[atom], label).help(help)
            };
        let near = |(&place, &(t, _)): (&(usize, usize), &(f64, usize))| {
            let tell = |rule: &str, boundary: &str| {
                format!(
                    "{rule} comes so near {boundary} by t = {} that the error of integration does not tell whether it meets it",
                    brief(t, 6)
                )
            };
            let help = "a smaller `--tolerance` tells more; if what comes near is to count, say how near: `if x >= y - 1e-5`";
            about(place, &tell, "as long as that is so, nothing follows", help)
        };
        let joined = |(&place, &t): (&(usize, usize), &f64)| {
            let tell = |rule: &str, boundary: &str| {
                format!(
                    "{rule} is so near {boundary} at an event of its neighbour, t = {}, that the error of integration does not tell which is first",
                    brief(t, 6)
                )
            };
            let help =
                "a smaller `--tolerance` tells more; if both are meant to happen together, all is well";
            about(place, &tell, "both happen at that time", help)
        };
        let approached = self.approached.iter().map(near);
        self.unbounded.iter().map(remark).chain(approached).chain(self.joined.iter().map(joined)).collect()
    }
}
