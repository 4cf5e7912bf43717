//! Pictures on triangles: which place of a picture a place of a triangle in pixels shows, and what is cut out of it.
//!
//! Places in a picture are no linear functions of places in pixels where what is nearer is larger; but each of them times the magnification is, and so is
//! the magnification itself (Heckbert and Moreton 1991, *Interpolation for polygon texture mapping and shading*).

use dlsys_geometry::scene::{Drawn, Footprint, Texture};

/// The picture on a triangle, as functions of a place in pixels.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mapping {
    /// Both coordinates of the picture times the magnification, and the magnification: at the origin, and what a pixel to the right and one down add.
    origin: [f64; 3],
    right: [f64; 3],
    down: [f64; 3],
}

/// A corner: its place in pixels, its place in the picture, and how much larger things are there than in the plane of focus.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pinned {
    pub(super) at: [f64; 2],
    pub(super) place: [f64; 2],
    pub(super) magnification: f64,
}

impl Mapping {
    /// `None` if the triangle has no area.
    pub(super) fn new(corners: [Pinned; 3]) -> Option<Mapping> {
        let [p, q, r] = corners.map(|corner| corner.at);
        let area = (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);
        if area == 0.0 || !area.is_finite() {
            return None;
        }
        let values = corners.map(|Pinned { place: [u, v], magnification: m, .. }| [u * m, v * m, m]);
        let slope = |along: [f64; 2], k: usize| {
            let [b, c] = [values[1][k] - values[0][k], values[2][k] - values[0][k]];
            (b * along[1] - c * along[0]) / area
        };
        let right = [0, 1, 2].map(|k| slope([q[1] - p[1], r[1] - p[1]], k));
        let down = [0, 1, 2].map(|k| -slope([q[0] - p[0], r[0] - p[0]], k));
        let origin = [0, 1, 2].map(|k| values[0][k] - right[k] * p[0] - down[k] * p[1]);
        Some(Mapping { origin, right, down })
    }

    /// What a pixel shows whose middle is there. The place must be in the triangle: behind the viewer there is nothing.
    pub(super) fn print(&self, [x, y]: [f64; 2]) -> Footprint {
        let [u, v, m] = [0, 1, 2].map(|k| self.origin[k] + self.right[k] * x + self.down[k] * y);
        let at = [u / m, v / m];
        let step = |by: [f64; 3]| [0, 1].map(|k| (by[k] - at[k] * by[2]) / m);
        Footprint { at, steps: [step(self.right), step(self.down)] }
    }

    /// What a pixel shows whose middle is between the corners, with these weights.
    pub(super) fn print_between(&self, corners: [Pinned; 3], weights: [f64; 3]) -> Footprint {
        self.print([0, 1].map(|k| (0..3).map(|i| corners[i].at[k] * weights[i]).sum()))
    }
}

/// What is cut out of a triangle.
pub(super) struct Cut<'t> {
    texture: &'t Texture,
    mapping: Mapping,
    /// The part of a pixel for which it is decided at once.
    part: f64,
}

impl<'t> Cut<'t> {
    /// `None` if nothing is cut out of the picture. There are so many decisions in a pixel.
    pub(super) fn new(texture: &'t Texture, corners: [Pinned; 3], count: usize) -> Option<Cut<'t>> {
        let mapping = Mapping::new(corners).filter(|_| texture.picture.is_cut_out())?;
        Some(Cut { texture, mapping, part: 1.0 / (count as f64).sqrt() })
    }

    /// Whether the triangle is drawn at a place in it.
    pub(super) fn is_drawn(&self, at: [f64; 2]) -> bool {
        let print = self.mapping.print(at);
        self.texture.is_drawn(print.at, self.apart(&print))
    }

    /// Distance in texels of the places at which it is decided.
    fn apart(&self, Footprint { steps: [a, b], .. }: &Footprint) -> f64 {
        let [width, height] = self.texture.picture.size().map(|side| side as f64);
        ((a[0] * b[1] - a[1] * b[0]).abs() * width * height).sqrt() * self.part
    }

    /// How much of the triangle is drawn in a pixel.
    pub(super) fn in_pixel(&self, [column, row]: [usize; 2]) -> Drawn {
        let print = self.mapping.print([column as f64 + 0.5, row as f64 + 0.5]);
        let reach = [0, 1].map(|k| print.steps[0][k].abs() + print.steps[1][k].abs());
        let corner = |sign: f64| [0, 1].map(|k| print.at[k] + sign * reach[k]);
        self.texture.drawn([corner(-1.0), corner(1.0)], self.apart(&print))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of a square that leads away from the viewer, the middle of the picture is where its diagonals meet, not in the middle of its height.
    #[test]
    fn what_is_nearer_shows_less_of_the_picture() {
        let pinned =
            |x: f64, y: f64, u: f64, v: f64, m: f64| Pinned { at: [x, y], place: [u, v], magnification: m };
        let near = [pinned(0.0, 100.0, 0.0, 0.0, 4.0), pinned(100.0, 100.0, 1.0, 0.0, 4.0)];
        let far = [pinned(62.5, 0.0, 1.0, 1.0, 1.0), pinned(37.5, 0.0, 0.0, 1.0, 1.0)];
        for corners in [[near[0], near[1], far[0]], [near[0], far[0], far[1]]] {
            let mapping = Mapping::new(corners).expect("an area");
            for corner in corners {
                let [u, v] = mapping.print(corner.at).at;
                assert!((u - corner.place[0]).abs() + (v - corner.place[1]).abs() < 1e-12);
            }
            // The diagonals meet at a fifth of the height.
            let print = mapping.print([50.0, 20.0]);
            assert!((print.at[0] - 0.5).abs() + (print.at[1] - 0.5).abs() < 1e-12, "{print:?}");
            // Steps are those to the next pixels, to the first order.
            let (small, next) = (1e-6, mapping.print([50.0, 20.0 + 1e-6]).at);
            assert!(((next[1] - print.at[1]) / small - print.steps[1][1]).abs() < 1e-4);
        }
        assert!(Mapping::new([near[0]; 3]).is_none());
    }
}
