//! Rotary inertia about the tangents: the floor under the inertia against twist.
//!
//! A straight thin stem has next to no inertia against twist: that of its sections, some 10⁻⁶ of that against bending. Once it is bent, the
//! masses off its axis have a thousand times more, and the gyroscopic forces of its swing act on a twist without inertia. Such a motion has time
//! scales of microseconds, which no picture shows, and no linearly implicit method follows with longer steps. Therefore each segment has a
//! flywheel about its tangent. For a straight stem, all flywheels together have about δ² of the moment of inertia that the stem has across
//! its root, as though its masses stood at δ of its length off the axis. Motion in a plane is exactly the same with and without them.

use crate::Skeleton;
use crate::sweep::Workspace;

/// Mass, and its first and second moment by the distance along the stem.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Beyond {
    mass: f64,
    first: f64,
    second: f64,
}

impl Beyond {
    fn add(&mut self, mass: f64, distance: f64) {
        self.mass += mass;
        self.first += mass * distance;
        self.second += mass * distance * distance;
    }

    /// Adds moments whose distances count from a place at `distance`.
    fn shift(&mut self, other: &Beyond, distance: f64) {
        self.mass += other.mass;
        self.first += other.first + distance * other.mass;
        self.second += other.second + distance * (2.0 * other.first + distance * other.mass);
    }
}

impl Workspace {
    /// Moments of inertia of the flywheels: a length l of a stem that carries the mass m with the second moment m₂ has δ² l √(m m₂).
    pub(crate) fn flywheels(&mut self, skeleton: &Skeleton, delta: f64) {
        if delta <= 0.0 {
            self.rotary.fill(0.0);
            return;
        }
        let segments = skeleton.segments();
        self.beyond.clear();
        self.beyond.resize(segments.len(), Beyond::default());
        for (index, segment) in segments.iter().enumerate().rev() {
            let length = segment.length;
            let own = &mut self.beyond[index];
            let mass = segment.mass * length;
            own.mass += mass;
            own.first += mass * length / 2.0;
            own.second += mass * length * length / 3.0;
            for load in skeleton.loads(index) {
                own.add(load.mass, load.at * length + load.spread());
            }
            let own = *own;
            self.rotary[index] = delta * delta * length * (own.mass * own.second).sqrt();
            if let Some(parent) = segment.parent {
                let distance = segments[parent].length + segment.joint.offset.norm();
                self.beyond[parent].shift(&own, distance);
            }
        }
    }
}
