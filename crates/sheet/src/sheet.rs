//! Sheets: masses and springs made from a mesh and a tissue.

use crate::cord::{Bend, Cord};
use crate::elastic::{Assembly, Weights};
use crate::hinge::{Hinge, PAIRS};
use crate::matrix::Pattern;
use crate::membrane::Triangle;
use crate::{Error, Mesh, Tissue, Vector};

/// Cosine of the largest turn between two cords of which one continues the other: 45°.
const STRAIGHT: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// Most cords at a point of which some may continue others: the work goes with the square.
const STAR: usize = 64;

/// A flexible surface or net.
#[derive(Clone, Debug)]
pub struct Sheet {
    pub(crate) tissue: Tissue,
    pub(crate) rest: Vec<Vector>,
    pub(crate) masses: Vec<f64>,
    pub(crate) pinned: Vec<bool>,
    triangles: Vec<Triangle>,
    hinges: Vec<Hinge>,
    pub(crate) cords: Vec<Cord>,
    bends: Vec<Bend>,
    /// Triangles that meet the air and solids: faces with more corners are cut once.
    pub(crate) faces: Vec<[usize; 3]>,
    pub(crate) pattern: Pattern,
    pub(crate) extent: f64,
}

impl Sheet {
    /// A sheet at rest in the shape of a mesh. Points where `pinned` holds do not move; if there is none, the sheet falls.
    ///
    /// A face with more than three corners is cut into triangles in two ways, with half of the thickness each, so that its stiffness is the
    /// same along both diagonals.
    ///
    /// # Errors
    ///
    /// A value of the tissue that is out of range; a mesh that has no points or more than [`MOST_POINTS`](crate::MOST_POINTS), a face or cord that is
    /// not valid or has no size, more than two faces at an edge, a point without mass.
    pub fn new(mesh: &Mesh, tissue: &Tissue, pinned: impl Fn(Vector) -> bool) -> Result<Sheet, Error> {
        tissue.check()?;
        mesh.check()?;
        let x = &mesh.points;
        let count = x.len();
        let mut sheet = Sheet {
            tissue: *tissue,
            rest: x.clone(),
            masses: vec![0.0; count],
            pinned: x.iter().map(|point| pinned(*point)).collect(),
            triangles: Vec::new(),
            hinges: Vec::new(),
            cords: mesh.cords.iter().map(|cord| Cord::new(*cord, x, tissue)).collect(),
            bends: continuations(mesh).into_iter().map(|points| Bend::new(points, x, tissue)).collect(),
            faces: Vec::new(),
            pattern: Pattern::default(),
            extent: extent(x),
        };
        let cuts = if mesh.faces.iter().any(|face| face.len() > 3) { 2 } else { 1 };
        for cut in 0..cuts {
            sheet.cut(mesh, cut, 1.0 / cuts as f64)?;
        }
        for cord in &mesh.cords {
            let mass = tissue.density * tissue.section() * (x[cord[1]] - x[cord[0]]).norm();
            cord.iter().for_each(|point| sheet.masses[*point] += mass / 2.0);
        }
        if let Some(point) = sheet.masses.iter().position(|mass| *mass <= 0.0) {
            return Err(Error::Massless { point });
        }
        sheet.couple();
        Ok(sheet)
    }

    /// Adds the triangles and hinges of one of the two ways to cut faces.
    fn cut(&mut self, mesh: &Mesh, first: usize, share: f64) -> Result<(), Error> {
        let (x, tissue) = (&mesh.points, self.tissue);
        // Edges of triangles with the corner on the other side.
        let mut edges: Vec<([usize; 2], usize)> = Vec::new();
        for (index, face) in mesh.faces.iter().enumerate() {
            let corner = |k: usize| face[(first + k) % face.len()];
            for k in 1..face.len() - 1 {
                let points = [corner(0), corner(k), corner(k + 1)];
                let corners = points.map(|point| x[point]);
                let what = "its corners lie on a line, or three of them do";
                let triangle = Triangle::new(points, &corners, &tissue, share).ok_or(Error::Element {
                    element: "face",
                    index,
                    what,
                })?;
                let [a, b, c] = corners;
                let area = 0.5 * (b - a).cross(&(c - a)).norm();
                let mass = tissue.density * tissue.thickness * share * area;
                for k in 0..3 {
                    self.masses[points[k]] += mass / 3.0;
                    let [a, b, c] = [points[k], points[(k + 1) % 3], points[(k + 2) % 3]];
                    edges.push(([a.min(b), a.max(b)], c));
                }
                self.triangles.push(triangle);
                if first == 0 {
                    self.faces.push(points);
                }
            }
        }
        edges.sort_unstable();
        for pair in edges.chunk_by(|a, b| a.0 == b.0) {
            if let [(edge, c), (_, d)] = *pair {
                self.hinges.extend(Hinge::new([edge[0], edge[1], c, d], x, &tissue, share));
            }
        }
        Ok(())
    }

    /// Finds the pattern of the matrix, and the slots of all elements.
    fn couple(&mut self) {
        let mut pairs: Vec<[usize; 2]> = self.cords.iter().map(|cord| cord.points).collect();
        for bend in &self.bends {
            let [a, b, c] = bend.points;
            pairs.extend([[a, b], [b, c], [a, c]]);
        }
        for triangle in &self.triangles {
            let [a, b, c] = triangle.points;
            pairs.extend([[b, c], [c, a], [a, b]]);
        }
        for hinge in &self.hinges {
            pairs.extend(PAIRS.map(|(j, k)| [hinge.points[j], hinge.points[k]]));
        }
        self.pattern = Pattern::new(self.rest.len(), pairs);
        let slot = |a, b| self.pattern.slot(a, b);
        for cord in &mut self.cords {
            cord.slot = slot(cord.points[0], cord.points[1]);
        }
        for bend in &mut self.bends {
            let [a, b, c] = bend.points;
            bend.slots = [slot(a, b), slot(b, c), slot(a, c)];
        }
        for triangle in &mut self.triangles {
            let [a, b, c] = triangle.points;
            triangle.slots = [slot(b, c), slot(c, a), slot(a, b)];
        }
        for hinge in &mut self.hinges {
            hinge.slots = PAIRS.map(|(j, k)| slot(hinge.points[j], hinge.points[k]));
        }
    }

    /// The same, held at those of its points for which `pinned` is true; points beyond its end are free.
    pub fn pinned_at(mut self, pinned: &[bool]) -> Sheet {
        let values = pinned.iter().copied().chain(std::iter::repeat(false));
        self.pinned.iter_mut().zip(values).for_each(|(held, value)| *held = value);
        self
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.rest.len()
    }

    /// Whether there are no points; never true.
    pub fn is_empty(&self) -> bool {
        self.rest.is_empty()
    }

    /// Points at rest, in m.
    pub fn rest(&self) -> &[Vector] {
        &self.rest
    }

    /// Masses of the points in kg.
    pub fn masses(&self) -> &[f64] {
        &self.masses
    }

    /// Whether each point is held.
    pub fn pinned(&self) -> &[bool] {
        &self.pinned
    }

    /// The triangles that meet the air and solids.
    pub fn triangles(&self) -> &[[usize; 3]] {
        &self.faces
    }

    /// Largest side of the box around the sheet at rest, in m; at least its thickness.
    pub fn extent(&self) -> f64 {
        self.extent.max(self.tissue.thickness)
    }

    /// Elastic energy in J.
    pub fn elastic_energy(&self, x: &[Vector]) -> f64 {
        self.triangles.iter().map(|part| part.energy(x)).sum::<f64>()
            + self.hinges.iter().map(|part| part.energy(x)).sum::<f64>()
            + self.cords.iter().map(|part| part.energy(x)).sum::<f64>()
            + self.bends.iter().map(|part| part.energy(x)).sum::<f64>()
    }

    /// The strains of all elements: three of each triangle, one of each hinge, cord and bend.
    pub(crate) fn strains(&self, x: &[Vector], out: &mut Vec<f64>) {
        out.clear();
        self.triangles.iter().for_each(|part| out.extend(part.strains(x).iter()));
        out.extend(self.hinges.iter().map(|part| part.strain(x)));
        out.extend(self.cords.iter().map(|part| part.strain(x)));
        out.extend(self.bends.iter().map(|part| part.strain(x)));
    }

    /// Adds elastic and viscous forces, and their matrix. Viscosity counts from the strains `base`.
    pub(crate) fn assemble_elastic(
        &self,
        x: &[Vector],
        base: &[f64],
        weights: &Weights,
        assembly: &mut Assembly,
    ) {
        let (triples, rest) = base.split_at(3 * self.triangles.len());
        for (part, base) in self.triangles.iter().zip(triples.chunks_exact(3)) {
            part.assemble(x, &Vector::from_column_slice(base), weights, assembly);
        }
        let (hinges, rest) = rest.split_at(self.hinges.len());
        let (cords, bends) = rest.split_at(self.cords.len());
        self.hinges.iter().zip(hinges).for_each(|(part, base)| part.assemble(x, *base, weights, assembly));
        self.cords.iter().zip(cords).for_each(|(part, base)| part.assemble(x, *base, weights, assembly));
        self.bends.iter().zip(bends).for_each(|(part, base)| part.assemble(x, *base, weights, assembly));
    }
}

/// Largest side of the box around points.
fn extent(points: &[Vector]) -> f64 {
    let (mut least, mut most) = (points[0], points[0]);
    for point in points {
        least = least.inf(point);
        most = most.sup(point);
    }
    (most - least).max()
}

/// Triples of points along pairs of cords of which one continues the other: at each point, the straightest pairs first, each cord once.
fn continuations(mesh: &Mesh) -> Vec<[usize; 3]> {
    let mut ends: Vec<(usize, usize)> = mesh.cords.iter().flat_map(|&[a, b]| [(a, b), (b, a)]).collect();
    ends.sort_unstable();
    ends.dedup();
    let mut found = Vec::new();
    for star in ends.chunk_by(|a, b| a.0 == b.0).filter(|star| star.len() <= STAR) {
        let centre = mesh.points[star[0].0];
        let ways: Vec<Vector> =
            star.iter().map(|(_, end)| (mesh.points[*end] - centre).normalize()).collect();
        let mut pairs: Vec<(f64, usize, usize)> = (0..star.len())
            .flat_map(|i| (0..i).map(move |j| (i, j)))
            .map(|(i, j)| (ways[i].dot(&ways[j]), j, i))
            .filter(|pair| pair.0 < -STRAIGHT)
            .collect();
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        let mut taken = vec![false; star.len()];
        for (_, i, j) in pairs {
            if !taken[i] && !taken[j] {
                (taken[i], taken[j]) = (true, true);
                found.push([star[i].1, star[i].0, star[j].1]);
            }
        }
    }
    found
}
