//! What can be said of the stems of a string before they are simulated: axes, their natural frequencies, and their stability.
//!
//! An axis is a stem with its continuations outside brackets. It is judged with what it carries, which is rigid for this purpose, and clamped
//! where it begins.

use dlsys_geometry::turtle;
use dlsys_model::{KindId, Model};
use dlsys_sway::{self as sway, Air, Joint, Segment, Solver, State, Still};
use dlsys_tree::ModuleString;

use crate::Error;
use crate::body::{Body, frame};

/// A stem with its continuations outside brackets. Values are in SI.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// The kinds of the modules that draw it, from the base on, each once.
    pub kinds: Vec<KindId>,
    /// Number of the tissue at its base among those of the model, from 0.
    pub tissue: usize,
    /// Number of brackets of the string around its first module.
    pub depth: usize,
    /// Number of segments.
    pub segments: usize,
    /// Length in m.
    pub length: f64,
    /// Diameter at the base in m.
    pub width: f64,
    /// Mass of the axis itself in kg.
    pub mass: f64,
    /// Mass of all that it carries in kg: branches, leaves, flowers, rigid parts.
    pub carried: f64,
    /// Drag coefficients times areas that face a wind across, of the axis and of what it carries, in m².
    pub drag: f64,
    /// Bending stiffness EI at the base, in N m².
    pub rigidity: f64,
    /// Number of its first stem in the skeleton.
    first: usize,
}

impl Axis {
    /// Cauchy's number in a wind of this speed (m/s): drag relative to the elastic restoring force, ½ ρ C A U² L²/EI (de Langre, *Effects
    /// of Wind on Plants*, Annu. Rev. Fluid Mech. 40, 2008). Above 1, bending is large.
    pub fn cauchy_number(&self, air: &Air, speed: f64) -> f64 {
        0.5 * air.density * self.drag * speed * speed * self.length * self.length / self.rigidity
    }
}

/// How an axis vibrates and stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vibration {
    /// First natural frequency in Hz, under the weight; 0 if the axis is not stable.
    pub frequency: f64,
    /// Damping ratio of that vibration by the tissue.
    pub damping: f64,
    /// Length of the axis relative to Greenhill's, at which a stem of the same proportions buckles under its own weight and its loads;
    /// 0 if no weight buckles it. Above 1, it does not stand.
    pub greenhill: f64,
}

/// The axes of a string.
#[derive(Clone, Debug)]
pub struct Survey {
    body: Body,
    axes: Vec<Axis>,
    /// The axis of each stem.
    owners: Vec<usize>,
}

impl Survey {
    /// The axes of a string of a model.
    ///
    /// # Errors
    /// A module that cannot be drawn.
    pub fn new(model: &Model, string: &ModuleString) -> Result<Survey, Error> {
        let body = body(model, string)?;
        let owners = owners(&body);
        let mut axes: Vec<Axis> = Vec::new();
        for (i, (stem, segment)) in body.stems.iter().zip(body.skeleton.segments()).enumerate() {
            if owners[i] == axes.len() {
                axes.push(Axis {
                    kinds: Vec::new(),
                    tissue: stem.tissue,
                    depth: stem.depth,
                    segments: 0,
                    length: 0.0,
                    width: segment.diameter,
                    mass: 0.0,
                    carried: 0.0,
                    drag: 0.0,
                    rigidity: segment.rigidity().y,
                    first: i,
                });
            }
            let axis = &mut axes[owners[i]];
            axis.segments += 1;
            axis.length += segment.length;
            axis.mass += segment.mass * segment.length;
            if !axis.kinds.contains(&stem.origin.kind) {
                axis.kinds.push(stem.origin.kind);
            }
        }
        let mut survey = Survey { body, axes, owners };
        survey.weigh();
        Ok(survey)
    }

    /// Adds what each axis carries, from the tips to the base.
    fn weigh(&mut self) {
        let air = Air::default();
        let skeleton = &self.body.skeleton;
        // Mass and drag of a stem and of all that it carries.
        let mut total = vec![(0.0, 0.0); skeleton.len()];
        for (i, segment) in skeleton.segments().iter().enumerate().rev() {
            let loads: f64 = skeleton.loads(i).iter().map(|load| load.mass).sum();
            let plates: f64 = skeleton.plates(i).iter().map(|plate| plate.area).sum();
            total[i].0 += segment.mass * segment.length + loads;
            total[i].1 += air.cylinder * segment.drag_diameter * segment.length + air.normal * plates;
            if let Some(parent) = segment.parent {
                let (mass, drag) = total[i];
                total[parent] = (total[parent].0 + mass, total[parent].1 + drag);
            }
        }
        for axis in &mut self.axes {
            let (mass, drag) = total[axis.first];
            (axis.carried, axis.drag) = ((mass - axis.mass).max(0.0), drag);
        }
    }

    /// The axes, in the order of their bases in the string.
    pub fn axes(&self) -> &[Axis] {
        &self.axes
    }

    /// Vibration and stability of an axis, by its number; `None` if it has no length, no mass or no stiffness.
    pub fn vibration(&self, axis: usize) -> Option<Vibration> {
        let first = self.axes.get(axis)?.first;
        let stem = &self.body.stems[first];
        let (mut part, members) =
            self.body.skeleton.subtree(first, Joint::fixed(frame(stem.axes), sway::Vector::zeros()));
        for (segment, member) in part.segments_mut().iter_mut().zip(members) {
            segment.rigid = self.owners[member] != axis;
        }
        let mut solver = Solver::new(sway::Settings::default());
        let mut state = State::at_rest(&part);
        let sags = |segment: &Segment| segment.sag && !segment.rigid;
        // A start that is exactly symmetric would stay upright where that is not stable.
        let aside = 1e-3 / self.axes[axis].length.max(f64::MIN_POSITIVE);
        state.strain.fill(sway::Vector::new(0.0, aside, aside));
        if !part.segments().iter().any(sags) || solver.equilibrium(&part, &mut state, &Still, 0.0).is_err() {
            state = State::at_rest(&part);
        }
        let mode = solver.modes(&part, &state.strain, 1).ok()?.into_iter().next()?;
        let greenhill = solver.greenhill_ratio(&part).ok()?;
        Some(Vibration { frequency: mode.frequency(), damping: mode.damping, greenhill })
    }
}

/// The axis of each stem, numbered in the order of their bases.
fn owners(body: &Body) -> Vec<usize> {
    // The stem that continues each one: the straightest of those outside further brackets.
    let mut next: Vec<Option<(usize, f64)>> = vec![None; body.stems.len()];
    for (i, stem) in body.stems.iter().enumerate() {
        let Some(parent) = stem.parent.filter(|parent| body.stems[*parent].depth == stem.depth) else {
            continue;
        };
        let along = stem.axes[0].dot(&body.stems[parent].end_axes[0]);
        if next[parent].is_none_or(|(_, best)| along > best) {
            next[parent] = Some((i, along));
        }
    }
    let (mut owners, mut count) = (Vec::with_capacity(body.stems.len()), 0);
    for (i, stem) in body.stems.iter().enumerate() {
        let continued = stem.parent.filter(|parent| next[*parent].is_some_and(|(child, _)| child == i));
        owners.push(match continued {
            Some(parent) => owners[parent],
            None => {
                count += 1;
                count - 1
            }
        });
    }
    owners
}

fn body(model: &Model, string: &ModuleString) -> Result<Body, Error> {
    let noted = turtle::skeleton(model, string, &mut turtle::blank(model))?;
    Body::new(noted, model, (model.scenery.units.length, string.time))
}

/// Whether growth moves any stem, or what it carries, between two strings of a model, the second a little later than the first.
///
/// # Errors
/// A module that cannot be drawn.
pub fn moves(model: &Model, earlier: &ModuleString, now: &ModuleString) -> Result<bool, Error> {
    let mut later = body(model, now)?;
    later.move_from(&body(model, earlier)?, (now.time - earlier.time) * model.scenery.units.time);
    Ok(later.moves())
}
