//! The state of a materialised module: rule, clause, signs, trajectories, next event.

use smallvec::SmallVec;

use crate::world::context::Context;
use crate::world::marks::Marks;
use crate::world::short::Short;
use crate::world::trajectories::{Law, Trajectories};
use dlsys_model::Sign;
pub use dlsys_ode::Control;
use dlsys_ode::Dense;
use dlsys_tree::{ModuleId, SimTime};

pub type Signs = Short<Sign>;
pub type Switches = Short<bool>;

/// A module's rule, its equations, and how far it is known to go.
#[derive(Clone, Debug)]
pub struct State {
    pub id: ModuleId,
    /// False when the module has been replaced, and its memory waits for another.
    pub is_alive: bool,
    /// The rule that applies; none where no rule's context is there.
    pub rule: Index,
    /// The active clause of it.
    pub solve: Index,
    pub context: Context,
    /// The sign of each atom of the rule, just after the last instant at which it was examined, and conditions inside the active
    /// equations.
    pub marks: Marks,
    /// When the trajectories began; the values in the tree are those of then.
    pub since: SimTime,
    /// How each parameter moves, and the module's own step.
    pub trajectories: Trajectories,
    /// How far formulas have been looked at; NaN if they have not. Of a coupled module, the time before which none of them meets a level, which every
    /// step of its neighbours asks for; infinitely early if that is not known. Of any other, the length of the last stretch that was searched.
    pub horizon: f64,
    /// All equations are integrated numerically, formulas or not.
    pub numeric_only: bool,
    /// It is integrated together with its neighbours.
    pub coupled: bool,
    /// Number of the last walk through neighbours that came by.
    pub visited: u32,
    pub next: Next,
    /// Set while an instant is examined that concerns the module.
    pub open: Option<Box<Open>>,
    /// Its trajectories are about to begin.
    pub waits: bool,
    /// What changed at the last instant that changed something: its number, four times, and in the last two bits what it was.
    changed: u64,
}

/// An index, or none: in a quarter of the room of an `Option<usize>`, because there are millions of states.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Index(u32);

impl Index {
    const NONE: Index = Index(u32::MAX);

    pub fn get(self) -> Option<usize> {
        (self != Index::NONE).then_some(self.0 as usize)
    }
}

impl From<Option<usize>> for Index {
    fn from(index: Option<usize>) -> Index {
        index.map_or(Index::NONE, |index| Index(index as u32))
    }
}

/// A step, or a window of formulas, of one module.
#[derive(Clone, Debug)]
pub struct Step {
    pub dense: Dense,
    pub control: Control,
    /// The clause whose equations the module follows, since when it has followed them, and the length that its first step then should
    /// have had.
    pub solve: usize,
    pub begun: SimTime,
    pub first: f64,
    /// The number of steps under this clause before this one, and one of them that was rejected at first.
    pub number: u32,
    pub hurdle: Option<Hurdle>,
    /// The step is of the present trajectory.
    pub live: bool,
    /// Time in the past, and the number of steps since then.
    pub mark: SimTime,
    pub since_mark: usize,
}

/// A step that was rejected at first: the number of steps that the module had made under its clause before it, and the length with
/// which it should be tried.
#[derive(Clone, Copy, Debug)]
pub struct Hurdle {
    pub number: u32,
    pub size: f64,
}

/// The next entry of the schedule for a module.
#[derive(Clone, Debug, Default)]
pub struct Next {
    pub kind: NextKind,
    /// All this follows from formulas, and holds whatever a common step brings.
    pub lasting: bool,
    /// Some signs change before then.
    has_changes: bool,
    /// Signs that change. Most coupled modules have none before their common step ends, and every step reads their states.
    ahead: Option<Box<Ahead>>,
}

/// The changes of signs up to the next entry of the schedule.
#[derive(Clone, Debug, Default)]
struct Ahead {
    /// Signs that are zero then, and behind them those that change before then, without consequence.
    changes: SmallVec<[Change; 1]>,
    /// The number of the former.
    touched: u32,
    /// See [`Next::near`].
    near: u64,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum NextKind {
    /// Nothing, ever.
    #[default]
    Nothing,
    /// A production, or a change of equations.
    Event,
    /// The end of the stretch that has been searched.
    Window,
    /// The end of the solution.
    Fault,
    /// Two sides come near each other and part again, and cannot be told from such as have met.
    Doubt,
}

impl Next {
    pub fn new(kind: NextKind, touched: SmallVec<[Change; 1]>, changes: &[Change]) -> Next {
        let mut next = Next::default();
        next.touch(kind, touched);
        next.add_changes(changes);
        next
    }

    /// Nothing known, of a module that goes on.
    pub fn again(&self) -> Next {
        let mut next = Next::default();
        next.set_near(self.near());
        next
    }

    /// The same at other times.
    pub fn moved(&self, time: impl Fn(SimTime) -> SimTime) -> Next {
        let mut moved = self.clone();
        let changes = moved.ahead.iter_mut().flat_map(|ahead| &mut ahead.changes);
        changes.for_each(|change| change.time = time(change.time));
        moved
    }

    /// Atoms, one bit each, whose sides are nearer each other than the error of integration: mostly none.
    pub fn near(&self) -> u64 {
        self.ahead.as_ref().map_or(0, |ahead| ahead.near)
    }

    pub fn set_near(&mut self, near: u64) {
        match &mut self.ahead {
            Some(ahead) => ahead.near = near,
            None if near == 0 => {}
            None => self.ahead = Some(Box::new(Ahead { near, ..Ahead::default() })),
        }
    }

    /// Forgets all, but not its memory.
    fn clear(&mut self) {
        (self.kind, self.lasting, self.has_changes) = (NextKind::Nothing, false, false);
        if let Some(ahead) = &mut self.ahead {
            ahead.changes.clear();
            (ahead.touched, ahead.near) = (0, 0);
        }
    }

    /// Signs that are zero then.
    pub fn touched(&self) -> &[Change] {
        self.ahead.as_ref().map_or(&[], |ahead| &ahead.changes[..ahead.touched as usize])
    }

    /// Takes the signs that are zero then out.
    pub fn take_touched(&mut self) -> SmallVec<[Change; 1]> {
        let Some(ahead) = &mut self.ahead else { return SmallVec::new() };
        let touched = std::mem::take(&mut ahead.touched) as usize;
        match self.has_changes {
            true => ahead.changes.drain(..touched).collect(),
            false => std::mem::take(&mut ahead.changes),
        }
    }

    /// Makes these the signs that are zero then.
    pub fn touch(&mut self, kind: NextKind, touched: SmallVec<[Change; 1]>) {
        self.kind = kind;
        if touched.is_empty() && self.ahead.is_none() {
            return;
        }
        let count = touched.len() as u32;
        let ahead = self.ahead.get_or_insert_default();
        match self.has_changes {
            true => {
                ahead.changes.drain(..ahead.touched as usize);
                ahead.changes.insert_from_slice(0, &touched);
            }
            false => ahead.changes = touched,
        }
        ahead.touched = count;
    }

    /// Signs that change before then, without consequence.
    pub fn changes(&self) -> &[Change] {
        let ahead = self.ahead.as_ref().filter(|_| self.has_changes);
        ahead.map_or(&[], |ahead| &ahead.changes[ahead.touched as usize..])
    }

    /// Adds such changes.
    pub fn add_changes(&mut self, changes: &[Change]) {
        if !changes.is_empty() {
            self.ahead.get_or_insert_default().changes.extend_from_slice(changes);
            self.has_changes = true;
        }
    }

    /// Takes out those of them that come before a time, and calls a function with each.
    fn pass_changes(&mut self, until: SimTime, mut pass: impl FnMut(&Change)) {
        let (true, Some(ahead)) = (self.has_changes, &mut self.ahead) else { return };
        let (mut place, touched) = (0, ahead.touched);
        ahead.changes.retain(|change| {
            let passed = place >= touched && change.time.since(until) <= 0.0;
            place += 1;
            if passed {
                pass(change);
            }
            !passed
        });
        self.has_changes = ahead.changes.len() > touched as usize;
    }
}

/// A sign that changes. Most modules that have events keep one: see [`Index`] for the room that numbers take.
#[derive(Clone, Copy, Debug)]
pub struct Change {
    pub time: SimTime,
    atom: u32,
    variable: Index,
    level: f64,
    pub at: Sign,
    pub after: Sign,
}

impl Change {
    /// An atom whose sign is `at` at a time, and `after` just after it.
    pub fn new(atom: usize, time: SimTime, [at, after]: [Sign; 2]) -> Change {
        Change { time, atom: atom as u32, variable: Index::NONE, level: 0.0, at, after }
    }

    pub fn atom(&self) -> usize {
        self.atom as usize
    }

    /// The variable that meets a level there, one of the module's parameters or of its neighbours', and the level.
    pub fn level(&self) -> Option<(usize, f64)> {
        self.variable.get().map(|variable| (variable, self.level))
    }

    /// The same change with such a level.
    pub fn at_level(self, level: Option<(usize, f64)>) -> Change {
        let (variable, level) = level.unzip();
        Change { variable: variable.into(), level: level.unwrap_or(0.0), ..self }
    }
}

/// The open questions of a module at the instant under examination.
#[derive(Clone, Debug, Default)]
pub struct Open {
    /// The signs at the instant.
    pub at: Signs,
    /// Where zero signs are expected to go: known if they were followed there.
    pub guess: Signs,
    /// The equations that brought the module here. None if it comes from elsewhere: then its signs are
    /// computed from values, not followed along a trajectory.
    pub flow: Option<(Option<usize>, Switches)>,
    /// Clauses whose equations were tried.
    pub tried: SmallVec<[usize; 4]>,
    /// Times that switches were found the other way, with what the module reads as it was.
    pub flips: usize,
    /// The number of the last choice at the instant that gave it other equations; see [`modes`](crate::event).
    pub chosen: usize,
    /// The instant has been put behind a jump.
    pub behind: bool,
    /// No side is near the other: signs are what they are.
    pub clear: bool,
    /// The sides that meet at the instant: what follows from that gets numbers at which they are equal, not roundings of these.
    pub levels: SmallVec<[Level; 1]>,
}

/// The sides of an atom that meet at an instant.
#[derive(Clone, Copy, Debug)]
pub struct Level {
    pub atom: usize,
    /// The one variable that moves, and its value there, if there is only one.
    pub level: Option<(usize, f64)>,
    /// The sign of the difference of the sides just after.
    pub after: Sign,
}

/// What may change at an instant.
const RESTARTED: u64 = 1;
const EXCHANGED: u64 = 2;

impl State {
    pub fn new(id: ModuleId) -> State {
        State {
            id,
            is_alive: true,
            rule: Index::NONE,
            solve: Index::NONE,
            context: Context::default(),
            marks: Marks::default(),
            since: SimTime::ZERO,
            trajectories: Trajectories::default(),
            horizon: f64::NAN,
            numeric_only: false,
            coupled: false,
            visited: 0,
            next: Next::default(),
            open: None,
            waits: false,
            changed: 0,
        }
    }

    /// Makes the memory of a dead module that of a new one.
    pub fn renew(&mut self, id: ModuleId) {
        (self.id, self.is_alive) = (id, true);
        self.context.clear();
        self.marks.set_switches(&[]);
        self.trajectories.end_steps();
        self.open = None;
        self.next.clear();
        self.horizon = f64::NAN;
        (self.numeric_only, self.coupled) = (false, false);
    }

    /// Notes that its trajectories begin at the instant of this number.
    pub fn restart(&mut self, number: u64) {
        self.change(number, RESTARTED);
    }

    /// True if they have begun then; asked of the present instant only.
    pub fn has_restarted(&self, number: u64) -> bool {
        self.changed >> 2 == number && self.changed & RESTARTED != 0
    }

    /// Notes that it gets other neighbours at the instant of this number, without anything else that changes.
    pub fn exchange(&mut self, number: u64) {
        self.change(number, EXCHANGED);
    }

    /// True if it has got them then; asked of the present instant only.
    pub fn has_exchanged(&self, number: u64) -> bool {
        self.changed >> 2 == number && self.changed & EXCHANGED != 0
    }

    fn change(&mut self, number: u64, what: u64) {
        let before = if self.changed >> 2 == number { self.changed } else { number << 2 };
        self.changed = before | what;
    }

    /// Puts the module under a rule and a clause of it.
    pub fn put_under(&mut self, rule: usize, solve: Option<usize>) {
        (self.rule, self.solve) = (Some(rule).into(), solve.into());
    }

    /// True if some parameter is integrated by the module's own steps.
    pub fn is_numeric(&self) -> bool {
        self.trajectories.iter().any(Law::is_numeric)
    }

    /// Opens the module as one that was followed along its trajectory.
    pub fn follow(&mut self) -> &mut Open {
        if self.open.is_none() {
            let flow = Some((self.solve.get(), self.marks.switches()));
            let at = Signs::from(self.marks.signs());
            let guess = at.clone();
            self.open = Some(Box::new(Open { at, guess, flow, ..Open::default() }));
        }
        self.open.as_mut().expect("just opened")
    }

    /// Opens the module as one whose signs are known from its values only.
    pub fn place(&mut self, clear: bool) {
        let at = Signs::from(self.marks.signs());
        let guess = at.iter().map(|&s| if s == Sign::Zero { Sign::Any } else { s }).collect();
        self.open = Some(Box::new(Open { at, guess, clear, ..Open::default() }));
    }

    /// Takes over the signs that have changed without consequence up to an instant.
    pub fn pass_changes(&mut self, until: SimTime) {
        let State { next, marks, .. } = self;
        let signs = marks.signs_mut();
        next.pass_changes(until, |change| signs[change.atom()] = change.after);
    }
}
