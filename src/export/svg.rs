//! A scene as an SVG picture.
//!
//! Stems are strokes with round ends, polygons and the triangles of surfaces are filled paths under a soft
//! light from the upper left. Everything is drawn from back to front, by the depth of its middle; a surface
//! is one thing in that order, and its triangles are in order among themselves. What is equally deep is
//! drawn in string order.
//!
//! Every element has an id that lasts from frame to frame: the name of its module, `KIND-LINEAGE`, for the
//! first that a module draws, then `KIND-LINEAGE.2` and so on.

use std::fmt::Write;

use svg::Document;
use svg::node::Blob;
use svg::node::element::{Circle, Element, Group, Line, Path, Rectangle, Title};

use super::name::Names;
use super::{Fit, number, triangulate};
use crate::scene::{Color, MaterialId, OwnerId, Point, Polygon, Scene, Segment, Surface, Vector};

/// Decimals of a coordinate. The larger side of a picture is 100 to 1000 units, so the last digit is a
/// millionth to a hundred-thousandth of it.
pub(super) const DECIMALS: usize = 3;
/// Decimals of a corner of a surface: a built-in flower has hundreds, and they are most of a file.
const SURFACE_DECIMALS: usize = 2;
/// Larger side of the picture in pixels, for programs that want a size.
const PIXELS: f64 = 1000.0;
/// A warm white.
const BACKGROUND: &str = "#fbfaf5";
/// Direction to the light, in the view's coordinates.
const LIGHT: Vector = Vector::new(-0.36, 0.58, 0.73);
/// Strength of light on a surface that faces away from the light, and what facing it adds.
const AMBIENT: f64 = 0.7;
const DIFFUSE: f64 = 0.4;
/// Steps in which the strength of light is rounded, and on surfaces that are small in the picture.
const SHADES: f64 = 40.0;
const COARSE_SHADES: f64 = 8.0;

/// The document of one frame.
pub(super) fn document(scene: &Scene, fit: &Fit, title: &str) -> String {
    let view_box = fit.picture.view_box();
    let [left, top, width, height] = view_box;
    let pixels = [width, height].map(|side| {
        // Even numbers, as video encoders want them.
        (2.0 * (PIXELS / 2.0 * side / width.max(height)).round()).max(2.0)
    });
    let background = Rectangle::new()
        .set("x", text(left))
        .set("y", text(top))
        .set("width", text(width))
        .set("height", text(height))
        .set("fill", BACKGROUND);
    let mut painter = Painter { scene, fit, names: Names::new(scene, '-'), out: String::new() };
    painter.paint();
    let things = Group::new()
        .set("stroke-linecap", "round")
        .set("stroke-linejoin", "round")
        .add(Blob::new(painter.out));
    // Characters that XML cannot hold have no place in a title.
    let title: String = title.chars().filter(|c| !c.is_control()).collect();
    let document = Document::new()
        .set("viewBox", view_box.map(text).join(" "))
        .set("width", pixels[0])
        .set("height", pixels[1])
        .add(Title::new(title))
        .add(background)
        .add(things);
    let mut out = document.to_string();
    out.push('\n');
    out
}

fn text(x: f64) -> String {
    let mut out = String::new();
    number::push(&mut out, x, DECIMALS);
    out
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
    fit: &'a Fit,
    names: Names,
    out: String,
}

impl Painter<'_> {
    fn paint(&mut self) {
        for layer in self.layers() {
            let name = self.names.get(layer.owner);
            let id = if layer.ordinal == 1 { name.to_owned() } else { format!("{name}.{}", layer.ordinal) };
            let element = match layer.thing {
                Thing::Segment(i) => self.segment(&self.scene.segments[i]),
                Thing::Polygon(i) => Some(self.polygon(&self.scene.polygons[i])),
                Thing::Surface(i) => Some(self.surface(&self.scene.surfaces[i])),
            };
            if let Some(mut element) = element {
                element.get_attributes_mut().insert("id".to_owned(), id.into());
                if !self.out.is_empty() {
                    self.out.push('\n');
                }
                let _ = write!(self.out, "{element}");
            }
        }
    }

    /// Everything, from back to front.
    fn layers(&self) -> Vec<Layer> {
        let quantum = 1e-9 * if self.fit.extent > 0.0 { self.fit.extent } else { 1.0 };
        let depth = |p: Point| (self.fit.view.see(p).z / quantum).round();
        let mut ordinals = vec![0_u32; self.scene.owners().len()];
        let mut layers = Vec::new();
        let mut add = |owner: OwnerId, depth: f64, thing: Thing| {
            let ordinal = &mut ordinals[owner.index()];
            *ordinal += 1;
            layers.push(Layer { depth, owner, ordinal: *ordinal, thing });
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

    /// Where a point comes to lie in the picture; z is towards the viewer.
    fn project(&self, p: Point) -> Point {
        let seen = self.fit.view.see(p);
        let scale = self.fit.picture.scale;
        Point::new(seen.x * scale, -seen.y * scale, seen.z * scale)
    }

    fn color(&self, material: MaterialId) -> Color {
        self.scene.palette.get(material).color
    }

    /// A stroke; a dot if it is seen end on; a filled outline if its ends differ in width.
    fn segment(&self, segment: &Segment) -> Option<Element> {
        let (a, b) = (self.project(segment.start), self.project(segment.end));
        let [wa, wb] = segment.widths.map(|w| w.resolve(self.fit.default_width) * self.fit.picture.scale);
        let color = self.color(segment.material).to_string();
        let texts = [a.x, a.y, b.x, b.y].map(text);
        let (from, to) = (text(wa), text(wb));
        if from == "0" && to == "0" {
            return None;
        }
        if from != to {
            return Some(tapered(a, b, wa / 2.0, wb / 2.0).set("fill", color).into());
        }
        let [x1, y1, x2, y2] = texts;
        // Not every renderer draws the ends of a stroke without length.
        if x1 == x2 && y1 == y2 {
            let dot = Circle::new().set("cx", x1).set("cy", y1).set("r", text(wa / 2.0));
            return Some(dot.set("fill", color).into());
        }
        let line = Line::new().set("x1", x1).set("y1", y1).set("x2", x2).set("y2", y2);
        Some(line.set("stroke", color).set("stroke-width", from).into())
    }

    fn polygon(&self, polygon: &Polygon) -> Element {
        let corners: Vec<Point> = polygon.vertices.iter().map(|&p| self.project(p)).collect();
        let fill = self.shade(polygon.material, triangulate::normal(&corners), SHADES);
        let mut outline = String::new();
        add_outline(&mut outline, &corners, DECIMALS);
        Path::new().set("d", outline).set("fill", fill.to_string()).into()
    }

    /// A group of paths, one for each run of triangles of one shade. A thin stroke of the same colour closes
    /// the seams that anti-aliasing would leave between them.
    fn surface(&self, surface: &Surface) -> Element {
        let corners: Vec<Point> =
            surface.mesh.vertices.iter().map(|&v| self.project(surface.placement.point(v))).collect();
        let size = surface.placement.scale * self.fit.picture.scale;
        // On a flower of a few pixels fine shades cannot be told apart, and they are most of a file.
        let [_, _, width, height] = self.fit.picture.view_box();
        let shades = if size < 0.05 * width.max(height) { COARSE_SHADES } else { SHADES };
        let mut faces: Vec<(f64, Color, [Point; 3])> = surface
            .mesh
            .faces
            .iter()
            .map(|face| {
                let corners = face.corners.map(|i| corners[i as usize]);
                let tint = surface.tint.filter(|_| face.takes_tint);
                let color = self.shade(tint.unwrap_or(face.material), triangulate::normal(&corners), shades);
                (corners.iter().map(|p| p.z).sum(), color, corners)
            })
            .collect();
        faces.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut group = Group::new().set("stroke-width", text((0.006 * size).clamp(0.01, 0.4)));
        for run in faces.chunk_by(|a, b| a.1 == b.1) {
            let mut outline = String::new();
            for (_, _, corners) in run {
                add_outline(&mut outline, corners, SURFACE_DECIMALS);
            }
            let color = run[0].1.to_string();
            group = group.add(Path::new().set("d", outline).set("fill", color.clone()).set("stroke", color));
        }
        group.into()
    }

    /// A material's colour on a surface with this normal, in picture coordinates. Both sides are alike: the
    /// side that is seen counts.
    fn shade(&self, material: MaterialId, normal: Vector, shades: f64) -> Color {
        let facing = Vector::new(normal.x, -normal.y, normal.z) * if normal.z < 0.0 { -1.0 } else { 1.0 };
        let strength = AMBIENT + DIFFUSE * facing.dot(&LIGHT).max(0.0);
        // Few shades, so that neighbours of nearly the same direction become one path.
        self.color(material).lit((strength * shades).round() / shades)
    }
}

fn middle(points: &[Point]) -> Point {
    let sum: Vector = points.iter().map(|p| p.coords).sum();
    Point::from(sum / points.len().max(1) as f64)
}

/// Appends a closed outline to path data. All outlines turn the same way, so that where two of one path
/// overlap, the rule of non-zero winding leaves no hole.
fn add_outline(data: &mut String, corners: &[Point], decimals: usize) {
    let mut doubled_area = 0.0;
    for (i, p) in corners.iter().enumerate() {
        let next = corners[(i + 1) % corners.len()];
        doubled_area +=
            (p.x - corners[0].x) * (next.y - corners[0].y) - (next.x - corners[0].x) * (p.y - corners[0].y);
    }
    let mut place = |p: &Point, command: char| {
        data.push(command);
        number::push(data, p.x, decimals);
        data.push(' ');
        number::push(data, p.y, decimals);
    };
    let command = |i| if i == 0 { 'M' } else { 'L' };
    if doubled_area < 0.0 {
        corners.iter().rev().enumerate().for_each(|(i, p)| place(p, command(i)));
    } else {
        corners.iter().enumerate().for_each(|(i, p)| place(p, command(i)));
    }
    data.push('Z');
}

/// The outline around two circles and what lies between them.
fn tapered(a: Point, b: Point, ra: f64, rb: f64) -> Path {
    let (dx, dy) = (b.x - a.x, b.y - a.y);
    let distance = dx.hypot(dy);
    let mut data = String::new();
    let mut push = |command: &str, numbers: &[f64]| {
        data.push_str(command);
        for (i, &x) in numbers.iter().enumerate() {
            if i > 0 {
                data.push(' ');
            }
            number::push(&mut data, x, DECIMALS);
        }
    };
    if distance <= (ra - rb).abs() {
        // One circle holds the other.
        let (c, r) = if ra > rb { (a, ra) } else { (b, rb) };
        push("M", &[c.x - r, c.y]);
        push("A", &[r, r, 0.0, 0.0, 0.0, c.x + r, c.y]);
        push("A", &[r, r, 0.0, 0.0, 0.0, c.x - r, c.y]);
    } else {
        // The common tangents touch at this sine from the axis.
        let sin = (ra - rb) / distance;
        let cos = (1.0 - sin * sin).sqrt();
        let (ex, ey) = (dx / distance, dy / distance);
        let touch = |c: Point, r: f64, side: f64| {
            [c.x + r * (sin * ex - side * cos * ey), c.y + r * (sin * ey + side * cos * ex)]
        };
        let large = |this: f64, other: f64| if this > other { 1.0 } else { 0.0 };
        let [p, q, s, t] = [touch(a, ra, 1.0), touch(b, rb, 1.0), touch(b, rb, -1.0), touch(a, ra, -1.0)];
        push("M", &p);
        push("L", &q);
        push("A", &[rb, rb, 0.0, large(rb, ra), 0.0, s[0], s[1]]);
        push("L", &t);
        push("A", &[ra, ra, 0.0, large(ra, rb), 0.0, p[0], p[1]]);
    }
    data.push('Z');
    Path::new().set("d", data)
}
