//! Surfaces that a flow cannot reach.
//!
//! A limit that is only approached is never reached (LANGUAGE, "Events"): logistic growth comes arbitrarily close to its
//! limit, closer than rounded numbers can distinguish. The values of a trajectory cannot show that the limit is not an
//! event; the equations can. The surface `a = b` is invariant if the rate of `a - b` is zero everywhere on it, and by
//! uniqueness of solutions no trajectory enters an invariant surface.
//!
//! The rate is written as a polynomial in all variables that change (`form`), with one parameter eliminated by the equation
//! of the surface, and must vanish term by term, within the rounding bounds of its coefficients. So a limit and a threshold
//! just below it are distinguished to the precision of the numbers in the text. Only constant parameters are given random
//! values (Schwartz 1980, Zippel 1979): a polynomial that is zero at all of these points is zero. Without a proof, a
//! surface counts as reachable.

use super::form::{Bounded, Form, Indeterminates, forms};
use super::zeros::{pieces_with_a_zero, with_same_zeros, zero_in};
use dlsys_expr::{Binary, Graph, NodeId, Program};
use dlsys_tree::mix;

/// Number of points at which the rate is tested, if there are constant parameters.
const POINTS: usize = 24;
/// Minimum number of points at which the rate must be defined.
const ENOUGH: usize = 6;

/// True if a flow can never bring `a - b` from another value to zero.
///
/// - `own`: the variables `0..own` are the module's parameters; `rates` gives the derivatives of those that change.
/// - `context`: the variables `own..own + context` change at unknown rates.
/// - The next two are `t` and `age`, whose rate is 1; any after them are truth values, which are constant.
pub fn never_reached(
    graph: &mut Graph,
    (a, b): (NodeId, NodeId),
    rates: &[(usize, NodeId)],
    own: usize,
    context: usize,
    variables: usize,
) -> bool {
    let known = |v: u32| (v as usize) < own || (v as usize) >= own + context;
    let read = graph.variables(&[a, b]);
    // Fields have no second derivatives.
    if graph.reads_field(&[a, b]) {
        return false;
    }
    if !read.iter().all(|v| known(*v)) {
        return false;
    }
    let moves = |v: u32| rates.iter().any(|(parameter, _)| *parameter == v as usize);
    let time = (own + context) as u32;
    let gap = graph.binary(Binary::Sub, a, b);
    // The rate of the difference along the flow.
    let mut rate = graph.constant(0.0);
    for &v in &read {
        let speed = match rates.iter().find(|(parameter, _)| *parameter == v as usize) {
            Some((_, speed)) => *speed,
            None if v == time || v == time + 1 => graph.constant(1.0),
            None => continue,
        };
        let slope = graph.derivative(gap, v);
        let part = graph.binary(Binary::Mul, slope, speed);
        rate = graph.binary(Binary::Add, rate, part);
    }
    let stands = |v: u32| !moves(v) && ((v as usize) < own || v > time + 1);
    let pivots: Vec<u32> = read.into_iter().filter(|v| moves(*v)).collect();
    pivots.into_iter().any(|pivot| {
        let (bend, slope) = (graph.derivative(rate, pivot), graph.derivative(gap, pivot));
        let plain = with_same_zeros(graph, gap, pivot);
        let surface = Surface { graph, gap, plain, slope, rate, bend, pivot, variables };
        let still: Vec<u32> = graph.variables(&[gap, rate]).into_iter().filter(|v| stands(*v)).collect();
        surface.is_invariant(&still, time + 2)
    })
}

/// A difference of two sides, its rate, and their derivatives by a parameter.
struct Surface<'g> {
    graph: &'g Graph,
    gap: NodeId,
    /// An expression with the zeros of the difference, at least.
    plain: NodeId,
    slope: NodeId,
    rate: NodeId,
    bend: NodeId,
    pivot: u32,
    variables: usize,
}

impl Surface<'_> {
    /// True if the rate is shown to vanish on the surface for all values of the constant variables.
    fn is_invariant(&self, still: &[u32], first_flag: u32) -> bool {
        let mut random = Random::new();
        let points = if still.is_empty() { 1 } else { POINTS };
        let mut defined = 0;
        for _ in 0..points {
            let mut point = vec![f64::NAN; self.variables];
            for &v in still {
                let drawn = random.magnitude();
                point[v as usize] = if v >= first_flag { f64::from(u8::from(drawn > 0.5)) } else { drawn };
            }
            match self.vanishes_at(&point, still) {
                Some(true) => defined += 1,
                Some(false) => return false,
                None => {}
            }
        }
        defined >= ENOUGH.min(points)
    }

    /// True if the rate is zero on the surface for these values of the constant variables; None if it is undefined there.
    fn vanishes_at(&self, point: &[f64], still: &[u32]) -> Option<bool> {
        let mut all = Indeterminates::default();
        let number = all.variable(self.pivot);
        let fixed = |v: u32| still.contains(&v).then(|| Form::number(Bounded::exactly(point[v as usize])));
        let Some(gap) = forms(self.graph, &[self.gap], &fixed, &mut all) else { return Some(false) };
        // The equation of the surface: the parameter in terms of all others, or as a number.
        let linear = gap[0].solved_for(number).filter(|(slope, _)| !slope.may_be_zero());
        let places = match linear.and_then(|(slope, rest)| rest.over(slope)?.scaled(Bounded::exactly(-1.0))) {
            Some(place) => vec![place],
            // A surface of several sheets is as good as the worst of them. One whose sheets cannot be listed has as many at other values.
            None => match self.roots(point, still) {
                Some(places) => places.into_iter().map(Form::number).collect(),
                None => return Some(false),
            },
        };
        let mut vanishes = None;
        for place in places {
            vanishes = self.vanishes_on(&place, &fixed, &mut all);
            if vanishes != Some(true) {
                break;
            }
        }
        vanishes
    }

    /// The same on one sheet of the surface, where the pivot is this.
    fn vanishes_on(
        &self,
        place: &Form,
        fixed: &dyn Fn(u32) -> Option<Form>,
        all: &mut Indeterminates,
    ) -> Option<bool> {
        if !place.is_finite() {
            return None;
        }
        let on_surface = |v: u32| if v == self.pivot { Some(place.clone()) } else { fixed(v) };
        let roots = [self.rate, self.bend, self.slope];
        let Some(found) = forms(self.graph, &roots, &on_surface, all) else { return Some(false) };
        let [rate, bend, slope] = &found[..] else { return Some(false) };
        if !rate.is_finite() {
            return None;
        }
        // At a double root of the difference its rate vanishes for every flow. Without a Lipschitz constant solutions are
        // not unique: x' = -sqrt(x) reaches 0.
        Some(rate.vanishes() && !slope.vanishes() && slope.is_finite() && bend.is_finite())
    }

    /// All zeros of the difference as a function of the only parameter in it that changes; None if some may be missing.
    fn roots(&self, point: &[f64], still: &[u32]) -> Option<Vec<Bounded>> {
        let read = self.graph.variables(&[self.gap]);
        if !read.iter().all(|v| *v == self.pivot || still.contains(v)) {
            return None;
        }
        let [gap, plain] =
            [self.gap, self.plain].map(|gap| Program::compile(self.graph, &[gap], self.variables));
        let pivot = self.pivot as usize;
        let pieces = pieces_with_a_zero(&plain, point, pivot)?;
        pieces.into_iter().map(|piece| zero_in(&gap, point, pivot, piece)).collect()
    }
}

/// Random numbers, the same in every run: [`mix`] of a counter.
pub struct Random(u64);

impl Random {
    pub fn new() -> Random {
        Random(0)
    }

    fn next(&mut self) -> u64 {
        self.0 += 1;
        mix(0x5eed, self.0)
    }

    /// A number from 0 up to, but not including, 1.
    pub fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// A number of either sign, most often positive, between 1/100 and 100.
    pub fn magnitude(&mut self) -> f64 {
        let size = 10f64.powf(4.0 * self.unit() - 2.0);
        if self.next().is_multiple_of(4) { -size } else { size }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dlsys_expr::{Binary, Graph};

    /// x' = r (1 - x/m) x with m = 3; variables x, t, age.
    fn logistic(g: &mut Graph) -> NodeId {
        let (x, one, m) = (g.var(0), g.constant(1.0), g.constant(3.0));
        let q = g.binary(Binary::Div, x, m);
        let rest = g.binary(Binary::Sub, one, q);
        g.binary(Binary::Mul, rest, x)
    }

    #[test]
    fn limit_of_logistic_growth_is_unreachable_and_thresholds_below_are_not() {
        let mut g = Graph::default();
        let rate = logistic(&mut g);
        let (x, limit, below) = (g.var(0), g.constant(3.0), g.constant(3.0 * (1.0 - 2f64.powi(-40))));
        assert!(never_reached(&mut g, (x, limit), &[(0, rate)], 1, 0, 3));
        assert!(!never_reached(&mut g, (x, below), &[(0, rate)], 1, 0, 3));
        // The result does not depend on the notation.
        let (one, third) = (g.constant(1.0), g.binary(Binary::Div, x, limit));
        assert!(never_reached(&mut g, (third, one), &[(0, rate)], 1, 0, 3));
    }

    #[test]
    fn solutions_that_end_in_finite_time_reach_the_end() {
        let mut g = Graph::default();
        let (x, zero) = (g.var(0), g.constant(0.0));
        let root = g.unary(dlsys_expr::Unary::Sqrt, x);
        let rate = g.unary(dlsys_expr::Unary::Neg, root);
        assert!(!never_reached(&mut g, (x, zero), &[(0, rate)], 1, 0, 3));
    }

    #[test]
    fn growth_that_ends_on_its_threshold_reaches_it() {
        // x' = (1 - age) age, which is zero at age 1 but not on the whole surface x = 1/6.
        let mut g = Graph::default();
        let (x, age, one, sixth) = (g.var(0), g.var(2), g.constant(1.0), g.constant(1.0 / 6.0));
        let rest = g.binary(Binary::Sub, one, age);
        let rate = g.binary(Binary::Mul, rest, age);
        assert!(!never_reached(&mut g, (x, sixth), &[(0, rate)], 1, 0, 3));
    }

    #[test]
    fn threshold_just_below_a_limit_is_distinguished_from_it() {
        let mut g = Graph::default();
        let (x, one, t) = (g.var(0), g.constant(1.0), g.var(1));
        let gap = g.binary(Binary::Sub, one, x);
        let square = g.binary(Binary::Mul, gap, gap);
        for short in [1e-4, 1e-8, 1e-12, 1e-15] {
            let below = g.constant(1.0 - short);
            assert!(!never_reached(&mut g, (x, below), &[(0, gap)], 1, 0, 3), "{short}");
            // The square of a difference of a few roundings is inconclusive.
            assert!(short < 1e-14 || !never_reached(&mut g, (x, below), &[(0, square)], 1, 0, 3), "{short}");
        }
        assert!(never_reached(&mut g, (x, one), &[(0, square)], 1, 0, 3));
        // A pulse around t = 300 underflows at random points.
        let far = g.constant(300.0);
        let since = g.binary(Binary::Sub, t, far);
        let square = g.binary(Binary::Mul, since, since);
        let minus = g.unary(dlsys_expr::Unary::Neg, square);
        let pulse = g.unary(dlsys_expr::Unary::Exp, minus);
        let driven = g.binary(Binary::Add, gap, pulse);
        assert!(!never_reached(&mut g, (x, one), &[(0, driven)], 1, 0, 3));
        // A factor that vanishes makes it irrelevant.
        let paced = g.binary(Binary::Mul, gap, pulse);
        assert!(never_reached(&mut g, (x, one), &[(0, paced)], 1, 0, 3));
    }

    #[test]
    fn a_parameter_may_approach_another_one() {
        // x' = m - x approaches m, which is constant; y' = 2 (x - y) approaches x, which changes.
        let mut g = Graph::default();
        let (x, y, m, two) = (g.var(0), g.var(1), g.var(2), g.constant(2.0));
        let rate = g.binary(Binary::Sub, m, x);
        let gap = g.binary(Binary::Sub, x, y);
        let other = g.binary(Binary::Mul, two, gap);
        let rates = [(0, rate), (1, other)];
        assert!(never_reached(&mut g, (x, m), &rates, 3, 0, 5));
        assert!(!never_reached(&mut g, (x, y), &rates, 3, 0, 5));
        // Two parameters with the same equation never become equal.
        let twin = g.binary(Binary::Sub, m, y);
        assert!(never_reached(&mut g, (x, y), &[(0, rate), (1, twin)], 3, 0, 5));
    }
}
