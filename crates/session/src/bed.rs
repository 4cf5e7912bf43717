//! The plants of one scene, grown and drawn: jobs for threads, each some plants of one simulation from young to old.
//!
//! ```text
//! seedlings ─divide─▶ jobs (a simulation at the age of the youngest) ─grow─▶ drawings in their places
//! ```
//!
//! Where the picture has a size and a camera, plants of nearly the same age share drawings ([`looks`]); plants that sway have
//! shapes of their own.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use dlsys_diagnostic::{Diagnostic, Span};
use dlsys_geometry::scene::{Plant, Seedling};
use dlsys_geometry::turtle::Strains;
use dlsys_model as model;
use dlsys_sim::brief;
use dlsys_surround::Motion;
use dlsys_tree::ModuleString;

use crate::looks::{self, LEAST_HALVINGS, Sight};
use crate::nursery::{DrawError, Growing, Kept, MOST_ELEMENTS, Nursery, count, set_widths, too_many};
use crate::swaying::{Around, sways};

/// Most plants in a job.
const MOST_IN_JOB: usize = 192;

/// What the plants of a scene have in common.
pub(crate) struct Bed<'a, 'm> {
    pub(crate) nursery: &'a Nursery<'m>,
    pub(crate) around: &'a Around<'m>,
    pub(crate) seedlings: &'a [Seedling],
    pub(crate) motions: Option<&'a [Option<Arc<Motion<'m>>>]>,
    /// `None`: every age has a drawing of its own.
    pub(crate) sight: Option<Sight>,
    pub(crate) accuracy: f64,
    /// All elements so far.
    pub(crate) elements: &'a AtomicUsize,
}

/// Plants of one simulation, by number, from young to old.
pub(crate) struct Job<'a, 'm> {
    key: (usize, u64),
    members: &'a [usize],
    /// At the age of the first or younger; `None`: it has not begun.
    start: Option<Kept<'m>>,
    /// The simulation at the age of the first is kept for the next scene.
    is_first: bool,
}

/// The plants of a job.
#[derive(Default)]
pub(crate) struct Grown<'m> {
    pub(crate) plants: Vec<(usize, Plant)>,
    /// A simulation to be kept for the next scene.
    pub(crate) kept: Option<((usize, u64), Kept<'m>)>,
    pub(crate) warnings: Vec<(Span, Diagnostic)>,
    pub(crate) lacked_accuracy: bool,
}

/// A drawing, and the simulation at its age.
struct Look<'m> {
    kept: Kept<'m>,
    /// `None`: nothing is drawn.
    plant: Option<Plant>,
}

impl<'m> Bed<'_, 'm> {
    fn plant(&self, number: usize) -> &'m model::Plant {
        &self.nursery.model.scenery.plants[number]
    }

    /// Makes jobs of plants of one simulation, which are sorted by age. In the common case nothing is simulated here; the starts of further jobs of
    /// one simulation are copies of it.
    pub(crate) fn divide<'s>(
        &self,
        key: (usize, u64),
        members: &'s [usize],
        growing: &mut Growing<'m>,
        jobs: &mut Vec<Job<'s, 'm>>,
    ) -> Result<(), DrawError> {
        let first = self.seedlings[members[0]].age;
        let mut start = growing.remove(&key).filter(|kept| kept.time <= first);
        let count = members.len().div_ceil(MOST_IN_JOB);
        for (number, members) in members.chunks(MOST_IN_JOB).enumerate() {
            let is_first = number == 0;
            if count > 1 {
                let mut kept = match start.take() {
                    Some(kept) => kept,
                    None => self.begin(key)?,
                };
                kept.reach(self.plant(key.0), self.seedlings[members[0]].age)?;
                start = Some(kept.clone());
                jobs.push(Job { key, members, start: Some(kept), is_first });
            } else {
                jobs.push(Job { key, members, start: start.take(), is_first });
            }
        }
        Ok(())
    }

    fn begin(&self, (plant, seed): (usize, u64)) -> Result<Kept<'m>, DrawError> {
        let simulation = self.nursery.start(self.plant(plant), seed)?;
        Ok(Kept { simulation, time: 0.0, string: ModuleString::default() })
    }

    /// Draws the plants of a job.
    pub(crate) fn grow(&self, job: Job<'_, 'm>) -> Result<Grown<'m>, DrawError> {
        let Job { key, members, start, is_first } = job;
        let mut grown = Grown::default();
        let mut kept = match start {
            Some(kept) => kept,
            None => self.begin(key)?,
        };
        let age = |i: usize| self.seedlings[i].age;
        let [first, last] = [members[0], members[members.len() - 1]].map(age);
        kept.reach(self.plant(key.0), first)?;
        // The next scene begins with the youngest of this one.
        let is_one_age = first == last;
        if is_first && !is_one_age {
            grown.kept = Some((key, kept.clone()));
        }
        let is_moved = self.motions.is_some() && sways(&self.plant(key.0).model);
        match self.sight.filter(|_| !is_moved && members.len() > 2 && !is_one_age) {
            None => self.grow_each(key.1, members, &mut kept, is_moved, &mut grown)?,
            Some(sight) => {
                let of_age = |at: f64| members.iter().copied().filter(move |&i| age(i) == at);
                let left = self.look(members[0], key.1, kept.clone(), &mut grown)?;
                let right = self.look(members[members.len() - 1], key.1, kept.clone(), &mut grown)?;
                self.put(&left, of_age(first), &mut grown);
                self.put(&right, of_age(last), &mut grown);
                let between: Vec<usize> =
                    members.iter().copied().filter(|&i| age(i) > first && age(i) < last).collect();
                self.share((key.1, &sight, 0), (&left, &right), &between, &mut grown)?;
            }
        }
        if is_first && is_one_age {
            grown.kept = Some((key, kept));
        }
        Ok(grown)
    }

    /// Each age has a drawing of its own; each plant, if they move.
    fn grow_each(
        &self,
        seed: u64,
        members: &[usize],
        kept: &mut Kept<'m>,
        is_moved: bool,
        grown: &mut Grown<'m>,
    ) -> Result<(), DrawError> {
        for twins in members.chunk_by(|a, b| self.seedlings[*a].age == self.seedlings[*b].age) {
            let seedling = &self.seedlings[twins[0]];
            kept.reach(self.plant(seedling.plant), seedling.age)?;
            for twins in twins.chunks(if is_moved { 1 } else { twins.len() }) {
                if let Some(plant) = self.draw(twins[0], seed, kept, grown)? {
                    let place =
                        |&i: &usize| (i, plant.twin(self.seedlings[i].placement, self.seedlings[i].owner));
                    grown.plants.extend(twins.iter().map(place));
                }
            }
        }
        Ok(())
    }

    /// Draws plants whose ages are between those of two drawings: of as few ages as the picture takes.
    fn share(
        &self,
        (seed, sight, halvings): (u64, &Sight, u32),
        (left, right): (&Look<'m>, &Look<'m>),
        members: &[usize],
        grown: &mut Grown<'m>,
    ) -> Result<(), DrawError> {
        let age = |i: usize| self.seedlings[i].age;
        let mut rest: Vec<usize> = Vec::with_capacity(members.len());
        let reach = looks::reach(left.plant.as_ref()).max(looks::reach(right.plant.as_ref()));
        // Comparisons are for tolerances that are powers of two.
        let mut known: Vec<(i32, bool)> = Vec::new();
        for &i in members {
            let tolerance = sight.tolerance(&self.seedlings[i].placement, reach);
            let exponent = tolerance.max(f64::MIN_POSITIVE).log2().floor() as i32;
            let found = known.iter().find(|(known, _)| *known == exponent).map(|(_, alike)| *alike);
            let is_alike = halvings >= LEAST_HALVINGS
                && tolerance > 0.0
                && found.unwrap_or_else(|| {
                    let is_alike = alike(left, right, 2_f64.powi(exponent));
                    known.push((exponent, is_alike));
                    is_alike
                });
            if !is_alike {
                rest.push(i);
                continue;
            }
            let is_nearer_left = age(i) - left.kept.time <= right.kept.time - age(i);
            self.put(if is_nearer_left { left } else { right }, [i].into_iter(), grown);
        }
        let Some(&middle) = rest.get(rest.len() / 2) else { return Ok(()) };
        let look = self.look(middle, seed, left.kept.clone(), grown)?;
        let at = age(middle);
        self.put(&look, rest.iter().copied().filter(|&i| age(i) == at), grown);
        let [before, after] = [
            &rest[..rest.partition_point(|&i| age(i) < at)],
            &rest[rest.partition_point(|&i| age(i) <= at)..],
        ];
        self.share((seed, sight, halvings + 1), (left, &look), before, grown)?;
        self.share((seed, sight, halvings + 1), (&look, right), after, grown)
    }

    /// Puts a drawing in the places of plants.
    fn put(&self, look: &Look<'m>, members: impl Iterator<Item = usize>, grown: &mut Grown<'m>) {
        let Some(plant) = &look.plant else { return };
        grown.plants.extend(members.map(|i| {
            let Seedling { placement, owner, .. } = self.seedlings[i];
            (i, plant.twin(placement, owner))
        }));
    }

    /// The drawing at the age of a plant, by a simulation that is not older.
    fn look(
        &self,
        i: usize,
        seed: u64,
        mut kept: Kept<'m>,
        grown: &mut Grown<'m>,
    ) -> Result<Look<'m>, DrawError> {
        let seedling = &self.seedlings[i];
        kept.reach(self.plant(seedling.plant), seedling.age)?;
        let plant = self.draw(i, seed, &kept, grown)?;
        Ok(Look { kept, plant })
    }

    /// What a plant draws at its age; `None` if that is nothing.
    fn draw(
        &self,
        i: usize,
        seed: u64,
        kept: &Kept<'m>,
        grown: &mut Grown<'m>,
    ) -> Result<Option<Plant>, DrawError> {
        let seedling = &self.seedlings[i];
        let Seedling { plant: number, age, .. } = *seedling;
        let (plant, below) = (self.plant(number), &self.nursery.below[number]);
        let around = self.around.within(seedling, &plant.model);
        let mut scene = below.blank();
        scene.accuracy = self.accuracy;
        let bent = match self.motions.and_then(|motions| motions[i].as_deref()) {
            Some(motion) => Some(motion.at(&kept.string)?),
            None => None,
        };
        let strains = bent.as_ref().map(|bent| bent as &dyn Strains);
        if let Err(error) = below.draw_with((seed, &around), &kept.string, strains, &mut scene) {
            let inner = error.diagnostic();
            let message = format!("the plant `{}` cannot be drawn at its age {}", plant.name, brief(age, 6));
            let error = Diagnostic::error(message).at(plant.span, "this plant").note(inner.message);
            return Err(DrawError::Plant(Box::new(error)));
        }
        if let Some(warning) = scene.warnings.first().filter(|_| grown.warnings.is_empty()) {
            let message = format!("in the plant `{}`: {}", plant.name, warning.message);
            grown.warnings.push((plant.span, Diagnostic::warning(message).at(plant.span, "this plant")));
        }
        scene.warnings.clear();
        grown.lacked_accuracy |= scene.lacked_accuracy;
        // The surroundings are those of the outermost scene.
        scene.surroundings = Default::default();
        set_widths(&mut scene);
        // It is kept as long as the picture is made.
        scene.shrink_to_fit();
        let elements = count(&scene);
        if self.elements.fetch_add(elements, Ordering::Relaxed) + elements > MOST_ELEMENTS {
            // The same message whichever plant is drawn last.
            let what = format!("the plants of this scene have more than {MOST_ELEMENTS} pieces");
            return Err(too_many(self.plant(self.seedlings[0].plant), what));
        }
        if scene.is_empty() {
            return Ok(None);
        }
        Ok(Some(Plant::new(Arc::new(scene), seedling.placement, seedling.owner)))
    }
}

fn alike(left: &Look, right: &Look, tolerance: f64) -> bool {
    match (&left.plant, &right.plant) {
        (Some(a), Some(b)) => looks::alike(&a.scene, &b.scene, tolerance),
        (a, b) => a.is_none() && b.is_none(),
    }
}
