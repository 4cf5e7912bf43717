//! Hairer's DOP853: Dormand and Prince's method of order 8 with estimates of orders 5 and 3, and a dense output of degree 7.
//!
//! Source: E. Hairer, S. P. Nørsett, G. Wanner, "Solving Ordinary Differential Equations I", 2nd ed. 1993, sections II.5 and II.6,
//! and their code DOP853.

use super::explicit::{AtPlace, Pair, Receiver, Tableau, changes};
use crate::column::Stage;
use crate::one_step::InteriorError;
use crate::workspace::{FLOOR, MAX_STAGES};

/// The method: 12 stages and the rate at the end, three more for the dense output.
#[derive(Clone, Debug)]
pub struct Dop853;

impl Pair for Dop853 {
    const TABLEAU: &'static Tableau = &DOP853;
    const DEGREE: usize = 7;
    /// At the tolerances that this method is used for, accuracy alone keeps steps well under this.
    const STABILITY: f64 = 1.9;
    const INTERIOR_IS_MEASURED: bool = true;

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
        let hk = changes::<N, 16>(k, first, h);
        out.put(dop853_dense(y, end, &hk)[..count].as_flattened());
    }

    /// The dense output may err a thousand times more than the end of the step where the step is twice as long as stability allows,
    /// which no estimate of the end shows. (That of DOPRI5 errs by at most 2.6 times the estimate of its end, for every z.) Its error
    /// is measured by the defect, the difference between the rate of the output and that of the equations. For y' = zy, the defect
    /// at 0.7 is 8 to 13 times the largest error, for all z from -25 to 2 and for imaginary z up to 6; elsewhere in the step it has
    /// zeros.
    fn interior_error(h: f64, y: &[f64], place: AtPlace) -> InteriorError {
        const PER_ERROR: f64 = 8.0;
        let AtPlace { first, values, slopes, rates } = place;
        let mut inside = InteriorError::default();
        for (component, y) in y.iter().enumerate() {
            let defect = slopes[component] - h * rates[component];
            let error = defect.abs() / PER_ERROR;
            if error.is_finite() {
                // A component at rest at the start moves only after it.
                let moved = (h * first[component]).abs().max(slopes[component].abs());
                let scale = y.abs().max(moved).max(values[component].abs()) + FLOOR;
                inside.relative = inside.relative.max(error / scale);
                inside.absolute = inside.absolute.max(error / y.abs().max(1.0));
            }
        }
        inside
    }
}

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
#[inline(always)]
pub(super) fn join_estimates(e5: f64, e3: f64) -> f64 {
    // All is computed, and chosen from, so that many components go side by side.
    let ratio = (0.1 * e3 / e5).abs();
    let root = (1.0 + ratio * ratio).sqrt();
    // A square of more than that may overflow, and 1 does not count beside it.
    let joined = e5.abs() / if ratio > 1e100 { ratio } else { root };
    let joined = if e5 == 0.0 { 0.0 } else { joined };
    if e5.is_finite() & e3.is_finite() { joined } else { f64::INFINITY }
}

/// The four sums of dense output weights applied to the stage rates of some components, side by side.
///
/// The weights of each sum to zero, so the first rate is taken off before: what is summed is then of the size of the
/// variation in the step, and a constant rate gives exactly zero in spite of weights of several hundred.
#[inline(always)]
fn dense_sums<const N: usize>(hk: &[[f64; N]; 16]) -> [[f64; N]; 4] {
    let mut sums = [[-0.0; N]; 4];
    let d = DOP853.d;
    let (d5, d6, d7, d8) = (&d[0][..16], &d[1][..16], &d[2][..16], &d[3][..16]);
    for i in 0..16 {
        // Four stages have no weight.
        if (1..5).contains(&i) {
            continue;
        }
        for j in 0..N {
            let change = hk[i][j] - hk[0][j];
            sums[0][j] += d5[i] * change;
            sums[1][j] += d6[i] * change;
            sums[2][j] += d7[i] * change;
            sums[3][j] += d8[i] * change;
        }
    }
    sums
}

/// Dense output of some components of a [`DOP853`] step: Bernstein coefficients of degree 7 on [0, 1].
///
/// `y0` and `y1` are the values at the ends of the step and `hk` is `h` times the 16 stage rates, the 13th
/// (index 12) at the end of the step. The polynomial is that of the code DOP853 (Hairer, Norsett, Wanner,
/// II.6): the cubic Hermite interpolant plus
/// `s^2(1-s)^2 (r5 + s (r6 + (1-s) (r7 + s r8)))`, where `r5..r8` are the sums `sum_i d_i hk_i`.
/// The ends are exact: `b_0 = y0`, `b_7 = y1`; the slopes there are `hk1` and `hk13`.
/// Its error in a step falls like `h^8`.
#[inline(always)]
pub(super) fn dop853_dense<const N: usize>(
    y0: &[f64; N],
    y1: &[f64; N],
    hk: &[[f64; N]; 16],
) -> [[f64; 8]; N] {
    let [r5, r6, r7, r8] = dense_sums(hk);
    let mut all = [[0.0; 8]; N];
    for (j, all) in all.iter_mut().enumerate() {
        let (y0, y1, first, end) = (y0[j], y1[j], hk[0][j], hk[12][j]);
        let dy = y1 - y0;
        let [r5, r6, r7, r8] = [r5[j], r6[j], r7[j], r8[j]];
        // The Hermite cubic raised to degree 7, plus s^i (1-s)^j raised to the same degree. Every coefficient is
        // built from the nearer end, so that small changes are added to the large value once.
        *all = [
            y0,
            y0 + first / 7.0,
            y0 + (dy / 7.0 + (4.0 * first - end + r5) / 21.0),
            y0 + (13.0 / 35.0 * dy + (6.0 * first - 4.0 * end + 3.0 * r5 + r6 + r7) / 35.0),
            y1 - (13.0 / 35.0 * dy + (6.0 * end - 4.0 * first - 3.0 * r5 - 2.0 * r6 - r7 - r8) / 35.0),
            y1 - (dy / 7.0 + (4.0 * end - first - r5 - r6) / 21.0),
            y1 - end / 7.0,
            y1,
        ];
    }
    all
}
