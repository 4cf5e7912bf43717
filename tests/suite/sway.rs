//! Stems that bend in the wind: no production can be seen, frames observe and never steer, and what does not move is drawn as ever.

use std::collections::HashMap;

use dlsys::scene::{Point, Scene};
use dlsys::session::{Nursery, Session};
use dlsys::sim::{BendSettings, Settings};
use dlsys::tree::ModuleString;

use super::common;

const DIVIDING: &str = "units length 0.1, time 1\n\
    tissue stalk = stiffness 6e7, density 900, damping 0.05\n\
    wind 1, 0, 0.3 speed 4 turbulence 0.4 scale 2\n\
    initial string: @E(stalk) S(1) /(20) S(1.3) [ +(40) S(0.5) @L(1) ] /(50) S(0.9) @K(1.5)\n\
    S(x): if x < 2 solve dx/dt = 0.4x if x = 2 produce S(0.8) /(33) S(1.2) \\(33)\n\
    interpret S(x): !(0.06) F(x)\n";

fn read(name: &str, text: &str) -> Session {
    Session::from_text(name, text, &[]).unwrap_or_else(|refused| panic!("{refused}"))
}

/// The scenes of a model at some times, which need not be in order.
fn scenes(session: &Session, times: &[f64]) -> Vec<Scene> {
    scenes_with(session, times, Settings::default())
}

fn scenes_with(session: &Session, times: &[f64], settings: Settings) -> Vec<Scene> {
    let nursery = Nursery::new(&session.model, settings);
    let draw = |&t: &f64| {
        let mut string = ModuleString::default();
        let mut simulation = session.simulate(settings).expect("it starts");
        simulation.at(t, &mut string).unwrap_or_else(|error| panic!("{error}"));
        let mut scene = nursery.blank();
        nursery.draw(&string, &mut scene).unwrap_or_else(|error| panic!("{error}"));
        scene
    };
    times.iter().map(draw).collect()
}

type Points = HashMap<(u64, usize), Point>;

/// Where things are, by the module that draws them and their number among its things.
fn points(scene: &Scene) -> Points {
    let mut count: HashMap<u64, usize> = HashMap::new();
    let mut found = HashMap::new();
    let surfaces = scene.surfaces.iter().map(|surface| (surface.owner, surface.placement.origin, false));
    let polygons = scene.polygons.iter().map(|polygon| (polygon.owner, polygon.vertices[0], false));
    let segments = scene.segments.iter().map(|segment| (segment.owner, segment.start, true));
    for (owner, point, stems) in surfaces.chain(polygons).chain(segments) {
        let module = scene.owner(owner).lineage.id;
        let number = count.entry(module).or_insert(0);
        // Of stems the first piece: the number of pieces of a bent stem follows its curvature.
        found.entry((module, if stems { usize::MAX } else { *number })).or_insert(point);
        *number += usize::from(!stems);
    }
    found
}

/// The instants of productions up to a time.
fn instants(session: &Session, end: f64) -> Vec<f64> {
    // A model that fails has no instants beyond that.
    let Ok(mut simulation) = session.simulate(Settings { log: true, ..Settings::default() }) else {
        return Vec::new();
    };
    let _ = simulation.pass(end);
    let mut times: Vec<f64> = simulation.take_events().iter().map(|event| event.time).collect();
    times.dedup();
    times
}

/// The largest jumps at an instant, and the largest speed.
#[derive(Clone, Copy, Debug)]
struct Jump {
    position: f64,
    velocity: f64,
    speed: f64,
}

/// The largest jumps of position and of velocity of what is there before and after some instants, in order.
fn jumps(session: &Session, instants: &[f64]) -> Vec<Jump> {
    const H: f64 = 2e-6;
    let times: Vec<f64> =
        instants.iter().flat_map(|at| [-3.0, -2.0, -1.0, 1.0, 2.0, 3.0].map(|i| at + i * H)).collect();
    let points: Vec<_> = scenes(session, &times).iter().map(points).collect();
    let jump = |points: &[Points]| {
        let mut jump = Jump { position: 0.0, velocity: 0.0, speed: 0.0 };
        for key in points[0].keys() {
            let there: Option<Vec<_>> = points.iter().map(|frame| frame.get(key).map(|p| p.coords)).collect();
            let Some(x) = there else { continue };
            // Extrapolated from three times on each side.
            let limit = |[near, next, far]: [usize; 3]| (x[near] - x[next]) * 3.0 + x[far];
            let slope =
                |[near, next, far]: [usize; 3]| (x[near] * 5.0 - x[next] * 8.0 + x[far] * 3.0) / (2.0 * H);
            jump.position = jump.position.max((limit([3, 4, 5]) - limit([2, 1, 0])).norm());
            jump.velocity = jump.velocity.max((slope([3, 4, 5]) + slope([2, 1, 0])).norm());
            jump.speed = jump.speed.max(slope([2, 1, 0]).norm());
        }
        jump
    };
    points.chunks(6).map(jump).collect()
}

#[test]
fn divisions_cannot_be_seen_in_the_wind() {
    let session = read("dividing.dls", DIVIDING);
    let times = instants(&session, 6.0);
    assert!(times.len() >= 6, "{times:?}");
    for jump in jumps(&session, &times) {
        assert!(jump.speed > 0.01, "the wind blows: {jump:?}");
        assert!(jump.position < 1e-9, "{jump:?}");
        assert!(jump.velocity < 1e-6 * jump.speed.max(1.0), "{jump:?}");
    }
}

/// Thin stems take many steps a tick, which read the turbulence between a few instants: within what a step tolerates of what they do with an instant for
/// each, as with any smaller tolerance, where their steps are otherwise the same.
#[test]
fn short_steps_read_turbulence_between_instants() {
    let text = "units length 0.02, time 1\n\
        tissue thread = stiffness 1e8, density 900, damping 0.1\n\
        wind 1, 0, 0.3 speed 3 + sin(2*t) turbulence 0.3 scale 1\n\
        initial string: @E(thread) S(0.3) S(0.3) [ +(40) S(0.2) @L(0.5) ] S(0.2) @K(0.2)\n\
        S(x): solve dx/dt = 0.5\n\
        interpret S(x): !(0.01 + 0.01*x) F(x)\n";
    let session = read("threads.dls", text);
    let drawn = |tolerance: f64| {
        let bending = BendSettings { tolerance, ..BendSettings::default() };
        let scenes = scenes_with(&session, &[1.0], Settings { bending, ..Settings::default() });
        points(&scenes[0])
    };
    let (between, exact) = (drawn(1e-3), drawn(0.999e-3));
    let extent = exact.values().map(|point| point.coords.norm()).fold(0.0, f64::max);
    let off = |(key, point): (&(u64, usize), &Point)| (point - exact[key]).norm() / extent;
    let worst = between.iter().map(off).fold(0.0, f64::max);
    assert!(worst > 1e-9 && worst < 1e-3, "{worst:e}");
}

#[test]
fn the_clock_cannot_be_seen() {
    let session = read("dividing.dls", DIVIDING);
    for jump in jumps(&session, &[30.0, 31.0, 77.0].map(|tick| tick / 30.0)) {
        assert!(jump.position < 1e-9 && jump.velocity < 1e-6 * jump.speed.max(1.0), "{jump:?}");
    }
}

#[test]
fn the_order_of_times_does_not_matter() {
    let session = read("dividing.dls", DIVIDING);
    let times: Vec<f64> = (0..40).map(|i| f64::from(i) * 0.1237).collect();
    let straight = scenes(&session, &times);
    let mut order: Vec<usize> = (0..times.len()).collect();
    order.sort_by_key(|i| i * 17 % 41);
    let mixed = scenes(&session, &order.iter().map(|i| times[*i]).collect::<Vec<_>>());
    for (scene, &i) in mixed.iter().zip(&order) {
        assert_eq!(points(scene), points(&straight[i]), "{}", times[i]);
        // A time that is asked for alone begins at the beginning.
        if i % 7 == 3 {
            let alone = &scenes(&session, &[times[i]])[0];
            assert_eq!(points(alone), points(scene), "{}", times[i]);
        }
    }
}

#[test]
fn at_rest_nothing_changes() {
    let rigid = DIVIDING.replace("@E(stalk) ", "");
    let still: String =
        DIVIDING.lines().filter(|line| !line.starts_with("wind")).map(|l| format!("{l}\n")).collect();
    let upright = still.replace("+(40) S(0.5)", "+(0) S(0.5)").replace("@L(1)", "");
    let [rigid, still] = [rigid, upright].map(|text| {
        scenes(
            &read("rest.dls", &text.replace("+(40) S(0.5)", "+(0) S(0.5)").replace("@L(1)", "")),
            &[0.5, 3.3],
        )
    });
    for (a, b) in rigid.iter().zip(&still) {
        assert!(!a.lacked_accuracy);
        assert_eq!(a.segments.len(), b.segments.len());
        for (a, b) in a.segments.iter().zip(&b.segments) {
            assert!((a.end - b.end).norm() < 1e-12, "growth along the stem moves nothing aside");
        }
    }
}

#[test]
fn a_plant_sways_as_its_model_does_alone() {
    let here = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &str| std::fs::write(here.path().join(name), text).expect("written");
    write("stalk.dls", DIVIDING);
    write(
        "scene.dls",
        "units length 0.1, time 1\nwind 1, 0, 0.3 speed 4 turbulence 0.4 scale 2\nplant @S from \"stalk.dls\"\n\
         initial string: [ -(90) f(0) +(90) -(90) +(90) ] @S(0) [ f(5) @S(0) ] [ f(5) /(90) @S(-0.7) ]\n",
    );
    let open = |name: &str| Session::open(&here.path().join(name), &[]).unwrap_or_else(|e| panic!("{e}"));
    let (alone, scene) = (open("stalk.dls"), open("scene.dls"));
    let (alone, scene) = (scenes(&alone, &[2.0, 4.0]), scenes(&scene, &[2.0, 4.0]));
    for (alone, scene) in alone.iter().zip(&scene) {
        let flower = |scene: &Scene| scene.surfaces.last().expect("a flower").placement.origin;
        let plants: Vec<_> =
            scene.plants.iter().map(|plant| plant.placement.point(flower(&plant.scene))).collect();
        // Bent stems are drawn in pieces: with an accuracy, also those of a plant are drawn again.
        assert!(alone.lacked_accuracy && scene.lacked_accuracy);
        // The plant's axes are those of the scene.
        assert!((plants[0] - flower(alone)).norm() < 1e-9, "{:?} {:?}", plants[0], flower(alone));
        let higher = plants[1] - dlsys::scene::Vector::new(0.0, 5.0, 0.0);
        assert!((higher - plants[0]).norm() > 1e-3, "another place, another wind");
    }
}

/// The number of segments drawn at a time, unless the model or its stems fail before, or the string is long.
fn drawn(session: &Session, time: f64) -> Option<usize> {
    let nursery = Nursery::new(&session.model, Settings::default());
    let mut string = ModuleString::default();
    let mut scene = nursery.blank();
    let settings = Settings { max_modules: 20_000, ..Settings::default() };
    session.simulate(settings).ok()?.at(time, &mut string).ok()?;
    nursery.draw(&string, &mut scene).ok()?;
    Some(scene.segments.len())
}

/// The models of the repository with everything that they draw made of a soft tissue, in a wind.
#[test]
#[ignore = "takes minutes"]
fn nothing_pops_in_any_model() {
    let (mut seen, mut large, mut refused) = (0, 0, Vec::new());
    for path in common::models().into_iter().filter(|path| path.to_string_lossy().contains("/models/")) {
        let text = std::fs::read_to_string(&path).expect("readable");
        let (head, tail) = text.split_once("initial string:").unwrap_or(("", ""));
        if head.contains("tissue ") || tail.is_empty() {
            continue;
        }
        let folder = path.parent().expect("a folder");
        let dressed = |words: &str, first: &str| {
            let text = format!("{words}\n{head}initial string: {first} {tail}");
            Session::from_text_in(folder, &[], "dressed.dls", &text, &[])
        };
        let words = "units length 0.05, time 1\ntissue zz = stiffness 1e10, density 900, damping 0.2\n\
             wind 1, 0, 0.3 speed 2 turbulence 0.3 scale 2";
        let (Ok(bent), Ok(rigid)) = (dressed(words, "@E(zz) !(0.1)"), dressed("", "!(0.1)")) else {
            continue;
        };
        let end = bent.model.frames.map_or(5.0, |frames| frames.to.min(8.0));
        let times = instants(&rigid, end);
        let some: Vec<f64> =
            times.iter().copied().step_by(times.len() / 4 + 1).filter(|t| *t > 0.1).collect();
        let last = some.last().copied().unwrap_or(0.0) + 0.1;
        // Curves of thousands of segments are no stems, and take minutes.
        let Some(stems) = drawn(&rigid, last) else { continue };
        if stems > 600 {
            large += 1;
            continue;
        }
        if drawn(&bent, last).is_none() {
            refused.push(path.display().to_string());
            continue;
        }
        for (jump, without) in jumps(&bent, &some).into_iter().zip(jumps(&rigid, &some)) {
            // What jumps without wind jumps in it.
            if without.position > 1e-9 || without.velocity > 1e-6 {
                continue;
            }
            assert!(jump.position < 2e-8, "{}: {jump:?} {without:?}", path.display());
            assert!(jump.velocity < 2e-6 * jump.speed.max(1.0), "{}: {jump:?} {without:?}", path.display());
            seen += 1;
        }
    }
    assert!(refused.is_empty(), "{refused:?}");
    assert!(seen > 30 && large < 20, "{seen}, {large}");
}

/// Days instead of seconds: the wind of so long a film would take more than ten million ticks, for a plant from the first tick on, and
/// for one that is born after so many.
#[test]
fn a_film_that_is_too_long_is_refused_at_once() {
    const STALK: &str = "tissue wood = stiffness 1e9, density 500, damping 0.1\n\
        initial string: @E(wood) !(0.1) F(1)\nframes 0 .. 1 step 1\n";
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("stalk.dls"), STALK).expect("written");
    for birth in [-2, 30] {
        let days = format!(
            "units length 0.1, time 86400\ninitial string: @Stalk({birth})\nplant @Stalk from \"stalk.dls\"\n"
        );
        std::fs::write(folder.path().join("days.dls"), days).expect("written");
        let session = Session::open(&folder.path().join("days.dls"), &[]).expect("a good model");
        let nursery = Nursery::new(&session.model, Settings::default());
        let mut string = ModuleString::default();
        let mut simulation = session.simulate(Settings::default()).expect("it starts");
        simulation.at(35.0, &mut string).expect("it grows");
        let error = nursery.draw(&string, &mut nursery.blank()).expect_err("so long a film").diagnostic();
        let text = format!("{} {:?}", error.message, error.notes);
        assert!(text.contains("more than 1e7 steps"), "born at {birth}: {text}");
    }
}

/// Of a stem that is born exactly at a tick, the velocity of growth is known one tick later. The difference is no acceleration: what the stem
/// carries would be thrown sideways, and the trunk below would swing.
#[test]
fn a_birth_at_a_tick_is_no_blow() {
    let model = |birth: f64| {
        format!(
            "units length 0.1, time 1\ntissue stalk = stiffness 1e9, density 500, damping 0.1\n\
             initial string: @E(stalk) T A\nA: if age = {birth} produce S(0.1) K\nS(x): solve dx/dt = 1\n\
             interpret T: !(0.05) F(3)\ninterpret S(x): &(90) !(0.05) F(x)\ninterpret K: @O(0.5)\ninterpret A: ε\n"
        )
    };
    for birth in [0.99, 1.0] {
        let session = read("blow.dls", &model(birth));
        let times: Vec<f64> = (0..24).map(|i| 1.0 + f64::from(i) / 48.0).collect();
        let aside = |scene: &Scene| {
            let mut ends = scene.segments.iter().map(|segment| segment.end);
            ends.find(|end| end.y > 2.0).expect("the upper part of the trunk").z.abs()
        };
        let swing = scenes(&session, &times).iter().map(aside).fold(0.0, f64::max);
        assert!(swing < 1e-3, "born at {birth}, the trunk swings by {swing}");
    }
}

/// Widths in proportion to lengths: a stem that is born with 1e-16 m at a tick, or a little before it, is 1e13 times as thick at the next.
#[test]
fn a_stem_may_be_born_as_small_as_it_likes() {
    let swaying = |birth: f64, size: f64| {
        let text = format!(
            "wind 1, 0, 0.3 speed 2\ntissue w = stiffness 5e8, density 800, damping 0.1\n\
             initial string: [ @E(w) S(0.06) S(0.03) A ]\nA: if age = {birth:?} produce S({size:?}) [ +(40) S({size:?}) ]\n\
             S(x): solve dx/dt = 0.1\ninterpret S(x): !(0.05*x) F(x) [ +(40) @L(x) ]\ninterpret A: ε\n"
        );
        let session = read("young.dls", &text);
        let [scene] = &scenes(&session, &[1.5])[..] else { unreachable!() };
        points(scene)
    };
    // At a tick, a rounding before it, and shortly before it.
    for birth in [28.0 / 30.0, 0.8999999999999999, 0.9333] {
        let large = swaying(birth, 1e-9);
        for size in [1e-12, 1e-16, 1e-18, 0.0] {
            let small = swaying(birth, size);
            assert_eq!(large.len(), small.len());
            for (owner, point) in &large {
                let off = (small[owner] - point).norm();
                assert!(off < 1e-4, "born at {birth} with {size}, {owner:?} is {off} elsewhere");
            }
        }
    }
}

#[test]
fn a_stem_that_cannot_be_followed_is_named_with_its_place() {
    const STORM: &str = "units length 0.1, time 2\nwind 1, 0, 0 speed 1e200\n\
        tissue stalk = stiffness 1e9, density 500, damping 0.1\ninitial string: @E(stalk) S(1)\n\
        S(x): if x < 2 solve dx/dt = 0.7 if x = 2 produce S(0.8) S(1.2)\ninterpret S(x): !(0.05) F(x)\n";
    let session = read("storm.dls", STORM);
    let nursery = Nursery::new(&session.model, Settings::default());
    let mut string = ModuleString::default();
    let mut simulation = session.simulate(Settings::default()).expect("it starts");
    simulation.at(0.5, &mut string).expect("it grows");
    let error = nursery.draw(&string, &mut nursery.blank()).expect_err("a storm").diagnostic();
    let message = "the stem of `S` (module 2) cannot be followed at t = 0: its motion is not finite";
    assert!(error.message.starts_with(message), "{}", error.message);
    let quoted: Vec<&str> =
        error.labels.iter().map(|(span, _)| &STORM[span.start as usize..span.end as usize]).collect();
    assert_eq!(quoted[0], "F(x)");
    assert!(quoted[1].starts_with("tissue stalk"), "{quoted:?}");
    assert!(error.notes[0].contains("10 cm long and 5 mm wide"), "{:?}", error.notes);
    assert!(error.help.iter().any(|help| help.contains("`--bend-tolerance 0.01`")), "{:?}", error.help);
}

/// A rope in a storm takes thousands of steps a second: the limit of time holds for them, too.
#[test]
fn stems_stop_at_the_limit_of_time() {
    let session =
        read("rope.dls", &DIVIDING.replace("speed 4", "speed 40").replace("damping 0.05", "damping 0"));
    let settings = Settings { max_seconds: 0.2, ..Settings::default() };
    let nursery = Nursery::new(&session.model, settings);
    let mut string = ModuleString::default();
    let mut simulation = session.simulate(settings).expect("it starts");
    simulation.at(6.0, &mut string).expect("it grows");
    let begun = std::time::Instant::now();
    let error = nursery.draw(&string, &mut nursery.blank()).expect_err("too slow").diagnostic();
    assert!(
        error.message.starts_with("after 0.2 s of computing, the surroundings are at t = "),
        "{}",
        error.message
    );
    assert!(begun.elapsed().as_secs() < 30, "{:?}", begun.elapsed());
}

/// A horizontal rod sags by q L⁴/(8 E I), however its segments are written: one is one `F`.
#[test]
fn every_step_of_a_drawing_is_a_segment() {
    let (diameter, length) = (0.02_f64, 2.0_f64);
    let inertia = std::f64::consts::PI * diameter.powi(4) / 64.0;
    let load = 800.0 * 9.81 * std::f64::consts::PI * diameter * diameter / 4.0;
    let sag = load * length.powi(4) / (8.0 * 2e10 * inertia);
    for drawn in [
        "!(0.02) for i in 1 .. 20: ( F(0.1) ) @O(0.0001)\n",
        "S @O(0.0001)\ninterpret S: !(0.02) for i in 1 .. 20: ( F(0.1) )\n",
        "S @O(0.0001)\ninterpret S: for i in 1 .. 20: ( !(0.02) F(0.1) )\n",
    ] {
        let text = format!(
            "units length 1, time 1\ntissue wood = stiffness 2e10, density 800, damping 0.7, sag\ninitial string: -(90) @E(wood) {drawn}"
        );
        let scene = scenes(&read("rod.dls", &text), &[20.0]).remove(0);
        let tip = scene.surfaces.last().expect("a ball").placement.origin;
        assert!((tip.y / -sag - 1.0).abs() < 0.005, "{drawn}: {tip}, not {sag}");
    }
}
