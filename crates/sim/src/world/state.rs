//! The state of a materialised module: rule, clause, signs, trajectories, next event.

use smallvec::SmallVec;

use crate::trajectory::Trajectory;
use crate::world::context::Context;
use dlsys_model::Sign;
pub use dlsys_ode::Control;
use dlsys_ode::Dense;
use dlsys_tree::{ModuleId, SimTime};

pub type Signs = SmallVec<[Sign; 8]>;
pub type Switches = SmallVec<[bool; 8]>;

/// A module's rule, its equations, and how far it is known to go.
#[derive(Clone, Debug)]
pub struct State {
    pub id: ModuleId,
    /// False when the module has been replaced, and its memory waits for another.
    pub is_alive: bool,
    /// The rule that applies; None where no rule's context is there.
    pub rule: Option<usize>,
    pub context: Context,
    pub solve: Option<usize>,
    /// Conditions inside the active equations.
    pub switches: Switches,
    /// The sign of each atom of the rule, just after the last instant at which it was examined.
    pub signs: Signs,
    /// When the trajectories began; the values in the tree are those of then.
    pub since: SimTime,
    /// How each parameter moves; empty means that none does.
    pub trajectories: SmallVec<[Trajectory; 2]>,
    /// The module's own step, if it is integrated alone.
    pub step: Option<Box<Step>>,
    /// Length of the last stretch of formulas that was searched; 0 if none was.
    pub window: f64,
    /// The time before which no formula of a coupled module meets a level; infinitely early if that is not known, NaN if it has
    /// not been asked. Every step of its neighbours asks.
    pub free_until: f64,
    /// All equations are integrated numerically, formulas or not.
    pub numeric_only: bool,
    /// It is integrated together with its neighbours.
    pub coupled: bool,
    /// Number of the last walk through neighbours that came by.
    pub visited: u64,
    pub next: Next,
    /// Set while an instant is examined that concerns the module.
    pub open: Option<Box<Open>>,
    /// Its trajectories are about to begin.
    pub waits: bool,
    /// Number of the instant at which its trajectories last began.
    pub restarted: u64,
    /// Number of the instant at which it last got other neighbours, without anything else that changed.
    pub exchanged: u64,
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
    /// Atoms, one bit each, whose sides are nearer each other than the error of integration.
    pub near: u64,
    /// Some signs change before then.
    has_changes: bool,
    /// Signs that change. Most coupled modules have none before their common step ends, and every step reads their states.
    ahead: Option<Box<Ahead>>,
}

/// The changes of signs up to the next entry of the schedule.
#[derive(Clone, Debug, Default)]
struct Ahead {
    /// Signs that are zero then.
    touched: SmallVec<[Change; 1]>,
    /// Signs that change before then, without consequence.
    changes: Vec<Change>,
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
    pub fn new(kind: NextKind, touched: SmallVec<[Change; 1]>, changes: Vec<Change>) -> Next {
        let has_changes = !changes.is_empty();
        let is_known = !touched.is_empty() || has_changes;
        let ahead = is_known.then(|| Box::new(Ahead { touched, changes }));
        Next { kind, has_changes, ahead, ..Next::default() }
    }

    /// Nothing known, of a module that goes on.
    pub fn again(&self) -> Next {
        Next { near: self.near, ..Next::default() }
    }

    /// Forgets all, but not its memory.
    fn clear(&mut self) {
        (self.kind, self.lasting, self.near, self.has_changes) = (NextKind::Nothing, false, 0, false);
        if let Some(ahead) = &mut self.ahead {
            ahead.touched.clear();
            ahead.changes.clear();
        }
    }

    /// Signs that are zero then.
    pub fn touched(&self) -> &[Change] {
        self.ahead.as_ref().map_or(&[], |ahead| &ahead.touched)
    }

    /// Takes the signs that are zero then out.
    pub fn take_touched(&mut self) -> SmallVec<[Change; 1]> {
        self.ahead.as_mut().map(|ahead| std::mem::take(&mut ahead.touched)).unwrap_or_default()
    }

    /// Makes these the signs that are zero then.
    pub fn touch(&mut self, kind: NextKind, touched: SmallVec<[Change; 1]>) {
        self.kind = kind;
        if !touched.is_empty() || self.ahead.is_some() {
            self.ahead.get_or_insert_default().touched = touched;
        }
    }

    /// Signs that change before then, without consequence.
    pub fn changes(&self) -> &[Change] {
        self.ahead.as_ref().filter(|_| self.has_changes).map_or(&[], |ahead| &ahead.changes)
    }

    /// Adds such changes.
    pub fn add_changes(&mut self, changes: Vec<Change>) {
        if !changes.is_empty() {
            self.ahead.get_or_insert_default().changes.extend(changes);
            self.has_changes = true;
        }
    }
}

/// A sign that changes.
#[derive(Clone, Copy, Debug)]
pub struct Change {
    pub atom: usize,
    pub time: SimTime,
    pub at: Sign,
    pub after: Sign,
    /// The variable that meets a level there, one of the module's parameters or of its neighbours', and the level.
    pub level: Option<(usize, f64)>,
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
    /// The variables that meet a level at the instant: what follows from that gets the level, not a rounding of it.
    pub levels: SmallVec<[Level; 1]>,
}

/// A variable at the level at which the sides of an atom meet.
#[derive(Clone, Copy, Debug)]
pub struct Level {
    pub atom: usize,
    pub variable: usize,
    pub value: f64,
    /// The sign of the difference of the sides just after.
    pub after: Sign,
}

impl State {
    pub fn new(id: ModuleId) -> State {
        State {
            id,
            is_alive: true,
            rule: None,
            context: Context::default(),
            solve: None,
            switches: SmallVec::new(),
            signs: SmallVec::new(),
            since: SimTime::ZERO,
            trajectories: SmallVec::new(),
            step: None,
            window: 0.0,
            free_until: f64::NAN,
            numeric_only: false,
            coupled: false,
            visited: 0,
            next: Next::default(),
            open: None,
            waits: false,
            restarted: 0,
            exchanged: 0,
        }
    }

    /// Makes the memory of a dead module that of a new one.
    pub fn renew(&mut self, id: ModuleId) {
        (self.id, self.is_alive) = (id, true);
        self.context.clear();
        self.switches.clear();
        (self.step, self.open) = (None, None);
        self.next.clear();
        (self.window, self.free_until) = (0.0, f64::NAN);
        (self.numeric_only, self.coupled) = (false, false);
    }

    /// True if some parameter is integrated by the module's own steps.
    pub fn is_numeric(&self) -> bool {
        self.trajectories.iter().any(|m| !m.is_formula())
    }

    /// Opens the module as one that was followed along its trajectory.
    pub fn follow(&mut self) -> &mut Open {
        if self.open.is_none() {
            let flow = Some((self.solve, Switches::from_slice(&self.switches)));
            let (at, guess) = (Signs::from_slice(&self.signs), Signs::from_slice(&self.signs));
            self.open = Some(Box::new(Open { at, guess, flow, ..Open::default() }));
        }
        self.open.as_mut().expect("just opened")
    }

    /// Opens the module as one whose signs are known from its values only.
    pub fn place(&mut self, clear: bool) {
        let guess = self.signs.iter().map(|&s| if s == Sign::Zero { Sign::Any } else { s }).collect();
        let at = Signs::from_slice(&self.signs);
        self.open = Some(Box::new(Open { at, guess, clear, ..Open::default() }));
    }

    /// Takes over the signs that have changed without consequence up to an instant.
    pub fn pass_changes(&mut self, until: SimTime) {
        let (signs, true, Some(ahead)) = (&mut self.signs, self.next.has_changes, &mut self.next.ahead)
        else {
            return;
        };
        ahead.changes.retain(|change| {
            let passed = change.time.since(until) <= 0.0;
            if passed {
                signs[change.atom] = change.after;
            }
            !passed
        });
        self.next.has_changes = !ahead.changes.is_empty();
    }
}
