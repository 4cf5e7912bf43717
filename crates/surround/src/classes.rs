//! Plants that move by the modes of their class: of bodies that are equal and do not grow.
//!
//! A body that grows has other modes at every instant, so its ticks are solved; from the tick on at which it stands, it moves by modes. The
//! state is that of the solver either way, the strains of all stems, so nothing jumps there.

use std::collections::HashMap;
use std::collections::hash_map::DefaultHasher;
use std::hash::{Hash, Hasher};
use std::sync::{Arc, Mutex, PoisonError};

use dlsys_sway::{self as sway, Breeze, Reduced, Skeleton, Solver, State, Vector};

use crate::body::Body;

/// Most classes that are kept for plants to come. Plants keep their own besides.
const MOST_KEPT: usize = 4096;

/// The modes of a class; `None` if its pose at rest is not stable, or its equilibrium is not found.
type Found = Option<Arc<Reduced>>;

/// The classes of the plants of a scene.
#[derive(Debug, Default)]
pub struct Classes {
    known: Mutex<HashMap<u64, Vec<Class>>>,
}

#[derive(Clone, Debug)]
struct Class {
    skeleton: Skeleton,
    gravity: Vector,
    count: usize,
    found: Found,
}

impl Classes {
    /// Number of different bodies among those that are kept.
    pub fn count(&self) -> usize {
        let known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        known.values().map(Vec::len).sum()
    }

    /// The `count` slowest modes of each root of a skeleton. Equal skeletons share them.
    fn of(&self, skeleton: &Skeleton, solver: &mut Solver, count: usize) -> Found {
        let gravity = solver.settings.air.gravity;
        let key = hash(skeleton, count);
        let known = || self.known.lock().unwrap_or_else(PoisonError::into_inner);
        let is_it =
            |class: &&Class| class.count == count && class.gravity == gravity && class.skeleton == *skeleton;
        if let Some(class) = known().get(&key).and_then(|classes| classes.iter().find(is_it)) {
            return class.found.clone();
        }
        let found = solver.reduce(skeleton, count).ok().map(Arc::new);
        let mut known = known();
        if known.len() < MOST_KEPT {
            let class = Class { skeleton: skeleton.clone(), gravity, count, found: found.clone() };
            known.entry(key).or_default().push(class);
        }
        found
    }
}

/// A number that equal skeletons share.
fn hash(skeleton: &Skeleton, count: usize) -> u64 {
    let mut hasher = DefaultHasher::new();
    (skeleton.len(), count).hash(&mut hasher);
    for segment in skeleton.segments() {
        let numbers = [segment.length, segment.diameter, segment.joint.rotation[0]];
        // Both zeros are equal.
        numbers.map(|x| (x + 0.0).to_bits()).hash(&mut hasher);
    }
    hasher.finish()
}

/// How many modes a plant moves by, and where their classes are kept.
#[derive(Clone, Debug)]
pub struct ByModes {
    /// Modes of each root.
    pub count: usize,
    /// Shared by the plants of a scene.
    pub classes: Arc<Classes>,
}

/// A plant that moves by modes where it stands.
#[derive(Clone, Debug)]
pub(crate) struct Modal {
    by: ByModes,
    /// The body whose modes are known, and they.
    body: Arc<Body>,
    found: Found,
    breeze: Breeze,
}

impl Modal {
    pub(crate) fn new(by: ByModes) -> Modal {
        Modal { by, body: Arc::default(), found: None, breeze: Breeze::default() }
    }

    /// Advances a state by one tick. False if the body grows, or cannot move by modes: the state is as before.
    pub(crate) fn advance(
        &mut self,
        body: &Arc<Body>,
        state: &mut State,
        times: (f64, f64),
        wind: &impl sway::Wind,
        solver: &mut Solver,
    ) -> bool {
        if !body.stands() {
            return false;
        }
        if !Arc::ptr_eq(body, &self.body) {
            if self.body.skeleton != body.skeleton {
                self.found = self.by.classes.of(&body.skeleton, solver, self.by.count);
                self.breeze = Breeze::default();
            }
            self.body = Arc::clone(body);
        }
        let Some(found) = &self.found else { return false };
        found.advance(state, times, wind, &mut self.breeze).is_ok()
    }
}
