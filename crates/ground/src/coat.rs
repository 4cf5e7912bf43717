//! Material that sticks to bodies: patches of their surfaces take it up where they touch the ground, and shed it as particles after they have left
//! (Sumner, O'Brien, Hodgins, section 3.2).
//!
//! A patch of an area A takes the volume v = A·`stick` from the column at its middle, or what that has. At a time t after it has left the ground, v·exp(-t/`shed`)
//! still sticks to it: of the n particles that v is divided into, number m leaves within the time in which the exponential falls from 1 - m/n to 1 - (m + 1)/n, at a
//! place of that interval which is random. So births have random times, and what has been shed differs from the exponential by less than a
//! particle of each patch at all times. Triangles that are larger than a column are divided, so that what sticks does not depend on how a body is divided into triangles.

use std::cell::OnceCell;
use std::collections::BTreeMap;
use std::sync::Arc;

use crate::barrier::Barriers;
use crate::noise::{mixed, unit};
use crate::particles::Particle;
use crate::tile::{HIGHEST, QUANTA};
use crate::{Body, Error, Ground, Vector};

/// Longest side of a patch, in columns.
const SIDE: f64 = 1.25;
/// Most parts of a side of a triangle, and roughly the most patches of a body.
const PARTS: f64 = 256.0;
const PATCHES: f64 = 262_144.0;
/// Distance in columns, besides the thickness of what has been taken, up to which a patch touches the ground.
const NEAR: f64 = 0.25;
/// Random part of a velocity, relative to its magnitude.
const SCATTER: f64 = 0.2;
/// Volumes up to this are not taken from a column, in quanta; a millionth of a cell.
const SKIN: i64 = 4096;

/// What sticks to a body.
#[derive(Clone, Debug)]
pub(crate) struct Coats {
    pub triangles: Arc<[[u32; 3]]>,
    /// Into how many parts the sides of each triangle are divided, and the number of its first patch.
    divisions: Arc<[(u32, u32)]>,
    /// Where the points of the body are, and where they were at the tick before.
    pub points: Arc<[Vector]>,
    past: Arc<[Vector]>,
    /// By patch.
    coats: BTreeMap<u32, Coat>,
}

/// What sticks to a patch.
#[derive(Clone, Copy, Debug)]
struct Coat {
    /// Volume in quanta.
    volume: i64,
    /// How it leaves, unless the patch touches the ground.
    shedding: Option<Shedding>,
}

/// How a patch sheds what sticks to it.
#[derive(Clone, Copy, Debug)]
struct Shedding {
    /// When the patch left the ground.
    since: f64,
    /// For how long it has shed since then, as if it had been shaken all the time ([`Soil::hold`](crate::Soil::hold)).
    shaken: f64,
    /// Volume of each particle in quanta; the last one is what is left.
    size: i64,
    /// Number of particles, and of those that have left.
    count: u32,
    gone: u32,
    seed: u64,
}

impl Shedding {
    /// The number of the next particle.
    fn id(&self) -> u64 {
        mixed(self.seed ^ mixed(u64::from(self.gone)))
    }

    /// A random number from 0 to 1 of the next particle, by number.
    fn random(&self, number: u64) -> f64 {
        unit(mixed(self.id() ^ mixed(number)))
    }

    /// How long after the patch has left the ground the next particle leaves, if that is shaken.
    fn next(&self, constant: f64) -> f64 {
        let part = (f64::from(self.gone) + self.random(0)) / f64::from(self.count);
        -constant * libm::log(1.0 - part)
    }

    /// Weights of the corners of a triangle for a place that is random on it, each as likely as any (equations 5 to 7).
    fn weights(&self) -> [f64; 3] {
        let a = 1.0 - self.random(1).sqrt();
        let b = self.random(2) * (1.0 - a);
        [a, b, 1.0 - a - b]
    }

    /// A random vector within a ball of radius 1.
    fn scatter(&self) -> Vector {
        let (up, turn) = (2.0 * self.random(3) - 1.0, std::f64::consts::TAU * self.random(4));
        let level = (1.0 - up * up).sqrt();
        Vector::new(level * libm::cos(turn), up, level * libm::sin(turn)) * self.random(5).cbrt()
    }
}

impl Coats {
    fn new(body: &Body, cell: f64) -> Coats {
        let parts = |side: f64| -> Vec<f64> {
            let of = |corners: &[u32; 3]| {
                let [a, b, c] = corners.map(|n| body.to[n as usize]);
                let longest = (b - a).norm().max((c - b).norm()).max((a - c).norm());
                (longest / (side * cell)).ceil().clamp(1.0, PARTS)
            };
            body.triangles.iter().map(of).collect()
        };
        let mut counts = parts(SIDE);
        let all: f64 = counts.iter().map(|n| n * n).sum();
        if all > PATCHES {
            counts = parts(SIDE * (all / PATCHES).sqrt());
        }
        let mut first = 0;
        let numbered = counts.into_iter().map(|count| {
            let count = count as u32;
            first += count * count;
            (count, first - count * count)
        });
        Coats {
            triangles: Arc::clone(&body.triangles),
            divisions: numbered.collect(),
            points: Arc::clone(&body.from),
            past: Arc::clone(&body.from),
            coats: BTreeMap::new(),
        }
    }

    /// A triangle at some points of the body, and its corners as weights of those of the triangle that it is a part of.
    fn patch(&self, patch: u32) -> ([u32; 3], [[f64; 3]; 3]) {
        let number = self.divisions.partition_point(|(_, first)| *first <= patch) - 1;
        let (count, first) = self.divisions[number];
        let mut place = patch - first;
        let mut row = 0;
        while place >= 2 * (count - row) - 1 {
            place -= 2 * (count - row) - 1;
            row += 1;
        }
        (self.triangles[number], part(count, row, place))
    }

    /// The corners of patches to which something sticks, and its volume in quanta.
    pub fn patches(&self) -> impl Iterator<Item = ([Vector; 3], i64)> + '_ {
        self.coats.iter().map(|(patch, coat)| {
            let (corners, weights) = self.patch(*patch);
            let corners = corners.map(|n| self.points[n as usize]);
            (weights.map(|weights| mean(weights, corners)), coat.volume)
        })
    }

    /// The corners of all patches.
    pub fn all(&self) -> impl Iterator<Item = [Vector; 3]> + '_ {
        let triangles = self.triangles.iter().zip(self.divisions.iter());
        triangles.flat_map(|(corners, (count, _))| {
            let corners = corners.map(|n| self.points[n as usize]);
            let rows =
                (0..*count).flat_map(move |row| (0..2 * (count - row) - 1).map(move |place| (row, place)));
            rows.map(move |(row, place)| part(*count, row, place).map(|weights| mean(weights, corners)))
        })
    }

    /// The acceleration of the middle of a patch, from the tick before to this one, in which the body goes on from where it was.
    fn acceleration(&self, body: &Body, (corners, weights): ([u32; 3], [[f64; 3]; 3]), tick: f64) -> f64 {
        let change = corners.map(|n| {
            let n = n as usize;
            (body.to[n] - body.from[n]) - (self.points[n] - self.past[n])
        });
        mean([1.0 / 3.0; 3], weights.map(|weights| mean(weights, change))).norm() / (tick * tick)
    }

    fn volume(&self) -> i128 {
        self.coats.values().map(|coat| i128::from(coat.volume)).sum()
    }
}

/// The corners of a part of a triangle whose sides are divided into `count` parts, in a row and at a place there, as weights of its corners.
fn part(count: u32, row: u32, place: u32) -> [[f64; 3]; 3] {
    let corner = |p: u32, q: u32| {
        let [p, q] = [p, q].map(|n| f64::from(n) / f64::from(count));
        [1.0 - p - q, p, q]
    };
    let p = place / 2;
    match place % 2 {
        0 => [corner(p, row), corner(p + 1, row), corner(p, row + 1)],
        _ => [corner(p + 1, row), corner(p + 1, row + 1), corner(p, row + 1)],
    }
}

/// The mean of the corners of a triangle.
fn mean(weights: [f64; 3], [a, b, c]: [Vector; 3]) -> Vector {
    a * weights[0] + b * weights[1] + c * weights[2]
}

/// A patch that touches the ground.
struct Touch {
    patch: u32,
    column: (i32, i32),
    /// What can stick to it, in quanta.
    most: i64,
}

impl Ground {
    /// Volume that sticks to bodies, in m³.
    pub fn sticking(&self) -> f64 {
        self.sticking_quanta() as f64 / QUANTA * self.cell().powi(3)
    }

    pub(crate) fn sticking_quanta(&self) -> i128 {
        self.coats.values().map(|coats| coats.volume()).sum()
    }

    /// After a tick, from its beginning to its end: bodies take up what they touch, and shed what sticks to them where they do not.
    pub(crate) fn stick_and_shed(&mut self, bodies: &[Body], span: [f64; 2]) -> Result<(), Error> {
        if self.soil().stick == 0.0 {
            return Ok(());
        }
        let (tick, cell) = (self.setup.settings.tick, self.cell());
        let made = OnceCell::new();
        let barriers = || made.get_or_init(|| Barriers::new(bodies, true, span[1], (tick, cell)));
        for body in bodies.iter().filter(|body| !body.shelf) {
            let known = self.coats.get(&body.id).cloned();
            let same = known
                .filter(|coats| coats.triangles == body.triangles && coats.points.len() == body.to.len());
            let is_still = same.is_some() && body.from == body.to && self.is_at_rest();
            let mut coats = match same {
                Some(coats) => coats,
                None => {
                    if self.coats.contains_key(&body.id) {
                        self.let_go(body.id, span, barriers())?;
                    }
                    Arc::new(Coats::new(body, self.cell()))
                }
            };
            if !is_still {
                self.touch(body, span, Arc::make_mut(&mut coats))?;
            }
            if coats.coats.values().any(|coat| coat.shedding.is_some()) {
                self.shed(body, span, Arc::make_mut(&mut coats), barriers())?;
            }
            if coats.points != body.to || coats.past != body.from {
                let coats = Arc::make_mut(&mut coats);
                (coats.past, coats.points) = (Arc::clone(&body.from), Arc::clone(&body.to));
            }
            Arc::make_mut(&mut self.coats).insert(body.id, coats);
        }
        Ok(())
    }

    /// Lets go all that sticks to a body that is gone, or has another shape now. It is at rest where it was.
    pub(crate) fn let_go(
        &mut self,
        id: u64,
        [begin, end]: [f64; 2],
        barriers: &Barriers,
    ) -> Result<(), Error> {
        if !self.coats.contains_key(&id) {
            return Ok(());
        }
        let Some(coats) = Arc::make_mut(&mut self.coats).remove(&id) else { return Ok(()) };
        for (patch, coat) in &coats.coats {
            let (corners, weights) = coats.patch(*patch);
            let corners = corners.map(|n| coats.points[n as usize]);
            let shedding = self.shedding((id, *patch), begin, coat);
            let mut rest = Coat { volume: coat.volume, shedding: Some(shedding) };
            while let Some((volume, left)) = rest.next() {
                let place = mean(left.weights(), weights.map(|weights| mean(weights, corners)));
                let (id, velocity) = (left.id(), Vector::zeros());
                self.throw(Particle { id, born: begin, place, velocity, volume }, end, barriers)?;
            }
        }
        Ok(())
    }

    /// Patches that touch the ground after a tick take it up; those that have left it begin to shed.
    fn touch(&mut self, body: &Body, [begin, end]: [f64; 2], coats: &mut Coats) -> Result<(), Error> {
        let clear = self.soil().stick + NEAR * self.cell();
        let touches = self.touches(body, coats, clear);
        for Touch { patch, column, most } in &touches {
            let coat = coats.coats.get(patch).copied();
            let has = coat.map_or(0, |coat| coat.volume);
            let volume = has + self.take(*column, most - has)?;
            if volume > 0 {
                coats.coats.insert(*patch, Coat { volume, shedding: None });
            }
        }
        let is_touching = |patch: &u32| touches.binary_search_by_key(patch, |touch| touch.patch).is_ok();
        let left = coats.coats.iter().filter(|(patch, coat)| coat.shedding.is_none() && !is_touching(patch));
        let left: Vec<(u32, Coat)> = left.map(|(patch, coat)| (*patch, *coat)).collect();
        for (patch, mut coat) in left {
            let (corners, weights) = coats.patch(patch);
            let over = |points: &[Vector]| {
                let corners = corners.map(|n| points[n as usize]);
                let at = mean([1.0 / 3.0; 3], weights.map(|weights| mean(weights, corners)));
                at.y - self.highest_beside(at)
            };
            let (before, after) = (over(&body.from), over(&body.to));
            // Where the ground was taken from it, but it does not move away, it has not left.
            if after <= before {
                continue;
            }
            let part = ((clear - before) / (after - before)).clamp(0.0, 1.0);
            let since = begin + part * (end - begin);
            coat.shedding = Some(self.shedding((body.id, patch), since, &coat));
            coats.coats.insert(patch, coat);
        }
        Ok(())
    }

    /// The patches of a body that touch the ground, in order.
    fn touches(&self, body: &Body, coats: &Coats, clear: f64) -> Vec<Touch> {
        let (cell, extent) = (self.cell(), self.extent());
        let range = |axis: usize| {
            let along = |points: &[Vector], first: f64, pick: fn(f64, f64) -> f64| {
                points.iter().map(|point| point[axis]).fold(first, pick)
            };
            [along(&body.to, f64::INFINITY, f64::min), along(&body.to, f64::NEG_INFINITY, f64::max)]
        };
        let [_, highest] = self.bounds(range(0), range(2));
        let mut touches = Vec::new();
        for (corners, (count, first)) in body.triangles.iter().zip(coats.divisions.iter()) {
            let corners @ [a, b, c] = corners.map(|n| body.to[n as usize]);
            if a.y.min(b.y).min(c.y) > highest + clear {
                continue;
            }
            let area = (b - a).cross(&(c - a)).norm() / (2.0 * f64::from(count * count));
            let most = area * self.soil().stick / cell.powi(3) * QUANTA;
            let most = most.min(HIGHEST as f64) as i64;
            let mut patch = *first;
            for row in 0..*count {
                for place in 0..2 * (count - row) - 1 {
                    let weights = part(*count, row, place);
                    let at = mean([1.0 / 3.0; 3], weights.map(|weights| mean(weights, corners)));
                    let column = self.nearest(at);
                    let near = |at: f64, column: i32| (at / cell - f64::from(column)).abs() <= 0.5;
                    let inside = near(at.x, column.0) && near(at.z, column.1);
                    if inside
                        && extent.contains(column.0, column.1)
                        && at.y - self.highest_beside(at) <= clear
                    {
                        touches.push(Touch { patch, column, most });
                    }
                    patch += 1;
                }
            }
        }
        touches
    }

    /// The height in m of the highest of the four columns around a place: at a wall, that of the ground beside it.
    fn highest_beside(&self, at: Vector) -> f64 {
        let [i, k] = [at.x, at.z].map(|at| (at / self.cell()).floor() as i32);
        let around = [(i, k), (i + 1, k), (i, k + 1), (i + 1, k + 1)];
        around.map(|(i, k)| self.column(i, k)).into_iter().fold(f64::NEG_INFINITY, f64::max)
    }

    /// Takes a volume from a column, or as much as it has.
    fn take(&mut self, column: (i32, i32), volume: i64) -> Result<i64, Error> {
        let (key, index) = self.setup.place(column.0, column.1);
        self.ensure(key)?;
        let bare = self.tiles.get(&key).is_some_and(|tile| tile.top(index) - tile.bed[index] <= SKIN);
        if volume <= SKIN || bare {
            return Ok(0);
        }
        let top = self.top(column.0, column.1);
        let taken = self.lower(column, top - volume)?;
        // Bonded material grows when it comes loose.
        let more = (taken - volume).max(0);
        self.tile_mut(key)?.loose[index] += more;
        Ok(taken - more)
    }

    /// How a patch that leaves the ground sheds what sticks to it.
    fn shedding(&self, (body, patch): (u64, u32), since: f64, coat: &Coat) -> Shedding {
        let size = std::f64::consts::PI / 6.0 * (self.grain() / self.cell()).powi(3) * QUANTA;
        let count = (coat.volume as f64 / size).round().clamp(1.0, 1e6).min(coat.volume as f64);
        let seed = mixed(body ^ mixed(u64::from(patch) ^ mixed(self.book.ticks)));
        let (size, count) = (coat.volume / count as i64, count as u32);
        Shedding { since, shaken: 0.0, size, count, gone: 0, seed }
    }

    /// Diameter of particles in m.
    fn grain(&self) -> f64 {
        /// In columns, if nothing else is said.
        const PART: f64 = 0.25;
        self.soil().grain.unwrap_or(PART * self.cell())
    }

    /// Throws the particles that leave a body in a tick.
    fn shed(
        &mut self,
        body: &Body,
        [begin, end]: [f64; 2],
        coats: &mut Coats,
        barriers: &Barriers,
    ) -> Result<(), Error> {
        let (soil, tick) = (*self.soil(), end - begin);
        let patches: Vec<u32> = coats.coats.keys().copied().collect();
        // Not if it was not there at the tick before, or is somewhere else now.
        let is_followed = soil.hold.is_some() && *coats.points == *body.from;
        for patch in patches {
            let (corners, weights) = coats.patch(patch);
            let acceleration =
                if is_followed { coats.acceleration(body, (corners, weights), tick) } else { 0.0 };
            let Some(coat) = coats.coats.get_mut(&patch) else { continue };
            let Some(Shedding { since, shaken, .. }) = coat.shedding else { continue };
            let (from, pace) = (since.max(begin), soil.part_let_go(acceleration));
            while let Some(next) = coat.shedding.map(|shedding| shedding.next(soil.shed)) {
                let born = match soil.hold {
                    None => since + next,
                    // Of what would leave the part `pace` does: time counts less.
                    Some(_) if next <= shaken + pace * (end - from) => from + (next - shaken) / pace,
                    Some(_) => break,
                };
                if born > end {
                    break;
                }
                let Some((volume, shedding)) = coat.next() else { break };
                let part = ((born - begin) / tick).clamp(0.0, 1.0);
                let inside = shedding.weights();
                let at = |points: &[Vector]| {
                    let corners = corners.map(|n| points[n as usize]);
                    mean(inside, weights.map(|weights| mean(weights, corners)))
                };
                let (from, to) = (at(&body.from), at(&body.to));
                let velocity = (to - from) / tick;
                let velocity = velocity + shedding.scatter() * (SCATTER * velocity.norm());
                let (id, place) = (shedding.id(), from + (to - from) * part);
                self.throw(Particle { id, born, place, velocity, volume }, end, barriers)?;
            }
            if let Some(shedding) = &mut coat.shedding {
                shedding.shaken += pace * (end - from);
            }
        }
        coats.coats.retain(|_, coat| coat.volume > 0);
        Ok(())
    }
}

impl Coat {
    /// Takes the next particle off: its volume, and the state with its random numbers.
    fn next(&mut self) -> Option<(i64, Shedding)> {
        let shedding = self.shedding.as_mut().filter(|shedding| shedding.gone < shedding.count)?;
        let left = *shedding;
        shedding.gone += 1;
        let volume = if shedding.gone == shedding.count { self.volume } else { shedding.size };
        self.volume -= volume;
        Some((volume, left))
    }
}
