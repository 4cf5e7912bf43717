//! Stretch and shear of faces: springs along the edges of triangles, coupled so that each triangle has the stiffness of its material.
//!
//! With half the changes of the squared edges, `q_i = (l_i² - L_i²)/2`, the energy of a triangle is `½ qᵀ K q`. Since `q_i = Dᵢᵀ E Dᵢ` for the edges D
//! at rest and Green's strain E, there is one K for which that is the energy of a St. Venant-Kirchhoff membrane (Delingette, *Triangular springs for
//! modeling nonlinear membranes*, IEEE Trans. Vis. Comput. Graph. 14, 2008). All forces are along edges, so they keep both momenta.

use nalgebra::Matrix3x2;

use crate::elastic::{Assembly, Weights};
use crate::{Matrix, Tissue, Vector};

/// A triangle.
#[derive(Clone, Debug)]
pub(crate) struct Triangle {
    pub points: [usize; 3],
    /// K, in N/m³.
    stiffness: Matrix,
    /// The squares of the edges at rest; edge i is opposite to corner i.
    rest: Vector,
    /// Slots of the pairs (1, 2), (2, 0), (0, 1).
    pub slots: [usize; 3],
}

/// The edges: edge i goes from corner i + 1 to corner i + 2.
fn edges(corners: &[Vector; 3]) -> [Vector; 3] {
    let [a, b, c] = corners;
    [c - b, a - c, b - a]
}

impl Triangle {
    /// A triangle at rest that has this part of the thickness; `None` if its area is 0.
    pub fn new(points: [usize; 3], corners: &[Vector; 3], tissue: &Tissue, share: f64) -> Option<Triangle> {
        let edges = edges(corners);
        let doubled = edges[0].cross(&edges[1]).norm();
        let longest = edges.iter().map(Vector::norm_squared).fold(0.0, f64::max);
        if doubled <= 1e-10 * longest {
            return None;
        }
        // Axes in the plane.
        let x = edges[0].normalize();
        let normal = edges[0].cross(&edges[1]) / doubled;
        let axes = Matrix3x2::from_columns(&[x, normal.cross(&x)]);
        let flat = edges.map(|edge| axes.tr_mul(&edge));
        let strains = Matrix::from_fn(|i, k| match k {
            0 => flat[i].x * flat[i].x,
            1 => flat[i].y * flat[i].y,
            _ => flat[i].x * flat[i].y,
        });
        let inverse = strains.try_inverse()?;
        let nu = tissue.poisson;
        let law = Matrix::new(1.0, nu, 0.0, nu, 1.0, 0.0, 0.0, 0.0, (1.0 - nu) / 2.0);
        let volume = 0.5 * doubled * tissue.thickness * share;
        let stiffness = inverse.transpose() * law * inverse * (tissue.stiffness * volume / (1.0 - nu * nu));
        let rest = Vector::from_fn(|i, _| edges[i].norm_squared());
        Some(Triangle { points, stiffness, rest, slots: [0; 3] })
    }

    fn strain(&self, edges: &[Vector; 3]) -> Vector {
        Vector::from_fn(|i, _| (edges[i].norm_squared() - self.rest[i]) / 2.0)
    }

    /// Elastic energy in J.
    pub fn energy(&self, x: &[Vector]) -> f64 {
        let q = self.strain(&edges(&self.points.map(|point| x[point])));
        0.5 * q.dot(&(self.stiffness * q))
    }

    /// Adds forces; `delay` is τ.
    #[inline(always)]
    pub fn forces(&self, x: &[Vector], v: &[Vector], delay: f64, forces: &mut [Vector]) {
        let edges = edges(&self.points.map(|point| x[point]));
        let pull = self.stiffness * self.strain(&edges) + self.viscous(&edges, v, delay);
        self.apply(&edges, &pull, forces);
    }

    fn viscous(&self, now: &[Vector; 3], v: &[Vector], delay: f64) -> Vector {
        let rates = edges(&self.points.map(|point| v[point]));
        self.stiffness * Vector::from_fn(|i, _| now[i].dot(&rates[i]) * delay)
    }

    fn apply(&self, edges: &[Vector; 3], pull: &Vector, forces: &mut [Vector]) {
        for i in 0..3 {
            let force = edges[i] * pull[i];
            forces[self.points[(i + 1) % 3]] += force;
            forces[self.points[(i + 2) % 3]] -= force;
        }
    }

    /// Adds forces, and the matrices. What pressure would take away from stiffness is left out, so that the matrices are positive.
    pub fn assemble(&self, x: &[Vector], v: &[Vector], weights: &Weights, assembly: &mut Assembly) {
        let edges = edges(&self.points.map(|point| x[point]));
        let elastic = self.stiffness * self.strain(&edges);
        let pull = elastic + self.viscous(&edges, v, weights.delay);
        self.apply(&edges, &pull, assembly.forces);
        let [a, b, c] = edges;
        let zero = Vector::zeros();
        let gradients = [
            Matrix::from_columns(&[zero, b, -c]),
            Matrix::from_columns(&[-a, zero, c]),
            Matrix::from_columns(&[a, -b, zero]),
        ];
        let products = gradients.map(|gradient| gradient * self.stiffness);
        let tension = elastic.map(|pull| pull.max(0.0));
        for i in 0..3 {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            let material = products[i] * gradients[i].transpose();
            let geometric = Matrix::from_diagonal_element(tension[j] + tension[k]);
            assembly.diagonal(self.points[i], &material, &geometric, weights);
            let material = products[j] * gradients[k].transpose();
            let geometric = Matrix::from_diagonal_element(-tension[i]);
            let pair = (self.points[j], self.points[k]);
            assembly.pair(self.slots[i], pair, &material, &geometric, weights);
        }
    }
}
