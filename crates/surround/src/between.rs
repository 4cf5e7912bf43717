//! The wind for steps that are shorter than its turbulence asks for.
//!
//! ```text
//! tick n                                     tick n+1
//! ●─────────●─────────●─────────●────────────●     instants: each costs as much as thousands of places in it
//!     ▲▲▲▲▲▲                                       steps of stems: between instants, as a cubic has it
//! ```
//!
//! Instants divide a tick into as many parts as the turbulence asks for at the speed of that tick, a power of two as those of steps. Steps that
//! are long enough read the wind at instants only, to the same bits as without this. Which times are instants follows from the wind alone, so that velocities are a pure function of
//! place and time.

use dlsys_wind::Field;

use crate::CLOCK;

/// A tick has at least two to the power of this many parts, so that its longest steps, and those of half of it, read instants only: steps read the
/// wind at both ends and in the middle.
const FEWEST: u32 = 2;
/// Where it takes more parts than two to this power, steps read instants only.
const MOST: u32 = 6;
/// Steps of a smaller tolerance read instants only: between them, turbulence has errors that are part of a field of its own.
const FINEST: f64 = 1e-3;
/// Steps of more segments than this read instants only: a place between instants costs as much as four at one.
const MOST_SEGMENTS: usize = 1000;
/// A time that is nearer than this to an instant, in parts of a tick, is one itself.
const ROUNDING: f64 = 1e-6;

/// The instants around a time, in s, of which the turbulence is made there, and how many intervals after the first of them it is.
pub(crate) struct Around {
    pub(crate) times: [f64; 4],
    pub(crate) place: f64,
}

/// Whether steps of this tolerance, with so many segments, may read the wind between instants.
pub(crate) fn serves(tolerance: f64, segments: usize) -> bool {
    tolerance >= FINEST && segments <= MOST_SEGMENTS
}

/// The parts of a tick as a power of two; `None` where there is nothing to interpolate, or too much.
pub(crate) fn parts(field: &Field, tick: f64) -> Result<Option<u32>, dlsys_wind::Error> {
    let Some(longest) = field.resolved(tick * CLOCK, (tick + 1.0) * CLOCK)? else { return Ok(None) };
    Ok((FEWEST..=MOST).find(|power| CLOCK / f64::from(1 << power) <= longest))
}

/// The tick of a time in s.
pub(crate) fn tick_of(time: f64) -> f64 {
    let tick = (time / CLOCK).round();
    if (time / CLOCK - tick).abs() < ROUNDING { tick } else { (time / CLOCK).floor() }
}

/// The instants around a time in a tick that has as many parts; `None` for an instant.
pub(crate) fn around(time: f64, parts: u32) -> Option<Around> {
    // As steps have it, so that their ends are instants to the last bit.
    let interval = CLOCK / f64::from(1 << parts);
    let place = time / interval;
    if (place - place.round()).abs() < ROUNDING {
        return None;
    }
    // No wind is asked for before t = 0.
    let first = (place.floor() - 1.0).max(0.0);
    let times = [0.0, 1.0, 2.0, 3.0].map(|i| (first + i) * interval);
    Some(Around { times, place: place - first })
}

#[cfg(test)]
mod tests {
    use super::*;
    use dlsys_wind::{Description, Signal};
    use nalgebra::Vector3;

    fn field(speed: f64, turbulence: f64) -> Field {
        let speed = Signal::function(move |t| if t < 1.0 { speed } else { 10.0 * speed });
        let description = Description { turbulence, ..Description::new(Vector3::x(), speed) };
        Field::new(description).expect("a wind")
    }

    #[test]
    fn ticks_have_the_parts_that_the_wind_asks_for() {
        let parts = |speed, tick| parts(&field(speed, 0.3), tick).expect("a speed");
        assert_eq!(parts(0.5, 3.0), Some(FEWEST));
        let (slow, fast) = (parts(3.0, 3.0).expect("few"), parts(3.0, 40.0).expect("more"));
        assert!(slow < fast && fast <= MOST, "{slow} {fast}");
        assert_eq!(parts(100.0, 40.0), None, "too fast");
        assert_eq!(super::parts(&field(3.0, 0.0), 3.0).expect("a speed"), None, "no turbulence");
    }

    /// Steps end at multiples of their length, and read the wind in their middle: those that are long enough meet instants.
    #[test]
    fn long_steps_read_instants_and_short_ones_what_is_between_four() {
        for tick in [0u32, 1, 7, 1000, 123_456] {
            let from = f64::from(tick) * CLOCK;
            assert_eq!(tick_of(from), f64::from(tick));
            assert_eq!(tick_of(from + 0.9 * CLOCK), f64::from(tick));
            for share in [0.0, 0.25, 0.5, 0.75, 1.0] {
                assert!(around(from + share * CLOCK, 2).is_none(), "{tick} {share}");
            }
            for share in [0.125, 0.3, 0.5001, 0.99] {
                let time = from + share * CLOCK;
                let Around { times, place } = around(time, 2).expect("between instants");
                assert!(times.is_sorted() && times[0] >= 0.0);
                assert!(tick == 0 || times[1] < time && time < times[2]);
                let spacing = times[1] - times[0];
                assert!((times[0] + place * spacing - time).abs() < 1e-9 && (0.0..3.0).contains(&place));
            }
        }
    }
}
