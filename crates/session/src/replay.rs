//! Random access to simulated time, forwards and backwards, with the same bits as a run from the start.
//!
//! ```text
//! marks (copies of the simulation)     ●──────●───────●───●──●─●●        ●            ●
//! the simulation at present                                     ▲ seek(t): copy the last mark before t and run to t
//! ```
//!
//! Between two events nothing is run: formulas and dense output are evaluated. A step back to the previous event only reads
//! the list of past events; the string of that time is formed on demand. For that, the last mark
//! before the time is copied and run to it. On the way new marks are set, each at half the remaining distance,
//! because steps back usually come in series: 1,000 steps back cost a few runs, not 1,000 (compare
//! checkpointing in reverse mode differentiation: Griewank and Walther 2000, *Revolve*). Marks are dense near the present and sparse
//! away from it, and their memory is bounded.
//!
//! # Examples
//!
//! ```
//! use dlsys_session::Session;
//! use dlsys_session::replay::{Replay, Stop};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let text = "initial string: A(0)\nA(x): if x < 1 solve dx/dt = 1\n if x = 1 produce F(1) A(0)";
//! let session = Session::from_text("stem.dls", text, &[])?;
//! let mut replay = Replay::new(&session.model, Default::default())?;
//! assert_eq!(replay.seek(10.5)?, Stop::There);
//! assert_eq!(replay.string()?.len(), 11);
//! replay.seek(2.5)?;
//! assert_eq!(replay.string()?.len(), 3);
//! assert_eq!(replay.seek_event(9.0)?, Stop::There);
//! assert_eq!((replay.time(), replay.modules()), (3.0, 4));
//! assert_eq!(replay.string()?.len(), 4);
//! # Ok(())
//! # }
//! ```

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use dlsys_model::Model;
use dlsys_sim::{Error, Event, Passed, Settings, Simulation, Surroundings, happens_by};
use dlsys_surround::Place;
use dlsys_tree::{Lineage, ModuleString, SimTime};

/// A model at a present time, which can be moved to any other time.
pub struct Replay<'m> {
    live: Simulation<'m>,
    time: f64,
    /// Whether `live` is at `time`; if not, it is moved there before it is read.
    placed: bool,
    /// Number of productions up to `time`.
    happened: usize,
    /// Number of modules at `time`.
    modules: usize,
    string: ModuleString,
    /// Whether `string` is that of `time`.
    shown: bool,
    /// In the order of their work. The first is the start and is never removed.
    marks: Vec<Mark<'m>>,
    memory: usize,
    /// The largest work of the simulation at any time visited so far.
    known: u64,
    /// The latest time visited; all events up to it are known.
    seen: f64,
    interrupt: Option<Arc<AtomicBool>>,
    /// Total work of all seeks.
    spent: u64,
    /// The productions up to `seen`, without the first `forgotten` ones.
    events: VecDeque<Past>,
    forgotten: usize,
}

/// A production, and the state just after its instant.
struct Past {
    event: Event,
    at: SimTime,
    /// Number of modules after all productions of that instant.
    modules: usize,
}

/// A copy of the simulation as it was at some time.
struct Mark<'m> {
    simulation: Simulation<'m>,
    work: u64,
    size: usize,
}

/// How a seek ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// The present is the requested time or event.
    There,
    /// There is no event up to the limit, which is now the present.
    Nothing,
    /// The flag of [`Replay::stop_when`] was set; the present is a time in between.
    Interrupted,
}

/// Number of events and steps between two checks of the flag, on parts that have been visited before.
const STRIDE: usize = 16;
/// Largest number of marks.
const MOST_MARKS: usize = 256;
/// Largest number of productions in the list.
const MOST_EVENTS: usize = 500_000;
/// Bytes copied, with allocations, in a unit of work (a tenth of a microsecond).
const BYTES_A_UNIT: usize = 400;
/// Work between marks in units of the cost of a mark, on times not visited before. On times visited before, a mark
/// may cost as much as it saves.
const DEAR: u64 = 16;
/// On times not visited before, a mark is set after each such part of the total work.
const PART: u64 = 64;

impl<'m> Replay<'m> {
    /// Default memory for marks in bytes.
    pub const MEMORY: usize = 256 << 20;

    /// Starts a model at t = 0, with its stems in the wind if its rules read them. At most 500,000 productions are kept for [`Replay::events`].
    ///
    /// # Errors
    /// Those of [`Simulation::new`].
    pub fn new(model: &'m Model, settings: Settings) -> Result<Replay<'m>, Error> {
        let place = Place::of_scene(&model.scenery);
        Replay::begin(dlsys_surround::start(model, Settings { log: true, ..settings }, place)?)
    }

    /// Starts a model at t = 0 in surroundings, as [`Simulation::with_surroundings`] does.
    ///
    /// # Errors
    /// Those of [`Simulation::with_surroundings`].
    pub fn with_surroundings(
        model: &'m Model,
        settings: Settings,
        surroundings: Box<dyn Surroundings + 'm>,
    ) -> Result<Replay<'m>, Error> {
        let settings = Settings { log: true, ..settings };
        Replay::begin(Simulation::with_surroundings(model, settings, surroundings)?)
    }

    fn begin(live: Simulation<'m>) -> Result<Replay<'m>, Error> {
        let mut replay = Replay {
            live,
            time: 0.0,
            placed: true,
            happened: 0,
            modules: 0,
            string: ModuleString::default(),
            shown: false,
            marks: Vec::new(),
            memory: Replay::MEMORY,
            known: 0,
            seen: 0.0,
            interrupt: None,
            spent: 0,
            events: VecDeque::new(),
            forgotten: 0,
        };
        replay.take_events();
        replay.arrive();
        replay.mark();
        replay.show()?;
        Ok(replay)
    }

    /// Sets the approximate memory for marks in bytes. The mark of the start is always kept.
    pub fn with_memory(mut self, bytes: usize) -> Replay<'m> {
        self.memory = bytes;
        self.thin_out();
        self
    }

    /// Sets a flag that interrupts seeks: while it is true, [`Replay::seek`] ends early. It is checked every few events
    /// or steps.
    pub fn stop_when(&mut self, flag: Arc<AtomicBool>) {
        self.interrupt = Some(flag);
    }

    /// The present, in the model's unit of time.
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Number of modules at present, without brackets.
    pub fn modules(&self) -> usize {
        self.modules
    }

    /// Number of productions up to the present.
    pub fn productions(&self) -> usize {
        self.happened
    }

    /// The string at present.
    ///
    /// # Errors
    /// A value cannot be computed. [`Replay::seek`] has checked this already, [`Replay::seek_event`] has not.
    pub fn string(&mut self) -> Result<&ModuleString, Error> {
        self.there()?;
        self.show()?;
        Ok(&self.string)
    }

    /// The simulation at present. It may have searched beyond the present, but not past the next event.
    ///
    /// # Errors
    /// As of [`Replay::string`].
    pub fn simulation(&mut self) -> Result<&Simulation<'m>, Error> {
        self.there()?;
        Ok(&self.live)
    }

    /// The productions up to the present, in the order of time; if there are very many, the last ones.
    pub fn events(&self) -> impl DoubleEndedIterator<Item = &Event> + ExactSizeIterator {
        let remembered = self.happened.saturating_sub(self.forgotten).min(self.events.len());
        self.events.range(..remembered).map(|past| &past.event)
    }

    /// Number of productions before the ones in [`Replay::events`].
    pub fn forgotten_events(&self) -> usize {
        self.forgotten
    }

    /// Number of marks, and their approximate size in bytes.
    pub fn marks(&self) -> (usize, usize) {
        (self.marks.len(), self.marks.iter().map(|mark| mark.size).sum())
    }

    /// Total work of all seeks so far without copies, in the unit of [`Simulation::work`].
    pub fn work_spent(&self) -> u64 {
        self.spent
    }

    /// Makes a time, which must not be negative, the present.
    ///
    /// # Errors
    /// Those of the run. The present is then unchanged.
    pub fn seek(&mut self, t: f64) -> Result<Stop, Error> {
        self.go(t, false)
    }

    /// Makes the next event the present, if there is one up to `limit`; otherwise `limit`, unless that
    /// is in the past. Events of one instant count as one.
    ///
    /// # Errors
    /// Those of the run. The present is then unchanged.
    pub fn seek_event(&mut self, limit: f64) -> Result<Stop, Error> {
        let limit = limit.max(self.time);
        self.go(limit, true)
    }

    /// Makes the last event before the present the present; if there is none in the list, the start. The simulation is
    /// not moved until it is needed; [`Replay::settle`] moves it and can be interrupted.
    ///
    /// # Errors
    /// Those of the run. The present is then unchanged.
    pub fn seek_event_before(&mut self) -> Result<Stop, Error> {
        let (events, remembered) = (&self.events, self.events().len());
        let Some(last) = (0..remembered).rev().find(|&i| events[i].event.time < self.time) else {
            let stop = self.seek(0.0)?;
            return Ok(if stop == Stop::There { Stop::Nothing } else { stop });
        };
        // Events within a rounding of that time belong to it.
        let t = events[last].event.time;
        let with_it = (last..remembered).take_while(|&i| happens_by(events[i].at, t)).last().unwrap_or(last);
        (self.happened, self.modules) = (self.forgotten + with_it + 1, events[with_it].modules);
        (self.time, self.placed, self.shown) = (t, false, false);
        Ok(Stop::There)
    }

    /// Moves the simulation to the present if it is not there.
    ///
    /// # Errors
    /// Those of the run, although these times were reached before.
    pub fn settle(&mut self) -> Result<Stop, Error> {
        if self.placed {
            return Ok(Stop::There);
        }
        let expected = (self.happened, self.modules);
        self.place(self.time)?;
        let stop = self.run(self.time, false)?;
        debug_assert!(stop != Stop::There || expected == (self.happened, self.modules));
        Ok(stop)
    }

    /// As [`Replay::settle`], ignoring the flag.
    fn there(&mut self) -> Result<(), Error> {
        let flag = self.interrupt.take();
        let gone = self.settle();
        self.interrupt = flag;
        gone.map(|_| ())
    }

    fn go(&mut self, t: f64, one_event: bool) -> Result<Stop, Error> {
        let present = self.time;
        let gone = match one_event {
            // The events of the present are past.
            true => self.place(present).and_then(|()| self.live.pass(present)),
            false => self.place(t),
        };
        let gone = gone.and_then(|()| self.run(t, one_event));
        // A series of steps from event to event does not need every string.
        match gone.and_then(|stop| if one_event { Ok(stop) } else { self.show().map(|()| stop) }) {
            Ok(stop) => Ok(stop),
            Err(error) => {
                // Return to the present, which is known to be valid.
                let flag = self.interrupt.take();
                let back = self.place(present).and_then(|()| self.run(present, false));
                self.interrupt = flag;
                back.and(Err(error))
            }
        }
    }

    /// The production that replaces a module of the present string, if it takes place up to `limit`; `None` if it
    /// does not, if the flag was set, or if finding it takes more than about two seconds. The present does not change.
    pub fn end_of(&mut self, module: Lineage, limit: f64) -> Option<Event> {
        /// In units of work: about two seconds.
        const MOST_WORK: u64 = 20_000_000;
        self.there().ok()?;
        let mut ahead = self.live.clone();
        let most = ahead.work() + MOST_WORK;
        loop {
            let passed = ahead.pass_some(limit, STRIDE, false);
            if let Some(event) = ahead.take_events().into_iter().find(|event| event.lineage == module) {
                return Some(event);
            }
            let stopped = self.interrupt.as_ref().is_some_and(|flag| flag.load(Ordering::Relaxed));
            if !matches!(passed, Ok(Passed::Some)) || stopped || ahead.work() > most {
                return None;
            }
        }
    }

    /// Moves the simulation to the mark from which `t` is reached at the least cost, unless it is closer already.
    fn place(&mut self, t: f64) -> Result<(), Error> {
        let near = self.marks.iter().rposition(|mark| mark.simulation.can_show(t)).unwrap_or(0);
        let mark = &self.marks[near];
        // The cost of a copy in units of work.
        let cost = (mark.size / BYTES_A_UNIT) as u64;
        if !self.live.can_show(t) || mark.work > self.live.work() + cost {
            self.live = mark.simulation.clone();
            // The string belongs to another copy.
            self.string.reset(t);
        }
        (self.placed, self.shown) = (false, false);
        Ok(())
    }

    fn run(&mut self, t: f64, one_event: bool) -> Result<Stop, Error> {
        let mut next_mark = self.next_mark();
        let mut stop = Stop::There;
        let before = self.live.work();
        loop {
            // On times not visited before, the state after each instant is recorded.
            let stride = if t <= self.seen { STRIDE } else { 1 };
            let passed = self.live.pass_some(t, stride, one_event);
            self.take_events();
            match passed? {
                Passed::All => {
                    self.time = t;
                    if one_event {
                        stop = Stop::Nothing;
                    }
                    break;
                }
                Passed::Event => {
                    self.time = self.live.reached();
                    break;
                }
                Passed::Some => {}
            }
            if self.live.work() >= next_mark {
                self.mark();
                next_mark = self.next_mark();
            }
            if self.interrupt.as_ref().is_some_and(|flag| flag.load(Ordering::Relaxed)) {
                // Just after the last event or step.
                self.time = self.live.reached().next_up().min(t);
                stop = Stop::Interrupted;
                break;
            }
        }
        // Events within a rounding of an event belong to it.
        if stop != Stop::There || one_event {
            self.live.pass(self.time)?;
            self.take_events();
        }
        self.known = self.known.max(self.live.work());
        self.spent += self.live.work() - before;
        self.arrive();
        Ok(stop)
    }

    /// Records that the simulation is at the present.
    fn arrive(&mut self) {
        (self.placed, self.shown) = (true, false);
        self.seen = self.seen.max(self.time);
        let stats = self.live.stats();
        (self.happened, self.modules) = (stats.events as usize, stats.modules as usize);
    }

    /// Forms the string of the present.
    fn show(&mut self) -> Result<(), Error> {
        if !self.shown {
            self.live.at(self.time, &mut self.string)?;
            self.shown = true;
        }
        Ok(())
    }

    fn take_events(&mut self) {
        let new = self.live.take_events();
        if new.is_empty() {
            return;
        }
        let happened = self.live.stats().events as usize;
        let seen = self.forgotten + self.events.len();
        if happened > seen {
            let missing = happened - seen;
            let known = new.len().saturating_sub(missing);
            let (at, modules) = (self.live.reached_at(), self.live.stats().modules as usize);
            self.events.extend(new.into_iter().skip(known).map(|event| Past { event, at, modules }));
            while self.events.len() > MOST_EVENTS {
                self.events.pop_front();
                self.forgotten += 1;
            }
        }
    }

    /// The work at which the next mark is due.
    fn next_mark(&self) -> u64 {
        let work = self.live.work();
        let cost = (self.live.size() / BYTES_A_UNIT) as u64;
        let after = self.marks.partition_point(|mark| mark.work <= work);
        let last = self.marks[after.saturating_sub(1)].work.min(work);
        // Up to the next mark, or to the largest work so far, these times have been visited.
        let end = self.marks.get(after).map_or(self.known, |mark| mark.work);
        if end > work {
            let half = (end - work) / 2;
            if half <= cost / 2 { end + (work / PART).max(DEAR * cost) } else { work + half }
        } else {
            last + (work / PART).max(DEAR * cost)
        }
    }

    /// Sets a mark at the present.
    fn mark(&mut self) {
        let (work, size) = (self.live.work(), self.live.size());
        let at = self.marks.partition_point(|mark| mark.work < work);
        if self.marks.get(at).is_some_and(|mark| mark.work == work) {
            return;
        }
        self.marks.insert(at, Mark { simulation: self.live.clone(), work, size });
        self.thin_out();
    }

    /// Removes marks until they fit: first those that leave the smallest gap relative to their distance from the present.
    fn thin_out(&mut self) {
        let here = self.live.work();
        let mut total: usize = self.marks.iter().map(|mark| mark.size).sum();
        while self.marks.len() > 1 && (total > self.memory || self.marks.len() > MOST_MARKS) {
            let gap = |i: usize| {
                let next = self.marks.get(i + 1).map_or(self.known.max(here), |mark| mark.work);
                let gap = next.max(self.marks[i].work) - self.marks[i - 1].work;
                (gap as f64 + 1.0) / (self.marks[i].work.abs_diff(here) as f64 + 1.0)
            };
            let worst = (1..self.marks.len()).min_by(|a, b| gap(*a).total_cmp(&gap(*b))).unwrap_or(1);
            total -= self.marks.remove(worst).size;
        }
    }
}
