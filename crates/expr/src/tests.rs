//! One suite for every evaluator: numbers, bounds and derivatives meet the same operations.

use proptest::prelude::*;

use super::*;
use dlsys_wide::Width;

/// Every operation once, as an expression of x (variable 0) and y (variable 1).
fn all() -> (Graph, Vec<(String, NodeId)>) {
    let mut g = Graph::default();
    let (x, y) = (g.var(0), g.var(1));
    let mut list = Vec::new();
    for (name, op) in Unary::NAMED {
        list.push((name.to_owned(), g.unary(op, x)));
    }
    list.push(("-x".to_owned(), g.unary(Unary::Neg, x)));
    for (name, op) in Binary::NAMED {
        list.push((name.to_owned(), g.binary(op, x, y)));
    }
    for op in [Binary::Add, Binary::Sub, Binary::Mul, Binary::Div, Binary::Pow] {
        list.push((format!("{op:?}"), g.binary(op, x, y)));
    }
    let (three, product, square) =
        (g.constant(3.0), g.binary(Binary::Mul, x, y), g.binary(Binary::Mul, y, y));
    let multiple = g.binary(Binary::Mul, three, y);
    for op in [Binary::Add, Binary::Sub] {
        for (second, of) in [(product, "xy"), (square, "y y"), (multiple, "3y")] {
            list.push((format!("{op:?}(x, {of})"), g.binary(op, x, second)));
        }
    }
    for exponent in [-2.0, -1.0, 0.0, 2.0, 3.0, 0.5, 1.5] {
        let e = g.constant(exponent);
        list.push((format!("x^{exponent}"), g.binary(Binary::Pow, x, e)));
    }
    for op in [Binary::Lt, Binary::Le, Binary::Eq, Binary::Ne] {
        let test = g.binary(op, x, y);
        let (a, b) = (g.unary(Unary::Exp, x), g.unary(Unary::Neg, y));
        list.push((format!("if {op:?}"), g.select(test, a, b)));
        let other = g.binary(Binary::Lt, y, x);
        let either = g.binary(Binary::Or, test, other);
        let not = g.unary(Unary::Not, test);
        let both = g.binary(Binary::And, not, either);
        list.push((format!("logic {op:?}"), both));
    }
    (g, list)
}

/// Many rows at once give each row the bits that it has alone, however many there are and however wide registers are.
#[test]
fn rows_are_what_each_is_alone() {
    let (graph, list) = all();
    let at = |row: usize| [0.1 + 0.37 * row as f64 - 3.0, 2.5 - 0.21 * row as f64];
    for (name, node) in list {
        let program = Program::compile(&graph, &[node], 2);
        for (rows, width) in [1, 7, 8, 9, 16, 17, LANES].into_iter().flat_map(|n| Width::ALL.map(|w| (n, w)))
        {
            let mut registers = vec![Lanes::all(f64::NAN); 2];
            for (register, variable) in registers.iter_mut().zip([0, 1]) {
                register.iter_mut().take(rows).enumerate().for_each(|(row, x)| *x = at(row)[variable]);
            }
            let output = program.eval_rows_with(width, &mut registers, rows).next().expect("one root");
            for (row, together) in registers[output].iter().copied().enumerate().take(rows) {
                let alone = program.eval_one(&at(row));
                let same = together.to_bits() == alone.to_bits() || together.is_nan() && alone.is_nan();
                assert!(same, "{name}, row {row} of {rows}, {width:?}: {together}, not {alone}");
            }
        }
    }
}

fn eval<T: Value>(graph: &Graph, node: NodeId, variables: &[T]) -> T {
    let mut out = [T::constant(0.0)];
    Program::compile(graph, &[node], 2).eval(variables, &mut Vec::new(), &mut out);
    out[0]
}

/// A sum and the product in it are one instruction, and are rounded twice all the same. A product that is used again stays.
#[test]
fn sums_of_products_are_rounded_twice() {
    let mut g = Graph::default();
    let (x, y, three) = (g.var(0), g.var(1), g.constant(3.0));
    let (product, square) = (g.binary(Binary::Mul, x, y), g.binary(Binary::Mul, x, x));
    let (multiple, more) = (g.binary(Binary::Mul, three, x), g.binary(Binary::Add, y, product));
    let rest = g.binary(Binary::Sub, more, multiple);
    let less = g.binary(Binary::Sub, rest, square);
    let again = g.binary(Binary::Sub, less, product);
    let (a, b) = (1.0 / 3.0, 0.3f64);
    let (p, q, r) = (a * b, a * a, 3.0 * a);
    let (more, low) = (b + p, b + p - r);
    let expected = low - q - p;
    assert_ne!(expected, f64::mul_add(-a, a, low) - p, "the second rounding shows");
    let program = Program::compile(&g, &[again], 2);
    assert_eq!(program.eval_one(&[a, b]).to_bits(), expected.to_bits());
    let mut registers = vec![Lanes::all(a), Lanes::all(b)];
    let output = program.eval_lanes(&mut registers).next().expect("one root");
    assert_eq!(registers[output].map(f64::to_bits), [expected.to_bits(); LANES]);
    let sums = Program::compile(&g, &[rest, product], 2);
    let mut out = [0.0; 2];
    sums.eval(&[a, b], &mut Vec::new(), &mut out);
    assert_eq!(out, [more - r, p]);
}

/// The same of chains of operations on several variables, whose registers are used again.
#[test]
fn rows_of_random_programs_are_what_each_is_alone() {
    const OPS: [Binary; 7] =
        [Binary::Add, Binary::Sub, Binary::Mul, Binary::Div, Binary::Min, Binary::Max, Binary::Lt];
    let mut seed = 1u64;
    let mut random = |below: usize| {
        seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (seed >> 33) as usize % below
    };
    for _ in 0..200 {
        let mut graph = Graph::default();
        let mut nodes: Vec<NodeId> = (0..4).map(|v| graph.var(v)).collect();
        nodes.push(graph.constant(random(100) as f64 / 7.0 - 5.0));
        for _ in 0..2 + random(20) {
            let [a, b] = [0; 2].map(|_| nodes[random(nodes.len())]);
            nodes.push(match random(10) {
                0 => graph.unary(Unary::Sin, a),
                1 => graph.unary(Unary::Neg, a),
                _ => graph.binary(OPS[random(OPS.len())], a, b),
            });
        }
        let roots = [nodes[nodes.len() - 1], nodes[nodes.len() - 2]];
        let program = Program::compile(&graph, &roots, 4);
        let rows = 1 + random(LANES);
        let values = [0; 4].map(|_| Lanes(std::array::from_fn(|_| random(4000) as f64 / 500.0 - 4.0)));
        for width in Width::ALL {
            let mut registers = values.to_vec();
            let outputs: Vec<usize> = program.eval_rows_with(width, &mut registers, rows).collect();
            for row in 0..rows {
                let mut alone = [0.0; 2];
                program.eval(&values.map(|lanes| lanes[row]), &mut Vec::new(), &mut alone);
                for (output, alone) in outputs.iter().zip(alone) {
                    let together = registers[*output][row];
                    let same = together.to_bits() == alone.to_bits() || together.is_nan() && alone.is_nan();
                    assert!(same, "row {row} of {rows}, {width:?}: {together}, not {alone}, in {program:?}");
                }
            }
        }
    }
}

#[test]
fn outputs_know_what_they_read_and_whether_they_are_numbers() {
    let mut g = Graph::default();
    let (x, y, two) = (g.var(0), g.var(1), g.constant(2.0));
    let square = g.binary(Binary::Mul, x, x);
    let sum = g.binary(Binary::Add, square, y);
    let sine = g.unary(Unary::Sin, y);
    // Registers are shared between the outputs, and used again within each.
    let program = Program::compile(&g, &[sum, two, sine, square, x], 3);
    let reads: Vec<Vec<usize>> = (0..5).map(|i| program.output_reads(i)).collect();
    assert_eq!(reads, [vec![0, 1], vec![], vec![1], vec![0], vec![0]]);
    let numbers: Vec<Option<f64>> = (0..5).map(|i| program.constant_output(i)).collect();
    assert_eq!(numbers, [None, Some(2.0), None, None, None]);
}

/// Plain numbers have an interpreter of their own; derivatives carry the same numbers through the one that all types share.
#[test]
fn plain_numbers_are_to_the_bit_those_of_the_common_interpreter() {
    let (graph, list) = all();
    let roots: Vec<NodeId> = list.iter().map(|(_, id)| *id).collect();
    // The last have more registers than a byte can name.
    for variables in [2, 100, 300] {
        let program = Program::compile(&graph, &roots, variables);
        for (x, y) in [(0.3, 0.7), (-1.5, 0.25), (2.0, 2.0), (0.0, -0.0), (1e-9, 1e9), (f64::NAN, 1.0)] {
            let mut values = vec![0.0; variables];
            (values[0], values[1]) = (x, y);
            let duals: Vec<Dual<f64>> = values.iter().map(|x| Dual::constant(*x)).collect();
            let (mut plain, mut common) = (vec![0.0; roots.len()], vec![Dual::constant(0.0); roots.len()]);
            program.eval(&values, &mut Vec::new(), &mut plain);
            program.eval(&duals, &mut Vec::new(), &mut common);
            for ((plain, common), (name, _)) in plain.iter().zip(&common).zip(&list) {
                let same =
                    plain.to_bits() == common.value.to_bits() || plain.is_nan() && common.value.is_nan();
                assert!(same, "{name} at {x}, {y}: {plain}, not {}", common.value);
            }
        }
    }
}

proptest! {
    #[test]
    fn bounds_hold_every_value(
        x in -3.0..3.0f64, y in -3.0..3.0f64, w in 0.0..2.0f64, v in 0.0..2.0f64,
        s in 0.0..1.0f64, t in 0.0..1.0f64,
    ) {
        let (graph, list) = all();
        let at = [x + s * w, y + t * v];
        let set = [Interval::spanned(x, x + w), Interval::spanned(y, y + v)];
        for (name, node) in list {
            let value = eval(&graph, node, &at);
            let bounds = eval(&graph, node, &set);
            if value.is_nan() {
                prop_assert!(bounds.partial, "{name} is undefined at {at:?} but not partial: {bounds:?}");
            } else {
                let slack = 1e-12 * value.abs().max(1.0);
                prop_assert!(bounds.lo - slack <= value && value <= bounds.hi + slack, "{name} {at:?}: {value} not in {bounds:?}");
            }
        }
    }

    #[test]
    fn rates_are_the_limit_of_differences(
        x in -3.0..3.0f64, y in -3.0..3.0f64, u in -2.0..2.0f64, v in -2.0..2.0f64,
    ) {
        let (graph, list) = all();
        for (name, node) in list {
            let moving = [Dual { value: x, rate: u }, Dual { value: y, rate: v }];
            let rate = eval(&graph, node, &moving).rate;
            let h = 1e-6;
            let [before, after] = [-h, h].map(|h| eval(&graph, node, &[x + h * u, y + h * v]));
            let difference = (after - before) / (2.0 * h);
            // Near a jump or a pole the difference means nothing; there are bounds for that.
            let set = [x, y].into_iter().zip([u, v]).map(|(x, u)| Dual {
                value: Interval::spanned(x - h * u, x + h * u),
                rate: Interval::constant(u),
            });
            let bounds = eval(&graph, node, &set.collect::<Vec<_>>());
            if !difference.is_finite() || !rate.is_finite() || bounds.rate.partial || bounds.value.partial {
                continue;
            }
            let spread = (bounds.rate.hi - bounds.rate.lo).abs();
            let slack = 1e-4 * difference.abs().max(1.0) + spread;
            prop_assert!((rate - difference).abs() <= slack, "{name} at {x}, {y}: {rate}, but {difference}");
            prop_assert!(bounds.rate.lo - slack <= rate && rate <= bounds.rate.hi + slack, "{name}: {rate} not in {bounds:?}");
        }
    }
}

#[test]
fn what_is_undefined_everywhere_is_empty() {
    let mut g = Graph::default();
    let x = g.var(0);
    let root = g.unary(Unary::Sqrt, x);
    assert!(eval(&g, root, &[Interval::spanned(-2.0, -1.0), Interval::constant(0.0)]).is_empty());
    let half = eval(&g, root, &[Interval::spanned(-1.0, 4.0), Interval::constant(0.0)]);
    assert_eq!((half.lo, half.hi, half.partial), (0.0, 2.0, true));
}
