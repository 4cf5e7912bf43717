//! A run of growth with its passive parts, from tick to tick.
//!
//! Growth is one tick ahead of the stems. On the way it stops at productions that may let go of something: the strings there, and a little
//! later, give the part its pose and its velocity.

use std::sync::Arc;

use dlsys_geometry::scene::Scene;
use dlsys_geometry::turtle::{self, FreePart};
use dlsys_model::{DETACH, KindId, Model};
use dlsys_sim::{Passed, Simulation};
use dlsys_tree::ModuleString;

use crate::bending::{Bending, BentStems, Tick, bent};
use crate::descent::Descent;
use crate::flights::Flights;
use crate::{CLOCK, Error};

/// Part of a tick over which the rates of growth are taken.
pub(crate) const LOOK_BACK: f64 = 1.0 / 1024.0;

/// A run of growth with the motion of its stems, at a tick and up to the next.
#[derive(Clone)]
pub(crate) struct Course<'m> {
    model: &'m Model,
    growth: Simulation<'m>,
    pub(crate) bending: Bending<'m, &'m Model>,
    /// The number of the present tick.
    pub(crate) number: u64,
    pub(crate) tick: Arc<Tick>,
    /// Productions from the present tick to the next.
    pub(crate) descent: Arc<Descent>,
    /// The strings a little before the next tick, and at the next tick, if growth gets there.
    ahead: Result<Arc<[ModuleString; 2]>, Error>,
    /// There was a production between these two strings.
    jumps: bool,
    /// Why something could not be let go before the next tick, and when, in units of the model.
    pub(crate) held: Option<(f64, Error)>,
    /// To draw into.
    scene: Scene,
}

impl<'m> Course<'m> {
    /// From the first tick.
    pub(crate) fn new(
        model: &'m Model,
        (growth, bending): (Simulation<'m>, Bending<'m, &'m Model>),
        flights: &mut Option<Flights<'m>>,
    ) -> Result<Course<'m>, Error> {
        let number = bending.place().first_tick();
        let mut course = Course {
            model,
            growth,
            bending,
            number,
            tick: Arc::new(Tick::still()),
            descent: Arc::default(),
            ahead: Ok(Arc::default()),
            jumps: false,
            held: None,
            scene: turtle::blank(model),
        };
        let mut string = ModuleString::default();
        let first = course.bending.place().time_of(number).max(0.0);
        let mut descent = Descent::default();
        if flights.is_some() {
            course.growth.at(0.0, &mut string)?;
            course.growth.take_events();
            course.let_go((&string, first), &mut descent, flights)?;
        }
        course.pass(first, &mut descent, flights)?;
        course.growth.at(first, &mut string)?;
        course.growth.take_events();
        course.tick = Arc::new(course.bending.advance(number, &string, None)?);
        course.look_ahead(flights);
        Ok(course)
    }

    /// Lets growth go on to the next tick. It may fail there, after a time that is asked for.
    fn look_ahead(&mut self, flights: &mut Option<Flights<'m>>) {
        let place = *self.bending.place();
        let next = place.time_of(self.number + 1);
        let before = next - LOOK_BACK * CLOCK / place.units.time;
        let mut strings = <[ModuleString; 2]>::default();
        let [earlier, now] = &mut strings;
        let mut descent = Descent::default();
        let mut go = || {
            self.show(before, earlier, &mut descent, flights)?;
            self.jumps = self.show(next, now, &mut descent, flights)?;
            Ok(())
        };
        let gone: Result<(), Error> = go();
        self.descent = Arc::new(descent);
        self.ahead = gone.map(|()| Arc::new(strings));
    }

    /// Lets growth go on to a time, and writes its string if stems depend on it. True if there were productions on the way.
    fn show(
        &mut self,
        time: f64,
        string: &mut ModuleString,
        descent: &mut Descent,
        flights: &mut Option<Flights<'m>>,
    ) -> Result<bool, Error> {
        let released = self.pass(time, descent, flights)?;
        if self.model.scenery.tissues.is_empty() {
            self.growth.pass(time)?;
        } else {
            self.growth.at(time, string)?;
        }
        let last = self.growth.take_events();
        descent.add(self.model, &last);
        Ok(released || !last.is_empty())
    }

    /// Lets growth go on to a time, and lets go on the way. True if there were productions. Without anything that may be let go, growth
    /// stays where it is.
    fn pass(
        &mut self,
        until: f64,
        descent: &mut Descent,
        flights: &mut Option<Flights<'m>>,
    ) -> Result<bool, Error> {
        let model = self.model;
        let mut string = ModuleString::default();
        let mut any = false;
        while flights.is_some() {
            if self.growth.pass_some(until, usize::MAX, true)? == Passed::All {
                break;
            }
            let events = self.growth.take_events();
            any |= !events.is_empty();
            descent.add(model, &events);
            let is_due = |flights: &Flights| events.iter().any(|event| flights.is_release(model, event));
            if flights.as_ref().is_some_and(is_due) {
                let now = self.growth.reached();
                self.growth.at(now, &mut string)?;
                let done = self.let_go((&string, until), descent, flights);
                self.held = done.err().map(|error| (now, error));
                if let Some((_, error)) = &self.held {
                    return Err(error.clone());
                }
            }
        }
        Ok(any)
    }

    /// Lets go of what a string has that is not known. Growth must be at its time, and is to go on to another.
    fn let_go(
        &mut self,
        (string, until): (&ModuleString, f64),
        descent: &mut Descent,
        flights: &mut Option<Flights<'m>>,
    ) -> Result<(), Error> {
        let model = self.model;
        let place = *self.bending.place();
        let Some(flights) = flights else { return Ok(()) };
        let mut string = string.clone();
        loop {
            let new = flights.news(model, &string, descent);
            if new.is_empty() {
                break;
            }
            let (strains, news) = self.held_back(&flights.way_to(&string, &new), descent, flights)?;
            if news.is_empty() {
                break;
            }
            let mut later = ModuleString::default();
            let step = LOOK_BACK * CLOCK / place.units.time;
            // Shortly before a tick, growth must not go beyond it.
            let goes_on = string.time + step <= until;
            let mut ahead = (!goes_on).then(|| self.growth.clone());
            let growth = ahead.as_mut().unwrap_or(&mut self.growth);
            growth.at(string.time + step, &mut later)?;
            let events = growth.take_events();
            let mut after = descent.clone();
            after.add(model, &events);
            let (_, there) = self.held_back(&flights.way_to(&later, &new), &after, flights)?;
            let times = [string.time, later.time].map(|time| place.seconds(time));
            flights.let_go(model, (news, &strains), &there, times)?;
            if !goes_on {
                break;
            }
            // What was made on the way may let go, too.
            *descent = after;
            string = later;
        }
        Ok(())
    }

    /// What a string is about to let go, as if the branch still held it, and the strains with which it is drawn.
    fn held_back(
        &mut self,
        string: &ModuleString,
        descent: &Descent,
        flights: &mut Flights<'m>,
    ) -> Result<(BentStems, Vec<FreePart>), Error> {
        let model = self.model;
        let none = Descent::default();
        let known = if holds_new(model, string, descent) { descent } else { &none };
        let mut strains = bent(&self.tick, known, &self.bending, string, &mut self.scene)?;
        strains.flown = flights.flown(model, string)?;
        let parts = flights.new_parts(model, string, &strains)?;
        let stems = parts.iter().flat_map(|part| &part.stems);
        // Stems that have taken the place of others have their strain, which a string that no longer carries them does not tell.
        if !strains.take_over(stems, descent) {
            return Ok((strains, parts));
        }
        let parts = flights.new_parts(model, string, &strains)?;
        Ok((strains, parts))
    }

    /// Goes on to the next tick; returns the one that is past.
    pub(crate) fn tick(&mut self, flights: &mut Option<Flights<'m>>) -> Result<Past, Error> {
        let ahead = self.ahead.clone()?;
        let [before, now] = &*ahead;
        let before = (!self.jumps).then_some(before);
        let tick = self.bending.advance(self.number + 1, now, Some((&self.tick, &self.descent, before)))?;
        let tick = std::mem::replace(&mut self.tick, Arc::new(tick));
        let past = Past { number: self.number, tick, descent: self.descent.clone() };
        self.number += 1;
        self.look_ahead(flights);
        Ok(past)
    }
}

/// A tick of the past.
#[derive(Clone)]
pub(crate) struct Past {
    pub(crate) number: u64,
    pub(crate) tick: Arc<Tick>,
    pub(crate) descent: Arc<Descent>,
}

impl Past {
    /// Number of strains that it keeps, and one for itself.
    pub(crate) fn size(&self) -> usize {
        self.tick.size() + 1
    }
}

/// True if a production since the tick has made a module that is not behind an `@D`: its stems have the strains of others, which a drawing tells.
fn holds_new(model: &Model, string: &ModuleString, descent: &Descent) -> bool {
    let mut freed = vec![false];
    for module in string.iter() {
        let is_free = freed.last().copied().unwrap_or_default();
        match module.kind {
            KindId::OPEN => freed.push(is_free),
            KindId::CLOSE => drop(freed.pop()),
            kind if model.kinds.get(kind).base() == DETACH => {
                freed.pop();
                freed.push(true);
            }
            _ if is_free => {}
            _ if descent.line(module.lineage.id).nth(1).is_some() => return true,
            _ => {}
        }
    }
    false
}
