//! Coefficients of Radau IIA collocation, computed from their definition.
//!
//! E. Hairer, G. Wanner, Solving Ordinary Differential Equations II (2nd ed. 1996), sections IV.5 and IV.8.
//! With `L_j` the Lagrange polynomials on the nodes 0, c_1 .. c_s and stage increments `Z_j = u(c_j) - y`,
//! collocation reads `sum_j L_j'(c_i) Z_j = h f(c_i h, y + Z_i)`: the matrix `L_j'(c_i)` is the inverse of
//! the Runge-Kutta matrix A, and is found here without forming A.

use crate::sparse::{Complex, Field};

/// Coefficients for `S` stages, `S` odd, with `L = (S + 1) / 2` lanes: the real eigenvalue, then one of each
/// pair.
#[derive(Clone, Debug)]
pub struct Collocation<const S: usize, const L: usize> {
    /// Nodes c_1 .. c_s in (0, 1], the last exactly 1.
    pub nodes: [f64; S],
    /// Eigenvalues of the inverse of A; lane 0 is real.
    pub lambda: [Complex; L],
    /// Real form of the eigenvectors: columns `v_0, Re v_1, Im v_1, ..`.
    pub vectors: [[f64; S]; S],
    /// Inverse of `vectors`.
    pub inverse: [[f64; S]; S],
    /// `-L_j'(0)`: the embedded formula of order s differs from the collocation by
    /// `gamma_0 (h f(0, y) - sum_j L_j'(0) Z_j)`, gamma_0 the inverse of the real eigenvalue (IV.8).
    pub error: [f64; S],
    /// Two places as far from the nodes as any.
    pub between: [Between<S>; 2],
    /// Coefficient k (1 .. s, at place k - 1) of `L_j` in Bernstein form of degree s; coefficient 0 is 0.
    pub bernstein: [[f64; S]; S],
}

/// A place between two nodes.
#[derive(Clone, Debug)]
pub struct Between<const S: usize> {
    /// The place, as a part of the step.
    pub place: f64,
    /// Values and slopes there of `L_1 .. L_s`.
    pub values: [f64; S],
    pub slopes: [f64; S],
    /// The defect there in units of that at the start, for equations that are linear and read no clock: a polynomial of degree s that
    /// vanishes at the nodes.
    pub defect: f64,
}

impl<const S: usize, const L: usize> Collocation<S, L> {
    /// Computes everything; small loops of a few microseconds.
    pub fn compute() -> Self {
        let nodes = radau_nodes::<S>();
        let mut all = [0.0; 8];
        all[1..=S].copy_from_slice(&nodes);
        let all = &all[..=S];

        let lambda = eigenvalues::<S, L>();
        let mut vectors = [[0.0; S]; S];
        for (l, &value) in lambda.iter().enumerate() {
            for i in 0..S {
                let v = eigenvector(&nodes, value, nodes[i]);
                if l == 0 {
                    vectors[i][0] = v.re;
                } else {
                    vectors[i][2 * l - 1] = v.re;
                    vectors[i][2 * l] = v.im;
                }
            }
        }
        // Unit size of each vector's largest part, so that transformed and plain increments are comparable.
        for l in 0..L {
            let columns = if l == 0 { 0..1 } else { 2 * l - 1..2 * l + 1 };
            let size = vectors.iter().flat_map(|r| &r[columns.clone()]).fold(0.0f64, |m, v| m.max(v.abs()));
            vectors.iter_mut().flat_map(|r| &mut r[columns.clone()]).for_each(|v| *v /= size);
        }
        let mut bernstein = [[0.0; S]; S];
        let mut error = [0.0; S];
        for j in 0..S {
            let coefficients = lagrange_bernstein(all, j + 1);
            for k in 0..S {
                bernstein[k][j] = coefficients[k + 1];
            }
            error[j] = -lagrange_derivative(all, j + 1, 0);
        }
        // At the end only the last stage counts.
        bernstein[S - 1] = [0.0; S];
        bernstein[S - 1][S - 1] = 1.0;
        let middle = (S - 1) / 2;
        let between = [middle - 1, middle].map(|i| Between::at(0.5 * (nodes[i] + nodes[i + 1]), &nodes, all));
        Collocation { nodes, lambda, inverse: invert(&vectors), vectors, error, between, bernstein }
    }

    /// Values at `x` of the Lagrange polynomials `L_1 .. L_s` (those that vanish at 0).
    pub fn lagrange(&self, x: f64) -> [f64; S] {
        lagrange(&self.nodes, x)
    }
}

impl<const S: usize> Between<S> {
    /// A place that is no node; `all` are the nodes with 0 before them.
    fn at(place: f64, nodes: &[f64; S], all: &[f64]) -> Self {
        let values = lagrange(nodes, place);
        let slope = |j: usize| {
            let others = all.iter().enumerate().filter(|(m, _)| *m != j + 1);
            values[j] * others.map(|(_, c)| 1.0 / (place - c)).sum::<f64>()
        };
        let defect = nodes.iter().map(|c| (place - c) / -c).product();
        Between { place, values, slopes: std::array::from_fn(slope), defect }
    }
}

fn lagrange<const S: usize>(nodes: &[f64; S], x: f64) -> [f64; S] {
    std::array::from_fn(|j| {
        let others = (0..S).filter(|&m| m != j);
        let own = nodes[j];
        others.fold(x / own, |p, m| p * (x - nodes[m]) / (own - nodes[m]))
    })
}

/// Zeros of `P_s(2x - 1) - P_{s-1}(2x - 1)`, P the Legendre polynomials (IV.5), by Newton's method with
/// deflation.
fn radau_nodes<const S: usize>() -> [f64; S] {
    // Value and derivative by the three-term recurrence.
    let value = |x: f64| {
        let t = 2.0 * x - 1.0;
        let (mut p, mut q, mut dp, mut dq) = (t, 1.0, 1.0, 0.0);
        for k in 2..=S {
            let k = k as f64;
            let next = ((2.0 * k - 1.0) * t * p - (k - 1.0) * q) / k;
            let slope = ((2.0 * k - 1.0) * (p + t * dp) - (k - 1.0) * dq) / k;
            (q, p, dq, dp) = (p, next, dp, slope);
        }
        (p - q, 2.0 * (dp - dq))
    };
    let mut nodes = [1.0; S];
    for i in 0..S - 1 {
        // From the left of all remaining zeros Newton's method rises to the smallest of them.
        let mut x = 0.0;
        for _ in 0..100 {
            let (f, d) = value(x);
            let found: f64 = nodes[..i].iter().chain([&1.0]).map(|c| 1.0 / (x - c)).sum();
            let step = 1.0 / (d / f - found);
            if !(step.is_finite() && step.abs() > 1e-15) {
                break;
            }
            x -= step;
        }
        // Last corrections without deflation, free of its rounding.
        for _ in 0..2 {
            let (f, d) = value(x);
            x -= f / d;
        }
        nodes[i] = x;
    }
    nodes
}

/// Eigenvalues of the inverse of A with imaginary part >= 0, the real one first.
///
/// The stability function is the (s - 1, s) Padé approximation of exp (IV.3, IV.5), its denominator det(I - z
/// A); so the eigenvalues are the zeros of `sum_l (-z)^l s! (2s - 1 - l)! / ((s - l)! (2s - 1)! l!)`. Found
/// together by the method of Durand and Kerner.
fn eigenvalues<const S: usize, const L: usize>() -> [Complex; L] {
    let mut c = [1.0; 8];
    for l in 0..S {
        c[l + 1] = -c[l] * (S - l) as f64 / ((2 * S - 1 - l) as f64 * (l + 1) as f64);
    }
    let start = Complex { re: 0.4, im: 0.9 };
    let mut z = [Complex::from_f64(S as f64); S];
    for i in 1..S {
        z[i] = z[i - 1].mul(start);
    }
    for _ in 0..200 {
        for i in 0..S {
            let p =
                (0..S).rev().fold(Complex::from_f64(c[S]), |p, l| p.mul(z[i]).add(Complex::from_f64(c[l])));
            let others = (0..S).filter(|&j| j != i);
            let d = others.fold(Complex::from_f64(c[S]), |d, j| d.mul(z[i].sub(z[j])));
            z[i] = z[i].sub(p.mul(d.reciprocal()));
        }
    }
    z.sort_by(|a, b| (a.im.abs() > 1e-9).cmp(&(b.im.abs() > 1e-9)).then(a.im.total_cmp(&b.im)));
    std::array::from_fn(|l| if l == 0 { Complex::from_f64(z[0].re) } else { z[S - L + l] })
}

/// Component at node `x` of the eigenvector for `lambda`.
///
/// Along an eigenvector the collocation polynomial p, p(0) = 0, fulfils `p' - lambda p = M` with a multiple M
/// of `prod (x - c_i)`; hence `p = -sum_k M^(k) / lambda^(k+1)`.
fn eigenvector(nodes: &[f64], lambda: Complex, x: f64) -> Complex {
    // Taylor coefficients of M around x: a product of the factors (x - c_i) + t.
    let mut taylor = [0.0; 8];
    taylor[0] = 1.0;
    for (i, c) in nodes.iter().enumerate() {
        for k in (0..=i + 1).rev() {
            taylor[k] = taylor[k] * (x - c) + if k > 0 { taylor[k - 1] } else { 0.0 };
        }
    }
    let inverse = lambda.reciprocal();
    let (mut power, mut sum, mut factorial) = (inverse, Complex::zero(), 1.0);
    for (k, t) in taylor.iter().enumerate().take(nodes.len() + 1) {
        factorial *= k.max(1) as f64;
        sum = sum.add(power.scale(t * factorial));
        power = power.mul(inverse);
    }
    sum
}

/// Derivative at node `i` of the Lagrange polynomial of node `j`.
fn lagrange_derivative(nodes: &[f64], j: usize, i: usize) -> f64 {
    let own = nodes[j];
    let others = |skip: usize| (0..nodes.len()).filter(move |&m| m != j && m != skip);
    if i == j {
        return others(j).map(|m| 1.0 / (own - nodes[m])).sum();
    }
    others(i).fold(1.0 / (own - nodes[i]), |p, m| p * (nodes[i] - nodes[m]) / (own - nodes[m]))
}

/// Bernstein coefficients of the Lagrange polynomial of node `j`, multiplied up from its linear factors
/// (R. Farouki, V. Rajan, Computer Aided Geometric Design 5 (1988) 1).
fn lagrange_bernstein(nodes: &[f64], j: usize) -> [f64; 8] {
    let mut b = [0.0; 8];
    b[0] = 1.0;
    let others = nodes.iter().enumerate().filter(|&(m, _)| m != j);
    for (degree, (_, c)) in (1..).zip(others) {
        let (at_0, at_1) = (-c / (nodes[j] - c), (1.0 - c) / (nodes[j] - c));
        for k in (0..=degree).rev() {
            let share = k as f64 / degree as f64;
            b[k] = (1.0 - share) * at_0 * b[k] + if k > 0 { share * at_1 * b[k - 1] } else { 0.0 };
        }
    }
    b
}

/// Inverse by Gauss-Jordan elimination with row exchange; the matrix is known to be regular.
fn invert<const S: usize>(matrix: &[[f64; S]; S]) -> [[f64; S]; S] {
    let mut a = *matrix;
    let mut b = std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))));
    for k in 0..S {
        let p = (k..S).fold(k, |p, i| if a[i][k].abs() > a[p][k].abs() { i } else { p });
        a.swap(k, p);
        b.swap(k, p);
        let d = 1.0 / a[k][k];
        a[k] = a[k].map(|v| v * d);
        b[k] = b[k].map(|v: f64| v * d);
        for i in (0..S).filter(|&i| i != k) {
            let m = a[i][k];
            for j in 0..S {
                a[i][j] -= m * a[k][j];
                b[i][j] -= m * b[k][j];
            }
        }
    }
    b
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: f64, b: f64, tolerance: f64) {
        assert!((a - b).abs() <= tolerance * (1.0 + b.abs()), "{a} is not {b}");
    }

    /// Published: section IV.5 (nodes, A) and the constants of RADAU5 (IV.8: eigenvalues, error
    /// coefficients).
    #[test]
    fn coefficients_of_three_stages_are_the_published_ones() {
        let c = Collocation::<3, 2>::compute();
        let r = 6f64.sqrt();
        [(4.0 - r) / 10.0, (4.0 + r) / 10.0, 1.0].iter().zip(c.nodes).for_each(|(p, c)| close(c, *p, 1e-15));
        let (a, b) = (81f64.cbrt(), 9f64.cbrt());
        let (re, im) = ((12.0 - a + b) / 60.0, (a + b) * 3f64.sqrt() / 60.0);
        let size = re * re + im * im;
        close(c.lambda[0].re, 30.0 / (6.0 + a - b), 1e-14);
        close(c.lambda[1].re, re / size, 1e-14);
        close(c.lambda[1].im, im / size, 1e-14);
        let error = [-(13.0 + 7.0 * r) / 3.0, (-13.0 + 7.0 * r) / 3.0, -1.0 / 3.0];
        error.iter().zip(c.error).for_each(|(p, e)| close(e, *p, 1e-14));
        let published = [
            [(88.0 - 7.0 * r) / 360.0, (296.0 - 169.0 * r) / 1800.0, (-2.0 + 3.0 * r) / 225.0],
            [(296.0 + 169.0 * r) / 1800.0, (88.0 + 7.0 * r) / 360.0, (-2.0 - 3.0 * r) / 225.0],
            [(16.0 - r) / 36.0, (16.0 + r) / 36.0, 1.0 / 9.0],
        ];
        let all = [0.0, c.nodes[0], c.nodes[1], c.nodes[2]];
        let derivative =
            std::array::from_fn(|i| std::array::from_fn(|j| lagrange_derivative(&all, j + 1, i + 1)));
        let matrix = invert::<3>(&derivative);
        matrix.iter().flatten().zip(published.iter().flatten()).for_each(|(m, p)| close(*m, *p, 1e-14));
    }

    fn check<const S: usize, const L: usize>() {
        let c = Collocation::<S, L>::compute();
        let mut all = [0.0; 8];
        all[1..=S].copy_from_slice(&c.nodes);
        for i in 0..S {
            // Derivatives of x^q at the nodes are exact for q <= s.
            for q in 1..=S as i32 {
                let d = |j: usize| lagrange_derivative(&all[..=S], j + 1, i + 1) * c.nodes[j].powi(q);
                close((0..S).map(d).sum(), f64::from(q) * c.nodes[i].powi(q - 1), 1e-13);
            }
            // Matrix times vectors = vectors times the real blocks of the eigenvalues.
            for column in 0..S {
                let d = |j: usize| lagrange_derivative(&all[..=S], j + 1, i + 1) * c.vectors[j][column];
                let l = c.lambda[column.div_ceil(2)];
                let v = &c.vectors[i];
                let expected = match column {
                    0 => l.re * v[0],
                    m if m % 2 == 1 => l.re * v[m] - l.im * v[m + 1],
                    m => l.im * v[m - 1] + l.re * v[m],
                };
                close((0..S).map(d).sum(), expected, 1e-12);
                let unit: f64 = (0..S).map(|j| c.inverse[i][j] * c.vectors[j][column]).sum();
                close(unit, f64::from(u8::from(i == column)), 1e-12);
            }
            // Bernstein form evaluated by de Casteljau's method at 0.3 against the Lagrange form.
            let mut b = [0.0; 8];
            (0..S).for_each(|k| b[k + 1] = c.bernstein[k][i]);
            (0..S).for_each(|r| (0..S - r).for_each(|k| b[k] += 0.3 * (b[k + 1] - b[k])));
            close(b[0], c.lagrange(0.3)[i], 1e-14);
        }
        assert!(c.nodes.windows(2).all(|w| w[0] < w[1]) && c.nodes[0] > 0.0 && c.nodes[S - 1] == 1.0);
    }

    #[test]
    fn coefficients_satisfy_their_definitions() {
        check::<3, 2>();
        check::<5, 3>();
        // Order conditions of the quadrature, degree 2s - 2, through the last row of A = inverse of the
        // derivative.
        let c = Collocation::<5, 3>::compute();
        let mut all = [0.0; 6];
        all[1..].copy_from_slice(&c.nodes);
        let d = std::array::from_fn(|i| std::array::from_fn(|j| lagrange_derivative(&all, j + 1, i + 1)));
        let weights = invert::<5>(&d)[4];
        for q in 0..=8 {
            close((0..5).map(|j| weights[j] * c.nodes[j].powi(q)).sum(), 1.0 / f64::from(q + 1), 1e-13);
        }
    }
}
