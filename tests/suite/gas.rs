//! Gases through the whole pipeline: `gas` and `@S` from the text to blobs, pictures and files.

use dlsys::Format;
use dlsys::interchange::{Options, grow};
use dlsys::render::{FrameWriter, Survey, View};
use dlsys::scene::{Blob, Gas, Point, Scene};
use dlsys::session::{Nursery, Session};
use dlsys::sim::Settings;
use dlsys::tree::ModuleString;

use crate::glb_reader::Glb;

/// A gas that changes little in some seconds.
const GAS: &str = "gas smoke = size 0.05, mass 1e-3, extinction 20, diffusion 1e-3\n";

fn session(text: &str) -> Session {
    Session::from_text("gas.dls", text, &[]).unwrap_or_else(|error| panic!("{error}"))
}

/// The scenes of a model at these times, drawn in this order.
fn scenes(session: &Session, times: &[f64], threads: usize) -> Vec<Scene> {
    let nursery = Nursery::new(&session.model, Settings::default()).with_threads(threads);
    let mut strings = Vec::new();
    for time in times {
        let mut string = ModuleString::default();
        session.simulate(Settings::default()).unwrap().at(*time, &mut string).unwrap();
        strings.push(string);
    }
    let draw = |string: &ModuleString| {
        let mut scene = nursery.blank();
        nursery.draw(string, &mut scene).unwrap_or_else(|error| panic!("{}", error.diagnostic().message));
        scene
    };
    strings.iter().map(draw).collect()
}

fn gas(text: &str, time: f64) -> Gas {
    scenes(&session(text), &[time], 1).remove(0).gases.remove(0)
}

/// The message of a time that cannot be drawn.
fn failure(text: &str, time: f64) -> String {
    let session = session(text);
    let nursery = Nursery::new(&session.model, Settings::default());
    let mut string = ModuleString::default();
    session.simulate(Settings::default()).unwrap().at(time, &mut string).unwrap();
    let error = nursery.draw(&string, &mut nursery.blank()).unwrap_err();
    error.diagnostic().render(&session.source, false)
}

/// In a uniform wind, the blobs of a source at a point are where the wind has carried them, evenly spaced, and σ² = σ0² + 2κ·age.
#[test]
fn a_plume_in_uniform_wind_is_the_formula() {
    let text = format!("{GAS}flow uniform 2, 0, 0\ninitial string: @S(smoke, 40)");
    let smoke = gas(&text, 3.0);
    assert!((119..=121).contains(&smoke.blobs.len()), "{}", smoke.blobs.len());
    for (older, blob) in smoke.blobs.iter().zip(&smoke.blobs[1..]) {
        assert!((older.centre.x - blob.centre.x - 2.0 / 40.0).abs() < 1e-12);
    }
    for Blob { centre, deviation, mass, .. } in &smoke.blobs {
        let age = centre.x / 2.0;
        assert!(centre.y == 0.0 && centre.z == 0.0 && (0.0..=3.0).contains(&age));
        assert!((deviation * deviation - (0.05 * 0.05 + 2.0 * 1e-3 * age)).abs() < 1e-12);
        assert_eq!(*mass, 1.0);
    }
}

/// Units: lengths, times and rates are those of the model, the values of the gas in SI.
#[test]
fn units_are_those_of_the_model() {
    let plain = format!("{GAS}flow uniform 2, 0, 0\ninitial string: f(1) @S(smoke, 40, 0.3)");
    let scaled = plain.replace("f(1) @S(smoke, 40, 0.3)", "f(100) @S(smoke, 80, 30)");
    let (a, b) = (gas(&plain, 3.0), gas(&format!("units length 0.01, time 2\n{scaled}"), 1.5));
    assert_eq!(a.blobs.len(), b.blobs.len());
    for (a, b) in a.blobs.iter().zip(&b.blobs) {
        assert!(
            (a.centre - b.centre / 100.0).norm() < 1e-9 && (a.deviation - b.deviation / 100.0).abs() < 1e-12
        );
    }
    assert!((a.area - b.area / 1e4).abs() < 1e-12 * a.area);
}

/// Mass decays as e^-αt, and blobs end when a thousandth is left.
#[test]
fn mass_is_conserved_without_decay_and_decays_with_it() {
    let text =
        format!("{GAS}wind 1, 0, 0 speed 1 turbulence 0.3 scale 1\ninitial string: @S(smoke, 100, 0.1)");
    let mass = |smoke: &Gas| smoke.blobs.iter().map(|blob| blob.mass).sum::<f64>();
    let whole = mass(&gas(&text, 2.0));
    assert!((whole - 200.0).abs() <= 1.0, "{whole}");
    let decays = text.replace("diffusion 1e-3", "diffusion 1e-3, decay 3");
    let left = gas(&decays, 4.0);
    // The integral of rate × e^-3t up to the end of a blob.
    let expected = 100.0 * (1.0 - 1e-3) / 3.0;
    assert!((mass(&left) - expected).abs() < 1.0, "{}", mass(&left));
    assert!(left.blobs.iter().all(|blob| blob.mass >= 0.99e-3));
}

/// A source that growth moves leaves blobs along its way, at the places and times of their births.
#[test]
fn a_source_that_moves_leaves_a_line() {
    let text =
        format!("{GAS}initial string: A(0)\nA(x): solve dx/dt = 3\ninterpret A(x): -(90) f(x) @S(smoke, 50)");
    let smoke = gas(&text, 2.0);
    assert!((99..=101).contains(&smoke.blobs.len()));
    for Blob { centre, deviation, .. } in &smoke.blobs {
        let age = 2.0 - centre.x / 3.0;
        assert!((deviation * deviation - (0.05 * 0.05 + 2e-3 * age)).abs() < 1e-9, "{centre} {deviation}");
    }
}

/// A production hands a source on: the next blob is as due as it was, however often modules are replaced. A source ends at the instant at which its
/// module does.
#[test]
fn productions_do_not_disturb_a_source() {
    let quiet = format!("{GAS}initial string: A\ninterpret A: @S(smoke, 7)");
    let busy = format!(
        "{GAS}initial string: A(0)\nA(x):\n if x < 0.013 solve dx/dt = 1\n if x = 0.013 produce A(0)\ninterpret A(x): @S(smoke, 7)"
    );
    let (quiet, busy) = (gas(&quiet, 5.0).blobs.len(), gas(&busy, 5.0).blobs.len());
    assert!((34..=36).contains(&quiet) && busy.abs_diff(quiet) <= 1, "{quiet} {busy}");
    let ends = format!(
        "{GAS}initial string: A\nA:\n if age = 1.01 produce B\ninterpret A: @S(smoke, 10000)\ninterpret B: f(1)"
    );
    let count = gas(&ends, 2.0).blobs.len();
    assert!((10_099..=10_101).contains(&count), "{count}");
}

const TURBULENT: &str = "wind 1, 0, 0 speed 1 turbulence 0.4 scale 0.5\nground 0\nsolid Ball\ninitial string: f(1) [ @S(smoke, 80, 0.2) ] Ball(-1)\n\
    Ball(x): solve dx/dt = 1.5\ninterpret Ball(x): [ -(90) f(x) @O(0.6) ]";

/// The same bits for any order of times, and any number of threads.
#[test]
fn times_in_any_order_and_threads_give_the_same_bits() {
    let session = session(&format!("{GAS}{TURBULENT}"));
    let ascending = [0.0, 0.31, 0.7, 1.0, 1.01, 2.345];
    let blobs = |scene: &Scene| scene.gases[0].blobs.clone();
    let expected: Vec<Vec<Blob>> = scenes(&session, &ascending, 1).iter().map(blobs).collect();
    assert!(expected[5].len() > 180);
    let mut backwards = ascending;
    backwards.reverse();
    let mut found: Vec<Vec<Blob>> = scenes(&session, &backwards, 3).iter().map(blobs).collect();
    found.reverse();
    assert!(found == expected);
    let jumping = [2.345, 0.31, 1.01];
    let found: Vec<Vec<Blob>> = scenes(&session, &jumping, 2).iter().map(blobs).collect();
    assert!(found == [5, 1, 4].map(|i| expected[i].clone()));
}

/// No centre is in a body at any time, however fast it is and however blobs sink; none is below the ground.
#[test]
fn bodies_and_the_ground_keep_blobs_out() {
    for (speed, fall, start) in [(1.5, 0.0, -1.0), (1.5, 0.8, -1.0), (0.0, 1.5, 0.4), (60.0, 0.2, -1.0)] {
        let text =
            format!("{}{TURBULENT}", GAS.replace("extinction 20", &format!("extinction 20, fall {fall}")))
                .replace("dx/dt = 1.5", &format!("dx/dt = {speed}"))
                .replace("Ball(-1)", &format!("Ball({start})"));
        let session = session(&text);
        let times: Vec<f64> = (0..40).map(|k| 0.013 + 0.047 * f64::from(k)).collect();
        let mut near = 0;
        for (time, scene) in times.iter().zip(scenes(&session, &times, 1)) {
            let centre = Point::new(start + speed * time, 1.0, 0.0);
            for blob in &scene.gases[0].blobs {
                let distance = (blob.centre - centre).norm();
                assert!(distance > 0.3 - 1e-6, "{speed} {fall} {time}: {distance}");
                assert!(blob.centre.y >= 0.0);
                near += usize::from(distance < 0.6);
            }
        }
        assert!(near > 10 || speed > 10.0, "{speed} {fall}: {near}");
    }
}

/// The pixels of a file.
fn pixels(bytes: &[u8]) -> (usize, Vec<u8>) {
    let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().expect("a PNG");
    let mut data = vec![0; reader.output_buffer_size().expect("small")];
    let info = reader.next_frame(&mut data).expect("an image");
    (info.width as usize, data)
}

fn drawn(session: &Session, time: f64, format: Format, view: View) -> Vec<u8> {
    let scene = scenes(session, &[time], 1).remove(0);
    let mut survey = Survey::new(view);
    survey.add(&scene);
    FrameWriter::new(format, survey.fit()).write(&scene, "gas")
}

/// Of a black gas in front of nothing, the opacity in each pixel is 1 - e^-τ, with τ by quadrature of the densities of all blobs.
#[test]
fn the_opacity_of_a_picture_is_that_of_quadrature() {
    let text = "gas soot = size 0.2, mass 1e-3, extinction 80, diffusion 1e-3, albedo 0\n\
        flow uniform 0, 1, 0\ninitial string: [ f(3) ] @S(soot, 20, 0.5)";
    let session = session(text);
    let scene = scenes(&session, &[2.0], 1).remove(0);
    let mut survey = Survey::new(View::FRONT);
    survey.add(&scene);
    let mut writer = FrameWriter::new(Format::PNG, survey.fit());
    writer.page.background = None;
    let (width, data) = pixels(&writer.write(&scene, "gas"));
    let [left, bottom, wide, high] = writer.page.picture.area;
    let [w, h] = writer.page.pixels.map(f64::from);
    let scale = (w / wide).min(h / high);
    let smoke = &scene.gases[0];
    let mut darkest = 0;
    for (number, pixel) in data.chunks_exact(4).enumerate().step_by(97) {
        let (x, y) = ((number % width) as f64 + 0.5, (number / width) as f64 + 0.5);
        let (x, y) = (left + wide / 2.0 + (x - w / 2.0) / scale, bottom + high / 2.0 - (y - h / 2.0) / scale);
        let density = |z: f64| {
            let place = Point::new(x, y, z);
            let one = |blob: &Blob| {
                let variance = blob.deviation * blob.deviation;
                let shape = (-(place - blob.centre).norm_squared() / (2.0 * variance)).exp();
                smoke.area * blob.mass * shape / (std::f64::consts::TAU * variance).powf(1.5)
            };
            smoke.blobs.iter().map(one).sum::<f64>()
        };
        let depth: f64 = (0..400).map(|k| density(-3.0 + (f64::from(k) + 0.5) * 0.015) * 0.015).sum();
        let expected = 255.0 * (1.0 - (-depth).exp());
        assert!((f64::from(pixel[3]) - expected).abs() < 1.0, "{x} {y}: {} {expected}", pixel[3]);
        assert!(pixel[3] == 0 || pixel[..3] == [0; 3]);
        darkest = darkest.max(pixel[3]);
    }
    assert!(darkest > 150, "{darkest}");
}

/// A leaf in front hides the gas, one behind is dimmed by it.
#[test]
fn gas_is_drawn_in_its_depth() {
    let scene = |z: f64| {
        format!(
            "gas fog = size 2, mass 1, extinction 100, color \"#ffffff\"\ncolor red = \"#c00000\"\n\
             initial string: @S(fog, 1000, 0.01) [ &(90) f({z}) ^(90) ;(red) {{ . f(1) . -(90) f(1) . -(90) f(1) . }} ]"
        )
    };
    let red = |z: f64| {
        let (_, data) = pixels(&drawn(&session(&scene(z)), 0.001, Format::PNG, View::FRONT));
        let reddest = |pixel: &[u8]| i32::from(pixel[0]) - i32::from(pixel[1]);
        data.chunks_exact(3).map(reddest).max().unwrap_or_default()
    };
    // The turtle pitches down, away from its up, which is towards the viewer.
    let (one, other) = (red(6.0), red(-6.0));
    let (front, behind) = (one.max(other), one.min(other));
    assert!(front > 150 && behind < 100, "{front} {behind}");
}

/// OBJ files hold the middles of blobs as points.
#[test]
fn meshes_hold_the_middles_of_blobs() {
    let session = session(&format!("{GAS}initial string: F(1) @S(smoke, 100, 0.1)"));
    let obj = String::from_utf8(drawn(&session, 1.0, Format::OBJ, View::FRONT)).expect("text");
    let vertices: Vec<&str> = obj.lines().filter(|line| line.starts_with("v ")).collect();
    let points: Vec<usize> = obj
        .lines()
        .filter_map(|line| line.strip_prefix("p "))
        .flat_map(|line| line.split(' ').map(|number| number.parse::<usize>().expect("a number")))
        .collect();
    let scene = scenes(&session, &[1.0], 1).remove(0);
    assert!(obj.contains("g gas.smoke\n"));
    assert_eq!(points.len(), scene.gases[0].blobs.len());
    for (number, blob) in points.iter().zip(&scene.gases[0].blobs) {
        let written: Vec<f64> =
            vertices[number - 1].split(' ').skip(1).map(|x| x.parse().expect("a number")).collect();
        assert!((Point::from_slice(&written) - blob.centre).norm() < 1e-4);
    }
}

/// USDA files hold gases as points with widths, at the frames.
#[test]
fn usd_files_hold_blobs_as_points() {
    let session = session(&format!("{GAS}initial string: F(1) @S(smoke, 100, 0.1)"));
    let mut options = Options::new(&session.model, 0.01, 1.0);
    options.gases = true;
    let times = [0.0, 0.5, 1.0];
    let growth = grow(&session, Settings::default(), &times, &options, &mut |_| true).expect("a run");
    let file = growth.file(dlsys::interchange::Format::Usda).expect("a file");
    let text = String::from_utf8(file).expect("text");
    let (_, points) = text.split_once("def Points \"gas_smoke\"").expect("a prim of points");
    let (_, widths) = points.split_once("float[] widths.timeSamples = {").expect("widths");
    let widths: Vec<&str> = widths.lines().next().expect("a line").split('[').skip(1).collect();
    let counts: Vec<usize> = widths.iter().map(|list| list.matches('.').count()).collect();
    let expected =
        scenes(&session, &times, 1).iter().map(|scene| scene.gases[0].blobs.len()).collect::<Vec<_>>();
    assert_eq!(counts, expected);
}

/// GLB files hold gases as points, too: at each frame all blobs of it, and nothing of another.
#[test]
fn glb_files_hold_blobs_as_points() {
    let session = session(&format!("{GAS}initial string: F(1) @S(smoke, 100, 0.1)"));
    let mut options = Options::new(&session.model, 0.01, 1.0);
    options.gases = true;
    let times = [0.0, 0.5, 1.0, 1.5];
    let growth = grow(&session, Settings::default(), &times, &options, &mut |_| true).expect("a run");
    let glb = Glb::read(&growth.file(dlsys::interchange::Format::Glb).expect("a file"));
    assert_eq!(glb.duration(), 1.5);
    for (time, scene) in times.iter().zip(scenes(&session, &times, 1)) {
        // What is seen at a frame is seen until the next.
        for later in [0.0, 0.3] {
            let shown = glb.shown(time + later);
            let points = shown.get("gas.smoke").map_or(&[][..], |shown| &shown.vertices);
            let blobs = &scene.gases[0].blobs;
            assert_eq!(points.len(), blobs.len(), "{time}");
            assert!(points.iter().zip(blobs).all(|(point, blob)| (point - blob.centre).norm() < 1e-5));
        }
    }
}

#[test]
fn too_many_blobs_are_an_error_with_a_place() {
    let text = format!("{GAS}initial string: F(1) @S(smoke, 1e9)");
    let message = failure(&text, 1.0);
    assert!(message.contains("more than 2000000 blobs at t = 0"), "{message}");
    assert!(message.contains("gas.dls:2:22") && message.contains("greater `mass`"), "{message}");
    let long = format!("{GAS}units time 86400\ninitial string: F(1) @S(smoke, 1)");
    let message = failure(&long, 10.0);
    assert!(message.contains("more than 1e7 steps") && message.contains("units time"), "{message}");
}

/// What the ground of a scene does not do is said when the model is read.
#[test]
fn gas_over_soil_and_shelves_without_soil_are_reported() {
    let said = |text: &str| session(text).warnings.iter().map(|w| w.message.clone()).collect::<Vec<_>>();
    let source = "initial string: @S(smoke, 10, 0.1)\n";
    let soil = "soil p = sand\nground p cell 0.1\n";
    assert_eq!(said(&format!("{GAS}{soil}{source}")), ["gas goes through ground of soil"]);
    assert!(said(&format!("{GAS}ground 0\n{source}")).is_empty());
    let rising = GAS.replacen("size", "fall -0.1, size", 1);
    assert!(said(&format!("{rising}{soil}{source}")).is_empty());
    let leaf = "shelf A\ninitial string: A\ninterpret A: @L(1)\n";
    assert_eq!(said(&format!("ground 0\n{leaf}")), ["`shelf` does nothing here"]);
    assert!(said(&format!("{soil}{leaf}")).is_empty());
}
