//! What happens to sheets in a tick: their states step by step, and the ways of solids among them.

use std::collections::BTreeMap;
use std::sync::Arc;

use dlsys_geometry::scene::SheetKey;
use dlsys_geometry::turtle::Origin;
use dlsys_sheet::{Place as Stand, Sheet, State, Step, Vector};

use crate::Error;
use crate::descent::Descent;
use crate::line::Line;

/// A sheet that a module has placed.
#[derive(Debug)]
pub(crate) struct Hung {
    pub(crate) key: SheetKey,
    pub(crate) origin: Origin,
    /// Its index among those that the model declares.
    pub(crate) sheet: usize,
    pub(crate) made: Arc<Sheet>,
    /// When it begins, in s.
    pub(crate) begin: f64,
}

/// A sheet through a tick or a part of it: its states at the ends of steps, and where it begins.
#[derive(Clone, Debug)]
pub(crate) struct Track {
    pub(crate) hung: Arc<Hung>,
    pub(crate) steps: Vec<(f64, State)>,
    /// What it does to the solids that sheets push, by their modules.
    pub(crate) forces: Vec<(u64, Line)>,
    /// Impulses in N s on solids, by their numbers among the paths.
    pub(crate) pushes: Vec<(usize, Vector)>,
}

/// A solid that passes through a part of a tick.
#[derive(Clone, Debug)]
pub(crate) struct Passage {
    /// The module that draws it where the part begins.
    pub(crate) origin: Origin,
    /// Its size in m: twice the largest distance of a point from its centre.
    pub(crate) size: f64,
    /// Where it is at the beginning and at the end.
    pub(crate) ends: [Stand; 2],
}

impl Track {
    /// The state at a time in s; `None` before its birth.
    pub(crate) fn at(&self, time: f64) -> Option<State> {
        let first = self.steps.first().filter(|(begin, _)| *begin <= time)?;
        let next = self.steps.partition_point(|(end, _)| *end < time);
        let Some((to, after)) = self.steps.get(next) else {
            return self.steps.last().map(|(_, last)| last.clone());
        };
        let (from, before) = if next == 0 { first } else { &self.steps[next - 1] };
        Some(Step { from: *from, to: *to, before, after, pushes: &[], depths: &[] }.at(time))
    }

    fn points(&self) -> usize {
        self.steps.len() * self.hung.made.len()
    }
}

/// What happens to sheets from one tick to the next.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tick {
    pub(crate) number: u64,
    /// One, or several where rules read forces.
    pub(crate) parts: Vec<Part>,
    /// Growth fails before the next tick; solids stand still until then.
    pub(crate) failed: Option<Error>,
}

/// What happens to sheets from one time to another, both in s.
#[derive(Clone, Debug, Default)]
pub(crate) struct Part {
    pub(crate) end: f64,
    pub(crate) tracks: Vec<Track>,
    pub(crate) descent: Descent,
    /// What sheets do to solids whose rules read it, by the module at the beginning.
    pub(crate) forces: BTreeMap<u64, Line>,
    /// Where the solids go, if that is noted.
    pub(crate) passages: Vec<Passage>,
}

impl Tick {
    /// The part within which a time in s lies.
    pub(crate) fn part(&self, seconds: f64) -> Option<&Part> {
        self.parts.iter().find(|part| part.end >= seconds).or(self.parts.last())
    }

    /// Number of points that are kept, and one for itself and for each part.
    pub(crate) fn size(&self) -> usize {
        let tracks = self.parts.iter().flat_map(|part| &part.tracks);
        1 + self.parts.len() + tracks.map(Track::points).sum::<usize>()
    }
}
