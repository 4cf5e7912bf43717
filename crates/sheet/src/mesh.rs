//! What a sheet is made of: a mesh of faces and cords, and a tissue.

use crate::error::check;
use crate::{Error, Vector};

/// Largest number of points.
pub const MOST_POINTS: usize = 1_000_000;

/// A mesh of faces and cords at rest, in plain numbers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Points in m.
    pub points: Vec<Vector>,
    /// Faces: three or more points each, in order around the face. They should be flat and convex.
    pub faces: Vec<Vec<usize>>,
    /// Cords: two points each.
    pub cords: Vec<[usize; 2]>,
}

impl Mesh {
    /// A rectangle of `columns` × `rows` quads with a corner at `origin` and the given sides.
    pub fn rectangle(origin: Vector, sides: [Vector; 2], [columns, rows]: [usize; 2]) -> Mesh {
        let place = |i: usize, j: usize| {
            origin + sides[0] * (i as f64 / columns as f64) + sides[1] * (j as f64 / rows as f64)
        };
        let points = (0..=rows).flat_map(|j| (0..=columns).map(move |i| place(i, j))).collect();
        let index = |i: usize, j: usize| j * (columns + 1) + i;
        let quad = |i, j| vec![index(i, j), index(i + 1, j), index(i + 1, j + 1), index(i, j + 1)];
        let faces = (0..rows).flat_map(|j| (0..columns).map(move |i| quad(i, j))).collect();
        Mesh { points, faces, cords: Vec::new() }
    }

    /// A cord of `parts` straight pieces between two points.
    pub fn cord(from: Vector, to: Vector, parts: usize) -> Mesh {
        let points = (0..=parts).map(|k| from + (to - from) * (k as f64 / parts as f64)).collect();
        Mesh { points, faces: Vec::new(), cords: (0..parts).map(|k| [k, k + 1]).collect() }
    }

    pub(crate) fn check(&self) -> Result<(), Error> {
        let points = self.points.len();
        if !(1..=MOST_POINTS).contains(&points) {
            return Err(Error::Points { points, most: MOST_POINTS });
        }
        for coordinate in self.points.iter().flat_map(|point| point.iter()) {
            check("a coordinate (m)", *coordinate, true, "a finite number")?;
        }
        for (index, face) in self.faces.iter().enumerate() {
            let bad = |what| Err(Error::Element { element: "face", index, what });
            if face.len() < 3 {
                return bad("it has fewer than three points");
            }
            self.check_points("face", index, face)?;
        }
        for (index, cord) in self.cords.iter().enumerate() {
            self.check_points("cord", index, cord)?;
            if self.points[cord[0]] == self.points[cord[1]] {
                return Err(Error::Element { element: "cord", index, what: "its length is 0" });
            }
        }
        self.check_edges()
    }

    fn check_points(&self, element: &'static str, index: usize, corners: &[usize]) -> Result<(), Error> {
        let mut sorted = corners.to_vec();
        sorted.sort_unstable();
        if sorted.last().is_some_and(|last| *last >= self.points.len()) {
            return Err(Error::Element {
                element,
                index,
                what: "it has a point that the mesh does not have",
            });
        }
        if sorted.windows(2).any(|pair| pair[0] == pair[1]) {
            return Err(Error::Element { element, index, what: "it has a point twice" });
        }
        Ok(())
    }

    /// At most two faces share an edge.
    fn check_edges(&self) -> Result<(), Error> {
        let around = |face: &Vec<usize>| {
            let next = face.iter().cycle().skip(1);
            face.iter().zip(next).map(|(a, b)| [*a.min(b), *a.max(b)]).collect::<Vec<_>>()
        };
        let mut edges: Vec<[usize; 2]> = self.faces.iter().flat_map(around).collect();
        edges.sort_unstable();
        match edges.chunk_by(|a, b| a == b).find(|same| same.len() > 2) {
            Some(same) => Err(Error::Manifold { edge: same[0], faces: same.len() }),
            None => Ok(()),
        }
    }
}

/// The material of a sheet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tissue {
    /// Young's modulus in Pa.
    pub stiffness: f64,
    /// Density in kg/m³.
    pub density: f64,
    /// Damping ratio at 1 Hz, of a Kelvin-Voigt material: that of a vibration of f Hz is f times as large.
    pub damping: f64,
    /// Thickness of faces and diameter of cords, in m.
    pub thickness: f64,
    /// Poisson's ratio of faces.
    pub poisson: f64,
}

impl Tissue {
    /// A tissue with a Young's modulus (Pa), a density (kg/m³) and a thickness (m), a damping ratio of 0.05 at 1 Hz, and a Poisson's ratio of 0.3.
    pub fn new(stiffness: f64, density: f64, thickness: f64) -> Tissue {
        Tissue { stiffness, density, damping: 0.05, thickness, poisson: 0.3 }
    }

    pub(crate) fn check(&self) -> Result<(), Error> {
        let Tissue { stiffness, density, damping, thickness, poisson } = *self;
        check("a stiffness (Pa)", stiffness, stiffness >= 0.0, "0 or more")?;
        check("a density (kg/m³)", density, density > 0.0, "more than 0")?;
        check("a damping ratio", damping, damping >= 0.0, "0 or more")?;
        check("a thickness (m)", thickness, thickness > 0.0, "more than 0")?;
        check("a Poisson's ratio", poisson, (0.0..=0.5).contains(&poisson), "0 to 0.5")
    }

    /// τ of Kelvin-Voigt material in s: stress E (ε + τ ε').
    pub(crate) fn delay(&self) -> f64 {
        self.damping / std::f64::consts::PI
    }

    /// Stiffness against bending of a face, E t³/(12 (1 - ν²)), in N m.
    pub(crate) fn rigidity(&self) -> f64 {
        self.stiffness * self.thickness.powi(3) / (12.0 * (1.0 - self.poisson * self.poisson))
    }

    /// Section of a cord in m².
    pub(crate) fn section(&self) -> f64 {
        std::f64::consts::FRAC_PI_4 * self.thickness * self.thickness
    }

    /// Stiffness against bending of a cord, E π d⁴/64, in N m².
    pub(crate) fn cord_rigidity(&self) -> f64 {
        self.stiffness * std::f64::consts::PI * self.thickness.powi(4) / 64.0
    }
}
