//! What bodies cover: their undersides as ceilings over columns.

use std::cmp::Ordering;
use std::sync::Arc;

use crate::marks::Marks;
use crate::reader::Reader;
use crate::spans::Place;
use crate::tile::Key;
use crate::{Error, Ground};

/// What a body covers: the lowest underside over each column, in quanta.
#[derive(Clone, Debug, Default)]
pub(crate) struct Foot {
    pub places: Arc<[Place]>,
    /// In order along z first, as spans are.
    pub undersides: Vec<((i32, i32), i64)>,
    /// First and last column with an underside along x and z.
    pub reach: Option<[[i32; 2]; 2]>,
    /// Columns with floors of the body.
    pub floors: Vec<(i32, i32)>,
    /// Whether its spans were computed: they are not where a body can neither press nor carry anything.
    pub spanned: bool,
}

impl Foot {
    /// Whether some point is lower than a height in quanta.
    pub fn comes_below(&self, height: i64) -> bool {
        self.places.iter().any(|place| place.y < height)
    }
}

/// The box around columns.
pub(crate) fn reach_of(columns: &[((i32, i32), i64)]) -> Option<[[i32; 2]; 2]> {
    columns.iter().fold(None, |reach, &((i, k), _)| {
        let [x, z] = reach.unwrap_or([[i; 2], [k; 2]]);
        Some([[x[0].min(i), x[1].max(i)], [z[0].min(k), z[1].max(k)]])
    })
}

fn meet(a: Option<[[i32; 2]; 2]>, b: Option<[[i32; 2]; 2]>) -> bool {
    let along = |a: [i32; 2], b: [i32; 2]| a[0] <= b[1] && b[0] <= a[1];
    a.zip(b).is_some_and(|(a, b)| along(a[0], b[0]) && along(a[1], b[1]))
}

/// Undersides over columns, in order along z first.
type Undersides = [((i32, i32), i64)];

/// The columns of two lists, each once with the lower underside.
fn merged(mut a: &Undersides, mut b: &Undersides) -> Vec<((i32, i32), i64)> {
    let mut all = Vec::with_capacity(a.len() + b.len());
    let place = |(i, k): (i32, i32)| (k, i);
    while let ([first, rest_a @ ..], [other, rest_b @ ..]) = (a, b) {
        match place(first.0).cmp(&place(other.0)) {
            Ordering::Less => {
                all.push(*first);
                a = rest_a;
            }
            Ordering::Greater => {
                all.push(*other);
                b = rest_b;
            }
            Ordering::Equal => {
                all.push((first.0, first.1.min(other.1)));
                (a, b) = (rest_a, rest_b);
            }
        }
    }
    all.extend_from_slice(a);
    all.extend_from_slice(b);
    all
}

/// Lowers heights over columns to the undersides that are over these. Both are in order.
fn lower_to(roofs: &mut Undersides, undersides: &Undersides) {
    let mut rest = undersides;
    for ((i, k), roof) in roofs {
        let skipped = rest.iter().take_while(|((other, row), _)| (row, other) < (&*k, &*i)).count();
        rest = &rest[skipped..];
        if let Some((column, underside)) = rest.first()
            && *column == (*i, *k)
        {
            *roof = (*roof).min(*underside);
        }
    }
}

impl Ground {
    /// Puts a body's new undersides in the place of the old ones, and wakes the columns that this concerns.
    pub(crate) fn cover(&mut self, id: u64, before: Option<&Foot>, after: Option<Foot>) -> Result<(), Error> {
        let none = Foot::default();
        let [old, new] = [before, after.as_ref()].map(|foot| &*foot.unwrap_or(&none).undersides);
        let lowest = merged(old, new);
        let feet = Arc::make_mut(&mut self.feet);
        match after {
            Some(foot) => feet.insert(id, Arc::new(foot)),
            None => feet.remove(&id),
        };
        let reach = reach_of(&lowest);
        let mut roofs: Vec<_> = lowest.iter().map(|(column, _)| (*column, i64::MAX)).collect();
        for foot in self.feet.values().filter(|foot| meet(foot.reach, reach)) {
            lower_to(&mut roofs, &foot.undersides);
        }
        self.set_roofs(&roofs);
        // Columns under a body that touches them, or did, and those around it.
        let (mut marks, mut reader, extent) = (Marks::new(self.setup.side), Reader::new(self), self.extent());
        for (column, underside) in lowest {
            if extent.contains(column.0, column.1) && underside - (1 << 32) <= reader.top(column) {
                marks.add_around(column);
            }
        }
        self.wake_marked(marks)
    }

    /// Sets the ceilings over columns; tiles without any are not stored.
    fn set_roofs(&mut self, roofs: &Undersides) {
        self.graph = None;
        let (extent, count) = (self.extent(), self.setup.settings.side * self.setup.settings.side);
        let inside = roofs.iter().filter(|((i, k), _)| extent.contains(*i, *k));
        let places: Vec<_> = inside.map(|((i, k), roof)| (self.setup.place(*i, *k), *roof)).collect();
        let stored = Arc::make_mut(&mut self.roofs);
        let mut opened: Vec<Key> = Vec::new();
        for row in places.chunk_by(|a, b| a.0.0 == b.0.0) {
            let key = row[0].0.0;
            let all = Arc::make_mut(stored.entry(key).or_insert_with(|| vec![i64::MAX; count].into()));
            for ((_, index), roof) in row {
                all[*index] = *roof;
            }
            if row.iter().any(|(_, roof)| *roof == i64::MAX) {
                opened.push(key);
            }
        }
        opened.sort_unstable();
        opened.dedup();
        for key in opened {
            if stored.get(&key).is_some_and(|all| all.iter().all(|roof| *roof == i64::MAX)) {
                stored.remove(&key);
            }
        }
    }

    /// Height of what is above a column, in quanta.
    pub(crate) fn roof(&self, (i, k): (i32, i32)) -> i64 {
        let (key, index) = self.setup.place(i, k);
        self.roofs.get(&key).map_or(i64::MAX, |roofs| roofs[index])
    }
}
