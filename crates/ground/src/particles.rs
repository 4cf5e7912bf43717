//! Particles: material in the air. They fly as projectiles, in closed form, land on the surface as it is in their tick, and join what they land on
//! (Sumner, O'Brien, Hodgins, section 3.2). From bodies that they meet from the side or from below they rebound.
//!
//! A path crosses columns at a uniform speed in plan, so over each square of columns its height above the surface is a polynomial of degree two in the time.
//! Its root is the landing.

use std::sync::Arc;

use crate::barrier::Barriers;
use crate::load::{Floor, Parcel};
use crate::tile::QUANTA;
use crate::{Body, Error, Ground, Mesh, Vector};

/// Gravity in m/s².
pub(crate) const GRAVITY: f64 = 9.81;
/// Most particles in the air.
const MOST: usize = 1 << 17;
/// Most contacts with bodies in a tick: what is thrown to and fro between them more often stays there.
const CONTACTS: usize = 16;

/// A particle at an instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flight {
    /// Its number, random and the same at all times.
    pub id: u64,
    /// Where it is, in m.
    pub place: Vector,
    /// Its volume in m³.
    pub volume: f64,
}

/// Material in the air.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Particle {
    /// A number of its own.
    pub id: u64,
    /// When its flight begins, in seconds from the beginning.
    pub born: f64,
    /// Where, and how fast.
    pub place: Vector,
    pub velocity: Vector,
    /// Volume in quanta of a column.
    pub volume: i64,
}

/// Where a particle comes down.
struct Landing {
    time: f64,
    column: (i32, i32),
    /// In quanta.
    height: i64,
}

/// What becomes of a particle in a span of time.
enum End {
    Flies(Particle),
    Lands(Landing),
    /// It comes to rest on a body, at a place in it as it is where its points are known.
    Rests(u64, Vector),
}

/// Heights in m above which nothing can be met: of the surface, and of what lies on bodies.
struct Tops {
    surface: f64,
    floors: f64,
}

impl Particle {
    /// Its place at a time.
    pub fn at(&self, time: f64) -> Vector {
        let t = (time - self.born).max(0.0);
        self.place + self.velocity * t - Vector::y() * (0.5 * GRAVITY * t * t)
    }

    /// Its velocity at a time.
    pub fn speed_at(&self, time: f64) -> Vector {
        self.velocity - Vector::y() * (GRAVITY * (time - self.born).max(0.0))
    }

    /// The particle as it is seen from what moves with a velocity and is where it is at a time.
    pub fn seen_from(&self, velocity: Vector, time: f64) -> Particle {
        let place = self.place - velocity * (self.born - time);
        Particle { place, velocity: self.velocity - velocity, ..*self }
    }

    /// Its greatest height within a span of time.
    pub fn highest(&self, [from, to]: [f64; 2]) -> f64 {
        self.at((self.born + self.velocity.y / GRAVITY).clamp(from, to)).y
    }

    /// The last time at which it is at a height.
    fn descends_to(&self, height: f64) -> Option<f64> {
        let rise = self.velocity.y;
        let root = (rise * rise + 2.0 * GRAVITY * (self.place.y - height)).sqrt();
        let after = (rise + root) / GRAVITY;
        (after >= 0.0).then_some(self.born + after)
    }

    /// Times within a span, the ends included, at which x or z is a whole number of cells and `beside` of one.
    fn crossings(&self, [from, to]: [f64; 2], cell: f64, beside: f64) -> Vec<f64> {
        let mut times = vec![from, to];
        for axis in [0, 2] {
            let place = |time: f64| self.at(time)[axis] / cell - beside;
            let (first, last) = (place(from), place(to));
            let (low, high) = (first.min(last), first.max(last));
            let mut line = low.floor() + 1.0;
            while line < high {
                times.push(from + (line - first) / (last - first) * (to - from));
                line += 1.0;
            }
        }
        times.sort_by(f64::total_cmp);
        times
    }
}

impl Mesh {
    /// A regular octahedron around a place, of a volume in m³, as particles are drawn.
    pub fn octahedron(place: Vector, volume: f64) -> Mesh {
        // That with corners at a distance r has a volume of 4r³/3.
        let reach = (0.75 * volume).cbrt();
        let axes = [Vector::x(), Vector::y(), Vector::z()].map(|axis| axis * reach);
        // Counterclockwise from outside.
        let triangles =
            vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
        Mesh {
            points: axes.into_iter().flat_map(|axis| [place + axis, place - axis]).collect(),
            triangles,
            ..Mesh::default()
        }
    }
}

impl Ground {
    /// Number of particles in the air.
    pub fn particles(&self) -> usize {
        self.particles.len()
    }

    /// Volume in the air, in m³.
    pub fn airborne(&self) -> f64 {
        self.airborne_quanta() as f64 / QUANTA * self.cell().powi(3)
    }

    pub(crate) fn airborne_quanta(&self) -> i128 {
        self.particles.iter().map(|particle| i128::from(particle.volume)).sum()
    }

    /// Particles that are in the air at the last tick, at a time (s) up to the next one. One that comes down before is where it does.
    pub fn flights(&self, time: f64) -> Vec<Flight> {
        let begin = self.time();
        let (tops, scale) = (self.tops(), self.cell().powi(3) / QUANTA);
        let shown = |particle: &Particle| {
            let landing = self.landing(particle, [begin, time.max(begin)], &tops);
            let time = landing.map_or(time, |landing| landing.time);
            Flight { id: particle.id, place: particle.at(time), volume: particle.volume as f64 * scale }
        };
        self.particles.iter().map(shown).collect()
    }

    /// Particles in the air at a time (s) from the last tick up to the next one, as octahedra of their volume: six points each, opposite ones in pairs.
    pub fn spray(&self, time: f64) -> Mesh {
        let mut mesh = Mesh::default();
        for Flight { place, volume, .. } in self.flights(time) {
            mesh.append(&Mesh::octahedron(place, volume));
        }
        mesh
    }

    /// Lets particles join what they come down on within a tick, and rebound from bodies, which are where the tick begins.
    pub(crate) fn land(&mut self, bodies: &[Body], span: [f64; 2]) -> Result<(), Error> {
        if self.particles.is_empty() {
            return Ok(());
        }
        let (tops, barriers) = (self.tops(), self.barriers_before(bodies, span[0]));
        let before = Arc::clone(&self.particles);
        let ends: Vec<End> =
            before.iter().map(|particle| self.fly(particle, span, &tops, &barriers)).collect();
        let goes_on =
            |(end, before): (&End, &Particle)| matches!(end, End::Flies(particle) if particle == before);
        if ends.iter().zip(before.iter()).all(goes_on) {
            return Ok(());
        }
        let mut flying = Vec::with_capacity(ends.len());
        for (particle, end) in before.iter().zip(ends) {
            match end {
                End::Flies(particle) => flying.push(particle),
                end => self.join(particle.volume, end)?,
            }
        }
        self.particles = Arc::new(flying);
        Ok(())
    }

    /// Adds a particle, which flies up to the end of a tick, if it does not come down before.
    pub(crate) fn throw(&mut self, particle: Particle, end: f64, barriers: &Barriers) -> Result<(), Error> {
        // Only its own surroundings matter: it is one of many.
        let tops = Tops { surface: f64::INFINITY, floors: f64::INFINITY };
        match self.fly(&particle, [particle.born, end], &tops, barriers) {
            End::Flies(particle) => {
                if self.particles.len() >= MOST {
                    let at = [particle.place.x, particle.place.z];
                    return Err(Error::Particles { most: MOST, at });
                }
                Arc::make_mut(&mut self.particles).push(particle);
                Ok(())
            }
            end => self.join(particle.volume, end),
        }
    }

    /// What becomes of a particle in a span of time.
    fn fly(&self, particle: &Particle, [from, to]: [f64; 2], tops: &Tops, barriers: &Barriers) -> End {
        let (mut particle, mut from, cell) = (*particle, from.max(particle.born), self.cell());
        if from > to {
            return End::Flies(particle);
        }
        let mut last = None;
        for _ in 0..CONTACTS {
            let landing = self.landing(&particle, [from, to], tops);
            let until = landing.as_ref().map_or(to, |landing| landing.time);
            let Some(contact) = barriers.first(&particle, [from, until], cell) else {
                return landing.map_or(End::Flies(particle), End::Lands);
            };
            if contact.is_flat() {
                return End::Rests(contact.body, contact.place);
            }
            last = Some(contact);
            (particle, from) = (contact.after(&particle, cell), contact.time);
        }
        last.map_or(End::Flies(particle), |contact| End::Rests(contact.body, contact.place))
    }

    /// Adds a volume to what a particle comes down on.
    fn join(&mut self, volume: i64, end: End) -> Result<(), Error> {
        self.stirred |= !self.floors.is_empty();
        match end {
            End::Flies(_) => Ok(()),
            End::Lands(landing) => self.drop(landing.column, landing.height, volume),
            End::Rests(body, place) => {
                let (column, base) = (self.nearest(place), (place.y / self.cell() * QUANTA) as i64);
                self.put(body, Parcel { column, base, load: volume, offset: [0; 2] })
            }
        }
    }

    fn tops(&self) -> Tops {
        let extent = self.extent();
        let edges = |[from, to]: [i32; 2]| [from, to].map(|at| f64::from(at) * self.cell());
        let floors = self.floors.values().flatten().map(Floor::top).max();
        let metres = |height: i64| height as f64 / QUANTA * self.cell();
        Tops {
            surface: self.bounds(edges(extent.x), edges(extent.z))[1],
            floors: floors.map_or(f64::NEG_INFINITY, metres),
        }
    }

    /// Where a particle comes down within a span of time: on the ground, or on what is over it, whichever is first.
    fn landing(&self, particle: &Particle, [from, to]: [f64; 2], tops: &Tops) -> Option<Landing> {
        let span = [from.max(particle.born), to];
        if span[0] > span[1] {
            return None;
        }
        // A path is concave, so it is lowest at an end.
        let lowest = particle.at(span[0]).y.min(particle.at(span[1]).y);
        let ground = if lowest <= tops.surface { self.meets_ground(particle, span) } else { None };
        let meets_floors = lowest <= tops.floors && !self.floors.is_empty();
        let floor = if meets_floors { self.meets_floor(particle, span) } else { None };
        match (ground, floor) {
            (Some(ground), Some(floor)) if ground.time < floor.time => Some(ground),
            (ground, floor) => floor.or(ground),
        }
    }

    fn meets_ground(&self, particle: &Particle, span: [f64; 2]) -> Option<Landing> {
        let over = |time: f64| {
            let at = particle.at(time);
            at.y - self.height(at.x, at.z)
        };
        let times = particle.crossings(span, self.cell(), 0.0);
        let mut first = over(times[0]);
        for pair in times.windows(2) {
            let [from, to] = [pair[0], pair[1]];
            let last = over(to);
            if let Some(part) = descent([first, over(0.5 * (from + to)), last]) {
                let time = from + part * (to - from);
                let height = (particle.at(time).y / self.cell() * QUANTA) as i64;
                return Some(Landing { time, column: self.nearest(particle.at(time)), height });
            }
            first = last;
        }
        None
    }

    fn meets_floor(&self, particle: &Particle, span: [f64; 2]) -> Option<Landing> {
        // What lies on a floor is level over its column.
        let times = particle.crossings(span, self.cell(), 0.5);
        for pair in times.windows(2) {
            let [from, to] = [pair[0], pair[1]];
            let column = self.nearest(particle.at(0.5 * (from + to)));
            let landings = self.floors.get(&column).into_iter().flatten().filter_map(|floor| {
                let time = particle.descends_to(floor.top() as f64 / QUANTA * self.cell())?;
                (from..=to).contains(&time).then_some(Landing { time, column, height: floor.top() })
            });
            let first = landings.min_by(|a, b| a.time.total_cmp(&b.time));
            if first.is_some() {
                return first;
            }
        }
        None
    }

    /// The column nearest to a place.
    pub(crate) fn nearest(&self, place: Vector) -> (i32, i32) {
        let extent = self.extent();
        let near = |at: f64, [from, to]: [i32; 2]| {
            (at / self.cell()).round().clamp(f64::from(from), f64::from(to)) as i32
        };
        (near(place.x, extent.x), near(place.z, extent.z))
    }
}

/// The first place from 0 to 1 from which on a polynomial of degree two, given at 0, 1/2 and 1, is negative.
fn descent([first, middle, last]: [f64; 3]) -> Option<f64> {
    if first < 0.0 {
        return Some(0.0);
    }
    let (a, b) = (2.0 * (first + last) - 4.0 * middle, 4.0 * middle - 3.0 * first - last);
    let root = (b * b - 4.0 * a * first).sqrt();
    // The same root twice, each without a difference of numbers that may be nearly equal.
    let at = if b < 0.0 { 2.0 * first / (root - b) } else { (-b - root) / (2.0 * a) };
    (0.0..=1.0).contains(&at).then_some(at)
}

#[cfg(test)]
mod tests {
    use super::{Particle, descent};
    use crate::barrier::Barriers;
    use crate::{Description, Error, Extent, Ground, Relief, Settings, Soil, Vector};

    #[test]
    fn a_polynomial_descends_where_it_does() {
        let at = |a: f64, b: f64, c: f64| {
            descent([c, 0.25 * a + 0.5 * b + c, a + b + c]).map(|at| (at * 1e9).round() / 1e9)
        };
        assert_eq!(at(0.0, -2.0, 1.0), Some(0.5));
        assert_eq!(at(-4.0, 0.0, 1.0), Some(0.5));
        assert_eq!(at(-2.0, 1.0, 0.0), Some(0.5));
        // From above, upward-curved: down at 1/4, up again at 3/4.
        assert_eq!(at(16.0, -16.0, 3.0), Some(0.25));
        assert_eq!(at(1.0, 1.0, 0.0), None);
        assert_eq!(at(0.0, 0.0, 0.0), None);
        assert_eq!(at(0.0, -1.0, -0.1), Some(0.0));
        assert_eq!(at(-1.0, 0.5, 2.0), None);
    }

    /// Thrown on a slope: the parabola meets the plane where it does, whatever ticks and columns are between.
    #[test]
    fn particles_come_down_where_their_parabola_meets_the_ground() -> Result<(), Error> {
        let slope = 0.3;
        let description = Description {
            cell: 0.01,
            extent: Extent::around(100),
            soil: Soil::snow(),
            bed: Relief::function(move |x, _| slope * x - 1.0),
            depth: Relief::Level(1.0),
        };
        let mut ground = Ground::new(description, Settings::default())?;
        let (place, velocity) = (Vector::new(0.1, 0.5, 0.2), Vector::new(1.1, 2.0, -0.7));
        let thrown = Particle { id: 1, born: 0.003, place, velocity, volume: 12_345 };
        ground.throw(thrown, 1.0 / 120.0, &Barriers::default())?;
        ground.book.poured += 12_345;
        // y + vt - gt²/2 = slope (x + ut).
        let (fall, over) = (velocity.y - slope * velocity.x, place.y - slope * place.x);
        let after = (fall + (fall * fall + 2.0 * 9.81 * over).sqrt()) / 9.81;
        let time = 0.003 + after;
        while ground.time() + 1.0 / 120.0 < time {
            assert_eq!((ground.particles(), ground.imbalance()), (1, 0));
            ground.advance(&[], &[])?;
        }
        let there = place + velocity * after - Vector::y() * (0.5 * 9.81 * after * after);
        for late in [0.0, 0.001] {
            let shown = ground.flights(time + late).first().map(|flight| flight.place);
            assert!(shown.is_some_and(|at| (at - there).norm() < 1e-9), "{shown:?} {there}");
        }
        ground.advance(&[], &[])?;
        assert_eq!((ground.particles(), ground.imbalance()), (0, 0));
        let column = ground.nearest(there);
        let (key, index) = ground.setup.place(column.0, column.1);
        let before = ground.setup.untouched(column.0, column.1)?;
        assert_eq!(ground.tiles[&key].loose[index] - before[2], 12_345);
        Ok(())
    }
}
