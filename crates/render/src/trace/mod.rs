//! The visible regions of a scene in depth, as the elements of an SVG picture.
//!
//! A scene in depth has surfaces that hide and cut one another, and shades that change from place to place. Its triangles are drawn
//! into a raster of cells, finer than the pixels of the page, that holds the nearest triangle of each; cells of one module and one shade
//! are a region, and the outlines of regions are the paths of the picture. So surfaces are hidden as in a PNG, no seam shows
//! between faces, and a file has as many paths as there are shades to see, not as there are triangles.
//!
//! Stems of a few pixels are no regions: they are strokes, where nothing is in front of them.

mod contour;
mod regions;

use std::collections::{BTreeMap, HashMap};
use std::fmt::Write;

use super::formats::png::{Lit, sides};
use super::name::Names;
use super::painter::Style;
use super::raster::cells;
use super::stroke::{Stroke, Strokes, is_thin};
use super::{number, triangles};
use contour::Corner;
use dlsys_geometry::scene::{MaterialId, OwnerId, Point, Scene, Segment, Width};
use regions::{NOTHING, Regions};

/// Cells on the larger side of a picture: two for each of a thousand pixels.
const CELLS: f64 = 2000.0;
/// Shades between black and a colour as it is.
const SHADES: f64 = 20.0;
/// A scene of more triangles has its elements painted one by one.
const MOST_TRIANGLES: usize = 1 << 24;
/// A stroke is hidden by what is nearer by more than this part of the extent.
const NEARER: f32 = 2e-3;

/// A region of one module, material and shade, in the order of painting.
type Key = (OwnerId, MaterialId, i32);

/// The elements of a scene in depth, one a line; `None` if it has too many triangles. See [`painter::elements`](super::painter::elements).
pub(super) fn elements(scene: &Scene, style: Style, named: bool, prefix: &str) -> Option<String> {
    let [left, bottom, width, height] = style.fit.picture.area;
    let cell = width.max(height) / CELLS;
    let size = [width, height].map(|side| (side / cell).ceil().max(1.0) as usize);
    let placement = [1.0 / cell, -left / cell, (bottom + height) / cell];
    let is_region = |segment: &Segment| !is_thin(segment, style);
    let mesh = triangles::triangles(scene, style.fit, sides(scene, style.fit, placement[0]), is_region);
    if mesh.faces.len() >= MOST_TRIANGLES {
        return None;
    }
    let lit = Lit::new(&mesh, style.fit, placement);
    let (numbers, depths) = cells::nearest(size, mesh.faces.len(), |n| lit.corners(n));

    // Regions are numbered as they are found, then by their keys.
    let mut weights = cells::Weights::default();
    let mut found: Vec<(Key, f64, usize)> = Vec::new();
    let mut known: HashMap<Key, u32> = HashMap::new();
    let mut last: Option<(Key, u32)> = None;
    let mut labels = vec![NOTHING; numbers.len()];
    for (cell, label) in labels.iter_mut().enumerate() {
        let Some(n) = (numbers[cell] as usize).checked_sub(1) else { continue };
        let weights = weights.at(n, || lit.corners(n), [cell % size[0], cell / size[0]]);
        let strength = lit.strength(n, weights);
        let face = &mesh.faces[n];
        let key = (face.owner, face.material, (strength * SHADES).round() as i32);
        let number = match last {
            Some((same, number)) if same == key => number,
            _ => *known.entry(key).or_insert_with(|| {
                found.push((key, 0.0, 0));
                found.len() as u32 - 1
            }),
        };
        last = Some((key, number));
        let (_, sum, count) = &mut found[number as usize];
        (*sum, *count) = (*sum + strength, *count + 1);
        *label = number;
    }
    let mut order: Vec<u32> = (0..found.len() as u32).collect();
    order.sort_by_key(|number| found[*number as usize].0);
    let mut ranks = vec![0; order.len()];
    order.iter().zip(0..).for_each(|(number, rank)| ranks[*number as usize] = rank);
    labels.iter_mut().filter(|label| **label != NOTHING).for_each(|label| *label = ranks[*label as usize]);
    found.sort_by_key(|(key, ..)| *key);
    let (items, of_item) = items(&found);
    let item_of = |number: u32| match (number as usize).checked_sub(1) {
        Some(n) => of_item.get(&(mesh.faces[n].owner, mesh.faces[n].material)).copied().unwrap_or(NOTHING),
        None => NOTHING,
    };
    let (places, chosen) = edges(size, &numbers, item_of);
    let samples = cells::samples(size, mesh.faces.len(), |n| lit.corners(n), &places, chosen);
    let samples = samples.into_iter().map(|samples| samples.map(item_of)).collect();
    let mut regions = Regions { width: size[0], height: size[1], labels, places, samples, items };
    regions.without_specks();
    let outlines = regions.outlines(found.len());

    let mut page = PageWriter { style, names: named.then(|| Names::new(scene, '-')), out: String::new() };
    let origin = [left * style.scale, -(bottom + height) * style.scale];
    let to_page = |[x, y]: Corner| [origin[0] + x * cell * style.scale, origin[1] + y * cell * style.scale];
    let mut paths: Vec<(OwnerId, String)> = Vec::new();
    for ((key, sum, count), outlines) in found.iter().zip(&outlines) {
        if outlines.is_empty() {
            continue;
        }
        let color = scene.palette.get(key.1).color.lit(sum / *count as f64);
        let mut data = String::new();
        outlines.iter().for_each(|outline| page.outline(&mut data, outline.iter().map(|c| to_page(*c))));
        paths.push((key.0, format!("<path fill=\"{color}\" d=\"{data}\"/>")));
    }
    page.groups(&paths);

    let visible = Visible { style, depths: &depths, size, placement };
    Some(page.with_strokes(scene, &visible, prefix))
}

/// The item (module and material) of each region, by number in the order of painting; and the number of each item.
fn items(found: &[(Key, f64, usize)]) -> (Vec<u32>, HashMap<(OwnerId, MaterialId), u32>) {
    let mut numbers: HashMap<(OwnerId, MaterialId), u32> = HashMap::new();
    let items = found
        .iter()
        .map(|(key, ..)| {
            let next = numbers.len() as u32;
            *numbers.entry((key.0, key.1)).or_insert(next)
        })
        .collect();
    (items, numbers)
}

/// For each cell beside one of another item its number among these cells, else a number that is greater than any; and their count.
fn edges([width, height]: [usize; 2], numbers: &[u32], item_of: impl Fn(u32) -> u32) -> (Vec<u32>, usize) {
    let items: Vec<u32> = {
        let (mut last, mut item) = (0, item_of(0));
        let of = |number: &u32| {
            if *number != last {
                (last, item) = (*number, item_of(*number));
            }
            item
        };
        numbers.iter().map(of).collect()
    };
    let mut places = vec![u32::MAX; items.len()];
    let mut count = 0;
    for row in 0..height {
        for column in 0..width {
            let cell = row * width + column;
            let differs = |other: usize| items[other] != items[cell];
            let is_edge = column > 0 && differs(cell - 1)
                || column + 1 < width && differs(cell + 1)
                || row > 0 && differs(cell - width)
                || row + 1 < height && differs(cell + width);
            if is_edge {
                places[cell] = count as u32;
                count += 1;
            }
        }
    }
    (places, count)
}

/// Writes the elements.
struct PageWriter<'a> {
    style: Style<'a>,
    names: Option<Names<'a>>,
    out: String,
}

impl PageWriter<'_> {
    /// Appends a closed outline in relative coordinates, a thousandth of the picture fine.
    fn outline(&self, data: &mut String, corners: impl Iterator<Item = Corner>) {
        let decimals = if self.style.side >= 400.0 { 1 } else { 2 };
        let scale = 10_f64.powi(decimals as i32);
        let mut last: Option<[f64; 2]> = None;
        for corner in corners {
            let at = corner.map(|x| (x * scale).round());
            let [x, y] = match last {
                None => at,
                Some([x, y]) => [at[0] - x, at[1] - y],
            };
            if last.is_some() && x == 0.0 && y == 0.0 {
                continue;
            }
            data.push_str(if last.is_none() { "M" } else { "l" });
            let mut first = String::new();
            number::push(&mut first, x / scale, decimals);
            data.push_str(first.strip_prefix("0.").map_or(&first, |_| &first[1..]));
            let mut second = String::new();
            number::push(&mut second, y / scale, decimals);
            let second = if second.starts_with("0.") { &second[1..] } else { &second };
            if !second.starts_with('-') {
                data.push(' ');
            }
            data.push_str(second);
            last = Some(at);
        }
        data.push('z');
    }

    /// The paths of each module, in a group that has its name.
    fn groups(&mut self, paths: &[(OwnerId, String)]) {
        for group in paths.chunk_by(|a, b| a.0 == b.0) {
            if let Some(names) = &self.names {
                let _ = writeln!(self.out, "<g id=\"{}\">", names.get(group[0].0));
            }
            for (_, path) in group {
                let _ = writeln!(self.out, "{path}");
            }
            if self.names.is_some() {
                self.out.push_str("</g>\n");
            }
        }
    }

    /// Adds the visible parts of thin stems, from back to front, and completes the elements.
    fn with_strokes(mut self, scene: &Scene, visible: &Visible, prefix: &str) -> String {
        let mut strokes = Strokes::new(scene, self.style, prefix);
        let mut order: Vec<usize> =
            (0..scene.segments.len()).filter(|i| is_thin(&scene.segments[*i], self.style)).collect();
        let depth = |i: usize| {
            let segment = &scene.segments[i];
            self.style.fit.camera.project(nalgebra::center(&segment.start, &segment.end)).z
        };
        order.sort_by(|a, b| depth(*a).total_cmp(&depth(*b)).then(a.cmp(b)));
        let mut known: BTreeMap<OwnerId, u32> = BTreeMap::new();
        for index in order {
            let segment = &scene.segments[index];
            for part in visible.parts(segment) {
                let (name, attributes) = match strokes.stroke(&part, index, false) {
                    None => continue,
                    Some(Stroke::Element { name, attributes }) => (name, attributes),
                    Some(Stroke::Path { attributes, data }) => ("path", format!("{attributes} d=\"{data}\"")),
                };
                let ordinal = known.entry(segment.owner).or_default();
                *ordinal += 1;
                let id = self.names.as_ref().map_or(String::new(), |names| {
                    format!(" id=\"{}.{}\"", names.get(segment.owner), *ordinal + 1)
                });
                let _ = writeln!(self.out, "<{name}{id}{attributes}/>");
            }
        }
        let definitions = strokes.definitions();
        match definitions.is_empty() {
            true => self.out,
            false => format!("<defs>\n{definitions}</defs>\n{}", self.out),
        }
    }
}

/// The depths of what hides thin stems.
struct Visible<'a> {
    style: Style<'a>,
    depths: &'a [f32],
    size: [usize; 2],
    placement: [f64; 3],
}

impl Visible<'_> {
    /// The parts of a segment that nothing hides.
    fn parts(&self, segment: &Segment) -> Vec<Segment> {
        let camera = &self.style.fit.camera;
        let [a, b, c] = self.placement;
        let extent = if self.style.fit.extent > 0.0 { self.style.fit.extent } else { 1.0 };
        let at = |p: Point| {
            let seen = camera.project(p);
            ([a * seen.x + b, c - a * seen.y], (seen.z / extent) as f32)
        };
        let ([x1, y1], _) = at(segment.start);
        let ([x2, y2], _) = at(segment.end);
        let pieces = ((x2 - x1).hypot(y2 - y1)).ceil().clamp(1.0, 4.0 * CELLS) as usize;
        let is_seen = |k: usize| {
            let p = segment.start + (segment.end - segment.start) * ((k as f64 + 0.5) / pieces as f64);
            let ([x, y], depth) = at(p);
            let [column, row] = [x.floor(), y.floor()];
            let within =
                column >= 0.0 && row >= 0.0 && column < self.size[0] as f64 && row < self.size[1] as f64;
            !within || depth + NEARER >= self.depths[row as usize * self.size[0] + column as usize]
        };
        let mut parts = Vec::new();
        let mut from = None;
        for k in 0..=pieces {
            match (k < pieces && is_seen(k), from) {
                (true, None) => from = Some(k),
                (false, Some(first)) => {
                    parts.push(part(segment, first as f64 / pieces as f64, k as f64 / pieces as f64));
                    from = None;
                }
                _ => {}
            }
        }
        parts
    }
}

/// The part of a segment between two places from 0 to 1.
fn part(segment: &Segment, from: f64, to: f64) -> Segment {
    if from == 0.0 && to == 1.0 {
        return segment.clone();
    }
    let place = |s: f64| segment.start + (segment.end - segment.start) * s;
    let width = |s: f64| match segment.widths {
        [Width::Set(a), Width::Set(b)] => Width::Set(a + (b - a) * s),
        [first, _] => first,
    };
    Segment { start: place(from), end: place(to), widths: [width(from), width(to)], ..segment.clone() }
}
