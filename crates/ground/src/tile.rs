//! Columns in square tiles, and the box of columns that a ground consists of.

use crate::Error;
use crate::error::check;

/// Quanta of height in a cell: heights are integers of this unit.
pub(crate) const QUANTA: f64 = 4_294_967_296.0;
/// Largest height in quanta, up or down: integers up to 2^51 are exact in the arithmetic of the sweeps, with room for sums.
pub(crate) const HIGHEST: i64 = 1 << 48;

/// Coordinates of a tile: those of its first column over the number of columns in a row.
pub(crate) type Key = (i32, i32);

/// A square of columns, in rows along x. Heights and thicknesses are in quanta.
#[derive(Clone, Debug)]
pub(crate) struct Tile {
    /// Height of the rigid bed.
    pub bed: Box<[i64]>,
    /// Thickness of what is bonded. It acts as bed until it comes loose.
    pub bonded: Box<[i64]>,
    /// Thickness of what can slip.
    pub loose: Box<[i64]>,
    /// Thickness that has been compressed away.
    pub packed: Box<[i64]>,
    /// Tangent of the angle of repose in quanta, where it is not that of the soil everywhere.
    pub slope: Option<Box<[f64]>>,
    /// How far what is seen of each column has slid along x and z, in cells, where that is followed and anything has.
    pub slid: Option<Box<[[f64; 2]]>>,
    /// One bit for each column of a row: whether it slipped in the last sweep or was changed since.
    pub awake: Box<[u32]>,
    /// Whether a column has been compressed.
    pub pressed: bool,
    /// What had fallen everywhere when that was added to the columns last.
    pub fallen: i64,
}

/// Bytes of a column.
pub(crate) const COLUMN_BYTES: usize = 33;
/// More of them where it is followed how far it has slid.
pub(crate) const SLID_BYTES: usize = 16;

impl Tile {
    /// Height of what cannot slip.
    pub fn base(&self, index: usize) -> i64 {
        self.bed[index] + self.bonded[index]
    }

    /// Height of the surface.
    pub fn top(&self, index: usize) -> i64 {
        self.base(index) + self.loose[index]
    }

    pub fn is_awake(&self) -> bool {
        self.awake.iter().any(|row| *row != 0)
    }
}

/// The columns of a ground: from the first to the last along x and along z. Column (i, k) stands around (i, k) times the size of a cell. Beyond the
/// edges the ground is its own mirror image, so nothing crosses them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Extent {
    /// First and last column along x.
    pub x: [i32; 2],
    /// First and last column along z.
    pub z: [i32; 2],
}

/// Most columns from 0 to an edge.
const FARTHEST: i32 = 1 << 20;

impl Extent {
    /// From -n to n along both axes.
    pub fn around(n: i32) -> Extent {
        Extent { x: [-n, n], z: [-n, n] }
    }

    pub(crate) fn check(&self) -> Result<(), Error> {
        for [from, to] in [self.x, self.z] {
            for end in [from, to] {
                let near = (-FARTHEST..=FARTHEST).contains(&end);
                check("a column at the edge of the ground", f64::from(end), near, "-2^20 to 2^20")?;
            }
            check("a last column of the ground", f64::from(to), from <= to, "the first one or more")?;
        }
        Ok(())
    }

    pub(crate) fn contains(&self, i: i32, k: i32) -> bool {
        (self.x[0]..=self.x[1]).contains(&i) && (self.z[0]..=self.z[1]).contains(&k)
    }

    /// Whether a tile has a column of the ground.
    pub(crate) fn has_tile(&self, (p, q): Key, side: i32) -> bool {
        let meets = |[from, to]: [i32; 2], at: i32| at * side <= to && at * side + side > from;
        meets(self.x, p) && meets(self.z, q)
    }

    /// Whether a tile and the two columns around it are all within the ground.
    pub(crate) fn surrounds(&self, (p, q): Key, side: i32) -> bool {
        let within = |[from, to]: [i32; 2], at: i32| at * side - 2 >= from && at * side + side < to;
        within(self.x, p) && within(self.z, q)
    }

    /// The column that stands for one beyond an edge: its mirror image.
    pub(crate) fn mirrored(&self, i: i32, k: i32) -> (i32, i32) {
        let fold = |[from, to]: [i32; 2], at: i32| {
            let inside = if at > to { 2 * to + 1 - at } else { at };
            let inside = if inside < from { 2 * from - 1 - inside } else { inside };
            inside.clamp(from, to)
        };
        (fold(self.x, i), fold(self.z, k))
    }
}
