//! Tests of the sparse elimination against dense elimination, and of its bounds.

use super::*;

/// Numbers in 0..1 (xorshift64*, S. Vigna, ACM TOMS 42 (2016) 30).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 11) as f64 / (1u64 << 53) as f64
    }
    fn below(&mut self, n: usize) -> usize {
        (self.next() * n as f64) as usize
    }
}

fn patterns(n: usize, random: &mut Random) -> Vec<Vec<(u32, u32)>> {
    let both = |a: usize, b: usize| [(a as u32, b as u32), (b as u32, a as u32)];
    vec![
        (1..n).flat_map(|k| both(k - 1, k)).collect(),
        (1..n).flat_map(|k| both(random.below(k), k)).collect(),
        (1..n).filter(|k| k % 7 != 0).flat_map(|k| both(random.below(k), k)).collect(),
        (0..n).flat_map(|k| (k.saturating_sub(2)..k).flat_map(move |j| both(j, k))).collect(),
        (0..2 * n).map(|_| (random.below(n) as u32, random.below(n) as u32)).collect(),
        (1..n).flat_map(|k| both(0, k).into_iter().chain(both(n - 1, k))).collect(),
    ]
}

/// Random values, rows diagonally dominant; the same matrix dense.
fn fill(pattern: &Pattern, couplings: &[(u32, u32)], random: &mut Random) -> (Vec<f64>, Vec<f64>) {
    let n = pattern.unknowns();
    let (mut values, mut dense) = (vec![0.0; pattern.entries()], vec![0.0; n * n]);
    for &(r, c) in couplings.iter().filter(|(r, c)| r != c) {
        let (r, c, v) = (r as usize, c as usize, random.next() - 0.4);
        values[pattern.entry(r, c).unwrap()] = v;
        dense[r * n + c] = v;
    }
    for k in 0..n {
        let d = -0.1 - dense[k * n..(k + 1) * n].iter().map(|v: &f64| v.abs()).sum::<f64>();
        values[pattern.entry(k, k).unwrap()] = d;
        dense[k * n + k] = d;
    }
    (values, dense)
}

/// Gaussian elimination with row exchange by size of `measure`.
fn gauss<F: Field>(a: &mut [F], b: &mut [F], measure: fn(F) -> f64) {
    let n = b.len();
    for k in 0..n {
        let p = (k..n).max_by(|&i, &j| measure(a[i * n + k]).total_cmp(&measure(a[j * n + k]))).unwrap();
        (0..n).for_each(|j| a.swap(k * n + j, p * n + j));
        b.swap(k, p);
        for i in k + 1..n {
            let m = a[i * n + k].mul(a[k * n + k].reciprocal());
            (k..n).for_each(|j| a[i * n + j] = a[i * n + j].sub(m.mul(a[k * n + j])));
            b[i] = b[i].sub(m.mul(b[k]));
        }
    }
    for k in (0..n).rev() {
        let s = (k + 1..n).fold(b[k], |s, j| s.sub(a[k * n + j].mul(b[j])));
        b[k] = s.mul(a[k * n + k].reciprocal());
    }
}

#[test]
fn sparse_elimination_agrees_with_dense_elimination() {
    let mut random = Random(7);
    for n in [1, 2, 9, 40] {
        for couplings in patterns(n, &mut random) {
            let pattern = Pattern::new(n, &couplings).unwrap();
            let (values, dense) = fill(&pattern, &couplings, &mut random);
            let scale = 0.7;
            let shifts = [1.3, 0.4, 2.0].map(|re| Complex { re, im: 3.0 * random.next() });
            let rhs: Vec<f64> = (0..n).map(|_| random.next() - 0.5).collect();
            let reference = |shift: Complex| {
                let mut a: Vec<Complex> = dense.iter().map(|v| Complex::from_f64(-scale * v)).collect();
                (0..n).for_each(|k| a[k * n + k] = a[k * n + k].add(shift));
                let mut b: Vec<Complex> = rhs.iter().map(|&v| Complex::from_f64(v)).collect();
                gauss(&mut a, &mut b, |z| z.re.hypot(z.im));
                b
            };
            let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-12 * (1.0 + b.abs()), "{n}: {a} {b}");

            let (mut factors, mut x) = (Vec::new(), rhs.clone());
            assert!(pattern.factor(&values, 1.3, scale, &mut factors));
            pattern.solve(&factors, &mut x);
            reference(Complex::from_f64(1.3)).iter().zip(&x).for_each(|(r, &x)| close(x, r.re));

            let (mut factors, mut x) = (Vec::new(), Vec::new());
            x.extend(rhs.iter().map(|&v| Complex::from_f64(v)));
            assert!(pattern.factor(&values, shifts[0], scale, &mut factors));
            pattern.solve(&factors, &mut x);
            for (r, x) in reference(shifts[0]).iter().zip(&x) {
                close(x.re, r.re);
                close(x.im, r.im);
            }

            let (mut factors, mut x) = (Vec::new(), Vec::new());
            x.extend(rhs.iter().map(|&v| Wide::<3>::from_f64(v)));
            let shift = Wide { re: shifts.map(|s| s.re), im: shifts.map(|s| s.im) };
            assert!(pattern.factor(&values, shift, scale, &mut factors));
            pattern.solve(&factors, &mut x);
            for (l, &shift) in shifts.iter().enumerate() {
                for (r, x) in reference(shift).iter().zip(&x) {
                    close(x.re[l], r.re);
                    close(x.im[l], r.im);
                }
            }

            // The first lane alone, if it is real.
            let real = Complex::from_f64(shifts[0].re);
            let shift = Wide { im: [0.0, shifts[1].im, shifts[2].im], ..shift };
            assert!(pattern.is_dominant(&values) && pattern.factor(&values, shift, scale, &mut factors));
            let mut both: Vec<[f64; 2]> = rhs.iter().map(|v| [*v, -3.0 * v]).collect();
            pattern.solve_real(&factors, &mut both);
            for (r, x) in reference(real).iter().zip(&both) {
                close(x[0], r.re);
                close(x[1], -3.0 * r.re);
            }

            let mut product = vec![0.0; n];
            pattern.multiply(&values, &rhs, &mut product);
            for (k, &p) in product.iter().enumerate() {
                close(p, (0..n).map(|j| dense[k * n + j] * rhs[j]).sum());
            }
        }
    }
}

#[test]
fn trees_take_linear_space_and_fill_is_bounded() {
    let mut random = Random(3);
    for n in [10usize, 1_000, 100_000] {
        let tree: Vec<_> = (1..n).map(|k| (random.below(k) as u32, k as u32)).collect();
        assert_eq!(Pattern::new(n, &tree).unwrap().entries(), 3 * n - 2);
    }
    let band: Vec<_> = (2..1_000).flat_map(|k| [(k, k - 1), (k, k - 2)]).collect();
    assert_eq!(Pattern::new(1_000, &band).unwrap().entries(), 1_000 + 2 * (999 + 998));
    // Eliminating the hub first couples everything with everything: 9e6 entries.
    let star: Vec<_> = (0..2_999).map(|k| (2_999, k)).collect();
    assert!(Pattern::new(3_000, &star).is_none());
    assert_eq!(Pattern::new(100, &star[..0]).unwrap().entries(), 100);
    assert!(Pattern::new(3, &[(0, 3)]).is_none());
    let missing = Pattern::new(3, &[(0, 1), (1, 0), (2, 2), (1, 0)]).unwrap();
    assert_eq!((missing.entries(), missing.entry(2, 0), missing.entry(9, 9)), (5, None, None));
}

#[test]
fn rows_are_dominant_whose_diagonal_outweighs_the_rest() {
    let pattern = Pattern::new(3, &[(0, 1), (1, 0), (1, 2), (2, 1)]).unwrap();
    let dominant = |diagonal: [f64; 3], [upper, lower]: [f64; 2]| {
        let mut values = vec![0.0; pattern.entries()];
        values[..3].copy_from_slice(&diagonal);
        values[pattern.entry(1, 2).unwrap()] = upper;
        values[pattern.entry(2, 1).unwrap()] = lower;
        values[pattern.entry(1, 0).unwrap()] = 1.0;
        pattern.is_dominant(&values)
    };
    assert!(dominant([0.0, -3.0, -1.5], [2.0, -1.5]));
    assert!(!dominant([0.0, -3.0, -1.5], [2.1, 1.0]) && !dominant([0.0, -3.0, -1.5], [1.0, -1.6]));
    assert!(!dominant([1.0, -3.0, -1.5], [2.0, 1.0]) && !dominant([0.0, f64::NAN, -1.5], [2.0, 1.0]));
    assert!(!pattern.is_dominant(&[]));
}

#[test]
fn zero_and_infinite_pivots_are_reported() {
    for couplings in [&[(0, 1), (1, 2)][..], &[(0, 1), (1, 2), (0, 2)]] {
        let pattern = Pattern::new(3, couplings).unwrap();
        let mut values = vec![0.0; pattern.entries()];
        let mut factors = Vec::new();
        assert!(pattern.factor(&values, 1.0, 1.0, &mut factors));
        assert!(!pattern.factor(&values, 0.0, 1.0, &mut factors));
        values[0] = f64::NAN;
        assert!(!pattern.factor(&values, 1.0, 1.0, &mut factors));
        values[0] = 1.0;
        let shift = Wide { re: [2.0, 1.0], im: [1.0, 0.0] };
        assert!(!pattern.factor(&values, shift, 1.0, &mut Vec::new()));
        assert!(!pattern.factor(&values[1..], 1.0, 1.0, &mut factors));
    }
}
