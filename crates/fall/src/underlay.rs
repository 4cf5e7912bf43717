//! The soil below a body from step to step: whether it is level, what has come onto the body, and the triangles near it.

use std::sync::Arc;

use dlsys_solid::Meeting;

use crate::approach::Touch;
use crate::fall::{Phase, Rules, State};
use crate::pairs::SKIN;
use crate::soil::{Face, Hollow, MOST_COLUMNS, Relief};
use crate::step::Step;
use crate::{Error, Ground, Motion, Span, Surface, Vector};

/// Most times that soil is lowered below a body that begins in it.
const MOVES: usize = 16;

/// The triangles that a body can come to before it has moved by a budget (m) from a place. They save work, and change no result.
#[derive(Clone, Debug)]
pub(crate) struct Close {
    base: Motion,
    pub(crate) budget: f64,
    pub(crate) faces: Vec<Face>,
}

impl Close {
    /// A bound of the way of any point of the body from where it was.
    pub(crate) fn moved(&self, rules: &Rules, motion: &Motion) -> f64 {
        let turned = self.base.attitude.angle_to(&motion.attitude);
        (motion.position - self.base.position).norm() + rules.body.reach() * turned
    }
}

impl Rules {
    /// Finds the triangles that the body can come to in the present step and some more like it, unless they are known.
    fn look_around(&mut self, state: &State, known: bool) {
        let Some(relief) = self.hills().filter(|_| state.phase == Phase::Contact) else {
            self.close = None;
            return;
        };
        let h = self.settings.longest / libm::exp2(f64::from(self.contact_level(&state.motion)));
        let fastest = state.motion.velocity.norm() + state.motion.spin.norm() * self.body.reach();
        let skin = SKIN * self.resolution();
        let need = (2.0 * fastest + 4.0 * self.settings.air.gravity * h) * h + 2.0 * skin;
        if let Some(close) = self.close.as_ref().filter(|_| known)
            && close.budget >= close.moved(self, &state.motion) + need
        {
            return;
        }
        let budget = 2.0 * need + 0.02 * self.size;
        let mut faces = relief.around_body(self, &state.motion, budget);
        let cores: Vec<Vec<Vector>> = self.parts.iter().map(|part| self.core(&state.motion, part)).collect();
        faces.retain(|face| {
            let mut parts = self.parts.iter().zip(&cores);
            parts.any(|(part, core)| {
                let reach = part.radius() + budget;
                face.lowest(core) <= reach && Meeting::of(core, &face.corners).way.norm() <= reach
            })
        });
        self.close = Some(Close { base: state.motion, budget, faces });
    }

    /// Notes the soil that the body may come to before the end of a span: if it is level there, it is a floor.
    ///
    /// # Errors
    ///
    /// The body lies on too many columns.
    pub(crate) fn underlay(&mut self, state: &mut State, span: Option<&Span>) -> Result<(), Error> {
        let Some((span, soil)) = span.and_then(|span| Some((span, span.soil()?))) else { return Ok(()) };
        let motion = &state.motion;
        let longest = self.settings.longest;
        let room = (span.end() - state.time).clamp(longest / 64.0, longest);
        let fastest = motion.velocity.norm() + motion.spin.norm() * self.body.reach();
        self.room = (2.0 * fastest + 4.0 * self.settings.air.gravity * room) * room;
        let reach = self.body.reach() + SKIN * self.resolution();
        let mut relief = Relief::new(soil.clone(), Arc::default());
        let columns = relief.around(&motion.position, reach + self.room);
        let low = motion.position.y - reach - self.room;
        let is_above = low > relief.bounds(columns)[1];
        if !is_above || state.steps == 0 {
            let count = relief.count(&motion.position, reach);
            if count > MOST_COLUMNS {
                return Err(Error::Columns { count, most: MOST_COLUMNS });
            }
        }
        if state.steps == 0 && !is_above {
            state.hollow = Arc::new(self.pit(&relief, motion));
        }
        if !state.hollow.is_empty() && state.phase != Phase::Rest {
            let covered =
                relief.facings(self, motion, 0.0).iter().any(|facing| facing.gap < -self.resolution());
            if !covered {
                state.hollow = Arc::default();
            }
        }
        relief.hollow = Arc::clone(&state.hollow);
        let [lowest, highest] = relief.bounds(columns);
        let Surface { friction, restitution, rolling } = relief.soil.surface;
        let floor = |height: f64| Ground { height, friction, restitution, rolling };
        self.hilly = !is_above && lowest < highest;
        self.ground = (lowest == highest && !is_above).then(|| floor(lowest));
        let here = match self.hilly {
            true => relief.surface(motion.position.x, motion.position.z).unwrap_or(highest),
            false => highest,
        };
        // Air sticks to the soil.
        self.dynamics.stand_on(floor(here));
        let is_near = self.hilly && relief.count(&motion.position, reach + self.room) <= MOST_COLUMNS;
        let known = self.soil.as_ref().is_some_and(|before| before.is_same(&relief));
        self.soil = Some(if is_near { relief.with(columns) } else { relief });
        self.look_around(state, known);
        Ok(())
    }

    /// The soil below a body that is let go in it, in part or as a whole: as much lower as the body is in it.
    fn pit(&self, relief: &Relief, motion: &Motion) -> Hollow {
        let columns = relief.around(&motion.position, self.body.reach() + SKIN * self.resolution());
        // What lies on soil may be in it by rounding.
        let (enough, mut sunk) = (-(SKIN + 1.0) * self.resolution(), 0.0);
        for _ in 0..MOVES {
            let lower =
                Relief { near: relief.hollow(columns, sunk), hollow: Arc::default(), ..relief.clone() };
            let facings = lower.facings(self, motion, 0.0);
            let Some(deepest) = facings.iter().min_by(|a, b| a.gap.total_cmp(&b.gap)) else { break };
            if deepest.gap >= enough {
                break;
            }
            sunk -= deepest.gap / deepest.normal.y.max(0.01);
        }
        if sunk > 0.0 { relief.hollow(columns, sunk) } else { Hollow::default() }
    }

    /// What the body meets of the soil first in a step, where that is not level; as [`Rules::first_touch`] says it of solids.
    pub(crate) fn first_soil(&self, step: &Step, how: (f64, bool)) -> Touch {
        match self.hills() {
            Some(relief) => relief.first_touch((self, step), how),
            None if self.soil.is_none() => Touch::Nothing,
            None => {
                // Beyond the room, soil is not known to be level.
                let swept = step.swept(self.body.reach());
                let part = 0.5 * self.room / swept;
                if swept > self.room {
                    Touch::Until(step.start + (step.end - step.start) * part)
                } else {
                    Touch::Nothing
                }
            }
        }
    }

    /// The soil that the body faces as a relief.
    pub(crate) fn hills(&self) -> Option<&Relief> {
        self.soil.as_ref().filter(|_| self.hilly)
    }

    /// Soil as a limit for what comes onto a body that rests there.
    pub(crate) fn bedded(&self, state: State) -> State {
        let Some(relief) = self.soil.as_ref().filter(|_| state.phase == Phase::Rest) else { return state };
        let columns = relief.around(&state.motion.position, self.body.reach() + SKIN * self.resolution());
        State { hollow: Arc::new(relief.hollow(columns, 0.0)), ..state }
    }

    /// True if no soil has gone from below a body that rests.
    pub(crate) fn is_held(&self, state: &State) -> bool {
        self.soil.as_ref().is_none_or(|relief| relief.holds(&state.hollow))
    }
}
