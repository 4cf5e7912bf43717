//! The search of a step for the next event.
//!
//! For each module the signs of its rule's atoms are known at the start of the step. Here the step is
//! searched for the first instant at which a change of signs matters: a production's condition becomes
//! true, the active equations' condition ends, or a condition inside them changes.

use super::dense::Dense;
use super::roots::{Function, Root, first_root};
use super::system::{Member, System};
use crate::expr::{Binary, Dual, Interval, Program, Scratch, Value};
use crate::model::{Rule, Sign, Truth};
use crate::structure::{Instant, ModuleId};

/// Zero, for a difference of two sides, in units of their rounding.
const TOUCH: f64 = 256.0 * f64::EPSILON;

/// Most changes of a module's signs that are followed within one step.
const MAX_ROUNDS: usize = 50;

/// A sign that changes during the step.
#[derive(Clone, Copy, Debug)]
pub struct Change {
    pub id: ModuleId,
    pub atom: usize,
    /// Position in the step.
    pub position: f64,
    pub at: Sign,
    pub after: Sign,
}

/// What a search found.
#[derive(Clone, Debug, Default)]
pub struct Found {
    /// Position of the first event, if there is one in the step.
    pub event: Option<f64>,
    /// Signs that are zero at the event.
    pub touched: Vec<Change>,
    /// Signs that change without consequence, up to the event or the end of the step.
    pub changes: Vec<Change>,
}

/// The difference of two sides of an atom along a step.
struct Difference<'w> {
    system: &'w System,
    dense: &'w Dense,
    member: &'w Member,
    sides: &'w Program,
    atom: usize,
    bounds: Vec<Dual<Interval>>,
    bounds_scratch: Scratch<Dual<Interval>>,
    bounds_out: Vec<Dual<Interval>>,
    values: Vec<f64>,
    scratch: Scratch<f64>,
    out: Vec<f64>,
}

impl Function for Difference<'_> {
    fn bounds(&mut self, lo: f64, hi: f64) -> Dual<Interval> {
        let h = self.dense.h;
        let width = hi - lo;
        self.system.variables(
            self.member,
            lo * h,
            |i| self.dense.piece(i, lo, hi),
            |t| Dual { value: Interval::spanned(t, t + width * h), rate: Interval::constant(h) },
            &mut self.bounds,
        );
        self.sides.eval(&self.bounds, &mut self.bounds_scratch, &mut self.bounds_out);
        difference(self.bounds_out[2 * self.atom], self.bounds_out[2 * self.atom + 1])
    }

    fn value(&mut self, at: f64) -> f64 {
        self.system.variables(
            self.member,
            at * self.dense.h,
            |i| self.dense.value(i, at),
            |t| t,
            &mut self.values,
        );
        self.sides.eval(&self.values, &mut self.scratch, &mut self.out);
        self.out[2 * self.atom] - self.out[2 * self.atom + 1]
    }
}

fn difference(a: Dual<Interval>, b: Dual<Interval>) -> Dual<Interval> {
    Dual::binary(Binary::Sub, a, b)
}

/// Searches a step. `signs` gives the signs of a module's atoms at its start.
pub fn search<'s>(
    rules: &[Rule],
    system: &System,
    dense: &Dense,
    bounds: &[Interval],
    signs: impl Fn(ModuleId) -> &'s [Sign],
) -> Found {
    let mut candidates: Vec<(Vec<Change>, Instant)> = Vec::new();
    // Of the module of the first event: the last position that is the same instant for its siblings, and
    // its birth.
    let mut elder = (0.0, Instant::ZERO);
    let mut changes: Vec<Change> = Vec::new();
    let mut best = f64::INFINITY;
    let (mut variables, mut scratch, mut out) = (Vec::new(), Vec::new(), Vec::new());
    let (mut moving, mut moving_scratch, mut moving_out) = (Vec::new(), Vec::new(), Vec::new());
    for member in &system.members {
        let rule = &rules[member.rule];
        if rule.atoms.is_empty() {
            continue;
        }
        // First over the whole step at once: most atoms keep their sign in most steps.
        let h = dense.h;
        system.variables(member, 0.0, |i| bounds[i], |t| Interval::spanned(t, t + h), &mut variables);
        out.resize(rule.sides.outputs(), Interval::EMPTY);
        rule.sides.eval(&variables, &mut scratch, &mut out);
        // Zero is judged on the scale of the present, not of the far end of the step: a step may be a
        // thousand lives long.
        let time = |t: f64| Dual { value: t, rate: h };
        system.variables(member, 0.0, |i| dense.start_of(i), time, &mut moving);
        moving_out.resize(rule.sides.outputs(), Dual { value: 0.0, rate: 0.0 });
        rule.sides.eval(&moving, &mut moving_scratch, &mut moving_out);
        let instant = dense.start.resolution() / h;
        let signs = signs(member.id);
        let watched: Vec<(usize, f64)> = (0..rule.atoms.len())
            .filter_map(|atom| {
                let (a, b) = (out[2 * atom], out[2 * atom + 1]);
                let start = [moving_out[2 * atom], moving_out[2 * atom + 1]];
                let size = start.iter().map(|s| s.value.abs()).filter(|s| s.is_finite()).fold(0.0, f64::max);
                let slope = Some((start[0].rate - start[1].rate).abs()).filter(|s| s.is_finite());
                let tolerance = TOUCH * size + slope.unwrap_or(0.0) * instant;
                may_change(rule, member, atom, signs[atom], a, b, tolerance).then_some((atom, tolerance))
            })
            .collect();
        if watched.is_empty() {
            continue;
        }
        let limit = dense.together(best.min(1.0)).min(1.0);
        let found = search_member(rule, system, dense, member, signs, &watched, limit, &mut changes);
        if let Some(event) = found {
            if event[0].position < best {
                best = event[0].position;
                elder = (dense.together_by(best, member.age()), member.birth());
            }
            candidates.push((event, member.birth()));
        }
    }
    if best.is_infinite() {
        return Found { event: None, touched: Vec::new(), changes };
    }
    let together = dense.together(best);
    candidates.retain(|(event, birth)| {
        // Those born together have clocks that are as good as their age is short.
        let limit = if *birth == elder.1 { elder.0 } else { together };
        event[0].position <= limit
    });
    changes.retain(|change| change.position <= together);
    Found {
        event: Some(best),
        touched: candidates.into_iter().flat_map(|(event, _)| event).collect(),
        changes,
    }
}

/// Whether an atom's sign may change, judged by its bounds over the whole step.
fn may_change(
    rule: &Rule,
    member: &Member,
    atom: usize,
    sign: Sign,
    a: Interval,
    b: Interval,
    tolerance: f64,
) -> bool {
    if member.solve.is_some_and(|s| rule.solves[s].unreachable[atom]) {
        return false;
    }
    if a.is_empty() || b.is_empty() {
        return sign != Sign::Undefined;
    }
    if a.partial || b.partial {
        return true;
    }
    let (lo, hi) = (a.lo - b.hi, a.hi - b.lo);
    match sign {
        Sign::Plus => lo.is_nan() || lo <= tolerance,
        Sign::Minus => hi.is_nan() || hi >= -tolerance,
        Sign::Zero | Sign::Any => !(lo >= -tolerance && hi <= tolerance),
        Sign::Undefined => true,
    }
}

/// Follows one module's signs until something happens, at most to `limit`. Changes without consequence
/// are added to `changes`; an event is returned as the signs that are zero at it, the first one first.
#[allow(clippy::too_many_arguments)]
fn search_member(
    rule: &Rule,
    system: &System,
    dense: &Dense,
    member: &Member,
    signs: &[Sign],
    watched: &[(usize, f64)],
    limit: f64,
    changes: &mut Vec<Change>,
) -> Option<Vec<Change>> {
    let outputs = rule.sides.outputs();
    let constant = Dual::<Interval>::constant(0.0);
    let mut f = Difference {
        system,
        dense,
        member,
        sides: &rule.sides,
        atom: 0,
        bounds: Vec::new(),
        bounds_scratch: Vec::new(),
        bounds_out: vec![constant; outputs],
        values: Vec::new(),
        scratch: Vec::new(),
        out: vec![0.0; outputs],
    };
    let mut now = signs.to_vec();
    let mut next: Vec<Option<Root>> = Vec::new();
    for &(atom, tolerance) in watched {
        f.atom = atom;
        next.push(first_root(&mut f, 0.0, limit, now[atom], tolerance));
    }
    let mut rounds = 0;
    loop {
        rounds += 1;
        let position = next.iter().flatten().map(|r| r.position).reduce(f64::min)?;
        let together = dense.together(position);
        let mut at = now.clone();
        let mut after = now.clone();
        let mut group = Vec::new();
        for (&(atom, tolerance), root) in watched.iter().zip(&next) {
            f.atom = atom;
            // A touch is known only to about the root of the rounding; one that is zero here is here.
            let zero = f.value(position).abs() <= tolerance;
            let here = match root {
                Some(root) if root.position <= together => Some((root.at, root.after)),
                Some(root) if root.after == now[atom] && zero => Some((Sign::Zero, root.after)),
                None if zero && now[atom] != Sign::Zero => Some((Sign::Zero, now[atom])),
                _ => None,
            };
            if let Some(signs) = here {
                (at[atom], after[atom]) = signs;
                group.push(Change { id: member.id, atom, position, at: signs.0, after: signs.1 });
            }
        }
        // A condition that oscillates without end is cut into short steps, each of bounded work.
        if matters(rule, system, member, &at, &after) || rounds > MAX_ROUNDS {
            return Some(group);
        }
        changes.extend(&group);
        now = after;
        for (&(atom, tolerance), root) in watched.iter().zip(&mut next) {
            if group.iter().any(|change| change.atom == atom) {
                f.atom = atom;
                let from = root.map_or(position, |r| r.position.max(position));
                *root = first_root(&mut f, from, limit, now[atom], tolerance);
            }
        }
    }
}

/// Whether anything follows from the signs at an instant and just after it.
fn matters(rule: &Rule, system: &System, member: &Member, at: &[Sign], after: &[Sign]) -> bool {
    let holds =
        |condition: &crate::model::Condition, signs: &[Sign]| condition.judge(|i| signs[i]) == Truth::Yes;
    if rule.produces.iter().any(|p| holds(&p.guard, at) || holds(&p.guard, after)) {
        return true;
    }
    // The first `solve` that holds is active.
    if rule.solves.iter().position(|s| holds(&s.guard, after)) != member.solve {
        return true;
    }
    let Some(solve) = member.solve else { return false };
    rule.solves[solve]
        .switches
        .iter()
        .zip(system.switches(member))
        .any(|(switch, &on)| holds(&switch.condition, after) != (on != 0.0))
}
