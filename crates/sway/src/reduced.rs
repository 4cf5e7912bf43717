//! Motion by a few modes: Galerkin's method on the slowest vibrations of each root.
//!
//! The strain is `u = u₀ + Σ aₖ xₖ` with the equilibrium u₀ of still air and the modes xₖ, whose coordinates have mass 1. Forces are those of
//! the whole skeleton in the pose that the strain makes, so bending may be large and drag is quadratic; they are projected on the modes, and
//!
//! ```text
//! a'' = Φᵀ (Q(u, u', t) - M(u) u'')  with  u'' = Φ a''
//! ```
//!
//! is advanced by the method of `ros2.rs` with the matrix `Φᵀ(M + γhD)Φ + γ²h²Λ`, of the size of the number of modes, in the pose at the start of
//! the step: a mode that bends a stem to the side has another mass where the stem is bent. What stiff modes would do is left out, so steps may be
//! as long as a tick.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use crate::Wind;
use crate::forces::{Part, Stretch};
use crate::form::{Form, Twist, Wrench};
use crate::link::{Link, pair, transport};
use crate::place::{Local, Place, Strain};
use crate::ros2::GAMMA;
use crate::sweep::part;
use crate::{Air, Error, Fixed, Mode, Skeleton, Solver, State, Vector};

/// The modes of a skeleton that does not change, and of what moves by them.
#[derive(Clone, Debug)]
pub struct Reduced {
    roots: Vec<Root>,
    segments: usize,
    air: Air,
}

/// A root with all that it carries.
#[derive(Clone, Debug)]
struct Root {
    skeleton: Skeleton,
    /// Its segments in the whole.
    members: Vec<usize>,
    base: Vec<Vector>,
    rest_moments: Vec<Vector>,
    rotary: Vec<f64>,
    /// Shapes of the modes, and their products with the mass matrix and the lengths.
    shapes: Vec<Vec<Vector>>,
    duals: Vec<Vec<Vector>>,
    squared: Vec<f64>,
    /// Damping by the tissue.
    tissue: DMatrix<f64>,
}

/// Amplitudes of modes and their rates.
#[derive(Clone, Debug)]
struct Amplitudes {
    value: DVector<f64>,
    rate: DVector<f64>,
}

/// Memory for one pass over a root.
#[derive(Clone, Debug, Default)]
struct Pass {
    places: Vec<Place>,
    wrenches: Vec<(Wrench, Vector)>,
    /// Of mass and drag, for each segment alone.
    forms: Vec<Form>,
    /// Velocities of the bases in each mode: those of one segment are neighbours.
    twists: Vec<Twist>,
    /// Middle of each segment and its velocity, in the world.
    middles: Vec<(Vector, Vector)>,
}

/// The wind at each segment at an instant.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Breeze {
    /// In s.
    time: f64,
    wind: Vec<Vector>,
}

impl Solver {
    /// The `count` slowest modes of each root of a skeleton, as if it did not grow. Loads and plates are [lumped](Skeleton::lumped).
    ///
    /// # Errors
    ///
    /// Those of [`modes`](Solver::modes) and [`equilibrium`](Solver::equilibrium); [`Error::Vibration`] if the pose is not stable.
    pub fn reduce(&mut self, skeleton: &Skeleton, count: usize) -> Result<Reduced, Error> {
        let whole = skeleton.held().lumped();
        let mut roots = Vec::new();
        for (index, segment) in whole.segments().iter().enumerate() {
            if segment.parent.is_none() {
                let (skeleton, members) = whole.subtree(index, segment.joint);
                roots.push(self.root(skeleton, members, count)?);
            }
        }
        Ok(Reduced { roots, segments: whole.len(), air: self.settings.air })
    }

    fn root(&mut self, skeleton: Skeleton, members: Vec<usize>, count: usize) -> Result<Root, Error> {
        let mut state = State::at_rest(&skeleton);
        if skeleton.segments().iter().any(|segment| segment.sag && !segment.rigid) {
            self.equilibrium(&skeleton, &mut state, &crate::Still, 0.0)?;
        }
        let base = state.strain.clone();
        let modes = match self.modes(&skeleton, &base, count) {
            // Nothing of this root bends, or has a mass.
            Err(Error::Vibration(_)) => Vec::new(),
            modes => modes?,
        };
        if modes.iter().any(|mode| mode.squared <= 0.0) {
            return Err(Error::Vibration("the pose at rest is not stable"));
        }
        let modes: Vec<Mode> = modes.into_iter().filter(|mode| mode.squared.is_finite()).collect();
        self.skeleton.clear();
        self.renew(&state, 0.0, &mut Fixed(&skeleton))?;
        let air = self.settings.air;
        let dual = |shape: &Vec<Vector>| {
            self.work.inertia(&skeleton, &air, &base, |index| shape[index]);
            let of = |(link, segment): (&Link, &crate::Segment)| link.late_pull * -segment.length;
            self.work.links.iter().zip(skeleton.segments()).map(of).collect()
        };
        let shapes: Vec<Vec<Vector>> = modes.iter().map(|mode| mode.shape.clone()).collect();
        let duals = shapes.iter().map(dual).collect();
        let (rest_moments, rotary) = (self.work.rest_moments.clone(), self.work.rotary.clone());
        let squared = modes.iter().map(|mode| mode.squared).collect();
        let mut root = Root {
            skeleton,
            members,
            base,
            rest_moments,
            rotary,
            shapes,
            duals,
            squared,
            tissue: DMatrix::zeros(0, 0),
        };
        root.tissue = root.heat();
        Ok(root)
    }
}

impl Reduced {
    /// Number of modes.
    pub fn modes(&self) -> usize {
        self.roots.iter().map(|root| root.squared.len()).sum()
    }

    /// Advances a state from a time to another (s) in one step. What of the state no mode has is left out. `breeze` is the memory of the
    /// wind: the wind at `from` is that at the end of the call before, if that was the same time.
    ///
    /// # Errors
    ///
    /// [`Error::Length`] if the state does not fit; [`Error::Step`] if a number of the result is not finite. The state is then as before.
    pub fn advance(
        &self,
        state: &mut State,
        (from, to): (f64, f64),
        wind: &impl Wind,
        breeze: &mut Breeze,
    ) -> Result<(), Error> {
        let n = self.segments;
        if state.strain.len() != n || state.rate.len() != n {
            return Err(Error::Length { state: state.strain.len(), skeleton: n });
        }
        let mut pass = Pass::default();
        let known = breeze.time == from && breeze.wind.len() == n;
        let mut winds = [std::mem::take(&mut breeze.wind), vec![Vector::zeros(); n]];
        winds[0].resize(n, Vector::zeros());
        let mut after = state.clone();
        for root in &self.roots {
            let mut now = root.project(state);
            root.blow(&now, &self.air, (from, to, known), wind, &mut winds, &mut pass);
            let between = |i: usize, at: f64| winds[0][i].lerp(&winds[1][i], at);
            root.step(&mut now, &self.air, to - from, between, &mut pass);
            root.expand(&now, &mut after);
        }
        let wrong = |x: &Vector| !x.iter().all(|x| x.is_finite());
        let mut values = after.strain.iter().zip(&after.rate);
        if let Some(segment) = values.position(|(strain, rate)| wrong(strain) || wrong(rate)) {
            return Err(Error::Step { time: from, step: to - from, segment, excess: f64::NAN });
        }
        // Where the search for a step begins if the next is solved.
        after.level = 0;
        *state = after;
        let [_, after] = winds;
        *breeze = Breeze { time: to, wind: after };
        Ok(())
    }
}

impl Root {
    /// Damping by the tissue: a form of the rates of the modes.
    fn heat(&self) -> DMatrix<f64> {
        let segments = self.skeleton.segments();
        let rigidity: Vec<Vector> =
            segments.iter().map(|segment| segment.rigidity() * (segment.damping * segment.length)).collect();
        self.form(|i, x, y| rigidity[i].component_mul(x).dot(y))
    }

    fn form(&self, of: impl Fn(usize, &Vector, &Vector) -> f64) -> DMatrix<f64> {
        let m = self.shapes.len();
        DMatrix::from_fn(m, m, |j, k| {
            let pairs = self.shapes[j].iter().zip(&self.shapes[k]);
            pairs.enumerate().map(|(i, (x, y))| of(i, x, y)).sum()
        })
    }

    /// The amplitudes that a state has.
    fn project(&self, state: &State) -> Amplitudes {
        let of = |value: &dyn Fn(usize) -> Vector| {
            let amplitude = |dual: &Vec<Vector>| dual.iter().enumerate().map(|(i, x)| x.dot(&value(i))).sum();
            DVector::from_iterator(self.duals.len(), self.duals.iter().map(amplitude))
        };
        Amplitudes {
            value: of(&|i| state.strain[self.members[i]] - self.base[i]),
            rate: of(&|i| state.rate[self.members[i]]),
        }
    }

    fn expand(&self, now: &Amplitudes, state: &mut State) {
        for (i, &member) in self.members.iter().enumerate() {
            state.strain[member] = self.base[i] + self.field(&now.value, i);
            state.rate[member] = self.field(&now.rate, i);
        }
    }

    #[inline(always)]
    fn field(&self, amplitudes: &DVector<f64>, index: usize) -> Vector {
        let mut sum = Vector::zeros();
        for (shape, amplitude) in self.shapes.iter().zip(amplitudes.iter()) {
            sum += shape[index] * *amplitude;
        }
        sum
    }

    /// Samples the wind at both ends of an interval, once a segment.
    fn blow(
        &self,
        now: &Amplitudes,
        air: &Air,
        (from, to, known): (f64, f64, bool),
        wind: &impl Wind,
        winds: &mut [Vec<Vector>; 2],
        pass: &mut Pass,
    ) {
        self.place(now, air, pass);
        for (i, &member) in self.members.iter().enumerate() {
            if !part(&self.skeleton, air, &self.rotary, i).feels_air() {
                continue;
            }
            let (point, velocity) = pass.middles[i];
            if !known {
                winds[0][member] = wind.velocity(point, from);
            }
            winds[1][member] = wind.velocity(point + velocity * (to - from), to);
        }
    }

    /// Places and velocities of the middles of all segments.
    fn place(&self, now: &Amplitudes, air: &Air, pass: &mut Pass) {
        pass.places.clear();
        pass.middles.clear();
        for (index, segment) in self.skeleton.segments().iter().enumerate() {
            let strain = Strain {
                value: self.base[index] + self.field(&now.value, index),
                rate: self.field(&now.rate, index),
                acceleration: Vector::zeros(),
            };
            let parent = segment.parent.map(|parent| &pass.places[parent]);
            let (local, place) = Local::new(segment, parent, &-air.gravity, &strain);
            let (middle, velocity) = Stretch::new(&local).middle();
            pass.middles.push((place.origin + place.axes * middle, place.axes * velocity));
            pass.places.push(place);
        }
    }

    /// Forces on the modes at a state with accelerations, inertia included; and, if `forms` is given, the forms of mass and of drag times it.
    fn forces(
        &self,
        now: &Amplitudes,
        acceleration: &DVector<f64>,
        air: &Air,
        wind: impl Fn(usize) -> Vector,
        forms: Option<f64>,
        pass: &mut Pass,
    ) -> DVector<f64> {
        let upwards = -air.gravity;
        pass.places.clear();
        pass.wrenches.clear();
        pass.forms.clear();
        for (index, segment) in self.skeleton.segments().iter().enumerate() {
            let strain = Strain {
                value: self.base[index] + self.field(&now.value, index),
                rate: self.field(&now.rate, index),
                acceleration: self.field(acceleration, index),
            };
            let parent = segment.parent.map(|parent| &pass.places[parent]);
            let (local, place) = Local::new(segment, parent, &upwards, &strain);
            let stretch = Stretch::new(&local);
            let whole: Part<'_> = part(&self.skeleton, air, &self.rotary, index);
            let wind = place.axes.tr_mul(&wind(self.members[index]));
            let forces = whole.forces(&local, &place, &stretch, &wind);
            let elastic = segment.rigidity().component_mul(&(strain.value + strain.rate * segment.damping));
            pass.wrenches.push((forces.wrench, forces.pull - elastic - self.rest_moments[index]));
            if let Some(damping) = forms {
                pass.forms.push(whole.form(&local, &stretch, &wind, damping));
            }
            pass.places.push(place);
        }
        for (index, segment) in self.skeleton.segments().iter().enumerate().rev() {
            if let Some(parent) = segment.parent {
                let (onto, own) = pair(&mut pass.wrenches, parent, index);
                let wrench = own.0;
                Link::hand(&wrench, (&mut onto.0, &mut onto.1), &pass.places[parent], &pass.places[index]);
            }
        }
        let segments = self.skeleton.segments();
        let of = |shape: &Vec<Vector>| {
            let parts = shape.iter().zip(&pass.wrenches).zip(segments);
            parts.map(|((x, (_, pull)), segment)| x.dot(pull) * segment.length).sum()
        };
        DVector::from_iterator(self.shapes.len(), self.shapes.iter().map(of))
    }

    /// A step of ROS2 of the length h; `wind` is that of a segment at a fraction of the step.
    fn step(
        &self,
        now: &mut Amplitudes,
        air: &Air,
        h: f64,
        wind: impl Fn(usize, f64) -> Vector,
        pass: &mut Pass,
    ) {
        let m = self.shapes.len();
        if m == 0 {
            return;
        }
        let squared = DVector::from_column_slice(&self.squared);
        let stiff = |x: &DVector<f64>| squared.component_mul(x);
        let still = DVector::zeros(m);
        // The derivative by time is that of the wind: its value at γh.
        let force = self.forces(now, &still, air, |i| wind(i, GAMMA), Some(GAMMA * h), pass);
        let Some(matrix) = self.matrix(h, pass) else {
            now.value.fill(f64::NAN);
            return;
        };
        let k = matrix.solve(&(force * h - stiff(&now.rate) * (GAMMA * h * h)));
        let middle = Amplitudes {
            value: &now.value + (&now.rate + &k * GAMMA) * (0.5 * h),
            rate: &now.rate + &k * 0.5,
        };
        let left = self.forces(&middle, &(&k / h), air, |i| wind(i, 0.5), None, pass);
        let z = matrix.solve(&(left * h - stiff(&k) * (GAMMA * (0.5 - GAMMA) * h * h)));
        let second = &k + z;
        now.value += (&now.rate + &k * (0.5 - GAMMA)) * h + &second * (GAMMA * h);
        now.rate += second;
    }

    /// M + γhD + γ²h²Λ on the modes, factorised: mass and drag in the present pose, from the forms of the last pass.
    fn matrix(&self, h: f64, pass: &mut Pass) -> Option<Cholesky<f64, Dyn>> {
        let m = self.shapes.len();
        let segments = self.skeleton.segments();
        let step = GAMMA * h;
        let mut matrix = &self.tissue * step;
        pass.twists.clear();
        for (index, segment) in segments.iter().enumerate() {
            let form = &pass.forms[index];
            for (k, shape) in self.shapes.iter().enumerate() {
                let twist = segment.parent.map_or(Twist::ZERO, |parent| {
                    let (behind, own) = (&pass.places[parent], &pass.places[index]);
                    let before = &pass.twists[parent * m + k];
                    transport(before, &shape[parent], segments[parent].length, behind, own)
                });
                pass.twists.push(twist);
                let long = shape[index] * segment.length;
                let (moment, force, pull) = form.times(&twist, &long);
                for (l, other) in self.shapes.iter().enumerate().take(k + 1) {
                    let against = &pass.twists[index * m + l];
                    matrix[(k, l)] += moment.dot(&against.angular)
                        + force.dot(&against.linear)
                        + pull.dot(&other[index]) * segment.length;
                }
            }
        }
        for (k, squared) in self.squared.iter().enumerate() {
            matrix[(k, k)] += step * step * squared;
        }
        // Cholesky's decomposition takes what is below the diagonal.
        Cholesky::new(matrix)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Load, Matrix, Plate, Pose, Segment, Settings};

    /// A culm of barley, as that of the field of the scenes: 0.8 m high, an ear at the end.
    fn culm() -> Skeleton {
        let mut skeleton = Skeleton::new();
        let lengths = [0.22, 0.2, 0.19, 0.13, 0.04, 0.03, 0.03];
        let widths = [0.0032, 0.003, 0.0027, 0.0024, 0.002, 0.002, 0.002];
        for (i, (length, width)) in lengths.into_iter().zip(widths).enumerate() {
            let parent = i.checked_sub(1);
            let mut segment = Segment::solid(parent, length, width, 3e9, 350.0);
            segment.damping = 0.12 / std::f64::consts::PI;
            segment.sag = false;
            if parent.is_none() {
                segment.joint.rotation = crate::upright();
            }
            skeleton.push(segment);
        }
        for k in 0..12 {
            let along = 0.008 * f64::from(k);
            let turn = 2.4 * f64::from(k);
            let centre = Vector::new(along, 0.005 * turn.cos(), 0.005 * turn.sin());
            skeleton.load(Load { at: 1.0, mass: 2e-5, centre, inertia: Matrix::identity() * 1e-10 });
            let normal = Vector::new(0.3, turn.cos(), turn.sin()).normalize();
            skeleton.plate(Plate { at: 1.0, centre, normal, area: 5e-5 });
        }
        skeleton
    }

    fn gusts(point: Vector, time: f64) -> Vector {
        let speed = 2.5 + 1.5 * (2.0 * time - point.x).sin() + 0.8 * (5.3 * time).sin() * point.y;
        Vector::new(speed, 0.0, 0.6 * (3.1 * time + point.y).cos())
    }

    /// Places of all ends at each tick of three seconds: solved to a tolerance, or by modes in steps of a tick.
    fn solved(skeleton: &Skeleton, tolerance: f64) -> Vec<Vec<Vector>> {
        let mut solver = Solver::new(Settings { tolerance, ..Settings::default() });
        let mut state = State::at_rest(skeleton);
        let mut growth = Fixed(skeleton);
        (0..90)
            .map(|n| {
                let [from, to] = [n, n + 1].map(|n| f64::from(n) / 30.0);
                let done = solver.advance(&mut state, from, to, &mut growth, &gusts, |_| ());
                assert_eq!(done, Ok(()));
                ends(skeleton, &state)
            })
            .collect()
    }

    fn by_modes(skeleton: &Skeleton, count: usize) -> Vec<Vec<Vector>> {
        let reduced = Solver::new(Settings::default()).reduce(skeleton, count).expect("it stands");
        assert_eq!(reduced.modes(), count);
        let (mut state, mut breeze) = (State::at_rest(skeleton), Breeze::default());
        (0..90)
            .map(|n| {
                let [from, to] = [n, n + 1].map(|n| f64::from(n) / 30.0);
                assert_eq!(reduced.advance(&mut state, (from, to), &gusts, &mut breeze), Ok(()));
                ends(skeleton, &state)
            })
            .collect()
    }

    fn ends(skeleton: &Skeleton, state: &State) -> Vec<Vector> {
        let pose = Pose::new(skeleton, &state.strain);
        (0..skeleton.len()).map(|i| pose.point(i, 1.0)).collect()
    }

    fn apart(a: &[Vec<Vector>], b: &[Vec<Vector>]) -> f64 {
        a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max)
    }

    #[test]
    fn more_modes_come_nearer_to_the_solution() {
        let culm = culm();
        let exact = solved(&culm, 1e-6);
        let usual = apart(&exact, &solved(&culm, 1e-3));
        let moved = exact.iter().flatten().map(|end| end.x).fold(0.0, f64::max);
        let errors = [2, 4, 6, 8].map(|count| apart(&exact, &by_modes(&culm, count)));
        println!("moves {moved:.4}, at the usual tolerance {usual:.6}, by modes {errors:.6?}");
        assert!(moved > 0.1 && usual < 5e-4, "{moved} {usual}");
        assert!(errors[0] < 0.03 * moved && errors[1] < 0.01 * moved, "{errors:?}");
        assert!(
            errors[1] < 0.5 * errors[0] && errors[2] <= errors[1] && errors[3] <= errors[1],
            "{errors:?}"
        );
    }
}
