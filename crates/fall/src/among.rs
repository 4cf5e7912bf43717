//! Steps among solids: flight up to an impact, contact with what stands or moves, rest until something near changes.
//!
//! A step in flight ends where the body touches something, located by [`Rules::first_touch`]. A step in contact gets impulses by which nothing sinks into what it
//! touches up to the place that this has at the end of the step; and the same search shows that the step passes through nothing, or it is repeated in a shorter one.

use std::sync::Arc;

use crate::approach::Touch;
use crate::contact::REBOUNDS;
use crate::fall::{FINAL, Phase, Rules, State};

use crate::impulse::{Bound, Carrier, collide};
use crate::pairs::{Facing, SKIN, Scene};
use crate::step::Step;
use crate::{Error, Motion, Span, Vector, Wind};

/// Levels by which a step in contact may be shorter than usual, if it would pass through something.
const FINER: u32 = 8;
/// The speed at which a body lies still, in parts of that below which it does not rebound.
const CALM: f64 = 0.1;
/// How far a body that is carried may move relative to what carries it in a long step, in parts of the error of a position that is allowed.
const CARRIED: f64 = 0.1;
/// The depth of what is squeezed, in the same parts: it passes through.
const SQUEEZED: f64 = 10.0;

/// Air that moves with what a body touches.
struct Layer(Vector);

impl Wind for Layer {
    fn velocity(&self, _: Vector, _: f64) -> Vector {
        self.0
    }
}

/// A try of a step in contact.
struct Slide {
    step: Step,
    after: Motion,
    /// What pushed most.
    pushed: Option<usize>,
    /// How far it has moved relative to that, in m.
    moved: f64,
}

impl Rules {
    /// The next step among the solids of a span, and the state after it.
    pub(crate) fn pass(
        &self,
        span: &Arc<Span>,
        state: &State,
        wind: &impl Wind,
    ) -> Result<(Step, State), Error> {
        let state = self.passing_through(span, state);
        match state.phase {
            Phase::Rest => match self.stay(span, &state) {
                Some(still) => Ok(still),
                None => self.touch(span, &State { phase: Phase::Contact, calm: 0.0, ..state }, wind),
            },
            Phase::Contact => self.touch(span, &state, wind),
            Phase::Flight => self.soar(span, &state, wind),
        }
    }

    /// The state with the solids that the body passes through: those that it overlaps where it is let go, or where they appear, and has not left.
    fn passing_through(&self, span: &Span, state: &State) -> State {
        let begins = state.steps == 0;
        let appears = |index: &usize| begins || state.time <= span.begin() && span.solids()[*index].is_new;
        let near = span.near(self.ball(&state.motion, 0.0), &[]);
        let known = |index: &usize| state.ignored.contains(&span.solids()[*index].number);
        let near: Vec<usize> = near.into_iter().filter(|index| appears(index) || known(index)).collect();
        if near.is_empty() && state.ignored.is_empty() {
            return state.clone();
        }
        let scene = Scene { rules: self, span, near: &near };
        // A body may lie on something where it is let go, up to what rounding makes of it.
        let all = scene.overlapped(&state.motion, state.time, 0.0);
        let deep = scene.overlapped(&state.motion, state.time, (SKIN + 1.0) * self.resolution());
        let stays = |number: &u64| state.ignored.contains(number) || deep.contains(number);
        State { ignored: all.into_iter().filter(stays).collect(), ..state.clone() }
    }

    /// A step at rest to the end of the span; `None` if something near moves, or is not what it was.
    fn stay(&self, span: &Span, state: &State) -> Option<(Step, State)> {
        let near = span.near(self.ball(&state.motion, 0.0), &state.ignored);
        let print = print(span, &near);
        if near.iter().any(|index| !span.swept(*index).is_still)
            || print != state.support
            || !self.is_held(state)
        {
            return None;
        }
        let support = if span.is_last() { FINAL } else { print };
        let step = Step::new(state.time, state.motion, span.end(), state.motion);
        Some((step, State { time: span.end(), support, ..state.clone() }))
    }

    /// The solids that a body may come to in a step.
    fn around(&self, span: &Span, step: &Step, ignored: &[u64]) -> Vec<usize> {
        let way = step.speed() * (step.end - step.start);
        span.near(self.ball(&step.first, way), ignored)
    }

    /// What the body meets first in a step: a solid, or soil that is not level.
    fn first_met(&self, step: &Step, (span, near): (&Span, &[usize]), (depth, sunk): (f64, bool)) -> Touch {
        let solid = self.first_touch(step, (span, near), (depth, sunk));
        let soil = self.first_soil(step, (depth, sunk));
        let time = |touch| match touch {
            Touch::Nothing => f64::INFINITY,
            Touch::At(time) | Touch::Until(time) => time,
        };
        if time(soil) < time(solid) { soil } else { solid }
    }

    /// A step in flight, up to the next impact at most.
    fn soar(&self, span: &Span, state: &State, wind: &impl Wind) -> Result<(Step, State), Error> {
        let (step, next) = self.free_step((state, span.end()), wind)?;
        let near = self.around(span, &step, &state.ignored);
        let ground = self.ground.and_then(|ground| ground.first_contact(&step, &self.body, self.depth()));
        let solid = match self.first_met(&step, (span, &near), (self.depth(), false)) {
            // No further than rounding allows.
            Touch::Until(time) if time - step.start <= 1e-6 * (step.end - step.start) => Touch::At(time),
            touch => touch,
        };
        let (time, strikes) = match (ground, solid) {
            (None, Touch::Nothing) => return Ok((step, State { halted: false, ..next })),
            (None, Touch::At(time)) => (time, true),
            (None, Touch::Until(time)) => (time, false),
            (Some(time), Touch::Nothing) => (time, true),
            (Some(ground), Touch::At(time)) => (time.min(ground), true),
            (Some(ground), Touch::Until(time)) => (time.min(ground), ground <= time),
        };
        let step = step.until(time);
        let there = State { time, motion: step.last, level: next.level, rate: None, ..state.clone() };
        if !strikes {
            return Ok((step, State { halted: false, ..there }));
        }
        let near = span.near(self.ball(&there.motion, self.resolution()), &there.ignored);
        let scene = Scene { rules: self, span, near: &near };
        let halted = time <= state.time;
        let mut after = self.hit(&scene, &there);
        // Without progress it is not the flight that ends the contact.
        if halted && state.halted {
            after.phase = Phase::Contact;
        }
        Ok((step, State { halted, ..after }))
    }

    /// The state after an impact.
    fn hit(&self, scene: &Scene, state: &State) -> State {
        let (slow, near) = (self.slow(), 2.0 * self.depth());
        let mut motion = state.motion;
        let raised = scene.part(&mut motion, state.time).y;
        let facings = scene.facings(&motion, state.time, near);
        let nearest = facings.iter().min_by(|a, b| a.gap.total_cmp(&b.gap));
        let carrier = nearest.map(|facing| scene.carrier(facing.number, &motion, state.time));
        let motion = self.paid(&motion, raised, carrier.unwrap_or_default());
        let rebounds = state.impacts < REBOUNDS;
        let least = |facing: &Facing, velocity: f64| {
            let restitution = if rebounds { scene.surface(facing.number).restitution } else { 0.0 };
            Some(if velocity < -slow { -restitution * velocity } else { 0.0 })
        };
        let bounds = scene.bounds(&facings, &motion, [state.time; 2], least);
        let surfaces: Vec<(Vector, Vector, Vector)> = bounds
            .iter()
            .map(|bound| (bound.arm, bound.surface, bound.frame.column(1).into_owned()))
            .collect();
        let (motion, _) = collide(&self.dynamics, &motion, bounds);
        let stays = surfaces.iter().any(|(arm, surface, normal)| {
            let velocity = motion.velocity + motion.world_spin().cross(arm) - surface;
            velocity.dot(normal) < slow
        });
        state.struck(motion, stays)
    }

    /// A step in contact, with solids, with the ground, or with both.
    fn touch(&self, span: &Span, state: &State, wind: &impl Wind) -> Result<(Step, State), Error> {
        let (time, motion) = (state.time, state.motion);
        let room = span.end() - time;
        let gravity = self.settings.air.gravity;
        let fastest = motion.velocity.norm() + motion.spin.norm() * self.body.reach();
        let near = span.near(self.ball(&motion, (fastest + gravity * room) * room), &state.ignored);
        if near.is_empty() && !self.hilly {
            return self.level_ground(span, state, wind);
        }
        let scene = Scene { rules: self, span, near: &near };
        let resolution = self.resolution();
        let close = scene.facings(&motion, time, resolution);
        let carrier = close.iter().min_by(|a, b| a.gap.total_cmp(&b.gap));
        let carrier = carrier.map(|facing| scene.carrier(facing.number, &motion, time));
        let relative = carrier.unwrap_or_default().relative(&motion);
        let mut level = self.contact_level(&relative).max(1);
        let most = (level + FINER).min(self.settings.deepest);
        // What is carried along goes on in steps as long as those of what carries it.
        // A long step would come near to much soil.
        let mut is_long = state.calm > self.topple() && !self.hilly;
        let mut end = if is_long { span.end() } else { self.grid(time, level).min(span.end()) };
        loop {
            let h = end - time;
            let slide = match self.slid(&scene, state, (end, carrier), wind)? {
                Ok(slide) => slide,
                Err(None) => {
                    return Ok((
                        Step::new(time, motion, time, motion),
                        State { halted: true, ..self.hit(&scene, state) },
                    ));
                }
                Err(Some(sooner)) => {
                    (end, is_long) = (sooner, false);
                    continue;
                }
            };
            let passed = self.around(span, &slide.step, &state.ignored);
            let clear =
                || self.first_met(&slide.step, (span, &passed), (0.5 * resolution, true)) == Touch::Nothing;
            if is_long && slide.moved > CARRIED * resolution || level < most && !clear() {
                if !is_long {
                    level += 1;
                }
                (end, is_long) = (self.grid(time, level).min(span.end()), false);
                continue;
            }
            return Ok(self.slid_to(span, &scene, state, (slide, is_long, h)));
        }
    }

    /// The state after a step in contact.
    fn slid_to(
        &self,
        span: &Span,
        scene: &Scene,
        state: &State,
        (slide, is_long, h): (Slide, bool, f64),
    ) -> (Step, State) {
        let Slide { step, mut after, pushed, moved } = slide;
        let end = step.end;
        let is_calm = pushed.is_some() && moved < CALM * self.slow() * h;
        let calm = if is_calm { state.calm + h } else { 0.0 };
        if let Some(number) = pushed.filter(|_| is_long) {
            // It has the mean velocity of what carries it, and gets the one at the end.
            let mean = scene.mean_carrier(number, &step.first, [step.start, end]);
            let relative = mean.relative(&after);
            let last = scene.carrier(number, &after, end);
            after.velocity = last.velocity + relative.velocity;
            after.spin = relative.spin + after.attitude.inverse_transform_vector(&last.spin);
        }
        let beside = span.near(self.ball(&after, 0.0), &state.ignored);
        let stands = || beside.iter().all(|index| span.swept(*index).is_still);
        let (mut phase, mut support) = (Phase::Contact, state.support);
        if calm > 4.0 * self.topple() && stands() {
            after.velocity.fill(0.0);
            after.spin.fill(0.0);
            (phase, support) = (Phase::Rest, print(span, &beside));
        } else if pushed.is_none() && scene.gap(&after, end, self.resolution()) > 0.1 * self.resolution() {
            phase = Phase::Flight;
        }
        let squeezed = scene.overlapped(&after, end, SQUEEZED * self.resolution());
        let ignored = match squeezed.is_empty() {
            true => state.ignored.clone(),
            false => state.ignored.iter().copied().chain(squeezed).collect(),
        };
        let level = self.contact_level(&after);
        let next = State {
            time: end,
            motion: after,
            level,
            phase,
            calm,
            rate: None,
            ignored,
            support,
            halted: false,
            ..state.clone()
        };
        (step, self.bedded(next))
    }

    /// A step in contact with the ground alone.
    fn level_ground(&self, span: &Span, state: &State, wind: &impl Wind) -> Result<(Step, State), Error> {
        let Some(ground) = &self.ground else {
            return self.soar(span, &State { phase: Phase::Flight, ..state.clone() }, wind);
        };
        let (step, next) = self.slide(ground, (state, span.end()), wind)?;
        let beside = span.near(self.ball(&next.motion, 0.0), &state.ignored);
        Ok((step, self.bedded(State { support: print(span, &beside), halted: false, ..next })))
    }

    /// Tries a step in contact up to a time: acceleration, then the impulses by which nothing sinks into what it touches, then motion at the new velocity. The
    /// error is a time at which a step must end before an impact; `None` if that is now.
    fn slid(
        &self,
        scene: &Scene,
        state: &State,
        (end, carrier): (f64, Option<Carrier>),
        wind: &impl Wind,
    ) -> Result<Result<Slide, Option<f64>>, Error> {
        let (time, motion) = (state.time, state.motion);
        let h = end - time;
        let (acceleration, angular) = match carrier {
            // Air sticks to what is touched.
            Some(carrier) => self.dynamics.accelerations(&motion, time, &Layer(carrier.velocity))?,
            None => self.dynamics.accelerations(&motion, time, wind)?,
        };
        let mut moved = motion;
        moved.velocity += acceleration * h;
        moved.spin = self.dynamics.spun(&motion, angular, h);
        let fastest = |motion: &Motion| motion.velocity.norm() + motion.spin.norm() * self.body.reach();
        let speed = fastest(&motion).max(fastest(&moved)) + self.paces(scene);
        let facings = scene.facings(&motion, time, speed * h + self.resolution());
        let (slow, near) = (self.slow(), 2.0 * self.depth());
        let bounds = scene.bounds(&facings, &moved, [time, end], |facing, _| Some(-facing.gap.max(0.0) / h));
        for (facing, bound) in facings.iter().zip(&bounds) {
            let approach = -approaching(&motion, bound);
            // Faster than what falls in this step: it will rebound.
            if approach <= slow + acceleration.norm() * h || state.halted {
                continue;
            }
            if facing.gap <= near {
                return Ok(Err(None));
            }
            let until = 0.9 * facing.gap / approach;
            if until < 0.9 * h {
                return Ok(Err(Some(time + until)));
            }
        }
        let (mut after, pushed) = collide(&self.dynamics, &moved, bounds);
        let first = Motion { velocity: after.velocity, spin: after.spin, ..motion };
        after.position += after.velocity * h;
        after.attitude = crate::motion::turn(after.attitude, after.spin * h);
        let raised = scene.part(&mut after, end).y;
        let base = pushed.map(|number| scene.mean_carrier(number, &motion, [time, end])).unwrap_or_default();
        after = self.paid(&after, raised, base);
        let way = (after.position - motion.position - base.velocity * h).norm();
        let moved = way + base.relative(&first).spin.norm() * h * self.size;
        let step = Step::new(time, first, end, after);
        Ok(Ok(Slide { step, after, pushed, moved }))
    }

    /// A motion whose kinetic energy, relative to what is touched, has paid for a height.
    fn paid(&self, motion: &Motion, raised: f64, carrier: Carrier) -> Motion {
        let energy = self.dynamics.kinetic_energy(&carrier.relative(motion));
        let cost = raised * self.dynamics.weight();
        if cost > 0.0 && energy > 0.0 {
            return carrier.slowed(motion, libm::sqrt((1.0 - cost / energy).max(0.0)));
        }
        *motion
    }

    /// Bound of the speed of the solids near a body, in m/s.
    fn paces(&self, scene: &Scene) -> f64 {
        let speed = |index: &usize| {
            let solid = &scene.span.solids()[*index];
            solid.path.bounds(solid.reach())[0]
        };
        scene.near.iter().map(speed).fold(0.0, f64::max)
    }
}

/// Velocity of a contact along its normal, relative to what is touched.
fn approaching(motion: &Motion, bound: &Bound) -> f64 {
    let velocity = motion.velocity + motion.world_spin().cross(&bound.arm) - bound.surface;
    bound.frame.column(1).dot(&velocity)
}

/// A print of solids and their places; never that of a place without any for ever.
fn print(span: &Span, near: &[usize]) -> u64 {
    // Fowler, Noll and Vo: FNV-1a, by words.
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    let mut add = |value: u64| hash = (hash ^ value).wrapping_mul(0x0000_0100_0000_01b3);
    for &index in near {
        let solid = &span.solids()[index];
        let place = solid.path.place(span.begin());
        add(solid.number);
        place.position.iter().chain(place.attitude.coords.iter()).for_each(|value| add(value.to_bits()));
        for shape in solid.parts.iter() {
            add(shape.radius().to_bits());
            shape.core().iter().flat_map(|point| point.iter()).for_each(|value| add(value.to_bits()));
        }
    }
    hash.max(1)
}
