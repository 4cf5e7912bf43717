//! The elements of an SVG picture, from back to front.
//!
//! An animation with depth is drawn by its visible regions ([`trace`]). In flat ones stems are strokes with round ends, polygons
//! and the triangles of surfaces are filled paths. All elements are drawn in string order.
//!
//! In a picture of one frame every element has an id that lasts from frame to frame: the name of its module,
//! `KIND-LINEAGE`, for the first that a module draws, then `KIND-LINEAGE.2` and so on. Where many frames share a picture,
//! elements have no names, and neighbours of the same look are one path.

use std::fmt::Write;

use rustc_hash::FxHashMap;

use super::name::Names;
use super::stroke::{Stroke, Strokes, is_thin};
use super::{Fit, number, trace, triangulate};
use dlsys_geometry::scene::{
    Color, Face, MaterialId, OwnerId, Point, Polygon, Scene, Segment, Surface, Vector,
};

/// Decimals of a coordinate. The larger side of a picture is 100 to 1000 units, so the last digit is a
/// millionth to a hundred-thousandth of it.
pub(super) const DECIMALS: usize = 3;
/// Decimals of a corner of a surface: a built-in flower has hundreds, and they are most of a file.
const SURFACE_DECIMALS: usize = 2;
/// Steps in which the strength of light is rounded.
pub(super) const SHADES: f64 = 40.0;

/// The values that the pictures of several frames share.
#[derive(Clone, Copy)]
pub(super) struct Style<'a> {
    pub(super) fit: &'a Fit,
    /// Picture units in a scene unit.
    pub(super) scale: f64,
    /// Pixels of the page in a scene unit.
    pub(super) pixels: f64,
    /// The colour behind everything.
    pub(super) background: Option<Color>,
    /// The material of the floor.
    pub(super) floor: Option<MaterialId>,
    /// What casts shadows, if it is not the scene that is drawn: that with its plants.
    pub(super) casting: Option<&'a Scene>,
    /// Threads that make shadows, at least 1.
    pub(super) threads: usize,
    /// Memory that is kept from frame to frame.
    pub(super) memory: Option<&'a trace::Memory>,
}

/// The elements of a scene, one a line. Names are those of modules; without them the elements have none, and `prefix`
/// begins the ids of gradients, which must differ in a document.
pub(super) fn elements(scene: &Scene, style: Style, named: bool, prefix: &str) -> String {
    let scene = &*scene.flattened();
    // The look must not change within an animation, so this does not depend on the frame.
    if style.fit.has_visible_regions() {
        return trace::elements(scene, None, style, named, prefix);
    }
    let names = named.then(|| Names::new(scene, '-'));
    let mut painter = Painter {
        scene,
        style,
        names,
        // Nameless ones of one look are one path; of wide ones the ends matter little, and they stay lines.
        strokes: Strokes::new(scene, style, prefix, |a, b| {
            let [a, b] = [&scene.segments[a], &scene.segments[b]];
            a.material != b.material || (named && is_thin(a, style) && is_thin(b, style))
        }),
        run: None,
        out: String::new(),
    };
    painter.paint();
    let definitions = painter.strokes.definitions();
    if definitions.is_empty() {
        return painter.out;
    }
    ["<defs>\n", &definitions, "</defs>\n", &painter.out].concat()
}

/// An element of the scene, by kind and index.
#[derive(Clone, Copy)]
enum Thing {
    Segment(usize),
    Polygon(usize),
    Surface(usize),
}

/// A thing in painter's order.
struct Layer {
    /// Towards the viewer, in steps too small to see, so that rounding does not shuffle a flat plant.
    depth: f64,
    owner: OwnerId,
    /// Which one of its owner's it is, from 1.
    ordinal: u32,
    thing: Thing,
}

struct Painter<'a> {
    scene: &'a Scene,
    style: Style<'a>,
    names: Option<Names<'a>>,
    strokes: Strokes<'a>,
    /// Attributes and data of the nameless path that is being gathered.
    run: Option<(String, String)>,
    out: String,
}

impl Painter<'_> {
    fn paint(&mut self) {
        let mut id = String::new();
        for layer in self.layers() {
            id.clear();
            if let Some(names) = &self.names {
                id.push_str(" id=\"");
                names.push(&mut id, layer.owner);
                if layer.ordinal > 1 {
                    let _ = write!(id, ".{}", layer.ordinal);
                }
                id.push('"');
            }
            match layer.thing {
                Thing::Segment(i) => self.segment(&self.scene.segments[i], i, &id),
                Thing::Polygon(i) => self.polygon(&self.scene.polygons[i], &id),
                Thing::Surface(i) => self.surface(&self.scene.surfaces[i], &id),
            }
        }
        self.end_run();
    }

    /// Everything, from back to front. A line that a later one covers from end to end is left out: where edges are smoothed
    /// twice they are darker.
    fn layers(&self) -> Vec<Layer> {
        let fit = self.style.fit;
        let quantum = 1e-9 * if fit.extent > 0.0 { fit.extent } else { 1.0 };
        let depth = |p: Point| (fit.camera.project(p).z / quantum).round();
        let mut ordinals = vec![0_u32; self.scene.owners().len()];
        let mut layers = Vec::new();
        let covered = self.covered();
        let mut add = |owner: OwnerId, depth: f64, thing: Thing| {
            let ordinal = &mut ordinals[owner.index()];
            *ordinal += 1;
            if !matches!(thing, Thing::Segment(i) if covered[i]) {
                layers.push(Layer { depth, owner, ordinal: *ordinal, thing });
            }
        };
        for (i, s) in self.scene.segments.iter().enumerate() {
            add(s.owner, depth(nalgebra::center(&s.start, &s.end)), Thing::Segment(i));
        }
        for (i, p) in self.scene.polygons.iter().enumerate() {
            add(p.owner, depth(middle(&p.vertices)), Thing::Polygon(i));
        }
        for (i, s) in self.scene.surfaces.iter().enumerate() {
            add(s.owner, depth(s.placement.point(middle(&s.mesh.vertices))), Thing::Surface(i));
        }
        // Stable: a module's own things stay in the order in which they were entered.
        layers.sort_by(|a, b| a.depth.total_cmp(&b.depth).then(a.owner.cmp(&b.owner)));
        layers
    }

    /// For each segment whether a later one between the same ends is no thinner.
    fn covered(&self) -> Vec<bool> {
        let Style { fit, scale, .. } = self.style;
        let place = |p: Point| {
            let p = self.style.project(p);
            // In steps too small to see.
            [p.x, p.y].map(|x| (x * 1e3).round() as i64)
        };
        let width = |s: &Segment, k: usize| (s.widths[k].resolve(fit.default_width) * scale * 1e3).round();
        let mut last: FxHashMap<[[i64; 2]; 2], [f64; 2]> = FxHashMap::default();
        let mut covered = vec![false; self.scene.segments.len()];
        for (i, s) in self.scene.segments.iter().enumerate().rev() {
            let mut ends = [(place(s.start), width(s, 0)), (place(s.end), width(s, 1))];
            ends.sort_by_key(|(at, _)| *at);
            let widths = ends.map(|(_, width)| width);
            let over = last.entry(ends.map(|(at, _)| at)).or_insert([-1.0; 2]);
            covered[i] = over[0] >= widths[0] && over[1] >= widths[1];
            if !covered[i] {
                *over = widths;
            }
        }
        covered
    }

    fn segment(&mut self, segment: &Segment, index: usize, id: &str) {
        let ends = self.strokes.ends(index);
        match self.strokes.stroke(segment, ends, self.names.is_none()) {
            None => {}
            Some(Stroke::Element { name, attributes }) => {
                self.end_run();
                self.out.extend(["<", name, id, &attributes, "/>\n"]);
            }
            Some(Stroke::Path { attributes, data }) => self.path(attributes, &data, id),
        }
    }

    fn polygon(&mut self, polygon: &Polygon, id: &str) {
        let corners: Vec<Point> = polygon.vertices.iter().map(|&p| self.project(p)).collect();
        let normal = self.style.fit.camera.direction(triangulate::normal(&polygon.vertices));
        let fill = self.shade(polygon.material, normal, middle(&corners).z, area(&corners) > 0.0);
        let mut outline = String::new();
        add_outline(&mut outline, &corners, DECIMALS);
        self.path(format!(" fill=\"{fill}\""), &outline, id);
    }

    /// A group of paths, one for each run of triangles of one colour: a surface of a drawing without depth. A thin stroke of the same
    /// colour closes the seams that anti-aliasing would leave between them.
    fn surface(&mut self, surface: &Surface, id: &str) {
        let (mesh, placement) = (&surface.mesh, &surface.placement);
        let corners: Vec<Point> = mesh.vertices.iter().map(|&v| self.project(placement.point(v))).collect();
        let material = |face: &Face| surface.tint.filter(|_| face.takes_tint).unwrap_or(face.material);
        self.end_run();
        let width = text((0.006 * placement.largest() * self.style.scale).clamp(0.01, 0.4));
        let _ = writeln!(self.out, "<g{id} stroke-width=\"{width}\">");
        for run in mesh.faces.chunk_by(|a, b| material(a) == material(b)) {
            let mut outline = String::new();
            for face in run {
                add_outline(&mut outline, &face.corners.map(|i| corners[i as usize]), SURFACE_DECIMALS);
            }
            let color = self.scene.palette.get(material(&run[0])).color;
            let _ = writeln!(self.out, "<path fill=\"{color}\" stroke=\"{color}\" d=\"{outline}\"/>");
        }
        self.out.push_str("</g>\n");
    }

    /// A path, or, if it has no name and looks like the one before, more of that.
    fn path(&mut self, attributes: String, data: &str, id: &str) {
        if id.is_empty() {
            if let Some((look, gathered)) = &mut self.run
                && *look == attributes
            {
                gathered.push_str(data);
                return;
            }
            self.end_run();
            self.run = Some((attributes, data.to_owned()));
        } else {
            self.out.extend(["<path", id, &attributes, " d=\"", data, "\"/>\n"]);
        }
    }

    fn end_run(&mut self) {
        if let Some((attributes, data)) = self.run.take() {
            self.out.extend(["<path", &attributes, " d=\"", &data, "\"/>\n"]);
        }
    }

    fn project(&self, p: Point) -> Point {
        self.style.project(p)
    }

    /// A material's colour on a surface with this unit normal, in the view's coordinates, at this place. Both sides are
    /// alike: the one that is seen counts, and it is the front if it is `turned` like that.
    fn shade(&self, material: MaterialId, normal: Vector, z: f64, front: bool) -> Color {
        let normal = if front { normal } else { -normal };
        let strength = self.style.fit.light.strength(normal, z / self.style.scale);
        // Few shades, so that neighbours of nearly the same direction become one path.
        self.scene.palette.get(material).color.lit((strength * SHADES).round() / SHADES)
    }
}

impl Style<'_> {
    /// The projection of a point to the picture; y goes down, z is towards the viewer.
    pub(super) fn project(&self, p: Point) -> Point {
        let seen = self.fit.camera.project(p);
        Point::new(seen.x * self.scale, -seen.y * self.scale, seen.z * self.scale)
    }
}

/// A number as it is written.
pub(super) fn text(x: f64) -> String {
    let mut out = String::new();
    number::push(&mut out, x, DECIMALS);
    out
}

fn middle(points: &[Point]) -> Point {
    let sum: Vector = points.iter().map(|p| p.coords).sum();
    Point::from(sum / points.len().max(1) as f64)
}

/// Twice the area of an outline in the picture, positive if its corners go counter-clockwise to the eye (y going down).
fn area(corners: &[Point]) -> f64 {
    let Some(&origin) = corners.first() else { return 0.0 };
    let next = corners.iter().cycle().skip(1);
    let parts = corners
        .iter()
        .zip(next)
        .map(|(p, q)| (p.y - origin.y) * (q.x - origin.x) - (q.y - origin.y) * (p.x - origin.x));
    parts.sum()
}

/// Appends a closed outline to path data. All outlines turn the same way, so that where two of one path
/// overlap, the rule of non-zero winding leaves no hole.
fn add_outline(data: &mut String, corners: &[Point], decimals: usize) {
    let mut place = |p: &Point, command: char| {
        data.push(command);
        number::push_row(data, [p.x, p.y], decimals);
    };
    let command = |i| if i == 0 { 'M' } else { 'L' };
    if area(corners) > 0.0 {
        corners.iter().rev().enumerate().for_each(|(i, p)| place(p, command(i)));
    } else {
        corners.iter().enumerate().for_each(|(i, p)| place(p, command(i)));
    }
    data.push('Z');
}
