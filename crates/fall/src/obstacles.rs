//! Solids in the way of a body that falls: where they are, span of time by span of time.

use std::sync::Arc;

use dlsys_solid::{Path, Shape};

use crate::error::check;
use crate::{Error, Soil, Vector};

/// How a body that touches something is held.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// Coulomb's coefficient of friction.
    pub friction: f64,
    /// Coefficient of restitution, 0 to 1: speed of a rebound relative to that of the impact.
    pub restitution: f64,
    /// Resistance of round bodies to rolling, in parts of their radius.
    pub rolling: f64,
}

impl Default for Surface {
    /// A friction of 0.5, a restitution of 0.2, and a resistance to rolling of 0.02.
    fn default() -> Surface {
        Surface { friction: 0.5, restitution: 0.2, rolling: 0.02 }
    }
}

impl Surface {
    pub(crate) fn check(&self) -> Result<(), Error> {
        let Surface { friction, restitution, rolling } = *self;
        check("a friction", friction, friction >= 0.0, "0 or more")?;
        check("a restitution", restitution, (0.0..=1.0).contains(&restitution), "0 to 1")?;
        check("a resistance to rolling", rolling, rolling >= 0.0, "0 or more")
    }
}

/// A rigid body on a given path. What falls does not push it.
#[derive(Clone, Debug)]
pub struct Obstacle {
    /// A number that it keeps from span to span.
    pub number: u64,
    /// Its convex parts, in its axes.
    pub parts: Arc<[Shape]>,
    /// Where it is.
    pub path: Path,
    /// How it holds what touches it.
    pub surface: Surface,
    /// It was not at the beginning of its path before: it appears there, or has been put there from elsewhere.
    pub is_new: bool,
}

impl Obstacle {
    /// Largest distance of one of its points from its origin, in m.
    pub fn reach(&self) -> f64 {
        self.parts.iter().map(Shape::reach).fold(0.0, f64::max)
    }
}

/// The solids from one time to another. A body that falls makes no step across an end of a span.
#[derive(Clone, Debug)]
pub struct Span {
    begin: f64,
    end: f64,
    solids: Vec<Obstacle>,
    swept: Vec<Swept>,
    soil: Option<Soil>,
    is_last: bool,
}

/// What a solid does in a span.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Swept {
    /// A ball in which it stays: centre and radius.
    pub(crate) ball: (Vector, f64),
    /// Bound of the acceleration of its points, in m/s².
    pub(crate) acceleration: f64,
    pub(crate) is_still: bool,
}

impl Span {
    /// From a time to another (s), with these solids.
    ///
    /// # Errors
    ///
    /// A span that does not end after its beginning, a solid without parts or without end, a surface out of range.
    pub fn new(begin: f64, end: f64, solids: Vec<Obstacle>) -> Result<Span, Error> {
        check("a length of a span of time (s)", end - begin, end > begin, "more than 0")?;
        let mut swept = Vec::with_capacity(solids.len());
        for solid in &solids {
            let reach = solid.reach();
            check("a reach of a solid (m)", reach, !solid.parts.is_empty(), "a finite number")?;
            solid.surface.check()?;
            let middle = solid.path.place((begin + end) / 2.0).position;
            let [speed, _] = solid.path.bounds(0.0);
            let [_, acceleration] = solid.path.bounds(reach);
            check("an acceleration of a solid (m/s²)", acceleration, true, "a finite number")?;
            let ball = (middle, reach + speed * (end - begin) / 2.0);
            swept.push(Swept { ball, acceleration, is_still: solid.path.is_still() });
        }
        Ok(Span { begin, end, solids, swept, soil: None, is_last: false })
    }

    /// With soil, which stands still from the beginning to the end. What has come to rest on it stays there, until the soil below it is lower in a later span; soil
    /// that is higher covers it.
    ///
    /// # Errors
    ///
    /// Columns without distance, a surface out of range.
    pub fn above(mut self, soil: Soil) -> Result<Span, Error> {
        soil.check()?;
        self.soil = Some(soil);
        Ok(self)
    }

    /// The last span that differs: what rests in it rests for ever.
    pub fn last(mut self) -> Span {
        self.is_last = true;
        self
    }

    pub(crate) fn soil(&self) -> Option<&Soil> {
        self.soil.as_ref()
    }

    pub(crate) fn is_last(&self) -> bool {
        self.is_last
    }

    /// When it begins, in s.
    pub fn begin(&self) -> f64 {
        self.begin
    }

    /// When it ends, in s.
    pub fn end(&self) -> f64 {
        self.end
    }

    /// Its solids.
    pub fn solids(&self) -> &[Obstacle] {
        &self.solids
    }

    pub(crate) fn swept(&self, index: usize) -> &Swept {
        &self.swept[index]
    }

    /// The solids that may be within a ball in this span, by their index, but for those of some numbers.
    pub(crate) fn near(&self, (centre, radius): (Vector, f64), ignored: &[u64]) -> Vec<usize> {
        let is_near = |index: &usize| {
            let (middle, reach) = self.swept[*index].ball;
            (middle - centre).norm() <= reach + radius && !ignored.contains(&self.solids[*index].number)
        };
        (0..self.solids.len()).filter(is_near).collect()
    }
}

/// Gives the solids at any time.
pub trait Obstacles {
    /// The span in which a time in s lies, as its beginning or after it; `None` if there are no solids at any time.
    ///
    /// # Errors
    ///
    /// The solids are not known.
    fn span(&self, time: f64) -> Result<Option<Arc<Span>>, Error>;
}

/// No solids.
#[derive(Clone, Copy, Debug, Default)]
pub struct Open;

impl Obstacles for Open {
    fn span(&self, _: f64) -> Result<Option<Arc<Span>>, Error> {
        Ok(None)
    }
}
