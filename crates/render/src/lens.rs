//! A camera with the pixels of its picture: where points come to lie, how large things are there, and what is outside.

use super::{Camera, Fit};
use crate::raster::{Corner, Place};
use dlsys_geometry::scene::{Point, Vector};

/// A camera, and the pixels that it fills.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lens {
    pub(super) camera: Camera,
    /// A point that the camera sees at x, y is at `a x + b` and `c - a y` pixels from the upper left corner.
    placement: [f64; 3],
    /// Width and height in pixels.
    pub(super) size: [usize; 2],
    /// Depths of the rasteriser in a scene unit, in the plane of focus.
    depth: f64,
}

impl Lens {
    pub(super) fn new(fit: &Fit, size: [u32; 2], placement: [f64; 3]) -> Lens {
        let depth = if fit.extent > 0.0 { 1.0 / fit.extent } else { 1.0 };
        Lens { camera: fit.camera, placement, size: size.map(|side| side as usize), depth }
    }

    /// Pixels in a scene unit at a point; 0 behind the viewer.
    pub(super) fn scale_at(&self, p: Point) -> f64 {
        self.camera.ahead(p).map_or(0.0, |seen| self.placement[0] * self.camera.magnification(seen.z))
    }

    /// Pixels in a scene unit in the plane of focus.
    pub(super) fn scale(&self) -> f64 {
        self.placement[0]
    }

    /// The place of a point in the picture; one behind the viewer has an undefined depth.
    pub(super) fn place(&self, p: Point) -> Place {
        let [a, b, c] = self.placement;
        match self.camera.ahead(p) {
            Some(p) => Corner { x: a * p.x + b, y: c - a * p.y, depth: p.z * self.depth }.place(),
            None => Place { x: 0, y: 0, depth: f32::NAN },
        }
    }

    /// The direction of a normal, to the right, up and towards the viewer.
    pub(super) fn normal(&self, v: Vector) -> [f32; 3] {
        let v = self.camera.direction(v);
        [v.x as f32, v.y as f32, v.z as f32]
    }

    /// The point that the camera sees in the middle of a pixel at a depth of the rasteriser, as the camera projects it.
    pub(super) fn seen(&self, [column, row]: [usize; 2], depth: f64) -> Point {
        let at = self.at([column as f64 + 0.5, row as f64 + 0.5]);
        Point::new(at.x, at.y, depth / self.depth)
    }

    /// What the camera sees at a place in pixels, in the plane of focus, as the camera projects it.
    pub(super) fn at(&self, [x, y]: [f64; 2]) -> Point {
        let [a, b, c] = self.placement;
        Point::new((x - b) / a, (c - y) / a, 0.0)
    }

    /// The first and the last column, and row, of the picture that a ball may touch.
    pub(super) fn pixels(&self, centre: Point, radius: f64) -> [[usize; 2]; 2] {
        let last = self.size.map(|side| side.saturating_sub(1));
        match self.reach(centre, radius) {
            None => last.map(|last| [0, last]),
            Some((middle, reach)) => [0, 1].map(|k| {
                // Saturates below 0.
                [middle[k] - reach, middle[k] + reach].map(|at| (at as usize).min(last[k]))
            }),
        }
    }

    /// The least and the greatest depth of a ball, as the camera projects it; the greatest is infinite if the viewer is in it.
    pub(super) fn depths(&self, centre: Point, radius: f64) -> [f64; 2] {
        let along = self.camera.view().towards() * radius;
        let depth = |at: Point| self.camera.ahead(at).map_or(f64::INFINITY, |seen| seen.z);
        [depth(centre - along), depth(centre + along)]
    }

    /// How much larger things are at a depth of the rasteriser than in the plane of focus.
    pub(super) fn magnification(&self, depth: f64) -> f64 {
        self.camera.magnification(depth / self.depth)
    }

    /// The most pixels in a scene unit within a ball; `None` if it is outside of the picture.
    pub(super) fn scale_of(&self, centre: Point, radius: f64) -> Option<f64> {
        let towards = self.camera.towards(centre) * radius;
        let nearest = self.scale_at(centre + towards).max(self.scale_at(centre));
        // Within the ball, the viewer sees it at any size.
        let scale = if nearest > 0.0 { nearest } else { self.scale_at(centre - towards) };
        (!self.misses(centre, radius)).then_some(scale)
    }

    /// Pixels in a scene unit for a surface in a ball; 0 if it is outside of the picture. One that comes very near to the viewer is as large as a
    /// quarter of the distance of its middle makes it: what is nearer is few of its points, and larger than the picture.
    pub(super) fn scale_within(&self, centre: Point, radius: f64) -> f64 {
        const NEAREST: f64 = 4.0;
        if self.misses(centre, radius) {
            return 0.0;
        }
        let towards = self.camera.towards(centre) * radius;
        let (middle, nearest) = (self.scale_at(centre), self.scale_at(centre + towards));
        match middle > 0.0 {
            true if nearest > 0.0 => nearest.clamp(middle, NEAREST * middle),
            true => NEAREST * middle,
            false => NEAREST * self.scale_at(centre - towards),
        }
    }

    /// The place of the middle of a ball in the picture, and a distance beyond which nothing of it is seen, in pixels; `None` if the viewer is in it, or
    /// it is behind.
    fn reach(&self, centre: Point, radius: f64) -> Option<([f64; 2], f64)> {
        let nearest = self.camera.ahead(centre + self.camera.towards(centre) * radius)?;
        let [a, b, c] = self.placement;
        let seen = self.camera.project(centre);
        let reach = 1.5 * radius * a * self.camera.magnification(nearest.z);
        Some(([a * seen.x + b, c - a * seen.y], reach))
    }

    /// True if a ball is outside of the picture.
    pub(super) fn misses(&self, centre: Point, radius: f64) -> bool {
        let Some(([x, y], reach)) = self.reach(centre, radius) else {
            return self.camera.ahead(centre - self.camera.view().towards() * radius).is_none();
        };
        let [width, height] = self.size.map(|side| side as f64);
        x + reach < 0.0 || y + reach < 0.0 || x - reach > width || y - reach > height
    }
}

/// The part of a flat outline that is in front of the viewer and in the picture, or beside it by no more than its width and height.
pub(super) fn clip(outline: &[Point], lens: &Lens) -> Vec<Point> {
    /// Nearer to the viewer than this part of the distance to the plane of focus, nothing is seen.
    const NEAREST: f64 = 2e-3;
    let [a, b, c] = lens.placement;
    let [width, height] = lens.size.map(|side| side as f64);
    // Each is not negative within, and linear in space.
    let sides: [&dyn Fn([f64; 3]) -> f64; 5] = [
        &|[_, _, w]| w - NEAREST,
        &|[x, _, w]| a * x + (b + width) * w,
        &|[x, _, w]| (2.0 * width - b) * w - a * x,
        &|[_, y, w]| (c + height) * w - a * y,
        &|[_, y, w]| a * y + (2.0 * height - c) * w,
    ];
    let mut outline = outline.to_vec();
    for side in sides {
        let inside = |p: &Point| side(lens.camera.homogeneous(*p));
        let mut kept = Vec::new();
        for (i, p) in outline.iter().enumerate() {
            let q = &outline[(i + 1) % outline.len()];
            let (here, there) = (inside(p), inside(q));
            if here >= 0.0 {
                kept.push(*p);
            }
            if (here >= 0.0) != (there >= 0.0) {
                kept.push(p + (q - p) * (here / (here - there)));
            }
        }
        outline = kept;
    }
    outline
}
