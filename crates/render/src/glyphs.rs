//! Letters for the captions of PNG pictures: the characters of a time, drawn with a round pen.
//!
//! A font file would be a megabyte for fifteen characters. A glyph consists of lines and arcs of ellipses, in a box
//! one half wide, with capitals and digits 0.7 high and small letters 0.5.

use super::raster::{self, Corner, Image, Plain};
use dlsys_geometry::scene::{Color, sin_cos_degrees};

/// Width of the pen, and from the middle of one glyph to the middle of the next, in sizes of letters.
const PEN: f64 = 0.075;
const ADVANCE: f64 = 0.54;
/// Degrees of an arc that are one line.
const ARC_STEP: f64 = 15.0;
/// Corners of a round end.
const ROUND: usize = 12;

/// A line of text, in pixels.
pub(super) struct GlyphLine<'a> {
    pub(super) middle: f64,
    pub(super) base: f64,
    /// Size of the letters.
    pub(super) size: f64,
    pub(super) text: &'a str,
}

/// A stroke of the pen. Coordinates go to the right from the middle of the glyph and up from the base line.
enum Stroke {
    Lines(&'static [[f64; 2]]),
    /// Part of an ellipse: centre, radii, from and to which angle (degrees, counter-clockwise from the right).
    Arc([f64; 2], [f64; 2], [f64; 2]),
}

use Stroke::{Arc, Lines};

/// The strokes of a character; none if it is not known.
fn strokes(character: char) -> &'static [Stroke] {
    match character {
        '0' => &[Arc([0.0, 0.35], [0.2, 0.35], [0.0, 360.0])],
        '1' => &[Lines(&[[-0.14, 0.55], [0.03, 0.7], [0.03, 0.0]])],
        '2' => {
            &[Arc([0.0, 0.5], [0.19, 0.2], [165.0, -35.0]), Lines(&[[0.156, 0.385], [-0.2, 0.0], [0.2, 0.0]])]
        }
        '3' => &[
            Arc([-0.01, 0.53], [0.17, 0.17], [150.0, -90.0]),
            Arc([-0.01, 0.18], [0.2, 0.18], [90.0, -150.0]),
        ],
        '4' => &[Lines(&[[0.09, 0.0], [0.09, 0.7], [-0.22, 0.2], [0.22, 0.2]])],
        '5' => &[
            Lines(&[[0.17, 0.7], [-0.15, 0.7], [-0.17, 0.37]]),
            Arc([-0.02, 0.22], [0.21, 0.22], [135.0, -145.0]),
        ],
        '6' => &[Arc([0.0, 0.21], [0.2, 0.21], [0.0, 360.0]), Arc([0.2, 0.21], [0.4, 0.49], [180.0, 97.0])],
        '7' => &[Lines(&[[-0.2, 0.7], [0.2, 0.7], [-0.08, 0.0]])],
        '8' => &[Arc([0.0, 0.53], [0.165, 0.17], [0.0, 360.0]), Arc([0.0, 0.18], [0.2, 0.18], [0.0, 360.0])],
        '9' => &[Arc([0.0, 0.49], [0.2, 0.21], [0.0, 360.0]), Arc([-0.2, 0.49], [0.4, 0.49], [0.0, -83.0])],
        '.' => &[Lines(&[[0.0, 0.0], [0.0, 0.01]])],
        '-' => &[Lines(&[[-0.15, 0.26], [0.15, 0.26]])],
        '+' => &[Lines(&[[-0.18, 0.28], [0.18, 0.28]]), Lines(&[[0.0, 0.1], [0.0, 0.46]])],
        '=' => &[Lines(&[[-0.19, 0.37], [0.19, 0.37]]), Lines(&[[-0.19, 0.19], [0.19, 0.19]])],
        'e' => &[Arc([0.0, 0.24], [0.2, 0.24], [0.0, 320.0]), Lines(&[[-0.2, 0.24], [0.2, 0.24]])],
        't' => &[
            Lines(&[[-0.04, 0.64], [-0.04, 0.13]]),
            Arc([0.07, 0.13], [0.11, 0.13], [180.0, 290.0]),
            Lines(&[[-0.15, 0.48], [0.13, 0.48]]),
        ],
        _ => &[],
    }
}

/// Draws lines of text in a picture of this size.
pub(super) fn draw(size: [u32; 2], lines: &[GlyphLine], color: Color) -> Image {
    let mut triangles: Vec<[Corner; 3]> = Vec::new();
    for line in lines {
        let count = line.text.chars().count();
        for (i, character) in line.text.chars().enumerate() {
            let x = line.middle + line.size * ADVANCE * (i as f64 - (count as f64 - 1.0) / 2.0);
            let place = |[right, up]: [f64; 2]| [x + right * line.size, line.base - up * line.size];
            for stroke in strokes(character) {
                let points: Vec<[f64; 2]> = points(stroke).into_iter().map(place).collect();
                pen(&points, PEN * line.size / 2.0, &mut triangles);
            }
        }
    }
    let [width, height] = size.map(|side| side as usize);
    let mut pixels = vec![[0; 4]; width * height];
    let triangles = Plain { triangles: &triangles, color: [color.red, color.green, color.blue] };
    raster::draw(&raster::SIXTEEN, 1, [width, height], &triangles, &mut pixels);
    Image { width, height, pixels }
}

/// The points of a stroke.
fn points(stroke: &Stroke) -> Vec<[f64; 2]> {
    match *stroke {
        Lines(points) => points.to_vec(),
        Arc([x, y], [rx, ry], [from, to]) => {
            let steps = ((to - from).abs() / ARC_STEP).ceil();
            let angle = |i: usize| sin_cos_degrees(from + (to - from) * i as f64 / steps);
            (0..=steps as usize).map(angle).map(|(sin, cos)| [x + rx * cos, y + ry * sin]).collect()
        }
    }
}

/// Draws with a round pen of this radius.
fn pen(points: &[[f64; 2]], radius: f64, triangles: &mut Vec<[Corner; 3]>) {
    let corner = |[x, y]: [f64; 2]| Corner { x, y, depth: 0.0 };
    for &[x, y] in points {
        let around = |k: usize| {
            let (sin, cos) = sin_cos_degrees(360.0 * k as f64 / ROUND as f64);
            corner([x + radius * cos, y + radius * sin])
        };
        triangles.extend((1..ROUND - 1).map(|k| [around(0), around(k), around(k + 1)]));
    }
    for pair in points.windows(2) {
        let [[ax, ay], [bx, by]] = [pair[0], pair[1]];
        let length = (bx - ax).hypot(by - ay).max(f64::MIN_POSITIVE);
        let (nx, ny) = (-(by - ay) / length * radius, (bx - ax) / length * radius);
        let [p, q, r, s] =
            [[ax + nx, ay + ny], [bx + nx, by + ny], [bx - nx, by - ny], [ax - nx, ay - ny]].map(corner);
        triangles.extend([[p, q, r], [p, r, s]]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_that_a_time_consists_of_is_known_and_stays_in_its_box() {
        for time in [0.0, 1234567890.0, -1.5e-7, 1e300] {
            for character in format!("t = {time:?}").chars().filter(|c| *c != ' ') {
                let places: Vec<[f64; 2]> = strokes(character).iter().flat_map(points).collect();
                assert!(!places.is_empty(), "{character}");
                for [x, y] in places {
                    assert!(x.abs() <= 0.23 && (-0.01..=0.71).contains(&y), "{character}: {x},{y}");
                }
            }
        }
    }

    #[test]
    fn text_stands_in_the_middle() {
        let line = GlyphLine { middle: 20.0, base: 15.0, size: 10.0, text: "-" };
        let image = draw([40, 20], &[line], Color::hex(0));
        let inked = |x: usize, y: usize| image.pixels[y * 40 + x][3];
        assert!(inked(20, 12) > 100 && inked(10, 12) == 0 && inked(20, 5) == 0);
    }
}
