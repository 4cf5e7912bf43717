//! Bodies that press and push: what stands in their way goes to the columns around them, or is compressed.
//!
//! The rules of Sumner, O'Brien, Hodgins (*Animating Sand, Mud, and Snow*, 1999, section 3.2) and of Onoue, Nishita (*Virtual Sandbox*, 2003,
//! section 3.3.2) in one: a column that a body enters is lowered to the body. A body that sinks compresses a part and presses the rest outward, along
//! falling distance from the rim; one that moves sideways pushes all of it, to columns ahead. What comes to lie under the body is moved on. Which of the two a body does is
//! decided where it touches the material: a wheel that rolls sinks in, whatever its axle does.

use std::sync::Arc;

use crate::barrier::Barriers;
use crate::contour::Contours;
use crate::cover::{Foot, reach_of};
use crate::heading::{Heading, Motions, Total};
use crate::load::{Floor, Parcel};
use crate::reader::Reader;
use crate::spans::{Place, Span, carried, join, of_mesh, of_surface};
use crate::tile::QUANTA;
use crate::way::Way;
use crate::{Error, Ground, Vector};

/// A closed mesh of triangles, or a shelf, and its way in a tick.
#[derive(Clone, Debug)]
pub struct Body {
    /// Its identity, by which it is found again in the next tick.
    pub id: u64,
    /// Its name in messages.
    pub name: String,
    /// Triangles, as numbers of points.
    pub triangles: Arc<[[u32; 3]]>,
    /// Points at the beginning of the tick, in m.
    pub from: Arc<[Vector]>,
    /// The same points at the end; they move uniformly.
    pub to: Arc<[Vector]>,
    /// Whether it is a shelf: a surface without thickness, open or closed, as of leaves. It carries what falls onto it, and does not press.
    pub shelf: bool,
}

/// Material that reaches into a body by less than this counts as touching it, in quanta; a millionth of a cell.
pub(crate) const SKIN: i64 = 4096;
/// Distance above the surface from which on bodies are looked at, in quanta.
const NEAR: i64 = 8 << 32;
/// Parts into which volumes are divided for the part that goes to the rim.
const PARTS: i64 = 1 << 16;

/// Columns around one.
pub(crate) const AROUND: [(i32, i32); 8] =
    [(-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1)];

impl Body {
    /// A body that stands still.
    pub fn still(id: u64, name: &str, triangles: Arc<[[u32; 3]]>, points: Arc<[Vector]>) -> Body {
        Body { id, name: name.to_owned(), triangles, from: points.clone(), to: points, shelf: false }
    }

    pub(crate) fn check(&self) -> Result<(), Error> {
        let fault = |fault| Err(Error::Body { name: self.name.clone(), fault });
        if self.from.len() != self.to.len() {
            return fault("has more points at one end of a tick than at the other");
        }
        if self.triangles.iter().flatten().any(|point| *point as usize >= self.from.len()) {
            return fault("has a triangle with a point that does not exist");
        }
        Ok(())
    }

    /// The longest way of a point, in m.
    pub(crate) fn way(&self) -> f64 {
        self.from.iter().zip(self.to.iter()).map(|(from, to)| (to - from).norm()).fold(0.0, f64::max)
    }

    /// Its points at a part of the tick.
    fn places(&self, part: f64, cell: f64) -> Result<Vec<Place>, Error> {
        let place = |(from, to): (&Vector, &Vector)| {
            let point = if part >= 1.0 { *to } else { from + (to - from) * part };
            Place::new(&point, cell)
        };
        let places = self.from.iter().zip(self.to.iter()).map(place).collect::<Option<_>>();
        let fault = "has a point that is not a number, or too far away";
        places.ok_or_else(|| Error::Body { name: self.name.clone(), fault })
    }
}

impl Ground {
    /// Moves a body to a part of its way in the tick.
    pub(crate) fn move_body(&mut self, body: &Body, part: f64) -> Result<(), Error> {
        let cell = self.cell();
        let places: Arc<[Place]> = body.places(part, cell)?.into();
        let before = self.feet.get(&body.id).cloned();
        if before.as_ref().is_some_and(|foot| foot.places == places && (foot.spanned || !self.falls)) {
            return Ok(());
        }
        let mut foot = Foot { places, ..Foot::default() };
        let (mut spans, mut way) = (Vec::new(), Vec::new());
        // The highest ground under the body before and after.
        let ends = [Some(&foot), before.as_deref()]
            .map(|foot| foot.map(|foot| (foot, self.highest_under(&foot.places))));
        let highest = ends.iter().flatten().map(|(_, highest)| *highest).fold(i64::MIN, i64::max);
        let is_near = ends.into_iter().flatten().any(|(foot, highest)| foot.comes_below(highest + NEAR));
        foot.spanned = is_near || self.falls || self.carries(body.id);
        if foot.spanned {
            if body.shelf {
                // Under the ground it is not there.
                spans = of_surface(&foot.places, &body.triangles);
                let mut reader = Reader::new(self);
                spans.retain(|span| span.top >= reader.top(span.column));
            } else {
                spans = of_mesh(&body.name, &foot.places, &body.triangles, cell)?;
                foot.undersides = spans.iter().map(|span| (span.column, span.bottom)).collect();
                foot.undersides.dedup_by_key(|(column, _)| *column);
                way = spans.clone();
                let passed = before.as_ref().filter(|before| before.places.len() == foot.places.len());
                if let Some(before) = passed {
                    let mut reader = Reader::new(self);
                    let passed = Way { from: &before.places, to: &foot.places, highest };
                    passed.spans(&body.triangles, |column| reader.top(column), &mut way);
                    join(&mut way);
                }
            }
        }
        foot.reach = reach_of(&foot.undersides);
        foot.floors = spans.iter().map(|span| span.column).collect();
        foot.floors.dedup();
        self.check_inside(body, &way)?;
        let motions = Motions::new(body, before.as_deref(), &foot);
        let parcels = self.take_loads(body, before.as_deref(), &foot);
        self.cover(body.id, before.as_deref(), Some(foot))?;
        self.add_floors(floors(body.id, &spans));
        self.stirred |= !spans.is_empty() || !parcels.is_empty();
        self.displace(body.id, &way, &motions)?;
        for parcel in parcels {
            self.put(body.id, parcel)?;
        }
        Ok(())
    }

    /// Takes the loads from a body's floors, and returns where they are after it has moved.
    fn take_loads(&mut self, body: &Body, before: Option<&Foot>, after: &Foot) -> Vec<Parcel> {
        let before = before.filter(|before| before.places.len() == after.places.len());
        let moved = |((i, k), floor): ((i32, i32), Floor)| {
            let triangle = body.triangles.get(floor.triangle as usize);
            let way = before.zip(triangle).map(|(before, triangle)| {
                let corners = triangle.map(|n| (before.places[n as usize], after.places[n as usize]));
                carried(corners, (i, k), floor.offset)
            });
            let (column, offset, up) = way.unwrap_or(((i, k), floor.offset, 0));
            Parcel { column, base: floor.base + up, load: floor.load, offset }
        };
        self.take_floors(body.id).into_iter().map(moved).collect()
    }

    /// Takes away the bodies that are not in a list.
    pub(crate) fn keep_bodies(&mut self, bodies: &[Body], span: [f64; 2]) -> Result<(), Error> {
        let gone: Vec<u64> =
            self.feet.keys().copied().filter(|id| bodies.iter().all(|body| body.id != *id)).collect();
        for id in gone {
            let before = self.feet.get(&id).cloned();
            let loads = self.take_floors(id);
            self.cover(id, before.as_deref(), None)?;
            self.stirred |= !loads.is_empty();
            for (column, floor) in loads {
                self.drop(column, floor.top(), floor.load)?;
            }
            self.let_go(id, span, &Barriers::default())?;
        }
        Ok(())
    }

    /// A height that no column under a body exceeds, in quanta.
    fn highest_under(&self, places: &[Place]) -> i64 {
        let over = |get: fn(&Place) -> i64| {
            let all = || places.iter().map(get);
            [all().min().unwrap_or(0) as f64, all().max().unwrap_or(0) as f64]
        };
        let scale = self.cell() / 65_536.0;
        let [_, high] = self.bounds(over(|at| at.x).map(|x| x * scale), over(|at| at.z).map(|z| z * scale));
        (high / self.cell() * QUANTA).ceil() as i64
    }

    fn check_inside(&self, body: &Body, way: &[Span]) -> Result<(), Error> {
        let extent = self.extent();
        // Beyond the edge there is as much as at the edge, or as there was before the body lowered that.
        let level = |(i, k): (i32, i32)| {
            let (at, along) = extent.mirrored(i, k);
            let before = self.setup.untouched(at, along).unwrap_or_default().iter().sum::<i64>();
            self.top(i, k).max(before + self.book.fallen)
        };
        let outside = way
            .iter()
            .find(|span| !extent.contains(span.column.0, span.column.1) && span.bottom < level(span.column));
        outside.map_or(Ok(()), |span| {
            let at = [span.column.0, span.column.1].map(|at| f64::from(at) * self.cell());
            Err(Error::Outside { name: body.name.clone(), at })
        })
    }

    /// The spans of a way that reach into the ground, by columns, with the heights of these.
    fn pierced<'w>(&self, way: &'w [Span]) -> Vec<(&'w [Span], i64)> {
        let (mut reader, extent) = (Reader::new(self), self.extent());
        let columns = way.chunk_by(|a, b| a.column == b.column);
        let inside = columns.filter(|spans| extent.contains(spans[0].column.0, spans[0].column.1));
        let tops = inside.map(|spans| (spans, reader.top(spans[0].column)));
        tops.filter(|(spans, top)| top - spans[0].bottom > SKIN).collect()
    }

    /// Removes what a body has passed, and puts it around the body. What is above it comes to lie on it.
    fn displace(&mut self, body: u64, way: &[Span], motions: &Motions) -> Result<(), Error> {
        let mut moved: Vec<((i32, i32), i64)> = Vec::new();
        let sunk = (self.soil().push * PARTS as f64).round() as i64;
        let mut total = Total::default();
        for (spans, height) in self.pierced(way) {
            let (column, bottom) = (spans[0].column, spans[0].bottom);
            let mut volume = self.lower(column, bottom)?;
            if volume == 0 {
                continue;
            }
            // From above: what is between the parts of the body stays.
            let (mut above, mut gone) = (height, 0);
            for span in spans.iter().rev() {
                let part = (height.min(above) - span.top).clamp(0, volume);
                above = span.bottom;
                volume -= part;
                gone += self.lay(body, column, span.top, part)?;
            }
            let motion = motions.of(spans[0].sole);
            total.add(motion, volume);
            let push = if Heading::of(motion).sinks { sunk } else { PARTS };
            let pushed = (i128::from(volume) * i128::from(push) / i128::from(PARTS)) as i64;
            self.pack(column, volume - pushed)?;
            gone += pushed;
            if gone > 0 {
                moved.push((column, gone));
            }
        }
        let heading = Heading::of(total.mean());
        // Each round, columns that were filled up to the body join those that material has to leave.
        let mut full: Vec<(i32, i32)> = Vec::new();
        while !moved.is_empty() {
            full.extend(moved.iter().map(|(column, _)| *column));
            full.sort_unstable();
            full.dedup();
            let landed = self.spread(moved, &full, heading)?;
            moved = Vec::new();
            for column in landed {
                let roof = self.roof(column);
                if roof != i64::MAX {
                    let excess = self.lower(column, roof)?;
                    if excess > 0 {
                        moved.push((column, excess));
                    }
                }
            }
        }
        Ok(())
    }

    /// Lays a volume onto the highest floor of a body that is not above a height, or back onto the ground, and returns what has no room there.
    fn lay(&mut self, body: u64, (i, k): (i32, i32), height: i64, volume: i64) -> Result<i64, Error> {
        if volume == 0 {
            return Ok(0);
        }
        let floors = Arc::make_mut(&mut self.floors);
        let all = floors.get_mut(&(i, k)).into_iter().flatten();
        let own = all.filter(|floor| floor.body == body && floor.base <= height);
        if let Some(floor) = own.max_by_key(|floor| floor.base) {
            floor.load += volume;
            return Ok(0);
        }
        let room = self.roof((i, k)).saturating_sub(self.top(i, k)).clamp(0, volume);
        let (key, index) = self.setup.place(i, k);
        self.tile_mut(key)?.loose[index] += room;
        Ok(volume - room)
    }

    /// Lowers a column to a height and returns what was removed; nothing if it is lower, or reaches above by a skin only.
    pub(crate) fn lower(&mut self, (i, k): (i32, i32), height: i64) -> Result<i64, Error> {
        if self.top(i, k) - height <= SKIN {
            return Ok(0);
        }
        self.loosen(i, k, height)?;
        let (key, index) = self.setup.place(i, k);
        let tile = self.tile_mut(key)?;
        let volume = (tile.top(index) - height).clamp(0, tile.loose[index]);
        tile.loose[index] -= volume;
        Ok(volume)
    }

    /// Compresses a volume in a column: it counts, and takes no space.
    fn pack(&mut self, (i, k): (i32, i32), volume: i64) -> Result<(), Error> {
        let (key, index) = self.setup.place(i, k);
        let tile = self.tile_mut(key)?;
        tile.packed[index] += volume;
        tile.pressed |= tile.packed[index] > 0;
        Ok(())
    }

    /// Moves volumes from full columns, which are in order, outward, from those farthest from the rim on, and returns where they land, in order.
    fn spread(
        &mut self,
        moved: Vec<((i32, i32), i64)>,
        full: &[(i32, i32)],
        heading: Heading,
    ) -> Result<Vec<(i32, i32)>, Error> {
        let (contours, extent) = (Contours::of(full, self.extent()), self.extent());
        // By the number of a full column.
        let mut volumes = vec![0; full.len()];
        for (column, volume) in moved {
            if let Some(number) = contours.number(column) {
                volumes[number] += volume;
            }
        }
        let mut landed: Vec<((i32, i32), i64)> = Vec::new();
        for number in contours.inward_first() {
            let (column, ring) = contours.column(number);
            let volume = std::mem::take(&mut volumes[number]);
            if volume == 0 {
                continue;
            }
            let target = |(di, dk): (i32, i32)| {
                let to = (column.0 + di, column.1 + dk);
                let ahead = heading.sinks || heading.x * i128::from(di) + heading.z * i128::from(dk) >= 0;
                let number = contours.number(to);
                let outward =
                    number.map_or(extent.contains(to.0, to.1), |number| contours.is_below(number, ring));
                outward.then_some((to, number, ahead))
            };
            let all = AROUND.map(target);
            let has_ahead = all.iter().flatten().any(|(.., ahead)| *ahead);
            let targets = all.into_iter().flatten().filter(|(.., ahead)| *ahead || !has_ahead);
            let count = targets.clone().count() as i64;
            let share = if count > 0 { volume / count } else { 0 };
            // What cannot be divided equally, and what cannot go anywhere, is compressed.
            self.pack(column, volume - share * count)?;
            for (to, number, _) in targets {
                match number {
                    Some(number) => volumes[number] += share,
                    None => landed.push((to, share)),
                }
            }
        }
        // Columns from which no way leads to a free one.
        for (number, volume) in volumes.into_iter().enumerate().filter(|(_, volume)| *volume > 0) {
            self.pack(contours.column(number).0, volume)?;
        }
        landed.sort_unstable_by_key(|(column, _)| *column);
        landed.dedup_by(|next, sum| {
            let same = next.0 == sum.0;
            sum.1 += if same { next.1 } else { 0 };
            same
        });
        for &((i, k), volume) in &landed {
            let (key, index) = self.setup.place(i, k);
            self.ensure(key)?;
            self.tile_mut(key)?.loose[index] += volume;
        }
        let landed: Vec<_> = landed.into_iter().map(|(column, _)| column).collect();
        self.wake_all(landed.iter().copied())?;
        Ok(landed)
    }
}

/// The floors on spans, which are in order.
fn floors(body: u64, spans: &[Span]) -> impl Iterator<Item = ((i32, i32), Floor)> {
    let above = move |n: usize| spans.get(n + 1).filter(move |next: &&Span| next.column == spans[n].column);
    spans.iter().enumerate().map(move |(n, span)| {
        let ceiling = above(n).map_or(i64::MAX, |next| next.bottom);
        let floor = Floor { body, triangle: span.lid, base: span.top, load: 0, ceiling, offset: [0; 2] };
        (span.column, floor)
    })
}
