//! The colours of a band's pixels, once it is known which triangle is seen at each sample.

use super::band::{Band, MIXED, NOTHING};
use super::lanes::LANES;
use super::list::List;
use super::{Place, STEPS, Triangles};

impl<const N: usize> Band<N> {
    /// The pixels of the rows from `top`. They are transparent before.
    pub(super) fn resolve(
        &self,
        triangles: &impl Triangles,
        list: &List,
        top: usize,
        pixels: &mut [[u8; 4]],
    ) {
        // Where something is drawn in front of nothing, too, all columns count.
        let [first, end] = if triangles.is_veiled() { [0, self.width] } else { self.touched };
        let mut between = Between::default();
        let mut color = |place: u32, pixel: [usize; 2]| {
            let number = list.numbers[place as usize] as usize;
            let weights = between.weights(number, || triangles.corners(number), pixel);
            triangles.shade(number, pixel, weights)
        };
        let surface = |place: u32| triangles.surface(list.numbers[place as usize] as usize);
        let is_veiled = triangles.is_veiled();
        for (line, pixels) in pixels.chunks_exact_mut(self.width.max(1)).enumerate() {
            let seen = &self.seen[line * self.stride..][first..end];
            let blocks = seen.chunks(LANES).zip(pixels[first..end].chunks_mut(LANES));
            for (block, (seen, pixels)) in blocks.enumerate() {
                // Most of a picture is empty.
                if !is_veiled && seen.iter().fold(NOTHING, |all, seen| all & seen) == NOTHING {
                    continue;
                }
                for (k, (seen, pixel)) in seen.iter().zip(pixels).enumerate() {
                    let at = [first + block * LANES + k, top + line];
                    *pixel = match *seen {
                        NOTHING if is_veiled => triangles.open(at),
                        NOTHING => continue,
                        seen @ MIXED.. => {
                            let shared = &self.shared[(seen - MIXED) as usize];
                            shared.mean(surface, |place| color(place, at), || triangles.open(at))
                        }
                        place => color(place, at),
                    };
                }
            }
        }
    }
}

/// Weights of corners in the middle of pixels, of one triangle after another.
#[derive(Default)]
struct Between {
    number: Option<usize>,
    corners: [[f64; 2]; 3],
    /// For the sides opposite of the first two corners the function of a place: `[a, b, c]`; in parts of the area.
    sides: [[f64; 3]; 2],
}

impl Between {
    /// The weights of a triangle's corners in the middle of a pixel, or at the place nearest to it if that is outside.
    fn weights(
        &mut self,
        number: usize,
        corners: impl FnOnce() -> [Place; 3],
        [column, row]: [usize; 2],
    ) -> [f64; 3] {
        if self.number != Some(number) {
            self.number = Some(number);
            let [p, q, r] = corners().map(|corner| [f64::from(corner.x), f64::from(corner.y)]);
            let area = (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);
            let side = |from: [f64; 2], to: [f64; 2]| {
                let (a, b) = ((from[1] - to[1]) / area, (to[0] - from[0]) / area);
                [a, b, -(a * from[0] + b * from[1])]
            };
            self.sides = [side(q, r), side(r, p)];
            self.corners = [p, q, r];
        }
        let middle = |at: usize| (at as i64 * STEPS + STEPS / 2) as f64;
        let (x, y) = (middle(column), middle(row));
        let [u, v] = self.sides.map(|[a, b, c]| a * x + b * y + c);
        let w = 1.0 - u - v;
        if u >= 0.0 && v >= 0.0 && w >= 0.0 {
            return [u, v, w];
        }
        nearest_on_sides(self.corners, [x, y])
    }
}

/// The weights of a triangle's corners at the place on its sides that is nearest to this one. Weights below zero that are only cut off give a
/// place far away along a narrow triangle.
fn nearest_on_sides(corners: [[f64; 2]; 3], [x, y]: [f64; 2]) -> [f64; 3] {
    let mut nearest = (f64::INFINITY, [1.0, 0.0, 0.0]);
    for k in 0..3 {
        let l = (k + 1) % 3;
        let ([px, py], [qx, qy]) = (corners[k], corners[l]);
        let (dx, dy) = (qx - px, qy - py);
        let part = (((x - px) * dx + (y - py) * dy) / (dx * dx + dy * dy)).clamp(0.0, 1.0);
        let (ex, ey) = (px + part * dx - x, py + part * dy - y);
        let distance = ex * ex + ey * ey;
        if distance < nearest.0 {
            let mut weights = [0.0; 3];
            (weights[k], weights[l]) = (1.0 - part, part);
            nearest = (distance, weights);
        }
    }
    nearest.1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_of_a_pixel_beside_a_narrow_triangle_are_those_of_the_place_next_to_it() {
        let place = |x: i32, y: i32| Place { x, y, depth: 0.0 };
        // Half a pixel wide at its upper end, 100 pixels long.
        let corners = [place(0, 25_600), place(0, 0), place(128, 0)];
        let mut between = Between::default();
        for row in 0..100 {
            let [low, left, right] = between.weights(0, || corners, [0, row]);
            let at = 25_600.0 * low / 256.0;
            assert!((at - (row as f64 + 0.5)).abs() < 1e-2 && left.abs() < 1e-12, "{row}: {at}, {left}");
            assert!((low + left + right - 1.0).abs() < 1e-12);
        }
        assert_eq!(between.weights(0, || corners, [1, 200]), [1.0, 0.0, 0.0]);
    }
}
