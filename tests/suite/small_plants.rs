//! Plants in the wind that are small in the picture: they move by the modes of their class, with an error below the bound, whatever is drawn
//! before, and on however many threads.

use dlsys::scene::{Point, Scene, Vector};
use dlsys::session::{Detail, Nursery, Session, SwayReport};
use dlsys::sim::Settings;
use dlsys::tree::ModuleString;

/// A tuft without chance, whose ears hang at bent necks.
const TUFT: &str = "units length 0.1, time 1\ntissue straw = stiffness 3e9, density 350, damping 0.12\n\
    initial string: for i in 1 .. 3: ( [ /(120*i) &(6) Culm ] )\n\
    interpret Culm: @E(straw) !(0.032) F(2.2) !(0.030) F(2.0) !(0.027) F(1.9) !(0.024) F(1.3) &(10) !(0.02) F(0.6) @E(0) [ @M(0.6, 1.2, 0.5) @L(0.05) ]\n";
/// A field of it, over which a gust runs.
const FIELD: &str = "units length 0.1, time 1\nplant @Tuft from \"tuft.dls\"\n\
    wind 1, 0, 0 speed 1.5 turbulence 0.35 scale 1.2\n\
    flow vortex 80 at 30*(t - 0.6) - 40, 22, 0 axis 0, 0, 1 decay 20\n\
    camera at 0, 12.5, 34 towards 0, 5.4, -6 angle 30\nframes 0 .. 3 step 0.5\n\
    initial string: for i in 0 .. 7: ( for j in 0 .. 5: ( P(2.3*(i - 4), 2.3*(j - 4), uniform(0, 360)) ) )\n\
    interpret P(x, z, a): [ /(90) -(90) f(z) +(90) \\(90) -(90) f(x) +(90) /(a) @Tuft(0) ]\n";

fn field() -> Session {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, text) in [("tuft.dls", TUFT), ("field.dls", FIELD)] {
        std::fs::write(folder.path().join(name), text).expect("a model");
    }
    Session::open(&folder.path().join("field.dls"), &[]).unwrap_or_else(|refused| panic!("{refused}"))
}

const DETAIL: Detail = Detail { pixels: 240.0, shape: 1.0, viewpoint: None, bound: 0.5 };

fn draw(session: &Session, nursery: &Nursery<'_>, t: f64) -> Scene {
    let mut string = ModuleString::default();
    let mut simulation = session.simulate(Settings::default()).expect("it starts");
    simulation.at(t, &mut string).expect("it grows");
    let mut scene = nursery.blank();
    nursery.draw(&string, &mut scene).unwrap_or_else(|error| panic!("{error}"));
    scene
}

/// Scenes at times in this order, and how plants were followed.
fn scenes(session: &Session, detail: Option<Detail>, times: &[f64]) -> (Vec<Scene>, SwayReport) {
    let nursery = Nursery::new(&session.model, Settings::default()).for_picture(detail);
    let scenes = times.iter().map(|&t| draw(session, &nursery, t)).collect();
    (scenes, nursery.sway_report().expect("they sway"))
}

/// The origins of all ears.
fn places(scene: &Scene) -> Vec<Point> {
    let of = |plant: &dlsys::scene::Plant| {
        let [x, y, z] = plant.placement.axes;
        let place = |p: Point| plant.placement.origin + x * p.x + y * p.y + z * p.z;
        plant.scene.surfaces.iter().map(|surface| place(surface.placement.origin)).collect::<Vec<Point>>()
    };
    scene.plants.iter().flat_map(of).collect()
}

/// Where the camera of the field sees a point, in pixels from the middle of the picture.
fn seen(p: Point, pixels: f64) -> [f64; 2] {
    let (eye, aim) = (Point::new(0.0, 12.5, 34.0), Point::new(0.0, 5.4, -6.0));
    let forward = (aim - eye).normalize();
    let right = forward.cross(&Vector::y()).normalize();
    let (away, up) = (p - eye, right.cross(&forward));
    let scale = 0.5 * pixels / 15_f64.to_radians().tan() / away.dot(&forward);
    [away.dot(&right) * scale, away.dot(&up) * scale]
}

/// Largest distance between two pictures of the same things, in pixels.
fn apart(a: &Scene, b: &Scene, pixels: f64) -> f64 {
    let (a, b) = (places(a), places(b));
    assert!(a.len() >= 48 && a.len() == b.len(), "{} and {} ears", a.len(), b.len());
    let distance = |(a, b): (&Point, &Point)| {
        let ([ax, ay], [bx, by]) = (seen(*a, pixels), seen(*b, pixels));
        (ax - bx).hypot(ay - by)
    };
    a.iter().zip(&b).map(distance).fold(0.0, f64::max)
}

#[test]
fn small_plants_move_by_modes_with_an_error_below_the_bound() {
    let session = field();
    let times = [0.3, 1.0, 1.6, 2.3];
    let (solved, all) = scenes(&session, None, &times);
    assert_eq!((all.plants, all.solved, all.by_modes), (48, 48, 0));
    let (modal, report) = scenes(&session, Some(DETAIL), &times);
    assert!(report.plants == 48 && report.by_modes > 24, "{report:?}");
    assert!(report.error_pixels > 0.0 && report.error_pixels <= 0.25, "{report:?}");
    let moved = apart(&solved[0], &solved[2], DETAIL.pixels);
    let errors: Vec<f64> =
        solved.iter().zip(&modal).map(|(solved, modal)| apart(solved, modal, DETAIL.pixels)).collect();
    let largest = errors.iter().copied().fold(0.0, f64::max);
    assert!(moved > 3.0, "the gust moves them by {moved} pixels only");
    assert!(largest > 0.0 && largest <= DETAIL.bound, "{errors:?} of {moved} pixels, {report:?}");
    // In a picture so large that modes do not suffice, all are solved, to the same bits.
    let (large, report) = scenes(&session, Some(Detail { pixels: 1e6, ..DETAIL }), &times[..1]);
    assert_eq!((report.solved, report.by_modes), (48, 0));
    assert_eq!(places(&large[0]), places(&solved[0]));
}

#[test]
fn frames_and_threads_do_not_matter_for_small_plants() {
    let session = field();
    let times = [0.4, 0.9, 1.5];
    let (forward, report) = scenes(&session, Some(DETAIL), &times);
    assert!(report.by_modes > 15, "{report:?}");
    let (back, _) = scenes(&session, Some(DETAIL), &[1.5, 0.4]);
    assert_eq!(places(&back[0]), places(&forward[2]));
    assert_eq!(places(&back[1]), places(&forward[0]));
    let nursery = Nursery::new(&session.model, Settings::default()).for_picture(Some(DETAIL));
    let together = std::thread::scope(|scope| {
        let threads = times.map(|t| {
            scope.spawn({
                let (session, nursery) = (&session, &nursery);
                move || places(&draw(session, nursery, t))
            })
        });
        threads.map(|thread| thread.join().expect("it draws"))
    });
    for (together, alone) in together.iter().zip(&forward) {
        assert_eq!(*together, places(alone));
    }
}
