//! Meetings of sides that are integrated: what is evidence of one, and what is not.
//!
//! An integrated value is known to some error, so a difference of two sides has a band around zero in which its sign says
//! nothing. A change of sign that stays within the band is no evidence of an event and none against one: neighbours that
//! equalise come as near each other as one likes and never meet, and their difference then turns about zero as
//! rounding has it. So
//!
//! - a crossing is one when the difference leaves the band on the other side, now or in a later step; its instant is where
//!   the sign changed;
//! - what stays in the band goes on with the sign it had;
//! - what comes from outside the band and leaves it on the side where it came from may have touched, or not: that is said
//!   ([`Error::InDoubt`](super::Error::InDoubt)) where something depends on it.
//!
//! A touch to the last digits counts as one, as everywhere. And all this is for productions: conditions inside equations
//! change where the integrated values have them change, or pieces of equations would be continued beyond their ends.
//!
//! Two modules of which one sees the other may have their events at one instant in truth, and at two instants as
//! integrated; then the second would see what the first has made. So when a module has its event, those that look at it and
//! are so near to theirs that the error of integration does not tell the two apart have it, too.

use crate::detect::crossing::{Crossing, CrossingDetector};
use crate::detect::signs::{half_width, opposite, sign_of};
use crate::world::path::Path;
use dlsys_expr::{Dual, Interval};
use dlsys_model::Sign;
use dlsys_ode::{Function, first_root};

/// The speed of a difference at a position is that around it, to as much of the path on both sides.
const NEARBY: f64 = 1e-6;

/// NextKind is never slower, on its way through the band, than this part of its mean speed goes on.
const STEADY: f64 = 0.5;

/// A difference so many times larger than what the sides may be wrong by is no matter of evidence.
pub const FAR: f64 = 1e3;

/// So many roundings of a difference that neighbours approach are nothing.
const BLUR: f64 = 4.0;

/// NextKind is ahead of an atom on a path.
#[derive(Clone, Copy, Debug, Default)]
pub struct Ahead {
    pub next: Option<Crossing>,
    /// Where the sides, before that, have come near each other and parted again.
    pub doubt: Option<f64>,
    /// At the end they are so near each other that their sign says nothing, and came there from where it did.
    pub near: bool,
}

/// A function that is higher by something.
struct Raised<'f, F>(&'f mut F, f64);

impl<F: Function> Function for Raised<'_, F> {
    fn bounds(&mut self, lo: f64, hi: f64) -> Dual<Interval> {
        let Dual { value, rate } = self.0.bounds(lo, hi);
        Dual { value: Interval { lo: value.lo + self.1, hi: value.hi + self.1, ..value }, rate }
    }

    fn value(&mut self, at: f64) -> f64 {
        self.0.value(at) + self.1
    }
}

/// NextKind is asked of one atom.
#[derive(Clone, Copy)]
pub struct Question {
    pub atom: usize,
    pub from: f64,
    pub limit: f64,
    /// Plus or minus.
    pub sign: Sign,
    /// NextKind rounding makes of the difference.
    pub tolerance: f64,
    /// The sides were near each other before, and had come there from outside.
    pub near: bool,
    /// A production may follow.
    pub decides: bool,
    /// NextKind integrated values may be wrong by, relative; 0 if there are none.
    pub error: f64,
}

impl CrossingDetector {
    /// Looks ahead for an atom of which something is integrated.
    pub fn look(&mut self, path: &Path, mut question: Question) -> Ahead {
        let Question { atom, limit, sign, tolerance, .. } = question;
        let side = sign_of(sign);
        let start = side * self.difference(path, atom).value(question.from);
        // Most are far from the band, and need not be told how wide it is.
        let [a, b] = [self.out[2 * atom], self.out[2 * atom + 1]];
        // `x - y` and 0 are small where `x` and `y` are not.
        let size = self.values.iter().fold(a.abs().max(b.abs()), |m, x| m.max(x.abs()));
        let is_far = start.abs() > FAR * question.error * size;
        let noise = if is_far { 0.0 } else { self.noise(path, atom, question.from) };
        // A neighbour's value is known to approach by nothing but the numbers, and these may meet at last by rounding.
        let around = path.rule.reads_context && !path.state.context.is_empty() && question.decides;
        let noise = if around { noise.max(BLUR * tolerance) } else { noise };
        // Equations change where their conditions do, however near that is: only a sign that is wrong already waits.
        let in_band = start.abs() <= noise && (question.decides || start <= 0.0);
        if noise > tolerance && in_band {
            // In the band: which way out?
            let up = self.leaves(path, question, noise, sign);
            let down = self.leaves(path, question, noise, opposite(sign));
            match (up, down) {
                (None, None) => return Ahead { near: question.near, ..Ahead::default() },
                (up, Some(down)) if up.is_none_or(|up| down < up) => {
                    let crossing = |crossings: &mut CrossingDetector| {
                        let f = &mut crossings.difference(path, atom);
                        first_root(f, question.from, down, sign, 0.0).map(|root| root.position)
                    };
                    let position = if start > 0.0 {
                        crossing(self).unwrap_or(question.from)
                    } else if self.heads(path, question, sign) {
                        // On the wrong side by the error, and on its way to the right one: it crosses when it comes back.
                        let f = &mut self.difference(path, atom);
                        let there = first_root(f, question.from, down, opposite(sign), 0.0);
                        let back = there.and_then(|root| first_root(f, root.position, down, sign, 0.0));
                        back.map_or(down, |root| root.position)
                    } else {
                        question.from
                    };
                    let crossing = CrossingDetector::crossing_at(path, position, opposite(sign));
                    return Ahead { next: Some(crossing), ..Ahead::default() };
                }
                (up, _) => {
                    let out = up.unwrap_or(limit);
                    if question.near {
                        return Ahead { doubt: Some(out), ..Ahead::default() };
                    }
                    (question.from, question.near) = (out, false);
                }
            }
        }
        let Question { from, .. } = question;
        let next = self.root(path, atom, from, limit, sign, tolerance);
        if let Some(Crossing { position, at: Sign::Zero, after, .. }) = next
            && (around && after != opposite(sign))
        {
            let band = BLUR * self.noise(path, atom, position).max(tolerance);
            if self.leaves(path, Question { from: position, ..question }, band, sign).is_none() {
                return Ahead { near: true, ..Ahead::default() };
            }
        }
        // One that leaves the domain, jumps, or touches to the last digits, is what it is.
        let crossing = match next {
            Some(crossing) if crossing.at != Sign::Zero || crossing.after != opposite(sign) => {
                return Ahead { next, ..Ahead::default() };
            }
            _ if !question.decides => return Ahead { next, ..Ahead::default() },
            Some(crossing) => crossing.position,
            None => limit,
        };
        let noise = self.noise(path, atom, crossing);
        let noise = if around { noise.max(BLUR * tolerance) } else { noise };
        let free = Ahead { next, ..Ahead::default() };
        if noise <= tolerance {
            return free;
        }
        // Near each other before they meet, or without crossing?
        let bounds = self.difference(path, atom).bounds(from, crossing);
        let straight = !bounds.rate.partial && (bounds.rate.lo > 0.0 || bounds.rate.hi < 0.0);
        if next.is_none() || !straight {
            let before = Question { from, limit: crossing, ..question };
            if let Some(enters) = self.falls_below(path, before, noise) {
                let inside = Question { from: enters, ..before };
                if let Some(out) = self.leaves(path, inside, noise, sign) {
                    return Ahead { doubt: Some(out), ..Ahead::default() };
                }
                if next.is_none() {
                    return Ahead { near: true, ..Ahead::default() };
                }
            } else if next.is_none() {
                return free;
            }
        }
        // Does it go on to the other side?
        if side * self.difference(path, atom).value(limit) < -noise {
            return free;
        }
        let beyond = Question { from: crossing, ..question };
        let down = self.leaves(path, beyond, noise, opposite(sign));
        match (down, self.leaves(path, beyond, noise, sign)) {
            (Some(down), up) if up.is_none_or(|up| down < up) => free,
            (_, Some(out)) => Ahead { doubt: Some(out), ..Ahead::default() },
            // The path ends too soon to tell. NextKind passes as fast as it came is not about to stay.
            _ if self.passes(path, Question { limit: crossing, ..question }, noise) => free,
            _ => Ahead { near: true, ..Ahead::default() },
        }
    }

    /// True if the difference comes from outside the band on this path and crosses zero, at the limit, at a steady speed: what
    /// only approaches zero is slower the nearer it is.
    fn passes(&mut self, path: &Path, question: Question, noise: f64) -> bool {
        let Some(enters) = self.falls_below(path, question, noise) else { return false };
        let crossing = question.limit;
        let rate = self.difference(path, question.atom).bounds(enters, crossing).rate;
        let speed = (-sign_of(question.sign) * rate.lo).min(-sign_of(question.sign) * rate.hi);
        !rate.partial && speed * (crossing - enters) > STEADY * noise
    }

    /// True if the difference moves towards a side at first.
    fn heads(&mut self, path: &Path, question: Question, towards: Sign) -> bool {
        let end = (question.from + NEARBY).min(question.limit);
        let rate = self.difference(path, question.atom).bounds(question.from, end).rate;
        !rate.partial && sign_of(towards) * rate.lo > 0.0 && sign_of(towards) * rate.hi > 0.0
    }

    /// Where the difference, on its side, becomes less than the noise.
    fn falls_below(&mut self, path: &Path, question: Question, noise: f64) -> Option<f64> {
        let Question { atom, from, limit, sign, tolerance, .. } = question;
        let f = &mut self.difference(path, atom);
        let root = first_root(&mut Raised(f, -sign_of(sign) * noise), from, limit, sign, tolerance)?;
        (root.after == opposite(sign)).then_some(root.position)
    }

    /// Where the difference leaves the band on a side.
    fn leaves(&mut self, path: &Path, question: Question, noise: f64, towards: Sign) -> Option<f64> {
        let Question { atom, from, limit, tolerance, .. } = question;
        let f = &mut self.difference(path, atom);
        let raised = &mut Raised(f, -sign_of(towards) * noise);
        let mut from = from;
        // Touching the edge of the band is not leaving it.
        for _ in 0..8 {
            let root = first_root(raised, from, limit, opposite(towards), tolerance)?;
            if root.after == towards || root.position <= from {
                return (root.after == towards).then_some(root.position);
            }
            from = root.position;
        }
        None
    }

    /// NextKind the errors of integration and rounding make of the difference of two sides. Zero where it jumps.
    pub fn noise(&mut self, path: &Path, atom: usize, at: f64) -> f64 {
        path.uncertain(at, &mut self.around);
        let sides = &path.rule.sides;
        self.around_out.resize(sides.outputs(), Interval::EMPTY);
        sides.eval(&self.around, &mut self.whole_scratch, &mut self.around_out);
        half_width(self.around_out[2 * atom], self.around_out[2 * atom + 1])
    }

    /// True if the sides of an atom approach each other, and are no further apart than so many errors of integration.
    pub fn is_about_to_meet(&mut self, path: &Path, atom: usize, sign: Sign, factor: f64) -> bool {
        let gap = sign_of(sign) * self.difference(path, atom).value(0.0);
        if gap > FAR * factor * path.error() * (1.0 + gap) || gap > factor * self.noise(path, atom, 0.0) {
            return false;
        }
        let rate = self.difference(path, atom).bounds(0.0, 1.0).rate;
        sign_of(sign) * rate.lo < 0.0 && sign_of(sign) * rate.hi < 0.0
    }

    /// A crossing at a position.
    fn crossing_at(path: &Path, position: f64, after: Sign) -> Crossing {
        let time = path.start.after(position * path.h);
        Crossing { position, time, at: Sign::Zero, after, level: None }
    }

    /// How much earlier or later a crossing may be, in units of position, given the errors of integration.
    pub fn slack(&mut self, path: &Path, atom: usize, position: f64) -> f64 {
        let noise = self.noise(path, atom, position);
        let (lo, hi) = ((position - NEARBY).max(0.0), (position + NEARBY).min(1.0));
        let Dual { rate, .. } = self.difference(path, atom).bounds(lo, hi);
        let speed = rate.lo.abs().min(rate.hi.abs());
        if rate.partial || rate.lo.is_nan() || rate.lo * rate.hi <= 0.0 {
            return 0.0;
        }
        // Not more than a small part of the time in which things change.
        (noise / speed).min(10.0 * path.error())
    }
}
