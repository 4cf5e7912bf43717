//! Landing: impacts, and the steps of a body that stays in contact with the ground until it rests.

use crate::fall::{Phase, Rules, State};
use crate::impulse::collide;
use crate::step::Step;
use crate::{Contact, Error, Ground, Motion, Wind};

/// Impacts of one fall that rebound. Those behind have no restitution, so that every fall comes to an end.
pub(crate) const REBOUNDS: u32 = 64;

impl Rules {
    /// Impact speed below which a body does not rebound, in m/s: the rebound would not rise above the tolerance.
    pub(crate) fn slow(&self) -> f64 {
        libm::sqrt(2.0 * self.settings.air.gravity * self.resolution())
    }

    /// Time in s in which a body would fall its own size.
    pub(crate) fn topple(&self) -> f64 {
        libm::sqrt(self.size / self.settings.air.gravity.max(f64::MIN_POSITIVE))
    }

    /// The state after an impact.
    pub(crate) fn strike(&self, ground: &Ground, state: &State) -> State {
        let (slow, near) = (self.slow(), 2.0 * self.depth());
        let restitution = if state.impacts < REBOUNDS { ground.restitution } else { 0.0 };
        let demand = |gap: f64, velocity: f64| {
            (gap <= near).then(|| if velocity < -slow { -restitution * velocity } else { 0.0 })
        };
        let bounds = ground.bounds(&state.motion, &self.body, &demand);
        let (motion, _) = collide(&self.dynamics, &state.motion, bounds);
        let stays = self.body.contacts.iter().any(|contact| {
            let arm = motion.turned(contact.point);
            let velocity = motion.velocity + motion.world_spin().cross(&arm);
            ground.gap(&motion, contact) <= near && velocity.y < slow
        });
        state.struck(motion, stays)
    }

    /// Level of the steps in contact.
    pub(crate) fn contact_level(&self, motion: &Motion) -> u32 {
        let pace = motion.velocity.norm() / self.size + motion.spin.norm();
        let longest = (self.topple() * libm::sqrt(self.settings.tolerance)).min(0.1 / pace.max(1e-300));
        let levels = libm::ceil(libm::log2(self.settings.longest / longest));
        // Saturates.
        (levels.max(0.0) as u32).min(self.settings.deepest)
    }

    /// A step in contact, not beyond a time: acceleration, then the impulses by which no contact sinks below the ground, then motion at the new velocity.
    pub(crate) fn slide(
        &self,
        ground: &Ground,
        (state, limit): (&State, f64),
        wind: &impl Wind,
    ) -> Result<(Step, State), Error> {
        let level = self.contact_level(&state.motion);
        let end = self.grid(state.time, level).min(limit);
        let h = end - state.time;
        let (acceleration, angular) = self.dynamics.accelerations(&state.motion, state.time, wind)?;
        let mut moved = state.motion;
        moved.velocity += acceleration * h;
        moved.spin = self.dynamics.spun(&state.motion, angular, h);
        let demand = |gap: f64, _: f64| Some(-gap.max(0.0) / h);
        let (mut after, pushed) = collide(&self.dynamics, &moved, ground.bounds(&moved, &self.body, &demand));
        let pushed = pushed.is_some();
        let first = Motion { velocity: after.velocity, spin: after.spin, ..state.motion };
        after.position += after.velocity * h;
        after.attitude = crate::motion::turn(after.attitude, after.spin * h);
        self.lift(ground, &mut after);

        let speed = after.velocity.norm() + after.spin.norm() * self.size;
        let calm = if pushed && speed < 0.1 * self.slow() { state.calm + h } else { 0.0 };
        let phase = if calm > 4.0 * self.topple() || calm > 0.0 && self.lies(ground, &after, speed) {
            after.velocity.fill(0.0);
            after.spin.fill(0.0);
            Phase::Rest
        } else if !pushed && ground.lowest(&after, &self.body) > 0.1 * self.resolution() {
            Phase::Flight
        } else {
            Phase::Contact
        };
        let next = State { time: end, motion: after, level, phase, calm, rate: None, ..state.clone() };
        Ok((Step::new(state.time, first, end, after), next))
    }

    /// True if a body with this speed can neither tip over nor slide on by a part of the tolerance. It feels no wind then, which could move it again.
    fn lies(&self, ground: &Ground, motion: &Motion, speed: f64) -> bool {
        let gravity = self.settings.air.gravity;
        let small = 0.01 * self.resolution();
        if speed > 0.01 * self.slow() || speed * speed > 2.0 * ground.friction * gravity * small {
            return false;
        }
        // A polygon with corners in the order of their angles around the centre of mass lies within the hull of its corners.
        let near = |contact: &&Contact| ground.gap(motion, contact) <= small;
        let arm = |contact: &Contact| {
            let arm = motion.turned(contact.point);
            [arm.x, arm.z]
        };
        let mut corners: Vec<[f64; 2]> = self.body.contacts.iter().filter(near).map(arm).collect();
        corners.sort_by(|a, b| libm::atan2(a[1], a[0]).total_cmp(&libm::atan2(b[1], b[0])));
        let next = corners.iter().cycle().skip(1);
        let reach = corners.iter().zip(next).map(|([x, z], [u, w])| {
            let edge = libm::hypot(u - x, w - z);
            if edge > 0.0 { (x * w - u * z) / edge } else { f64::INFINITY }
        });
        let reach = reach.fold(f64::INFINITY, f64::min);
        let height = motion.position.y - ground.height;
        let climb = libm::hypot(height, reach) - height;
        let energy = self.dynamics.kinetic_energy(motion);
        corners.len() > 2 && reach > 0.0 && energy < 0.5 * self.dynamics.weight() * climb
    }

    /// Lifts a body that rotation has brought below the ground. The kinetic energy pays for the height.
    pub(crate) fn lift(&self, ground: &Ground, motion: &mut Motion) {
        let gap = ground.lowest(motion, &self.body);
        if gap >= 0.0 {
            return;
        }
        motion.position.y -= gap;
        let energy = self.dynamics.kinetic_energy(motion);
        let cost = -gap * self.dynamics.weight();
        if cost > 0.0 && energy > 0.0 {
            let factor = libm::sqrt((1.0 - cost / energy).max(0.0));
            motion.velocity *= factor;
            motion.spin *= factor;
        }
    }
}
