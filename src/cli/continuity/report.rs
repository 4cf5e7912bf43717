//! The largest jumps of each production, and a verdict.

use std::fmt::Write;

use super::measure::{Jump, Sides};
use crate::session::Session;
use crate::sim::{Event, brief};

/// Smallest scale of sizes and speeds, relative to the largest in the run.
const FLOOR: f64 = 1e-3;

/// Continuity of a production.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Verdict {
    /// Neither the drawing nor its speed jumps.
    C1,
    /// Only the speed jumps.
    C0,
    Discontinuous,
}

/// All productions of a run.
pub struct Report<'s> {
    session: &'s Session,
    end: f64,
    tolerance: f64,
    /// Findings for each rule and clause.
    productions: Vec<Vec<Production>>,
    /// Smallest scale of each quantity.
    floors: [f64; 7],
}

#[derive(Clone, Default)]
struct Production {
    fired: usize,
    /// Number of times that it replaced a module made at the same instant.
    followed_on: usize,
    /// Number of times without a speed before it.
    without_speed: usize,
    /// Largest number of productions of one instant that were taken together with it.
    cascade: usize,
    /// Candidates for jumps.
    jumps: Vec<Jump>,
}

/// The quantities that are compared, in the order of the report.
const NAMES: [&str; 7] =
    ["position", "heading", "roll", "length", "speed of position", "speed of direction", "speed of length"];
/// Index of the first speed.
const FIRST_SPEED: usize = 4;
const UNITS: [&str; 7] = ["", "°", "°", "", "", "°", ""];

/// The values of these quantities for one jump.
fn quantities(jump: &Jump) -> [Option<Sides>; 7] {
    let Jump { position, heading, roll, length, speeds, .. } = *jump;
    let [p, d, l] = match speeds {
        Some(s) => [s.position, s.direction, s.length].map(Some),
        None => [None; 3],
    };
    [Some(position), Some(heading), Some(roll), Some(length), p, d, l]
}

/// The scale of the jump of a quantity, unless it is too small: the larger length, or the larger speed.
fn size(jump: &Jump, quantity: usize, sides: Sides) -> f64 {
    match quantity {
        0 | 3 => jump.size,
        1 | 2 => 0.0,
        _ => sides.before.abs().max(sides.after.abs()),
    }
}

/// The worst jump of a quantity.
#[derive(Clone, Copy)]
struct Worst {
    sides: Sides,
    relative: f64,
    time: f64,
}

impl<'s> Report<'s> {
    pub fn new(session: &'s Session, end: f64, tolerance: f64) -> Report<'s> {
        let rules = &session.model.rules;
        let productions = rules.iter().map(|rule| vec![Production::default(); rule.produces.len()]).collect();
        // Jumps of angles are in radians.
        let radian = 1f64.to_degrees();
        let mut floors = [f64::MIN_POSITIVE; 7];
        (floors[1], floors[2]) = (radian, radian);
        Report { session, end, tolerance, productions, floors }
    }

    /// Adds an event, and its jump unless that is included in the jump of another event.
    pub fn add(&mut self, event: &Event, jump: Option<Jump>) {
        let production = &mut self.productions[event.rule][event.clause];
        production.fired += 1;
        let Some(jump) = jump else {
            production.followed_on += 1;
            return;
        };
        production.without_speed += usize::from(jump.speeds.is_none());
        production.cascade = production.cascade.max(jump.cascade);
        let mut seen = false;
        for (i, sides) in quantities(&jump).into_iter().enumerate() {
            let Some(sides) = sides else { continue };
            let size = size(&jump, i, sides);
            self.floors[i] = self.floors[i].max(FLOOR * size);
            seen |= sides.jump > self.tolerance * size.max(f64::MIN_POSITIVE);
        }
        // A jump that is negligible on its own scale is negligible on a larger one.
        if seen {
            production.jumps.push(jump);
        }
    }

    fn worst(&self, production: &Production) -> [Option<Worst>; 7] {
        let mut worst = [None; 7];
        for jump in &production.jumps {
            for (i, sides) in quantities(jump).into_iter().enumerate() {
                let Some(sides) = sides else { continue };
                let relative = sides.jump / size(jump, i, sides).max(self.floors[i]);
                // Of jumps that are equal up to rounding, the first is reported.
                let more = worst[i].is_none_or(|w: Worst| relative > w.relative * (1.0 + 1e-6));
                if more {
                    worst[i] = Some(Worst { sides, relative, time: jump.time });
                }
            }
        }
        worst
    }

    /// The report as text, and the worst verdict.
    pub fn show(&self) -> (String, Verdict) {
        let mut out = String::new();
        let Session { source, model, .. } = self.session;
        let _ = writeln!(
            out,
            "\nContinuity of productions, t = 0 to {}; relative jumps up to {:e} are none\n",
            self.end, self.tolerance
        );
        let mut counts = [0; 3];
        let mut never = Vec::new();
        for (rule, productions) in model.rules.iter().zip(&self.productions) {
            for (clause, production) in rule.produces.iter().zip(productions) {
                let line = source.position(clause.span.start).0;
                let name = format!("{}, line {line}", rule.label);
                if production.fired == 0 {
                    never.push(name);
                    continue;
                }
                let verdict = self.production(&name, production, &mut out);
                counts[verdict as usize] += usize::from(production.fired > production.followed_on);
            }
        }
        for name in never {
            let _ = writeln!(out, "{name}: never fired");
        }
        let _ = writeln!(out, "\n{} C1, {} C0 only, {} discontinuous", counts[0], counts[1], counts[2]);
        let worst = match counts {
            [_, 0, 0] => Verdict::C1,
            [_, _, 0] => Verdict::C0,
            _ => Verdict::Discontinuous,
        };
        (out, worst)
    }

    fn production(&self, name: &str, production: &Production, out: &mut String) -> Verdict {
        let worst = self.worst(production);
        let jumps = |i: usize| worst[i].is_some_and(|w| w.relative > self.tolerance);
        let verdict = match () {
            () if (0..FIRST_SPEED).any(jumps) => Verdict::Discontinuous,
            () if (FIRST_SPEED..7).any(jumps) => Verdict::C0,
            () => Verdict::C1,
        };
        let says = match verdict {
            _ if production.fired == production.followed_on => "judged with what made its predecessor",
            Verdict::C1 => "C1",
            Verdict::C0 => "C0 only",
            Verdict::Discontinuous => "discontinuous",
        };
        let times = if production.fired == 1 { "time" } else { "times" };
        let _ = writeln!(out, "{name}: fired {} {times}; {says}", production.fired);
        for i in 0..7 {
            let Some(w) = worst[i].filter(|w| w.relative > self.tolerance) else { continue };
            let Sides { before, after, jump } = w.sides;
            let unit = UNITS[i];
            // The norm of a position is not informative.
            let sides = match i {
                0..=2 => String::new(),
                _ => format!("{}{unit} -> {}{unit}", brief(before, 5), brief(after, 5)),
            };
            let relative = match i {
                1 | 2 => String::new(),
                _ => format!("({}%)", brief(100.0 * w.relative, 3)),
            };
            let by = format!("{}{unit}", brief(jump, 5));
            let at = format!("at t = {}", brief(w.time, 6));
            let row = format!("    {:19} {sides:24} by {by:12} {relative:10} {at}", NAMES[i]);
            let _ = writeln!(out, "{}", row.trim_end());
        }
        let first = production.without_speed;
        if first > 0 {
            let _ = writeln!(out, "    {first} at t = 0: there is no speed before it to compare with");
        }
        let more = production.cascade;
        if more > 0 {
            let _ =
                writeln!(out, "    taken together with up to {more} more productions at the same instant");
        }
        if (1..production.fired).contains(&production.followed_on) {
            let n = production.followed_on;
            let _ = writeln!(out, "    {n} of them are judged with what made their predecessor");
        }
        verdict
    }
}
