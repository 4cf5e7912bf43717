//! The stalk of `models/scenes/wilt.dls` against the heavy elastica, the exact shape of a thin rod under its weight and a load, and against the
//! same mechanics in rules, `models/wilting.dls`.

use dlsys::session::{Nursery, Session};
use dlsys::sim::Settings;
use dlsys::surround::{Axis, Survey};
use dlsys::tree::ModuleString;

use crate::common::repository;

const GRAVITY: f64 = 9.81;

/// From the tip down to the base of an elastica whose tip points at an angle from the vertical: the angle at the base, and how far aside and
/// how high the tip is, in lengths. θ'' = -W/EI sin θ with the weight W above.
fn descend(axis: &Axis, angle: f64) -> (f64, [f64; 2]) {
    const STEPS: u32 = 2000;
    let h = 1.0 / f64::from(STEPS);
    let factor = GRAVITY * axis.length * axis.length / axis.rigidity;
    let bend = |above: f64, angle: f64| factor * (axis.carried + axis.mass * above) * angle.sin();
    let (mut angle, mut curvature, mut place) = (angle, 0.0, [0.0; 2]);
    for step in 0..STEPS {
        let above = f64::from(step) * h;
        let middle = angle - h / 2.0 * curvature;
        let half = curvature + h / 2.0 * bend(above, angle);
        place = [place[0] + h * middle.sin(), place[1] + h * middle.cos()];
        angle -= h * half;
        curvature += h * bend(above + h / 2.0, middle);
    }
    (angle, place)
}

#[test]
fn a_wilted_stalk_hangs_over_as_the_elastica() {
    const LEAN: f64 = 2.86 * std::f64::consts::PI / 180.0;
    let still = [dlsys::compile::Setting { name: "breeze".to_owned(), value: 0.0 }];
    let session = Session::open(&repository("models/scenes/wilt.dls"), &still).expect("a good model");
    let nursery = Nursery::new(&session.model, Settings::default());
    let mut string = ModuleString::default();
    session.simulate(Settings::default()).expect("it starts").at(12.0, &mut string).expect("it grows");
    let mut scene = nursery.blank();
    nursery.draw(&string, &mut scene).unwrap_or_else(|error| panic!("{error}"));
    let tip = scene.surfaces.first().expect("the middle of the flower").placement.origin / 5.0;
    let survey = Survey::new(&session.model, &string).expect("a skeleton");
    let axis = &survey.axes()[0];
    // The shape that hangs down most has the largest angle at its tip.
    let angles = (1..2000).rev().map(|i| f64::from(i) * std::f64::consts::PI / 2000.0);
    let hanging = angles.map(|angle| descend(axis, angle)).find(|(base, _)| *base <= LEAN);
    let (_, [aside, high]) = hanging.expect("a shape in equilibrium");
    assert!((0.4..0.6).contains(&high), "it hangs over: {high}");
    let found = [tip.x.hypot(tip.z), tip.y];
    let error = (found[0] - aside).hypot(found[1] - high);
    assert!(error < 0.01, "{found:?} instead of {:?}", [aside, high]);
}

/// Where the tip of the stalk of `models/wilting.dls` is, with so many pieces, at some times: aside and up, in lengths of the stalk.
fn by_rules(pieces: usize, times: &[f64]) -> Vec<[f64; 2]> {
    let text = std::fs::read_to_string(repository("models/wilting.dls")).expect("a model");
    let piece = "S(0, 0, 0, 0, 0, 0, 0, 0, 0)";
    assert_eq!(text.matches(piece).count(), 11, "a base and eleven pieces");
    let text = text.replace(piece, "").replace("const n = 12 ", &format!("const n = {pieces} "));
    let text = text.replace("const m_S = 0.003 ", &format!("const m_S = {} ", 0.036 / pieces as f64));
    let text = text.replace("  R(0, 0,", &format!("  {}  R(0, 0,", format!("{piece} ").repeat(pieces - 1)));
    let session = Session::from_text("wilting.dls", &text, &[]).expect("a good model");
    let kind = session.model.kinds.iter().find(|(_, kind)| kind.name == "R").expect("the receptacle").0;
    let mut simulation = session.simulate(Settings::default()).expect("it starts");
    let at = |time: &f64| {
        let mut string = ModuleString::default();
        simulation.at(*time, &mut string).expect("it grows");
        let tip = string.iter().find(|module| module.kind == kind).expect("it is there");
        [tip.parameters[2], tip.parameters[3]]
    };
    times.iter().map(at).collect()
}

/// The solver and the rules of `models/wilting.dls` are two ways to one motion.
#[test]
fn a_poppy_wilts_as_its_rules_say() {
    let times: Vec<f64> = (1..=48).map(|k| f64::from(k) * 0.25).collect();
    let still = [dlsys::compile::Setting { name: "breeze".to_owned(), value: 0.0 }];
    let session = Session::open(&repository("models/scenes/wilt.dls"), &still).expect("a good model");
    let nursery = Nursery::new(&session.model, Settings::default());
    let mut simulation = session.simulate(Settings::default()).expect("it starts");
    let at = |time: &f64| {
        let (mut string, mut scene) = (ModuleString::default(), nursery.blank());
        simulation.at(*time, &mut string).expect("it grows");
        nursery.draw(&string, &mut scene).unwrap_or_else(|error| panic!("{error}"));
        let tip = scene.surfaces.first().expect("the receptacle").placement.origin / 5.0;
        [tip.x.hypot(tip.z), tip.y]
    };
    let ours: Vec<[f64; 2]> = times.iter().map(at).collect();
    let [coarse, fine, finest] = [12, 24, 48].map(|pieces| by_rules(pieces, &times));
    let distance = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
    let mut worst = 0.0_f64;
    for (i, time) in times.iter().enumerate() {
        // The error of pieces that are straight, with a hinge at the base too many, is of order 1.
        let limit = [0, 1].map(|k| 2.0 * finest[i][k] - fine[i][k]);
        let (error, of_pieces) = (distance(ours[i], limit), distance(coarse[i], limit));
        // Petals weigh where they are, not at the tip: the flower leans to and fro a little as they leave.
        assert!(error <= (0.4 * of_pieces).max(0.02), "t = {time}: {error}, error of the pieces {of_pieces}");
        worst = worst.max(of_pieces);
    }
    assert!(worst > 0.2, "the stalk falls: {worst}");
}
