//! Light, shadows, floor, camera, and plants of other models: at places that can be computed.

use std::sync::Arc;

use crate::cli::{bad, good};
use crate::common::scene;
use dlsys::render::{
    Fit, Format, FrameWriter, Layout, Page, Sheet, SheetWriter, Size, Smoothness, Spacing, Survey, View,
    pixels_by,
};
use dlsys::scene::{
    Bounds, Color, Face, MaterialId, Mesh, Owner, Placement, Plant, Point, Polygon, Scene, Surroundings,
    Vector, Viewpoint,
};
use dlsys::tree::Lineage;

/// A pole of height 4 on a floor at 0, and the sun in the east at 45 degrees.
fn pole() -> Scene {
    let mut scene = scene("!(0.2)F(4)");
    scene.surroundings.floor = Some(0.0);
    scene.surroundings.sun = Some(Vector::new(1.0, 1.0, 0.0));
    scene
}

fn fit(scene: &Scene, view: &str) -> Fit {
    let mut survey = Survey::new(view.parse().expect("a view")).with_perspective(40.0);
    survey.add(scene);
    survey.fit()
}

/// Red, green and blue before white of the pixel at which a camera sees a point, on a page of 400 pixels that shows eight units.
fn seen_at(scene: &Scene, view: &str, place: Point) -> [f64; 3] {
    let mut fit = fit(scene, view);
    fit.picture.area = [-4.0, -4.0, 8.0, 8.0];
    let page = Page::new(fit.picture, Size::Exact(400, 400), None).expect("small");
    let pixels = pixels_by(scene, &fit, &page, Smoothness::Fine, 1);
    let at = fit.camera.project(place);
    let (x, y) = ((at.x + 4.0) * 50.0, (4.0 - at.y) * 50.0);
    let pixel = pixels[y as usize * 400 + x as usize];
    [0, 1, 2].map(|k| f64::from(pixel[k]) + 255.0 - f64::from(pixel[3]))
}

#[test]
fn the_shadow_of_a_pole_lies_on_the_side_away_from_the_sun_and_is_as_long_as_it_is_high() {
    let scene = pole();
    let floor = |x: f64, z: f64| seen_at(&scene, "0,50", Point::new(x, 0.0, z))[1];
    let lit = floor(2.0, 0.0);
    assert!(lit > 215.0, "towards the sun the floor is lit: {lit}");
    for x in [-1.0, -2.0, -3.0, -3.7] {
        let dark = floor(x, 0.0);
        assert!(dark < 0.8 * lit, "in shadow at {x}: {dark} beside {lit}");
        // The pole is 0.2 wide, and so is its shadow.
        for z in [-0.25, 0.25] {
            assert!(floor(x, z) > 0.9 * lit, "lit beside the shadow at {x}, {z}");
        }
    }
    assert!(floor(-4.3, 0.0) > 0.9 * lit, "beyond the shadow's end");
}

/// A drawing in one plane is a diagram until the model declares light: then it is round stems and shadows as any other.
#[test]
fn what_has_no_depth_stands_in_declared_light() {
    let mut flat = scene("!(0.2)F(4)");
    let side = |scene: &Scene, x: f64| seen_at(scene, "0,0", Point::new(x, 2.0, 0.0))[1];
    assert_eq!(side(&flat, -0.07), side(&flat, 0.07), "a diagram has one shade");
    flat.surroundings.sun = Some(Vector::new(-1.0, 1.0, 0.2));
    assert!(side(&flat, -0.07) > 1.2 * side(&flat, 0.07), "a side towards the sun, and one away from it");
}

/// Ground of soil that reaches a hundred times as far does not make the shadow of what stands on it wider.
#[test]
fn shadows_on_wide_soil_are_as_sharp_as_on_a_floor() {
    let mut scene = pole();
    scene.surroundings.floor = None;
    let mut mesh = Mesh::new();
    // Squares of five units: what is behind the viewer is not drawn.
    let side = 160_u32;
    let place = |i: u32| 5.0 * f64::from(i) - 400.0;
    mesh.vertices =
        (0..=side).flat_map(|j| (0..=side).map(move |i| Point::new(place(i), 0.0, place(j)))).collect();
    mesh.normals = vec![Vector::y(); mesh.vertices.len()];
    let face = |corners| Face { corners, material: MaterialId::CENTRE, takes_tint: false };
    let corners = (0..side).flat_map(|j| (0..side).map(move |i| j * (side + 1) + i));
    mesh.faces =
        corners.flat_map(|v| [[v, v + side + 1, v + side + 2], [v, v + side + 2, v + 1]]).map(face).collect();
    scene.add_terrain(Arc::new(mesh));
    let soil = |x: f64, z: f64| seen_at(&scene, "0,50", Point::new(x, 0.0, z))[1];
    let lit = soil(2.0, 0.0);
    for x in [-1.0, -2.0, -3.0] {
        assert!(soil(x, 0.0) < 0.8 * lit, "in shadow at {x}: {} of {lit}", soil(x, 0.0));
        assert!([-0.25, 0.25].map(|z| soil(x, z)).iter().all(|beside| *beside > 0.9 * lit), "lit beside it");
    }
    // The sky is seen less near the foot, and as far from the pole as anywhere.
    assert!(soil(0.2, 0.0) < 0.97 * lit && (soil(3.5, 2.0) - lit).abs() < 0.03 * lit);
}

#[test]
fn a_floor_has_the_declared_color() {
    let mut scene = pole();
    scene.surroundings.floor_color = Some(Color::hex(0x7f9a4e));
    for sky in [None, Some([Color::hex(0x6fa3e0), Color::hex(0xe8f0f8)])] {
        scene.surroundings.sky = sky;
        let [red, green, blue] = seen_at(&scene, "0,50", Point::new(2.0, 0.0, 0.0));
        let far = [red - 127.0, green - 154.0, blue - 78.0].map(f64::abs).into_iter().fold(0.0, f64::max);
        assert!(far < 12.0, "{red} {green} {blue}");
    }
}

#[test]
fn without_a_sun_the_floor_is_soft_and_dark_where_something_stands() {
    let mut scene = scene("!(1)F(2)");
    scene.surroundings.floor = Some(0.0);
    let floor = |x: f64| seen_at(&scene, "0,40", Point::new(x, 0.0, 0.0))[1];
    let [near, middle, far] = [1.0, 1.5, 3.5].map(floor);
    assert!(near + 5.0 < middle && middle < far, "{near} {middle} {far}");
    assert!(near > 120.0, "no hard shadow: {near}");
}

/// Small pictures have fewer and coarser maps of the sky's light: the light is that of a large picture, but for edges.
#[test]
fn a_small_picture_has_the_light_of_a_large_one() {
    let mut scene = scene("!(0.3)F(1.5)[^(70)@L(2)][&(70)@L(2)]/(90)[^(60)@K(1)]F(1.5)@O(1)");
    scene.surroundings.floor = Some(0.0);
    scene.surroundings.sky = Some([Color::hex(0x8f_b8e6), Color::hex(0xee_f3f7)]);
    let fit = fit(&scene, "30,30");
    let drawn = |side: u32| {
        let page = Page::new(fit.picture, Size::Exact(side, side), None).expect("small");
        pixels_by(&scene, &fit, &page, Smoothness::Fine, 1)
    };
    let large = drawn(960);
    for side in [120, 320] {
        let (small, zoom) = (drawn(side), (960 / side) as usize);
        let mean = |x: usize, y: usize, k: usize| {
            let block = (0..zoom * zoom).map(|i| (y * zoom + i / zoom) * 960 + x * zoom + i % zoom);
            block.map(|at| f64::from(large[at][k])).sum::<f64>() / (zoom * zoom) as f64
        };
        let pixels = side as usize * side as usize;
        let differences = (0..3 * pixels).map(|i| {
            let (k, at) = (i % 3, i / 3);
            (f64::from(small[at][k]) - mean(at % side as usize, at / side as usize, k)).abs()
        });
        let mut differences: Vec<f64> = differences.collect();
        differences.sort_by(f64::total_cmp);
        let whole = differences.iter().sum::<f64>() / differences.len() as f64;
        let most = differences[differences.len() * 99 / 100];
        assert!(whole < 1.5 && most < 12.0, "{side}: {whole} on average, {most} at most but for a hundredth");
    }
}

#[test]
fn light_stays_within_bounds_and_passes_through_leaves() {
    // A leaf that the sun lights from above, seen from both sides.
    let mut scene = Scene::default();
    let owner = scene.add_owner(Owner { name: "P".into(), lineage: Lineage::of_axiom(0) });
    let vertices = [[-2.0, -2.0], [2.0, -2.0], [2.0, 2.0], [-2.0, 2.0]].map(|[x, z]| Point::new(x, 1.0, z));
    scene.polygons.push(Polygon { vertices: vertices.to_vec(), material: MaterialId::LEAF, owner });
    let own = scene.palette.get(MaterialId::LEAF).color;
    let green =
        |scene: &Scene, view: &str| seen_at(scene, view, Point::new(0.3, 1.0, 0.3))[1] / f64::from(own.green);
    for sun in [None, Some(Vector::y())] {
        scene.surroundings.sun = sun;
        let [above, below] = [green(&scene, "0,60"), green(&scene, "0,-60")];
        assert!((0.7..1.4).contains(&above), "{above}");
        assert!((0.45..above).contains(&below), "{below} below, {above} above");
    }
    // In the shadow of another one it is darker, but not black.
    let lit = green(&scene, "0,60");
    let roof = vertices.map(|p| Point::new(p.x, 3.0, p.z - 4.5));
    scene.polygons.push(Polygon { vertices: roof.to_vec(), material: MaterialId::LEAF, owner });
    scene.surroundings.sun = Some(Vector::new(0.0, 2.0, -4.5));
    let shaded = green(&scene, "0,60");
    assert!((0.2..0.75 * lit).contains(&shaded), "{shaded} of {lit}");
}

#[test]
fn pixels_do_not_depend_on_threads() {
    let scene = pole();
    let fit = fit(&scene, "30,20");
    let page = Page::new(fit.picture, Size::Exact(200, 150), None).expect("small");
    let pixels = |threads| pixels_by(&scene, &fit, &page, Smoothness::Fine, threads);
    let one = pixels(1);
    assert!(one == pixels(2) && one == pixels(5));
}

#[test]
fn a_floor_is_a_group_of_a_mesh_and_regions_of_a_drawing_and_does_not_change_the_frame() {
    let scene = pole();
    let mut bare = scene.clone();
    bare.surroundings = Surroundings::default();
    assert_eq!(fit(&scene, "20,30").picture, fit(&bare, "20,30").picture);
    let write = |format| {
        String::from_utf8(FrameWriter::new(format, fit(&scene, "20,30")).write(&scene, "")).expect("UTF-8")
    };
    let mesh = write(Format::OBJ);
    assert!(mesh.contains("\ng ground\nusemtl ground\n"));
    let svg = write(Format::SVG);
    let ground = svg.split("<g id=\"ground\">").nth(1).and_then(|rest| rest.split("</g>").next());
    assert!(ground.is_some_and(|ground| ground.lines().count() > 3), "lit and in shadow");
}

#[test]
fn a_floor_fills_pages_of_any_shape() {
    let scene = pole();
    for size in [[900, 200], [200, 900]] {
        let mut writer = FrameWriter::new(Format::SVG, fit(&scene, "20,60"));
        writer.page = Page::new(writer.page.picture, Size::Exact(size[0], size[1]), writer.page.background)
            .expect("small");
        let svg = String::from_utf8(writer.write(&scene, "")).expect("UTF-8");
        let tree = usvg::Tree::from_str(&svg, &usvg::Options::default()).expect("an SVG");
        let ground = tree.node_by_id("ground").expect("a floor").abs_bounding_box();
        let [width, height] = size.map(|side| side as f32);
        // It reaches beyond the page: outlines are smoothed, and one along the margin would let the background through.
        let reaches = [-ground.left(), -ground.top(), ground.right() - width, ground.bottom() - height];
        assert!(reaches.iter().all(|reach| *reach > 0.5), "{size:?}: {ground:?}");
    }
}

#[test]
fn a_declared_camera_sees_its_aim_in_the_middle() {
    let mut scene = squares();
    scene.surroundings.camera =
        Some(Viewpoint { eye: Point::new(3.0, 2.0, 9.0), aim: Point::new(3.0, 2.0, 1.0), angle: 20.0 });
    let mut survey = Survey::new(View::FRONT);
    survey.add(&scene);
    let page = Page::usual(survey.fit().picture);
    let (fit, page) = survey.fit().for_frame(&scene, &page);
    let [left, bottom, width, height] = page.picture.area;
    let aim = fit.camera.project(Point::new(3.0, 2.0, 1.0));
    assert!((aim.x - left - width / 2.0).abs() < 1e-9 && (aim.y - bottom - height / 2.0).abs() < 1e-9);
    // 20 degrees from top to bottom, at a distance of 8.
    assert!((height - 16.0 * 10_f64.to_radians().tan()).abs() < 1e-9);
    let survey = Survey::new(View::FRONT).without_cameras();
    assert_eq!(survey.fit().for_frame(&scene, &page).1, page);
}

/// How a floor fades, and where it is darker, follows from the camera and from what stands there, not from what goes far away later.
#[test]
fn a_picture_of_a_declared_camera_does_not_depend_on_other_frames() {
    let mut scene = pole();
    scene.surroundings.floor_color = Some(Color::hex(0x7f9a4e));
    scene.surroundings.camera =
        Some(Viewpoint { eye: Point::new(2.0, 3.0, 12.0), aim: Point::new(0.0, 2.0, 0.0), angle: 40.0 });
    let later = self::scene("+(90)!(0.2)F(90)");
    let picture = |others: &[&Scene]| {
        let mut survey = Survey::new(View::FRONT);
        survey.add(&scene);
        others.iter().for_each(|other| survey.add(other));
        let (fit, page) = survey
            .fit_of_width(0.1)
            .with_accuracy(0.01)
            .for_frame(&scene, &Page::new(survey.fit().picture, Size::Exact(200, 200), None).expect("small"));
        pixels_by(&scene, &fit, &page, Smoothness::Fine, 1)
    };
    let [alone, among] = [picture(&[]), picture(&[&later])];
    let far = |a: &[u8; 4], b: &[u8; 4]| a.iter().zip(b).map(|(a, b)| a.abs_diff(*b)).max();
    let most = alone.iter().zip(&among).filter_map(|(a, b)| far(a, b)).max();
    assert!(most <= Some(12), "{most:?}");
    assert_ne!(alone[100 * 200 + 20], alone[190 * 200 + 20], "the floor fades");
}

fn squares() -> Scene {
    let mut scene = Scene::default();
    let owner = scene.add_owner(Owner { name: "P".into(), lineage: Lineage::of_axiom(0) });
    for z in [0.0, 2.0] {
        let vertices = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]].map(|[x, y]| Point::new(x, y, z));
        scene.polygons.push(Polygon { vertices: vertices.to_vec(), material: MaterialId::LEAF, owner });
    }
    scene
}

/// A row of plants, `step` apart along x.
fn row(plant: Scene, count: usize, step: f64) -> Scene {
    let plant = Arc::new(plant);
    let mut scene = Scene::default();
    for i in 0..count {
        let owner = scene.add_owner(Owner { name: "@P".into(), lineage: Lineage::of_axiom(i) });
        let origin = Point::new(step * i as f64, 0.0, 0.0);
        let placement = Placement::uniform(origin, [Vector::x(), Vector::y(), Vector::z()], 2.0);
        scene.plants.push(Plant::new(plant.clone(), placement, owner));
    }
    scene
}

#[test]
fn plants_count_in_bounds_and_are_drawn_where_they_stand() {
    let scene = row(scene("!(0.2);(7)F(3)[&(90)!(0.2);(7)F(0.5)]"), 3, 4.0);
    let bounds = Bounds::of(&scene);
    let [low, high] = bounds.corners(bounds.default_width()).expect("something");
    assert!((high.y - 6.2).abs() < 1e-9 && (high.x - 8.2).abs() < 1e-9 && (low.x + 0.2).abs() < 1e-9);
    let mut survey = Survey::new(View::FRONT);
    survey.add(&scene);
    let fit = survey.fit();
    let page = Page::new(fit.picture, Size::Width(300), None).expect("small");
    let pixels = pixels_by(&scene, &fit, &page, Smoothness::Fine, 1);
    let [left, bottom, width, height] = page.picture.area;
    let [w, h] = page.pixels.map(f64::from);
    let opacity = |x: f64, y: f64| {
        let (column, row) = ((x - left) / width * w, (bottom + height - y) / height * h);
        pixels[row as usize * page.pixels[0] as usize + column as usize][3]
    };
    for i in 0..3 {
        let x = 4.0 * f64::from(i);
        assert_eq!([opacity(x, 1.0), opacity(x, 5.9), opacity(x + 2.0, 3.0)], [255, 255, 0]);
    }
    // The same in one mesh, where every module of every plant is a group.
    let mesh = String::from_utf8(FrameWriter::new(Format::OBJ, fit).write(&scene, "")).expect("UTF-8");
    assert_eq!(mesh.matches("\ng F.").count(), 6, "{}", &mesh[..400]);
}

/// Stems of plants that stand on the scene's floor widen towards it, in pixels as in meshes; those above it do not.
#[test]
fn plants_on_a_floor_have_feet() {
    let mut scene = row(scene("!(0.5)F(3)"), 2, 4.0);
    scene.surroundings.floor = Some(0.0);
    scene.plants[1].placement.origin.y = 0.1;
    let fit = fit(&scene, "front");
    let page = Page::new(fit.picture, Size::Width(600), None).expect("small");
    let pixels = pixels_by(&scene, &fit, &page, Smoothness::Fine, 1);
    let [left, bottom, width, height] = page.picture.area;
    let [w, h] = page.pixels.map(f64::from);
    let is_drawn = |x: f64, y: f64| {
        let (column, row) = ((x - left) / width * w, (bottom + height - y) / height * h);
        pixels[row as usize * page.pixels[0] as usize + column as usize][3] == 255
    };
    // Beside the stem, of radius 0.5, and just above its lower end.
    let beside = [(0.56, 0.03), (0.56, 2.0), (4.56, 0.13), (4.0, 0.13)].map(|(x, y)| is_drawn(x, y));
    assert_eq!(beside, [true, false, false, true]);
    let mesh = String::from_utf8(FrameWriter::new(Format::OBJ, fit).write(&scene, "")).expect("UTF-8");
    let stems = mesh.lines().filter_map(|line| {
        let mut numbers = line.strip_prefix("v ")?.split(' ').filter_map(|number| number.parse::<f64>().ok());
        Some([numbers.next()?, numbers.next()?])
    });
    let widest = |from: f64, to: f64| {
        let near = stems.clone().filter(|[x, y]| (from..to).contains(x) && (-0.01..0.2).contains(y));
        near.fold(f64::MIN, |most, [x, _]| most.max(x))
    };
    assert!(
        widest(-1.0, 1.0) > 0.57 && widest(3.0, 5.0) < 4.51,
        "{} {}",
        widest(-1.0, 1.0),
        widest(3.0, 5.0)
    );
}

#[test]
fn detail_follows_the_picture_but_never_the_mesh() {
    let plant = scene("!(0.1)F(1)[+(40)@K(0.5)]F(1)@L(0.7)");
    let mut survey = Survey::new(View::FRONT);
    survey.add(&plant);
    let mesh = |width| {
        let mut writer = FrameWriter::new(Format::OBJ, survey.fit());
        writer.page = Page::new(writer.fit.picture, Size::Width(width), None).expect("small");
        writer.write(&plant, "")
    };
    assert!(mesh(20) == mesh(2000));
}

#[test]
fn flags_say_what_is_wrong_with_them() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("out");
    let out = out.to_str().expect("UTF-8");
    let render =
        ["render", "models/campanula.dls", "-o", out, "--at", "20", "--format", "png", "--width", "60"];
    for (flags, message) in [
        (&["--camera", "1,2/0,0,0"][..], "expected eye/aim"),
        (&["--camera", "1,2,3/1,2,3"], "must be different"),
        (&["--camera", "1,2,3/0,0,0/200"], "between 1 and 120"),
        (&["--light", "0,0,0"], "not all 0"),
        (&["--sky", "#ffffff"], "two colours"),
        (&["--zoom", "0"], "from 0.001"),
    ] {
        let (_, said) = bad(&[&render, flags].concat());
        assert!(said.contains(message), "{said}");
    }
    let flags =
        ["--camera", "20,20,90/0,20,0/40", "--zoom", "2", "--light", "1,2,1", "--sky", "#6fa3e0,#e8f0f8"];
    good(&[&render[..], &flags].concat());
    assert!(
        bad(&[&render[..6], &["--format", "obj", "--light", "1,2,1"]].concat()).1.contains("for pictures")
    );
}

#[test]
fn the_sky_is_behind_everything() {
    let mut scene = squares();
    scene.surroundings.sky = Some([Color::hex(0x0000ff), Color::hex(0xffffff)]);
    let svg = String::from_utf8(FrameWriter::new(Format::SVG, fit(&scene, "30,-70")).write(&scene, ""))
        .expect("UTF-8");
    let has = |text: &str| assert!(svg.contains(text), "{text}: {}", &svg[..600.min(svg.len())]);
    has("fill=\"url(#sky)\"");
    has("stop-color=\"#0000ff\"");
}

/// Frames of a grid stand on one floor, each with its whole shadow: at the rims of the frames there is nothing to be seen.
#[test]
fn frames_of_a_grid_stand_on_one_floor() {
    let mut scene = pole();
    scene.surroundings.sky = Some([Color::hex(0x6fa3e0), Color::hex(0xe8f0f8)]);
    scene.surroundings.floor_color = Some(Color::hex(0x7f9a4e));
    let mut survey = Survey::new("0,30".parse().expect("a view"));
    survey.add(&scene);
    let fit = survey.fit();
    let sheet = Sheet::new(Layout::Grid, &fit, &[survey.clone(), survey], &[], Spacing::default());
    let page = Page::new(sheet.picture, Size::Larger(600), Some(Page::BACKGROUND)).expect("small");
    let writer = SheetWriter::new(Format::PNG, fit, sheet, page).expect("a picture");
    let mut assembly = writer.begin();
    for frame in 0..2 {
        assembly.add(writer.part(frame, &scene).expect("room")).expect("short");
    }
    let file = assembly.finish("poles");
    let mut reader = png::Decoder::new(std::io::Cursor::new(file)).read_info().expect("PNG");
    let mut data = vec![0; reader.output_buffer_size().expect("small")];
    reader.next_frame(&mut data).expect("a picture");
    let width = writer.page().pixels[0] as usize;
    let green: Vec<i32> = data.chunks_exact(3).map(|rgb| i32::from(rgb[1])).collect();
    let rows: Vec<&[i32]> = green.chunks_exact(width).collect();
    assert!(rows[0].iter().chain(rows[rows.len() - 1]).all(|green| (green - 154).abs() <= 1), "one floor");
    // What is darker than that changes slowly, but for the shadow's own edge and the pole, in both halves alike.
    let dark = |columns: std::ops::Range<usize>| {
        rows.iter().flat_map(|row| &row[columns.clone()]).filter(|green| **green < 130).count()
    };
    let (left, right) = (dark(0..width / 2), dark(width / 2..width));
    assert!(left > 500 && left.abs_diff(right) < left / 20, "{left} {right}");
    let edges = |row: &&&[i32]| row.windows(2).filter(|pair| (pair[0] - pair[1]).abs() > 8).count();
    let most = rows.iter().map(|row| edges(&row)).max().unwrap_or_default();
    assert!(most <= 24, "{most} edges in a row");
}
