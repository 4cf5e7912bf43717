//! Skeletons with fewer plates, and fewer loads, that move in the same way.

use nalgebra::SymmetricEigen;

use crate::{Matrix, Plate, Skeleton, Vector};

impl Skeleton {
    /// The same skeleton with one load and at most three plates at each section that carries any.
    ///
    /// Rigid bodies that are fixed to one section are one rigid body, so loads lose nothing. The drag of plates in a flow that is the same for
    /// all of them is a function of `Σ A n nᵀ`; its eigenvectors are the normals of the three plates, its eigenvalues their areas. That leaves
    /// out that plates far from the section's axis move faster where it turns.
    pub fn lumped(&self) -> Skeleton {
        let mut out = Skeleton::new();
        for (index, segment) in self.segments().iter().enumerate() {
            out.push(*segment);
            let loads = self.loads(index);
            for at in sections(loads.iter().map(|load| load.at)) {
                loads.iter().filter(|load| load.at == at).for_each(|load| out.load(*load));
            }
            let plates = self.plates(index);
            for at in sections(plates.iter().map(|plate| plate.at)) {
                let here: Vec<&Plate> = plates.iter().filter(|plate| plate.at == at).collect();
                if here.len() <= 3 {
                    here.into_iter().for_each(|plate| out.plate(*plate));
                } else {
                    three(&here, at).for_each(|plate| out.plate(plate));
                }
            }
        }
        out
    }
}

/// The different sections, in the order in which they appear.
fn sections(all: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut sections = Vec::new();
    for at in all {
        if !sections.contains(&at) {
            sections.push(at);
        }
    }
    sections
}

/// Three plates with the drag of many.
fn three(plates: &[&Plate], at: f64) -> impl Iterator<Item = Plate> {
    let sum: Matrix = plates.iter().map(|plate| plate.normal * plate.normal.transpose() * plate.area).sum();
    let eigen = SymmetricEigen::new(sum);
    let of = |k: usize| {
        let normal: Vector = eigen.eigenvectors.column(k).into_owned();
        let part = |plate: &&Plate| plate.area * plate.normal.dot(&normal).powi(2);
        let area: f64 = plates.iter().map(part).sum();
        let centre: Vector = plates.iter().map(|plate| plate.centre * part(plate)).sum();
        (area > 0.0).then(|| Plate { at, centre: centre / area, normal, area })
    };
    [of(0), of(1), of(2)].into_iter().flatten()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Air, Load, Segment};

    #[test]
    fn many_plates_and_loads_are_few_that_feel_the_same() {
        let mut skeleton = Skeleton::new();
        skeleton.push(Segment::solid(None, 0.1, 0.003, 1e9, 900.0));
        let vector = |k: u32, a: f64| {
            let x = f64::from(k) * a;
            Vector::new(x.sin(), (1.7 * x).cos(), (0.6 * x + 1.0).sin())
        };
        for k in 0..9 {
            let inertia = Matrix::from_diagonal(&Vector::new(1.0, 2.0, 2.5)) * 1e-6;
            skeleton.load(Load {
                at: 1.0,
                mass: 1e-3 * f64::from(k + 1),
                centre: vector(k, 0.9) * 0.05,
                inertia,
            });
            let normal = vector(k, 2.3).normalize();
            skeleton.plate(Plate {
                at: 1.0,
                centre: vector(k, 0.9) * 0.05,
                normal,
                area: 1e-4 * f64::from(9 - k),
            });
        }
        let lumped = skeleton.lumped();
        assert!(lumped.check().is_ok());
        assert_eq!((lumped.loads(0).len(), lumped.plates(0).len()), (1, 3));
        // Force in a flow, and kinetic energy of a rigid motion.
        let air = Air::default();
        let force = |skeleton: &Skeleton, flow: &Vector| -> Vector {
            skeleton.plates(0).iter().map(|plate| air.plate_drag(plate.area, &plate.normal, flow)).sum()
        };
        let energy = |skeleton: &Skeleton, omega: &Vector, v: &Vector| -> f64 {
            let of = |load: &Load| {
                let speed = v + omega.cross(&load.centre);
                0.5 * load.mass * speed.norm_squared() + 0.5 * omega.dot(&(load.inertia * omega))
            };
            skeleton.loads(0).iter().map(of).sum()
        };
        for k in 1..20 {
            let (flow, omega) = (vector(k, 0.77) * 5.0, vector(k, 1.3) * 3.0);
            let [whole, few] = [force(&skeleton, &flow), force(&lumped, &flow)];
            assert!((whole - few).norm() < 1e-12 * whole.norm(), "{whole} {few}");
            let [whole, few] = [energy(&skeleton, &omega, &flow), energy(&lumped, &omega, &flow)];
            assert!((whole - few).abs() < 1e-12 * whole, "{whole} {few}");
        }
    }
}
