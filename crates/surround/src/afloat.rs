//! Solids whose equations read no force, as if sheets moved them: masses that are given, and the motion that forces add to that of growth.
//!
//! ```text
//! place = path of growth + q,   m q'' = force of the sheets,   q = q' = 0 at t = 0
//! ```
//!
//! That is what two-way equations would do if the accelerations of growth depend neither on place nor on velocity, as in free flight; if they do, it leaves
//! out what growth would do about the deviation.

use std::collections::BTreeMap;

use dlsys_model::KindId;
use dlsys_sheet::{Matrix, Vector};

use crate::descent::Descent;
use crate::line::{Exerted, Line};
use crate::paths::{INSTANTS, Path};
use crate::tracks::Passage;

/// The masses of some kinds of solids, and where the solids are beyond the places that growth gives them.
#[derive(Clone, Debug, Default)]
pub(crate) struct Afloat {
    /// In kg.
    masses: BTreeMap<KindId, f64>,
    /// Way (m) and velocity (m/s) where the present part begins, by the module where the part before began.
    drift: BTreeMap<u64, [Vector; 2]>,
}

impl Afloat {
    pub(crate) fn new(masses: BTreeMap<KindId, f64>) -> Afloat {
        Afloat { masses, drift: BTreeMap::new() }
    }

    /// The inverse mass of the solids of a kind, in 1/kg.
    pub(crate) fn light(&self, kind: KindId) -> Option<Matrix> {
        self.masses.get(&kind).map(|mass| Matrix::identity() / *mass)
    }

    fn drift(&self, module: u64, since: &Descent) -> [Vector; 2] {
        since.line(module).find_map(|id| self.drift.get(&id)).copied().unwrap_or_default()
    }

    /// Adds the deviations to paths over a span of this length in s, under forces. `since` has the productions of the part before.
    pub(crate) fn deviate(&self, paths: &mut [Path], length: f64, exerted: &Exerted, since: &Descent) {
        for path in paths {
            let Some(light) = self.light(path.origin.kind) else { continue };
            let module = path.origin.lineage.id;
            let ([way, velocity], line) = (self.drift(module, since), exerted.on(module));
            let at = |part: f64| {
                let time = part * length;
                way + velocity * time + light * line.moments(time)[1]
            };
            path.deviate(INSTANTS.map(at));
        }
    }

    /// Goes on to the end of a part of this length in s, in which solids passed under these forces.
    pub(crate) fn go_on(
        &mut self,
        passages: &[Passage],
        (forces, since): (&BTreeMap<u64, Line>, &Descent),
        length: f64,
    ) {
        let next = passages.iter().filter_map(|Passage { origin, .. }| {
            let (light, module) = (self.light(origin.kind)?, origin.lineage.id);
            let [way, velocity] = self.drift(module, since);
            let line = forces.get(&module).copied().unwrap_or_default();
            let [impulse, integral] = line.moments(length);
            Some((module, [way + velocity * length + light * integral, velocity + light * impulse]))
        });
        self.drift = next.collect();
    }
}
