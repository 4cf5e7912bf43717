//! The first pass over an animation, which finds what its frames share: scale, picture area, default width, camera, light.

use std::borrow::Cow;

use super::camera::Camera;
use super::crowd::Crowd;
use super::extent::{Extent, Shadow};
use super::light::Light;
use super::tube::TubeStyle;
use super::{Page, View, number, painter};
use dlsys_geometry::scene::{Bounds, Point, Scene, Surroundings, Viewpoint, Widest, Width, sin_cos_degrees};

/// Drawings less deep than this part of their extent are flat.
const FLAT: f64 = 1e-6;

/// The first pass: the extent of an animation, in space and in its view.
#[derive(Clone, Debug)]
pub struct Survey {
    view: View,
    /// Field of view in degrees; `None`: orthographic.
    field: Option<f64>,
    space: Bounds,
    seen: Extent,
    crowd: Crowd,
    has_one_width: bool,
    /// What flags declare in place of the model.
    declared: Surroundings,
    zoom: f64,
    /// Cameras that the model declares count.
    follows_cameras: bool,
    has_camera: bool,
    /// What is seen is a profile, which turns.
    turns: bool,
    /// There are pictures on surfaces, or ground that gives way: these are seen as they are also where plants have no depth, or nothing is drawn.
    has_solids: bool,
    pub(super) has_soil: bool,
    /// A sun, a sky or a floor is declared: what has no depth is no diagram then, but stands in that light.
    is_lit: bool,
    /// The surroundings of the first frame.
    first: Option<Surroundings>,
    widest: Option<Widest>,
}

impl Survey {
    /// An empty survey, orthographic, in this view.
    pub fn new(view: View) -> Survey {
        Survey {
            view,
            field: None,
            space: Bounds::default(),
            seen: Extent::EMPTY,
            crowd: Crowd::default(),
            has_one_width: false,
            declared: Surroundings::default(),
            zoom: 1.0,
            follows_cameras: true,
            has_camera: false,
            turns: false,
            has_solids: false,
            has_soil: false,
            is_lit: false,
            first: None,
            widest: None,
        }
    }

    /// With these surroundings in place of those that the model declares; what is `None` stays the model's.
    pub fn with_surroundings(self, declared: Surroundings) -> Survey {
        Survey { declared, ..self }
    }

    /// Magnified about the middle of the picture, at least a thousandth and at most a million times.
    pub fn with_zoom(self, zoom: f64) -> Survey {
        Survey { zoom: if zoom.is_nan() { 1.0 } else { zoom.clamp(1e-3, 1e6) }, ..self }
    }

    /// In its own view, whatever cameras the model declares.
    pub fn without_cameras(self) -> Survey {
        Survey { follows_cameras: false, ..self }
    }

    /// In perspective: the camera is as near as possible if all that is drawn in any frame is within this angle, in degrees (clamped
    /// to [`Camera::FIELDS`]).
    pub fn with_perspective(self, field: f64) -> Survey {
        Survey { field: Some(field), ..self }
    }

    /// On a turntable: the plant fits into the picture from all azimuths ([`Fit::turned`]).
    pub fn on_a_turntable(self) -> Survey {
        Survey { turns: true, ..self }
    }

    /// With one width for all lines, whatever the model says; [`fit_of_width`](Survey::fit_of_width) takes it.
    pub fn with_one_width(self) -> Survey {
        Survey { has_one_width: true, ..self }
    }

    /// Includes the scene of a frame. The result does not depend on the order.
    pub fn add(&mut self, scene: &Scene) {
        let scene = &*if self.has_one_width { Cow::Owned(of_one_width(scene)) } else { Cow::Borrowed(scene) };
        self.space.add(scene);
        let around = joined(&self.declared, &scene.surroundings);
        self.first.get_or_insert_with(|| around.clone());
        self.has_camera |= around.camera.is_some() && self.follows_cameras;
        self.seen.merge(&if self.turns { Extent::profile(scene) } else { Extent::of(scene, &self.view) });
        self.is_lit |= around.sun.is_some() || around.sky.is_some() || around.floor.is_some();
        self.has_solids |= scene.palette.has_textures() || scene.terrain.is_some();
        self.has_soil |= scene.terrain.is_some();
        self.note_widest(scene.widest);
        self.crowd.merge(Crowd::of(scene));
    }

    /// Includes another survey in the same view, of later frames, for example that of another thread.
    pub fn merge(&mut self, other: &Survey) {
        self.space.merge(&other.space);
        self.crowd.merge(other.crowd);
        self.has_camera |= other.has_camera;
        self.has_solids |= other.has_solids;
        self.has_soil |= other.has_soil;
        self.is_lit |= other.is_lit;
        if self.first.is_none() {
            self.first.clone_from(&other.first);
        }
        self.note_widest(other.widest);
        self.seen.merge(&other.seen);
    }

    /// The widest of all; of some that are alike that of the earliest frame.
    fn note_widest(&mut self, other: Option<Widest>) {
        let rank = |widest: &Widest| (widest.width, -widest.time);
        if let Some(other) = other
            && self.widest.is_none_or(|known| rank(&other) > rank(&known))
        {
            self.widest = Some(other);
        }
    }

    /// The widest stem and the extent of all points, in scene units, if `!` makes it wider than half of that: hardly meant, as widths are lengths.
    pub fn too_wide(&self) -> Option<(Widest, f64)> {
        let extent = self.space.extent();
        self.widest
            .filter(|widest| extent > 0.0 && widest.width > 0.5 * extent)
            .map(|widest| (widest, extent))
    }

    /// The surroundings of the first frame.
    pub fn first_surroundings(&self) -> Surroundings {
        self.first.clone().unwrap_or_default()
    }

    /// The values that all frames share. Lines to which the model gives no width have a fixed part of the extent, or less where they are
    /// crowded.
    pub fn fit(&self) -> Fit {
        self.fit_of_width(self.crowd.default_width(&self.space))
    }

    /// Outlines around everything, from all azimuths on a turntable.
    fn shadow(&self, default_width: f64) -> Option<Shadow> {
        let shadow = self.seen.shadow(default_width)?;
        Some(if self.turns { Shadow::of_profile(&shadow, &self.view) } else { shadow })
    }

    /// The values that all frames share if lines of default width are this wide, in scene units.
    pub fn fit_of_width(&self, default_width: f64) -> Fit {
        let usual = self.space.default_width();
        let extent = self.space.extent();
        let bounds = self.space.corners(default_width);
        // Where stems are wider than everything is long, their width is what there is to see.
        let whole = bounds.map_or(0.0, |[low, high]| (high - low).max());
        let size = extent.max(whole - extent);
        let shadow = self.shadow(default_width);
        let camera = match (self.field, &shadow) {
            (Some(field), Some(shadow)) => Camera::perspective(self.view, field, shadow),
            _ => Camera::orthographic(self.view),
        };
        let depth = match &shadow {
            Some(shadow) if self.turns => Some(shadow.x.depth()),
            _ => self.seen.depth(),
        };
        let depths = depth.unwrap_or_default().map(|z| camera.depth(z));
        Fit {
            camera,
            default_width,
            extent,
            accuracy: size * Fit::ACCURACY,
            bounds,
            picture: match self.has_camera {
                true => Picture::of([-0.5 * CAMERA_SHAPE, -0.5, CAMERA_SHAPE, 1.0]),
                false => Picture::around(shadow.map(|shadow| camera.frame(&shadow))).magnified(self.zoom),
            },
            light: Light::new(depths, extent, self.is_lit),
            meshes: (usual, self.space.corners(usual)),
            has_one_width: self.has_one_width,
            has_regions: depths[1] - depths[0] > FLAT * extent || self.has_solids || self.is_lit,
            declared: self.declared.clone(),
            zoom: self.zoom,
            follows_cameras: self.follows_cameras,
            turn: 0.0,
            shaded: None,
        }
    }
}

/// The values that all frames of an animation share.
#[derive(Clone, Debug, PartialEq)]
pub struct Fit {
    /// The camera that sees all frames.
    pub camera: Camera,
    /// Width of a line of default width, in scene units.
    pub default_width: f64,
    /// Largest side of the box around all points of all frames, in scene units; 0 if nothing is drawn.
    pub extent: f64,
    /// Greatest distance of meshes and outlines from curved surfaces and round stems, in scene units; a fixed part of
    /// the extent by default.
    pub accuracy: f64,
    /// Opposite corners of the box around everything; `None` if nothing is drawn.
    pub bounds: Option<[Point; 2]>,
    /// The picture area of the view.
    pub picture: Picture,
    pub(super) light: Light,
    /// The default width of lines in meshes, and the box around everything.
    meshes: (f64, Option<[Point; 2]>),
    /// All lines have the default width.
    has_one_width: bool,
    /// Its depth is more than rounding, or there are pictures on surfaces, ground that gives way, or declared light.
    has_regions: bool,
    declared: Surroundings,
    zoom: f64,
    follows_cameras: bool,
    /// By how many degrees cameras have gone round.
    turn: f64,
    /// The part of what the camera sees in which the floor has shades: left, bottom, right and top. `None`: all of it.
    pub(super) shaded: Option<[f64; 4]>,
}

/// The shape of pictures of declared cameras: width by height.
pub const CAMERA_SHAPE: f64 = 1.5;

/// Surroundings of flags, and those of a scene where there are none.
fn joined(flags: &Surroundings, scene: &Surroundings) -> Surroundings {
    Surroundings {
        sun: flags.sun.or(scene.sun),
        sky: flags.sky.or(scene.sky),
        camera: flags.camera.or(scene.camera),
        floor: flags.floor.or(scene.floor),
        floor_color: flags.floor_color.or(scene.floor_color),
    }
}

impl Fit {
    /// The default accuracy, in parts of the extent: half a pixel of a picture of a thousand.
    pub const ACCURACY: f64 = 1.0 / 2000.0;

    /// An accuracy in scene units, limited to what the last digits of coordinates can show.
    pub fn with_accuracy(self, accuracy: f64) -> Fit {
        /// Coordinates in files have the resolution of a millionth of the extent.
        const FINEST: f64 = 5e-7;
        let size = self.accuracy / Fit::ACCURACY;
        Fit { accuracy: accuracy.max(size * FINEST), ..self }
    }

    /// The same for pictures on a page, in these surroundings: what a camera shows large, or a flag magnifies, is not coarser for what is far
    /// away and makes the extent large, such as petals that the wind has taken.
    pub fn for_pictures(self, around: &Surroundings, page: &Page) -> Fit {
        /// Pixels that the accuracy may be, and those that it becomes where it is more.
        const MOST: f64 = 0.75;
        const WANTED: f64 = 0.35;
        let smaller = around.camera.filter(|_| self.follows_cameras).map(|at| self.smaller_side(&at));
        let side = f64::from(page.pixels[0].min(page.pixels[1]));
        let pixels = smaller.map_or_else(|| page.pixels_per_unit(), |smaller| side / smaller);
        let is_coarse = pixels.is_finite() && self.accuracy * pixels > MOST;
        let accuracy = if is_coarse { WANTED / pixels } else { self.accuracy };
        Fit { accuracy, ..self }
    }

    /// The smaller side of what a declared camera sees in its plane of focus.
    fn smaller_side(&self, at: &Viewpoint) -> f64 {
        let slope = (at.angle.clamp(*Camera::FIELDS.start(), *Camera::FIELDS.end()) / 2.0).to_radians().tan();
        2.0 * (at.eye - at.aim).norm() * slope / self.zoom
    }

    /// The same for a camera that has gone round the axis y by this angle, in degrees from the front towards the side: cameras of flags and of the model round the vertical axis through their aim.
    /// After [`Survey::on_a_turntable`], everything fits into the picture.
    pub fn turned(self, degrees: f64) -> Fit {
        Fit { camera: self.camera.turned(degrees), turn: self.turn + degrees, ..self }
    }

    /// The same for meshes: lines of default width have a fixed part of the extent, however crowded they are.
    pub(super) fn of_meshes(self) -> Fit {
        let (default_width, bounds) = self.meshes;
        Fit { default_width, bounds, ..self }
    }

    /// A scene as it is drawn: with one width for all lines, if that was asked for.
    pub(super) fn drawn<'s>(&self, scene: Cow<'s, Scene>) -> Cow<'s, Scene> {
        if self.has_one_width { Cow::Owned(of_one_width(&scene)) } else { scene }
    }

    /// Opposite corners of the box around one scene, lines having their width.
    pub fn bounds_of(&self, scene: &Scene) -> Option<[Point; 2]> {
        Bounds::of(&self.drawn(Cow::Borrowed(scene))).corners(self.default_width)
    }

    /// True if SVG pictures are made of visible regions: the animation has depth, or there are pictures on surfaces, ground that gives way, or declared light. Without depth nothing is hidden,
    /// and every element keeps its exact shape.
    pub(super) fn has_visible_regions(&self) -> bool {
        self.has_regions
    }

    /// Whether stems join as if they had grown: in drawings with depth or declared light; others are diagrams.
    pub fn is_grown(&self) -> bool {
        !self.light.is_flat()
    }

    /// How stems become tubes. Without depth and declared light they are lines of a diagram, and their joints keep their shape.
    pub(super) fn tubes(&self) -> TubeStyle {
        let Fit { default_width, accuracy, .. } = *self;
        TubeStyle { default_width, sides: 0, accuracy, grown: self.is_grown(), floor: None, steady: false }
    }

    /// The surroundings of a frame: those of flags, and those that its scene declares.
    pub(super) fn surroundings(&self, scene: &Scene) -> Surroundings {
        joined(&self.declared, &scene.surroundings)
    }

    /// The middle of everything, and the extent, which is not 0.
    pub(super) fn middle(&self) -> (Point, f64) {
        let middle = self.bounds.map_or_else(Point::origin, |[low, high]| nalgebra::center(&low, &high));
        (middle, if self.extent > 0.0 { self.extent } else { 1.0 })
    }

    /// The fit and the page of one frame, which differ from the others where a camera is declared.
    pub fn for_frame(&self, scene: &Scene, page: &Page) -> (Fit, Page) {
        let declared = self.surroundings(scene).camera.filter(|_| self.follows_cameras);
        let camera = declared.and_then(|mut at| {
            if self.turn != 0.0 {
                let (sin, cos) = sin_cos_degrees(self.turn);
                let away = at.eye - at.aim;
                at.eye.x = at.aim.x + away.x * cos + away.z * sin;
                at.eye.z = at.aim.z + away.z * cos - away.x * sin;
            }
            Some((Camera::at(at.eye, at.aim)?, at))
        });
        let Some((camera, at)) = camera else { return (self.clone(), *page) };
        let [width, height] = page.pixels.map(f64::from);
        let smaller = self.smaller_side(&at);
        let [w, h] = [width, height].map(|side| smaller * side / width.min(height));
        let aim = camera.project(at.aim);
        let picture = Picture::of([aim.x - w / 2.0, aim.y - h / 2.0, w, h]);
        (Fit { camera, picture, ..self.clone() }, Page { picture, ..*page })
    }

    /// Left, bottom, right and top of a survey as this camera sees it; `None` if it is empty.
    pub(super) fn frame_of(&self, survey: &Survey) -> Option<[f64; 4]> {
        survey.seen.shadow(self.default_width).map(|shadow| self.camera.frame(&shadow))
    }

    /// The same with the shade on the floor, as far as it is to be seen.
    pub(super) fn shaded_frame_of(&self, survey: &Survey) -> Option<[f64; 4]> {
        /// How far around a plant it darkens the floor, and the longest shadow, in parts of its height above the floor.
        const AROUND: f64 = 0.3;
        const LONGEST: f64 = 2.5;
        let frame = self.frame_of(survey)?;
        let around = survey.first_surroundings();
        let Some(([low, high], floor)) =
            survey.space.corners(self.default_width).zip(around.floor).filter(|_| !self.light.is_flat())
        else {
            return Some(frame);
        };
        let height = (high.y - floor).max(0.0);
        let shift = around.sun.filter(|sun| sun.y > 0.0).map_or([0.0; 2], |sun| {
            let long = (sun.x.hypot(sun.z) / sun.y).max(f64::MIN_POSITIVE);
            [sun.x, sun.z].map(|x| -x / sun.y * height * (LONGEST / long).min(1.0))
        });
        let reach = AROUND * height;
        let ends =
            |low: f64, high: f64, shift: f64| [low - reach + shift.min(0.0), high + reach + shift.max(0.0)];
        let (xs, zs) = (ends(low.x, high.x, shift[0]), ends(low.z, high.z, shift[1]));
        let corners: Vec<_> =
            (xs.into_iter()).flat_map(|x| zs.map(|z| self.camera.project(Point::new(x, floor, z)))).collect();
        // A floor that is seen along itself shows no shade.
        let heights = corners.iter().map(|at| at.y);
        let tall = heights.clone().fold(f64::MIN, f64::max) - heights.fold(f64::MAX, f64::min);
        if tall <= 1e-9 * (high.x - low.x).max(high.z - low.z) {
            return Some(frame);
        }
        Some(corners.into_iter().fold(frame, |[left, bottom, right, top], at| {
            [left.min(at.x), bottom.min(at.y), right.max(at.x), top.max(at.y)]
        }))
    }

    /// The same for one of several pictures on a sheet: this part of what the camera sees, left, bottom, right and top. The shade on the
    /// floor fades towards its rim.
    pub(super) fn for_cell(&self, [left, bottom, right, top]: [f64; 4]) -> Fit {
        let picture = Picture::of([left, bottom, right - left, top - bottom]);
        Fit { picture, shaded: Some([left, bottom, right, top]), ..self.clone() }
    }
}

/// A scene whose lines have the default width, but for those that have none.
fn of_one_width(scene: &Scene) -> Scene {
    let mut scene = scene.clone();
    for segment in &mut scene.segments {
        if segment.widths.iter().any(|width| width.resolve(1.0) > 0.0) {
            segment.widths = [Width::Default(1.0); 2];
        }
    }
    scene
}

/// The picture area: a rectangle of what the camera sees, and the scale at which it is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Picture {
    /// Left, bottom, width and height, in scene units of the plane of focus.
    pub area: [f64; 4],
    /// Picture units in one scene unit: a power of ten such that the larger side of the area is between 100
    /// and 1000 picture units. Numbers stay short, and lengths can still be read from them.
    pub scale: f64,
}

impl Picture {
    /// Margin on each side, in parts of the larger side of what is drawn.
    const MARGIN: f64 = 0.04;
    /// Least ratio of the smaller side to the larger one, so that the picture of a filament has a useful shape.
    const SLIMMEST: f64 = 0.2;

    /// The area around what is drawn: left, bottom, right and top.
    pub(super) fn around(frame: Option<[f64; 4]>) -> Picture {
        let [left, bottom, right, top] = frame.unwrap_or([-0.5, -0.5, 0.5, 0.5]);
        let (width, height) = (right - left, top - bottom);
        let larger = match width.max(height) {
            larger if larger > 0.0 => larger,
            _ => 1.0,
        };
        let side = |length: f64| length.max(larger * Picture::SLIMMEST) + 2.0 * Picture::MARGIN * larger;
        let (w, h) = (side(width), side(height));
        Picture::of([(left + right - w) / 2.0, (bottom + top - h) / 2.0, w, h])
    }

    /// Of an area, at the scale that suits it.
    fn of(area: [f64; 4]) -> Picture {
        let scale = 10_f64.powi(2 - area[2].max(area[3]).log10().floor() as i32);
        Picture { area, scale }
    }

    /// A part of it about its middle, drawn so many times as large.
    fn magnified(&self, zoom: f64) -> Picture {
        let [left, bottom, width, height] = self.area;
        let (w, h) = (width / zoom, height / zoom);
        Picture::of([left + (width - w) / 2.0, bottom + (height - h) / 2.0, w, h])
    }

    /// Widened on both sides, or above and below, to this ratio of width to height.
    pub(super) fn shaped(&self, ratio: f64) -> Picture {
        let [left, bottom, width, height] = self.area;
        let (w, h) = (width.max(height * ratio), height.max(width / ratio));
        Picture::of([left - (w - width) / 2.0, bottom - (h - height) / 2.0, w, h])
    }

    /// `viewBox` of an SVG: left, top, width and height in picture units, y going down.
    pub fn view_box(&self) -> [f64; 4] {
        let [left, bottom, width, height] = self.area;
        [left, -(bottom + height), width, height].map(|x| number::rounded(x * self.scale, painter::DECIMALS))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dlsys_geometry::scene::{MaterialId, Owner, Polygon, Vector};
    use dlsys_tree::Lineage;

    #[test]
    fn a_turntable_has_room_for_all_azimuths_and_little_more() {
        let mut scene = Scene::default();
        let owner = scene.add_owner(Owner { name: "P".into(), lineage: Lineage::of_axiom(0) });
        let vertices =
            [[0.2, 0.0, 0.1], [3.0, 1.0, 0.5], [-1.0, 4.0, -2.5], [0.0, 5.0, 0.3]].map(Point::from).to_vec();
        scene.polygons.push(Polygon { vertices, material: MaterialId::LEAF, owner });
        for (view, field) in
            [("front", None), ("30,20", None), ("-70,-50", None), ("top", None), ("10,15", Some(50.0))]
        {
            let view: View = view.parse().expect("a view");
            let survey = Survey::new(view).on_a_turntable();
            let mut survey = match field {
                Some(field) => survey.with_perspective(field),
                None => survey,
            };
            survey.add(&scene);
            let fit = survey.fit();
            let [left, bottom, width, height] = fit.picture.area;
            let margin = Picture::MARGIN / (1.0 + 2.0 * Picture::MARGIN) * width.max(height);
            let mut reached = [f64::INFINITY; 4];
            for degrees in 0..360 {
                let turned = fit.clone().turned(f64::from(degrees));
                assert_eq!(turned.picture, fit.picture);
                for p in scene.polygons[0].vertices.iter().map(|p| turned.camera.project(*p)) {
                    let room = [p.x - left, left + width - p.x, p.y - bottom, bottom + height - p.y];
                    reached = [0, 1, 2, 3].map(|i| reached[i].min(room[i]));
                }
            }
            assert!(
                reached.iter().all(|room| *room > 0.999 * margin),
                "{view}: {reached:?}, margin {margin}"
            );
            assert!(
                reached[..2].iter().all(|room| *room < margin + 0.05 * width),
                "{view}: {reached:?}, margin {margin}"
            );
        }
    }

    #[test]
    fn declared_cameras_go_round_their_aim() {
        let mut scene = Scene::default();
        let at = Viewpoint { eye: Point::new(1.0, 2.0, 9.0), aim: Point::new(1.0, 1.0, 4.0), angle: 40.0 };
        scene.surroundings.camera = Some(at);
        let mut survey = Survey::new(View::FRONT).on_a_turntable();
        survey.add(&scene);
        let page = Page::new(survey.fit().picture, crate::Size::default(), None).expect("a page");
        let (fit, _) = survey.fit().turned(90.0).for_frame(&scene, &page);
        assert!((fit.camera.view().towards() - Vector::new(5.0, 1.0, 0.0).normalize()).norm() < 1e-12);
        // Its aim stays in the middle of the picture.
        let (before, _) = survey.fit().for_frame(&scene, &page);
        let middle = |fit: &Fit| {
            let [left, bottom, width, height] = fit.picture.area;
            let aim = fit.camera.project(at.aim);
            [aim.x - left - width / 2.0, aim.y - bottom - height / 2.0]
        };
        assert!([middle(&fit), middle(&before)].iter().flatten().all(|x| x.abs() < 1e-9));
    }

    /// What lies a thousand times as far away as the camera sees does not make what it sees coarse.
    #[test]
    fn a_camera_asks_for_its_own_accuracy() {
        let mut scene = Scene::default();
        let owner = scene.add_owner(Owner { name: "P".into(), lineage: Lineage::of_axiom(0) });
        let vertices = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 2000.0]].map(Point::from).to_vec();
        scene.polygons.push(Polygon { vertices, material: MaterialId::LEAF, owner });
        let fit_of = |scene: &Scene, view: View| {
            let mut survey = Survey::new(view);
            survey.add(scene);
            let fit = survey.fit();
            let page = Page::new(fit.picture, crate::Size::Exact(600, 400), None).expect("a page");
            (fit.clone().for_pictures(&survey.first_surroundings(), &page).accuracy, fit.accuracy)
        };
        let (chosen, usual) = fit_of(&scene, View::new(90.0, 0.0).expect("a view"));
        assert_eq!((chosen, usual), (1.0, 1.0), "all is seen");
        scene.surroundings.camera =
            Some(Viewpoint { eye: Point::new(0.0, 0.0, 5.0), aim: Point::origin(), angle: 40.0 });
        let (chosen, _) = fit_of(&scene, View::FRONT);
        // 400 pixels are 3.6 units.
        assert!((0.002..0.005).contains(&chosen), "{chosen}");
    }

    #[test]
    fn pictures_have_a_margin_and_a_shape() {
        let picture = Picture::around(Some([0.0, 0.0, 50.0, 0.0]));
        assert_eq!(picture.area, [-2.0, -7.0, 54.0, 14.0]);
        assert_eq!(picture.scale, 10.0);
        assert_eq!(picture.view_box(), [-20.0, -70.0, 540.0, 140.0]);
        assert_eq!(picture.shaped(1.0).area, [-2.0, -27.0, 54.0, 54.0]);
        let nothing = Picture::around(None);
        assert!(nothing.area[2] > 0.0);
        assert_eq!(Survey::new(View::FRONT).fit().bounds, None);
    }
}
