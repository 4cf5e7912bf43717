//! Where the cells of a plant are: one behind the other, or in a tree.

use crate::Dice;

/// A place in the string of a plant, without its walls.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    Cell,
    /// The beginning of a branch, and its end.
    Open,
    Close,
}

/// The cells of a plant and the brackets between them; the first cell here is the first of all, and so on.
#[derive(Clone, Debug)]
pub struct Shape(Vec<Place>);

/// The neighbours of a cell, by number.
#[derive(Clone, Debug, Default)]
pub struct Relatives {
    /// None beside a wall.
    pub below: Option<usize>,
    /// The next on the axis, and the first of each branch, in string order.
    pub attached: Vec<usize>,
}

impl Shape {
    pub fn row(cells: usize) -> Shape {
        Shape(vec![Place::Cell; cells])
    }

    pub fn tree(dice: &mut Dice, cells: usize) -> Shape {
        let (mut places, mut depth) = (Vec::new(), 0);
        for n in 0..cells {
            match dice.roll(4) {
                0 | 1 if n > 0 => {
                    places.push(Place::Open);
                    depth += 1;
                }
                2 if depth > 0 => {
                    places.push(Place::Close);
                    depth -= 1;
                }
                _ => {}
            }
            places.push(Place::Cell);
        }
        places.extend(vec![Place::Close; depth]);
        Shape(places)
    }

    pub fn places(&self) -> impl Iterator<Item = Place> + '_ {
        self.0.iter().copied()
    }

    pub fn relatives(&self) -> Vec<Relatives> {
        let mut all: Vec<Relatives> = Vec::new();
        // The last cell on each axis that has not ended.
        let mut axes = vec![None];
        for place in self.places() {
            match place {
                Place::Open => axes.extend_from_within(axes.len() - 1..),
                Place::Close => {
                    axes.pop();
                }
                Place::Cell => {
                    let cell = all.len();
                    let below = axes.last_mut().and_then(|last| last.replace(cell));
                    if let Some(below) = below {
                        let below: &mut Relatives = &mut all[below];
                        below.attached.push(cell);
                    }
                    all.push(Relatives { below, attached: Vec::new() });
                }
            }
        }
        all
    }

    /// The shape when some cells have been replaced by so many each, of which the second may be a branch.
    pub fn after(&self, replaced: &[usize], successors: usize, forks: bool) -> Shape {
        let (mut places, mut cell) = (Vec::new(), 0);
        for place in self.places() {
            if place != Place::Cell {
                places.push(place);
                continue;
            }
            let count = if replaced.contains(&cell) { successors } else { 1 };
            for n in 0..count {
                match n == 1 && forks {
                    true => places.extend([Place::Open, Place::Cell, Place::Close]),
                    false => places.push(Place::Cell),
                }
            }
            cell += 1;
        }
        Shape(places)
    }
}
