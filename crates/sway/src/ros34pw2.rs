//! One step of ROS34PW2: order 3 with any matrix.
//!
//! Stages `k_i = h f(y + Σ α_ij k_j) + h W Σ γ_ij k_j`. The accelerations f come from the mass matrix at each stage, factorised there; so a step takes
//! five eliminations instead of one.

use crate::Wind;
use crate::carried::by_section;
use crate::link::{Weights, transport};
use crate::ros2::StepError;
use crate::sweep::{Bend, Instant, Workspace};
use crate::{Air, Skeleton, State, Vector};

const GAMMA: f64 = 0.435_866_521_508_459;
const ALPHA: [[f64; 3]; 4] = [
    [0.0, 0.0, 0.0],
    [0.871_733_043_016_918, 0.0, 0.0],
    [0.844_570_600_153_694_2, -0.112_990_642_364_841_85, 0.0],
    [0.0, 0.0, 1.0],
];
const COUPLING: [[f64; 3]; 4] = [
    [0.0, 0.0, 0.0],
    [-0.871_733_043_016_918, 0.0, 0.0],
    [-0.903_380_570_130_440_8, 0.054_180_672_388_095_326, 0.0],
    [0.242_123_807_060_953_46, -1.223_250_583_904_514_7, 0.545_260_255_335_102_1],
];
const WEIGHTS: [f64; 4] =
    [0.242_123_807_060_953_46, -1.223_250_583_904_514_7, 1.545_260_255_335_102, 0.435_866_521_508_459];
const EMBEDDED: [f64; 4] = [0.378_109_031_458_193_7, -0.096_042_292_212_423_18, 0.5, 0.217_933_260_754_229_5];

/// Increments of strain and rate in one stage.
#[derive(Clone, Debug, Default)]
struct Stage {
    strain: Vec<Vector>,
    rate: Vec<Vector>,
}

/// `Σ weights[j] stages[j]` for one segment, of strain and rate.
fn sum(stages: &[Stage], weights: &[f64], index: usize) -> (Vector, Vector) {
    let mut total = (Vector::zeros(), Vector::zeros());
    for (stage, weight) in stages.iter().zip(weights) {
        total.0 += stage.strain[index] * *weight;
        total.1 += stage.rate[index] * *weight;
    }
    total
}

impl Workspace {
    /// A step of ROS34PW2 from `before` to `after`; `aside` is a second workspace.
    pub(crate) fn ros34pw2<W: Wind>(
        &mut self,
        aside: &mut Workspace,
        skeleton: &Skeleton,
        air: &Air,
        instant: Instant<'_, W>,
        before: &State,
        after: &mut State,
    ) -> StepError {
        let h = instant.to - instant.from;
        let step = GAMMA * h;
        aside.fit(skeleton);
        aside.rest_moments.clone_from(&self.rest_moments);
        aside.rotary.clone_from(&self.rotary);
        let weights = Weights { mass: 1.0, damping: step, stiffness: step * step, extra: 0.0, blur: 0.0 };
        let bend = Bend { strain: &before.strain, rate: &before.rate };
        self.spread(skeleton, air, bend, instant, (0.0, 0.0), &weights);
        self.gather(skeleton, &before.rate, &weights, 0.0);
        let n = skeleton.len();
        let mut stages: Vec<Stage> = Vec::with_capacity(4);
        let mut bent = Stage::default();
        after.work = before.work;
        for i in 0..4 {
            bent.strain.clear();
            bent.rate.clear();
            for index in 0..n {
                let (strain, rate) = sum(&stages, &ALPHA[i], index);
                bent.strain.push(before.strain[index] + strain);
                bent.rate.push(before.rate[index] + rate);
            }
            let at = instant.from + h * ALPHA[i].iter().sum::<f64>();
            let now = Instant { wind: instant.wind, from: at, to: at };
            let explicit = Weights { mass: 1.0, damping: 0.0, stiffness: 0.0, extra: 0.0, blur: 0.0 };
            let bend = Bend { strain: &bent.strain, rate: &bent.rate };
            let power = aside.spread(skeleton, air, bend, now, (1.0, 0.0), &explicit);
            aside.gather(skeleton, &bent.rate, &explicit, 0.0);
            aside.resolve(skeleton);
            after.work.wind += WEIGHTS[i] * h * power.wind;
            after.work.dissipated += WEIGHTS[i] * h * power.dissipated;
            self.inertia(skeleton, air, &before.strain, |index| aside.links[index].x);
            let lag = GAMMA + COUPLING[i].iter().sum::<f64>();
            self.stage_load(skeleton, h, lag, &stages, &COUPLING[i], &bent.rate);
            self.gather_again(skeleton);
            self.resolve(skeleton);
            let mut stage = Stage::default();
            for index in 0..n {
                let k = self.links[index].x;
                let turned = sum(&stages, &COUPLING[i], index).1;
                stage.rate.push(k);
                stage.strain.push((bent.rate[index] + turned) * h + k * step);
            }
            stages.push(stage);
        }
        self.end(skeleton, h, before, after, &stages)
    }

    /// Right-hand side of a stage: `h M a` (in `late_pull`), and the products of damping and stiffness with the earlier stages.
    fn stage_load(
        &mut self,
        skeleton: &Skeleton,
        h: f64,
        lag: f64,
        stages: &[Stage],
        coupling: &[f64; 3],
        rates: &[Vector],
    ) {
        let segments = skeleton.segments();
        for (index, segment) in segments.iter().enumerate() {
            let (strain, rate) = sum(stages, coupling, index);
            let pressed = strain * h + (rates[index] + rate) * (h * h * GAMMA);
            let slowed = rate * h;
            let fields = match segment.parent {
                None => [crate::form::Twist::ZERO; 2],
                Some(parent) => [0, 1].map(|k| {
                    let link = &self.links[parent];
                    let length = segments[parent].length;
                    let (behind, own) = (&self.places[parent], &self.places[index]);
                    transport(&link.errors[k], &link.error_x[k], length, behind, own)
                }),
            };
            let link = &mut self.links[index];
            link.errors = fields;
            link.error_x = [pressed, slowed];
            let rigidity = segment.rigidity();
            link.wrench.moment = link.gust.0.moment * (h * lag);
            link.wrench.force = link.gust.0.force * (h * lag);
            link.pull = link.gust.1 * (h * lag) - link.late_pull * h;
            link.pull -= rigidity.component_mul(&(pressed + slowed * segment.damping));
            link.press(-1.0, segment.length, &fields[0].angular, &pressed);
            let first = skeleton.first_plate(index);
            let (damper, long) = (link.damper, slowed * segment.length);
            let velocity = fields[1].at(&damper.place) + damper.shift * long;
            let force = -(damper.damping * velocity);
            link.wrench.push(&damper.place, &force);
            link.pull += damper.shift.tr_mul(&force);
            let sections = by_section(skeleton.plates(index)).count();
            for drag in &self.plate_drags[first..first + sections] {
                let (wrench, pull) = drag.force(&fields[1], &long);
                link.wrench.moment += wrench.moment;
                link.wrench.force += wrench.force;
                link.pull += pull;
            }
        }
    }

    fn end(
        &mut self,
        skeleton: &Skeleton,
        h: f64,
        before: &State,
        after: &mut State,
        stages: &[Stage],
    ) -> StepError {
        let mut error = StepError::ZERO;
        for link in &mut self.links {
            link.errors = [crate::form::Twist::ZERO; 2];
        }
        let segments = skeleton.segments();
        for (index, segment) in segments.iter().enumerate() {
            let (strain, rate) = sum(stages, &WEIGHTS, index);
            let (other, other_rate) = sum(stages, &EMBEDDED, index);
            after.strain[index] = before.strain[index] + strain;
            after.rate[index] = before.rate[index] + rate;
            let x = [strain - other, (rate - other_rate) * self.horizon.max(h)];
            self.measure(index, segment.parent, segments, x, &mut error);
        }
        error
    }
}
