//! Pictures on surfaces in every format: where their parts are seen, what is cut out, and which files stand beside which.

use std::fs;
use std::path::PathBuf;

use dlsys::render::{Fit, Format, FrameWriter, Page, Size, Smoothness, Survey, View, pixels_by};
use dlsys::scene::{MaterialId, Point, Scene, Vector};
use dlsys::session::Session;
use dlsys::sim::Settings;
use dlsys::surround::Terrain;
use dlsys::tree::ModuleString;
use dlsys::turtle;
use serde_json::Value;

use crate::cli::{bad, good};
use crate::glb_reader::Glb;

/// A square of two units around the origin, seen from the front as it is written.
const SQUARE: &str =
    "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n";
/// The same as a patch.
const PATCH: &str = "-1 1  -1 1  0 0\nCONTACT POINT X: 0 Y: 0 Z: 0\nEND POINT X: 0 Y: 1 Z: 0\nHEADING X: 0 Y: 1 Z: 0\n\
    UP X: 0 Y: 0 Z: 1\nSIZE: 1\npatch\nTOP COLOR: 0 DIFFUSE: 0 BOTTOM COLOR: 0 DIFFUSE: 0\nAL: ~ A: ~ AR: ~\n\
    L: ~ R: ~\nBL: ~ B: ~ BR: ~\n-1 -1 0 -0.33 -1 0 0.33 -1 0 1 -1 0\n-1 -0.33 0 -0.33 -0.33 0 0.33 -0.33 0 1 -0.33 0\n\
    -1 0.33 0 -0.33 0.33 0 0.33 0.33 0 1 0.33 0\n-1 1 0 -0.33 1 0 0.33 1 0 1 1 0\n";

const RED: [u8; 3] = [200, 30, 30];
const GREEN: [u8; 3] = [40, 160, 60];
const BLUE: [u8; 3] = [30, 60, 200];

/// A folder with a model, both surfaces, and a picture: its lower left quarter is red, the lower right one green, the upper left one blue, and
/// the upper right one is transparent.
struct Home(tempfile::TempDir);

impl Home {
    fn new(model: &str) -> Home {
        let home = Home(tempfile::tempdir().expect("a folder"));
        home.put("model.dls", model.as_bytes());
        home.put("square.obj", SQUARE.as_bytes());
        home.put("patch.s", PATCH.as_bytes());
        let quarter = |x: usize, y: usize| match (x < 32, y < 32) {
            (true, true) => [BLUE[0], BLUE[1], BLUE[2], 255],
            (false, true) => [255, 255, 255, 0],
            (true, false) => [RED[0], RED[1], RED[2], 255],
            (false, false) => [GREEN[0], GREEN[1], GREEN[2], 255],
        };
        let data: Vec<u8> = (0..64).flat_map(|y| (0..64).flat_map(move |x| quarter(x, y))).collect();
        home.put("pictures/four.png", &png(64, 64, &data));
        home
    }

    fn put(&self, name: &str, bytes: &[u8]) {
        let path = self.path(name);
        fs::create_dir_all(path.parent().expect("a parent")).expect("a folder");
        fs::write(path, bytes).expect("written");
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn text(&self, name: &str) -> String {
        self.path(name).to_str().expect("UTF-8").to_owned()
    }

    fn session(&self) -> Session {
        Session::open(&self.path("model.dls"), &[]).unwrap_or_else(|refused| {
            panic!(
                "{}",
                refused.diagnostics.iter().map(|d| d.render(&refused.source, false)).collect::<String>()
            )
        })
    }

    fn scene(&self) -> Scene {
        let session = self.session();
        let mut simulation = session.simulate(Default::default()).expect("it starts");
        let mut string = ModuleString::default();
        simulation.at(0.0, &mut string).expect("it runs");
        let mut scene = Scene::default();
        turtle::draw(&session.model, &string, &mut scene).expect("drawable");
        scene
    }
}

fn png(width: u32, height: u32, data: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Rgba);
    let mut writer = encoder.write_header().expect("a header");
    writer.write_image_data(data).expect("the data");
    writer.finish().expect("memory");
    bytes
}

fn model(surface: &str, string: &str) -> String {
    format!("surface @Q from \"{surface}\" texture \"pictures/four.png\"\ninitial string: {string}")
}

fn fit(scene: &Scene) -> Fit {
    let mut survey = Survey::new(View::FRONT);
    survey.add(scene);
    survey.fit()
}

fn writer(scene: &Scene, format: Format) -> FrameWriter {
    FrameWriter::new(format, fit(scene))
}

/// The pixel in which a point is seen: red, green and blue, each times the opacity, and the opacity. The page shows eight units in so many pixels.
fn seen_at(scene: &Scene, place: [f64; 2], pixels: u32) -> [u8; 4] {
    let mut fit = fit(scene);
    fit.picture.area = [-4.0, -4.0, 8.0, 8.0];
    let page = Page::new(fit.picture, Size::Exact(pixels, pixels), None).expect("small");
    let all = pixels_by(scene, &fit, &page, Smoothness::Fine, 1);
    assert_eq!(all, pixels_by(scene, &fit, &page, Smoothness::Fine, 3));
    let scale = f64::from(pixels) / 8.0;
    let (x, y) = ((place[0] + 4.0) * scale, (4.0 - place[1]) * scale);
    all[y as usize * pixels as usize + x as usize]
}

fn is_near(seen: [u8; 4], color: [u8; 3]) -> bool {
    seen[3] == 255 && (0..3).all(|k| seen[k].abs_diff(color[k]) <= 2)
}

/// On a mesh and on a patch; a colour that the model chooses changes nothing.
#[test]
fn each_part_of_a_picture_is_where_its_coordinates_say() {
    for (surface, string) in [("square.obj", "@Q(1)"), ("patch.s", "@Q(1)"), ("square.obj", ";(7) @Q(1)")] {
        let scene = Home::new(&model(surface, string)).scene();
        assert!(is_near(seen_at(&scene, [-0.5, -0.5], 400), RED), "{surface}");
        assert!(is_near(seen_at(&scene, [0.5, -0.5], 400), GREEN), "{surface}");
        assert!(is_near(seen_at(&scene, [-0.5, 0.5], 400), BLUE), "{surface}");
        assert_eq!(seen_at(&scene, [0.5, 0.5], 400), [0; 4], "{surface}: cut out");
        assert_eq!(seen_at(&scene, [1.5, -0.5], 400), [0; 4], "{surface}: beside it");
    }
}

/// The edge of what is cut out is as smooth as that of a triangle, and what is small is the mean of what is drawn.
#[test]
fn edges_are_smooth_and_small_pictures_are_means() {
    let scene = Home::new(&model("square.obj", "@Q(1)")).scene();
    // The edge runs through the middle of this pixel.
    let edge = seen_at(&scene, [0.0, 0.5], 401)[3];
    assert!((96..=160).contains(&edge), "{edge}");
    // A square of half a pixel: a sixteenth of it is drawn, at three quarters of its samples.
    let tiny = seen_at(&scene, [0.0, 0.0], 1);
    let mean = |k: usize| f64::from(RED[k]) + f64::from(GREEN[k]) + f64::from(BLUE[k]);
    let opacity = f64::from(tiny[3]) / 255.0;
    assert!((0.03..=0.13).contains(&opacity), "{tiny:?}");
    for k in 0..3 {
        let color = f64::from(tiny[k]) / opacity;
        assert!((color - mean(k) / 3.0).abs() < 25.0, "{k}: {tiny:?}");
    }
}

/// A square hangs over the floor; under its cut-out quarter the floor is in the sun, and in the light of a part of the sky.
#[test]
fn shadows_have_the_outline_of_what_is_drawn() {
    let mut scene = Home::new(&model("square.obj", "f(3) &(90) @Q(1)")).scene();
    scene.surroundings.floor = Some(0.0);
    scene.surroundings.sun = Some(Vector::new(0.0, 1.0, 0.0));
    let mut survey = Survey::new("0,60".parse().expect("a view")).with_perspective(30.0);
    survey.add(&scene);
    let mut fit = survey.fit();
    fit.picture.area = [-4.0, -4.0, 8.0, 8.0];
    let page = Page::new(fit.picture, Size::Exact(400, 400), None).expect("small");
    let pixels = pixels_by(&scene, &fit, &page, Smoothness::Fine, 1);
    let floor = |x: f64, z: f64| {
        let at = fit.camera.project(Point::new(x, 0.0, z));
        let (x, y) = ((at.x + 4.0) * 50.0, (4.0 - at.y) * 50.0);
        let pixel = pixels[y as usize * 400 + x as usize];
        f64::from(pixel[1]) + 255.0 - f64::from(pixel[3])
    };
    let lit = floor(3.0, 0.5);
    let dark: Vec<bool> =
        [(-0.5, 0.5), (0.5, 0.5), (-0.5, -0.5), (0.5, -0.5)].map(|(x, z)| floor(x, z) < 0.6 * lit).into();
    assert_eq!(dark.iter().filter(|dark| **dark).count(), 3, "{dark:?}");
    // The heading leads away from the viewer.
    assert!(!dark[3], "{dark:?}");
}

#[test]
fn meshes_have_coordinates_and_copies_of_the_picture() {
    let home = Home::new(&model("square.obj", "F(1) @Q(1) @L(1)"));
    let scene = home.scene();
    let text = String::from_utf8(writer(&scene, Format::OBJ).write(&scene, "square")).expect("UTF-8");
    let lines = |start: &str| text.lines().filter(|line| line.starts_with(start)).count();
    assert_eq!(lines("vt "), 4);
    let pictured: Vec<&str> = text.lines().filter(|l| l.starts_with("f ") && !l.contains("//")).collect();
    assert_eq!(pictured.len(), 2, "only the square has places in a picture");
    let numbers: Vec<&str> = pictured[0].split([' ', '/']).collect();
    assert_eq!([numbers[2], numbers[5], numbers[8]], ["1", "2", "3"]);
    let files = writer(&scene, Format::OBJ).companions(&scene);
    let [library, copy] = &files[..] else { panic!("{} files", files.len()) };
    let library = String::from_utf8(library.bytes.clone()).expect("UTF-8");
    assert!(library.contains("newmtl Q\nKa 0.2 0.2 0.2\nKd 1 1 1\n"), "{library}");
    assert!(library.contains("map_Kd four.png\nmap_d four.png\n"), "{library}");
    assert_eq!(copy.name, "four.png");
    assert_eq!(copy.bytes, fs::read(home.path("pictures/four.png")).expect("a picture"));
    let (models, _) = tobj::load_obj_buf(
        &mut text.as_bytes(),
        &tobj::LoadOptions { triangulate: true, single_index: true, ..Default::default() },
        |_| tobj::load_mtl_buf(&mut library.as_bytes()),
    )
    .expect("an OBJ");
    let square = models.iter().find(|model| !model.mesh.texcoords.is_empty()).expect("a square");
    assert_eq!(square.mesh.texcoords, [0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 1.0]);

    // The same model without the picture has none of that.
    home.put("model.dls", b"surface @Q from \"square.obj\"\ninitial string: F(1) @Q(1) @L(1)");
    let scene = home.scene();
    let plain = String::from_utf8(writer(&scene, Format::OBJ).write(&scene, "square")).expect("UTF-8");
    assert!(!plain.contains("vt ") && plain.lines().all(|l| !l.starts_with("f ") || l.contains("//")));
    assert_eq!(writer(&scene, Format::OBJ).companions(&scene).len(), 1);
}

/// Few colours, no image, and nothing where the picture is transparent.
#[test]
fn vectors_have_tones_and_holes() {
    let scene = Home::new(&model("square.obj", "@Q(1)")).scene();
    let text = String::from_utf8(writer(&scene, Format::SVG).write(&scene, "square")).expect("UTF-8");
    assert!(!text.contains("<image"), "vectors only");
    let tree = usvg::Tree::from_str(&text, &usvg::Options::default()).expect("an SVG");
    let size = f64::from(tree.size().width());
    let mut found = Vec::new();
    fn paths<'t>(group: &'t usvg::Group, all: &mut Vec<&'t usvg::Path>) {
        for node in group.children() {
            match node {
                usvg::Node::Group(group) => paths(group, all),
                usvg::Node::Path(path) => all.push(path),
                _ => {}
            }
        }
    }
    paths(tree.root(), &mut found);
    for color in [RED, GREEN, BLUE] {
        let is_of = |path: &&&usvg::Path| match path.fill().map(usvg::Fill::paint) {
            Some(usvg::Paint::Color(c)) => is_near([c.red, c.green, c.blue, 255], color),
            _ => false,
        };
        let path = found.iter().find(is_of).unwrap_or_else(|| panic!("no path is {color:?}: {text}"));
        let at = path.abs_bounding_box();
        let middle = [f64::from(at.left() + at.right()) / size, f64::from(at.top() + at.bottom()) / size];
        let is_left = color != GREEN;
        let is_upper = color == BLUE;
        assert_eq!((middle[0] < 1.0, middle[1] < 1.0), (is_left, is_upper), "{color:?} at {middle:?}");
        // Paths may reach under later ones, but never into the open quarter.
        assert!(is_left || middle[1] > 1.2, "{middle:?}");
    }
}

#[test]
fn animated_files_have_the_picture() {
    let home = Home::new(&format!(
        "{}\nframes 0 .. 1 step 0.5\nF(x): solve dx/dt = 1",
        model("square.obj", "F(1) @Q(1)")
    ));
    let at = |name: &str| home.text(name);
    good(&["run", &at("model.dls"), "--format", "glb", "-o", &at("a.glb")]);
    let file = fs::read(home.path("a.glb")).expect("a file");
    let json = Glb::read(&file).json;
    let picture = fs::read(home.path("pictures/four.png")).expect("a picture");
    let view = &json["bufferViews"][json["images"][0]["bufferView"].as_u64().expect("a view") as usize];
    let first = 28
        + u32::from_le_bytes(file[12..16].try_into().expect("four")) as usize
        + view["byteOffset"].as_u64().unwrap_or(0) as usize;
    assert!(file[first..].starts_with(&picture));
    let materials = json["materials"].as_array().expect("materials");
    let own = materials.iter().find(|m| m["name"] == "Q").expect("a material");
    assert_eq!((&own["alphaMode"], &own["doubleSided"]), (&Value::from("MASK"), &Value::from(true)));
    assert_eq!(own["pbrMetallicRoughness"]["baseColorTexture"]["index"], 0);
    assert!(materials.iter().filter(|m| m["name"] != "Q").all(|m| m["alphaMode"].is_null()));
    let primitive = (json["meshes"].as_array().expect("meshes").iter())
        .flat_map(|mesh| mesh["primitives"].as_array().expect("primitives"))
        .find(|primitive| !primitive["attributes"]["TEXCOORD_0"].is_null())
        .expect("a primitive with a picture");
    let accessor = &json["accessors"][primitive["attributes"]["TEXCOORD_0"].as_u64().expect("one") as usize];
    assert_eq!((&accessor["type"], &accessor["count"]), (&Value::from("VEC2"), &Value::from(4)));

    fs::create_dir(home.path("out")).expect("a folder");
    let order = ["run", &at("model.dls"), "--format", "usda", "-o", &at("out/a.usda")];
    let said = good(&order);
    assert!(said.contains("a.usda, with four.png: "), "{said}");
    assert_eq!(fs::read(home.path("out/four.png")).expect("a copy"), picture);
    let text = fs::read_to_string(home.path("out/a.usda")).expect("a layer");
    for part in [
        "asset inputs:file = @./four.png@",
        "texCoord2f[] primvars:st = [(0,0),(1,0),(1,1),(0,1)]",
        "float inputs:opacityThreshold = 0.5",
        "token inputs:wrapS = \"clamp\"",
    ] {
        assert!(text.contains(part), "{part}");
    }
    // The same again is no conflict; another file of that name is one.
    good(&order);
    fs::write(home.path("out/four.png"), "a holiday").expect("written");
    let (_, message) = bad(&order);
    assert!(message.contains("four.png is there and is another file"), "{message}");
    assert_eq!(fs::read(home.path("out/four.png")).expect("still there"), b"a holiday");
}

#[test]
fn pages_have_the_picture_and_frames_a_copy() {
    let home = Home::new(&model("patch.s", "@Q(1)"));
    let at = |name: &str| home.text(name);
    good(&["view", &at("model.dls"), "--at", "0", "-o", &at("a.html")]);
    let page = fs::read_to_string(home.path("a.html")).expect("a page");
    let text = page.split_once("type=\"application/json\">").expect("a description").1;
    let description: Value =
        serde_json::from_str(text.split_once("</script>").expect("an end").0).expect("JSON");
    assert_eq!(description["pictures"][0]["size"], serde_json::json!([64, 64]));
    assert_eq!(description["meshes"][0]["picture"], 0);
    let [places, pinned] =
        ["places", "pinned"].map(|name| description["meshes"][0][name].as_array().expect("numbers").len());
    assert_eq!(places / 3, pinned / 2);
    good(&["render", &at("model.dls"), "--at", "0,1,2", "--format", "obj", "-o", &at("frames")]);
    let mut names: Vec<String> = fs::read_dir(home.path("frames"))
        .expect("a folder")
        .map(|entry| entry.expect("readable").file_name().into_string().expect("UTF-8"))
        .collect();
    names.sort();
    let expected =
        ["four.png", "frame-0000.obj", "frame-0001.obj", "frame-0002.obj", "manifest.json", "materials.mtl"];
    assert_eq!(names, expected);
}

/// A picture on ground has a place at each point, stays where nothing slips, and goes outwards with a heap that does; heights are those without it.
#[test]
fn a_picture_on_ground_slides_with_the_material() {
    let text = |picture: &str| {
        format!(
            "soil dry = sand, repose 30, flow 0.2\nground dry cell 0.02 depth 0.5 extent 0.8{picture} \
             height if x^2 + z^2 < 0.04 then 0.2 else 0\ninitial string: F(0.1)\n"
        )
    };
    let home = Home::new("");
    let ground = |picture: &str| {
        home.put("model.dls", text(picture).as_bytes());
        let session = home.session();
        let terrain =
            Terrain::new(&session.model, Settings::default(), 1).expect("a ground").expect("of soil");
        terrain.at(1.5, MaterialId::LEAF, None).unwrap_or_else(|error| panic!("{error}"))
    };
    let plain = ground("");
    let covered = ground(" texture \"pictures/four.png\" size 0.25");
    assert!(
        plain.vertices == covered.vertices && plain.normals == covered.normals && plain.places.is_empty()
    );
    assert_eq!(covered.places.len(), covered.vertices.len());
    let (mut outwards, mut most) = (0, 0.0_f64);
    for (point, [u, v]) in covered.vertices.iter().zip(&covered.places) {
        let [dx, dz] = [point.x - 0.25 * u, point.z + 0.25 * v];
        let radius = point.x.hypot(point.z);
        most = most.max(dx.hypot(dz));
        if radius > 0.6 {
            assert!(dx.hypot(dz) < 1e-12, "{point}: {dx} {dz}");
        } else if radius > 0.16 && radius < 0.25 {
            assert!(dx * point.x + dz * point.z > 0.0, "{point}: {dx} {dz}");
            outwards += 1;
        }
    }
    assert!(outwards > 100 && most > 0.02, "{outwards} {most}");
    let (code, message) = {
        home.put("model.dls", text(" size 2").as_bytes());
        bad(&["check", &home.text("model.dls")])
    };
    assert!(code == 1 && message.contains("model.dls:2:43") && message.contains("no picture"), "{message}");
}

/// Each with its place, and advice.
#[test]
fn mistakes_are_told_with_their_place() {
    let home = Home::new("");
    home.put("bare.obj", b"v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n");
    home.put("text.png", b"no picture");
    home.put("photo.jpg", b"\xff\xd8\xff\xe0");
    let whole = fs::read(home.path("pictures/four.png")).expect("a picture");
    home.put("half.png", &whole[..60]);
    home.put("wide.png", &png(5000, 1, &[0; 20_000]));
    for (surface, picture, place, what, help) in [
        ("square.obj", "gone.png", "2:38", "there is no file", "put it into the folder"),
        ("square.obj", "../four.png", "2:38", "leaves the model's folder", "in the folder of the model"),
        ("square.obj", "text.png", "2:38", "this is no PNG picture", "save it as PNG"),
        ("square.obj", "photo.jpg", "2:38", "this is a JPEG picture", "save it as PNG"),
        ("square.obj", "half.png", "2:38", "the PNG picture is broken", "save it again"),
        ("square.obj", "wide.png", "2:38", "has 5000 × 1 pixels; at most 4096 × 4096", "make it smaller"),
        (
            "bare.obj",
            "pictures/four.png",
            "2:17",
            "bare.obj, line 4: there are no texture coordinates",
            "leave out `texture`",
        ),
    ] {
        let text = format!(
            "# A leaf.\nsurface @Q from \"{surface}\" texture \"{picture}\"\ninitial string: @Q(1)\n"
        );
        home.put("model.dls", text.as_bytes());
        let (code, message) = bad(&["check", &home.text("model.dls")]);
        assert_eq!(code, 1, "{message}");
        let column = if surface == "square.obj" { place } else { "2:17" };
        for part in [&format!("model.dls:{column}"), what, help] {
            assert!(message.contains(part), "{picture}: {part:?} is not in\n{message}");
        }
    }
}
