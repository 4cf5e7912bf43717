//! Random access in simulated time: any time after any other, forwards or backwards, to the bits that a run to it gives.
//!
//! ```text
//! marks (copies of the simulation)     ●──────●───────●───●──●─●●        ●            ●
//! the simulation, where it is now                               ▲ seek(t): the last mark before t, then on from there
//! ```
//!
//! Between two events nothing is run at all: formulas and dense output are evaluated. One event back is no more than a
//! look into the list of what has happened: the structure of that time is formed when somebody wants to see it. Then the last mark
//! before that time is copied and run on. While it runs new marks are set, each half as far from the goal
//! as the one before, because whoever goes back goes back again: 1,000 steps back cost some runs, not 1,000 (the idea
//! is that of checkpointing in reverse mode differentiation: Griewank and Walther 2000, *Revolve*). Marks lie densely where the present is and ever more
//! thinly away from it, and together take no more than the memory that they are given.
//!
//! # Examples
//!
//! ```
//! use dlsys_session::replay::{Replay, Stop};
//! use dlsys_session::Session;
//!
//! let text = "initial string: A(0)\nA(x): if x < 1 solve dx/dt = 1\n if x = 1 produce F(1) A(0)";
//! let session = Session::from_text("stem.dls", text, &[]).expect("a good model");
//! let mut replay = Replay::new(&session.model, Default::default()).expect("it starts");
//! assert_eq!(replay.seek(10.5).expect("it runs"), Stop::There);
//! assert_eq!(replay.string().expect("it runs").len(), 11);
//! replay.seek(2.5).expect("it runs");
//! assert_eq!(replay.string().expect("it runs").len(), 3);
//! assert_eq!(replay.seek_event(9.0).expect("it runs"), Stop::There);
//! assert_eq!((replay.time(), replay.modules()), (3.0, 4));
//! assert_eq!(replay.string().expect("it runs").len(), 4);
//! ```

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use dlsys_model::Model;
use dlsys_sim::{Error, Event, Passed, Settings, Simulation, happens_by};
use dlsys_tree::{Lineage, ModuleString, SimTime};

/// A model in time, with everything that is needed to go to any time at once.
pub struct Replay<'m> {
    live: Simulation<'m>,
    time: f64,
    /// The simulation is at `time`; if not, it is put there before anybody looks.
    placed: bool,
    /// Productions up to `time`, and modules then.
    happened: usize,
    modules: usize,
    string: ModuleString,
    /// The string is that of `time`.
    shown: bool,
    /// In the order of their work; the first is the start, and stays.
    marks: Vec<Mark<'m>>,
    memory: usize,
    /// The most work that has been done on the way to any time: so far the way is known.
    known: u64,
    /// The latest time that was the present: up to there all that happens is known.
    seen: f64,
    interrupt: Option<Arc<AtomicBool>>,
    /// All work that was ever done.
    spent: u64,
    /// The productions up to the latest time that was seen, but for the first so many, which are forgotten.
    events: VecDeque<Past>,
    forgotten: usize,
}

/// A production, and what is known of the time just after it.
struct Past {
    event: Event,
    at: SimTime,
    /// Modules after all that happens at that instant.
    modules: usize,
}

/// A copy of the simulation as it was at some time.
struct Mark<'m> {
    simulation: Simulation<'m>,
    work: u64,
    size: usize,
}

/// How a search has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// The time, or the event, that was asked for is the present.
    There,
    /// There is no event up to the time that was given; that time is the present.
    Nothing,
    /// The flag was set; the present is somewhere on the way.
    Interrupted,
}

/// Entries that are passed before somebody looks at the flag, where nobody wants to know what each of them changes.
const STRIDE: usize = 16;
/// Most marks, whatever their size.
const MOST_MARKS: usize = 256;
/// Most productions that are remembered.
const MOST_EVENTS: usize = 500_000;
/// Bytes that are copied in a unit of work (a tenth of a microsecond), allocations included.
const BYTES_A_UNIT: usize = 400;
/// On new ground marks take no more than this part of the time; on known ground a mark may cost as much as
/// what it saves.
const DEAR: u64 = 16;
/// On new ground a mark is set each time that this part of all work so far has been done.
const PART: u64 = 64;

impl<'m> Replay<'m> {
    /// Memory for marks, in bytes, unless another amount is chosen.
    pub const MEMORY: usize = 256 << 20;

    /// Starts a model at t = 0. Productions are remembered, 500,000 at most.
    ///
    /// # Errors
    /// Those of [`Simulation::new`].
    pub fn new(model: &'m Model, settings: Settings) -> Result<Replay<'m>, Error> {
        let live = Simulation::new(model, Settings { log: true, ..settings })?;
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

    /// Gives marks so many bytes of memory, about. One mark, that of the start, there is always.
    pub fn with_memory(mut self, bytes: usize) -> Replay<'m> {
        self.memory = bytes;
        self.thin_out();
        self
    }

    /// A flag that stops long ways: whoever sets it makes [`Replay::seek`] end early. It is looked at every few events
    /// or steps.
    pub fn stop_when(&mut self, flag: Arc<AtomicBool>) {
        self.interrupt = Some(flag);
    }

    /// The present, in the model's unit of time.
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Modules at present, brackets not counted.
    pub fn modules(&self) -> usize {
        self.modules
    }

    /// Productions up to the present.
    pub fn productions(&self) -> usize {
        self.happened
    }

    /// The structure at present.
    ///
    /// # Errors
    /// If it cannot be formed; [`Replay::seek`] has tried, events that were sought are not looked at before.
    pub fn string(&mut self) -> Result<&ModuleString, Error> {
        self.there()?;
        self.show()?;
        Ok(&self.string)
    }

    /// The simulation; it may have been further than the present, but not past anything that happens after it.
    ///
    /// # Errors
    /// As of [`Replay::string`].
    pub fn simulation(&mut self) -> Result<&Simulation<'m>, Error> {
        self.there()?;
        Ok(&self.live)
    }

    /// The productions up to the present, in the order of time; of very many, the last.
    pub fn events(&self) -> impl DoubleEndedIterator<Item = &Event> + ExactSizeIterator {
        let remembered = self.happened.saturating_sub(self.forgotten).min(self.events.len());
        self.events.range(..remembered).map(|past| &past.event)
    }

    /// Number of productions that took place before those that are remembered.
    pub fn forgotten_events(&self) -> usize {
        self.forgotten
    }

    /// Number of marks, and the bytes that they take, about.
    pub fn marks(&self) -> (usize, usize) {
        (self.marks.len(), self.marks.iter().map(|mark| mark.size).sum())
    }

    /// All work done so far to get from time to time, copies not counted, in the unit of [`Simulation::work`].
    pub fn work_spent(&self) -> u64 {
        self.spent
    }

    /// Makes a time (not negative) the present.
    ///
    /// # Errors
    /// Those of the run. The present is then what it was.
    pub fn seek(&mut self, t: f64) -> Result<Stop, Error> {
        self.go(t, false)
    }

    /// Makes the next event after the present the present, if there is one up to `limit`; else `limit`, unless that
    /// is past. Events of one instant are one.
    ///
    /// # Errors
    /// Those of the run. The present is then what it was.
    pub fn seek_event(&mut self, limit: f64) -> Result<Stop, Error> {
        let limit = limit.max(self.time);
        self.go(limit, true)
    }

    /// Makes the last event before the present the present; if there is none that is remembered, the start. That way
    /// is not gone before somebody looks: [`Replay::settle`] can be stopped on it.
    ///
    /// # Errors
    /// Those of the run. The present is then what it was.
    pub fn seek_event_before(&mut self) -> Result<Stop, Error> {
        let (events, remembered) = (&self.events, self.events().len());
        let Some(last) = (0..remembered).rev().find(|&i| events[i].event.time < self.time) else {
            let stop = self.seek(0.0)?;
            return Ok(if stop == Stop::There { Stop::Nothing } else { stop });
        };
        // What happens within a rounding of that time belongs to it.
        let t = events[last].event.time;
        let with_it = (last..remembered).take_while(|&i| happens_by(events[i].at, t)).last().unwrap_or(last);
        (self.happened, self.modules) = (self.forgotten + with_it + 1, events[with_it].modules);
        (self.time, self.placed, self.shown) = (t, false, false);
        Ok(Stop::There)
    }

    /// Goes the way to the present, if that is still to be gone.
    ///
    /// # Errors
    /// Those of the run, though it was gone before.
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

    /// Goes there, whatever the flag says.
    fn there(&mut self) -> Result<(), Error> {
        let flag = self.interrupt.take();
        let gone = self.settle();
        self.interrupt = flag;
        gone.map(|_| ())
    }

    fn go(&mut self, t: f64, one_event: bool) -> Result<Stop, Error> {
        let present = self.time;
        let gone = match one_event {
            // What happens at the present has happened.
            true => self.place(present).and_then(|()| self.live.pass(present)),
            false => self.place(t),
        };
        let gone = gone.and_then(|()| self.run(t, one_event));
        // Whoever steps from event to event may not want to see each.
        match gone.and_then(|stop| if one_event { Ok(stop) } else { self.show().map(|()| stop) }) {
            Ok(stop) => Ok(stop),
            Err(error) => {
                // What was good before is good again.
                let flag = self.interrupt.take();
                let back = self.place(present).and_then(|()| self.run(present, false));
                self.interrupt = flag;
                back.and(Err(error))
            }
        }
    }

    /// The production by which a module that is there at present is replaced, if that comes up to `limit`; None if it
    /// does not, or if the flag was set or too much work done before it was found. The present stays what it is.
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

    /// Puts the simulation where it can go on to `t`, as near as possible.
    fn place(&mut self, t: f64) -> Result<(), Error> {
        let near = self.marks.iter().rposition(|mark| mark.simulation.can_show(t)).unwrap_or(0);
        let mark = &self.marks[near];
        // A copy costs as much as some work.
        let cost = (mark.size / BYTES_A_UNIT) as u64;
        if !self.live.can_show(t) || mark.work > self.live.work() + cost {
            self.live = mark.simulation.clone();
            // Of another copy, and maybe of another time.
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
            // On new ground, what each instant changes is written down.
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
                // Just after what was passed last.
                self.time = self.live.reached().next_up().min(t);
                stop = Stop::Interrupted;
                break;
            }
        }
        // What happens within a rounding of an event belongs to it.
        if stop != Stop::There || one_event {
            self.live.pass(self.time)?;
            self.take_events();
        }
        self.known = self.known.max(self.live.work());
        self.spent += self.live.work() - before;
        self.arrive();
        Ok(stop)
    }

    /// The simulation is at the present.
    fn arrive(&mut self) {
        (self.placed, self.shown) = (true, false);
        self.seen = self.seen.max(self.time);
        let stats = self.live.stats();
        (self.happened, self.modules) = (stats.events as usize, stats.modules as usize);
    }

    /// Writes the string of the present.
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

    /// The work at which the next mark is due, on the way from here.
    fn next_mark(&self) -> u64 {
        let work = self.live.work();
        let cost = (self.live.size() / BYTES_A_UNIT) as u64;
        let after = self.marks.partition_point(|mark| mark.work <= work);
        let last = self.marks[after.saturating_sub(1)].work.min(work);
        // Up to the next mark, or as far as anybody has been, the way is known.
        let end = self.marks.get(after).map_or(self.known, |mark| mark.work);
        if end > work {
            let half = (end - work) / 2;
            if half <= cost / 2 { end + (work / PART).max(DEAR * cost) } else { work + half }
        } else {
            last + (work / PART).max(DEAR * cost)
        }
    }

    /// Sets a mark here.
    fn mark(&mut self) {
        let (work, size) = (self.live.work(), self.live.size());
        let at = self.marks.partition_point(|mark| mark.work < work);
        if self.marks.get(at).is_some_and(|mark| mark.work == work) {
            return;
        }
        self.marks.insert(at, Mark { simulation: self.live.clone(), work, size });
        self.thin_out();
    }

    /// Takes marks out until they fit: first those that leave the smallest gap, as seen from here.
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
