//! The surface in pieces whose triangles stay the same while their points move: for files that animate points.

use std::collections::{BTreeMap, BTreeSet};

use crate::mesh::Weaver;
use crate::tile::{Key, QUANTA};
use crate::{Ground, Vector};

/// A part of the surface: triangles between columns.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Piece {
    /// The columns at which its points stand.
    pub columns: Vec<(i32, i32)>,
    /// Triangles as numbers of columns in that list, counterclockwise as seen from above.
    pub triangles: Vec<[u32; 3]>,
}

impl Ground {
    /// The surface in pieces that serve for this state and all before it: first what nothing has touched, coarse where it is flat, then every tile that has been touched, at every column.
    /// Points that pieces have in common are the same columns, so there are no cracks.
    pub fn pieces(&self) -> Vec<Piece> {
        let touched: BTreeSet<Key> = (self.tiles.keys())
            .flat_map(|(p, q)| [(*p, *q), (p - 1, *q), (*p, q - 1), (p - 1, q - 1)])
            .collect();
        let mut squares: BTreeMap<Key, i32> = self.squares();
        for (key, size) in &mut squares {
            if touched.contains(key) {
                *size = 1;
            }
        }
        let (mut still, mut moving) = (Weaver::new(self), Vec::new());
        for (key, size) in &squares {
            if touched.contains(key) {
                let mut weaver = Weaver::new(self);
                weaver.tile(&squares, *key, *size);
                moving.push(weaver.piece());
            } else {
                still.tile(&squares, *key, *size);
            }
        }
        let mut pieces = vec![still.piece()];
        pieces.append(&mut moving);
        pieces.retain(|piece| !piece.triangles.is_empty());
        pieces
    }

    /// The points of a piece, in m.
    pub fn points(&self, piece: &Piece) -> Vec<Vector> {
        let cell = self.cell();
        let point = |&(i, k): &(i32, i32)| {
            Vector::new(f64::from(i) * cell, self.shown(i, k) as f64 / QUANTA * cell, f64::from(k) * cell)
        };
        piece.columns.iter().map(point).collect()
    }
}
