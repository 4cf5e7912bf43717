//! The drawings of the turtle, on strings written by hand.

use super::*;
use crate::scene::{MaterialId, Point, Vector, Width};
use dlsys_diagnostic::Span;
use dlsys_expr::{Binary, Graph, NodeId, Program};
use dlsys_model::{Interpretation, Stretch, Successor};
use dlsys_tree::Lineage;

/// Modules by name and parameters.
fn string(model: &mut Model, modules: &[(&str, &[f64])]) -> ModuleString {
    let mut string = ModuleString::default();
    for (place, (name, parameters)) in modules.iter().enumerate() {
        let kind = model.kinds.intern(name, parameters.len());
        string.push(kind, parameters.iter().copied(), 0.5, Lineage::of_axiom(place));
    }
    string
}

fn drawn(modules: &[(&str, &[f64])]) -> Scene {
    let mut model = Model::default();
    let string = string(&mut model, modules);
    let mut scene = Scene::default();
    draw(&model, &string, &mut scene).expect("drawable");
    scene
}

#[test]
fn steps_and_turns() {
    let scene =
        drawn(&[("F", &[]), ("+", &[]), ("F_x", &[2.0, 9.0]), ("-", &[45.0]), ("f", &[1.0]), ("F", &[-1.0])]);
    assert_eq!(scene.segments.len(), 3);
    assert_eq!(scene.segments[0].end, Point::new(0.0, 1.0, 0.0));
    assert_eq!(scene.segments[1].end, Point::new(-2.0, 1.0, 0.0), "+ turns left on the screen");
    assert_eq!(scene.segments[1].follows, Some(0));
    assert_eq!(scene.segments[2].follows, None, "after a step that is not drawn");
    assert_eq!(scene.segments[2].end, scene.segments[1].end, "backwards");
    assert_eq!(scene.owners()[1].name.as_ref(), "F_x");
}

#[test]
fn a_step_of_no_length_draws_nothing_and_breaks_nothing() {
    let scene = drawn(&[("F", &[1.0]), ("F", &[0.0]), ("F", &[1.0])]);
    assert_eq!(scene.segments.len(), 2);
    assert_eq!(scene.segments[1].follows, Some(0));
}

#[test]
fn brackets_restore_everything() {
    let scene = drawn(&[
        ("F", &[1.0]),
        ("[", &[]),
        ("+", &[30.0]),
        ("!", &[0.5]),
        (";", &[4.0]),
        ("F", &[1.0]),
        ("]", &[]),
        ("F", &[1.0]),
    ]);
    let [trunk, branch, top] = &scene.segments[..] else { panic!() };
    assert_eq!(branch.widths, [Width::Set(0.5); 2]);
    assert_eq!(scene.palette.get(branch.material).name, "colour-4");
    assert_eq!((branch.follows, top.follows), (None, Some(0)));
    assert_eq!((top.widths, top.material), (trunk.widths, MaterialId::STEM));
    assert_eq!(top.end, Point::new(0.0, 2.0, 0.0));
}

#[test]
fn widths_and_colours_without_a_parameter() {
    let scene =
        drawn(&[("!", &[]), (";", &[]), (";", &[]), ("F", &[]), ("!", &[2.0]), ("!", &[]), ("F", &[])]);
    assert_eq!(scene.segments[0].widths[0], Width::Default(0.7));
    assert_eq!(scene.palette.get(scene.segments[0].material).name, "colour-2");
    assert_eq!(scene.segments[1].widths[0], Width::Set(1.4));
}

#[test]
fn polygons_collect_vertices() {
    let turn: (&str, &[f64]) = ("+", &[120.0]);
    let edge: (&str, &[f64]) = ("F", &[1.0]);
    let scene = drawn(&[("{", &[]), edge, turn, edge, turn, edge, ("}", &[]), ("F", &[])]);
    assert_eq!(scene.polygons[0].vertices.len(), 3);
    assert_eq!(scene.segments.len(), 1, "edges of a polygon are not drawn");
    let dots = [("{", &[][..]), (".", &[]), ("f", &[]), (".", &[]), ("f", &[-1.0]), ("}", &[])];
    assert!(drawn(&dots).polygons.is_empty(), "two distinct vertices are no polygon");
    assert!(drawn(&[("{", &[]), edge, turn, edge, turn, edge]).polygons.is_empty(), "never closed");
    assert!(drawn(&[("}", &[]), ("]", &[])]).is_empty());
}

#[test]
fn surfaces_stand_where_the_turtle_is() {
    let scene = drawn(&[("F", &[3.0]), ("@L", &[2.0]), ("@K", &[]), ("@L", &[0.0]), ("@Q", &[])]);
    assert_eq!(scene.surfaces.len(), 2);
    let leaf = &scene.surfaces[0].placement;
    assert_eq!((leaf.origin, leaf.scales), (Point::new(0.0, 3.0, 0.0), [2.0; 3]));
    assert_eq!(leaf.point(Point::new(1.0, 0.0, 0.0)), Point::new(0.0, 5.0, 0.0));
}

#[test]
fn parameters_that_are_no_numbers_are_errors() {
    let mut model = Model::default();
    let bad = string(&mut model, &[("F", &[1.0]), ("+_a", &[f64::NAN])]);
    let error = draw(&model, &bad, &mut Scene::default()).unwrap_err();
    assert_eq!(error.to_string(), "cannot draw `+_a` (module 2): its parameter is NaN");
    let far = string(&mut model, &[("F", &[1e100]), ("F", &[1e100])]);
    assert!(matches!(draw(&model, &far, &mut Scene::default()), Err(Error { kind: ErrorKind::TooFar, .. })));
    let unread = string(&mut model, &[("A", &[f64::NAN]), ("F", &[1.0, f64::NAN])]);
    assert_eq!(draw(&model, &unread, &mut Scene::default()), Ok(()));
}

/// `interpret NAME(x): …` with the given modules, whose arguments are made by `arguments` from `x t age`.
fn interpret(
    model: &mut Model,
    name: &str,
    modules: &[(&str, usize)],
    arguments: impl FnOnce(&mut Graph, [NodeId; 3]) -> Vec<NodeId>,
) {
    let mut graph = Graph::default();
    let variables = [0, 1, 2].map(|i| graph.var(i));
    let roots = arguments(&mut graph, variables);
    let kinds = modules.iter().map(|&(name, arity)| model.kinds.intern(name, arity)).collect();
    let drawn = Stretch { kinds, arguments: Program::compile(&graph, &roots, 3), ..Stretch::default() };
    let drawn = Successor::Plain(drawn);
    let kind = model.kinds.intern(name, 1);
    model.kinds.get_mut(kind).interpretation = Some(model.interpretations.len());
    model.interpretations.push(Interpretation { span: Span::default(), drawn });
}

#[test]
fn interpretations_replace_and_nest() {
    let mut model = Model::default();
    // A(x): + B(2x) ;  B(x): F(x + t + age)
    interpret(&mut model, "A", &[("+", 0), ("B", 1), (".", 0)], |g, [x, _, _]| {
        let two = g.constant(2.0);
        vec![g.binary(Binary::Mul, two, x)]
    });
    interpret(&mut model, "B", &[("F", 1)], |g, [x, t, age]| {
        let sum = g.binary(Binary::Add, x, t);
        vec![g.binary(Binary::Add, sum, age)]
    });
    let mut string = string(&mut model, &[("A", &[1.0]), ("F", &[1.0])]);
    string.time = 10.0;
    let mut scene = Scene::default();
    draw(&model, &string, &mut scene).expect("drawable");
    // string() rebuilt it with age 0.5: 2 + 10 + 0.5.
    assert_eq!(scene.segments[0].end, Point::new(-12.5, 0.0, 0.0));
    assert_eq!(scene.segments[1].end, Point::new(-13.5, 0.0, 0.0), "the turn stays");
    assert_eq!(scene.owners()[0].name.as_ref(), "A", "drawn on behalf of the module of the string");
    assert_eq!(scene.owners()[0].lineage, Lineage::of_axiom(0));
}

#[test]
fn interpretations_that_explode_are_stopped() {
    let mut model = Model::default();
    // 40 levels, each twice the next: 2^40 modules.
    for level in 0..40 {
        let (name, next) = (format!("A{level}"), format!("A{}", level + 1));
        interpret(&mut model, &name, &[(&next, 1), (&next, 1)], |_, [x, _, _]| vec![x, x]);
    }
    let mut wide = string(&mut model, &[("A0", &[1.0])]);
    assert!(matches!(
        draw(&model, &wide, &mut Scene::default()),
        Err(Error { kind: ErrorKind::TooMany { limit: ModuleString::DRAWN, in_string: 1 }, .. })
    ));
    for (of_run, limit) in [(100, ModuleString::DRAWN), (12_000_000, 12_000_000)] {
        wide.set_run_limit(of_run);
        let error = draw(&model, &wide, &mut Scene::default()).expect_err("too many");
        assert_eq!(error.kind, ErrorKind::TooMany { limit, in_string: 1 });
        assert!(error.diagnostic().help.concat().contains(&format!("`--max-modules {}`", 10 * limit)));
    }
    let mut model = Model::default();
    for level in 0..101 {
        let (name, next) = (format!("A{level}"), format!("A{}", level + 1));
        interpret(&mut model, &name, &[(&next, 1)], |_, [x, _, _]| vec![x]);
    }
    let deep = string(&mut model, &[("A0", &[1.0])]);
    assert!(matches!(
        draw(&model, &deep, &mut Scene::default()),
        Err(Error { kind: ErrorKind::TooDeep, .. })
    ));
}

/// The dragon of the paper (section 4.1) between its stages: every segment is split in two at 45 degrees,
/// and the distance from end to end stays 1.
#[test]
fn a_dragon_keeps_its_ends_one_apart() {
    let mut model = Model { angle: 45.0, ..Model::default() };
    let [plus, minus] = ["+", "-"].map(|name| model.kinds.intern(name, 0));
    let [right, left] = ["F_r", "F_l"].map(|name| model.kinds.intern(name, 1));
    let mut kinds = vec![minus, minus, right];
    for _ in 0..16 {
        let split = |kind| match kind {
            k if k == right => vec![minus, right, plus, plus, left, minus],
            k if k == left => vec![plus, right, minus, minus, left, plus],
            other => vec![other],
        };
        kinds = kinds.into_iter().flat_map(split).collect();
    }
    let length = 0.5_f64.powi(8);
    let mut string = ModuleString::default();
    for kind in kinds {
        let parameters = if kind == right || kind == left { vec![length] } else { vec![] };
        string.push(kind, parameters, 0.0, Lineage::of_axiom(0));
    }
    let mut scene = Scene::default();
    draw(&model, &string, &mut scene).expect("drawable");
    assert_eq!(scene.segments.len(), 1 << 16);
    let end = scene.segments.last().expect("segments").end;
    assert!((end - Point::new(1.0, 0.0, 0.0)).norm() < 1e-12, "{end}");
}

#[test]
fn a_million_small_steps_end_where_one_large_step_does() {
    let mut model = Model::default();
    let modules = vec![("F", &[0.1][..]); 1_000_000];
    let string = string(&mut model, &modules);
    let mut scene = Scene::default();
    draw(&model, &string, &mut scene).expect("drawable");
    let end = scene.segments.last().expect("segments").end;
    assert!((end.y - 100_000.0).abs() < 1e-10, "{}", end.y);
    assert_eq!(scene.segments[0].direction, Vector::y());
}
