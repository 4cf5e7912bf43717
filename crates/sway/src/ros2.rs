//! One step of ROS2, and of the linearly implicit Euler method, which is its first stage with γ = 1.
//!
//! With u' = w and M w' = Q, the first stage solves `(M + γhD + γ²h²K) k = h Q + γh² Q_t - γh K h w`. The second would take the acceleration at
//! the predicted state from the mass matrix there, which would be another factorisation. Instead the equation is written for the
//! difference from k/h: with the residual `r = Q₁ - M₁ k/h` (inverse dynamics, in linear time), `M₀ a₁ = M₀ k/h + r` up to
//! `(M₁ - M₀)(a₁ - k/h)`, second order in h, so the step stays of order 2. And M₀ k follows from the first stage:
//! the second right-hand side for `k₂ + k` is `h r + γh D k + γh² K (w + (3γ - 1) k) - γh² Q_t`.

use crate::air::Wind;
use crate::forces::{Part, Stretch};
use crate::form::Twist;
use crate::link::{Link, Weights, pair, transport};
use crate::place::{Local, Strain};
use crate::sweep::{Bend, Instant, Power, Workspace, heat, part};
use crate::{Air, Skeleton, State, Vector};

/// γ of ROS2: 1 - 1/√2.
pub(crate) const GAMMA: f64 = 1.0 - std::f64::consts::FRAC_1_SQRT_2;

/// Largest error of a step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StepError {
    /// Displacement in m; NaN if any value is not finite.
    pub displacement: f64,
    pub segment: usize,
}

impl StepError {
    pub(crate) const ZERO: StepError = StepError { displacement: 0.0, segment: 0 };

    /// Takes a displacement into account. The first that is not a number stays.
    #[inline(always)]
    pub(crate) fn meet(&mut self, displacement: f64, segment: usize) {
        if !self.displacement.is_nan() && !(displacement <= self.displacement) {
            *self = StepError { displacement, segment };
        }
    }
}

impl Workspace {
    /// A step of ROS2 from `before` to `after`. The workspace fits the skeleton and has its rest moments.
    pub(crate) fn ros2<W: Wind>(
        &mut self,
        skeleton: &Skeleton,
        air: &Air,
        instant: Instant<'_, W>,
        before: &State,
        after: &mut State,
    ) -> StepError {
        let h = instant.to - instant.from;
        let step = GAMMA * h;
        let weights = Weights { mass: 1.0, damping: step, stiffness: step * step };
        let bend = Bend { strain: &before.strain, rate: &before.rate };
        let early = self.spread(skeleton, air, bend, instant, (h, step), &weights);
        self.gather(skeleton, &before.rate, &weights, step * h);
        let late = self.predict(skeleton, air, h, before);
        self.gather_difference(skeleton, h);
        after.work = before.work;
        after.work.wind += 0.5 * h * (early.wind + late.wind);
        after.work.dissipated += 0.5 * h * (early.dissipated + late.dissipated);
        self.finish(skeleton, h, before, after)
    }

    /// Solution of the first stage, places and residual forces at the predicted state, and the second right-hand side.
    fn predict(&mut self, skeleton: &Skeleton, air: &Air, h: f64, before: &State) -> Power {
        let segments = skeleton.segments();
        let step = GAMMA * h;
        let upwards = -air.gravity;
        let mut power = Power::default();
        for (index, segment) in segments.iter().enumerate() {
            let twist = self.base_twist(segment, index, segments);
            let link = &mut self.links[index];
            link.resolve(twist);
            let k = link.x;
            link.first = k;
            let w = if segment.rigid { Vector::zeros() } else { before.rate[index] };
            let strain = Strain {
                value: before.strain[index] + (w + k * GAMMA) * h,
                rate: w + k,
                acceleration: k / h,
            };
            let parent = segment.parent.map(|parent| &self.later[parent]);
            let (local, place) = Local::new(segment, parent, &upwards, &strain);
            let stretch = Stretch::new(&local);
            let part = part(skeleton, air, index);
            let wind = place.axes.tr_mul(&link.wind);
            let forces = part.forces(&local, &place, &stretch, &wind);
            let rigidity = segment.rigidity();
            power.wind += forces.power;
            power.dissipated += heat(segment, &rigidity, &strain.rate);
            let elastic = rigidity.component_mul(&(strain.value + strain.rate * segment.damping));
            link.late_wrench = forces.wrench;
            link.late_pull = forces.pull;
            // What of the right-hand side belongs to the first geometry.
            link.wrench.moment = link.gust.0.moment * -step;
            link.wrench.force = link.gust.0.force * -step;
            link.pull = link.gust.1 * -step - (elastic + self.rest_moments[index]) * h;
            link.pull += rigidity.component_mul(&k) * (step * segment.damping);
            let x = w + k * (3.0 * GAMMA - 1.0);
            link.pull += rigidity.component_mul(&x) * (step * h);
            let here = &self.places[index];
            let turn =
                here.spin - here.turning * (w * segment.length) + link.twist.angular * (3.0 * GAMMA - 1.0);
            link.press(step * h, segment.length, &turn, &x);
            self.drag_again(index, skeleton.first_plate(index), &part, step);
            self.later[index] = place;
        }
        power
    }

    /// Adds the product of the drag's matrix with the solution of the first stage.
    #[inline(always)]
    fn drag_again(&mut self, index: usize, first_plate: usize, part: &Part<'_>, step: f64) {
        let link = &mut self.links[index];
        let long = link.x * part.segment.length;
        let plates = &self.plate_dampers[first_plate..first_plate + part.plates.len()];
        let own = (part.segment.drag_diameter > 0.0).then_some(link.damper);
        for damper in own.iter().chain(plates) {
            let velocity = link.twist.at(&damper.place) + damper.shift * long;
            let force = damper.damping * velocity * step;
            link.wrench.push(&damper.place, &force);
            link.pull += damper.shift.tr_mul(&force);
        }
    }

    /// Sums residual forces in the second geometry, and eliminates the second right-hand side in the first.
    fn gather_difference(&mut self, skeleton: &Skeleton, h: f64) {
        for index in (0..skeleton.len()).rev() {
            let segment = &skeleton.segments()[index];
            let link = &mut self.links[index];
            link.pull += link.late_pull * h;
            link.reduce(segment.length);
            if let Some(parent) = segment.parent {
                let (onto, link) = pair(&mut self.links, parent, index);
                let (wrench, late) = (link.wrench, link.late_wrench);
                let (behind, own) = (&self.places[parent], &self.places[index]);
                Link::hand(&wrench, (&mut onto.wrench, &mut onto.pull), behind, own);
                let (behind, own) = (&self.later[parent], &self.later[index]);
                Link::hand(&late, (&mut onto.late_wrench, &mut onto.late_pull), behind, own);
            }
        }
    }

    /// Solution of the second stage, new state and error.
    fn finish(&mut self, skeleton: &Skeleton, h: f64, before: &State, after: &mut State) -> StepError {
        let segments = skeleton.segments();
        let step = GAMMA * h;
        let mut error = StepError::ZERO;
        for (index, segment) in segments.iter().enumerate() {
            let twist = self.base_twist(segment, index, segments);
            self.links[index].resolve(twist);
            let link = &mut self.links[index];
            let w = if segment.rigid { Vector::zeros() } else { before.rate[index] };
            let first = link.first;
            let second = link.x - first;
            let first_strain = w * h + first * step;
            let second_strain = (w + first) * h - first_strain * 2.0 + second * step;
            after.strain[index] = before.strain[index] + first_strain * 1.5 + second_strain * 0.5;
            after.rate[index] = w + first * 1.5 + second * 0.5;
            let x = [(first_strain + second_strain) * 0.5, (first + second) * (0.5 * h)];
            self.measure(index, segment.parent, segments, x, &mut error);
        }
        error
    }

    /// Displacement of the end of a segment by errors of strain.
    #[inline(always)]
    pub(crate) fn measure(
        &mut self,
        index: usize,
        parent: Option<usize>,
        segments: &[crate::Segment],
        x: [Vector; 2],
        error: &mut StepError,
    ) {
        let own = &self.places[index];
        if let Some(parent) = parent {
            let (before, link) = pair(&mut self.links, parent, index);
            let behind = &self.places[parent];
            for k in 0..2 {
                let length = segments[parent].length;
                link.errors[k] = transport(&before.errors[k], &before.error_x[k], length, behind, own);
            }
        } else {
            // Of another skeleton, this may have been a branch.
            self.links[index].errors = [Twist::ZERO; 2];
        }
        let link = &mut self.links[index];
        link.error_x = x;
        let length = segments[index].length;
        let [a, b] = [0, 1].map(|k| link.errors[k].at(&own.tip) + own.shift * (x[k] * length));
        error.meet(a.norm().max(b.norm()), index);
    }

    /// A step of the linearly implicit Euler method. Its error is half of the rate's change times h.
    pub(crate) fn euler<W: Wind>(
        &mut self,
        skeleton: &Skeleton,
        air: &Air,
        instant: Instant<'_, W>,
        before: &State,
        after: &mut State,
    ) -> StepError {
        let h = instant.to - instant.from;
        let weights = Weights { mass: 1.0, damping: h, stiffness: h * h };
        let bend = Bend { strain: &before.strain, rate: &before.rate };
        let power = self.spread(skeleton, air, bend, instant, (h, h), &weights);
        self.gather(skeleton, &before.rate, &weights, h * h);
        self.resolve(skeleton);
        after.work = before.work;
        after.work.wind += h * power.wind;
        after.work.dissipated += h * power.dissipated;
        let segments = skeleton.segments();
        let mut error = StepError::ZERO;
        for (index, segment) in segments.iter().enumerate() {
            let k = self.links[index].x;
            let w = if segment.rigid { Vector::zeros() } else { before.rate[index] };
            after.rate[index] = w + k;
            after.strain[index] = before.strain[index] + (w + k) * h;
            let x = [k * (0.5 * h), k * (0.5 * h)];
            self.measure(index, segment.parent, segments, x, &mut error);
        }
        error
    }
}
