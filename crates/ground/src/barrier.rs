//! Bodies as particles meet them: their triangles, on their way through a tick.
//!
//! A particle is looked at from a body that moves: there its path is a parabola, too, and the body stands still. So the faster of the two may be as fast as it likes, and neither passes the
//! other. A path is divided where it crosses cells of a grid in plan, and meets the triangles over these where a polynomial of degree two has a root.

use nalgebra::Matrix3;

use crate::particles::{GRAVITY, Particle};
use crate::{Body, Ground, Vector};

/// Most cells of a grid along an axis.
const CELLS: f64 = 64.0;
/// Distance in columns up to which a place counts as on a triangle.
const SKIN: f64 = 1e-3;
/// How far beyond its edges a triangle is met, as a part of it: lines between triangles have no gaps.
const EDGE: f64 = 1e-6;
/// The part of the speed towards a body that a particle has away from it afterwards, and the least speed (m/s): without it, there is no end of contacts on a slope.
const REBOUND: f64 = 0.2;
const LEAST: f64 = 0.05;
/// Vertical component of the normal of a triangle from which on particles come to rest on it: 60°.
const FLAT: f64 = 0.5;

/// A body in a tick.
#[derive(Debug)]
struct Barrier {
    id: u64,
    faces: Vec<Face>,
    /// A surface without an inside: it is met from both sides.
    is_open: bool,
    /// The box around it where its points are known, and on its way.
    low: Vector,
    high: Vector,
    swept: [Vector; 2],
    motion: Motion,
    /// When the points of the triangles are theirs.
    time: f64,
    grid: Grid,
}

/// A triangle.
#[derive(Debug)]
struct Face {
    corners: [Vector; 3],
    /// Outward, of length 1; zero if the triangle has no area.
    normal: Vector,
    /// Twice its area against the normal, by the square of that: weights of places on it are products with this.
    across: Vector,
}

/// How a body moves, as if it were rigid.
#[derive(Clone, Copy, Debug, Default)]
struct Motion {
    middle: Vector,
    velocity: Vector,
    rotation: Vector,
}

impl Motion {
    fn of(from: &[Vector], to: &[Vector], seconds: f64) -> Motion {
        let count = from.len().max(1) as f64;
        let middle = from.iter().zip(to).map(|(from, to)| (from + to) * 0.5).sum::<Vector>() / count;
        let velocity = from.iter().zip(to).map(|(from, to)| to - from).sum::<Vector>() / (count * seconds);
        let (mut inertia, mut moment) = (Matrix3::zeros(), Vector::zeros());
        for (from, to) in from.iter().zip(to) {
            let arm = (from + to) * 0.5 - middle;
            inertia += Matrix3::identity() * arm.norm_squared() - arm * arm.transpose();
            moment += arm.cross(&((to - from) / seconds - velocity));
        }
        let rotation = inertia.try_inverse().map_or(Vector::zeros(), |inverse| inverse * moment);
        let is_finite = rotation.iter().all(|value| value.is_finite());
        Motion { middle, velocity, rotation: if is_finite { rotation } else { Vector::zeros() } }
    }

    fn at(&self, place: Vector) -> Vector {
        self.velocity + self.rotation.cross(&(place - self.middle))
    }
}

/// Which triangles are over the cells of a rectangle in plan.
#[derive(Debug, Default)]
struct Grid {
    low: [f64; 2],
    cell: f64,
    counts: [usize; 2],
    /// By cell, row after row, where its triangles begin, and the triangles.
    starts: Vec<u32>,
    triangles: Vec<u32>,
}

impl Grid {
    fn new(triangles: &[[Vector; 3]], [low, high]: [Vector; 2], least: f64) -> Grid {
        let cell = ((high.x - low.x).max(high.z - low.z) / CELLS).max(least);
        let counts = [high.x - low.x, high.z - low.z].map(|wide| (wide / cell).floor() as usize + 1);
        let mut grid = Grid { low: [low.x, low.z], cell, counts, ..Grid::default() };
        let ranges: Vec<_> = triangles
            .iter()
            .map(|corners| {
                let all = |pick: fn(f64, f64) -> f64, axis: usize| {
                    pick(pick(corners[0][axis], corners[1][axis]), corners[2][axis])
                };
                grid.cells([all(f64::min, 0), all(f64::min, 2)], [all(f64::max, 0), all(f64::max, 2)])
            })
            .collect();
        let mut starts = vec![0_u32; counts[0] * counts[1] + 1];
        let numbers = |[x, z]: [[usize; 2]; 2]| {
            (z[0]..=z[1]).flat_map(move |k| (x[0]..=x[1]).map(move |i| k * counts[0] + i))
        };
        for range in &ranges {
            numbers(*range).for_each(|number| starts[number + 1] += 1);
        }
        for number in 1..starts.len() {
            starts[number] += starts[number - 1];
        }
        let mut next = starts.clone();
        grid.triangles = vec![0; starts.last().map_or(0, |last| *last as usize)];
        for (triangle, range) in ranges.iter().enumerate() {
            for number in numbers(*range) {
                grid.triangles[next[number] as usize] = triangle as u32;
                next[number] += 1;
            }
        }
        grid.starts = starts;
        grid
    }

    /// First and last cell along both axes of a rectangle, those at the edge beyond it.
    fn cells(&self, low: [f64; 2], high: [f64; 2]) -> [[usize; 2]; 2] {
        [0, 1].map(|axis| {
            let last = (self.counts[axis] - 1) as f64;
            [low[axis], high[axis]]
                .map(|at| ((at - self.low[axis]) / self.cell).floor().clamp(0.0, last) as usize)
        })
    }

    /// The triangles over a rectangle, some of them more than once.
    fn over(&self, low: [f64; 2], high: [f64; 2]) -> impl Iterator<Item = u32> + '_ {
        let [x, z] = self.cells(low, high);
        (z[0]..=z[1]).flat_map(move |k| {
            let row = k * self.counts[0];
            let (from, to) = (self.starts[row + x[0]], self.starts[row + x[1] + 1]);
            self.triangles[from as usize..to as usize].iter().copied()
        })
    }
}

/// Where a particle meets a body.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Contact {
    pub body: u64,
    pub time: f64,
    /// Where, in the body as it is where its points are known.
    pub place: Vector,
    /// Outward, of length 1.
    normal: Vector,
    /// Velocity of the body there.
    velocity: Vector,
}

impl Contact {
    /// Whether what comes down there stays.
    pub fn is_flat(&self) -> bool {
        self.normal.y >= FLAT
    }

    /// A particle after it: at the place where it met the body, just outside, with a part of its speed towards the body turned round.
    pub fn after(&self, particle: &Particle, cell: f64) -> Particle {
        let speed = particle.speed_at(self.time) - self.velocity;
        let towards = speed.dot(&self.normal).min(0.0);
        let away = (-REBOUND * towards).max(LEAST);
        Particle {
            born: self.time,
            place: particle.at(self.time) + self.normal * (SKIN * cell),
            velocity: self.velocity + speed + self.normal * (away - towards),
            ..*particle
        }
    }
}

/// The bodies that particles can meet in a tick.
#[derive(Debug, Default)]
pub(crate) struct Barriers {
    all: Vec<Barrier>,
}

impl Barriers {
    /// Bodies where they are at the beginning of a tick or at its end, at a time.
    pub fn new(bodies: &[Body], at_end: bool, time: f64, (tick, cell): (f64, f64)) -> Barriers {
        let all = bodies.iter().filter(|body| !body.triangles.is_empty());
        Barriers { all: all.map(|body| Barrier::new(body, at_end, time, (tick, cell))).collect() }
    }

    /// Where a particle meets one of them first, from a time to another one.
    pub fn first(&self, particle: &Particle, span: [f64; 2], cell: f64) -> Option<Contact> {
        if self.all.is_empty() {
            return None;
        }
        let (begin, end) = (particle.at(span[0]), particle.at(span[1]));
        let (low, mut high) = (begin.inf(&end), begin.sup(&end));
        high.y = high.y.max(particle.highest(span));
        // Straight ways are not quite those of what turns.
        let is_near = |barrier: &&Barrier| {
            let [least, most] = barrier.swept;
            (0..3).all(|axis| low[axis] <= most[axis] + cell && high[axis] >= least[axis] - cell)
        };
        let near = self.all.iter().filter(is_near);
        let contacts = near.filter_map(|barrier| barrier.meet(particle, span, cell));
        contacts.min_by(|a, b| a.time.total_cmp(&b.time))
    }
}

impl Barrier {
    fn new(body: &Body, at_end: bool, time: f64, (tick, cell): (f64, f64)) -> Barrier {
        let points = if at_end { &body.to } else { &body.from };
        let triangles: Vec<[Vector; 3]> =
            body.triangles.iter().map(|corners| corners.map(|n| points[n as usize])).collect();
        let corners = || triangles.iter().flatten();
        let first = triangles.first().map_or(Vector::zeros(), |corners| corners[0]);
        let low = corners().fold(first, |low, point| low.inf(point));
        let high = corners().fold(first, |high, point| high.sup(point));
        let volume: f64 =
            triangles.iter().map(|[a, b, c]| (a - first).dot(&(b - first).cross(&(c - first)))).sum();
        let grid = Grid::new(&triangles, [low, high], cell);
        // Of a mesh that is inside out, triangles go round the other way.
        let sign = if volume < 0.0 && !body.shelf { -1.0 } else { 1.0 };
        let face = |corners: [Vector; 3]| {
            let [a, b, c] = corners;
            let across = (b - a).cross(&(c - a));
            let area = across.norm();
            let normal = if area > 0.0 { across * (sign / area) } else { Vector::zeros() };
            Face { corners, normal, across: if area > 0.0 { across / (area * area) } else { across } }
        };
        let swept = body.from.iter().chain(body.to.iter());
        let swept = swept.fold([low, high], |[low, high], point| [low.inf(point), high.sup(point)]);
        Barrier {
            id: body.id,
            is_open: body.shelf,
            motion: Motion::of(&body.from, &body.to, tick),
            faces: triangles.into_iter().map(face).collect(),
            swept,
            low,
            high,
            time,
            grid,
        }
    }

    fn meet(&self, particle: &Particle, [from, to]: [f64; 2], cell: f64) -> Option<Contact> {
        let velocity = self.motion.at(particle.at(from));
        let seen = particle.seen_from(velocity, self.time);
        let (begin, end) = (seen.at(from), seen.at(to));
        let skin = SKIN * cell;
        let margin = Vector::repeat(skin);
        let (low, mut high) = (begin.inf(&end) - margin, begin.sup(&end) + margin);
        high.y = high.y.max(seen.highest([from, to]) + skin);
        if (0..3).any(|axis| low[axis] > self.high[axis] || high[axis] < self.low[axis]) {
            return None;
        }
        // In parts that cross a few cells of the grid.
        let long = (end.x - begin.x).abs().max((end.z - begin.z).abs());
        let parts = (long / self.grid.cell).ceil().clamp(1.0, 4.0 * CELLS) as u32;
        let time = |part: u32| from + (to - from) * (f64::from(part) / f64::from(parts));
        (0..parts).find_map(|part| self.meet_in(&seen, [time(part), time(part + 1)], (velocity, skin)))
    }

    fn meet_in(
        &self,
        seen: &Particle,
        [from, to]: [f64; 2],
        (velocity, skin): (Vector, f64),
    ) -> Option<Contact> {
        let (begin, end, speed) = (seen.at(from), seen.at(to), seen.speed_at(from));
        let low = [begin.x.min(end.x) - skin, begin.z.min(end.z) - skin];
        let high = [begin.x.max(end.x) + skin, begin.z.max(end.z) + skin];
        let mut first: Option<(f64, Vector)> = None;
        for number in self.grid.over(low, high) {
            let Face { corners: [a, b, c], normal, across } = &self.faces[number as usize];
            let over = normal.dot(&(begin - a));
            // Surfaces without an inside are met from the side on which the particle is.
            let sign = if self.is_open && over < 0.0 { -1.0 } else { 1.0 };
            let course = [sign * over, sign * normal.dot(&speed), sign * GRAVITY * normal.y];
            let Some(after) = entry(course, skin) else { continue };
            if after > to - from || first.is_some_and(|(sooner, _)| after >= sooner) {
                continue;
            }
            let (at, normal) = (seen.at(from + after), normal * sign);
            let weight = |p: &Vector, q: &Vector| (q - p).cross(&(at - p)).dot(across);
            if weight(a, b) >= -EDGE && weight(b, c) >= -EDGE && weight(c, a) >= -EDGE {
                first = Some((after, normal));
            }
        }
        first.map(|(after, normal)| {
            let time = from + after;
            Contact { body: self.id, time, place: seen.at(time), normal, velocity }
        })
    }
}

/// When something that is at a distance from a plane, with a speed away from it and an acceleration towards it, comes to its other side; at once if it is on the plane and about to.
fn entry([distance, speed, fall]: [f64; 3], skin: f64) -> Option<f64> {
    if (-skin..=0.0).contains(&distance) && (speed < 0.0 || speed == 0.0 && fall > 0.0) {
        return Some(0.0);
    }
    let square = speed * speed + 2.0 * fall * distance;
    // What only touches the plane does not enter.
    if square <= 0.0 {
        return None;
    }
    // The root at which it comes nearer; without a difference of numbers that may be nearly equal.
    let root = square.sqrt();
    let after = if speed < 0.0 { 2.0 * distance / (root - speed) } else { (speed + root) / fall };
    (after >= 0.0 && after.is_finite()).then_some(after)
}

impl Ground {
    /// Bodies at the beginning of this tick, if something may meet them.
    pub(crate) fn barriers_before(&self, bodies: &[Body], begin: f64) -> Barriers {
        if self.particles.is_empty() {
            return Barriers::default();
        }
        Barriers::new(bodies, false, begin, (self.setup.settings.tick, self.cell()))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::{Barriers, entry};
    use crate::particles::Particle;
    use crate::{Body, Description, Error, Extent, Ground, Relief, Settings, Soil, Vector};

    #[test]
    fn a_plane_is_entered_from_its_outside() {
        let at = |distance: f64, speed: f64, fall: f64| {
            entry([distance, speed, fall], 1e-3).map(|after| (after * 1e9).round() / 1e9)
        };
        assert_eq!(at(1.0, -2.0, 0.0), Some(0.5));
        assert_eq!(at(1.0, 2.0, 0.0), None);
        assert_eq!(at(0.5, 0.0, 1.0), Some(1.0));
        // From behind up through the plane, and down again.
        assert_eq!(at(-1.5, 2.0, 1.0), Some(3.0));
        // An overhang from which gravity pulls away: it does not come there, or does.
        assert_eq!(at(1.0, -1.0, -1.0), None);
        assert_eq!(at(0.375, -1.0, -1.0), Some(0.5));
        // On the plane: it goes in, or away.
        assert_eq!(at(-1e-4, -1.0, 0.0), Some(0.0));
        assert_eq!(at(0.0, 0.0, 9.0), Some(0.0));
        assert_eq!(at(0.0, 0.0, -9.0), None);
        assert_eq!(at(-1e-4, 1.0, 0.0), None);
        assert_eq!(at(-0.1, -1.0, 0.0), None);
    }

    /// A box between two corners, or only its side towards the first one.
    fn board(low: Vector, high: Vector, shelf: bool) -> Body {
        let corner = |n: u32| {
            let pick = |bit: u32, axis: usize| if n >> bit & 1 == 0 { low[axis] } else { high[axis] };
            Vector::new(pick(0, 0), pick(1, 1), pick(2, 2))
        };
        let points: Arc<[Vector]> = (0..8).map(corner).collect();
        let sides = [[0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6], [0, 4, 6, 2], [1, 3, 7, 5]];
        let sides = &sides[..if shelf { 1 } else { 6 }];
        let triangles = sides.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]);
        Body { shelf, ..Body::still(1, "a board", triangles.collect(), points) }
    }

    /// Boards and leaves that are struck, chased and overtaken, from below and from a side, at up to 12 m/s a way of ten thicknesses in a tick: nothing comes through, and no
    /// volume is lost.
    #[test]
    fn nothing_passes_a_board_that_moves() -> Result<(), Error> {
        let description = Description {
            cell: 0.01,
            extent: Extent::around(200),
            soil: Soil::snow(),
            bed: Relief::Level(-0.1),
            depth: Relief::Level(0.1),
        };
        let mut state = 7_u64;
        let mut random = |low: f64, high: f64| {
            state = crate::noise::mixed(state);
            low + (high - low) * crate::noise::unit(state)
        };
        let tick = Settings::default().tick;
        let mut met = 0;
        // Of a lying board the lower side is met, of a standing one that towards -x.
        for (axis, shelf) in [(1, false), (0, false), (1, true)] {
            let mut ground = Ground::new(description.clone(), Settings::default())?;
            let along = |at: f64, wide: f64| {
                let mut corner = Vector::repeat(wide);
                corner.y += 2.0;
                corner[axis] = at;
                corner
            };
            let first = if axis == 1 { 2.0 } else { 0.0 };
            let mut at = first;
            let total = 300;
            for n in 0..total {
                let mut place = Vector::new(random(-0.1, 0.1), 2.0 + random(-0.1, 0.1), random(-0.1, 0.1));
                place[axis] = first - random(0.02, 0.1);
                let mut velocity = Vector::new(random(-1.0, 1.0), random(-1.0, 1.0), random(-1.0, 1.0));
                velocity[axis] *= 4.0;
                let particle = Particle { id: n, born: 0.0, place, velocity, volume: 1 << 20 };
                ground.throw(particle, 0.0, &Barriers::default())?;
                ground.book.poured += 1 << 20;
            }
            for _ in 0..12 {
                let next = at + random(-12.0, 4.0) * tick;
                let of = |at: f64| board(along(at, -0.35), along(at + 0.01, 0.35), shelf);
                let (from, to) = (of(at), of(next));
                let body = Body { to: to.to, ..from };
                ground.advance(&[], &[body])?;
                at = next;
                assert_eq!(ground.imbalance(), 0);
                for flight in ground.flights(ground.time()) {
                    assert!(flight.place[axis] < at + 1e-3 * 0.01, "{axis} {shelf} {} {at}", flight.place);
                    met += usize::from(flight.place[axis] > at - 0.002);
                }
            }
        }
        assert!(met > 20, "{met}");
        Ok(())
    }

    /// What comes down on a flat side lies there, and is carried by it.
    #[test]
    fn what_a_rising_board_catches_lies_on_it() -> Result<(), Error> {
        let description = Description {
            cell: 0.01,
            extent: Extent::around(50),
            soil: Soil::snow(),
            bed: Relief::Level(-0.1),
            depth: Relief::Level(0.1),
        };
        for shelf in [false, true] {
            let mut ground = Ground::new(description.clone(), Settings::default())?;
            for n in 0..20 {
                let place = Vector::new(0.004 * f64::from(n), 0.5, 0.03);
                let velocity = Vector::zeros();
                let particle = Particle { id: n as u64, born: 0.0, place, velocity, volume: 1 << 24 };
                ground.throw(particle, 0.0, &Barriers::default())?;
                ground.book.poured += 1 << 24;
            }
            // It rises by 20 cm in each tick.
            for tick in 0..5 {
                let of = |tick: u32| {
                    let low = 0.1 + 0.2 * f64::from(tick);
                    board(Vector::new(-0.2, low, -0.2), Vector::new(0.2, low + 0.02, 0.2), shelf)
                };
                ground.advance(&[], &[Body { to: of(tick + 1).to, ..of(tick) }])?;
                assert_eq!(ground.imbalance(), 0);
            }
            assert_eq!((ground.particles(), ground.carried() > 0.0), (0, true));
            let all = 20.0 * f64::from(1 << 24) / crate::tile::QUANTA * 1e-6;
            assert!((ground.carried() / all - 1.0).abs() < 1e-12);
        }
        Ok(())
    }
}
