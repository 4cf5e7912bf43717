//! Explicit Runge-Kutta pairs as data, with their error estimators and dense output.
//!
//! Two embedded pairs: Dormand-Prince 5(4) and Hairer's DOP853 of order 8(5,3). Both are "first same as
//! last": the last stage of a step is the rate at its end and serves as the first stage of the next one.
//! Inside a step each component is a polynomial, given here in the Bernstein basis on [0, 1]. There the
//! coefficients bound the polynomial, and its sign changes bound the number of roots, which is what event
//! location needs.
//!
//! Sources: J. R. Dormand, P. J. Prince, "A family of embedded Runge-Kutta formulae", J. Comput. Appl. Math.
//! 6 (1980) 19-26; E. Hairer, S. P. Norsett, G. Wanner, "Solving Ordinary Differential Equations I", 2nd ed.
//! 1993, sections II.5 (the pairs) and II.6 (dense output), and their codes DOPRI5 and DOP853.

/// An explicit Runge-Kutta pair with dense output, for `y' = f(t, y)` and steps of length `h`.
///
/// Stage `i` (from 0) is `k_i = f(t + c_i h, y + h sum_j a_ij k_j)` over `j < i`.
#[derive(Debug, Clone, Copy)]
pub struct Tableau {
    /// Order of the solution that is carried on.
    #[cfg(test)]
    pub order: u32,
    /// Order `q` of the error estimate for step control: the estimate falls like `h^(q+1)`.
    pub error_order: u32,
    /// Stages of a step, with the last one, the rate at the end, counted. Further rows of `a` are the extra
    /// stages of the dense output, wanted only for accepted steps.
    pub stages: usize,
    /// Nodes as fractions of the step, one for each stage, extra stages included.
    pub c: &'static [f64],
    /// Stage coefficients; row `i` has `i` entries. Row `stages - 1` holds the weights of the solution.
    pub a: &'static [&'static [f64]],
    /// Weights of the error estimates, each of `stages` entries: one for the 5(4) pair; for DOP853 two, the
    /// estimate of 5th order and then that of 3rd order, to be joined by [`dop853_error`].
    pub e: &'static [&'static [f64]],
    /// Weights of the dense output beyond its Hermite part, each with one entry for every stage.
    pub d: &'static [&'static [f64]],
}

#[cfg(test)]
impl Tableau {
    /// Weights of the solution at the end of the step: `y1 = y0 + h sum_i b_i k_i`, over `stages - 1` stages.
    pub fn weights(&self) -> &'static [f64] {
        self.a[self.stages - 1]
    }
}

/// Dormand-Prince 5(4): 7 stages, dense output of degree 4 without extra stages.
///
/// Hairer, Norsett, Wanner, table II.5.2; the row `d` is that of their code DOPRI5 (after Shampine 1986,
/// "Some practical Runge-Kutta formulas", Math. Comp. 46, 135-150).
#[rustfmt::skip]
pub static DOPRI5: Tableau = Tableau {
    #[cfg(test)]
    order: 5,
    error_order: 4,
    stages: 7,
    c: &[0.0, 0.2, 0.3, 0.8, 8.0 / 9.0, 1.0, 1.0],
    a: &[
        &[],
        &[0.2],
        &[3.0 / 40.0, 9.0 / 40.0],
        &[44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0],
        &[19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0],
        &[9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0],
        &[35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0],
    ],
    e: &[&[
        71.0 / 57600.0, 0.0, -71.0 / 16695.0, 71.0 / 1920.0, -17253.0 / 339200.0, 22.0 / 525.0, -1.0 / 40.0,
    ]],
    d: &[&[
        -12715105075.0 / 11282082432.0, 0.0, 87487479700.0 / 32700410799.0,
        -10690763975.0 / 1880347072.0, 701980252875.0 / 199316789632.0,
        -1453857185.0 / 822651844.0, 69997945.0 / 29380423.0,
    ]],
};

/// DOP853, order 8(5,3): 12 stages and the rate at the end as 13th, three more for the dense output.
///
/// Coefficients of Hairer's code DOP853 (Hairer, Norsett, Wanner, sections II.5 and II.6), rounded to f64.
/// Hairer controls the step with the exponent 1/8, hence the error order 7.
#[rustfmt::skip]
pub static DOP853: Tableau = Tableau {
    #[cfg(test)]
    order: 8,
    error_order: 7,
    stages: 13,
    c: &[
        0.0, 0.05260015195876773, 0.0789002279381516, 0.1183503419072274, 0.2816496580927726,
        0.3333333333333333, 0.25, 0.3076923076923077, 0.6512820512820513, 0.6, 0.8571428571428571, 1.0, 1.0,
        0.1, 0.2, 0.7777777777777778,
    ],
    a: &[
        &[],
        &[0.05260015195876773],
        &[0.0197250569845379, 0.0591751709536137],
        &[0.02958758547680685, 0.0, 0.08876275643042054],
        &[0.2413651341592667, 0.0, -0.8845494793282861, 0.924834003261792],
        &[0.037037037037037035, 0.0, 0.0, 0.17082860872947386, 0.12546768756682242],
        &[0.037109375, 0.0, 0.0, 0.17025221101954405, 0.06021653898045596, -0.017578125],
        &[
            0.03709200011850479, 0.0, 0.0, 0.17038392571223998, 0.10726203044637328, -0.015319437748624402,
            0.008273789163814023,
        ],
        &[
            0.6241109587160757, 0.0, 0.0, -3.3608926294469414, -0.868219346841726, 27.59209969944671,
            20.154067550477894, -43.48988418106996,
        ],
        &[
            0.47766253643826434, 0.0, 0.0, -2.4881146199716677, -0.590290826836843, 21.230051448181193,
            15.279233632882423, -33.28821096898486, -0.020331201708508627,
        ],
        &[
            -0.9371424300859873, 0.0, 0.0, 5.186372428844064, 1.0914373489967295, -8.149787010746927,
            -18.52006565999696, 22.739487099350505, 2.4936055526796523, -3.0467644718982196,
        ],
        &[
            2.273310147516538, 0.0, 0.0, -10.53449546673725, -2.0008720582248625, -17.9589318631188,
            27.94888452941996, -2.8589982771350235, -8.87285693353063, 12.360567175794303, 0.6433927460157636,
        ],
        &[
            0.054293734116568765, 0.0, 0.0, 0.0, 0.0, 4.450312892752409, 1.8915178993145003,
            -5.801203960010585, 0.3111643669578199, -0.1521609496625161, 0.20136540080403034,
            0.04471061572777259,
        ],
        &[
            0.056167502283047954, 0.0, 0.0, 0.0, 0.0, 0.0, 0.25350021021662483, -0.2462390374708025,
            -0.12419142326381637, 0.15329179827876568, 0.00820105229563469, 0.007567897660545699, -0.008298,
        ],
        &[
            0.03183464816350214, 0.0, 0.0, 0.0, 0.0, 0.028300909672366776, 0.053541988307438566,
            -0.05492374857139099, 0.0, 0.0, -0.00010834732869724932, 0.0003825710908356584,
            -0.00034046500868740456, 0.1413124436746325,
        ],
        &[
            -0.42889630158379194, 0.0, 0.0, 0.0, 0.0, -4.697621415361164, 7.683421196062599, 4.06898981839711,
            0.3567271874552811, 0.0, 0.0, 0.0, -0.0013990241651590145, 2.9475147891527724, -9.15095847217987,
        ],
    ],
    e: &[
        &[
            0.01312004499419488, 0.0, 0.0, 0.0, 0.0, -1.2251564463762044, -0.4957589496572502,
            1.6643771824549864, -0.35032884874997366, 0.3341791187130175, 0.08192320648511571,
            -0.022355307863886294, 0.0,
        ],
        &[
            -0.18980075407240762, 0.0, 0.0, 0.0, 0.0, 4.450312892752409, 1.8915178993145003,
            -5.801203960010585, -0.42268232132379197, -0.1521609496625161, 0.20136540080403034,
            0.022651792198360825, 0.0,
        ],
    ],
    d: &[
        &[
            -8.428938276109013, 0.0, 0.0, 0.0, 0.0, 0.5667149535193777, -3.0689499459498917, 2.38466765651207,
            2.117034582445028, -0.871391583777973, 2.2404374302607883, 0.6315787787694688,
            -0.08899033645133331, 18.148505520854727, -9.194632392478356, -4.436036387594894,
        ],
        &[
            10.427508642579134, 0.0, 0.0, 0.0, 0.0, 242.28349177525817, 165.20045171727028,
            -374.5467547226902, -22.113666853125306, 7.733432668472264, -30.674084731089398,
            -9.332130526430229, 15.697238121770845, -31.139403219565178, -9.35292435884448, 35.81684148639408,
        ],
        &[
            19.985053242002433, 0.0, 0.0, 0.0, 0.0, -387.0373087493518, -189.17813819516758,
            527.8081592054236, -11.57390253995963, 6.8812326946963, -1.0006050966910838, 0.7777137798053443,
            -2.778205752353508, -60.19669523126412, 84.32040550667716, 11.99229113618279,
        ],
        &[
            -25.69393346270375, 0.0, 0.0, 0.0, 0.0, -154.18974869023643, -231.5293791760455,
            357.6391179106141, 93.40532418362432, -37.45832313645163, 104.0996495089623, 29.8402934266605,
            -43.53345659001114, 96.32455395918828, -39.17726167561544, -149.72683625798564,
        ],
    ],
};

/// Joins the two error estimates of one component of DOP853 (5th order `e5`, 3rd order `e3`, both with the
/// factor `h`) into the one used for step control: `e5^2 / sqrt(e5^2 + 0.01 e3^2)`, never negative.
///
/// This is the formula of the code DOP853 for a single component, for a maximum norm over the components.
/// It is homogeneous, so the estimates may be divided by the tolerance before or the result after. It gives
/// infinity when an estimate is not finite, because a NaN would be lost in `f64::max`.
pub fn dop853_error(e5: f64, e3: f64) -> f64 {
    if !e5.is_finite() || !e3.is_finite() {
        return f64::INFINITY;
    }
    if e5 == 0.0 {
        return 0.0;
    }
    // The quotient of e5 and the root is at most 1, and hypot does not overflow or underflow in the squares.
    e5.abs() * (e5.abs() / e5.hypot(0.1 * e3))
}

/// Dense output weights applied to the stage rates of one component.
///
/// The weights sum to zero, so the first rate is taken off before: what is summed is then of the size of the
/// variation in the step, and a constant rate gives exactly zero in spite of weights of several hundred.
fn dense_sum(d: &[f64], hk: &[f64]) -> f64 {
    let first = hk.first().copied().unwrap_or(0.0);
    d.iter().zip(hk).map(|(d, k)| d * (k - first)).sum()
}

/// Dense output of some components of a [`DOPRI5`] step: Bernstein coefficients of degree 4 on [0, 1].
///
/// `y0` and `y1` are the values at the ends of the step and `hk` is `h` times the rates of each stage. With
/// `r2 = y1 - y0`, `r3 = hk1 - r2`, `r4 = r2 - hk7 - r3`, `r5 = sum d_i hk_i` it is the polynomial
/// `y0 + s r2 + s(1-s) r3 + s^2(1-s) r4 + s^2(1-s)^2 r5` of the code DOPRI5 (Hairer, Norsett, Wanner, II.6).
/// The ends are exact: `b_0 = y0`, `b_4 = y1`; the slopes there are `hk1` and `hk7`.
/// Its error in a step falls like `h^5`.
#[inline]
pub fn dopri5_dense<const N: usize>(y0: &[f64; N], y1: &[f64; N], hk: &[[f64; N]; 7]) -> [[f64; 5]; N] {
    let (first, end) = (&hk[0], &hk[6]);
    // As in `dense_sum`, for all of them side by side.
    let mut r5 = [-0.0; N];
    for (d, k) in DOPRI5.d[0].iter().zip(hk) {
        for j in 0..N {
            r5[j] += d * (k[j] - first[j]);
        }
    }
    std::array::from_fn(|j| {
        let middle = y0[j] + (0.5 * (y1[j] - y0[j]) + (first[j] - end[j] + r5[j]) / 6.0);
        [y0[j], y0[j] + first[j] / 4.0, middle, y1[j] - end[j] / 4.0, y1[j]]
    })
}

/// Dense output of one component of a [`DOP853`] step: Bernstein coefficients of degree 7 on [0, 1].
///
/// `y0` and `y1` are the values at the ends of the step and `hk` is `h` times the 16 stage rates, the 13th
/// (index 12) at the end of the step. The polynomial is that of the code DOP853 (Hairer, Norsett, Wanner,
/// II.6): the cubic Hermite interpolant plus
/// `s^2(1-s)^2 (r5 + s (r6 + (1-s) (r7 + s r8)))`, where `r5..r8` are the sums `sum_i d_i hk_i`.
/// The ends are exact: `b_0 = y0`, `b_7 = y1`; the slopes there are `hk1` and `hk13`.
/// Its error in a step falls like `h^8`.
pub fn dop853_dense(y0: f64, y1: f64, hk: &[f64; 16]) -> [f64; 8] {
    let (first, end) = (hk[0], hk[12]);
    let dy = y1 - y0;
    let [r5, r6, r7, r8] = [0, 1, 2, 3].map(|i| dense_sum(DOP853.d[i], hk));
    // The Hermite cubic raised to degree 7, plus s^i (1-s)^j raised to the same degree. Every coefficient is
    // built from the nearer end, so that small changes are added to the large value once.
    [
        y0,
        y0 + first / 7.0,
        y0 + (dy / 7.0 + (4.0 * first - end + r5) / 21.0),
        y0 + (13.0 / 35.0 * dy + (6.0 * first - 4.0 * end + 3.0 * r5 + r6 + r7) / 35.0),
        y1 - (13.0 / 35.0 * dy + (6.0 * end - 4.0 * first - 3.0 * r5 - 2.0 * r6 - r7 - r8) / 35.0),
        y1 - (dy / 7.0 + (4.0 * end - first - r5 - r6) / 21.0),
        y1 - end / 7.0,
        y1,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    type Rate = fn(f64, [f64; 2]) -> [f64; 2];
    type Solution = fn(f64) -> [f64; 2];

    /// y' = y cos t, with the solution exp(sin t); the second component is its mirror.
    fn cosine(t: f64, y: [f64; 2]) -> [f64; 2] {
        [y[0] * t.cos(), -y[1] * t.cos()]
    }

    fn cosine_solution(t: f64) -> [f64; 2] {
        [t.sin().exp(), (-t.sin()).exp()]
    }

    /// x' = x ln y, y' = -y ln x, with the solution exp(sin t), exp(cos t).
    fn logarithms(_: f64, [x, y]: [f64; 2]) -> [f64; 2] {
        [x * y.ln(), -y * x.ln()]
    }

    fn logarithms_solution(t: f64) -> [f64; 2] {
        [t.sin().exp(), t.cos().exp()]
    }

    const PROBLEMS: [(Rate, Solution); 2] = [(cosine, cosine_solution), (logarithms, logarithms_solution)];

    /// One step: the new values and h times all rates, the extra stages with them.
    fn step(tab: &Tableau, f: Rate, t: f64, h: f64, y: [f64; 2]) -> ([f64; 2], [[f64; 16]; 2]) {
        let mut hk = [[0.0; 16]; 2];
        let mut end = y;
        for (i, (c, row)) in tab.c.iter().zip(tab.a).enumerate() {
            let at = [0, 1].map(|m| y[m] + row.iter().zip(&hk[m]).map(|(a, k)| a * k).sum::<f64>());
            if i == tab.stages - 1 {
                end = at;
            }
            let rate = f(t + c * h, at);
            for m in 0..2 {
                hk[m][i] = h * rate[m];
            }
        }
        (end, hk)
    }

    fn dense(tab: &Tableau, y0: f64, y1: f64, hk: &[f64; 16]) -> Vec<f64> {
        match tab.order {
            5 => dopri5_dense(&[y0], &[y1], &std::array::from_fn(|i| [hk[i]]))[0].to_vec(),
            _ => dop853_dense(y0, y1, hk).to_vec(),
        }
    }

    /// Value of a Bernstein polynomial by de Casteljau's scheme.
    fn bernstein(mut b: Vec<f64>, s: f64) -> f64 {
        while b.len() > 1 {
            b = b.windows(2).map(|p| p[0] + s * (p[1] - p[0])).collect();
        }
        b[0]
    }

    /// Largest global errors over [0, 6]: at the ends of the steps and inside them.
    fn errors(tab: &Tableau, (f, solution): (Rate, Solution), n: usize) -> [f64; 2] {
        let h = 6.0 / n as f64;
        let (mut y, mut at_ends, mut inside) = (solution(0.0), 0.0f64, 0.0f64);
        for i in 0..n {
            let t = i as f64 * h;
            let (end, hk) = step(tab, f, t, h, y);
            for m in 0..2 {
                let b = dense(tab, y[m], end[m], &hk[m]);
                for s in [0.1, 0.3, 0.5, 0.7, 0.9] {
                    inside = inside.max((bernstein(b.clone(), s) - solution(t + s * h)[m]).abs());
                }
                at_ends = at_ends.max((end[m] - solution(t + h)[m]).abs());
            }
            y = end;
        }
        [at_ends, inside]
    }

    #[test]
    fn sum_rules() {
        for tab in [&DOPRI5, &DOP853] {
            assert_eq!(tab.c.len(), tab.a.len());
            for (i, (c, row)) in tab.c.iter().zip(tab.a).enumerate() {
                assert_eq!(row.len(), i);
                assert!((row.iter().sum::<f64>() - c).abs() < 3e-14, "row {i}");
            }
            for row in tab.e {
                assert_eq!(row.len(), tab.stages);
                assert!(row.iter().sum::<f64>().abs() < 1e-14);
            }
            for row in tab.d {
                assert_eq!(row.len(), tab.c.len());
                assert!(row.iter().sum::<f64>().abs() < 1e-12);
            }
            // Quadrature: the weights integrate the powers below the order exactly.
            for p in 0..tab.order as i32 {
                let q: f64 = tab.weights().iter().zip(tab.c).map(|(b, c)| b * c.powi(p)).sum();
                assert!((q * f64::from(p + 1) - 1.0).abs() < 1e-14, "power {p}");
            }
        }
    }

    #[test]
    fn global_errors_fall_with_the_order() {
        for (tab, n) in [(&DOPRI5, 160), (&DOP853, 24)] {
            for problem in PROBLEMS {
                let (coarse, fine) = (errors(tab, problem, n), errors(tab, problem, 2 * n));
                for i in 0..2 {
                    let p = (coarse[i] / fine[i]).log2();
                    assert!(
                        p > f64::from(tab.order) - 0.3 && p < f64::from(tab.order) + 0.7,
                        "order {} measure {i}: {p}",
                        tab.order
                    );
                }
            }
        }
    }

    #[test]
    fn local_errors_fall_with_their_orders() {
        // Powers of h in one step: the estimates (one order above their name), then the dense output.
        let cases = [(&DOPRI5, 0.1, vec![5.0], 5.0), (&DOP853, 0.4, vec![6.0, 4.0], 8.0)];
        for (tab, h, estimates, inside) in cases {
            let measure = |h: f64| {
                let (y, t) = (logarithms_solution(0.3), 0.3);
                let (end, hk) = step(tab, logarithms, t, h, y);
                let mut v: Vec<f64> = tab
                    .e
                    .iter()
                    .map(|e| e.iter().zip(&hk[0]).map(|(e, k)| e * k).sum::<f64>().abs())
                    .collect();
                let b = dense(tab, y[0], end[0], &hk[0]);
                v.push((1..40).fold(0.0, |max: f64, i| {
                    let s = f64::from(i) / 40.0;
                    max.max((bernstein(b.clone(), s) - logarithms_solution(t + s * h)[0]).abs())
                }));
                v
            };
            let (coarse, fine) = (measure(h), measure(h / 2.0));
            for (i, want) in estimates.iter().chain([&inside]).enumerate() {
                let p = (coarse[i] / fine[i]).log2();
                assert!((p - want).abs() < 0.5, "order {} local {i}: {p}", tab.order);
            }
        }
    }

    #[test]
    fn bernstein_form_equals_the_nested_form() {
        let hk: [f64; 16] = std::array::from_fn(|i| (1.7 * i as f64).sin());
        let (y0, y1) = (1.3, -0.4);
        let dot = |d: &[f64]| d.iter().zip(&hk).map(|(d, k)| d * k).sum::<f64>();
        let small = dense(&DOPRI5, y0, y1, &hk);
        let large = dense(&DOP853, y0, y1, &hk);
        assert_eq!([small[0], small[4], large[0], large[7]], [y0, y1, y0, y1]);
        for i in 0..=20 {
            let s = f64::from(i) / 20.0;
            let u = 1.0 - s;
            let r2 = y1 - y0;
            let r3 = hk[0] - r2;
            let r4 = r2 - hk[6] - r3;
            let nested = y0 + s * (r2 + u * (r3 + s * (r4 + u * dot(DOPRI5.d[0]))));
            assert!((bernstein(small.clone(), s) - nested).abs() < 1e-14);
            let r4 = r2 - hk[12] - r3;
            let r: Vec<f64> = DOP853.d.iter().map(|d| dot(d)).collect();
            let tail = r[0] + s * (r[1] + u * (r[2] + s * r[3]));
            let nested = y0 + s * (r2 + u * (r3 + s * (r4 + u * tail)));
            assert!((bernstein(large.clone(), s) - nested).abs() < 1e-13);
        }
    }

    #[test]
    fn straight_lines_stay_straight() {
        // A constant rate must not meet the large weights: the coefficients are those of a line to rounding.
        let b = dop853_dense(1.0, 1.25, &[0.25; 16]);
        for (i, b) in b.iter().enumerate() {
            assert!((b - (1.0 + 0.25 * i as f64 / 7.0)).abs() < 3e-16);
        }
    }

    #[test]
    fn joined_error_estimate() {
        assert!((dop853_error(-3.0, 40.0) - 9.0 / 5.0).abs() < 1e-15);
        assert!((dop853_error(3e-200, 40e-200) / 1.8e-200 - 1.0).abs() < 1e-15);
        assert_eq!(dop853_error(2.0, 0.0), 2.0);
        assert_eq!(dop853_error(0.0, 0.0), 0.0);
        assert_eq!(dop853_error(f64::NAN, 1.0), f64::INFINITY);
        assert_eq!(dop853_error(1.0, f64::NEG_INFINITY), f64::INFINITY);
    }
}
