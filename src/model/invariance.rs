//! Surfaces that a flow cannot reach.
//!
//! A value that is only approached is never reached (LANGUAGE, "Events"): logistic growth comes as close
//! to its limit as one likes, and closer than rounded numbers can tell. That the limit is not an event
//! cannot be seen on the numbers of a trajectory; it is seen on the equations. The surface `a = b` is
//! invariant if the rate of `a - b` is zero everywhere on it, and by uniqueness of solutions no trajectory
//! enters an invariant surface.
//!
//! Whether a rate is identically zero is tested at many points (Schwartz 1980, Zippel 1979): an
//! analytic function that vanishes at all of them vanishes.

use crate::expr::{Dual, Graph, NodeId, Program};

/// Points at which a rate is tested.
const POINTS: usize = 48;
/// Fewer defined points than this prove nothing.
const ENOUGH: usize = 12;

/// True if a flow can never bring `a - b` from another value to zero.
///
/// - `own`: the variables `0..own` are the module's parameters; `rates` gives each its derivative.
/// - `context`: the variables `own..own + context` move in ways that are not known here.
/// - The next two are `t` and `age`, whose rate is 1; any after them are truth values that stand still.
pub fn never_reached(
    graph: &Graph,
    (a, b): (NodeId, NodeId),
    rates: &[(usize, NodeId)],
    own: usize,
    context: usize,
    variables: usize,
) -> bool {
    let known = |v: u32| (v as usize) < own || (v as usize) >= own + context;
    let read = graph.variables(&[a, b]);
    if !read.iter().all(|v| known(*v)) {
        return false;
    }
    // The surface is sampled by solving for one parameter.
    let Some(pivot) = read.into_iter().map(|v| v as usize).find(|v| *v < own) else { return false };
    let sides = Program::compile(graph, &[a, b], variables);
    let roots: Vec<NodeId> = rates.iter().map(|(_, rate)| *rate).collect();
    let flow = Program::compile(graph, &roots, variables);

    let mut random = Random::new();
    let (mut defined, mut scratch, mut dual_scratch) = (0, Vec::new(), Vec::new());
    let mut derivative = vec![0.0; roots.len()];
    let mut difference = |point: &[f64]| {
        flow.eval(point, &mut scratch, &mut derivative);
        let mut duals: Vec<Dual<f64>> = point.iter().map(|&value| Dual { value, rate: 0.0 }).collect();
        duals[own + context].rate = 1.0;
        duals[own + context + 1].rate = 1.0;
        for ((parameter, _), &rate) in rates.iter().zip(&derivative) {
            duals[*parameter].rate = rate;
        }
        let mut out = [Dual { value: 0.0, rate: 0.0 }; 2];
        sides.eval(&duals, &mut dual_scratch, &mut out);
        out[0].rate - out[1].rate
    };
    for _ in 0..POINTS {
        let mut point: Vec<f64> = (0..variables).map(|_| random.magnitude()).collect();
        for flag in &mut point[own + context + 2..] {
            *flag = f64::from(u8::from(random.next() & 1 == 1));
        }
        let Some((at, slope)) = solve(&sides, &mut point, pivot) else { continue };
        // Where the difference has a double root its rate vanishes whatever the flow does.
        let aside = 0.25 * at.abs().max(1e-3);
        point[pivot] = at + aside;
        let rise = gap(&sides, &point).abs();
        point[pivot] = at;
        if slope.abs() * aside < 1e-3 * rise {
            return false;
        }
        let here = difference(&point);
        // How large the rate is off the surface says what counts as zero on it.
        let mut scale: f64 = 0.0;
        for step in [0.25, 0.5] {
            for side in [-step, step] {
                point[pivot] = at + side * at.abs().max(1e-3);
                let there = difference(&point);
                scale = if there.is_finite() { scale.max(there.abs()) } else { scale };
            }
        }
        // A rate that is zero all around, by underflow perhaps, shows nothing.
        if !here.is_finite() || scale == 0.0 {
            continue;
        }
        if here.abs() > 64.0 * f64::EPSILON * scale {
            return false;
        }
        // Without a Lipschitz constant solutions are not unique: x' = -sqrt(x) does arrive at 0.
        let unit = at.abs().max(1e-3);
        for side in [-1.0, 1.0] {
            let mut slope = |step: f64| {
                point[pivot] = at + side * step * unit;
                difference(&point).abs() / step
            };
            let (far, near) = (slope(1e-2), slope(1e-6));
            if near > 10.0 * far {
                return false;
            }
        }
        defined += 1;
    }
    defined >= ENOUGH
}

/// The difference of the two sides.
fn gap(sides: &Program, point: &[f64]) -> f64 {
    let mut out = [0.0; 2];
    sides.eval(point, &mut Vec::new(), &mut out);
    out[0] - out[1]
}

/// Puts the point on the surface by changing one variable (Newton's method). Returns that variable and the
/// slope of the difference in it; None if that fails.
fn solve(sides: &Program, point: &mut [f64], pivot: usize) -> Option<(f64, f64)> {
    let mut scratch = Vec::new();
    for _ in 0..60 {
        let moving =
            |(i, value): (usize, &f64)| Dual { value: *value, rate: f64::from(u8::from(i == pivot)) };
        let duals: Vec<Dual<f64>> = point.iter().enumerate().map(moving).collect();
        let mut out = [Dual { value: 0.0, rate: 0.0 }; 2];
        sides.eval(&duals, &mut scratch, &mut out);
        let (gap, slope) = (out[0].value - out[1].value, out[0].rate - out[1].rate);
        let step = gap / slope;
        if gap == 0.0 {
            return Some((point[pivot], slope));
        }
        if !step.is_finite() {
            return None;
        }
        point[pivot] -= step;
        if step.abs() <= 2.0 * f64::EPSILON * point[pivot].abs() {
            return Some((point[pivot], slope));
        }
    }
    None
}

/// SplitMix64 (Steele, Lea, Flood 2014): the points are the same in every run.
pub(super) struct Random(u64);

impl Random {
    pub fn new() -> Random {
        Random(0x5eed)
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A number of either sign, most often positive, between 1/100 and 100.
    pub fn magnitude(&mut self) -> f64 {
        let unit = (self.next() >> 11) as f64 / (1u64 << 53) as f64;
        let size = 10f64.powf(4.0 * unit - 2.0);
        if self.next().is_multiple_of(4) { -size } else { size }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::expr::{Binary, Graph};

    /// x' = r (1 - x/m) x with m = 3; variables x, t, age.
    fn logistic(g: &mut Graph) -> NodeId {
        let (x, one, m) = (g.var(0), g.constant(1.0), g.constant(3.0));
        let q = g.binary(Binary::Div, x, m);
        let rest = g.binary(Binary::Sub, one, q);
        g.binary(Binary::Mul, rest, x)
    }

    #[test]
    fn the_limit_of_logistic_growth_is_never_reached_but_what_is_below_is() {
        let mut g = Graph::default();
        let rate = logistic(&mut g);
        let (x, limit, below) = (g.var(0), g.constant(3.0), g.constant(3.0 * (1.0 - 2f64.powi(-40))));
        assert!(never_reached(&g, (x, limit), &[(0, rate)], 1, 0, 3));
        assert!(!never_reached(&g, (x, below), &[(0, rate)], 1, 0, 3));
        // However it is written.
        let (one, third) = (g.constant(1.0), g.binary(Binary::Div, x, limit));
        assert!(never_reached(&g, (third, one), &[(0, rate)], 1, 0, 3));
    }

    #[test]
    fn what_ends_in_finite_time_arrives() {
        let mut g = Graph::default();
        let (x, zero) = (g.var(0), g.constant(0.0));
        let root = g.unary(crate::expr::Unary::Sqrt, x);
        let rate = g.unary(crate::expr::Unary::Neg, root);
        assert!(!never_reached(&g, (x, zero), &[(0, rate)], 1, 0, 3));
    }

    #[test]
    fn growth_that_ends_on_its_threshold_arrives() {
        // x' = (1 - age) age, which is zero at age 1 but not on the whole surface x = 1/6.
        let mut g = Graph::default();
        let (x, age, one, sixth) = (g.var(0), g.var(2), g.constant(1.0), g.constant(1.0 / 6.0));
        let rest = g.binary(Binary::Sub, one, age);
        let rate = g.binary(Binary::Mul, rest, age);
        assert!(!never_reached(&g, (x, sixth), &[(0, rate)], 1, 0, 3));
    }
}
