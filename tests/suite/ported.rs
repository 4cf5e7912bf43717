//! Porting from cpfg and L-Py: models of ABOP as they stand there, their counts and extents, function files, jumps of curves.

use dlsys::scene::{Point, Scene};
use dlsys::session::Session;
use dlsys::tree::ModuleString;
use dlsys::turtle;

use crate::common::{plain, repository};

/// A ported model at a time.
struct Ported {
    modules: Vec<(String, Vec<f64>)>,
    scene: Scene,
}

fn ported(name: &str, t: f64) -> Ported {
    let session =
        Session::open(&repository(&format!("models/ported/{name}.dls")), &[]).expect("a good model");
    assert!(session.warnings.is_empty(), "{name}: {:?}", session.warnings);
    let mut simulation = session.simulate(Default::default()).expect("it starts");
    let mut string = ModuleString::default();
    simulation.at(t, &mut string).expect("it runs");
    let mut scene = Scene::default();
    turtle::draw(&session.model, &string, &mut scene).expect("drawable");
    Ported { modules: plain(&session.model, &string), scene }
}

impl Ported {
    fn count(&self, name: &str) -> usize {
        self.modules.iter().filter(|(other, _)| other == name).count()
    }

    fn highest(&self) -> f64 {
        self.scene.segments.iter().map(|s| s.end.y).fold(f64::MIN, f64::max)
    }
}

/// ABOP, figure 2.6: each apex makes a segment and two apices; the trunk is contracted by 0.9 in each step.
#[test]
fn the_monopodial_tree_has_the_segments_of_the_book() {
    let tree = ported("monopodial-tree", 10.0);
    assert_eq!(tree.count("F"), 1023);
    let trunk = (1.0 - 0.9f64.powi(10)) / (1.0 - 0.9);
    assert!((tree.highest() - trunk).abs() < 1e-12, "{} instead of {trunk}", tree.highest());
    // Widths are contracted by 0.707: Leonardo's rule.
    let widths: Vec<f64> = tree.modules.iter().filter(|(name, _)| name == "@W").map(|(_, w)| w[0]).collect();
    let least = widths.iter().copied().fold(f64::MAX, f64::min);
    assert!((least - 0.1 * 0.707f64.powi(9)).abs() < 1e-15);
}

/// ABOP, figure 2.8 a: three apices for one; all segments and widths grow in each step.
#[test]
fn the_ternary_tree_has_rules_for_symbols() {
    let tree = ported("ternary-tree", 6.0);
    assert_eq!((tree.count("A"), tree.count("F")), (729, 1 + 2 * (729 - 1)));
    let trunk = tree.modules.iter().find(|(name, _)| name == "F").map(|(_, length)| length[0]);
    assert!((trunk.expect("a trunk") - 200.0 * 1.109f64.powi(6)).abs() < 1e-9);
    let width = tree.modules.iter().find(|(name, _)| name == "@W").map(|(_, width)| width[0]);
    assert!((width.expect("a width") - 1.732f64.powi(6)).abs() < 1e-9);
}

/// ABOP, figure 5.11 a.
#[test]
fn the_compound_leaf_is_the_same_on_every_scale() {
    let leaf = ported("compound-leaf", 6.0);
    assert_eq!((leaf.count("A"), leaf.count("F")), (729, 728));
    assert!((leaf.highest() - 2.0 * 63.0).abs() < 1e-10);
}

/// ABOP, section 4.1, equation 4.1: angle = n · 137.5°, r = c √n.
#[test]
fn florets_stand_on_vogels_spiral() {
    let disc = ported("phyllotaxis", 300.0);
    assert_eq!(disc.count("Floret"), 300);
    let mut places: Vec<Point> = disc.scene.surfaces.iter().map(|s| s.placement.origin).collect();
    places.sort_by(|a, b| a.coords.norm().total_cmp(&b.coords.norm()));
    for (n, place) in places.iter().enumerate().skip(1) {
        // The angle of floret n is (n + 1) · 137.5: the apex turns before the first one.
        let (r, angle) = ((n as f64).sqrt(), (90.0 + 137.5 * (n + 1) as f64).to_radians());
        let apart = (place.x - r * angle.cos()).hypot(place.y - r * angle.sin());
        assert!(apart < 1e-9, "{n}: {place} is {apart} away");
    }
}

/// ABOP, figure 3.5.
#[test]
fn shepherds_purse_has_14_leaves_and_flowers_of_four_petals() {
    let plant = ported("capsella", 40.0);
    // Each leaf is two polygons, each flower 4 · 2 for its petals, and one for its fruit when that is ripe. The apex makes
    // a leaf in each of 14 steps, a flower in each of 26 from then on, and petals in the step after their flower.
    let flowers = 40 - 14;
    let ripe = flowers - 6;
    assert_eq!(plant.count("{"), 2 * 14 + 8 * (flowers - 1) + ripe);
    assert_eq!(plant.count("A"), 1);
}

#[test]
fn function_files_are_the_splines_of_their_points() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("g.func"), "range: 0.0 1.0\npoints: 4\n0.0 0.0\n0.3 0.1\n0.6 0.9\n1.0 0.3\n")
        .expect("written");
    let points = |name: &str| {
        format!("fver 1 1\nname: {name}\nsamples: 100\nflip: off\npoints: 4\n0 0\n0.4 0\n0.4 1\n1 1\n")
    };
    let set = format!("funcgalleryver 1 1\nitems: 2\n{}{}", points("stem"), points("leaf"));
    std::fs::write(at("functions.fset"), set).expect("written");
    let text = "curve g from \"g.func\"\ncurve stem from \"functions.fset\"\n\
        curve step from \"functions.fset\" item \"leaf\"\ncurve spline same = (0, 0) (0.3, 0.1) (0.6, 0.9) (1, 0.3)\n\
        initial string: F(g(0.37), same(0.37), stem(0.425), step(0.425), integral(g, 0, 1))";
    std::fs::write(at("model.dls"), text).expect("written");
    let session = Session::open(&at("model.dls"), &[]).unwrap_or_else(|refused| panic!("{refused}"));
    let mut string = ModuleString::default();
    session.simulate(Default::default()).expect("it starts").at(0.0, &mut string).expect("it runs");
    let found = plain(&session.model, &string).remove(0).1;
    // The Bézier curve of the points, by bisection for x = 0.37.
    let bezier = |u: f64, c: [f64; 3]| {
        3.0 * u * (1.0 - u) * (1.0 - u) * c[0] + 3.0 * u * u * (1.0 - u) * c[1] + u * u * u * c[2]
    };
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if bezier(middle, [0.3, 0.6, 1.0]) < 0.37 { low = middle } else { high = middle }
    }
    assert!((found[0] - bezier(low, [0.1, 0.9, 0.3])).abs() < 1e-14, "{found:?}");
    assert_eq!(found[0].to_bits(), found[1].to_bits());
    assert!((found[2] - 0.5).abs() < 1e-15 && found[2] == found[3], "{found:?}");
}

/// A jump of a curve is an event: where a condition reads it, and where a rate does.
#[test]
fn jumps_of_curves_are_located() {
    let text = "curve linear dose = (0, 1) (1.3, 1) (1.3, 3) (5, 3)\nconst k = 0.1
initial string: A(0) B(0) C(0, 0)
A(x): if dose(t) < 2 solve dx/dt = 1
 if dose(t) >= 2 produce F(x)
B(x): solve dx/dt = dose(t)
C(x, y): solve dx/dt = dose(t)*y, dy/dt = k*sin(x) + 1";
    for (name, method) in dlsys::sim::Method::NAMED.iter().copied() {
        let session = crate::common::session(text);
        let step_size = if method.is_fixed_step() { 1.0 / 64.0 } else { Default::default() };
        let settings =
            dlsys::sim::Settings { method, tolerance: 1e-9, step_size, log: true, ..Default::default() };
        let mut simulation = session.simulate(settings).expect("it starts");
        let mut string = ModuleString::default();
        simulation.at(2.0, &mut string).expect("it runs");
        let modules = plain(&session.model, &string);
        let near = |found: f64, wanted: f64| (found - wanted).abs() < 1e-7;
        assert_eq!(modules[0].0, "F");
        assert!((modules[0].1[0] - 1.3).abs() < 1e-12, "{name}: {:?}", modules[0]);
        // Euler's method, too, is exact on both sides of the jump.
        assert!(near(modules[1].1[0], 1.3 + 3.0 * 0.7), "{name}: {:?}", modules[1]);
        let event = &simulation.take_events()[0];
        assert!((event.time - 1.3).abs() < 1e-12, "{name}: {}", event.time);
        assert!(modules[2].1.iter().all(|x| x.is_finite()));
    }
}
