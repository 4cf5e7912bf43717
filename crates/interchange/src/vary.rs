//! A run as meshes whose triangles change from frame to frame, each corner with its velocity.
//!
//! Between two productions the corners of a module are smooth functions of time. A frame is drawn five times, a small step apart, and a corner's velocity is the derivative of the
//! polynomial of degree four through its five places, whose error is that of the fourth power of the step. A module that is not there at all five instants, because it was born or replaced in
//! between, has the polynomial of those on its side: velocities never look across a production. So they are differences, not derivatives of the equations, over 1.3 ms to either side; the
//! difference from the polynomial of half as many places is measured, and is a bound of their error where the motion is smooth.

use std::collections::{BTreeMap, HashMap};

use dlsys_geometry::scene::{MaterialId, Palette, Scene, Vector};
use dlsys_session::{Nursery, Session};
use dlsys_sim::{Settings, Simulation};
use dlsys_tree::ModuleString;

use crate::mesh::Cutter;
use crate::part::{Catalogue, Frame};
use crate::sample::{Sample, Sampler};
use crate::{Error, Options};

/// The step in seconds of the animation: a 64th of a frame of film.
const STEP: f64 = 1.0 / 24.0 / 64.0;
/// The instants at which a frame is drawn, in steps; the frame itself is the third.
const STEPS: [f64; 5] = [-2.0, -1.0, 0.0, 1.0, 2.0];
const OWN: usize = 2;
/// Part of the accuracy that triangles take.
const OF_TRIANGLES: f64 = 0.8;
/// A step of this part of the extent is a jump, if the one on the other side is much smaller.
const JUMP: f64 = 0.02;

/// The triangles of one material at one instant, in metres.
#[derive(Debug, Default)]
pub(crate) struct Mesh {
    pub(crate) points: Vec<Vector>,
    pub(crate) normals: Vec<[f32; 3]>,
    /// In metres a second.
    pub(crate) velocities: Vec<Vector>,
    pub(crate) triangles: Vec<u32>,
    /// Places in the picture of the material.
    pub(crate) pinned: Vec<[f32; 2]>,
}

/// A frame.
#[derive(Debug, Default)]
pub(crate) struct Varied {
    /// By number of the material.
    pub(crate) meshes: BTreeMap<usize, Mesh>,
    /// The largest difference of velocities from those of fewer places, in metres a second.
    pub(crate) error: f64,
}

/// Draws frames with velocities.
pub(crate) struct Draughts<'m, 'a> {
    nursery: &'a Nursery<'m>,
    options: &'a Options,
    sampler: Sampler,
    palette: &'a Palette,
    contours: &'a [Vec<[f64; 2]>],
    blank: &'a Scene,
}

/// A frame's strings, as far as there are any.
type Strings = [Option<ModuleString>; STEPS.len()];

/// Draws all frames in batches of as many as there are threads, and passes what `work` makes of each to `take`, in order.
///
/// # Errors
/// See [`Error`], and those of `take`.
pub(crate) fn vary<T: Send>(
    session: &Session,
    settings: Settings,
    times: &[f64],
    options: &Options,
    work: impl Fn(Varied, &Palette) -> T + Sync,
    mut take: impl FnMut(f64, T) -> Result<(), Error>,
) -> Result<(), Error> {
    options.check_extent()?;
    let nursery = Nursery::new(&session.model, settings);
    let mut blank = nursery.blank();
    blank.notes_poses = true;
    blank.accuracy = (1.0 - OF_TRIANGLES) * options.tolerance() / options.metres;
    let (palette, contours) = (blank.palette.clone(), blank.contours.to_vec());
    let Options { default_width, metres, grown, .. } = *options;
    let sampler = Sampler { default_width, metres, grown };
    let draughts = Draughts {
        nursery: &nursery,
        options,
        sampler,
        palette: &palette,
        contours: &contours,
        blank: &blank,
    };
    let mut simulation = session.simulate(settings)?;
    let end = times.last().copied().unwrap_or(0.0);
    for batch in times.chunks(options.threads.max(1)) {
        let strings = strings(&mut simulation, batch, options, end)?;
        let draw = |strings: Strings| draughts.frame(&strings).map(|varied| work(varied, &palette));
        let made: Vec<Result<T, Error>> = dlsys_threads::in_order(options.threads, strings, draw);
        for (time, made) in batch.iter().zip(made) {
            take(*time, made?)?;
        }
    }
    Ok(())
}

/// The step in units of the model, large enough for instants of this size.
fn step(options: &Options, time: f64) -> f64 {
    (STEP / options.seconds).max(time.abs() * 1e-10)
}

/// The strings of frames. Instants after the last frame that fail are left out: no frame shows them.
fn strings(
    simulation: &mut Simulation<'_>,
    batch: &[f64],
    options: &Options,
    end: f64,
) -> Result<Vec<Strings>, Error> {
    let mut all: Vec<Strings> = batch.iter().map(|_| Strings::default()).collect();
    let mut wanted: Vec<(f64, usize, usize)> = Vec::new();
    for (n, &time) in batch.iter().enumerate() {
        let step = step(options, time);
        let instants = STEPS.iter().enumerate().map(|(k, steps)| (time + steps * step, n, k));
        wanted.extend(instants.filter(|(instant, ..)| *instant >= 0.0));
    }
    wanted.sort_by(|a, b| a.0.total_cmp(&b.0));
    for (instant, n, k) in wanted {
        let mut string = ModuleString::default();
        match simulation.at(instant, &mut string) {
            Ok(()) => all[n][k] = Some(string),
            Err(_) if instant > end => break,
            Err(error) => return Err(error.into()),
        }
    }
    Ok(all)
}

/// A module at one of the instants.
struct Pose<'s> {
    frame: Frame,
    numbers: &'s [f64],
}

impl Draughts<'_, '_> {
    fn sample(&self, string: &ModuleString, scene: &mut Scene) -> Result<Sample<f64>, Error> {
        scene.clear();
        self.nursery.draw(string, scene)?;
        if !scene.plants.is_empty() {
            return Err(Error::Plants);
        }
        Ok(self.sampler.sample(string.time, scene))
    }

    fn frame(&self, strings: &Strings) -> Result<Varied, Error> {
        let mut scene = self.blank.clone();
        let mut samples: [Option<Sample<f64>>; STEPS.len()] = Default::default();
        for (sample, string) in samples.iter_mut().zip(strings) {
            if let Some(string) = string {
                *sample = Some(self.sample(string, &mut scene)?);
            }
        }
        let mut varied = Varied::default();
        let Some(own) = &samples[OWN] else { return Ok(varied) };
        let mut catalogue = Catalogue::default();
        for (place, source) in &own.sources {
            catalogue.surfaces.entry(*place).or_insert_with(|| source.clone());
        }
        let numbers: [HashMap<u64, usize>; STEPS.len()] = std::array::from_fn(|k| {
            let modules = samples[k].iter().flat_map(|sample| &sample.modules).enumerate();
            modules.map(|(i, module)| (module.lineage.id, i)).collect()
        });
        let limit = self.options.limits.numbers / 16;
        let mut corners = 0;
        for (i, module) in own.modules.iter().enumerate() {
            let parts = own.parts(i);
            let poses: [Option<Pose<'_>>; STEPS.len()] = std::array::from_fn(|k| {
                let sample = samples[k].as_ref()?;
                let j = *numbers[k].get(&module.lineage.id)?;
                let frame = sample.modules[j].frame;
                (sample.parts(j) == parts).then(|| Pose { frame, numbers: sample.numbers(j) })
            });
            let (form, paint) = (catalogue.form(parts), catalogue.paint(own.materials(i)));
            let cutter = Cutter {
                catalogue: &catalogue,
                palette: self.palette,
                contours: self.contours,
                accuracy: OF_TRIANGLES * self.options.tolerance(),
            };
            let layout = cutter.layout(&form, &paint, &[own.numbers(i).to_vec()]);
            corners += self.add(&layout, &poses, step(self.options, own.time), &mut varied);
            if corners > limit {
                return Err(Error::TooLarge { time: own.time, limit });
            }
        }
        Ok(varied)
    }

    /// Adds the triangles of a module. Returns the number of its corners.
    fn add(
        &self,
        layout: &crate::mesh::Layout,
        poses: &[Option<Pose<'_>>; STEPS.len()],
        step: f64,
        varied: &mut Varied,
    ) -> usize {
        let mut primitives: Vec<usize> = Vec::new();
        let mut normals: Vec<Vector> = Vec::new();
        let places: [Option<Vec<Vector>>; STEPS.len()] = std::array::from_fn(|k| {
            let &Pose { frame, numbers } = poses[k].as_ref()?;
            let mut places = Vec::new();
            layout.visit(numbers, |primitive, position, normal| {
                places.push(frame.origin.coords + frame.turn * position);
                if k == OWN {
                    primitives.push(primitive);
                    normals.push(frame.turn * normal);
                }
            });
            Some(places)
        });
        let Some(own) = &places[OWN] else { return 0 };
        let jump = JUMP * self.options.extent * self.options.metres;
        let stencil = Stencil::of(&places, jump);
        let pinned = layout.pinned();
        for ((material, triangles), pinned) in layout.primitives.iter().zip(&pinned) {
            let mesh = varied.meshes.entry(material.index()).or_default();
            let first = mesh.points.len() as u32;
            mesh.triangles.extend(triangles.iter().map(|corner| corner + first));
            mesh.pinned.extend(pinned);
        }
        let seconds = step * self.options.seconds;
        for (c, (primitive, normal)) in primitives.iter().zip(&normals).enumerate() {
            let (velocity, error) = stencil.derivative(|k| places[k].as_ref().map_or(own[c], |all| all[c]));
            varied.error = varied.error.max(error / seconds);
            let material: MaterialId = layout.primitives[*primitive].0;
            let Some(mesh) = varied.meshes.get_mut(&material.index()) else { continue };
            mesh.points.push(own[c]);
            mesh.velocities.push(velocity / seconds);
            let normal = normal.try_normalize(1e-30).unwrap_or_else(Vector::y);
            mesh.normals.push(normal.map(|x| x as f32).into());
        }
        own.len()
    }
}

/// Which of the places of a module its velocity is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stencil {
    /// All five.
    Central,
    /// The ones just before and just after.
    Narrow,
    /// The frame's own and so many on one side of it: 1 or 2 after it, -1 or -2 before it.
    Aside(i32),
    /// It is there at this instant only.
    None,
}

impl Stencil {
    fn of(places: &[Option<Vec<Vector>>; STEPS.len()], jump: f64) -> Stencil {
        let there = |k: usize| places[k].is_some();
        // The largest step to a neighbour.
        let way = |k: usize| -> f64 {
            let (Some(own), Some(other)) = (&places[OWN], &places[k]) else { return 0.0 };
            own.iter().zip(other).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max)
        };
        let (before, after) = (way(OWN - 1), way(OWN + 1));
        // A drawing that jumps within one life, by an `if`: what is on the other side does not count.
        let jumps = |far: f64, near: f64| far > jump && far > 8.0 * near;
        let has_before = there(OWN - 1) && !jumps(before, after);
        let has_after = there(OWN + 1) && !jumps(after, before);
        match (has_before, has_after) {
            (true, true) if there(0) && there(4) => Stencil::Central,
            (true, true) => Stencil::Narrow,
            (false, true) => Stencil::Aside(if there(4) { 2 } else { 1 }),
            (true, false) => Stencil::Aside(if there(0) { -2 } else { -1 }),
            (false, false) => Stencil::None,
        }
    }

    /// The derivative by steps at the third place, and its difference from that of fewer places.
    fn derivative(self, at: impl Fn(usize) -> Vector) -> (Vector, f64) {
        let central = |n: usize| (at(OWN + n) - at(OWN - n)) / (2.0 * n as f64);
        let (best, other) = match self {
            Stencil::Central => ((central(1) * 4.0 - central(2)) / 3.0, central(1)),
            Stencil::Narrow => (central(1), at(OWN + 1) - at(OWN)),
            Stencil::Aside(side) => {
                let sign = f64::from(side.signum());
                let near = if side > 0 { at(OWN + 1) } else { at(OWN - 1) };
                let first = (near - at(OWN)) * sign;
                match side {
                    2 | -2 => {
                        let far = if side > 0 { at(OWN + 2) } else { at(OWN - 2) };
                        (((near - at(OWN)) * 4.0 - (far - at(OWN))) * (sign / 2.0), first)
                    }
                    _ => (first, first),
                }
            }
            Stencil::None => (Vector::zeros(), Vector::zeros()),
        };
        (best, (best - other).norm())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn places(there: [bool; 5], at: impl Fn(f64) -> f64) -> [Option<Vec<Vector>>; 5] {
        std::array::from_fn(|k| there[k].then(|| vec![Vector::new(at(STEPS[k]), 1.0, 0.0)]))
    }

    fn velocity(there: [bool; 5], at: impl Fn(f64) -> f64) -> (Stencil, f64) {
        let all = places(there, at);
        let stencil = Stencil::of(&all, 1e3);
        let own = all[OWN].clone().expect("there");
        let (velocity, _) = stencil.derivative(|k| all[k].as_ref().unwrap_or(&own)[0]);
        assert_eq!((velocity.y, velocity.z), (0.0, 0.0));
        (stencil, velocity.x)
    }

    #[test]
    fn polynomials_of_their_degree_are_exact_on_either_side() {
        let quartic = |x: f64| 3.0 + 2.0 * x - x.powi(2) + 0.5 * x.powi(3) - 0.25 * x.powi(4);
        let (stencil, x) = velocity([true; 5], quartic);
        assert_eq!(stencil, Stencil::Central);
        assert!((x - 2.0).abs() < 1e-12, "{x}");
        let square = |x: f64| 3.0 + 2.0 * x - x.powi(2);
        for (there, expected) in [
            ([false, true, true, true, false], Stencil::Narrow),
            ([false, false, true, true, true], Stencil::Aside(2)),
            ([true, true, true, false, false], Stencil::Aside(-2)),
            ([true, false, true, true, true], Stencil::Aside(2)),
        ] {
            let (stencil, x) = velocity(there, square);
            assert_eq!(stencil, expected);
            assert!((x - 2.0).abs() < 1e-12, "{there:?}: {x}");
        }
        let line = |x: f64| 2.0 * x;
        assert_eq!(velocity([false, false, true, true, false], line), (Stencil::Aside(1), 2.0));
        assert_eq!(velocity([false, true, true, false, false], line), (Stencil::Aside(-1), 2.0));
        assert_eq!(velocity([false, false, true, false, false], line), (Stencil::None, 0.0));
    }

    #[test]
    fn a_jump_is_no_motion() {
        let all = places([true; 5], |x| if x < 0.0 { -50.0 + x } else { x });
        assert_eq!(Stencil::of(&all, 1.0), Stencil::Aside(2));
        assert_eq!(Stencil::of(&all, 100.0), Stencil::Central);
    }
}
