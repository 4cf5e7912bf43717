//! A second computation of plates: the equations of Andersen, Pesavento and Wang in the plane, without units, as they stand in their papers.
//!
//! It shares nothing with the rest of the crate: the equations stand in axes along the chord and the normal, and are integrated by the classical
//! method of Runge and Kutta with one step. Lengths are in half chords a, velocities in U with U² = weight per span/(π ρ a).

/// Velocity along the chord and the normal, angle, rate of the angle, and horizontal and vertical place.
type State = [f64; 6];

/// Length of a step.
const STEP: f64 = 1e-3;

/// Quantities of a fall in the plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Planar {
    /// Time of a period, or of a turn.
    pub period: f64,
    /// Mean velocity downward.
    pub fall: f64,
}

fn rates(state: &State, ratio: f64) -> State {
    let [vx, vy, angle, spin, ..] = *state;
    let speed = vx.hypot(vy);
    let [mut circulation, mut drag] = [2.0 * spin, 0.0];
    if speed > 0.0 {
        circulation -= 2.0 / std::f64::consts::PI * 1.2 * vx * vy / speed;
        drag = speed / std::f64::consts::PI * (1.4 - (vx * vx - vy * vy) / (speed * speed));
    }
    let (sine, cosine) = angle.sin_cos();
    [
        ((ratio + 1.0) * spin * vy - circulation * vy - sine - drag * vx) / ratio,
        (-ratio * spin * vx + circulation * vx - cosine - drag * vy) / (ratio + 1.0),
        spin,
        (-vx * vy - (0.2 + 0.2 * spin.abs()) * spin) / (0.25 * (ratio + 0.5)),
        vx * cosine - vy * sine,
        vx * sine + vy * cosine,
    ]
}

fn plus(state: &State, rates: &State, h: f64) -> State {
    std::array::from_fn(|i| state[i] + h * rates[i])
}

fn step(state: &State, ratio: f64) -> State {
    let a = rates(state, ratio);
    let b = rates(&plus(state, &a, STEP / 2.0), ratio);
    let c = rates(&plus(state, &b, STEP / 2.0), ratio);
    let d = rates(&plus(state, &c, STEP), ratio);
    std::array::from_fn(|i| state[i] + STEP / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]))
}

/// Instants (time, height) at which the angle passes `level(n)` for n = 0, 1, … upward, of a plate released at rest with an angle.
fn passages(ratio: f64, angle: f64, level: fn(usize) -> f64, count: usize) -> Vec<(f64, f64)> {
    let mut state = [0.0, 0.0, angle, 0.0, 0.0, 0.0];
    let mut found = Vec::new();
    // Far more than is needed: a plate that neither flutters nor tumbles ends the search.
    for k in 0..10_000_000_u32 {
        let next = step(&state, ratio);
        let wanted = level(found.len());
        if state[2] < wanted && next[2] >= wanted {
            let share = (wanted - state[2]) / (next[2] - state[2]);
            found.push(((f64::from(k) + share) * STEP, state[5] + share * (next[5] - state[5])));
            if found.len() == count {
                break;
            }
        }
        state = next;
    }
    found
}

fn mean(passages: &[(f64, f64)]) -> Planar {
    let (Some(first), Some(last)) = (passages.first(), passages.last()) else {
        return Planar { period: f64::NAN, fall: f64::NAN };
    };
    let time = last.0 - first.0;
    Planar { period: time / (passages.len() - 1) as f64, fall: (first.1 - last.1) / time }
}

/// Flutter of a plate of this mass ratio I*, released at rest at 0.5 rad: the means over periods `from..to`.
pub fn planar_flutter(ratio: f64, from: usize, to: usize) -> Planar {
    let passages = passages(ratio, 0.5, |_| 0.0, to + 1);
    mean(passages.get(from..).unwrap_or_default())
}

/// Tumbling of a plate of this mass ratio I*, released at rest at 0.5 rad: the means over turns `from..to`.
pub fn planar_tumble(ratio: f64, from: usize, to: usize) -> Planar {
    let passages = passages(ratio, 0.5, |n| n as f64 * std::f64::consts::TAU, to + 1);
    mean(passages.get(from..).unwrap_or_default())
}
