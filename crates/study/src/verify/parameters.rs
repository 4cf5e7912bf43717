//! The largest difference of each parameter.

use std::collections::HashMap;

use dlsys_model::{KindId, Model};
use dlsys_tree::{Lineage, Module, ModuleString};

/// Where a parameter of a kind of module differs most.
#[derive(Clone, Debug, PartialEq)]
pub struct Gap {
    /// The kind.
    pub kind: KindId,
    /// Index of the parameter, from 0.
    pub parameter: usize,
    /// Time of the largest difference.
    pub t: f64,
    /// Lineage of the module.
    pub lineage: Lineage,
    /// The value in the run in question.
    pub ours: f64,
    /// The value in the other run.
    pub theirs: f64,
    /// The difference, relative to max(1, |value|). Infinite if one of them is not a number.
    pub error: f64,
}

/// Parameters by kind, as far as they were seen.
pub(super) struct Parameters {
    gaps: Vec<Vec<Gap>>,
}

impl Parameters {
    pub fn new(model: &Model) -> Parameters {
        Parameters { gaps: model.kinds.iter().map(|_| Vec::new()).collect() }
    }

    /// Two strings of the same modules.
    pub fn compare_all(&mut self, ours: &ModuleString, theirs: &ModuleString) {
        for (m, n) in ours.iter().zip(theirs.iter()) {
            self.compare(ours.time, m, n);
        }
    }

    /// Two strings of which only some modules are the same.
    pub fn compare_common(&mut self, ours: &ModuleString, theirs: &ModuleString) {
        let modules = theirs.iter().filter(|n| !n.kind.is_bracket());
        let known: HashMap<(KindId, u64), Module<'_>> =
            modules.map(|n| ((n.kind, n.lineage.id), n)).collect();
        for m in ours.iter() {
            if let Some(n) = known.get(&(m.kind, m.lineage.id)) {
                self.compare(ours.time, m, *n);
            }
        }
    }

    fn compare(&mut self, t: f64, m: Module<'_>, n: Module<'_>) {
        let gaps = &mut self.gaps[m.kind.index()];
        for (parameter, (&ours, &theirs)) in m.parameters.iter().zip(n.parameters).enumerate() {
            let error = (ours - theirs).abs() / theirs.abs().max(1.0);
            // What is not a number is as wrong as can be.
            let error = if error.is_nan() { f64::INFINITY } else { error };
            if gaps.get(parameter).is_none_or(|known| error > known.error) {
                let gap = Gap { kind: m.kind, parameter, t, lineage: m.lineage, ours, theirs, error };
                match gaps.get_mut(parameter) {
                    Some(known) => *known = gap,
                    None => gaps.push(gap),
                }
            }
        }
    }

    /// In the order of kinds and parameters.
    pub fn found(self) -> Vec<Gap> {
        self.gaps.into_iter().flatten().collect()
    }
}
