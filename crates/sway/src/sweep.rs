//! Passes over the tree: places and forces from the roots to the tips, elimination back.

use crate::Wind;
use crate::carried::PlateDrag;
use crate::forces::{Damper, Forces, Part, Stretch};
use crate::form::{Twist, Wrench};
use crate::link::{Link, Weights, pair, transport};
use crate::place::{Local, Place, Strain};
use crate::rotary::Beyond;
use crate::{Air, Segment, Skeleton, Vector};

/// Working memory for one skeleton.
#[derive(Clone, Debug, Default)]
pub(crate) struct Workspace {
    pub links: Vec<Link>,
    pub places: Vec<Place>,
    /// Places of the second stage.
    pub later: Vec<Place>,
    /// Of the sections of each segment that carry plates, from the number of its first plate on.
    pub plate_drags: Vec<PlateDrag>,
    /// Moments of the weight on the rest shape, where that is an equilibrium.
    pub rest_moments: Vec<Vector>,
    /// Moment of inertia of each segment about its tangent in addition to that of its sections, in kg m².
    pub rotary: Vec<f64>,
    pub beyond: Vec<Beyond>,
    /// The time over which an error of a velocity counts as a displacement, in s.
    pub horizon: f64,
}

/// When and for how long the wind is sampled.
pub(crate) struct Instant<'a, W> {
    pub wind: &'a W,
    pub from: f64,
    pub to: f64,
}

impl<W> Clone for Instant<'_, W> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<W> Copy for Instant<'_, W> {}

/// Strain and rate of all segments.
#[derive(Clone, Copy)]
pub(crate) struct Bend<'a> {
    pub strain: &'a [Vector],
    pub rate: &'a [Vector],
}

/// Power at an instant, in W.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Power {
    pub wind: f64,
    pub dissipated: f64,
}

/// A segment with what it carries.
#[inline(always)]
pub(crate) fn part<'a>(skeleton: &'a Skeleton, air: &'a Air, rotary: &[f64], index: usize) -> Part<'a> {
    Part {
        segment: &skeleton.segments()[index],
        loads: skeleton.loads(index),
        plates: skeleton.plates(index),
        air,
        rotary: rotary[index],
    }
}

/// Heat in the tissue of a segment, in W.
#[inline(always)]
pub(crate) fn heat(segment: &Segment, rigidity: &Vector, rate: &Vector) -> f64 {
    segment.length * segment.damping * rigidity.component_mul(rate).dot(rate)
}

impl Workspace {
    /// Makes room for a skeleton.
    pub(crate) fn fit(&mut self, skeleton: &Skeleton) {
        let n = skeleton.len();
        self.links.resize(n, Link::ZERO);
        self.places.resize(n, Place::ZERO);
        self.later.resize(n, Place::ZERO);
        self.rest_moments.resize(n, Vector::zeros());
        self.rotary.resize(n, 0.0);
        self.plate_drags.resize(skeleton.plate_count(), PlateDrag::ZERO);
    }

    /// Moments of the weight on the rest shape: what the tissue of segments without `sag` carries when they are at rest.
    pub(crate) fn weigh(&mut self, skeleton: &Skeleton, air: &Air) {
        if skeleton.segments().iter().all(|segment| segment.sag) {
            self.rest_moments.fill(Vector::zeros());
            return;
        }
        self.still_loads(skeleton, air, &air.gravity, |_| (Vector::zeros(), Vector::zeros()));
        for (index, segment) in skeleton.segments().iter().enumerate() {
            let moment = self.links[index].late_pull;
            self.rest_moments[index] = if segment.sag { Vector::zeros() } else { moment };
        }
    }

    /// Minus the product of the mass matrix at a strain with accelerations, in `late_pull`.
    pub(crate) fn inertia(
        &mut self,
        skeleton: &Skeleton,
        air: &Air,
        strain: &[Vector],
        acceleration: impl Fn(usize) -> Vector,
    ) {
        self.still_loads(skeleton, air, &Vector::zeros(), |index| (strain[index], acceleration(index)));
    }

    /// Moments on all strains, in `late_pull`, of weight and of inertia in a skeleton that is held still: of strains and accelerations only.
    fn still_loads(
        &mut self,
        skeleton: &Skeleton,
        air: &Air,
        gravity: &Vector,
        strain: impl Fn(usize) -> (Vector, Vector),
    ) {
        let zero = Vector::zeros();
        for index in 0..skeleton.len() {
            let whole = part(skeleton, air, &self.rotary, index);
            let mut segment = whole.segment.held();
            segment.drag_diameter = 0.0;
            let (value, acceleration) = strain(index);
            let strain = Strain { value, rate: zero, acceleration };
            let parent = segment.parent.map(|parent| &self.later[parent]);
            let (local, place) = Local::new(&segment, parent, &-gravity, &strain);
            let stretch = Stretch::new(&local);
            let bare = Part { segment: &segment, plates: &[], ..whole };
            let forces = bare.forces(&local, &place, &stretch, &zero);
            self.later[index] = place;
            self.links[index].late_wrench = forces.wrench;
            self.links[index].late_pull = forces.pull;
        }
        self.gather_late(skeleton);
    }

    /// Sums the wrenches of the second geometry towards the roots; `late_pull` becomes the moment on each strain.
    fn gather_late(&mut self, skeleton: &Skeleton) {
        for index in (0..skeleton.len()).rev() {
            if let Some(parent) = skeleton.segments()[index].parent {
                let (onto, link) = pair(&mut self.links, parent, index);
                Link::hand(
                    &link.late_wrench,
                    (&mut onto.late_wrench, &mut onto.late_pull),
                    &self.later[parent],
                    &self.later[index],
                );
            }
        }
    }

    /// First pass: places and velocities, forces times `scale` plus the change of the drag times `gust`, forms of mass and damping.
    pub(crate) fn spread<W: Wind>(
        &mut self,
        skeleton: &Skeleton,
        air: &Air,
        bend: Bend<'_>,
        instant: Instant<'_, W>,
        (scale, gust): (f64, f64),
        weights: &Weights,
    ) -> Power {
        let upwards = -air.gravity;
        let mut power = Power::default();
        for index in 0..skeleton.len() {
            let part = part(skeleton, air, &self.rotary, index);
            let segment = part.segment;
            let rate = if segment.rigid { Vector::zeros() } else { bend.rate[index] };
            let strain = Strain { value: bend.strain[index], rate, acceleration: Vector::zeros() };
            let parent = segment.parent.map(|parent| &self.places[parent]);
            let (local, place) = Local::new(segment, parent, &upwards, &strain);
            let stretch = Stretch::new(&local);
            let link = &mut self.links[index];
            let mut wind = Vector::zeros();
            link.gust = (Wrench::ZERO, Vector::zeros());
            link.wind = Vector::zeros();
            let blown = part.feels_air();
            if blown {
                let (middle, velocity) = stretch.middle();
                let point = place.origin + place.axes * middle;
                wind = place.axes.tr_mul(&instant.wind.velocity(point, instant.from));
                if instant.to != instant.from {
                    let ahead = point + place.axes * velocity * (instant.to - instant.from);
                    link.wind = instant.wind.velocity(ahead, instant.to);
                    let later = place.axes.tr_mul(&link.wind);
                    link.gust = part.gust(&local, &stretch, [&wind, &later]);
                }
            }
            let forces = part.forces(&local, &place, &stretch, &wind);
            power.wind += forces.power;
            let rigidity = segment.rigidity();
            power.dissipated += heat(segment, &rigidity, &strain.rate);
            let elastic = rigidity.component_mul(&(strain.value + strain.rate * segment.damping));
            link.load(&forces, scale);
            link.pull -= (elastic + self.rest_moments[index]) * scale;
            link.wrench.moment += link.gust.0.moment * gust;
            link.wrench.force += link.gust.0.force * gust;
            link.pull += link.gust.1 * gust;
            link.form = part.mass_form(&local, &stretch);
            if weights.mass != 1.0 {
                link.form.scale(weights.mass);
            }
            part.blur(&mut link.form, &stretch, weights.blur * place.flow.linear.norm_squared());
            link.damper = Damper::ZERO;
            if blown && weights.damping != 0.0 {
                link.damper = part.damper(&local, &stretch, &wind);
                let damper = &link.damper;
                link.form.damper(&(damper.damping * weights.damping), &damper.place, &damper.shift);
                let first = skeleton.first_plate(index);
                for (drag, kept) in part.plate_drag(&local, &wind).zip(&mut self.plate_drags[first..]) {
                    drag.put_into(&mut link.form, weights.damping);
                    *kept = drag;
                }
            }
            self.places[index] = place;
        }
        power
    }

    /// Second pass: eliminates matrix and right-hand side towards the roots. The right-hand side loses `pressed` times the stiffness times the
    /// rate of strain. Returns whether the matrix has the geometric stiffness of every segment.
    pub(crate) fn gather(
        &mut self,
        skeleton: &Skeleton,
        rate: &[Vector],
        weights: &Weights,
        pressed: f64,
    ) -> bool {
        let mut whole = true;
        for index in (0..skeleton.len()).rev() {
            let segment = &skeleton.segments()[index];
            let place = &self.places[index];
            let rigidity = segment.rigidity();
            let link = &mut self.links[index];
            if weights.stiffness != 0.0 && !segment.rigid {
                link.stiffen(place);
            }
            let material = rigidity * (weights.damping * segment.damping + weights.stiffness + weights.extra);
            whole &= link.eliminate(segment.length, &material, weights.stiffness, segment.rigid);
            if pressed != 0.0 && !segment.rigid {
                let x = &rate[index];
                let turn = place.flow.angular - place.turning * (x * segment.length);
                link.pull -= rigidity.component_mul(x) * pressed;
                link.press(-pressed, segment.length, &turn, x);
            }
            link.reduce(segment.length);
            if let Some(parent) = segment.parent {
                let (onto, link) = pair(&mut self.links, parent, index);
                link.hand_form(onto, &self.places[parent], place);
                let wrench = link.wrench;
                Link::hand(&wrench, (&mut onto.wrench, &mut onto.pull), &self.places[parent], place);
            }
        }
        whole
    }

    /// Eliminates another right-hand side, that of `wrench` and `pull`.
    pub(crate) fn gather_again(&mut self, skeleton: &Skeleton) {
        for index in (0..skeleton.len()).rev() {
            let segment = &skeleton.segments()[index];
            let link = &mut self.links[index];
            link.reduce(segment.length);
            if let Some(parent) = segment.parent {
                let (onto, link) = pair(&mut self.links, parent, index);
                let wrench = link.wrench;
                Link::hand(
                    &wrench,
                    (&mut onto.wrench, &mut onto.pull),
                    &self.places[parent],
                    &self.places[index],
                );
            }
        }
    }

    /// Velocity of the base of a segment in the field of a solution.
    #[inline(always)]
    pub(crate) fn base_twist(&self, segment: &Segment, index: usize, lengths: &[Segment]) -> Twist {
        match segment.parent {
            None => Twist::ZERO,
            Some(parent) => {
                let before = &self.links[parent];
                let length = lengths[parent].length;
                transport(&before.twist, &before.x, length, &self.places[parent], &self.places[index])
            }
        }
    }

    /// Last pass: solves for the rate of each strain, `links[i].x`.
    pub(crate) fn resolve(&mut self, skeleton: &Skeleton) {
        let segments = skeleton.segments();
        for (index, segment) in segments.iter().enumerate() {
            let twist = self.base_twist(segment, index, segments);
            self.links[index].resolve(twist);
        }
    }
}

impl Link {
    /// Takes forces, times `scale`, as the right-hand side, and their geometric sums.
    #[inline(always)]
    pub(crate) fn load(&mut self, forces: &Forces, scale: f64) {
        self.wrench = Wrench { moment: forces.wrench.moment * scale, force: forces.wrench.force * scale };
        self.pull = forces.pull * scale;
        self.thrust = forces.wrench.force;
        self.virial = forces.virial;
        self.mean = forces.mean;
        self.late = forces.late;
    }
}
