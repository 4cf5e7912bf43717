//! Natural frequencies, Greenhill's ratio, Cauchy's number: what is known of a plant before it is simulated.

use crate::Still;
use crate::form::{Twist, Wrench};
use crate::krylov::largest;
use crate::link::{Link, Weights, pair, transport};
use crate::sweep::{Bend, Instant};
use crate::{Air, Error, Fixed, Skeleton, Solver, State, Vector};

/// A vibration about an equilibrium.
#[derive(Clone, Debug, PartialEq)]
pub struct Mode {
    /// Square of the angular frequency ω, in 1/s²: negative if the pose is not stable.
    pub squared: f64,
    /// Damping ratio by the tissue, 0 if the pose is not stable.
    pub damping: f64,
    /// Rates of strain, in 1/m per unit of the mode's coordinate. The mode has a mass of 1 kg in this scale: its kinetic energy is half of the
    /// square of the coordinate's rate.
    pub shape: Vec<Vector>,
}

impl Mode {
    /// Frequency in Hz; 0 if the pose is not stable.
    pub fn frequency(&self) -> f64 {
        self.squared.max(0.0).sqrt() / std::f64::consts::TAU
    }
}

/// Ratio of drag to elastic restoring force of a cylinder: Cauchy's number ½ ρ C d U² L³/EI, with the drag diameter d (m), the speed U
/// (m/s), the length L (m) and the rigidity EI (N m²). Above 1, bending is large.
pub fn cauchy_number(air: &Air, diameter: f64, speed: f64, length: f64, rigidity: f64) -> f64 {
    0.5 * air.density * air.cylinder * diameter * speed * speed * length.powi(3) / rigidity
}

/// Sum of `length · a · b` pairs with, so that forces divided by length become forces.
fn lengthen(skeleton: &Skeleton, values: &mut [Vector]) {
    for (value, segment) in values.iter_mut().zip(skeleton.segments()) {
        *value *= segment.length;
    }
}

impl Solver {
    /// The `count` slowest vibrations about a strain, with the geometric stiffness of the weight, slowest first. Stems with round sections
    /// have them in pairs. Pure torsion, which moves no centre line, is left out.
    ///
    /// # Errors
    ///
    /// [`Error::Length`] and [`Error::Value`] as in [`advance`](Solver::advance); [`Error::Vibration`] if nothing bends or has mass.
    pub fn modes(
        &mut self,
        skeleton: &Skeleton,
        strain: &[Vector],
        count: usize,
    ) -> Result<Vec<Mode>, Error> {
        let n = skeleton.len();
        let held = skeleton.held();
        let state = State { strain: strain.to_vec(), ..State::at_rest(&held) };
        self.skeleton.clear();
        self.renew(&state, 0.0, &mut Fixed(&held))?;
        // A shift makes the matrix positive where the pose is not stable.
        let mut shift = 0.0;
        while !self.factor(&held, &state, shift) {
            shift = (shift * 4.0_f64).max(1e-3);
            if shift > 1e15 {
                return Err(Error::Vibration("no segment has stiffness"));
            }
        }
        let mut aside = self.work.clone();
        let air = self.settings.air;
        let mut mass = |x: &[Vector]| {
            aside.inertia(&held, &air, strain, |index| x[index]);
            aside.links.iter().map(|link| -link.late_pull).collect::<Vec<Vector>>()
        };
        let mut again = self.work.clone();
        again.rest_moments.clone_from(&self.work.rest_moments);
        let mut mass_again = |x: &[Vector]| {
            again.inertia(&held, &air, strain, |index| x[index]);
            let mut forces: Vec<Vector> = again.links.iter().map(|link| -link.late_pull).collect();
            lengthen(&held, &mut forces);
            forces
        };
        let work = &mut self.work;
        let solve = |x: &[Vector]| {
            let load = mass(x);
            for (link, load) in work.links.iter_mut().zip(load) {
                link.wrench = Wrench::ZERO;
                link.pull = load;
            }
            work.gather_again(&held);
            work.resolve(&held);
            work.links.iter().map(|link| link.x).collect()
        };
        let room = (6 * count + 32).max(48);
        let pairs = largest(n, count, room, solve, &mut mass_again);
        if pairs.values.is_empty() {
            return Err(Error::Vibration("no segment has both mass and stiffness"));
        }
        let modes = pairs.values.iter().zip(pairs.vectors);
        Ok(modes.map(|(value, shape)| mode(&held, 1.0 / value - shift, shape)).collect())
    }

    /// Factorises stiffness plus `shift` times mass. Returns whether it is positive.
    fn factor(&mut self, skeleton: &Skeleton, state: &State, shift: f64) -> bool {
        let weights = Weights { mass: shift, damping: 0.0, stiffness: 1.0, extra: 0.0, blur: 0.0 };
        let bend = Bend { strain: &state.strain, rate: &state.rate };
        let now = Instant { wind: &Still, from: 0.0, to: 0.0 };
        self.work.spread(skeleton, &self.settings.air, bend, now, (1.0, 0.0), &weights);
        self.work.gather(skeleton, &state.rate, &weights, 0.0)
    }

    /// Load factor of buckling: by how much the weight would have to be multiplied for the rest shape to lose its stability. Infinite if no
    /// weight can do that (what hangs).
    ///
    /// # Errors
    ///
    /// [`Error::Length`] and [`Error::Value`] as in [`advance`](Solver::advance); [`Error::Vibration`] if nothing bends.
    pub fn buckling(&mut self, skeleton: &Skeleton) -> Result<f64, Error> {
        let n = skeleton.len();
        let held = skeleton.held();
        let state = State::at_rest(&held);
        self.skeleton.clear();
        self.renew(&state, 0.0, &mut Fixed(&held))?;
        self.factor(&held, &state, 0.0);
        // The elimination removes geometric stiffness where the sum is not positive; here it is wanted whole.
        for (link, place) in self.work.links.iter_mut().zip(&self.work.places) {
            link.stiffen(place);
        }
        let work = &mut self.work;
        let press = |x: &[Vector]| -> Vec<Vector> {
            let segments = held.segments();
            for (index, segment) in segments.iter().enumerate() {
                let twist = match segment.parent {
                    None => Twist::ZERO,
                    Some(parent) => {
                        let before = work.links[parent].twist;
                        let length = segments[parent].length;
                        transport(&before, &x[parent], length, &work.places[parent], &work.places[index])
                    }
                };
                let link = &mut work.links[index];
                link.twist = twist;
                link.wrench = Wrench::ZERO;
                link.pull = Vector::zeros();
                link.press(-1.0, segment.length, &twist.angular, &x[index]);
            }
            for index in (0..n).rev() {
                if let Some(parent) = segments[index].parent {
                    let (onto, link) = pair(&mut work.links, parent, index);
                    let wrench = link.wrench;
                    let (behind, own) = (&work.places[parent], &work.places[index]);
                    Link::hand(&wrench, (&mut onto.wrench, &mut onto.pull), behind, own);
                }
            }
            let free = |index: usize| soft(&held, index).map(|rigidity| rigidity.map(|value| 1.0 / value));
            (0..n)
                .map(|index| {
                    free(index)
                        .map_or_else(Vector::zeros, |inverse| work.links[index].pull.component_mul(&inverse))
                })
                .collect()
        };
        let weigh = |x: &[Vector]| -> Vec<Vector> {
            let stiff = |index| soft(&held, index).unwrap_or_else(Vector::zeros);
            (0..n)
                .map(|index| stiff(index).component_mul(&x[index]) * held.segments()[index].length)
                .collect()
        };
        let pairs = largest(n, 1, 60, press, weigh);
        match pairs.values.first() {
            None => Ok(f64::INFINITY),
            Some(&value) if value > 0.0 => Ok(1.0 / value),
            Some(_) => Ok(f64::INFINITY),
        }
    }

    /// Ratio of the length of a stem to Greenhill's critical length, from the load factor of [`buckling`](Solver::buckling): a stem that were
    /// longer by a factor s, with the same sections, would have its load multiplied by s³. Above 1, the rest shape is not stable.
    ///
    /// # Errors
    ///
    /// Those of [`buckling`](Solver::buckling).
    pub fn greenhill_ratio(&mut self, skeleton: &Skeleton) -> Result<f64, Error> {
        Ok((1.0 / self.buckling(skeleton)?).cbrt())
    }
}

/// The rigidity of a segment that bends, where all of it is positive.
fn soft(skeleton: &Skeleton, index: usize) -> Option<Vector> {
    let segment = &skeleton.segments()[index];
    let rigidity = segment.rigidity();
    (!segment.rigid && rigidity.iter().all(|value| *value > 0.0)).then_some(rigidity)
}

/// A mode from its shape, of which the kinetic energy is ½.
fn mode(skeleton: &Skeleton, squared: f64, shape: Vec<Vector>) -> Mode {
    let heat: f64 = skeleton
        .segments()
        .iter()
        .zip(&shape)
        .map(|(segment, x)| crate::sweep::heat(segment, &segment.rigidity(), x))
        .sum();
    let damping = if squared > 0.0 { 0.5 * heat / squared.sqrt() } else { 0.0 };
    Mode { squared, damping, shape }
}
