//! Productions that hold just after an instant but not at it, where something jumps.
//!
//! `if floor(x) != n produce A(floor(x))`, with an x that falls through 2: at the instant the whole part is 2 and the condition does not
//! hold; just after it the whole part is 1. So the successor is that of just after, A(1), and for the rest of the instant whole
//! parts and signs in conditions are those of just after: else A(1) would find a whole part of 2 and be replaced without end.
//! What does not jump has its value at the instant.

use super::{EventStage, Firing, chance};
use crate::world::new_modules::NewModules;
use crate::world::state::Open;
use dlsys_expr::Dual;
use dlsys_model::{Sign, Truth};
use dlsys_tree::{Family, ModuleId};

/// The first delay that is tried, in resolutions of time.
const FIRST_DELAY: f64 = 64.0;

/// No delay is longer than this part of the present time, or of 1.
const LONGEST_DELAY: f64 = 1e-6;

/// Every variable over which something jumps moves at least by this part of its size, or of 1, so that also its sum with something larger does,
const LEAST_MOVE: f64 = 1e-12;

/// and none by more than this part, if that is possible.
const MOST_MOVE: f64 = 1e-9;

/// Sides that differ by so much of their size differ by more than rounding, in whatever way the successor is written.
const CLEAR: f64 = 1024.0 * f64::EPSILON;

/// Arguments that differ by no more than this part of them are the same: what they differ by is the effect of the delay.
const SAME: f64 = 1e-9;

/// The limit from above of a number that is known a little later and twice as long later; the number at the instant itself, where it is
/// known and no more than rounding away.
fn just_after(at: Option<f64>, near: f64, far: f64) -> f64 {
    let limit = if near == far { near } else { 2.0 * near - far };
    at.filter(|at| (limit - at).abs() <= SAME * at.abs().max(limit.abs())).unwrap_or(limit)
}

/// The value at the instant of the moving variable that a parameter is, if it is one a little later: where the successor has other modules at
/// the instant, what is handed on would else get a rounding of itself, perhaps on the other side of the jump.
fn handed_on(near: f64, variables: &[f64], later: &[f64]) -> Option<f64> {
    let mut moving = variables.iter().zip(later).filter(|(at, later)| at != later);
    moving.find(|(_, later)| **later == near).map(|(at, _)| *at)
}

impl EventStage<'_, '_> {
    /// The production of a rule that holds, with these signs, at the instant. Once what jumps has jumped, no whole part and no sign there
    /// tells anything.
    pub fn production_at(&self, rule: usize, at: &[Sign]) -> Option<usize> {
        let rule = &self.setup.model.rules[rule];
        let has_jumped = |atom: usize| self.events.is_after && at[atom] == Sign::Zero && rule.jumping[atom];
        let sign = |atom: usize| if has_jumped(atom) { Sign::Any } else { at[atom] };
        rule.produces.iter().position(|produce| produce.guard.judge(sign) == Truth::Yes)
    }

    /// The production that holds just after the instant, of a module that was followed to its own jump there, once the instant has been put behind
    /// the jump of another: both happen together.
    pub(super) fn production_behind(&self, rule: usize, open: &Open) -> Option<usize> {
        if !self.events.is_after || open.flow.is_none() {
            return None;
        }
        let rule = &self.setup.model.rules[rule];
        let sign = |atom: usize| match open.at[atom] {
            Sign::Zero if rule.jumping[atom] && open.guess[atom] == Sign::Zero => Sign::Any,
            Sign::Zero if rule.jumping[atom] => open.guess[atom],
            at => at,
        };
        rule.produces.iter().position(|produce| produce.guard.judge(sign) == Truth::Yes)
    }

    /// Appends the modules of the successor just after the instant to `out`; returns its number and the lineage of the new modules.
    /// The variables in `self.scratch` are those of the instant.
    pub fn successor_after(
        &mut self,
        fire: &Firing,
        out: &mut NewModules,
    ) -> Result<(usize, Family), chance::Undrawn> {
        self.events.is_after = true;
        let clause = &self.setup.model.rules[fire.rule].produces[fire.produce];
        let lineage = self.world.tree.lineage(fire.id);
        let variables = self.scratch.variables.clone();
        let later = self.variables_after(fire);
        let mut of = |variables: &[f64]| {
            let mut made = NewModules::default();
            self.scratch.variables.clear();
            self.scratch.variables.extend_from_slice(variables);
            let which = chance::successor(self.setup.seed, clause, lineage, self.scratch, &mut made);
            which.map(|which| (which, made))
        };
        let [at, near, far] = [of(&variables), of(&later[0]), of(&later[1])];
        // Where it has no successor a little later, it has none that could be told from that at the instant.
        let ((which, family), mut made) = match (near, &at) {
            (Ok(near), _) => near,
            (Err(_), Ok(_)) => at.clone()?,
            (Err(undrawn), Err(_)) => return Err(undrawn),
        };
        let alike = |other: Result<((usize, Family), NewModules), chance::Undrawn>| {
            other.ok().filter(|((other, _), new)| *other == which && new.kinds == made.kinds)
        };
        if let Some((_, far)) = alike(far) {
            let at = alike(at).map(|(_, at)| at.arguments);
            for (i, near) in made.arguments.iter_mut().enumerate() {
                let at = match &at {
                    Some(at) => Some(at[i]),
                    None => handed_on(*near, &variables, &later[0]),
                };
                *near = just_after(at, *near, far.arguments[i]);
            }
        }
        out.kinds.append(&mut made.kinds);
        out.arguments.append(&mut made.arguments);
        Ok((which, family))
    }

    /// The variables of a production a little after the instant, and twice as long after it: so long that the sides that meet at the
    /// instant have parted again.
    fn variables_after(&mut self, fire: &Firing) -> [Vec<f64>; 2] {
        let rule = &self.setup.model.rules[fire.rule];
        let open = self.world.state(fire.id).and_then(|state| state.open.as_ref());
        let zero: Vec<usize> = match open {
            Some(open) => (0..rule.atoms.len()).filter(|atom| open.at[*atom] == Sign::Zero).collect(),
            None => Vec::new(),
        };
        let reads = &self.setup.jump_reads[fire.rule][fire.produce];
        let delay = self.delay_of_parting(fire.id, reads, &zero);
        let mut moving = Vec::new();
        [1.0, 2.0].map(|times| {
            self.flow().moving_variables(fire.id, times * delay, &mut moving);
            moving.iter().map(|variable| variable.value).collect()
        })
    }
    /// A time after the instant at which a module's sides that meet at it have parted again, and variables over which something jumps have moved
    /// by more than their rounding.
    pub(super) fn delay_of_parting(&mut self, id: ModuleId, reads: &[usize], zero: &[usize]) -> f64 {
        let rule = self.world.state(id).and_then(|state| state.rule.get());
        let rule = &self.setup.model.rules[rule.expect("open modules have a rule")];
        self.flows.known_rates.clear();
        let longest = LONGEST_DELAY * self.instant.at.to_f64().abs().max(1.0);
        let (mut moving, mut registers) = (Vec::new(), Vec::new());
        self.flow().moving_variables(id, 0.0, &mut moving);
        let [mut least, mut most] = [FIRST_DELAY * self.instant.at.resolution(), longest];
        for &variable in reads {
            let Some(Dual { value, rate }) = moving.get(variable).filter(|moving| moving.rate != 0.0) else {
                continue;
            };
            let time = value.abs().max(1.0) / rate.abs();
            (least, most) = (least.max(LEAST_MOVE * time), most.min(MOST_MOVE * time));
        }
        let mut delay = least.min(most);
        let mut sides = vec![Dual { value: 0.0, rate: 0.0 }; rule.sides.outputs()];
        loop {
            self.flow().moving_variables(id, delay, &mut moving);
            rule.sides.eval(&moving, &mut registers, &mut sides);
            let has_parted = |atom: &usize| {
                let [a, b] = [sides[2 * atom], sides[2 * atom + 1]];
                (a.value - b.value).abs() > CLEAR * a.value.abs().max(b.value.abs()) || a.rate == b.rate
            };
            if zero.iter().all(has_parted) || delay >= longest {
                return delay;
            }
            delay = (4.0 * delay).min(longest);
        }
    }
}
