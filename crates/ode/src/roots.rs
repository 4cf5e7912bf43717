//! The first change of sign of a function over a step, found by exclusion.
//!
//! The function is known through bounds over any stretch of the step. A stretch on which the bounds
//! exclude zero is passed; one on which the rate has a single sign holds at most one root, which its ends
//! show; any other is halved (Moore 1966; Shampine, Gladwell and Brankin 1991 do the same for
//! polynomials with Sturm sequences). So no pair of crossings inside a step is missed, and a touch is found
//! where a sign test sees nothing.
//!
//! # Contract
//!
//! - The sign just after the start of the search is given by the caller (`Sign::Any` if not known). A zero
//!   at the start itself is not a root: it belongs to the search before.
//! - The first root is returned: an instant at which the sign becomes another, or zero is touched.
//! - Zero means within `tolerance`, which should stand for the rounding of the function's values.
//! - Work is bounded: after `MAX_PIECES` stretches the rest is judged by the signs at a few places and at the extremes between them. A function that varies fast gives the length of a
//!   part of the step that is searched with so many of them.

use dlsys_expr::Sign;
use dlsys_expr::{Dual, Interval};

/// Stretches narrower than this part of their position are not halved.
const NARROW: f64 = 1e-13;
/// Nor are those that end before this.
const SMALL: f64 = 1e-30;
const MAX_PIECES: usize = 1024;
/// The parts of each of the stretches that are left then, at whose ends the function is evaluated.
const PARTS: usize = 16;

/// A function over a step, for positions 0 to 1.
pub trait Function {
    /// Bounds of the value and of its rate from `lo` to `hi`.
    fn bounds(&mut self, lo: f64, hi: f64) -> Dual<Interval>;
    /// The value at a position; NaN where it is undefined.
    fn value(&mut self, at: f64) -> f64;
    /// True if it is known to be defined everywhere. It may jump all the same.
    fn is_total(&self) -> bool {
        false
    }
    /// The length of a part of the step within which the function does not vary often.
    fn stretch(&self) -> f64 {
        f64::INFINITY
    }
}

/// A root found by [`first_root`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Root {
    /// Where in the step, from 0 to 1.
    pub position: f64,
    /// The sign at the root: zero, unless the function jumps over it.
    pub at: Sign,
    /// The sign just after the root; the same as before where zero is only touched.
    pub after: Sign,
}

/// Finds the first root in `(from, to]`; see the contract above.
pub fn first_root(f: &mut impl Function, from: f64, to: f64, start: Sign, tolerance: f64) -> Option<Root> {
    let mut search = Search { f, to, tolerance, sign: start, armed: false, total: None };
    let first = search.sign_at(from);
    if first != Sign::Zero && search.sign == Sign::Any {
        search.sign = first;
    }
    // Where it is undefined from here on it may be defined here.
    if first != Sign::Zero && first != search.sign && search.sign != Sign::Undefined {
        return Some(Root { position: from, at: Sign::Zero, after: first });
    }
    // Off zero: a root from here on is one that was not there before.
    search.armed = first != Sign::Zero;
    let stretch = search.f.stretch().max(NARROW);
    let (mut begin, mut stack) = (from, Vec::new());
    loop {
        let end = if begin + stretch < to { begin + stretch } else { to };
        let (mut next, mut pieces) = (Some((begin, end)), 0);
        while let Some((lo, hi)) = next {
            pieces += 1;
            next = match search.examine(lo, hi, pieces > MAX_PIECES) {
                Finding::Nothing => stack.pop(),
                Finding::Root(root) => return Some(root),
                Finding::Halve => {
                    let middle = 0.5 * (lo + hi);
                    stack.push((middle, hi));
                    Some((lo, middle))
                }
            }
        }
        if end == to {
            return None;
        }
        begin = end;
    }
}

/// The state of a search, which goes from stretch to stretch in the order of position.
struct Search<'f, F> {
    f: &'f mut F,
    to: f64,
    tolerance: f64,
    /// The sign up to here.
    sign: Sign,
    /// The function was off zero somewhere up to here.
    armed: bool,
    /// The function is known to be defined everywhere, once that has been asked.
    total: Option<bool>,
}

/// The result of a look at a stretch.
enum Finding {
    /// It holds no root.
    Nothing,
    Root(Root),
    /// Bounds are too wide to tell: its halves are to be searched.
    Halve,
}

impl<F: Function> Search<'_, F> {
    fn classify(&self, g: f64) -> Sign {
        if g.abs() <= self.tolerance { Sign::Zero } else { Sign::of(g) }
    }

    fn is_total(&mut self) -> bool {
        *self.total.get_or_insert_with(|| self.f.is_total())
    }

    fn sign_at(&mut self, at: f64) -> Sign {
        let g = self.f.value(at);
        self.classify(g)
    }

    /// Searches a stretch; if it is the `last`, it is judged by its ends.
    fn examine(&mut self, lo: f64, hi: f64, last: bool) -> Finding {
        let (sign, tolerance) = (self.sign, self.tolerance);
        let Dual { value: mut g, rate } = self.f.bounds(lo, hi);
        if g.is_empty() {
            return match sign {
                Sign::Undefined => Finding::Nothing,
                _ => Finding::Root(Root { position: lo, at: Sign::Undefined, after: Sign::Undefined }),
            };
        }
        if !rate.partial && !g.partial {
            // The mean value theorem often bounds more tightly than the expression itself.
            let (centre, reach) = (self.f.value(0.5 * (lo + hi)), 0.5 * (hi - lo) * rate.magnitude());
            if centre.is_finite() && reach.is_finite() {
                g.lo = g.lo.max(centre - reach);
                g.hi = g.hi.min(centre + reach);
            }
        }
        let settled = match sign {
            Sign::Plus => g.lo > tolerance,
            Sign::Minus => g.hi < -tolerance,
            Sign::Zero | Sign::Any => g.magnitude() <= tolerance,
            Sign::Undefined => false,
        };
        // What jumps without meeting zero is no root, as far as it is defined.
        if settled && (!g.partial || self.is_total()) {
            self.armed |= matches!(sign, Sign::Plus | Sign::Minus);
            return Finding::Nothing;
        }
        let monotone = !rate.partial && !g.partial && (rate.lo > 0.0 || rate.hi < 0.0);
        let narrow = hi - lo <= NARROW * hi || hi <= SMALL || last;
        if !monotone && !narrow {
            return Finding::Halve;
        }
        let end = self.sign_at(hi);
        let found = if !self.armed {
            self.leave_zero(lo, hi, end)
        } else {
            let monotone_rate = monotone.then_some(rate);
            match self.jumped(lo).or_else(|| self.crossing(lo, hi, end, monotone_rate)) {
                None if monotone => None,
                None if last => self.judge(lo, hi),
                None => self.touch(lo, hi, end),
                crossing => crossing,
            }
        };
        found.map_or(Finding::Nothing, Finding::Root)
    }

    /// A jump at the beginning of a stretch: the bounds of the stretch before, which excluded it, are those of values that are rounded
    /// another way.
    fn jumped(&mut self, lo: f64) -> Option<Root> {
        let there = self.sign_at(lo);
        let jumps = matches!(self.sign, Sign::Plus | Sign::Minus) && there == opposite(self.sign);
        jumps.then_some(Root { position: lo, at: there, after: there })
    }

    /// A change of sign in a stretch that is narrow, or monotone with a `rate` of one sign, and has the sign `end` at its end.
    fn crossing(&mut self, lo: f64, hi: f64, end: Sign, rate: Option<Interval>) -> Option<Root> {
        let (sign, monotone) = (self.sign, rate.is_some());
        // Exactly: a value that merely comes within the tolerance may be about to cross.
        let exact = Sign::of(self.f.value(hi));
        // At the very end of the stretch, if it is about to cross within the rounding of the position.
        if monotone && hi >= self.to && exact == sign && end == Sign::Zero {
            let rate = self.f.bounds(lo.max(hi - 1e-9 * hi), hi).rate;
            let steep = rate.lo.abs().min(rate.hi.abs()) * 16.0 * f64::EPSILON * hi;
            if self.f.value(hi).abs() <= steep && (rate.hi < 0.0) == (sign == Sign::Plus) {
                return Some(Root { position: hi, at: Sign::Zero, after: opposite(sign) });
            }
        }
        let crossed = if monotone { exact != sign } else { end != sign && end != Sign::Zero };
        if !crossed {
            return None;
        }
        let position = bracket(self.f, lo, hi, sign);
        // It jumps where its bounds say that it does not, as above.
        let step = match rate {
            // What moves away from zero and is on its other side then has been through infinity.
            Some(rate) if (sign == Sign::Plus && rate.lo > 0.0) || (sign == Sign::Minus && rate.hi < 0.0) => {
                0.0
            }
            Some(rate) if rate.magnitude().is_finite() => 16.0 * f64::EPSILON * hi * rate.magnitude(),
            // Through infinity, or as steep as that.
            Some(_) => 0.0,
            None => f64::INFINITY,
        };
        let there = self.f.value(position);
        if there.abs() > self.tolerance + step && Sign::of(there) == exact {
            return Some(Root { position, at: exact, after: exact });
        }
        if monotone {
            // One that ends on zero may turn back there, or rest.
            let after = if exact == Sign::Zero { self.way_out(hi).1 } else { exact };
            return Some(Root { position, at: Sign::Zero, after });
        }
        // Too narrow to see how it gets from one side to the other: it jumps, or as good as.
        let near = [self.f.value(lo), self.f.value(position)];
        let is_near = near.into_iter().any(|g| self.classify(g) == Sign::Zero);
        Some(Root { position, at: if is_near { Sign::Zero } else { exact }, after: exact })
    }

    /// An extremum on zero, or within the tolerance, in a narrow stretch that has the sign `end` at its end.
    fn touch(&mut self, lo: f64, hi: f64, end: Sign) -> Option<Root> {
        let (sign, middle) = (self.sign, 0.5 * (lo + hi));
        let seen = [(middle, self.sign_at(middle)), (hi, end)];
        let at = match seen.into_iter().find(|(_, seen)| *seen == Sign::Zero) {
            Some((at, _)) => at,
            // A corner may touch zero between them.
            None => self.extreme(lo, hi).filter(|at| self.sign_at(*at) == Sign::Zero)?,
        };
        // A kink in a crossing looks like one, as far as its value is zero.
        let (beyond, after) = self.way_out(at);
        let position = if after == opposite(sign) {
            if Sign::of(self.f.value(lo)) == sign { bracket(self.f, lo, beyond, sign) } else { lo }
        } else if after == Sign::Zero {
            // It stays there: from where it is as small as it gets.
            let least = 2.0 * self.f.value(beyond).abs();
            first_where(lo, beyond, |x| self.f.value(x).abs() <= least)
        } else {
            first_where(lo, at, |x| self.sign_at(x) == Sign::Zero)
        };
        Some(Root { position, at: Sign::Zero, after })
    }

    /// A root in a stretch that cannot be halved any more, as far as its parts and the extremes in them show one.
    fn judge(&mut self, lo: f64, hi: f64) -> Option<Root> {
        let mut from = lo;
        for i in 1..=PARTS {
            let to = if i == PARTS { hi } else { lo + (hi - lo) * (i as f64 / PARTS as f64) };
            for at in [self.extreme(from, to), Some(to)].into_iter().flatten() {
                let end = self.sign_at(at);
                let root = self.crossing(from, at, end, None).or_else(|| self.touch(from, at, end));
                if root.is_some() {
                    return root;
                }
            }
            from = to;
        }
        None
    }

    /// The place nearest to zero of a stretch at whose ends the function goes towards zero and away from it.
    fn extreme(&mut self, mut lo: f64, mut hi: f64) -> Option<f64> {
        let towards = if self.sign == Sign::Plus { -1.0 } else { 1.0 };
        let mut comes = |at: f64| {
            let rate = self.f.bounds(at, at).rate;
            towards * (0.5 * (rate.lo + rate.hi)) > 0.0
        };
        if !comes(lo) || comes(hi) {
            return None;
        }
        while hi - lo > f64::EPSILON * hi {
            let middle = 0.5 * (lo + hi);
            if middle <= lo || middle >= hi {
                break;
            }
            if comes(middle) { lo = middle } else { hi = middle }
        }
        Some(hi)
    }

    /// The end of a zero that has lasted since the start of the search, in a stretch that has the sign `end` at its end.
    fn leave_zero(&mut self, lo: f64, hi: f64, end: Sign) -> Option<Root> {
        if end == Sign::Zero {
            return None;
        }
        if self.sign == Sign::Any {
            self.sign = end;
        }
        if end == self.sign {
            self.armed = true;
            return None;
        }
        // It leaves zero continuously, or it jumps.
        let position = first_where(lo, hi, |x| self.sign_at(x) != Sign::Zero);
        let (there, later) = (self.f.value(position).abs(), self.f.value(hi).abs());
        let jumps = there > 4.0 * self.tolerance && there > 0.5 * later && later.is_finite();
        Some(match self.sign == Sign::Undefined || jumps {
            true => Root { position, at: end, after: end },
            false => Root { position: lo, at: Sign::Zero, after: end },
        })
    }

    /// The nearest position found after a zero at `at` where the function is no longer zero, and its sign there; the sign is zero if
    /// there is none nearby.
    fn way_out(&mut self, at: f64) -> (f64, Sign) {
        /// A function that is zero up to here, relative to the position, stays zero.
        const NEARBY: f64 = 1e-6;
        let (size, mut reach) = (at.max(SMALL), NARROW * at.max(SMALL));
        loop {
            let position = (at + reach).min(self.to);
            let sign = self.sign_at(position);
            if sign != Sign::Zero || position >= self.to || reach > NEARBY * size {
                return (position, sign);
            }
            reach *= 2.0;
        }
    }
}

/// The first position at which a condition holds that holds at `hi` and need not hold at `lo`, by bisection.
fn first_where(mut lo: f64, mut hi: f64, mut holds: impl FnMut(f64) -> bool) -> f64 {
    while hi - lo > f64::EPSILON * hi {
        let middle = 0.5 * (lo + hi);
        if middle <= lo || middle >= hi {
            break;
        }
        if holds(middle) {
            hi = middle;
        } else {
            lo = middle;
        }
    }
    hi
}

fn opposite(sign: Sign) -> Sign {
    match sign {
        Sign::Plus => Sign::Minus,
        Sign::Minus => Sign::Plus,
        other => other,
    }
}

/// The first position in `(lo, hi]` at which the sign is no longer `sign`, to the last bit.
///
/// False position with halved ends (Illinois; Dowell and Jarratt 1971), and bisection where that is slow.
fn bracket(f: &mut impl Function, mut lo: f64, mut hi: f64, sign: Sign) -> f64 {
    let (mut g_lo, mut g_hi) = (f.value(lo), f.value(hi));
    for i in 0..200 {
        if hi - lo <= f64::EPSILON * hi {
            break;
        }
        let guess = hi - g_hi * (hi - lo) / (g_hi - g_lo);
        let bisect = i % 4 == 3 || !(guess > lo && guess < hi);
        // A stretch may be longer than the way to the root by any number of decades.
        let at = match bisect {
            true if lo == 0.0 => 1e-3 * hi,
            true if hi > 16.0 * lo => (lo * hi).sqrt(),
            true => 0.5 * (lo + hi),
            false => guess,
        };
        if at <= lo || at >= hi {
            break;
        }
        let g = f.value(at);
        if Sign::of(g) == sign {
            (lo, g_lo) = (at, g);
            if !bisect {
                g_hi *= 0.5;
            }
        } else {
            (hi, g_hi) = (at, g);
            if !bisect {
                g_lo *= 0.5;
            }
            if g == 0.0 {
                break;
            }
        }
    }
    hi
}

#[cfg(test)]
mod tests;
