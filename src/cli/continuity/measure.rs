//! The jump of the drawing at a production: positions, directions, lengths and their speeds on both sides.

use crate::model::Model;
use crate::scene::{Patch, Point, Scene, Vector};
use crate::sim::{ModuleState, Transition};
use crate::tree::{Lineage, ModuleString};
use crate::turtle::{self, Error};

/// Step of the difference quotients for speeds, relative to the time scale.
const PROBE: f64 = 1e-5;
/// Speeds below this part of (size / time scale) are rounding of the difference quotient: some units of 1e-16/[`PROBE`].
const NOISE: f64 = 1e-9;

/// A quantity before and after a production, and its jump.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sides {
    pub before: f64,
    pub after: f64,
    /// Absolute value of the difference; for vectors, norm of the difference.
    pub jump: f64,
}

/// The jump at a production. Lengths in scene units, angles in degrees, speeds per unit of time.
#[derive(Clone, Copy, Debug)]
pub struct Jump {
    pub time: f64,
    /// The largest length on either side, the scale of positions and lengths.
    pub size: f64,
    /// Position of the turtle at the end.
    pub position: Sides,
    /// Its heading; 0 if nothing is drawn after it.
    pub heading: Sides,
    /// Its roll about the heading; 0 if nothing is drawn after it.
    pub roll: Sides,
    /// Total length of lines and outlines, plus the sizes of surfaces.
    pub length: Sides,
    /// `None` if the rates before are unknown.
    pub speeds: Option<Speeds>,
    /// Number of further productions of the same instant that are included.
    pub cascade: usize,
}

#[derive(Clone, Copy, Debug)]
pub struct Speeds {
    pub position: Sides,
    /// Turning and rolling, in degrees per unit of time.
    pub direction: Sides,
    pub length: Sides,
}

/// The measured properties of a drawing.
#[derive(Clone, Copy)]
struct Measurement {
    position: Point,
    axes: [Vector; 3],
    length: f64,
}

/// Rates of a drawing.
struct Motion {
    position: Vector,
    /// Angular velocity, in radians.
    turning: Vector,
    length: f64,
}

/// Draws modules to measure their drawing.
pub struct DrawingProbe<'m> {
    model: &'m Model,
    string: ModuleString,
    scene: Scene,
}

impl<'m> DrawingProbe<'m> {
    pub fn new(model: &'m Model) -> DrawingProbe<'m> {
        DrawingProbe { model, string: ModuleString::default(), scene: Scene::default() }
    }

    /// Measures a transition at a time.
    pub fn jump(&mut self, time: f64, transition: &Transition) -> Result<Jump, Error> {
        let Transition { before, after, moved, followed, cascade } = transition;
        let before = std::slice::from_ref(before);
        let from = self.measure(before, time, 0.0)?;
        let to = self.measure(after, time, 0.0)?;
        let size = from.length.max(to.length).max(from.position.coords.norm()).max(to.position.coords.norm());
        let of = |way: f64| if *followed { way } else { 0.0 };
        let (heading, roll) = angles(&from.axes, &to.axes);
        let speeds = if *moved { Some(self.speeds(time, transition, size)?) } else { None };
        Ok(Jump {
            time,
            size,
            position: Sides {
                before: from.position.coords.norm(),
                after: to.position.coords.norm(),
                jump: (to.position - from.position).norm(),
            },
            heading: Sides { before: 0.0, after: of(heading), jump: of(heading) },
            roll: Sides { before: 0.0, after: of(roll), jump: of(roll) },
            length: scalar(from.length, to.length, 0.0),
            speeds,
            cascade: *cascade,
        })
    }

    fn speeds(&mut self, time: f64, transition: &Transition, size: f64) -> Result<Speeds, Error> {
        let before = std::slice::from_ref(&transition.before);
        let age = before[0].age;
        let scale = time_scale(before.iter().chain(&transition.after)).min(if age > 0.0 { age } else { 1.0 });
        let h = PROBE * scale;
        let from = self.motion(before, time, -h)?;
        let to = self.motion(&transition.after, time, h)?;
        let (slow, still) = (NOISE * size / scale, NOISE / scale);
        let mut direction = Sides::default();
        if transition.followed {
            let parts = vector(from.turning, to.turning, still);
            direction = Sides {
                before: parts.before.to_degrees(),
                after: parts.after.to_degrees(),
                jump: parts.jump.to_degrees(),
            };
        }
        Ok(Speeds {
            position: vector(from.position, to.position, slow),
            direction,
            length: scalar(from.length, to.length, slow),
        })
    }

    /// Rates at an instant by a one-sided difference quotient of second order; a negative `h` looks backwards in time.
    fn motion(&mut self, stands: &[ModuleState], time: f64, h: f64) -> Result<Motion, Error> {
        let measured = [
            self.measure(stands, time, 0.0)?,
            self.measure(stands, time, h)?,
            self.measure(stands, time, 2.0 * h)?,
        ];
        let slope = |x: [Vector; 3]| (4.0 * (x[1] - x[0]) - (x[2] - x[0])) / (2.0 * h);
        let turning: Vector =
            (0..3).map(|axis| measured[0].axes[axis].cross(&slope(measured.map(|m| m.axes[axis])))).sum();
        let [a, b, c] = measured.map(|m| m.length);
        Ok(Motion {
            position: slope(measured.map(|m| m.position.coords)),
            turning: turning / 2.0,
            length: (4.0 * (b - a) - (c - a)) / (2.0 * h),
        })
    }

    /// Draws modules, extrapolated by the time `tau`, with a turtle that heads up.
    fn measure(&mut self, stands: &[ModuleState], time: f64, tau: f64) -> Result<Measurement, Error> {
        self.string.reset(time + tau);
        for stand in stands {
            let values = stand.values.iter().zip(&stand.rates).map(|(x, rate)| x + tau * rate);
            self.string.push(stand.kind, values, stand.age + tau, Lineage::of_axiom(0));
        }
        self.scene.clear();
        let pose = turtle::trace(self.model, &self.string, &mut self.scene)?;
        let lines = self.scene.segments.iter().map(|s| (s.end - s.start).norm());
        let outlines = self.scene.polygons.iter().map(|polygon| {
            let corners = &polygon.vertices;
            let next = |i: usize| &corners[(i + 1) % corners.len()];
            corners.iter().enumerate().map(|(i, p)| (next(i) - p).norm()).sum::<f64>()
        });
        let surfaces =
            self.scene.surfaces.iter().map(|surface| surface.placement.scales.iter().sum::<f64>() / 3.0);
        let patches = self.scene.patches.iter().map(Patch::length);
        let length =
            lines.sum::<f64>() + outlines.sum::<f64>() + surfaces.sum::<f64>() + patches.sum::<f64>();
        Ok(Measurement { position: pose.position, axes: pose.axes, length })
    }
}

/// A time in which no parameter changes by much more than its size, at most 1.
fn time_scale<'s>(stands: impl Iterator<Item = &'s ModuleState>) -> f64 {
    stands
        .flat_map(|stand| stand.values.iter().zip(&stand.rates))
        .map(|(x, rate)| if *rate == 0.0 { 1.0 } else { x.abs().max(1.0) / rate.abs() })
        .fold(1.0, f64::min)
}

fn scalar(before: f64, after: f64, least: f64) -> Sides {
    let clear = |x: f64| if x.abs() > least { x } else { 0.0 };
    Sides { before: clear(before), after: clear(after), jump: clear(after - before).abs() }
}

fn vector(before: Vector, after: Vector, least: f64) -> Sides {
    let clear = |v: Vector| if v.norm() > least { v.norm() } else { 0.0 };
    Sides { before: clear(before), after: clear(after), jump: clear(after - before) }
}

/// The angles between two headings, and about the heading, in degrees.
fn angles(from: &[Vector; 3], to: &[Vector; 3]) -> (f64, f64) {
    let between = |a: &Vector, b: &Vector| a.cross(b).norm().atan2(a.dot(b)).to_degrees();
    let heading = between(&from[0], &to[0]);
    // The left side, carried along with the heading by the shortest turn.
    let axis = from[0].cross(&to[0]);
    let cos = from[0].dot(&to[0]);
    let left = &from[1];
    let carried = if cos > -1.0 + 1e-12 {
        left * cos + axis.cross(left) + axis * (axis.dot(left) / (1.0 + cos))
    } else {
        *left
    };
    (heading, between(&carried, &to[1]))
}
