//! Patches as triangles that are fine at their edges only.
//!
//! The outline of a leaf bends more than its surface does, so a grid as fine as its edges has many triangles inside that nobody can see. Here edges have all
//! their pieces, a coarser grid lies within, and strips of triangles lead from one to the other.

use super::bernstein::{Column, normal, point, slopes, weights};
use super::patch::{Net, Paint};
use super::{Mesh, Point, Vector};

/// The grid has one piece for so many of an edge, at least: then its own lines are so little bent that they do not pass beyond the edge by more than the
/// accuracy.
const COARSER: usize = 2;

/// Numbers of pieces of edges: first row, last row, first column, last column.
pub(super) type Edges = [usize; 4];

/// The columns and rows of a grid within these edges, given those that the patch needs; `None` if a grid as fine as the edges has no more triangles.
pub(super) fn within(
    [bottom, top, left, right]: Edges,
    (columns, rows): (usize, usize),
) -> Option<[usize; 2]> {
    let coarse = |grid: usize, edge: usize| grid.max(edge.div_ceil(COARSER)).max(2);
    let grid = [coarse(columns, bottom.max(top)), coarse(rows, left.max(right))];
    let fine = 2 * columns.max(bottom).max(top) * rows.max(left).max(right);
    let [across, up] = grid.map(|pieces| pieces - 2);
    let strips = bottom + top + left + right + 2 * (across + up);
    (2 * across * up + strips < fine).then_some(grid)
}

/// A line of vertices: the parameter and the number of each.
type Chain = Vec<(f64, u32)>;

/// Adds a patch: its edges, and a grid of so many columns and rows, at least two, the outermost lines of which are the edges.
pub(super) fn add(net: &Net, edges: Edges, [columns, rows]: [usize; 2], paint: Paint, mesh: &mut Mesh) {
    let mut vertex = |(point, normal): (Point, Vector)| {
        mesh.vertices.push(point);
        mesh.normals.push(normal);
        mesh.vertices.len() as u32 - 1
    };
    let at = |u: f64, v: f64| (point(net, u, v), normal(net, u, v));
    let [[a, b], [d, c]] = [0.0, 1.0].map(|v| [0.0, 1.0].map(|u| vertex(at(u, v))));
    let mut edge = |[from, to]: [u32; 2], count: usize, at: &dyn Fn(f64) -> (Point, Vector)| -> Chain {
        let between = (1..count).map(|k| k as f64 / count as f64).map(|t| (t, vertex(at(t))));
        [(0.0, from)].into_iter().chain(between).chain([(1.0, to)]).collect()
    };
    let [bottom, top, left, right] = edges;
    let bottom = edge([a, b], bottom, &|u| at(u, 0.0));
    let top = edge([d, c], top, &|u| at(u, 1.0));
    let left = edge([a, d], left, &|v| at(0.0, v));
    let right = edge([b, c], right, &|v| at(1.0, v));

    let rows_of = (0..=rows).map(|j| j as f64 / rows as f64).map(|v| (v, weights(v), slopes(v)));
    let rows_of: Vec<(f64, [f64; 4], [f64; 4])> = rows_of.collect();
    let first = mesh.vertices.len() as u32;
    for column in (1..columns).map(|i| Column::new(net, i as f64 / columns as f64)) {
        for row in &rows_of[1..rows] {
            let (point, normal) = column.at(net, row);
            mesh.vertices.push(point);
            mesh.normals.push(normal);
        }
    }
    let number = |i: usize, j: usize| first + ((i - 1) * (rows - 1) + j - 1) as u32;
    let row =
        |j: usize| -> Chain { (1..columns).map(|i| (i as f64 / columns as f64, number(i, j))).collect() };
    let column = |i: usize| -> Chain { (1..rows).map(|j| (rows_of[j].0, number(i, j))).collect() };
    let mut face = |corners: [u32; 3]| mesh.add_face(corners, paint.material, paint.takes_tint);
    for i in 1..columns - 1 {
        for j in 1..rows - 1 {
            let [a, b, c, d] = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)].map(|(i, j)| number(i, j));
            match (i < columns / 2) == (j < rows / 2) {
                true => [[a, b, c], [a, c, d]].map(&mut face),
                false => [[a, b, d], [b, c, d]].map(&mut face),
            };
        }
    }
    let mut turned = |[a, b, c]: [u32; 3]| mesh.add_face([a, c, b], paint.material, paint.takes_tint);
    strip(&top, &row(rows - 1), &mut turned);
    strip(&left, &column(1), &mut turned);
    let mut face = |corners: [u32; 3]| mesh.add_face(corners, paint.material, paint.takes_tint);
    strip(&bottom, &row(1), &mut face);
    strip(&right, &column(columns - 1), &mut face);
}

/// The triangles between an edge and the line of the grid beside it, which is on the left of it.
fn strip(edge: &Chain, line: &Chain, face: &mut dyn FnMut([u32; 3])) {
    let (mut k, mut m) = (0, 0);
    // Twice the middle of the next piece.
    let next =
        |chain: &Chain, at: usize| chain.get(at + 1).map_or(f64::INFINITY, |next| chain[at].0 + next.0);
    while k + 1 < edge.len() || m + 1 < line.len() {
        if next(edge, k) <= next(line, m) {
            face([edge[k].1, edge[k + 1].1, line[m].1]);
            k += 1;
        } else {
            face([edge[k].1, line[m + 1].1, line[m].1]);
            m += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::MaterialId;

    const PAINT: Paint = Paint { material: MaterialId::LEAF, takes_tint: true, has_picture: false };

    /// A leaf in the plane whose outline bends.
    fn leaf() -> Net {
        let wide = [0.4, 1.6, 1.2, 0.2];
        [0, 1, 2, 3].map(|r| {
            [0, 1, 2, 3].map(|c| Point::new((c as f64 / 3.0 - 0.5) * wide[r], r as f64 + 0.1 * c as f64, 0.0))
        })
    }

    #[test]
    fn strips_and_grid_cover_what_is_within_the_edges_once() {
        let net = leaf();
        for (edges, needed) in [([3, 2, 16, 15], (1, 1)), ([8, 8, 8, 8], (2, 7)), ([1, 2, 30, 28], (5, 3))] {
            let grid = within(edges, needed).expect("fewer triangles");
            let mut mesh = Mesh::new();
            add(&net, edges, grid, PAINT, &mut mesh);
            let fine = 2 * needed.0.max(edges[0]).max(edges[1]) * needed.1.max(edges[2]).max(edges[3]);
            assert!(mesh.faces.len() < fine && grid[0] >= needed.0 && grid[1] >= needed.1);
            let place = |i: u32| mesh.vertices[i as usize];
            let areas = mesh.faces.iter().map(|face| {
                let [a, b, c] = face.corners.map(place);
                (b - a).cross(&(c - a)).z / 2.0
            });
            assert!(areas.clone().all(|area| area > 0.0), "{edges:?} {grid:?}");
            // A side that belongs to one triangle is a piece of an edge.
            let sides = mesh
                .faces
                .iter()
                .flat_map(|face| [0, 1, 2].map(|k| [face.corners[k], face.corners[(k + 1) % 3]]));
            let sides: std::collections::HashSet<[u32; 2]> = sides.collect();
            let rim: Vec<&[u32; 2]> = sides.iter().filter(|[a, b]| !sides.contains(&[*b, *a])).collect();
            assert_eq!(rim.len(), edges.iter().sum::<usize>());
            let around: f64 =
                rim.iter().map(|side| side.map(place)).map(|[p, q]| (p.x * q.y - q.x * p.y) / 2.0).sum();
            assert!((areas.sum::<f64>() - around).abs() < 1e-12);
        }
    }

    #[test]
    fn a_grid_that_is_no_finer_at_its_edges_stays() {
        assert_eq!(within([8, 8, 8, 8], (8, 8)), None);
        assert_eq!(within([1, 1, 1, 1], (1, 1)), None);
        assert_eq!(within([2, 2, 2, 2], (1, 1)), None);
    }
}
