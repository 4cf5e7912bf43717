//! The soil below what falls, at any time: columns from tick to tick, together with the solids in its way.
//!
//! ```text
//! growth ──bodies, pours──▶ Terrain ──columns at a tick──▶ spans ──▶ flights (fall)
//!                           Obstacles ──solids of a tick──▲
//! ```
//!
//! It is followed from when a flight first comes near, apart from the soil that is drawn, and with the same bits where no stem that bends presses it.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use dlsys_diagnostic::Span as Text;
use dlsys_fall::{self as fall, Columns, Obstacles as Way, Span};
use dlsys_ground::Ground;
use dlsys_model::Model;
use dlsys_sim::Settings;

use crate::Error;
use crate::columns::grip;
use crate::obstacles::Obstacles;
use crate::terrain::{TICKS, Terrain};

/// Number of spans that are kept: flights go on in turn, each through some of them.
const KEPT: usize = 64;

/// The soil of a scene as flights meet it.
pub(crate) struct Footing<'m> {
    model: &'m Model,
    settings: Settings,
    terrain: OnceLock<Result<Option<Terrain<'m>>, Error>>,
    /// The last spans, by the numbers of the tick and of the span of solids.
    kept: Mutex<VecDeque<(Key, Arc<Span>)>>,
    /// The last columns.
    last: Mutex<Option<Arc<Heights>>>,
    /// Why the soil of a tick is not known.
    failure: Mutex<Option<Error>>,
}

/// The number of a tick, and the bits of the beginning of the span of solids in it.
type Key = (i64, u64);

/// Columns at a tick.
#[derive(Debug)]
struct Heights(Ground);

impl Heights {
    /// They are those of another ground, too.
    fn are(&self, ground: &Ground) -> bool {
        let changed = |one: &Ground, other: &Ground| !one.changed_since(other).is_empty();
        let fallen = self.0.column(0, 0) != ground.column(0, 0);
        !fallen && !changed(&self.0, ground) && !changed(ground, &self.0)
    }
}

impl Columns for Heights {
    fn cell(&self) -> f64 {
        self.0.cell()
    }

    fn height(&self, i: i32, k: i32) -> f64 {
        let extent = self.0.extent();
        let within = |at: i32, [from, to]: [i32; 2]| at.clamp(from, to);
        self.0.column(within(i, extent.x), within(k, extent.z))
    }

    fn bounds(&self, x: [i32; 2], z: [i32; 2]) -> [f64; 2] {
        let metres = |at: [i32; 2]| at.map(|at| f64::from(at) * self.0.cell());
        self.0.bounds(metres(x), metres(z))
    }
}

impl<'m> Footing<'m> {
    /// `None` for a model without ground of soil.
    pub(crate) fn new(model: &'m Model, settings: Settings) -> Option<Footing<'m>> {
        let (terrain, kept) = (OnceLock::new(), Mutex::default());
        let (last, failure) = (Mutex::default(), Mutex::default());
        model.scenery.bed.as_ref().map(|_| Footing { model, settings, terrain, kept, last, failure })
    }

    /// The declaration of the ground.
    pub(crate) fn declared(model: &Model) -> Option<Text> {
        model.scenery.bed.as_ref().map(|bed| bed.span)
    }

    /// The reason why the soil of a tick is not known, if there was one.
    pub(crate) fn failure(&self) -> Option<Error> {
        self.failure.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// The soil and the solids at a time in s.
    fn span(&self, time: f64, obstacles: Option<&Obstacles<'m>>) -> Result<Option<Arc<Span>>, fall::Error> {
        let solids = match obstacles {
            Some(obstacles) => Some(obstacles.at_time(time)?),
            None => None,
        };
        let number = tick_of(time);
        let key = (number, solids.as_ref().map_or(0, |solids| solids.begin().to_bits()));
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, span)) = kept.iter().find(|(known, _)| *known == key) {
            return Ok(Some(Arc::clone(span)));
        }
        let terrain = self.terrain.get_or_init(|| Terrain::new(self.model, self.settings, 1));
        let found = match terrain {
            Ok(Some(terrain)) => terrain.columns(number.max(0) as u64),
            Ok(None) => return Ok(solids),
            Err(error) => Err(error.clone()),
        };
        let (ground, rests) = found.map_err(|error| {
            *self.failure.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
            fall::Error::Solids { time }
        })?;
        let surface = grip(ground.soil());
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        // What has not changed is the same columns.
        let columns = match last.as_ref().filter(|last| last.are(&ground)) {
            Some(known) => Arc::clone(known),
            None => Arc::clone(last.insert(Arc::new(Heights(ground)))),
        };
        let soil = fall::Soil { columns, surface };
        let (mut begin, mut end) = (number as f64 / TICKS, (number + 1) as f64 / TICKS);
        let mut there = Vec::new();
        if let Some(solids) = &solids {
            (begin, end) = (begin.max(solids.begin()), end.min(solids.end()));
            there = solids.solids().to_vec();
            // They appear at the beginning of their own span.
            there.iter_mut().for_each(|solid| solid.is_new &= begin == solids.begin());
        }
        let span = Span::new(begin, end, there)?.above(soil)?;
        let span = Arc::new(if rests && solids.is_none() { span.last() } else { span });
        if kept.len() >= KEPT {
            kept.pop_front();
        }
        kept.push_back((key, Arc::clone(&span)));
        Ok(Some(span))
    }
}

/// The number of the tick in which a time in s lies, as its beginning or after it. Before the first one the soil is that at the beginning.
fn tick_of(time: f64) -> i64 {
    let number = (time * TICKS).floor();
    // Saturates.
    let number = number as i64;
    match () {
        () if (number + 1) as f64 / TICKS <= time => number + 1,
        () if number as f64 / TICKS > time => number - 1,
        () => number,
    }
}

/// What is in the way of a flight: solids, and soil.
pub(crate) struct Among<'a, 'm> {
    pub(crate) obstacles: Option<&'a Obstacles<'m>>,
    pub(crate) footing: Option<&'a Footing<'m>>,
}

impl Among<'_, '_> {
    /// The reason why something was not known at a time, if there was one.
    pub(crate) fn failure(&self) -> Option<Error> {
        let of_solids = self.obstacles.and_then(Obstacles::failure);
        of_solids.or_else(|| self.footing.and_then(Footing::failure))
    }
}

impl Way for Among<'_, '_> {
    fn span(&self, time: f64) -> Result<Option<Arc<Span>>, fall::Error> {
        match (self.footing, self.obstacles) {
            (Some(footing), obstacles) => footing.span(time, obstacles),
            (None, Some(obstacles)) => obstacles.at_time(time).map(Some),
            (None, None) => Ok(None),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_lies_in_its_tick() {
        for number in -1000..100_000_i64 {
            let begin = number as f64 / TICKS;
            assert_eq!(tick_of(begin), number);
            assert_eq!(tick_of(begin.next_down()), number - 1);
        }
    }
}
