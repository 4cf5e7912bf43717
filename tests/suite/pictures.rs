//! Pictures: pixels at places that can be computed, sheets of several frames, and the flags of `render` for them.

use crate::cli::{bad, good};
use crate::common::scene;
use crate::export::assert_golden;
use dlsys::render::{
    Fit, Format, FrameWriter, Layout, Page, Sheet, SheetWriter, Size, Spacing, Survey, View,
};
use dlsys::scene::{Owner, Point, Polygon, Scene};
use dlsys::tree::Lineage;

/// A PNG as a reader sees it: width, height, and red, green, blue (and opacity) of each pixel.
struct Picture {
    width: usize,
    height: usize,
    channels: usize,
    data: Vec<u8>,
}

impl Picture {
    fn read(bytes: &[u8]) -> Picture {
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().expect("a PNG");
        let mut data = vec![0; reader.output_buffer_size().expect("small")];
        let info = reader.next_frame(&mut data).expect("an image");
        Picture {
            width: info.width as usize,
            height: info.height as usize,
            channels: info.color_type.samples(),
            data,
        }
    }

    fn at(&self, x: usize, y: usize) -> &[u8] {
        let start = (y * self.width + x) * self.channels;
        &self.data[start..start + self.channels]
    }

    /// Whether any pixel of these columns is not as the first of all.
    fn is_drawn_on(&self, columns: std::ops::Range<usize>) -> bool {
        (0..self.height).any(|y| columns.clone().any(|x| self.at(x, y) != self.at(0, 0)))
    }
}

/// Squares around the z axis: half of the side, z, number of the colour.
fn squares(all: &[(f64, f64, f64)]) -> Scene {
    let mut scene = Scene::default();
    for (i, &(half, z, number)) in all.iter().enumerate() {
        let owner = scene.add_owner(Owner { name: "P".into(), lineage: Lineage::of_axiom(i) });
        let corners = [[-half, -half], [half, -half], [half, half], [-half, half]];
        let material = scene.palette.numbered(number).expect("a colour");
        let vertices = corners.map(|[x, y]| Point::new(x, y, z)).to_vec();
        scene.polygons.push(Polygon { vertices, material, owner });
    }
    scene
}

fn color(number: f64) -> [u8; 3] {
    let palette = Scene::default().palette;
    let color = palette.get(palette.numbered(number).expect("a colour")).color;
    [color.red, color.green, color.blue]
}

fn drawn(scene: &Scene, view: &str, field: Option<f64>) -> Picture {
    let mut survey = Survey::new(view.parse().expect("a view"));
    if let Some(field) = field {
        survey = survey.with_perspective(field);
    }
    survey.add(scene);
    Picture::read(&FrameWriter::new(Format::PNG, survey.fit()).write(scene, "squares"))
}

#[test]
fn nearer_wins_from_any_side_in_any_order() {
    let mut pair = [(1.0, 1.0, 7.0), (2.0, -1.0, 9.0)];
    for _ in 0..2 {
        let picture = drawn(&squares(&pair), "front", None);
        assert_eq!((picture.width, picture.height, picture.channels), (1000, 1000, 3));
        // The picture is 4.32 wide, so a unit is 231.5 pixels. What faces the viewer in front keeps its colour.
        assert_eq!(picture.at(500, 500), color(7.0));
        assert_eq!(picture.at(730, 500), color(7.0));
        assert_eq!(picture.at(733, 500), picture.at(960, 960), "beside the small square, the large one");
        assert_ne!(picture.at(733, 500), color(9.0), "which is further away and darker");
        assert_eq!(picture.at(965, 500), [0xfb, 0xfa, 0xf5], "beside that, nothing");
        let behind = drawn(&squares(&pair), "180,0", None);
        assert_eq!((behind.at(500, 500), behind.at(950, 500)), (&color(9.0)[..], &color(9.0)[..]));
        pair.reverse();
    }
}

#[test]
fn in_perspective_nearer_is_larger() {
    let scene = squares(&[(1.0, 1.0, 7.0), (2.0, -1.0, 9.0)]);
    // At 40 degrees the eye is where the large square just fits: (2 - tan 20°)/tan 20° = 4.495 from the middle. The small
    // one is then 1.2861 times as large, the large one 0.8180 times: 1.2861 and 1.6360 to either side.
    let slope = 20_f64.to_radians().tan();
    let eye = (2.0 - slope) / slope;
    let (small, large) = (eye / (eye - 1.0), 2.0 * eye / (eye + 1.0));
    let pixels = 1000.0 / (2.0 * large * 1.08);
    let picture = drawn(&scene, "front", Some(40.0));
    let column = |x: f64| (500.0 + x * pixels) as usize;
    assert_eq!(picture.at(column(small) - 1, 500), color(7.0));
    assert_eq!(picture.at(column(small) + 1, 500), picture.at(column(large) - 1, 500));
    assert_eq!(picture.at(column(large) + 1, 500), [0xfb, 0xfa, 0xf5]);
    // The same camera in SVG.
    let mut survey = Survey::new(View::FRONT).with_perspective(40.0);
    survey.add(&scene);
    let text = FrameWriter::new(Format::SVG, survey.fit()).write(&scene, "");
    let text = String::from_utf8(text).expect("UTF-8");
    let tree = usvg::Tree::from_str(&text, &usvg::Options::default()).expect("an SVG");
    let mut reach = 0.0_f64;
    // The background is as wide as the picture.
    let mut groups = vec![tree.root()];
    while let Some(group) = groups.pop() {
        for node in group.children() {
            match node {
                usvg::Node::Group(inner) => groups.push(inner),
                other if f64::from(other.abs_bounding_box().width()) < 999.0 => {
                    reach = reach.max(f64::from(other.abs_bounding_box().right()));
                }
                _ => {}
            }
        }
    }
    assert!((reach - 500.0 - large * pixels).abs() < 0.3, "{reach}");
}

#[test]
fn stems_are_lit_like_cylinders() {
    let scene = scene("!(0.4)F(4)[&(60)F(2)]");
    let picture = drawn(&scene, "front", None);
    let mut survey = Survey::new(View::FRONT);
    survey.add(&scene);
    let fit = survey.fit();
    let [left, bottom, width, height] = fit.picture.area;
    let place = |x: f64, y: f64| {
        let scale = picture.width as f64 / width;
        picture.at(((x - left) * scale) as usize, ((bottom + height - y) * scale) as usize)
    };
    let brightness = |pixel: &[u8]| pixel.iter().map(|&c| u32::from(c)).sum::<u32>();
    let [lit, middle, dark] = [-0.12, 0.0, 0.17].map(|x| brightness(place(x, 1.0)));
    assert!(lit > middle && middle > dark, "{lit} {middle} {dark}");
}

#[test]
fn stems_that_stand_on_the_ground_are_cut_there_in_svg_as_in_png() {
    for text in ["!(0.4)F(4)[&(60)F(2)]", "@W(0.4)F(3)@W(0.3)F(1)[&(60)F(2)]"] {
        let scene = scene(text);
        let mut survey = Survey::new(View::FRONT);
        survey.add(&scene);
        let writer = FrameWriter::new(Format::SVG, survey.fit());
        let [_, bottom, _, height] = writer.page.picture.area;
        let ground =
            f64::from(writer.page.pixels[1]) / 2.0 + writer.page.pixels_per_unit() * (bottom + height / 2.0);
        let svg = String::from_utf8(writer.write(&scene, "")).expect("UTF-8");
        let tree = usvg::Tree::from_str(&svg, &usvg::Options::default()).expect("an SVG");
        let paths = crate::export::nodes(tree.root());
        // The background reaches to the lower edge.
        let lowest = paths.iter().map(|path| f64::from(path.abs_stroke_bounding_box().bottom()));
        let lowest = lowest.filter(|y| *y < f64::from(writer.page.pixels[1]) - 0.5).fold(0.0_f64, f64::max);
        assert!((lowest - ground).abs() < 0.6, "{text}: {lowest}, the ground is at {ground}");
    }
}

#[test]
fn a_foot_that_is_seen_from_above_is_round_in_svg_as_in_png() {
    let model = concat!(env!("CARGO_MANIFEST_DIR"), "/models/sapling.dls");
    let folder = tempfile::tempdir().expect("a directory");
    let drawn = |format: &str| {
        let out = folder.path().join(format);
        let path = out.to_str().expect("UTF-8");
        let flags = ["render", "--quiet", "--at", "4.9", "--perspective", "60", "--format", format];
        good(&[&flags[..], &["-o", path, model]].concat());
        std::fs::read(out.join(format!("frame-0000.{format}"))).expect("a frame")
    };
    let exact = Picture::read(&drawn("png"));
    let is_drawn = |x: usize, y: usize| exact.at(x, y)[2].abs_diff(exact.at(0, 0)[2]) > 100;
    let mut rows = (0..exact.height).filter(|y| (0..exact.width).any(|x| is_drawn(x, *y)));
    let foot = 1.0 + rows.next_back().expect("a plant") as f64;
    let svg = String::from_utf8(drawn("svg")).expect("UTF-8");
    let tree = usvg::Tree::from_str(&svg, &usvg::Options::default()).expect("an SVG");
    let paths = crate::export::nodes(tree.root());
    // The background reaches to the lower edge.
    let lowest = paths.iter().map(|path| f64::from(path.abs_stroke_bounding_box().bottom()));
    let lowest = lowest.filter(|y| *y < exact.height as f64 - 0.5).fold(0.0_f64, f64::max);
    assert!((lowest - foot).abs() < 1.0, "{lowest}, {foot}");
}

#[test]
fn pages_have_the_size_and_background_that_was_asked_for() {
    let scene = squares(&[(1.0, 0.0, 7.0)]);
    let mut survey = Survey::new(View::FRONT);
    survey.add(&scene);
    let mut writer = FrameWriter::new(Format::PNG, survey.fit());
    writer.page = Page::new(writer.fit.picture, Size::Exact(64, 32), None).expect("small");
    let picture = Picture::read(&writer.write(&scene, ""));
    assert_eq!((picture.width, picture.height, picture.channels), (64, 32, 4));
    assert_eq!((picture.at(0, 0), picture.at(20, 16)[3], picture.at(60, 16)[3]), (&[0; 4][..], 255, 0));
    let [red, green, blue] = color(7.0);
    assert_eq!(picture.at(32, 16), [red, green, blue, 255]);
}

/// A twig at three ages, on a sheet.
fn sheet(layout: Layout, format: Format, spacing: Spacing) -> (Vec<u8>, Fit) {
    let scenes =
        ["F(1)", "F(2)[+(60);(7)F(1)]", "F(3)[+(60);(7)F(2)][-(60){f(1)+(120)f(1)+(120)f(1)}]"].map(scene);
    let surveys: Vec<Survey> = scenes
        .iter()
        .map(|scene| {
            let mut survey = Survey::new(View::FRONT);
            survey.add(scene);
            survey
        })
        .collect();
    let mut all = Survey::new(View::FRONT);
    surveys.iter().for_each(|survey| all.merge(survey));
    let fit = all.fit();
    let captions: Vec<String> = ["t = 1", "t = 2.5", "t < 10"].map(str::to_owned).into();
    let sheet = Sheet::new(layout, &fit, &surveys, &captions, spacing);
    let page = Page::new(sheet.picture, Size::default(), Some(Page::BACKGROUND)).expect("small");
    let writer = SheetWriter::new(format, fit.clone(), sheet, page).expect("a picture");
    let mut assembly = writer.begin();
    for (i, scene) in scenes.iter().enumerate() {
        let part = writer.part(i, scene).expect("room");
        assembly.add(part).expect("short");
    }
    (assembly.finish("a twig, t = 1 to 10"), fit)
}

#[test]
fn sheets_hold_a_group_for_each_frame() {
    for layout in [Layout::Overlay, Layout::Stack, Layout::Grid] {
        let (bytes, _) = sheet(layout, Format::SVG, Spacing::default());
        let text = String::from_utf8(bytes).expect("UTF-8");
        let tree = usvg::Tree::from_str(&text, &usvg::Options::default()).expect("an SVG");
        let groups = (0..3).filter(|i| text.contains(&format!("<g id=\"frame-{i:04}\""))).count();
        assert_eq!((groups, text.matches("<g id=").count()), (3, 3), "{}", layout.name());
        for frame in ["frame-0000", "frame-0001", "frame-0002"] {
            assert!(tree.node_by_id(frame).is_some(), "{frame} is drawn");
        }
        assert_golden(&format!("{}.svg", layout.name()), &text);
    }
}

#[test]
fn sheets_are_drawn_in_pixels_too() {
    let (bytes, _) = sheet(Layout::Grid, Format::PNG, Spacing::default());
    let row = Picture::read(&bytes);
    assert!(row.width == 1000 && row.height < 1000);
    for third in 0..3 {
        assert!(row.is_drawn_on(333 * third..333 * (third + 1)), "{third}");
    }
    let one_column = Spacing { columns: Some(1), ..Spacing::default() };
    let column = Picture::read(&sheet(Layout::Grid, Format::PNG, one_column).0);
    assert!(column.height == 1000 && column.width < 500);
    // The stem of the last frame of an overlay covers the older, fainter ones.
    let (bytes, fit) = sheet(Layout::Overlay, Format::PNG, Spacing::default());
    let overlay = Picture::read(&bytes);
    let [left, bottom, width, height] = fit.picture.area;
    let scale = overlay.width as f64 / width;
    let place = |y: f64| overlay.at((-left * scale) as usize, ((bottom + height - y) * scale) as usize);
    assert_eq!(place(0.5), [0x6b, 0x7a, 0x3a]);
    assert_eq!(place(2.7), [0x6b, 0x7a, 0x3a]);
}

#[test]
fn layouts_are_rendered_whole_and_alike_by_any_number_of_threads() {
    let folder = tempfile::tempdir().expect("a folder");
    let render = |threads: &str, more: &[&str]| {
        let out = folder.path().join(format!("{threads}{}", more.join("")));
        let path = out.to_str().expect("UTF-8");
        let common = ["render", "models/leaf.dls", "--at", "0.5,3,9", "-o", path, "--threads", threads];
        good(&[&common[..], more].concat());
        out
    };
    for (flags, file) in [
        (&["--layout", "overlay"][..], "overlay.svg"),
        (&["--layout", "stack", "--format", "png", "--width", "200"], "stack.png"),
        (&["--layout", "grid", "--columns", "2", "--perspective", "40", "--view", "30,20"], "grid.svg"),
        (&["--format", "png", "--size", "120x90", "--background", "none"], "frame-0001.png"),
        (&[], "frame-0002.svg"),
    ] {
        let [one, many] = ["1", "3"].map(|threads| render(threads, flags));
        for name in [file, "manifest.json"] {
            let [a, b] = [&one, &many].map(|out| std::fs::read(out.join(name)).expect("written"));
            assert!(a == b, "{flags:?}: {name}");
        }
        let manifest: serde_json::Value =
            serde_json::from_slice(&std::fs::read(one.join("manifest.json")).expect("written"))
                .expect("JSON");
        assert_eq!(manifest["frames"].as_array().map(Vec::len), Some(3));
        if flags.contains(&"--layout") {
            assert_eq!(manifest["settings"]["layout"], flags[1]);
            assert_eq!(manifest["files"], serde_json::json!([file]));
        }
    }
}

#[test]
fn flags_that_do_not_go_together_say_so() {
    for (flags, says) in [
        (&["--layout", "grid", "--format", "obj"][..], "an OBJ file is one mesh in space"),
        (&["--perspective", "40", "--format", "obj"], "--perspective is for pictures"),
        (&["--layout", "heap"], "layouts are frames, overlay, stack, grid"),
        (&["--columns", "3"], "--columns goes with --layout grid, not with frames"),
        (&["--layout", "overlay", "--row-height", "1"], "--row-height goes with --layout stack"),
        (&["--layout", "grid", "--columns", "0"], "must be a number from 1"),
        (&["--perspective", "0"], "between 1 and 120 degrees"),
        (&["--size", "100"], "such as 1280x720"),
        (&["--size", "30000x100"], "between 1 and 20000 pixels"),
        (&["--size", "20000x20000"], "50 million in all"),
        (&["--size", "10x10", "--width", "10"], "cannot be used with"),
        (&["--background", "white"], "a colour like #ffffff"),
        (&["--threads", "0"], "between 1 and 256"),
        (&["--line-width", "0px"], "must be greater than 0"),
        (&["--line-width", "thin"], "expected pixels of the page, such as 1px"),
        (&["--line-width", "1px", "--format", "obj"], "--line-width is for pictures"),
    ] {
        let folder = tempfile::tempdir().expect("a folder");
        let out = folder.path().join("out");
        let path = out.to_str().expect("UTF-8");
        let (status, message) =
            bad(&[&["render", "models/leaf.dls", "--at", "1", "-o", path], flags].concat());
        assert!(status == 2 && message.contains(says), "{flags:?}: {status}, {message}");
        assert!(!out.exists(), "{flags:?}: nothing is written");
    }
}

/// The values of an attribute in an SVG.
fn values(svg: &str, attribute: &str) -> Vec<f64> {
    let begin = format!(" {attribute}=\"");
    let parts = svg.split(&begin).skip(1).filter_map(|rest| rest.split('"').next());
    parts.map(|value| value.split(' ').nth(2).unwrap_or(value).parse().expect("a number")).collect()
}

#[test]
fn lines_have_the_width_that_was_asked_for_in_pixels_and_in_units() {
    let folder = tempfile::tempdir().expect("a folder");
    let drawn = |name: &str, flags: &[&str]| {
        let out = folder.path().join(name);
        let path = out.to_str().expect("UTF-8");
        let model = "models/abop/plant.dls";
        good(&[&["render", model, "--at", "3", "--quiet", "-o", path], flags].concat());
        std::fs::read_to_string(out.join("frame-0000.svg")).expect("a picture")
    };
    for (pixels, width) in [(1.0, "300"), (4.0, "300"), (4.0, "1200")] {
        let svg = drawn("pixels", &["--line-width", &format!("{pixels}px"), "--width", width]);
        // The third number of `viewBox` is the width of the page.
        let page = values(&svg, "viewBox")[0];
        let drawn = values(&svg, "stroke-width");
        let pixel = page / width.parse::<f64>().expect("a number");
        assert!(drawn.len() > 20, "{}", drawn.len());
        let far = drawn.iter().map(|x| (x / pixel - pixels).abs()).fold(0.0, f64::max);
        assert!(far < 0.01 * pixels + 0.001 / pixel, "{pixels} at {width}: {far}");
    }
    let [narrow, wide] =
        ["0.02", "0.08"].map(|units| values(&drawn("units", &["--line-width", units]), "stroke-width")[0]);
    assert!((wide / narrow - 4.0).abs() < 0.1, "{narrow} {wide}");
}

/// The ending of the file chooses the format; one picture is a file of that name.
#[test]
fn one_picture_is_a_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name).to_str().expect("UTF-8").to_owned();
    let render = |out: &str, flags: &[&str]| {
        good(&[&["render", "models/leaf.dls", "--width", "60", "-o", &at(out)][..], flags].concat())
    };
    let begins = |name: &str, start: &[u8]| std::fs::read(at(name)).expect("a file").starts_with(start);
    let said = render("a.png", &["--at", "3"]);
    assert!(begins("a.png", b"\x89PNG") && said.contains("a.png"), "{said}");
    render("frames", &["--at", "3", "--format", "png"]);
    let frame = std::fs::read(at("frames/frame-0000.png")).expect("a frame");
    assert!(frame == std::fs::read(at("a.png")).expect("a file"), "the same picture");
    render("a.svg", &["--at", "3"]);
    render("grid.svg", &["--at", "1,3", "--layout", "grid"]);
    render("a.gif", &["--at", "1,3"]);
    assert!(begins("a.svg", b"<svg") && begins("grid.svg", b"<svg") && begins("a.gif", b"GIF"));
    std::fs::write(at("thesis.png"), "years of work").expect("written");
    for (out, flags, expected) in [
        ("many.png", &["--at", "1,3"][..], "`--at T` for one frame in a file"),
        ("thesis.png", &["--at", "1"], "is not a PNG file"),
        ("a.obj", &["--at", "1"], "materials in a file beside it"),
    ] {
        let out = at(out);
        let command = [&["render", "models/leaf.dls", "-o", &out][..], flags].concat();
        assert!(bad(&command).1.contains(expected), "{out}: {}", bad(&command).1);
    }
    // Only a stream of pixels goes to standard output.
    for (command, hint) in [
        (&["render", "--format", "svg"][..], "`--at T -o leaf.svg`"),
        (&["render", "--format", "obj"], "`-o frames`"),
        (&["render", "--format", "glb"], "`-o leaf.glb`"),
        (&["view"], "`-o leaf.html`"),
    ] {
        let command = [command, &["models/leaf.dls", "-o", "-"]].concat();
        let said = bad(&command).1;
        assert!(said.contains("`-o -` is standard output") && said.contains(hint), "{said}");
    }
    let said = bad(&["run", "models/leaf.dls", "--seed", "-1"]).1;
    assert!(said.contains("expected a whole number from 0 to 18446744073709551615"), "{said}");
    assert_eq!(std::fs::read(at("thesis.png")).expect("a file"), b"years of work");
    let count = std::fs::read_dir(folder.path()).expect("a folder").count();
    assert_eq!(count, 6, "nothing is left over");
}

#[test]
fn a_coloured_floor_fades_into_the_horizon_in_svg_as_in_png() {
    let folder = tempfile::tempdir().expect("a directory");
    let model = folder.path().join("post.dls");
    let text = "ground 0 color \"#7f9a4e\"\nsky \"#5f95cf\", \"#e6e9dc\"\ninitial string: !(0.2) F(3)\n";
    std::fs::write(&model, text).expect("a model");
    let drawn = |format: &str, view: &[&str]| {
        let out = folder.path().join(format).join(view.len().to_string());
        let [out_name, model] = [&out, &model].map(|path| path.to_str().expect("UTF-8"));
        let flags = [
            "render", "--quiet", "--force", "--at", "0", "--view", "20,8", "--size", "300x240", "--format",
            format,
        ];
        good(&[&flags[..], view, &["-o", out_name, model]].concat());
        std::fs::read(out.join(format!("frame-0000.{format}"))).expect("a frame")
    };
    let picture = Picture::read(&drawn("png", &["--perspective", "40"]));
    let greens: Vec<i32> =
        (0..240).map(|y| i32::from(picture.at(2, y)[1]) - i32::from(picture.at(2, y)[2])).collect();
    assert!(greens.windows(2).all(|rows| rows[0].abs_diff(rows[1]) <= 6), "no edge: {greens:?}");
    assert!(greens[239] > 50 && greens[239] > greens[120] + 20, "{greens:?}");

    let svg = String::from_utf8(drawn("svg", &["--perspective", "40"])).expect("UTF-8");
    assert!(usvg::Tree::from_str(&svg, &usvg::Options::default()).is_ok());
    let (copies, floor) = svg.split_once("<g mask=\"url(#near)\">").expect("a floor with a mask");
    let (_, copies) =
        copies.split_once("<g fill=\"#e6e9dc\">").expect("copies that have the colour of the horizon");
    let outline =
        |line: &str| line.split_once(" d=\"").map(|(_, data)| data.trim_end_matches("\"/>").to_owned());
    let of_floor: Vec<String> = floor.lines().filter_map(outline).collect();
    let copies: Vec<String> = copies.lines().filter_map(outline).collect();
    assert!(!copies.is_empty() && copies.iter().all(|copy| of_floor.contains(copy)));
    // Without perspective there is no horizon.
    let text = "ground 0 color \"#7f9a4e\"\ninitial string: !(0.2) F(3)\n";
    std::fs::write(&model, text).expect("a model");
    let flat = String::from_utf8(drawn("svg", &[])).expect("UTF-8");
    assert!(flat.contains("<path") && !flat.contains("mask"));
}
