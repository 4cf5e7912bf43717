//! The visible regions of a scene in depth, as the elements of an SVG picture.
//!
//! ```text
//! triangles ─label─▶ raster of regions ─regions, contour─▶ outlines ─▶ paths, in a group for each module
//! stems ─hidden─▶ those that nothing hides, and the visible parts of thin ones ─▶ strokes
//! ```
//!
//! A scene in depth has surfaces that hide and cut one another, and shades that change from place to place. Its triangles are drawn
//! into a raster of cells, finer than the pixels of the page, that holds the nearest triangle of each; cells of one module and one shade
//! are a region, and the outlines of regions are the paths of the picture. So surfaces are hidden as in a PNG, no seam shows
//! between faces, and a file has as many paths as there are shades to see, not as there are triangles.
//!
//! Stems that nothing hides are no regions: they are strokes, over everything else. So are thin ones, where nothing is in front of
//! them. In a scene of nothing but stems all are strokes but wide ones ([`stems`]), from back to front ([`order`]); those that regions hide in part are
//! under these, too.

mod cell_set;
mod contour;
mod edges;
mod faded;
mod hidden;
mod label;
mod memory;
mod order;
mod path;
mod pieces;
mod regions;
mod scarce;
mod shading;
mod spans;
mod specks;
mod stems;
mod tones;

use std::borrow::Cow;
use std::collections::HashSet;
use std::fmt::Write;

use super::Fit;
use super::formats::png::Lit;
use super::lens::Lens;
use super::lighting::Lighting;
use super::name::Names;
use super::painter::Style;
use super::raster::cells::Middles;
use super::stroke::{End, Stroke, Strokes, is_thin, pixels_across};
use super::triangles::{Solid, Triangle, Triangles};
use super::tube::{TubeStyle, Tubes, sides_for};
use contour::Corner;
use dlsys_geometry::scene::{Face, OwnerId, Point, Scene, Segment};
use faded::Faded;
use hidden::{Part, Visible};
use label::{Look, Seen, Stems};
pub(super) use memory::Memory;
use memory::Rasters;
use path::push_outline;
use regions::Regions;
use stems::Plan;
use tones::Tones;

/// Cells for each pixel of the page, along a side.
pub(super) const CELLS_PER_PIXEL: f64 = 2.0;
/// The same before a background, where half of the area is in surfaces that are so many pixels large: what has few edges for its size needs fewer.
const OF_LARGE: f64 = 1.5;
const LARGE: f64 = 200.0;
/// Least and most cells on the larger side of a picture.
const LEAST_CELLS: f64 = 1000.0;
pub(super) const MOST_CELLS: f64 = 4000.0;
/// Greatest distance of tubes from round ones, in cells; most sides of one; and about how many triangles all of them may have.
const ROUNDNESS: f64 = 0.2;
const MOST_SIDES: usize = 64;
const MOST_TRIANGLES: usize = 4_000_000;
/// A scene of so few triangles has no small parts, so one cell for each pixel of the page is enough.
const PLAIN: usize = 2000;
/// Stems wider than this many pixels of the page are regions, because their bends and domes have shades of their own.
const WIDEST_STROKE: f64 = 16.0;
/// A stem whose visible length is less than this many widths is painted by its shades: its ends are much of it.
const SHORTEST_GRADIENT: f64 = 1.0;
/// What goes on beyond the page is traced for so many cells: outlines are not exact, and along the margin of the page none should be.
const BEYOND: f64 = 4.0;
/// Stems thinner than this many pixels of the page hide nothing: between the middles of cells they would have gaps.
const LEAST_PIXELS: f64 = 1.5;

/// The elements of a scene in depth, one a line, and of triangles `beside` it, which are parts of its modules. See
/// [`painter::elements`](super::painter::elements).
pub(super) fn elements(
    scene: &Scene,
    beside: Option<Triangles>,
    style: Style,
    named: bool,
    prefix: &str,
) -> String {
    let plan = if beside.is_none() { Plan::of(scene, style) } else { None };
    if let Some(plan) = plan.as_ref().filter(|plan| !plan.has_regions()) {
        let mut page = PageWriter::new(scene, style, named);
        let mut strokes = Strokes::new(scene, style, prefix, |_, _| true);
        for &index in &plan.strokes {
            let segment = &scene.segments[index];
            page.stroke(segment.owner, segment, strokes.ends(index), &mut strokes);
        }
        return page.finish(strokes);
    }
    let [left, bottom, width, height] = style.fit.picture.area;
    let larger = width.max(height);
    let cell_of = |per_pixel: f64| {
        let least = LEAST_CELLS * per_pixel / CELLS_PER_PIXEL;
        larger / (per_pixel * larger * style.pixels).clamp(least, MOST_CELLS)
    };
    let finest = cell_of(CELLS_PER_PIXEL);
    let has_triangles = |i: usize| match &plan {
        Some(plan) => plan.is_region[i],
        None => pixels_across(&scene.segments[i], style) >= LEAST_PIXELS,
    };
    let is_near = |i: usize| plan.as_ref().is_none_or(|plan| plan.is_near[i]);
    let mut mesh = mesh(scene, style.fit, 1.0 / finest, is_near, has_triangles);
    beside.iter().for_each(|beside| mesh.append(beside));
    drop(beside);
    let is_fine = mesh.faces.len() > PLAIN;
    let seen: Vec<Point> = mesh.vertices.iter().map(|p| style.fit.camera.project(*p)).collect();
    let per_side = match is_fine {
        false => 1.0,
        true if style.background.is_some() && large(&mesh, &seen) * style.pixels.powi(2) >= LARGE => OF_LARGE,
        true => CELLS_PER_PIXEL,
    };
    mesh.without_far_sides(&seen);
    let cell = cell_of(per_side);
    // Cells in a pixel of the page.
    let per_pixel = (cell * style.pixels).powi(-2);
    let [a, b, c] = [1.0 / cell, -left / cell, (bottom + height) / cell];
    let whole = [width, height].map(|side| (side / cell).ceil().max(1.0));
    let lens = Lens::new(style.fit, whole.map(|side| side as u32), [a, b, c]);
    let casting = style.casting.unwrap_or(scene);
    let lighting = Lighting::new(casting, style.fit, a, style.threads, style.floor, Some(&lens));
    let mut lit = Lit::new(scene, (&mesh, seen), (style.fit, lighting), [a, b, c], style.floor);
    // Of the raster only the part in which something is drawn.
    let [low, size] = drawn(&mesh, &lit, whole);
    let placement = [a, b - low[0], c - low[1]];
    lit.shift(low);
    let size = size.map(|side| side as usize);
    let mut rasters = style.memory.map(Memory::take).unwrap_or_default();
    let [widest, highest] = whole.map(|side| side + 2.0 * (BEYOND + 1.0));
    let most = if style.memory.is_some() { (widest * highest) as usize } else { 0 };
    let (nearest, spans) = label::nearest(&mesh, &lit, (size, most), &mut rasters);
    let around = spans.widened();
    let beyond = around.widened();
    let Middles { numbers, depths } = nearest;
    let mut visible = Visible { style, depths: &depths, labels: &[], size, placement };
    let stems = match &plan {
        Some(_) => Stems::default(),
        None => stems(scene, style, &visible, lit.lighting().is_declared()),
    };
    let tones = Tones::of(&scene.palette);
    let seen = Seen { mesh: &mesh, lit: &lit, size, spans: &spans, around: &around, beyond: &beyond };
    let fineness = (is_fine, per_pixel);
    let (mut regions, shades) = label::label((numbers, seen), (&stems, &tones), fineness, most, &mut rasters);
    regions.with_narrow_parts();
    regions.without_specks(per_pixel, &mut rasters.marks, most);
    let outlines = regions.outlines(shades.len(), &mut rasters.marks, most);
    visible.labels = &regions.labels;

    let unit = cell * style.scale;
    let origin = [(low[0] - b) * unit, (low[1] - c) * unit];
    let to_page = |[x, y]: Corner| [origin[0] + x * unit, origin[1] + y * unit];
    // A quarter of a cell.
    let decimals = (-(unit / 4.0).log10()).ceil().clamp(0.0, 6.0) as usize;
    let is_stroke = |i: usize| {
        let segment = &scene.segments[i];
        match &plan {
            Some(plan) => !plan.is_region[i],
            None => {
                stems.strokes.contains(&(segment.owner, segment.material))
                    || pixels_across(segment, style) < LEAST_PIXELS
            }
        }
    };
    let parted = |a: usize, b: usize| is_stroke(a) && is_stroke(b);
    let mut strokes = Strokes::new(scene, style, prefix, parted).lit(lit.lighting());
    let mut paths: Vec<(OwnerId, String)> = Vec::new();
    let (fading, mut floor_owner, mut far_floor) =
        (Faded::of(style, lit.lighting(), casting), None, Vec::new());
    for (shade, outlines) in shades.iter().zip(&outlines).filter(|(_, outlines)| !outlines.is_empty()) {
        let (owner, material) = shade.item.look;
        let fill = match shade.item.stem.and_then(|stem| scene.segments.get(stem as usize)) {
            Some(segment) => strokes.fill(segment),
            None => {
                let tone = tones.color(material, shade.item.tone);
                lit.color(material, tone, shade.strength(), style.background).to_string()
            }
        };
        let mut data = String::new();
        outlines.iter().for_each(|outline| push_outline(&mut data, outline, to_page, decimals));
        if style.floor == Some(material) {
            floor_owner = Some(owner);
            let far = fading
                .as_ref()
                .is_some_and(|fading| outlines.iter().flatten().any(|at| fading.is_faint(to_page(*at)[1])));
            far_floor.extend(far.then(|| data.clone()));
        }
        paths.push((owner, format!("<path fill=\"{fill}\" d=\"{data}\"/>")));
    }
    let mut page = PageWriter::new(scene, style, named);
    let over = plan.as_ref().map(|plan| page.under_regions(scene, &plan.strokes, &mut strokes, &visible));
    // The floor is the last module.
    let floor = paths.iter().position(|(owner, _)| Some(*owner) == floor_owner).unwrap_or(paths.len());
    page.groups(&paths[..floor]);
    match fading.filter(|_| !far_floor.is_empty()) {
        Some(fading) => {
            page.out.push_str(&fading.begin(&far_floor, prefix));
            page.groups(&paths[floor..]);
            page.out.push_str("</g>\n");
        }
        None => page.groups(&paths[floor..]),
    }
    match over {
        Some(over) => over.iter().for_each(|(owner, parts)| page.strokes(*owner, parts, &mut strokes)),
        None => {
            let order = (0..scene.segments.len()).filter(|i| is_stroke(*i)).collect();
            for i in by_depth(scene, style, order) {
                let segment = &scene.segments[i];
                let parts = visible.parts(segment, strokes.ends(i), is_thin(segment, style));
                page.strokes(segment.owner, &parts, &mut strokes);
            }
        }
    }
    let elements = page.finish(strokes);
    if let Some(memory) = style.memory {
        let Regions { labels: numbers, strengths, .. } = regions;
        memory.keep(Rasters { numbers, depths, strengths, ..rasters }, [&spans, &beyond]);
    }
    elements
}

/// Segments from back to front, as far as the depths of their middles tell.
fn by_depth(scene: &Scene, style: Style, mut numbers: Vec<usize>) -> Vec<usize> {
    let depth = |i: usize| {
        let segment = &scene.segments[i];
        style.fit.camera.project(nalgebra::center(&segment.start, &segment.end)).z
    };
    numbers.sort_by(|a, b| depth(*a).total_cmp(&depth(*b)).then(a.cmp(b)));
    numbers
}

/// Everything in a scene as triangles, in string order, as round as so many cells for a scene unit show; stems, by number, if they are to be `kept`.
/// Others that are `near` give the joints of these their shape.
fn mesh(
    scene: &Scene,
    fit: &Fit,
    scale: f64,
    near: impl Fn(usize) -> bool,
    kept: impl Fn(usize) -> bool,
) -> Triangles {
    let affordable = (MOST_TRIANGLES / (2 * scene.segments.len().max(1))).clamp(4, MOST_SIDES);
    let sides = |radius: f64, at: Point| {
        let nearer = fit.camera.magnification(fit.camera.project(at).z);
        sides_for(radius * scale * nearer, ROUNDNESS).min(affordable)
    };
    let style = TubeStyle { floor: scene.surroundings.floor, ..fit.tubes() };
    let tubes = Tubes::of(scene, style, sides, near);
    Triangles::of(&Solid::of(scene, tubes, Cow::Borrowed(&scene.surfaces)), kept)
}

/// The area of the surface up to which, from the smallest on, surfaces have half of the area of all, in the units of the plane of focus.
fn large(mesh: &Triangles, seen: &[Point]) -> f64 {
    let area = |face: &Triangle| {
        let [a, b, c] = face.corners.map(|(vertex, _)| seen[vertex as usize]);
        ((b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x)).abs() / 2.0
    };
    let surfaces = mesh.faces.chunk_by(|a, b| a.surface == b.surface);
    let mut areas: Vec<f64> = surfaces.map(|faces| faces.iter().map(area).sum()).collect();
    areas.sort_by(f64::total_cmp);
    let half = areas.iter().sum::<f64>() / 2.0;
    let mut below = 0.0;
    let largest = areas.iter().find(|area| {
        below += **area;
        below >= half
    });
    largest.copied().unwrap_or(0.0)
}

/// The rectangle of cells that triangles touch, within a picture of this size or a little beyond, and a cell around it: its first column and
/// row, and its size.
fn drawn(mesh: &Triangles, lit: &Lit, size: [f64; 2]) -> [[f64; 2]; 2] {
    let (mut low, mut high) = (size, [0.0; 2]);
    for corner in (0..mesh.faces.len()).flat_map(|n| lit.corners(n)) {
        for (k, at) in [corner.x, corner.y].into_iter().enumerate() {
            low[k] = at.min(low[k]);
            high[k] = at.max(high[k]);
        }
    }
    let low = [0, 1].map(|k| low[k].floor().clamp(-BEYOND, size[k] - 1.0) - 1.0);
    let high = [0, 1].map(|k| high[k].ceil().clamp(low[k] + 2.0, size[k] + BEYOND) + 1.0);
    [low, [0, 1].map(|k| high[k] - low[k])]
}

/// The looks that are strokes: all stems of theirs are thin, or nothing hides them; and they have nothing but stems. And the other stems
/// that are painted with gradients. The light of a declared sun changes along a stem, too, so there only thin ones are strokes.
fn stems(scene: &Scene, style: Style, visible: &Visible, is_declared: bool) -> Stems {
    let widest = if is_declared { LEAST_PIXELS } else { WIDEST_STROKE };
    let mut strokes: HashSet<Look> = scene.segments.iter().map(|s| (s.owner, s.material)).collect();
    for polygon in &scene.polygons {
        strokes.remove(&(polygon.owner, polygon.material));
    }
    for surface in &scene.surfaces {
        let material = |face: &Face| surface.tint.filter(|_| face.takes_tint).unwrap_or(face.material);
        for run in surface.mesh.faces.chunk_by(|a, b| material(a) == material(b)) {
            strokes.remove(&(surface.owner, material(&run[0])));
        }
    }
    let is_wide = |segment: &Segment| pixels_across(segment, style) > widest;
    for segment in &scene.segments {
        let look = (segment.owner, segment.material);
        let pixels = pixels_across(segment, style);
        if pixels < LEAST_PIXELS || !strokes.contains(&look) {
            continue;
        }
        let is_whole = || match is_thin(segment, style) {
            true => visible.is_cut_across(segment),
            false => visible.is_clear(segment),
        };
        if segment.contour.is_some() || is_wide(segment) || !is_whole() {
            strokes.remove(&look);
        }
    }
    let has_gradient = |segment: &Segment| {
        let pixels = pixels_across(segment, style);
        !strokes.contains(&(segment.owner, segment.material))
            && segment.contour.is_none()
            && (LEAST_PIXELS..=widest).contains(&pixels)
            && visible.length(segment) >= SHORTEST_GRADIENT * pixels
    };
    let gradients = (0..).zip(&scene.segments).filter(|(_, segment)| has_gradient(segment));
    let gradients = gradients.map(|(i, _)| i).collect();
    Stems { strokes, gradients }
}

/// Writes the elements.
struct PageWriter<'a> {
    style: Style<'a>,
    names: Option<Names<'a>>,
    /// Elements of each module so far; none in a picture without names.
    ordinals: Vec<u32>,
    out: String,
}

impl<'a> PageWriter<'a> {
    fn new(scene: &'a Scene, style: Style<'a>, named: bool) -> PageWriter<'a> {
        let names = named.then(|| Names::new(scene, '-'));
        let ordinals = vec![0; if named { scene.owners().len() } else { 0 }];
        PageWriter { style, names, ordinals, out: String::new() }
    }

    /// Appends the `id` of the next element of a module: its name, then its name and a number from 2. Nothing in a picture without names.
    fn push_id(&mut self, owner: OwnerId) {
        let Some(names) = &self.names else { return };
        self.out.push_str(" id=\"");
        self.out.push_str(&names.get(owner));
        let ordinal = &mut self.ordinals[owner.index()];
        *ordinal += 1;
        if *ordinal > 1 {
            let _ = write!(self.out, ".{ordinal}");
        }
        self.out.push('"');
    }

    /// The paths of each module, in a group that has its name.
    fn groups(&mut self, paths: &[(OwnerId, String)]) {
        for group in paths.chunk_by(|a, b| a.0 == b.0) {
            let lines: Vec<&String> = group.iter().map(|(_, path)| path).collect();
            self.group(group[0].0, &lines);
        }
    }

    /// Elements of one module that have one name.
    fn group(&mut self, owner: OwnerId, lines: &[impl std::fmt::Display]) {
        let is_group = self.names.is_some();
        if is_group {
            self.out.push_str("<g");
            self.push_id(owner);
            self.out.push_str(">\n");
        }
        for line in lines {
            let _ = writeln!(self.out, "{line}");
        }
        if is_group {
            self.out.push_str("</g>\n");
        }
    }

    /// Adds what regions hide in part, to come under these regions, so that no background shows along their edges; and gives the parts that nothing hides,
    /// which come over all regions.
    fn under_regions(
        &mut self,
        scene: &Scene,
        order: &[usize],
        strokes: &mut Strokes,
        visible: &Visible,
    ) -> Vec<(OwnerId, Vec<Part>)> {
        let parted = order.iter().map(|&index| {
            let segment = &scene.segments[index];
            let is_hair = pixels_across(segment, self.style) < LEAST_PIXELS;
            let [over, under] = visible.over_and_under(segment, strokes.ends(index), is_hair);
            self.strokes(segment.owner, &under, strokes);
            (segment.owner, over)
        });
        parted.collect()
    }

    /// The parts of a segment as strokes.
    fn strokes(&mut self, owner: OwnerId, parts: &[Part], strokes: &mut Strokes) {
        if let [(part, ends)] = parts {
            self.stroke(owner, part, *ends, strokes);
            return;
        }
        let elements: Vec<(&str, String)> = (parts.iter())
            .filter_map(|(part, ends)| strokes.stroke(part, *ends, false))
            .map(Stroke::element)
            .collect();
        if let [element] = &elements[..] {
            self.element(owner, element);
        } else if !elements.is_empty() {
            let line = |(name, attributes): &(&str, String)| format!("<{name}{attributes}/>");
            self.group(owner, &elements.iter().map(line).collect::<Vec<_>>());
        }
    }

    /// A whole segment as a stroke.
    fn stroke(&mut self, owner: OwnerId, segment: &Segment, ends: [End; 2], strokes: &mut Strokes) {
        if let Some(stroke) = strokes.stroke(segment, ends, false) {
            self.element(owner, &stroke.element());
        }
    }

    fn element(&mut self, owner: OwnerId, (name, attributes): &(&str, String)) {
        self.out.extend(["<", name]);
        self.push_id(owner);
        self.out.extend([attributes, "/>\n"]);
    }

    /// The elements so far, and the gradients of strokes before them.
    fn finish(self, mut strokes: Strokes) -> String {
        let definitions = strokes.definitions();
        match definitions.is_empty() {
            true => self.out,
            false => format!("<defs>\n{definitions}</defs>\n{}", self.out),
        }
    }
}
