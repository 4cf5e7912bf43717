//! Plants of other models in a scene, and the words of scenes: what a plant draws is what its model draws at its age, whatever was drawn
//! before; names of older models that are words now stay names.

use dlsys::model::{Primitive, Spectrum, Tissue, Units};
use dlsys::scene::{Point, Scene, Surroundings};
use dlsys::session::{Nursery, Session};
use dlsys::sim::Settings;
use dlsys::tree::ModuleString;
use std::path::Path;

const STEM: &str = "color sap = \"#123456\"\ncontour flat = (1, 0) (0, 0.1) (-1, 0) (0, -0.1)\nparam r = 1\nangle 30\n\
    initial string: ;(sap) @C(flat) F(0) + A\nF(x): solve dx/dt = r\nA: if age = 1 produce [ & @L(1) ] F(0) A\n";
const CHANCE: &str = "initial string: A\nA: at rate 2 produce [ +(uniform(-60, 60)) F(uniform(1, 2)) ] F(1) A\ninterpret A: !(0.1) F(0.3)\n";

fn folder(files: &[(&str, &str)]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, text) in files {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("made");
        std::fs::write(path, text).expect("written");
    }
    folder
}

fn open(folder: &Path, name: &str) -> Session {
    Session::open(&folder.join(name), &[]).unwrap_or_else(|refused| panic!("{refused}"))
}

fn refusal(folder: &Path, name: &str) -> String {
    Session::open(&folder.join(name), &[]).expect_err("refused").to_string()
}

fn string(session: &Session, t: f64, seed: u64) -> ModuleString {
    let mut string = ModuleString::default();
    let settings = Settings { seed, ..Settings::default() };
    session.simulate(settings).and_then(|mut simulation| simulation.at(t, &mut string)).expect("it grows");
    string
}

fn drawn(session: &Session, t: f64, seed: u64) -> Scene {
    let nursery = Nursery::new(&session.model, Settings { seed, ..Settings::default() });
    let mut scene = nursery.blank();
    nursery.draw(&string(session, t, seed), &mut scene).expect("drawable");
    scene
}

/// Everything that is drawn, plants included, as text.
fn shown(scene: &Scene) -> Vec<String> {
    let flat = scene.flattened();
    let color = |material| flat.palette.get(material).color.to_string();
    let mut all: Vec<String> = (flat.segments.iter())
        .map(|s| {
            let contour = s.contour.map(|i| &flat.contours[i as usize]);
            format!("{:?} {:?} {:?} {} {contour:?}", s.start, s.end, s.widths, color(s.material))
        })
        .collect();
    all.extend(flat.surfaces.iter().map(|s| {
        let colors: Vec<String> = s.mesh.faces.iter().map(|face| color(face.material)).collect();
        format!("{:?} {:?} {}", s.placement, s.tint, colors.concat())
    }));
    all
}

#[test]
fn a_plant_is_what_its_model_draws_at_its_age() {
    let main = "color first = \"#abcdef\"\ncontour own = (1, 0) (0, 1) (-1, 0) (0, -1)\nplant @Stem from \"deep/stem.dls\" with r = 0.5\n\
        initial string: ;(first) @C(own) !(1) F(1) [ f(3) @Stem(1.5) ] -(90) f(2) +(90) @Stem(2.5, 7) @Stem(9)\n";
    let here = folder(&[("main.dls", main), ("deep/stem.dls", STEM)]);
    let session = open(here.path(), "main.dls");
    let scene = drawn(&session, 4.0, 1);
    assert_eq!(scene.plants.len(), 2, "one is not born yet");
    for (plant, age) in scene.plants.iter().zip([2.5, 1.5]) {
        let stem = Session::open(
            &here.path().join("deep/stem.dls"),
            &[dlsys::compile::Setting { name: "r".to_owned(), value: 0.5 }],
        )
        .expect("a model");
        let own = drawn(&stem, age, 1);
        assert_eq!(plant.scene.segments.len(), own.segments.len());
        let default = dlsys::scene::Bounds::of(&own).default_width();
        for (ours, theirs) in plant.scene.segments.iter().zip(&own.segments) {
            assert_eq!((ours.start, ours.end), (theirs.start, theirs.end));
            assert_eq!(ours.widths.map(|w| w.resolve(0.0)), theirs.widths.map(|w| w.resolve(default)));
            assert_eq!(scene.palette.get(ours.material).color, own.palette.get(theirs.material).color);
            let contour = |scene: &Scene, i: Option<u32>| i.map(|i| scene.contours[i as usize].clone());
            assert_eq!(contour(&scene, ours.contour), contour(&own, theirs.contour));
        }
    }
    let flat = scene.flattened();
    assert_eq!(flat.segments[1].start, dlsys::scene::Point::new(0.0, 4.0, 0.0), "after 1 and 3");
    assert!((flat.segments.last().expect("a stem").start.x - 2.0).abs() < 2.0);
    let names: std::collections::HashSet<u64> = flat.owners().iter().map(|owner| owner.lineage.id).collect();
    assert_eq!(names.len(), flat.owners().len(), "every module has a name of its own");
}

#[test]
fn plants_do_not_depend_on_what_was_drawn_before() {
    let main = "plant @Stem from \"stem.dls\"\nplant @Chance from \"chance.dls\"\n\
        initial string: for i in 0 .. 9: ( [ -(90) f(2*i) +(90) @Stem(i/3) @Chance(i/5) @Chance(i/4, i) @Chance(0, 0.5) ] )\n";
    let here = folder(&[("main.dls", main), ("stem.dls", STEM), ("chance.dls", CHANCE)]);
    let session = open(here.path(), "main.dls");
    let nursery = Nursery::new(&session.model, Settings { seed: 3, ..Settings::default() });
    let look = |t: f64| {
        let mut scene = nursery.blank();
        nursery.draw(&string(&session, t, 3), &mut scene).expect("drawable");
        shown(&scene)
    };
    let times = [2.0, 4.0, 1.0, 4.0, 0.0, 3.0];
    let all: Vec<Vec<String>> = times.iter().map(|t| look(*t)).collect();
    for (t, ours) in times.iter().zip(&all) {
        assert_eq!(ours, &shown(&drawn(&session, *t, 3)), "t = {t}");
    }
    // From several threads at once.
    let strings: Vec<ModuleString> = times.iter().map(|t| string(&session, *t, 3)).collect();
    std::thread::scope(|scope| {
        let jobs: Vec<_> = (strings.iter().zip(&all))
            .map(|(string, expected)| {
                let nursery = &nursery;
                scope.spawn(move || {
                    let mut scene = nursery.blank();
                    nursery.draw(string, &mut scene).expect("drawable");
                    assert_eq!(&shown(&scene), expected);
                })
            })
            .collect();
        jobs.into_iter().for_each(|job| job.join().expect("no panic"));
    });
}

#[test]
fn seeds_tell_plants_with_random_numbers_apart_and_no_others() {
    let main = "plant @Stem from \"stem.dls\"\nplant @Chance from \"chance.dls\"\n\
        initial string: @Stem(0, 1) @Stem(0, 2) @Chance(0, 1) @Chance(0, 2) @Chance(0, 1) @Chance(0) @Chance(0, 5)\n";
    let here = folder(&[("main.dls", main), ("stem.dls", STEM), ("chance.dls", CHANCE)]);
    let session = open(here.path(), "main.dls");
    let scene = drawn(&session, 3.0, 5);
    let same = |a: usize, b: usize| std::sync::Arc::ptr_eq(&scene.plants[a].scene, &scene.plants[b].scene);
    assert!(same(0, 1) && same(2, 4) && !same(2, 3) && same(5, 6));
    assert_ne!(shown(&scene.plants[2].scene), shown(&scene.plants[3].scene));
    let own = drawn(&open(here.path(), "chance.dls"), 3.0, 5);
    assert_eq!(scene.plants[5].scene.segments.len(), own.segments.len(), "the seed of the scene");
}

#[test]
fn plants_stand_in_plants_and_never_in_themselves() {
    let outer = "plant @Tuft from \"tuft/tuft.dls\"\ninitial string: for i in 0 .. 2: ( [ -(90) f(i) +(90) @Tuft(0) ] )\n";
    let tuft = "plant @Stem from \"stem.dls\"\nground 2\ninitial string: [ @G @Stem(-1) ] f(1) @Stem(-2)\n";
    let here = folder(&[
        ("main.dls", outer),
        ("tuft/tuft.dls", tuft),
        ("tuft/stem.dls", STEM),
        ("self.dls", "plant @Me from \"self.dls\"\ninitial string: @Me(0)\n"),
        ("one.dls", "plant @Two from \"two.dls\"\ninitial string: @Two(0)\n"),
        ("two.dls", "plant @One from \"one.dls\"\ninitial string: @One(0)\n"),
        ("wrong.dls", "plant @Bad from \"bad.dls\"\ninitial string: @Bad(0)\n"),
        ("bad.dls", "initial string: F(1)\n\nF(x): solve dx/dt = y\n"),
        ("with.dls", "plant @Stem from \"tuft/stem.dls\" with q = 2\ninitial string: @Stem(0)\n"),
        ("late.dls", "plant @Late from \"limit.dls\"\ninitial string: @Late(0)\n"),
        ("limit.dls", "initial string: F(0)\nF(x): if x < 1 solve dx/dt = 1\n"),
    ]);
    let scene = drawn(&open(here.path(), "main.dls"), 1.0, 1);
    assert_eq!((scene.plants.len(), scene.plants[0].scene.plants.len()), (3, 2));
    assert_eq!(scene.surroundings, Surroundings::default(), "those of a plant do not count");
    let flat = scene.flattened();
    assert_eq!(flat.plants.len(), 0);
    assert!(flat.segments.iter().any(|s| s.start.y == 2.0 && s.start.x == 2.0), "@G in the plant");
    assert!(refusal(here.path(), "self.dls").contains("is a plant of itself"));
    assert!(refusal(here.path(), "one.dls").contains("is a plant of itself"));
    let bad = refusal(here.path(), "wrong.dls");
    assert!(bad.contains("in line 3") && bad.contains("bad.dls:3: unknown name `y`"), "{bad}");
    let with = refusal(here.path(), "with.dls");
    assert!(with.contains("refuses a value") && with.contains("no param `q`"), "{with}");
    let late = open(here.path(), "late.dls");
    let nursery = Nursery::new(&late.model, Settings::default());
    let error = nursery.draw(&string(&late, 3.0, 1), &mut nursery.blank()).expect_err("outside its domain");
    let message = error.diagnostic().render(&late.source, false);
    assert!(
        message.contains("the plant `@Late` cannot grow to the age 3") && message.contains("limit.dls:2:"),
        "{message}"
    );
}

#[test]
fn plants_are_as_large_as_their_third_parameter_says() {
    let main = "plant @Stem from \"stem.dls\"\nplant @Ripe from \"ripe.dls\"\nparam k = 1 in 0 .. 9\n\
        initial string: @Stem(0) f(2) @Stem(0, 0, 0.5) @Stem(0, 0, 0) @Stem(0, 0, -1) @Ripe(0, 0, k)\n";
    let ripe = "units length 1, time 1\nground 0\ninitial string: f(0.5) @D @P(0.05, 0.06)\n";
    let here = folder(&[("main.dls", main), ("stem.dls", STEM), ("ripe.dls", ripe)]);
    let session = open(here.path(), "main.dls");
    let scene = drawn(&session, 3.5, 1);
    assert_eq!(scene.plants.len(), 3, "those of no size are not there");
    assert!(std::sync::Arc::ptr_eq(&scene.plants[0].scene, &scene.plants[1].scene), "one drawing");
    let flat = scene.flattened();
    let (whole, half) = flat.segments.split_at(flat.segments.len() / 2);
    assert!(whole.len() > 2 && whole.len() == half.len());
    for (whole, half) in whole.iter().zip(half) {
        let wanted = Point::new(0.0, 2.0, 0.0) + whole.end.coords / 2.0;
        assert!((half.end - wanted).norm() < 1e-12, "{:?} {wanted:?}", half.end);
    }
    let twice = dlsys::compile::Setting { name: "k".to_owned(), value: 2.0 };
    let session = Session::open(&here.path().join("main.dls"), &[twice]).expect("a model");
    let nursery = Nursery::new(&session.model, Settings::default());
    let error =
        nursery.draw(&string(&session, 3.5, 1), &mut nursery.blank()).expect_err("it lets something go");
    let message = error.diagnostic().render(&session.source, false);
    assert!(message.contains("has the size of its model") && message.contains("main.dls:2:"), "{message}");
}

/// A plant of half a metre after five minutes would be five metres high after five seconds.
#[test]
fn other_units_of_a_plant_are_told() {
    let plant =
        "units length 0.1, time 60\ninitial string: A(0)\nA(x): solve dx/dt = 1\ninterpret A(x): F(x)\n";
    let scene = |units: &str| format!("{units}plant @P from \"plant.dls\"\ninitial string: @P(0)\n");
    let warnings = |units: &str| {
        let folder = folder(&[("plant.dls", plant), ("scene.dls", &scene(units))]);
        open(folder.path(), "scene.dls").warnings.len()
    };
    assert_eq!([warnings(""), warnings("units length 0.1, time 60\n")], [1, 0]);
}

#[test]
fn surroundings_follow_time() {
    let text = "light cos(t), 1, 0\nsky \"#001122\", \"#fff\"\ncamera at 0, 1, 5 + t towards 0, 1, 0 angle 30\nground -0.5\n\
        initial string: f(3) @G F(1)\n";
    let here = folder(&[("main.dls", text)]);
    let scene = drawn(&open(here.path(), "main.dls"), 2.0, 1);
    let camera = scene.surroundings.camera.expect("a camera");
    assert_eq!((camera.eye.z, camera.angle, scene.surroundings.floor), (7.0, 30.0, Some(-0.5)));
    assert_eq!(scene.surroundings.sun.expect("a sun").x, 2_f64.cos());
    assert_eq!(scene.surroundings.sky.expect("a sky")[1].to_string(), "#ffffff");
    assert_eq!(scene.segments[0].start.y, -0.5);
}

#[test]
fn words_of_scenes_stay_names_where_a_declaration_cannot_begin() {
    let text = "const plant = 2\nparam sky = 3\nconst camera = 1\n\
        initial string: light(1) ground(camera) sky(sky)\n  light(2) ground(plant) camera\n\
        light(x): if x < 5 solve dx/dt = 1\n if x = 5 produce ground(1) plant\nground(x) < sky(y): solve dy/dt = x\n\
        camera: if age = 1 produce light(4)\nplant: if age = 1 produce ε\nlight(x) > ground(y): solve dx/dt = 0\ninterpret ground(x): ε\n";
    let session = crate::common::session(text);
    assert_eq!(session.model.axiom.kinds().count(), 6);
    assert_eq!(session.model.rules.len(), 5);
    assert!(session.model.scenery.light.is_none() && session.model.scenery.ground.is_none());
}

const STALK: &str = "tissue stalk = stiffness 2e8, density 900, damping 0.05\n";

#[test]
fn wind_and_tissues_have_the_values_that_are_written() {
    let text = "units time 3600, length 0.1\nparam u = 3\nconst soft = 1e7\n\
        wind 0, 0, -2 speed u + sin(t) turbulence 0.3 scale 4 seed 7 roughness 0.03\nflow uniform -1, 0, t\n\
        flow vortex 2*t axis 0, 1, 0 at 1, 2, -3 decay 3\nflow sink 4 at 0, 1, 0\n\
        tissue stalk = stiffness 2e8, density 900, damping 0.05\n\
        tissue leaf = sag, thickness 1e-4, damping 0, stiffness 3*soft, density 800\n\
        initial string: @E(leaf) F(stalk) @E(0) F(1)\n";
    let session = crate::common::session(text);
    assert!(session.warnings.is_empty(), "{:?}", session.warnings);
    let scenery = &session.model.scenery;
    assert_eq!(scenery.units, Units { length: 0.1, time: 3600.0 });
    let wind = scenery.wind.as_ref().expect("a wind");
    assert_eq!((wind.direction, wind.speed.eval_one(&[0.5])), ([0.0, 0.0, -2.0], 3.0 + 0.5_f64.sin()));
    assert_eq!((wind.turbulence, wind.scale, wind.roughness), (0.3, 4.0, Some(0.03)));
    assert_eq!((wind.period, wind.seed, wind.spectrum), (None, 7, Spectrum::VonKarman));
    let values: Vec<(Primitive, Vec<f64>, Option<f64>)> = (scenery.flows.iter())
        .map(|flow| {
            let mut out = vec![0.0; flow.program.outputs()];
            flow.program.eval(&[5.0], &mut Vec::new(), &mut out);
            (flow.primitive, out, flow.decay)
        })
        .collect();
    assert_eq!(values[0], (Primitive::Uniform, vec![-1.0, 0.0, 5.0], None));
    assert_eq!(values[1], (Primitive::Vortex, vec![10.0, 1.0, 2.0, -3.0, 0.0, 1.0, 0.0], Some(3.0)));
    assert_eq!(values[2], (Primitive::Sink, vec![4.0, 0.0, 1.0, 0.0], None));
    let [stalk, leaf] = &scenery.tissues[..] else { panic!("two tissues") };
    assert_eq!((stalk.stiffness_at(0.0), stalk.density, stalk.damping), (Some(2e8), 900.0, 0.05));
    assert_eq!((stalk.thickness, stalk.sag), (Tissue::THICKNESS, false));
    assert_eq!(
        (leaf.stiffness_at(0.0), leaf.damping, leaf.thickness, leaf.sag),
        (Some(3e7), 0.0, 1e-4, true)
    );
    let mut string = ModuleString::default();
    session.simulate(Settings::default()).and_then(|mut run| run.at(0.0, &mut string)).expect("it grows");
    let parameters: Vec<f64> = string.iter().map(|module| module.parameters[0]).collect();
    assert_eq!(parameters, [2.0, 1.0, 0.0, 1.0], "names are numbers in the order written");
}

#[test]
fn a_wind_may_have_a_period_that_its_speed_has() {
    for speed in ["3", "3 + sin(2*pi*t/8)", "2 + cos(pi*t/2)^2", "if t/8 - floor(t/8) < 0.5 then 1 else 2"] {
        let text =
            format!("wind 1, 0, 0 speed {speed} turbulence 0.1 scale 1 period 8\ninitial string: F(1)\n");
        let model = crate::common::session(&text).model;
        assert_eq!(model.scenery.wind.expect("a wind").period, Some(8.0), "{speed}");
    }
    let text = "wind 1, 0, 0 speed 1 spectrum kolmogorov 1, 4, 0.5\ninitial string: F(1)\n";
    let wind = crate::common::session(text).model.scenery.wind.expect("a wind");
    assert_eq!(wind.spectrum, Spectrum::Kolmogorov([1.0, 4.0, 0.5]));
}

#[test]
fn names_hide_the_command_of_tissues() {
    let file = "initial string: F(1)\n";
    let drawing = "initial string: @E(7) @E_x(1.5)\ninterpret @E(x): F(x)\ninterpret @E_x(x): F(x)\n";
    let plant = "plant @E from \"stem.dls\"\ninitial string: @E(7) @E\n";
    let tissue = format!("{STALK}interpret @E(x): F(x)\ninitial string: F(stalk) @E(7)\n");
    let here = folder(&[
        ("drawing.dls", drawing),
        ("plant.dls", plant),
        ("tissue.dls", &tissue),
        ("stem.dls", file),
    ]);
    for name in ["drawing.dls", "plant.dls", "tissue.dls"] {
        assert!(open(here.path(), name).warnings.is_empty(), "{name}");
    }
    let other = format!("{STALK}initial string: @E(2) F(stalk)\n");
    let here = folder(&[("bad.dls", &other), ("subscript.dls", "initial string: @E_x(1)")]);
    assert!(refusal(here.path(), "bad.dls").contains("bad.dls:2:20"));
    assert!(refusal(here.path(), "subscript.dls").contains("there is none"));
}

#[test]
fn words_of_wind_and_bending_stay_names_where_a_declaration_cannot_begin() {
    let text = "const wind = 2\nparam flow = 3\nconst units = 1\nconst tissue = 4\nconst speed = 5\nconst at = 1\n\
        def scale(length, axis) = length*axis\ncurve sag = (0, 0) (1, 1)\n\
        initial string: wind(1) flow(units) units(speed) tissue(flow) speed\n  wind(2) flow(tissue) length(at)\n\
        wind(x): if x < 5 solve dx/dt = 1\n if x = 5 produce flow(wind) units(1)\nflow(x) < units(y): solve dy/dt = scale(x, sag(0.5))\n\
        tissue(density): if age = 1 produce wind(4)\nspeed: if age = 1 produce ε\nlength(time): solve dtime/dt = 1\n\
        interpret flow(x): ε\ninterpret tissue(x): ε\n";
    let session = crate::common::session(text);
    assert_eq!(session.model.axiom.kinds().count(), 8);
    let scenery = &session.model.scenery;
    assert!(scenery.wind.is_none() && scenery.flows.is_empty() && scenery.tissues.is_empty());
}
