//! The visible regions of a scene in depth, as the elements of an SVG picture.
//!
//! ```text
//! triangles ─label─▶ raster of regions ─regions, contour─▶ outlines ─▶ paths, in a group for each module
//! thin stems ─hidden─▶ the parts that nothing hides ─▶ strokes
//! ```
//!
//! A scene in depth has surfaces that hide and cut one another, and shades that change from place to place. Its triangles are drawn
//! into a raster of cells, finer than the pixels of the page, that holds the nearest triangle of each; cells of one module and one shade
//! are a region, and the outlines of regions are the paths of the picture. So surfaces are hidden as in a PNG, no seam shows
//! between faces, and a file has as many paths as there are shades to see, not as there are triangles.
//!
//! Stems of a few pixels are no regions: they are strokes, over everything else, where nothing is in front of them.

mod contour;
mod hidden;
mod label;
mod regions;

use std::collections::HashMap;
use std::fmt::Write;

use super::formats::png::{Lit, sides};
use super::name::Names;
use super::painter::Style;
use super::stroke::{Stroke, Strokes, is_thin};
use super::{number, triangles};
use contour::Corner;
use dlsys_geometry::scene::{OwnerId, Scene, Segment};
use hidden::Visible;

/// Cells for each pixel of the page, along a side.
const CELLS_PER_PIXEL: f64 = 2.0;
/// Least and most cells on the larger side of a picture.
const LEAST_CELLS: f64 = 1000.0;
const MOST_CELLS: f64 = 4000.0;

/// The elements of a scene in depth, one a line. See [`painter::elements`](super::painter::elements).
pub(super) fn elements(scene: &Scene, style: Style, named: bool, prefix: &str) -> String {
    let [left, bottom, width, height] = style.fit.picture.area;
    let larger = width.max(height);
    let cell = larger / (CELLS_PER_PIXEL * larger * style.pixels).clamp(LEAST_CELLS, MOST_CELLS);
    let size = [width, height].map(|side| (side / cell).ceil().max(1.0) as usize);
    let placement = [1.0 / cell, -left / cell, (bottom + height) / cell];
    let is_region = |segment: &Segment| !is_thin(segment, style);
    let mesh = triangles::triangles(scene, style.fit, sides(scene, style.fit, placement[0]), is_region);
    let lit = Lit::new(scene, &mesh, style.fit, placement, style.floor);
    let (mut regions, shades, depths) = label::label(&mesh, &lit, size);
    regions.without_specks();
    let outlines = regions.outlines(shades.len());

    let unit = cell * style.scale;
    let origin = [left * style.scale, -(bottom + height) * style.scale];
    let to_page = |[x, y]: Corner| [origin[0] + x * unit, origin[1] + y * unit];
    // A quarter of a cell.
    let decimals = (-(unit / 4.0).log10()).ceil().clamp(0.0, 6.0) as usize;
    let mut paths: Vec<(OwnerId, String)> = Vec::new();
    for (shade, outlines) in shades.iter().zip(&outlines).filter(|(_, outlines)| !outlines.is_empty()) {
        let color = lit.color(scene, shade.material, shade.strength(), style.background);
        let mut data = String::new();
        outlines.iter().for_each(|outline| push_outline(&mut data, outline, to_page, decimals));
        paths.push((shade.owner, format!("<path fill=\"{color}\" d=\"{data}\"/>")));
    }
    let mut page = PageWriter {
        style,
        names: named.then(|| Names::new(scene, '-')),
        ordinals: HashMap::new(),
        out: String::new(),
    };
    page.groups(&paths);
    let visible = Visible { style, depths: &depths, size, placement };
    page.with_strokes(scene, &visible, prefix)
}

/// Appends a closed outline to path data, in relative coordinates of so many decimals.
fn push_outline(
    data: &mut String,
    outline: &[Corner],
    to_page: impl Fn(Corner) -> [f64; 2],
    decimals: usize,
) {
    let scale = 10_f64.powi(decimals as i32);
    let mut last: Option<[f64; 2]> = None;
    for corner in outline {
        let at = to_page(*corner).map(|x| (x * scale).round());
        let [x, y] = last.map_or(at, |last| [at[0] - last[0], at[1] - last[1]]);
        if last.is_some() && x == 0.0 && y == 0.0 {
            continue;
        }
        data.push(if last.is_none() { 'M' } else { 'l' });
        push_number(data, x / scale, decimals, false);
        push_number(data, y / scale, decimals, true);
        last = Some(at);
    }
    data.push('z');
}

/// Appends a number of path data, as short as it can be; `after` another one.
fn push_number(data: &mut String, x: f64, decimals: usize, after: bool) {
    let start = data.len();
    number::push(data, x, decimals);
    if data[start..].starts_with("0.") {
        data.remove(start);
    }
    // A sign separates, too.
    if after && !data[start..].starts_with('-') {
        data.insert(start, ' ');
    }
}

/// Writes the elements.
struct PageWriter<'a> {
    style: Style<'a>,
    names: Option<Names<'a>>,
    /// Elements of each module so far.
    ordinals: HashMap<OwnerId, u32>,
    out: String,
}

impl PageWriter<'_> {
    /// The `id` of the next element of a module: its name, then its name and a number from 2. Empty in a picture without names.
    fn id(&mut self, owner: OwnerId) -> String {
        let Some(names) = &self.names else { return String::new() };
        let ordinal = self.ordinals.entry(owner).or_default();
        *ordinal += 1;
        match ordinal {
            1 => format!(" id=\"{}\"", names.get(owner)),
            ordinal => format!(" id=\"{}.{ordinal}\"", names.get(owner)),
        }
    }

    /// The paths of each module, in a group that has its name.
    fn groups(&mut self, paths: &[(OwnerId, String)]) {
        for group in paths.chunk_by(|a, b| a.0 == b.0) {
            let lines: Vec<&str> = group.iter().map(|(_, path)| &**path).collect();
            self.group(group[0].0, &lines);
        }
    }

    /// Elements of one module that have one name.
    fn group(&mut self, owner: OwnerId, lines: &[&str]) {
        let id = self.id(owner);
        let is_group = !id.is_empty();
        if is_group {
            let _ = writeln!(self.out, "<g{id}>");
        }
        for line in lines {
            let _ = writeln!(self.out, "{line}");
        }
        if is_group {
            self.out.push_str("</g>\n");
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
        for index in order {
            let segment = &scene.segments[index];
            let parts: Vec<(&str, String)> = (visible.parts(segment).iter())
                .filter_map(|part| strokes.stroke(part, index, false))
                .map(|stroke| match stroke {
                    Stroke::Element { name, attributes } => (name, attributes),
                    Stroke::Path { attributes, data } => ("path", format!("{attributes} d=\"{data}\"")),
                })
                .collect();
            match &parts[..] {
                [] => {}
                [(name, attributes)] => {
                    let id = self.id(segment.owner);
                    let _ = writeln!(self.out, "<{name}{id}{attributes}/>");
                }
                parts => {
                    let lines: Vec<String> =
                        parts.iter().map(|(name, attributes)| format!("<{name}{attributes}/>")).collect();
                    let lines: Vec<&str> = lines.iter().map(String::as_str).collect();
                    self.group(segment.owner, &lines);
                }
            }
        }
        let definitions = strokes.definitions();
        match definitions.is_empty() {
            true => self.out,
            false => format!("<defs>\n{definitions}</defs>\n{}", self.out),
        }
    }
}
