//! Pages that play a recording: their content, decoded independently, against the model run again.

use std::fs;
use std::io::Read;

use dlsys::player::{Form, Stage};
use dlsys::render::{Survey, View};
use dlsys::session::{Nursery, Session};
use dlsys::sim::Settings;
use dlsys::tree::ModuleString;
use serde_json::Value;

use crate::cli::{bad, dlsys, good};
use crate::common::repository;

/// The page of a model, as the program writes it.
fn page(model: &str, flags: &[&str]) -> String {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("plant.html");
    let path = file.to_str().expect("UTF-8");
    let said = good(&[&["view", model, "-o", path], flags].concat());
    assert!(said.contains("frame") && said.lines().count() == 1, "{said}");
    fs::read_to_string(file).expect("written")
}

/// What stands in the script element of this name.
fn script<'p>(page: &'p str, id: &str) -> &'p str {
    let start = page.split_once(&format!("<script id=\"{id}\"")).expect("an element").1;
    start.split_once('>').expect("a tag").1.split_once("</script>").expect("an end").0
}

fn description(page: &str) -> Value {
    serde_json::from_str(script(page, "description")).expect("JSON")
}

/// A thing as the page has it: see `crates/player/src/encode.rs`, which says how it is written.
#[derive(Debug)]
struct Track {
    kind: u64,
    first: u64,
    last: u64,
    stride: u64,
    /// By sample, in steps about the middle.
    samples: Vec<Vec<f64>>,
}

impl Track {
    fn at(&self, frame: u64) -> Vec<f64> {
        let i = (frame - self.first) / self.stride;
        let sample = |i: u64| &self.samples[(i as usize).min(self.samples.len() - 1)];
        let (start, end) =
            (self.first + i * self.stride, (self.first + (i + 1) * self.stride).min(self.last));
        let part = if end > start { (frame - start) as f64 / (end - start) as f64 } else { 0.0 };
        sample(i).iter().zip(sample(i + 1)).map(|(a, b)| a + (b - a) * part).collect()
    }
}

/// Bytes in base64, compressed.
fn unpacked(text: &str) -> Numbers {
    let digit = |c: u8| match c {
        b'A'..=b'Z' => c - b'A',
        b'a'..=b'z' => c - b'a' + 26,
        b'0'..=b'9' => c - b'0' + 52,
        b'+' => 62,
        b'/' => 63,
        _ => panic!("not base64: {c}"),
    };
    let mut packed = Vec::new();
    for chunk in text.trim().trim_end_matches('=').as_bytes().chunks(4) {
        let bits = chunk.iter().fold(0_u32, |bits, &c| bits << 6 | u32::from(digit(c)));
        let bits = bits << (6 * (4 - chunk.len()));
        packed.extend_from_slice(&bits.to_be_bytes()[1..chunk.len()]);
    }
    let mut bytes = Vec::new();
    flate2::read::ZlibDecoder::new(&packed[..]).read_to_end(&mut bytes).expect("zlib");
    Numbers { bytes, at: 0 }
}

/// Whole numbers as pages have them.
struct Numbers {
    bytes: Vec<u8>,
    at: usize,
}

impl Numbers {
    fn natural(&mut self) -> u64 {
        let (mut number, mut shift) = (0_u64, 0);
        loop {
            let byte = self.bytes[self.at];
            self.at += 1;
            number |= u64::from(byte & 127) << shift;
            shift += 7;
            if byte < 128 {
                return number;
            }
        }
    }

    fn integer(&mut self) -> i64 {
        let n = self.natural();
        (n >> 1) as i64 ^ -((n & 1) as i64)
    }

    fn end(&self) {
        assert_eq!(self.at, self.bytes.len(), "nothing is left over");
    }
}

fn tracks(page: &str) -> Vec<Track> {
    let mut numbers = unpacked(script(page, "tracks"));
    let heads: Vec<([u64; 6], usize)> = (0..numbers.natural())
        .map(|_| {
            let [kind, detail] = [(); 2].map(|()| numbers.natural());
            let corners = if kind == 5 { numbers.natural() } else { detail };
            let [first, span, log2, length] = [(); 4].map(|()| numbers.natural());
            // Looks: not looked at here.
            (0..3 * numbers.natural()).for_each(|_| {
                numbers.natural();
            });
            let width = [18, 9, 48, 3 * corners as usize, 12, 3 * corners as usize][kind as usize];
            ([kind, detail, first, span, log2, length], width)
        })
        .collect();
    let mut tracks = Vec::new();
    for ([kind, _, first, span, log2, length], width) in heads {
        let mut samples = vec![vec![0.0; width]; length as usize];
        let mut firsts = vec![0_i64; width];
        for number in 0..width {
            let is_near = [2, 3, 5].contains(&kind) && number >= 3;
            let mut now = numbers.integer() + if is_near { firsts[number - 3] } else { 0 };
            let mut rate = 0;
            firsts[number] = now;
            samples[0][number] = now as f64;
            for sample in &mut samples[1..] {
                rate += numbers.integer();
                now += rate;
                sample[number] = now as f64;
            }
        }
        tracks.push(Track { kind, first, last: first + span, stride: 1 << log2, samples });
    }
    numbers.end();
    tracks
}

/// The blobs of gases in each frame, as the page has them: see `crates/player/src/clouds.rs`.
fn clouds(said: &Value) -> Vec<Vec<[i64; 8]>> {
    let mut numbers = unpacked(said["clouds"].as_str().expect("gases"));
    let frames = said["times"].as_array().expect("a list").len();
    let mut all: Vec<Vec<[i64; 8]>> = Vec::new();
    for _ in 0..frames {
        let runs: Vec<u64> = (0..numbers.natural()).map(|_| numbers.natural()).collect();
        let fresh = numbers.natural();
        let before = all.last().cloned().unwrap_or_default();
        let kept = runs.iter().enumerate().flat_map(|(i, run)| (0..*run).map(move |_| i % 2 == 0));
        let mut now: Vec<[i64; 8]> =
            before.iter().zip(kept).filter(|(_, kept)| *kept).map(|(blob, _)| *blob).collect();
        let first = now.len();
        now.extend((0..fresh).map(|_| [0; 8]));
        for k in 0..8 {
            for i in 0..now.len() {
                let from = if i < first {
                    now[i][k]
                } else if i > first {
                    now[i - 1][k]
                } else {
                    0
                };
                now[i][k] = from + numbers.integer();
            }
        }
        all.push(now);
    }
    numbers.end();
    all
}

#[test]
fn a_page_has_everything_and_asks_nobody() {
    let page = page("models/leaf.dls", &[]);
    assert!(page.starts_with("<!doctype html>\n") && page.trim_end().ends_with("</html>"));
    // No address, and nothing that would load one.
    for foreign in
        ["http:", "https:", "//cdn", " src=", "@import", "url(", "import(", "fetch(", "XMLHttp", "{{"]
    {
        assert!(!page.contains(foreign), "{foreign}");
    }
    assert!(page.contains("default-src 'none'"), "and the browser would not let it");
    for link in page.split("href=").skip(1) {
        assert!(link.starts_with("\"data:,\""), "{}", &link[..40]);
    }
    for tag in
        ["html", "head", "body", "title", "style", "script", "header", "aside", "footer", "section", "div"]
    {
        let opened = page.matches(&format!("<{tag}>")).count() + page.matches(&format!("<{tag} ")).count();
        assert_eq!(opened, page.matches(&format!("</{tag}>")).count(), "{tag}");
    }
    let mut names: Vec<&str> =
        page.split(" id=\"").skip(1).map(|rest| rest.split_once('"').expect("closed").0).collect();
    let count = names.len();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), count, "each name once");
    let said = description(&page);
    assert_eq!(said["title"], "Pinnate leaf");
    assert_eq!(said["source"], "leaf.dls", "the file's name without its folder");
    assert_eq!(said["times"].as_array().expect("a list").len(), 181);
    assert_eq!(said["modules"][180], 22);
    assert_eq!(said["productions"], 5);
    assert_eq!(said["parameters"][0]["name"], "n_0");
    assert_eq!(said["parameters"][0]["range"], serde_json::json!([0.0, 12.0]));
}

#[test]
fn pages_are_small_and_the_same_each_time() {
    // Bytes of a page without a plant, and in all.
    for (model, most) in [("models/leaf.dls", 90_000), ("models/anabaena.dls", 160_000)] {
        let once = page(model, &[]);
        assert!(once.len() < most, "{model}: {}", once.len());
        assert_eq!(once, page(model, &[]), "{model}");
    }
}

/// The things of a page at a frame are those that the turtle draws then, where it draws them, to a tenth of a pixel of a
/// picture of a thousand.
fn is_what_the_turtle_draws(path: &str) {
    let page = page(path, &[]);
    let (said, tracks) = (description(&page), tracks(&page));
    let unit = said["unit"].as_f64().expect("a number");
    let session = Session::open(&repository(path), &[]).expect("a good model");
    let times: Vec<f64> =
        said["times"].as_array().expect("a list").iter().map(|t| t.as_f64().expect("a number")).collect();
    let mut string = ModuleString::default();
    let nursery = Nursery::new(&session.model, Settings::default()).with_ground_in_pieces();
    let quilt = nursery.quilt(times[times.len() - 1]).expect("drawable");
    let (mut scene, mut ground) = (nursery.blank(), nursery.blank());
    let mut survey = Survey::new(View::FRONT);
    let mut simulation = session.simulate(Settings::default()).expect("it starts");
    for &time in &times {
        simulation.at(time, &mut string).expect("it runs");
        scene.clear();
        nursery.draw(&string, &mut scene).expect("drawable");
        survey.add(&scene);
    }
    let fit = survey.fit();
    scene.accuracy = fit.accuracy;
    let bounds = fit.bounds.expect("something to see");
    let centre = nalgebra::center(&bounds[0], &bounds[1]);
    let mut simulation = session.simulate(Settings::default()).expect("it starts");
    let mut stage = Stage::default();
    for frame in (0..times.len()).step_by((times.len() / 6).max(1)) {
        simulation.at(times[frame], &mut string).expect("it runs");
        scene.clear();
        nursery.draw(&string, &mut scene).expect("drawable");
        stage.set(&scene, &fit);
        if let Some(quilt) = &quilt {
            ground.clear();
            nursery.draw_quilt(times[frame], quilt, &mut ground).expect("drawable");
            stage.add_ground(&ground);
        }
        let now = frame as u64;
        let mut there: Vec<&Track> = tracks.iter().filter(|t| (t.first..=t.last).contains(&now)).collect();
        assert_eq!(there.len(), stage.items.len(), "{path}: things in frame {frame}");
        for item in &stage.items {
            let kind = match item.key.form {
                Form::Stem(_) => 0,
                Form::Mesh(_) => 1,
                Form::Patch => 2,
                Form::Polygon(_) => 3,
                Form::Stretched(_) => 4,
                Form::Net(..) => 5,
            };
            let numbers: Vec<f64> = stage.numbers_of(item).to_vec();
            let is_point = |i: usize| [2, 3, 5].contains(&kind) || (if kind == 4 { i } else { i % 9 }) < 3;
            let off = |track: &Track| -> f64 {
                let shown = track.at(now).into_iter().enumerate();
                let placed = shown.map(|(i, x)| x * unit + if is_point(i) { centre[i % 3] } else { 0.0 });
                placed.zip(&numbers).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
            };
            let alike = |track: &Track| track.kind == kind && track.samples[0].len() == numbers.len();
            let nearest = (0..there.len())
                .filter(|&i| alike(there[i]))
                .min_by(|&a, &b| off(there[a]).total_cmp(&off(there[b])));
            let nearest = nearest.unwrap_or_else(|| panic!("{path}: frame {frame} has no {:?}", item.key));
            let off = off(there.remove(nearest));
            assert!(
                off <= 28.0 * unit,
                "{path}: {:?} in frame {frame} is {} steps off",
                item.key,
                off / unit
            );
        }
    }
}

#[test]
fn a_page_shows_what_the_turtle_draws() {
    is_what_the_turtle_draws("models/leaf.dls");
    is_what_the_turtle_draws("models/petal.dls");
    is_what_the_turtle_draws("models/abop/koch-island.dls");
}

/// Sheets and ground keep their meshes, whose points move; blobs are where they are, and those that are kept are the same ones.
#[test]
fn a_page_has_sheets_ground_and_gases() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("cloth.obj"), crate::sheets::cloth()).expect("written");
    let path = folder.path().join("scene.dls");
    let text = "tissue silk = stiffness 1e6, density 1000, damping 0.1, thickness 0.001\n\
        sheet @Cloth from \"cloth.obj\" of silk pinned x < 0.01 | x > 0.99\n\
        gas smoke = size 0.05, mass 1e-3, extinction 10, diffusion 1e-3, decay 3, fall -0.1\n\
        soil beach = sand\nground beach cell 0.05 depth 0.5 height -1 extent 1\nsolid Ball\nframes 0 .. 0.4 step 0.1\n\
        initial string: [ @Cloth ] @S(smoke, 40, 0.1) Ball(-0.7)\nBall(y): solve dy/dt = -0.8\n\
        interpret Ball(y): [ f(y) @O(0.4) ]\n";
    fs::write(&path, text).expect("written");
    let path = path.to_str().expect("UTF-8");
    is_what_the_turtle_draws(path);
    let page = page(path, &[]);
    let (said, tracks) = (description(&page), tracks(&page));
    let nets = tracks.iter().filter(|track| track.kind == 5).count();
    assert!(
        nets >= 3 && tracks.iter().filter(|t| t.kind == 5).all(|t| [t.first, t.last] == [0, 4]),
        "{nets}"
    );
    // Blobs, in any order, against the scene.
    let session = Session::open(path.as_ref(), &[]).expect("a good model");
    let nursery = Nursery::new(&session.model, Settings::default());
    let (step, extent) =
        (said["puffUnit"].as_f64().expect("a number"), said["extent"].as_f64().expect("a number"));
    let clouds = clouds(&said);
    assert!(step < 1e-3 * extent && clouds[4].len() > 10);
    let mut simulation = session.simulate(Settings::default()).expect("it starts");
    let mut string = ModuleString::default();
    let mut survey = Survey::new(View::FRONT);
    let mut scenes = Vec::new();
    for time in [0.0, 0.1, 0.2, 0.3, 0.4] {
        simulation.at(time, &mut string).expect("it runs");
        let mut scene = nursery.blank();
        nursery.draw(&string, &mut scene).expect("drawable");
        survey.add(&scene);
        scenes.push(scene);
    }
    let [low, high] = survey.fit().bounds.expect("something to see");
    let centre = nalgebra::center(&low, &high);
    for (frame, scene) in clouds.iter().zip(&scenes) {
        let gas = &scene.gases[0];
        assert_eq!(frame.len(), gas.blobs.len());
        for blob in &gas.blobs {
            let place = (blob.centre - centre) / step;
            let depth = 256.0 + 16.0 * gas.depth(blob).log2();
            let expected = [place.x, place.y, place.z, blob.deviation / step, depth];
            let off = |code: &[i64; 8]| {
                code.iter().zip(expected).map(|(a, b)| (*a as f64 - b).abs()).fold(0.0, f64::max)
            };
            let nearest = frame.iter().map(off).fold(f64::INFINITY, f64::min);
            assert!(nearest <= 0.501, "{expected:?}: {nearest}");
        }
    }
}

#[test]
fn a_title_cannot_end_the_page() {
    let folder = tempfile::tempdir().expect("a folder");
    let model = folder.path().join("</script>.dls".replace('/', "\u{2215}"));
    let text = "title \"</script><b>{{tracks}}&\"\ninitial string: F(1)\nF(x): solve dx/dt = 1\nframes 0 .. 1 step 1\n";
    fs::write(&model, text).expect("written");
    let page = page(model.to_str().expect("UTF-8"), &[]);
    assert_eq!(description(&page)["title"], "</script><b>{{tracks}}&");
    assert!(page.contains("<title>&lt;/script&gt;&lt;b&gt;{{tracks}}&amp;</title>"));
    assert_eq!(page.matches("</script>").count(), 3);
}

#[test]
fn files_of_others_are_not_written_over() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("index.html");
    fs::write(&file, "<!doctype html>\nmy home").expect("written");
    let path = file.to_str().expect("UTF-8");
    let line = ["view", "models/leaf.dls", "-o", path];
    let (status, message) = bad(&line);
    assert!(status == 2 && message.contains("--force") && message.contains("index.html"), "{message}");
    assert_eq!(fs::read_to_string(&file).expect("there"), "<!doctype html>\nmy home");
    good(&[&line[..], &["--force"]].concat());
    // A page of ours is replaced.
    good(&line);
    let (status, message) = bad(&["view", "models/leaf.dls", "-o", folder.path().to_str().expect("UTF-8")]);
    assert!(status == 2 && message.contains("plant.html"), "{message}");
    let (status, message) =
        bad(&["view", "models/leaf.dls", "-o", path, "--from", "0", "--to", "9", "--step", "1e-4"]);
    assert!(status == 2 && message.contains("too many for a page"), "{message}");
    assert_eq!(dlsys(&["view", "no-such-model.dls", "-o", path]).status.code(), Some(1));
}

#[test]
fn plants_that_are_too_much_for_a_page_are_refused_before_they_are_recorded() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = |name: &str| folder.path().join(name).to_str().expect("UTF-8").to_owned();
    let tuft = "initial string: for i in 1 .. 40: ( [ /(9*i) &(40) A(0) ] )\nA(x): solve dx/dt = 1\ninterpret A(x): F(1 + x)";
    fs::write(file("tuft.dls"), tuft).expect("written");
    let field = "plant @Tuft from \"tuft.dls\"\ninitial string: for i in 1 .. 2500: ( @Tuft(0) f(1) )";
    fs::write(file("field.dls"), field).expect("written");
    let line = |step: &str| {
        let (model, page) = (file("field.dls"), file("field.html"));
        bad(&["view", &model, "-o", &page, "--from", "0", "--to", "1", "--step", step])
    };
    // 2500 tufts of 40 stems with 18 numbers each.
    let (status, message) = line("0.005");
    assert!(status == 1 && message.contains("201 frames are placed by about 362 million"), "{message}");
    assert!(message.contains("holds 75 million") && message.contains("--step"), "{message}");
    assert!(!folder.path().join("field.html").exists());
}

#[test]
fn without_the_window_one_is_told_how_to_get_it() {
    if cfg!(feature = "viewer") {
        return;
    }
    let (status, message) = bad(&["view", "models/leaf.dls"]);
    assert_eq!(status, 2);
    for part in ["without the window", "dlsys view models/leaf.dls -o plant.html", "--features viewer"] {
        assert!(message.contains(part), "{message}");
    }
    let (status, message) = bad(&["view", "models/leaf.dls", "--force"]);
    assert!(status == 2 && message.contains("--out"), "{message}");
}
