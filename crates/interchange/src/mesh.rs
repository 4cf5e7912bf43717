//! Triangles of a form: which they are does not depend on its numbers, where their corners lie does.

use std::sync::Arc;

use dlsys_geometry::scene::{MaterialId, Mesh, Net, Palette, Patch, Point, Vector};
use dlsys_render::{cross_section, normal, triangulate};

use crate::part::{Catalogue, Form, Number, Paint, Part, any_across, stem_point, stem_radii, triple};
use crate::stem::{Corner, Tube};

/// Corners of one material in their places.
#[derive(Clone, Debug, Default)]
pub(crate) struct Places {
    pub(crate) positions: Vec<[f32; 3]>,
    pub(crate) normals: Vec<[f32; 3]>,
}

/// The triangles of a form, by material.
pub(crate) struct Layout {
    pieces: Vec<Piece>,
    /// The material and the triangles of each primitive.
    pub(crate) primitives: Vec<(MaterialId, Vec<u32>)>,
}

/// The corners of a part, or of those of its faces that have one material.
struct Piece {
    /// Number of the primitive, and of the first number of the part.
    primitive: usize,
    first: usize,
    shape: PieceShape,
}

enum PieceShape {
    Stem(Tube),
    Polygon(usize),
    /// These corners of a mesh; the limits of its coordinates.
    Surface(Arc<Mesh>, Vec<u32>, [f64; 3]),
    /// Pieces from column to column and from row to row.
    Patch(usize, usize),
    /// These corners of a mesh whose vertices move.
    Net(Arc<Mesh>, Vec<u32>),
}

/// What is needed to cut forms into triangles.
pub(crate) struct Cutter<'a> {
    pub(crate) catalogue: &'a Catalogue,
    pub(crate) palette: &'a Palette,
    pub(crate) contours: &'a [Vec<[f64; 2]>],
    /// Largest distance from what is curved, in metres.
    pub(crate) accuracy: f64,
}

impl Cutter<'_> {
    /// The triangles of a form that are right for all of these shapes, the first of which is the mature one.
    pub(crate) fn layout<N: Number>(&self, form: &Form, paint: &Paint, shapes: &[Vec<N>]) -> Layout {
        let mut layout = Layout { pieces: Vec::new(), primitives: Vec::new() };
        let mut counts: Vec<u32> = Vec::new();
        let mut first = 0;
        for (part, material) in form.iter().zip(&**paint) {
            let own: Vec<&[N]> = shapes.iter().map(|shape| &shape[first..first + part.numbers()]).collect();
            let material = material.unwrap_or(MaterialId::LEAF);
            match *part {
                Part::Stem(contour) | Part::Shoot(contour) => {
                    let neck = matches!(part, Part::Shoot(_));
                    let radius = |numbers: &&[N]| {
                        stem_radii(numbers)
                            .map(|first| triple(&numbers[first..], 0).norm())
                            .fold(0.0, f64::max)
                    };
                    let tube = self.tube((contour, neck), own.iter().map(radius).fold(0.0, f64::max));
                    let (triangles, corners) = (tube.triangles.clone(), tube.corners.len());
                    layout.add(&mut counts, material, &triangles, corners, first, PieceShape::Stem(tube));
                }
                Part::Polygon(corners) => {
                    let points: Vec<Point> =
                        (0..corners as usize).map(|i| triple(own[0], i).into()).collect();
                    let triangles = triangulate(&points, normal(&points));
                    let triangles: Vec<[u32; 3]> =
                        triangles.into_iter().map(|t| t.map(|k| k as u32)).collect();
                    let shape = PieceShape::Polygon(points.len());
                    layout.add(&mut counts, material, &triangles, points.len(), first, shape);
                }
                Part::Surface(place) | Part::Net(place, _) => {
                    self.surface(&mut layout, &mut counts, (place, paint, form), first, &own)
                }
                Part::Patch => {
                    let pieces = own.iter().map(|numbers| {
                        let patch = Patch { net: net(numbers), material, owner: Default::default() };
                        patch.pieces(self.accuracy)
                    });
                    let (columns, rows) = pieces.fold((1, 1), |a, b| (a.0.max(b.0), a.1.max(b.1)));
                    let triangles = grid(columns as u32, rows as u32);
                    let corners = (columns + 1) * (rows + 1);
                    layout.add(
                        &mut counts,
                        material,
                        &triangles,
                        corners,
                        first,
                        PieceShape::Patch(columns, rows),
                    );
                }
            }
            first += part.numbers();
        }
        layout
    }

    /// A stem of a contour, with a neck or none, with as many sides as its radius asks for.
    pub(crate) fn tube(&self, (contour, neck): (Option<u32>, bool), radius: f64) -> Tube {
        let points = contour.and_then(|i| self.contours.get(i as usize)).map(Vec::as_slice);
        Tube::new(&cross_section(points, radius, self.accuracy), neck)
    }

    fn surface<N: Number>(
        &self,
        layout: &mut Layout,
        counts: &mut Vec<u32>,
        (place, paint, form): (usize, &Paint, &Form),
        first: usize,
        own: &[&[N]],
    ) {
        let Some(source) = self.catalogue.surfaces.get(&place) else { return };
        let limits = source.limits();
        let scale =
            |numbers: &[N]| (0..3).map(|k| triple(numbers, k + 1).norm() / limits[k]).fold(0.0_f64, f64::max);
        let index = part_at(form, first);
        let moves = matches!(form.get(index), Some(Part::Net(..)));
        let largest = own.iter().filter(|_| !moves).map(|numbers| scale(numbers)).fold(0.0, f64::max);
        let mesh = source.mesh(self.accuracy, largest);
        // The part's own colour, if it has one.
        let tint = paint.get(index).copied().flatten();
        let mut faces: Vec<(MaterialId, Vec<[u32; 3]>)> = Vec::new();
        for face in &mesh.faces {
            let material = tint.filter(|_| face.takes_tint).unwrap_or(face.material);
            match faces.iter_mut().find(|(known, _)| *known == material) {
                Some((_, triangles)) => triangles.push(face.corners),
                None => faces.push((material, vec![face.corners])),
            }
        }
        for (material, mut triangles) in faces {
            let mut number = vec![u32::MAX; mesh.vertices.len()];
            let mut corners = Vec::new();
            for corner in triangles.iter_mut().flatten() {
                let own = &mut number[*corner as usize];
                if *own == u32::MAX {
                    *own = corners.len() as u32;
                    corners.push(*corner);
                }
                *corner = *own;
            }
            let count = corners.len();
            let shape = match moves {
                true => PieceShape::Net(mesh.clone(), corners),
                false => PieceShape::Surface(mesh.clone(), corners, limits),
            };
            layout.add(counts, material, &triangles, count, first, shape);
        }
    }
}

/// The number of the part whose numbers begin there.
fn part_at(form: &Form, first: usize) -> usize {
    let mut sum = 0;
    form.iter()
        .take_while(|part| {
            let here = sum < first;
            sum += part.numbers();
            here
        })
        .count()
}

impl Layout {
    fn add(
        &mut self,
        counts: &mut Vec<u32>,
        material: MaterialId,
        triangles: &[[u32; 3]],
        corners: usize,
        first: usize,
        shape: PieceShape,
    ) {
        let known = self.primitives.iter().position(|(known, _)| *known == material);
        let primitive = known.unwrap_or_else(|| {
            self.primitives.push((material, Vec::new()));
            counts.push(0);
            self.primitives.len() - 1
        });
        let offset = counts[primitive];
        self.primitives[primitive].1.extend(triangles.iter().flatten().map(|corner| corner + offset));
        counts[primitive] += corners as u32;
        self.pieces.push(Piece { primitive, first, shape });
    }

    /// By primitive, where its corners lie in the picture of its material, as meshes have it; empty without a picture.
    pub(crate) fn pinned(&self) -> Vec<Vec<[f32; 2]>> {
        let mut all = vec![Vec::new(); self.primitives.len()];
        for piece in &self.pieces {
            if let PieceShape::Surface(mesh, corners, _) | PieceShape::Net(mesh, corners) = &piece.shape {
                let places = corners.iter().filter_map(|&corner| mesh.places.get(corner as usize));
                all[piece.primitive].extend(places.map(|place| place.map(|x| x as f32)));
            }
        }
        all
    }

    /// Where the corners lie for these numbers, by primitive. Where a normal has no direction it is zero.
    pub(crate) fn places(&self, numbers: &[f32]) -> Vec<Places> {
        let mut places = vec![Places::default(); self.primitives.len()];
        self.visit(numbers, |primitive, position, normal| {
            let out = &mut places[primitive];
            out.positions.push(position.map(|x| x as f32).into());
            let normal = normal.try_normalize(1e-30).unwrap_or_else(Vector::zeros);
            out.normals.push(normal.map(|x| x as f32).into());
        });
        places
    }

    /// The same one after the other: the number of the primitive, the position, and a vector along the normal.
    pub(crate) fn visit<N: Number>(&self, numbers: &[N], mut visit: impl FnMut(usize, Vector, Vector)) {
        for Piece { primitive, first, shape } in &self.pieces {
            let own = &numbers[*first..];
            let mut put = |position: Vector, normal: Vector| visit(*primitive, position, normal);
            match shape {
                PieceShape::Stem(tube) => stem(tube, own, &mut put),
                PieceShape::Polygon(corners) => {
                    let points: Vec<Point> = (0..*corners).map(|i| triple(own, i).into()).collect();
                    let normal = normal(&points);
                    points.iter().for_each(|p| put(p.coords, normal));
                }
                PieceShape::Surface(mesh, corners, limits) => {
                    let axes = [1, 2, 3].map(|k| triple(own, k));
                    let units = axes.map(|axis| axis.try_normalize(1e-300).unwrap_or_else(Vector::zeros));
                    for &corner in corners {
                        let (p, n) = (mesh.vertices[corner as usize], mesh.normals[corner as usize]);
                        let mut at = triple(own, 0);
                        let mut normal = Vector::zeros();
                        for k in 0..3 {
                            at += axes[k] * (p[k] / limits[k]);
                            let scale = axes[k].norm() / limits[k];
                            normal += units[k] * if scale > 0.0 { n[k] / scale } else { 0.0 };
                        }
                        put(at, normal);
                    }
                }
                PieceShape::Patch(columns, rows) => patch(&net(own), *columns, *rows, &mut put),
                PieceShape::Net(mesh, corners) => {
                    let at = |corner: u32| triple(own, corner as usize);
                    let normals = mesh.normals_at(|corner| at(corner).into());
                    corners.iter().for_each(|&corner| put(at(corner), normals[corner as usize]));
                }
            }
        }
    }
}

fn stem<N: Number>(tube: &Tube, numbers: &[N], put: &mut impl FnMut(Vector, Vector)) {
    let [(start, lower), (end, upper)] = [0, 1].map(|which| stem_point(numbers, which));
    let has_neck = tube.sizes > 3;
    let (narrow_end, narrow) = if has_neck { stem_point(numbers, 2) } else { (start, [Vector::zeros(); 3]) };
    let neck = narrow_end - start;
    let thick = if lower[2].norm_squared() >= upper[2].norm_squared() { lower } else { upper };
    let unit = |v: Vector| v.try_normalize(1e-300);
    let along = unit(thick[2]).or_else(|| unit(end - start)).unwrap_or_else(Vector::y);
    let across = unit(thick[0]).unwrap_or_else(|| any_across(&along));
    let axes = [across, along.cross(&across), along];
    let slope = match neck.norm() {
        0.0 => 0.0,
        length => (lower[2].norm() - narrow[2].norm()) / length,
    };
    for corner in &tube.corners {
        // Sums of the numbers, so that shapes between two others, and sums of several, are right.
        let [to_end, of_lower, of_upper, to_neck, of_narrow] = corner.shares;
        let middle = start + (end - start) * to_end + neck * to_neck;
        let own = [0, 1, 2].map(|k| lower[k] * of_lower + upper[k] * of_upper + narrow[k] * of_narrow);
        let normal = (Corner::turned(corner.normal, axes) + along * (corner.slope * slope)).normalize();
        put(middle + Corner::turned(corner.place, own), normal);
    }
}

fn net<N: Number>(numbers: &[N]) -> Net {
    let point = |i: usize| Point::from(triple(numbers, i));
    [0, 4, 8, 12].map(|row| [0, 1, 2, 3].map(|column| point(row + column)))
}

/// Two triangles for each square of a grid of corners, row by row.
fn grid(columns: u32, rows: u32) -> Vec<[u32; 3]> {
    let mut triangles = Vec::with_capacity(2 * (columns * rows) as usize);
    for row in 1..=rows {
        for column in 1..=columns {
            let b = row * (columns + 1) + column;
            let a = b - columns - 1;
            triangles.extend([[a - 1, a, b], [a - 1, b, b - 1]]);
        }
    }
    triangles
}

fn patch(net: &Net, columns: usize, rows: usize, put: &mut impl FnMut(Vector, Vector)) {
    let patch = Patch { net: *net, material: MaterialId::PETAL, owner: Default::default() };
    let share = |i: usize, n: usize| i as f64 / n as f64;
    let points: Vec<Point> = (0..=rows)
        .flat_map(|row| (0..=columns).map(move |column| (share(row, rows), share(column, columns))))
        .map(|(row, column)| patch.point(row, column))
        .collect();
    let mut normals = vec![Vector::zeros(); points.len()];
    let mut whole = Vector::zeros();
    for corners in grid(columns as u32, rows as u32) {
        let [p, q, r] = corners.map(|i| points[i as usize]);
        let area = (q - p).cross(&(r - p));
        whole += area;
        corners.iter().for_each(|&i| normals[i as usize] += area);
    }
    for (point, normal) in points.iter().zip(normals) {
        // Where an edge is a point some corners have no triangles with an area.
        put(point.coords, if normal == Vector::zeros() { whole } else { normal });
    }
}
