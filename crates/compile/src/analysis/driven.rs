//! Equations with a formula in terms of a known integral: `x' = h(time) q(x)`.
//!
//! h is a sum of curves and growth functions of time, each with its antiderivative known to the graph; q is one of the
//! rates with a formula: quadratic, Gompertz's `x (a + b ln x)`, or Bernoulli's `a x + b x^p`, to which the growth laws of
//! Richards and von Bertalanffy belong. With H the integral of h, the solution is that of `dx/ds = q(x)` at `s = H(time)`.

use std::sync::Arc;

use rustc_hash::FxHashMap;

use super::invariance::Random;
use dlsys_expr::{
    Binary, Curve, Graph, Integral, Monomial, Node, NodeId, NodeMap, Part, Polynomial, Program, Unary,
};
use dlsys_model::{DrivenGrowth, GrowthLaw};

/// Variables from this number on stand for parts of a rate; those of functions have higher numbers.
const STAND_IN: u32 = 1 << 23;
/// Stand-ins for ln x, and for x to the power [`Parts::power`].
const LOGARITHM: u32 = STAND_IN;
const POWER: u32 = STAND_IN + 1;
/// First stand-in for a curve or a growth function.
const FIRST_DRIVER: u32 = STAND_IN + 2;

/// Maximum power of `age` in h.
const MAX_AGE_DEGREE: u32 = 3;
/// Number of random points at which coefficients are tested for proportionality (Schwartz 1980, Zippel 1979).
const POINTS: usize = 8;

/// A decomposed rate before compilation.
pub struct DrivenForm {
    growth: GrowthLaw,
    coefficients: Vec<NodeId>,
    pace: Option<NodeId>,
    monotone: bool,
    curves: Vec<Arc<Curve>>,
}

impl DrivenForm {
    pub fn compile(self, graph: &Graph, total: usize) -> DrivenGrowth {
        DrivenGrowth {
            growth: self.growth,
            coefficients: Program::compile(graph, &self.coefficients, total),
            pace: self.pace.map(|pace| Arc::new(Program::compile(graph, &[pace], total))),
            monotone: self.monotone,
            curves: self.curves,
        }
    }
}

/// A part of h: an expression with its antiderivative along time.
#[derive(Clone, Copy)]
struct Driver {
    node: NodeId,
    /// The rate of the argument, d(argument)/dt.
    speed: NodeId,
    integral: Integral,
}

/// The substitution of stand-ins for parts of a rate.
#[derive(Default)]
struct Parts {
    drivers: Vec<Driver>,
    images: NodeMap<NodeId>,
    power: Option<NodeId>,
}

/// The maximal parts of an expression with an antiderivative along time (curves and growth functions of `age` or `t`), and
/// the nodes outside of them.
fn drivers(
    graph: &mut Graph,
    root: NodeId,
    is_constant: &dyn Fn(u32) -> bool,
    time: u32,
) -> (Vec<Driver>, Vec<NodeId>) {
    let is_time = |v: u32| v == time || v == time + 1;
    let (mut found, mut outside) = (Vec::new(), Vec::new());
    let mut stack = vec![root];
    let mut seen = dlsys_expr::NodeSet::from_iter([root]);
    while let Some(id) = stack.pop() {
        let reads = graph.variables(&[id]);
        let timely =
            reads.iter().copied().any(is_time) && reads.iter().all(|v| is_time(*v) || is_constant(*v));
        if timely
            && let Some(integral) = graph.integral_of(id)
            && let Some(speed) = speed(graph, integral.argument, is_constant, time)
        {
            found.push(Driver { node: id, speed, integral });
            continue;
        }
        outside.push(id);
        for operand in graph.node(id).operands().into_iter().flatten() {
            if seen.insert(operand) {
                stack.push(operand);
            }
        }
    }
    found.sort_by_key(|driver| driver.node);
    (found, outside)
}

/// The rate of an argument that is linear in time with a constant coefficient.
fn speed(
    graph: &mut Graph,
    argument: NodeId,
    is_constant: &dyn Fn(u32) -> bool,
    time: u32,
) -> Option<NodeId> {
    let polynomial = graph.polynomial(argument, |v| v == time || v == time + 1)?;
    let constant = |graph: &Graph, id: NodeId| graph.variables(&[id]).into_iter().all(is_constant);
    if polynomial.degree() != 1 || !polynomial.terms.values().all(|c| constant(graph, *c)) {
        return None;
    }
    let slopes: Vec<NodeId> = [time, time + 1].iter().filter_map(|v| polynomial.coefficient(*v, 1)).collect();
    slopes.into_iter().reduce(|a, b| graph.binary(Binary::Add, a, b))
}

/// The nodes of a rate outside of curves and growth functions of time, as opposed to their operands.
pub fn outside_of_drivers(
    graph: &mut Graph,
    root: NodeId,
    is_constant: &dyn Fn(u32) -> bool,
    time: u32,
) -> Vec<NodeId> {
    drivers(graph, root, is_constant, time).1
}

/// The form of a rate, if it is `h(time) q(x)`. `parameter` is the number of x, `time` that of `t`; `age` is the next.
/// Quadratic rates without curves and growth functions have a formula of their own and are not treated here.
pub fn driven_form(
    graph: &mut Graph,
    parameter: u32,
    rate: NodeId,
    is_constant: &dyn Fn(u32) -> bool,
    time: u32,
) -> Option<DrivenForm> {
    let mut parts = Parts { drivers: drivers(graph, rate, is_constant, time).0, ..Parts::default() };
    for (i, driver) in parts.drivers.iter().enumerate() {
        let stand_in = graph.var(FIRST_DRIVER + i as u32);
        parts.images.insert(driver.node, stand_in);
    }
    growth_terms(graph, parameter, rate, is_constant, &mut parts);
    let images = &parts.images;
    let form = graph.rewrite(&[rate], |_, id, _| images.get(&id).copied())[0];
    let age = time + 1;
    let counts = |v: u32| v == parameter || v == age || (STAND_IN..STAND_IN + (1 << 20)).contains(&v);
    let polynomial = graph.polynomial(form, counts)?;
    let constant = |graph: &Graph, id: NodeId| graph.variables(&[id]).into_iter().all(is_constant);
    if polynomial.terms.is_empty() || !polynomial.terms.values().all(|c| constant(graph, *c)) {
        return None;
    }
    let products = Products::of(&polynomial, age)?;
    let (growth, order) = growth_law(parameter, &products.of_x)?;
    let driven = products.of_time.iter().flatten().any(|(v, _)| *v >= FIRST_DRIVER);
    // h is the constant 1.
    let trivial = products.of_time.len() == 1 && products.of_time[0].is_empty();
    // Without a driver only a constant h and a growth law without another formula; x' = age x is integrated.
    if !driven && (growth == GrowthLaw::Quadratic || !trivial) {
        return None;
    }
    let (of_q, of_h) = products.factors(graph, time)?;
    let pace = (!trivial).then(|| pace(graph, &parts, age, &products.of_time, &of_h));
    let zero = graph.constant(0.0);
    let mut coefficients: Vec<NodeId> =
        order.into_iter().map(|place| place.map_or(zero, |i: usize| of_q[i])).collect();
    if growth == GrowthLaw::Bernoulli {
        coefficients.push(exponent(graph, parameter, &products.of_x, parts.power)?);
    }
    let known: Vec<Option<(Arc<Curve>, Part)>> = parts.drivers.iter().map(|d| curve_of(graph, d)).collect();
    let steady = match known.first() {
        Some(Some((curve, part))) => curve.keeps_sign(*part),
        _ => false,
    };
    let monotone = trivial || products.is_first_driver() && steady;
    let mut curves: Vec<Arc<Curve>> = known.into_iter().flatten().map(|(curve, _)| curve).collect();
    curves.dedup_by(|a, b| Arc::ptr_eq(a, b));
    Some(DrivenForm { growth, coefficients, pace, monotone, curves })
}

/// A rate as a sum of products: a monomial of q, a monomial of h, and a constant coefficient.
struct Products {
    of_x: Vec<Monomial>,
    of_time: Vec<Monomial>,
    /// The coefficient by the places of the two monomials.
    table: FxHashMap<(usize, usize), NodeId>,
}

impl Products {
    /// Takes a polynomial in x, `age` and the stand-ins apart. None if a monomial of time has no antiderivative that is
    /// known: a product of drivers, or too high a power of `age`.
    fn of(polynomial: &Polynomial, age: u32) -> Option<Products> {
        let mut all = Products { of_x: Vec::new(), of_time: Vec::new(), table: FxHashMap::default() };
        let place = |list: &mut Vec<Monomial>, item: Monomial| {
            list.iter().position(|known| *known == item).unwrap_or_else(|| {
                list.push(item);
                list.len() - 1
            })
        };
        for (monomial, coefficient) in &polynomial.terms {
            let in_time = |v: &u32| *v == age || *v >= FIRST_DRIVER;
            let (h, q): (Monomial, Monomial) = monomial.iter().copied().partition(|(v, _)| in_time(v));
            let single = match h[..] {
                [] => true,
                [(v, n)] if v == age => n <= MAX_AGE_DEGREE,
                [(_, n)] => n == 1,
                _ => false,
            };
            if !single {
                return None;
            }
            all.table.insert((place(&mut all.of_x, q), place(&mut all.of_time, h)), *coefficient);
        }
        Some(all)
    }

    /// The coefficients of q and of h, in the order of their monomials. None if the sum is not a product of the two.
    fn factors(&self, graph: &mut Graph, time: u32) -> Option<(Vec<NodeId>, Vec<NodeId>)> {
        let one = graph.constant(1.0);
        let row = |i: usize| (0..self.of_time.len()).map(|j| self.table.get(&(i, j)).copied()).collect();
        let mut rows: Vec<Vec<NodeId>> = (0..self.of_x.len()).map(row).collect::<Option<_>>()?;
        match (self.of_x.len(), self.of_time.len()) {
            (_, 1) => Some((rows.into_iter().map(|row| row[0]).collect(), vec![one])),
            (1, _) => Some((vec![one], rows.swap_remove(0))),
            _ => {
                if !proportional(graph, &rows, time) {
                    return None;
                }
                let h = rows[0].iter().map(|c| graph.binary(Binary::Div, *c, rows[0][0])).collect();
                Some((rows.iter().map(|row| row[0]).collect(), h))
            }
        }
    }

    /// True if h is a multiple of the first driver.
    fn is_first_driver(&self) -> bool {
        self.of_time.len() == 1 && self.of_time[0].first().is_some_and(|(v, _)| *v == FIRST_DRIVER)
    }
}

/// The curve that a driver is made of, and whether it is the curve, its derivative or its integral.
fn curve_of(graph: &Graph, driver: &Driver) -> Option<(Arc<Curve>, Part)> {
    match graph.node(driver.node) {
        Node::Curve(curve, part, _) => Some((graph.curve_of(curve).clone(), part)),
        _ => None,
    }
}

/// Adds stand-ins for logarithms and powers of x.
fn growth_terms(
    graph: &mut Graph,
    parameter: u32,
    rate: NodeId,
    is_constant: &dyn Fn(u32) -> bool,
    parts: &mut Parts,
) {
    let (logarithm, power_of_x) = (graph.var(LOGARITHM), graph.var(POWER));
    let still = |graph: &Graph, id: NodeId| graph.variables(&[id]).into_iter().all(is_constant);
    for id in graph.reachable(&[rate]) {
        let (base, exponent) = match graph.node(id) {
            Node::Unary(Unary::Ln, base) => (base, None),
            Node::Unary(Unary::Sqrt, base) => (base, Some(graph.constant(0.5))),
            Node::Binary(Binary::Pow, base, exponent)
                if !still(graph, base) && still(graph, exponent) && !is_count(graph, base, exponent) =>
            {
                (base, Some(exponent))
            }
            _ => continue,
        };
        // The base is κ x or κ / x.
        let (scale, sign) = match scale_of(graph, base, parameter, &still) {
            Some(scale) => (scale, 1.0),
            None => match graph.node(base) {
                Node::Binary(Binary::Div, top, below) if still(graph, top) => {
                    match scale_of(graph, below, parameter, &still) {
                        Some(scale) => (graph.binary(Binary::Div, top, scale), -1.0),
                        None => continue,
                    }
                }
                _ => continue,
            },
        };
        let signed = |graph: &mut Graph, id| if sign < 0.0 { graph.unary(Unary::Neg, id) } else { id };
        let image = match exponent {
            None => {
                let (constant, own) = (graph.unary(Unary::Ln, scale), signed(graph, logarithm));
                graph.binary(Binary::Add, constant, own)
            }
            Some(exponent) => {
                let own = signed(graph, exponent);
                if *parts.power.get_or_insert(own) != own {
                    continue;
                }
                let factor = graph.binary(Binary::Pow, scale, exponent);
                graph.binary(Binary::Mul, factor, power_of_x)
            }
        };
        parts.images.insert(id, image);
    }
}

/// True for a power that a polynomial in x can contain.
fn is_count(graph: &Graph, base: NodeId, exponent: NodeId) -> bool {
    let whole = graph.as_constant(exponent).is_some_and(|n| n == n.trunc() && (0.0..=8.0).contains(&n));
    whole && !matches!(graph.node(base), Node::Binary(Binary::Div, ..))
}

/// The factor κ of an expression `κ x`.
fn scale_of(
    graph: &mut Graph,
    base: NodeId,
    parameter: u32,
    still: &dyn Fn(&Graph, NodeId) -> bool,
) -> Option<NodeId> {
    let polynomial = graph.polynomial(base, |v| v == parameter)?;
    let scale = polynomial.coefficient(parameter, 1)?;
    (polynomial.terms.len() == 1 && still(graph, scale)).then_some(scale)
}

/// The growth law q with these monomials, and the index of the monomial of each of its coefficients.
fn growth_law(x: u32, monomials: &[Monomial]) -> Option<(GrowthLaw, Vec<Option<usize>>)> {
    let find = |wanted: Monomial| monomials.iter().position(|m| *m == wanted);
    let power = |n: u32| find(if n == 0 { Monomial::new() } else { vec![(x, n)] });
    let places = [power(0), power(1), power(2)];
    let matched = |places: &[Option<usize>]| places.iter().flatten().count() == monomials.len();
    if matched(&places) {
        return Some((GrowthLaw::Quadratic, places.to_vec()));
    }
    let gompertz = [power(1), find(vec![(x, 1), (LOGARITHM, 1)])];
    if matched(&gompertz) {
        return Some((GrowthLaw::Gompertz, gompertz.to_vec()));
    }
    let higher = monomials.iter().position(|m| {
        matches!(m[..], [(POWER, 1)])
            || m[..] == [(x, 1), (POWER, 1)]
            || matches!(m[..], [(v, n)] if v == x && n > 1)
    });
    let bernoulli = [power(1), higher];
    matched(&bernoulli).then(|| (GrowthLaw::Bernoulli, bernoulli.to_vec()))
}

/// The exponent p of Bernoulli's equation.
fn exponent(graph: &mut Graph, x: u32, monomials: &[Monomial], power: Option<NodeId>) -> Option<NodeId> {
    let one = graph.constant(1.0);
    for monomial in monomials {
        match monomial[..] {
            [(POWER, 1)] => return power,
            [(v, 1), (POWER, 1)] if v == x => return Some(graph.binary(Binary::Add, one, power?)),
            [(v, n)] if v == x && n > 1 => return Some(graph.constant(f64::from(n))),
            _ => {}
        }
    }
    None
}

/// True if all rows are multiples of the first one.
fn proportional(graph: &mut Graph, rows: &[Vec<NodeId>], time: u32) -> bool {
    let nodes: Vec<NodeId> = rows.concat();
    let most = graph.variables(&nodes).last().map_or(0, |v| *v + 1).max(time);
    let program = Program::compile(graph, &nodes, most as usize);
    let mut random = Random::new();
    let mut defined = 0;
    for _ in 0..4 * POINTS {
        let point: Vec<f64> = (0..most).map(|_| 0.2 + 1.5 * random.unit()).collect();
        let mut out = vec![0.0; nodes.len()];
        program.eval(&point, &mut Vec::new(), &mut out);
        let width = rows[0].len();
        if out.iter().any(|x| !x.is_finite()) || out[0] == 0.0 {
            continue;
        }
        defined += 1;
        let off = |i: usize, j: usize| {
            let (a, b) = (out[i * width + j] * out[0], out[i * width] * out[j]);
            (a - b).abs() > 1e-12 * a.abs().max(b.abs())
        };
        if (1..rows.len()).any(|i| (1..width).any(|j| off(i, j))) {
            return false;
        }
        if defined == POINTS {
            return true;
        }
    }
    false
}

/// The integral H of h as an expression.
fn pace(graph: &mut Graph, parts: &Parts, age: u32, of_time: &[Monomial], of_h: &[NodeId]) -> NodeId {
    let age_node = graph.var(age);
    let mut whole: Option<NodeId> = None;
    for (monomial, &factor) in of_time.iter().zip(of_h) {
        let term = match monomial[..] {
            [(v, 1)] if v >= FIRST_DRIVER => {
                let driver = parts.drivers[(v - FIRST_DRIVER) as usize];
                graph.binary(Binary::Div, driver.integral.whole, driver.speed)
            }
            [(_, n)] => {
                let exponent = graph.constant(f64::from(n + 1));
                let power = graph.binary(Binary::Pow, age_node, exponent);
                graph.binary(Binary::Div, power, exponent)
            }
            _ => age_node,
        };
        let term = graph.binary(Binary::Mul, factor, term);
        whole = Some(whole.map_or(term, |sum| graph.binary(Binary::Add, sum, term)));
    }
    whole.unwrap_or(age_node)
}
