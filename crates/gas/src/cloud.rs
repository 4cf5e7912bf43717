//! The blobs of one gas, from tick to tick.

use std::collections::{BTreeMap, BTreeSet};

use dlsys_wind::Wind;

use crate::blobs::{Birth, Blob, Blobs};
use crate::carry::{Moving, Tick};
use crate::chance::Chance;
use crate::error::check;
use crate::walls::{Open, Walls};
use crate::{Error, Gas, Settings, Source, Vector};

/// The blobs of a gas at an instant.
///
/// A cloud goes on from tick to tick: multiples of [`Settings::tick`] on one grid of time. What it is at a tick depends on the sources and the wind
/// of the ticks before, not on the number of threads nor on the instants at which it was [shown](Cloud::shown).
#[derive(Clone, Debug)]
pub struct Cloud {
    gas: Gas,
    settings: Settings,
    /// Number of the tick.
    number: u64,
    blobs: Blobs,
    /// Of each source: how many blobs it has made, and the part of the next one that is due.
    made: BTreeMap<u64, (u64, f64)>,
    /// The time, in s: that of the tick, or later if it is shown.
    time: f64,
}

impl Cloud {
    /// No blobs, at time 0.
    ///
    /// # Errors
    ///
    /// A value out of range.
    pub fn new(gas: Gas, settings: Settings) -> Result<Cloud, Error> {
        gas.check()?;
        let settings = settings.checked(&gas)?;
        Ok(Cloud { gas, settings, number: 0, blobs: Blobs::default(), made: BTreeMap::new(), time: 0.0 })
    }

    /// The gas.
    pub fn gas(&self) -> &Gas {
        &self.gas
    }

    /// The time in s.
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Seconds from one tick to the next.
    pub fn tick(&self) -> f64 {
        self.settings.tick
    }

    /// Number of blobs.
    pub fn len(&self) -> usize {
        self.blobs.len()
    }

    /// True if there are no blobs.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The blobs at the present time.
    pub fn blobs(&self) -> impl Iterator<Item = Blob> {
        (0..self.len()).map(|blob| self.blobs.get(blob, &self.gas, self.time))
    }

    /// For each of the [`blobs`](Cloud::blobs) a number that it has as long as it lasts, and no other. The parts of one that splits have others.
    pub fn keys(&self) -> impl Iterator<Item = u64> {
        self.blobs.keys()
    }

    /// Mass of all blobs, in kg.
    pub fn mass(&self) -> f64 {
        self.blobs().map(|blob| blob.mass).sum()
    }

    /// Adds a blob at the present time, of the size and a share of the mass of new ones. Blobs that are added one after another differ in their
    /// random numbers.
    ///
    /// # Errors
    ///
    /// A value that is not finite, a share that is not above 0, too many blobs.
    pub fn add(&mut self, centre: Vector, share: f64) -> Result<(), Error> {
        for value in centre.iter() {
            check("a coordinate of a blob (m)", *value, true, "a finite number")?;
        }
        check("a share of the mass of a new blob", share, share > 0.0, "more than 0")?;
        self.room(1)?;
        let (time, variance) = (self.time, self.gas.size * self.gas.size);
        let chance = Chance::new(self.number).of(self.len() as u64);
        self.blobs.push(Birth { centre, born: time, since: time, variance, share, chance });
        Ok(())
    }

    /// Fails if there is no room for some more blobs.
    fn room(&self, more: usize) -> Result<(), Error> {
        let most = self.settings.most;
        if self.len().saturating_add(more) > most {
            Err(Error::Blobs { most, time: self.time })
        } else {
            Ok(())
        }
    }

    /// Goes on to the next tick, in open air. Sources must not have an identity in common.
    ///
    /// # Errors
    ///
    /// A source without meaning, too many blobs, a wind without a value.
    pub fn advance(&mut self, sources: &[Source], wind: &(impl Wind + Sync)) -> Result<(), Error> {
        self.advance_among(sources, wind, &Open)
    }

    /// Goes on to the next tick, with what no blob passes into.
    ///
    /// # Errors
    ///
    /// As of [`advance`](Cloud::advance).
    pub fn advance_among(
        &mut self,
        sources: &[Source],
        wind: &(impl Wind + Sync),
        walls: &impl Walls,
    ) -> Result<(), Error> {
        let end = (self.number + 1) as f64 * self.settings.tick;
        self.go_on(end, sources, (wind, walls))?;
        self.number += 1;
        self.blobs.end(&self.gas, end);
        // Sources that are gone are forgotten.
        if self.made.len() > sources.len() {
            let known: BTreeSet<u64> = sources.iter().map(|source| source.id).collect();
            self.made.retain(|id, _| known.contains(id));
        }
        if self.settings.split < f64::INFINITY {
            self.blobs.split(&self.gas, end, &self.settings)?;
        }
        Ok(())
    }

    /// The cloud at a time in s between this tick and the next, for a picture. Centres are cubics with the places and velocities at both ticks.
    ///
    /// # Errors
    ///
    /// As of [`advance`](Cloud::advance); a time that is not between these ticks.
    pub fn shown(&self, time: f64, sources: &[Source], wind: &(impl Wind + Sync)) -> Result<Cloud, Error> {
        self.shown_among(time, sources, wind, &Open)
    }

    /// The same with what no blob passes into.
    ///
    /// # Errors
    ///
    /// As of [`shown`](Cloud::shown).
    pub fn shown_among(
        &self,
        time: f64,
        sources: &[Source],
        wind: &(impl Wind + Sync),
        walls: &impl Walls,
    ) -> Result<Cloud, Error> {
        let (begin, end) = (self.time, (self.number + 1) as f64 * self.settings.tick);
        check("a time (s)", time, time >= begin && time <= end, "a time from the present tick to the next")?;
        let mut shown = self.clone();
        if time == begin {
            return Ok(shown);
        }
        for source in sources {
            shown.bear(source, end)?;
        }
        let first = shown.blobs.moving.clone();
        shown.carry(end, (wind, walls))?;
        for (blob, from) in first.iter().enumerate() {
            let since = shown.blobs.born[blob].max(begin);
            let to = &mut shown.blobs.moving[blob];
            to.centre = walls.outside(cubic((from, since), (to, end), time), time);
        }
        shown.blobs.keep(|born| born <= time);
        shown.time = time;
        Ok(shown)
    }

    /// Births and motion up to the next tick.
    fn go_on(
        &mut self,
        end: f64,
        sources: &[Source],
        around: (&(impl Wind + Sync), &impl Walls),
    ) -> Result<(), Error> {
        for source in sources {
            self.bear(source, end)?;
        }
        self.carry(end, around)?;
        self.time = end;
        Ok(())
    }

    fn carry(&mut self, end: f64, (wind, walls): (&(impl Wind + Sync), &impl Walls)) -> Result<(), Error> {
        let tick = Tick { gas: &self.gas, settings: &self.settings, begin: self.time, end };
        tick.carry(&mut self.blobs, wind, walls)
    }

    /// The blobs that a source makes from the present tick to a time.
    fn bear(&mut self, source: &Source, end: f64) -> Result<(), Error> {
        source.check()?;
        let [begin, until] = source.during.unwrap_or([self.time, end]);
        check(
            "a time of a source (s)",
            begin,
            begin >= self.time && begin <= until,
            "a time within the tick",
        )?;
        check("a time of a source (s)", until, until <= end, "a time within the tick")?;
        let before = self.made.get(&source.id).copied();
        let before = before.or_else(|| self.made.remove(&source.predecessor?));
        let (number, due) = before.unwrap_or((0, source.phase));
        let lasts = until - begin;
        let [first, last] = source.rate;
        let all = due + 0.5 * (first + last) * lasts;
        if all >= self.settings.most as f64 + 1.0 {
            return Err(Error::Blobs { most: self.settings.most, time: self.time });
        }
        let count = libm::floor(all);
        self.room(count as usize)?;
        let chance = Chance::new(0x6761_7365 ^ self.settings.seed).of(source.id);
        for k in 0..count as u64 {
            let since = source.time_of((k + 1) as f64 - due, lasts);
            let (born, part) = (begin + since, if lasts > 0.0 { since / lasts } else { 0.0 });
            let chance = chance.of(number + k);
            let radius = source.radius[0] + (source.radius[1] - source.radius[0]) * part;
            let centre = source.from.lerp(&source.to, part) + chance.in_ball() * radius;
            let variance = self.gas.size * self.gas.size;
            self.blobs.push(Birth { centre, born, since: born, variance, share: 1.0, chance });
        }
        self.made.insert(source.id, (number + count as u64, all - count));
        Ok(())
    }
}

/// The centre of a blob at a time between two states. A blob that is new at the first one has no velocity there.
fn cubic((from, begin): (&Moving, f64), (to, end): (&Moving, f64), time: f64) -> Vector {
    let span = end - begin;
    if span <= 0.0 || time <= begin {
        return from.centre;
    }
    let x = (time - begin) / span;
    let rise = to.centre - from.centre;
    let last = to.velocity * span;
    let first = if from.velocity.x.is_finite() { from.velocity * span } else { rise * 2.0 - last };
    let (square, cube) = (rise * 3.0 - first * 2.0 - last, first + last - rise * 2.0);
    from.centre + (first + (square + cube * x) * x) * x
}
