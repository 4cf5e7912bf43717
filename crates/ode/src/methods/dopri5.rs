//! The pair of orders 5 and 4 by Dormand and Prince, with the dense output of the code DOPRI5.
//!
//! Sources: J. R. Dormand, P. J. Prince, "A family of embedded Runge-Kutta formulae", J. Comput. Appl. Math. 6 (1980) 19-26;
//! E. Hairer, S. P. Nørsett, G. Wanner, "Solving Ordinary Differential Equations I", 2nd ed. 1993, sections II.5 and II.6.

use super::explicit::{Pair, Receiver, Tableau, changes};
use crate::column::Stage;
use crate::workspace::MAX_STAGES;

/// The pair: 7 stages, order 5, dense output of degree 4.
#[derive(Clone, Debug)]
pub struct Dopri5;

impl Pair for Dopri5 {
    const TABLEAU: &'static Tableau = &DOPRI5;
    const DEGREE: usize = 4;
    const STABILITY: f64 = 2.8;

    #[inline(always)]
    fn dense<const N: usize, K: Stage>(
        y: &[f64; N],
        end: &[f64; N],
        k: &[K; MAX_STAGES],
        first: usize,
        h: f64,
        count: usize,
        out: &mut impl Receiver,
    ) {
        let hk = changes::<N, 7>(k, first, h);
        out.put(dopri5_dense(y, end, &hk)[..count].as_flattened());
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

/// Dense output of some components of a [`DOPRI5`] step: Bernstein coefficients of degree 4 on [0, 1].
///
/// `y0` and `y1` are the values at the ends of the step and `hk` is `h` times the rates of each stage. With
/// `r2 = y1 - y0`, `r3 = hk1 - r2`, `r4 = r2 - hk7 - r3`, `r5 = sum d_i hk_i` it is the polynomial
/// `y0 + s r2 + s(1-s) r3 + s^2(1-s) r4 + s^2(1-s)^2 r5` of the code DOPRI5 (Hairer, Norsett, Wanner, II.6).
/// The ends are exact: `b_0 = y0`, `b_4 = y1`; the slopes there are `hk1` and `hk7`.
/// Its error in a step falls like `h^5`.
#[inline(always)]
pub(super) fn dopri5_dense<const N: usize>(
    y0: &[f64; N],
    y1: &[f64; N],
    hk: &[[f64; N]; 7],
) -> [[f64; 5]; N] {
    let (first, end) = (&hk[0], &hk[6]);
    // The weights sum to zero, so the first rate is taken off before (as in `dop853::dense_sums`), for all components side by side.
    let mut r5 = [-0.0; N];
    for (d, k) in DOPRI5.d[0].iter().zip(hk) {
        for j in 0..N {
            r5[j] += d * (k[j] - first[j]);
        }
    }
    let mut all = [[0.0; 5]; N];
    for (j, all) in all.iter_mut().enumerate() {
        let middle = y0[j] + (0.5 * (y1[j] - y0[j]) + (first[j] - end[j] + r5[j]) / 6.0);
        *all = [y0[j], y0[j] + first[j] / 4.0, middle, y1[j] - end[j] / 4.0, y1[j]];
    }
    all
}
