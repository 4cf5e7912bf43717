//! A vessel that scoops, lifts and is tipped out.

use std::sync::Arc;

use dlsys_wind::study::Convergence;
use nalgebra::Rotation3;

use super::integral;
use crate::{Body, Description, Error, Extent, Ground, Relief, Settings, Soil, Vector};

/// An open box as a closed mesh, around the origin: half its outer width, half its height and the thickness of its walls and of its bottom.
pub fn vessel(half: f64, height: f64, wall: f64) -> (Vec<Vector>, Arc<[[u32; 3]]>) {
    let mut points = Vec::new();
    // Rings of four corners: outside below, outside above, inside above, inside below.
    for (half, y) in [(half, -height), (half, height), (half - wall, height), (half - wall, wall - height)] {
        points.extend(
            [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
                .map(|(x, z)| Vector::new(half * x, y, half * z)),
        );
    }
    let mut triangles = vec![[0, 1, 2], [0, 2, 3], [12, 14, 13], [12, 15, 14]];
    for ring in [0, 4, 8] {
        for n in 0..4 {
            let [a, b] = [ring + n, ring + (n + 1) % 4];
            triangles.extend([[a, a + 4, b], [b, a + 4, b + 4]]);
        }
    }
    (points, triangles.into())
}

/// The way of a vessel through sand: pressed down until sand flows in, held, lifted, and turned over.
struct Digging {
    ground: Ground,
    points: Vec<Vector>,
    triangles: Arc<[[u32; 3]]>,
    /// Its height and its turn at the moment.
    place: (f64, f64),
}

/// Half the height of the vessel, in m.
const HEIGHT: f64 = 0.05;

impl Digging {
    fn new(n: i32) -> Result<Digging, Error> {
        let cell = 0.1 / f64::from(n);
        let description = Description {
            cell,
            extent: Extent::around(5 * n),
            soil: Soil { push: 1.0, ..Soil::sand() },
            bed: Relief::Level(-0.3),
            depth: Relief::Level(0.3),
        };
        let ground = Ground::new(description, Settings::default())?;
        let (points, triangles) = vessel(0.1, HEIGHT, 0.03);
        Ok(Digging { ground, points, triangles, place: (0.06, 0.0) })
    }

    fn points(&self, (height, turn): (f64, f64)) -> Arc<[Vector]> {
        let rotation = Rotation3::from_axis_angle(&Vector::x_axis(), turn);
        self.points.iter().map(|point| rotation * point + Vector::y() * height).collect()
    }

    /// Moves to a height (m) and a turn (rad) in some ticks.
    fn go(&mut self, to: (f64, f64), ticks: u32) -> Result<(), Error> {
        let from = self.place;
        for tick in 1..=ticks {
            let part = f64::from(tick) / f64::from(ticks);
            let next = (from.0 + (to.0 - from.0) * part, from.1 + (to.1 - from.1) * part);
            let body = Body {
                id: 0,
                name: "a vessel".to_owned(),
                triangles: self.triangles.clone(),
                from: self.points(self.place),
                to: self.points(next),
                shelf: false,
            };
            self.ground.advance(&[], &[body])?;
            self.place = next;
        }
        Ok(())
    }

    /// Pressed down, held, lifted.
    fn scoop(&mut self) -> Result<(), Error> {
        self.go((-HEIGHT - 0.02, 0.0), 60)?;
        self.go((-HEIGHT - 0.02, 0.0), 60)?;
        self.go((0.3, 0.0), 60)
    }

    /// Volume by which the ground stands higher than at the beginning, in m³.
    fn gained(&self) -> f64 {
        integral(&self.ground, |_, _, height| height)
    }
}

/// A vessel that is pressed into sand and lifted: the hole that it leaves, less the heap around, relative to what it carries.
///
/// # Errors
///
/// An error of the ground, which is a defect.
pub fn scoop() -> Result<Vec<Convergence>, Error> {
    let mut found = Vec::new();
    for n in [4, 6, 8] {
        let mut digging = Digging::new(n)?;
        digging.scoop()?;
        found.push((f64::from(n), -digging.gained() / digging.ground.carried()));
    }
    Ok(Convergence::rows("scooped sand: hole less heap (volumes carried)", 1.0, &found))
}

/// The same, turned over: what lies on the ground again, relative to what was carried.
///
/// # Errors
///
/// An error of the ground, which is a defect.
pub fn tip() -> Result<Vec<Convergence>, Error> {
    let mut found = Vec::new();
    for n in [4, 6, 8] {
        let mut digging = Digging::new(n)?;
        digging.scoop()?;
        let (carried, before) = (digging.ground.carried(), digging.gained());
        digging.go((0.3, std::f64::consts::PI), 120)?;
        digging.go((0.3, std::f64::consts::PI), 60)?;
        found.push((f64::from(n), (digging.gained() - before) / carried));
    }
    Ok(Convergence::rows("tipped out: what is back on the ground (volumes carried)", 1.0, &found))
}
