//! The stalk of `models/scenes/wilt.dls` against the heavy elastica, the exact shape of a thin rod under its weight and a load.

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
fn a_wilted_stalk_hangs_as_the_elastica() {
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
    assert!(high < 0.0, "it hangs: {high}");
    let found = [tip.x.hypot(tip.z), tip.y];
    let error = (found[0] - aside).hypot(found[1] - high);
    assert!(error < 0.03, "{found:?} instead of {:?}", [aside, high]);
}
