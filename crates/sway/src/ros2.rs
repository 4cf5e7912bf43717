//! One step of ROS2 with its second stage in the middle, and of the linearly implicit Euler method, which is its first stage with γ = 1.
//!
//! All methods of two stages and order 2 for any matrix W have the same stability function; they differ in the place of the second stage,
//! y + α k. With α = 1 the stage multiplies stiff motion by 1 - 1/γ = -2.4, and the centrifugal forces of that are larger than what the step
//! damps: thin stems that twist blow up. With α = ½ it is -0.7. So
//!
//! ```text
//! (1 - γhW) k₁ = h f(t, y) + γh² f_t
//! (1 - γhW) k₂ = h f(t + h/2, y + k₁/2) - γhW k₁
//! y₁ = y + k₂,  error: k₂ - k₁
//! ```
//!
//! With u' = w and M w' = Q, the first stage solves `(M + γhD + γ²h²K) k = h Q + γh² Q_t - γh K h w`. The second would take the acceleration at
//! its state from the mass matrix there, which would be another factorisation. Instead it is written for the difference z = k₂ - k₁:
//! with the residual `r = Q₁ - M₁ k/h` (inverse dynamics, in linear time), `M₀ a₁ = M₀ k/h + r` up to `(M₁ - M₀)(a₁ - k/h)`, of second order
//! in h, so the step stays of order 2. All products with D cancel: `(M + γhD + γ²h²K) z = h r - γ(½ - γ) h² K k`.

use crate::Wind;
use crate::forces::Stretch;
use crate::form::{Twist, Wrench};
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
        if !self.displacement.is_nan() && (displacement.is_nan() || displacement > self.displacement) {
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
        let weights =
            Weights { mass: 1.0, damping: step, stiffness: step * step, extra: 0.0, blur: 2.0 * h * h };
        let bend = Bend { strain: &before.strain, rate: &before.rate };
        let middle = Instant { to: instant.from + 0.5 * h, ..instant };
        self.spread(skeleton, air, bend, middle, (h, 2.0 * step), &weights);
        self.gather(skeleton, &before.rate, &weights, step * h);
        let power = self.predict(skeleton, air, h, before);
        self.gather_difference(skeleton, h);
        after.work = before.work;
        after.work.wind += h * power.wind;
        after.work.dissipated += h * power.dissipated;
        self.finish(skeleton, h, before, after)
    }

    /// Solution of the first stage, places and residual forces at the predicted state, and the second right-hand side.
    fn predict(&mut self, skeleton: &Skeleton, air: &Air, h: f64, before: &State) -> Power {
        let segments = skeleton.segments();
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
                value: before.strain[index] + (w + k * GAMMA) * (0.5 * h),
                rate: w + k * 0.5,
                acceleration: k / h,
            };
            let parent = segment.parent.map(|parent| &self.later[parent]);
            let (local, place) = Local::new(segment, parent, &upwards, &strain);
            let stretch = Stretch::new(&local);
            let part = part(skeleton, air, &self.rotary, index);
            let wind = place.axes.tr_mul(&link.wind);
            let forces = part.forces(&local, &place, &stretch, &wind);
            let rigidity = segment.rigidity();
            power.wind += forces.power;
            power.dissipated += heat(segment, &rigidity, &strain.rate);
            let elastic = rigidity.component_mul(&(strain.value + strain.rate * segment.damping));
            link.late_wrench = forces.wrench;
            link.late_pull = forces.pull;
            // The part of the right-hand side that belongs to the first geometry.
            let pressed = GAMMA * (0.5 - GAMMA) * h * h;
            link.wrench = Wrench::ZERO;
            link.pull = (elastic + self.rest_moments[index]) * -h - rigidity.component_mul(&k) * pressed;
            let turn = link.twist.angular;
            link.press(-pressed, segment.length, &turn, &k);
            self.later[index] = place;
        }
        power
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
        let horizon = self.horizon.max(h);
        for (index, segment) in segments.iter().enumerate() {
            let twist = self.base_twist(segment, index, segments);
            self.links[index].resolve(twist);
            let link = &mut self.links[index];
            let w = if segment.rigid { Vector::zeros() } else { before.rate[index] };
            let first = link.first;
            let second = link.x + first;
            let first_strain = w * h + first * step;
            let second_strain = (w + first * (0.5 - GAMMA)) * h + second * step;
            after.strain[index] = before.strain[index] + second_strain;
            after.rate[index] = w + second;
            let x = [second_strain - first_strain, link.x * horizon];
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
        let weights = Weights { mass: 1.0, damping: h, stiffness: h * h, extra: 0.0, blur: 2.0 * h * h };
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
            let x = [k * (0.5 * h), k * (0.5 * self.horizon.max(h))];
            self.measure(index, segment.parent, segments, x, &mut error);
        }
        error
    }
}
