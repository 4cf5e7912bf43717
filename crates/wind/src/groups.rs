//! The sum over the frequencies of modes at an instant, for eight modes at once.
//!
//! The numbers of eight modes stand next to each other, so that compilers compute with several at once. Phases are reduced to a
//! turn before anything is made of them, however far the wind has come.

use dlsys_wide::Kernel;
use nalgebra::Vector3;

use crate::fourier::Transform;
use crate::lanes::{Complex, Lanes};
use crate::modes::{FREQUENCIES, Instant, Lap};
use crate::turns::{cos_sin, cos_sin_each, nearest};

/// Modes in a group.
pub(crate) const GROUP: usize = 8;

/// A number of each mode.
type Each<T> = [T; GROUP];

/// Eight modes; at the end of a band, fewer, and zeros.
#[derive(Clone, Debug, Default)]
pub(crate) struct Group {
    /// Turns of phase per metre that the wind travels.
    drift: Each<f64>,
    lines: [Line; FREQUENCIES],
    /// The factors of the two polarisations in the potential, by axes of the lattice; see [`Mode::potential`].
    potential: [[Each<f64>; 3]; 2],
    /// Where the amplitudes of a mode belong in the transform, and where those of its conjugate, if they do.
    indices: Each<[u32; 2]>,
    /// The number of modes.
    count: usize,
}

/// One of the frequencies of each mode.
#[derive(Clone, Debug, Default)]
struct Line {
    /// Turns of phase per metre of decorrelation.
    turns: Each<f64>,
    /// The complex amplitudes of both polarisations.
    amplitude: [Each<f64>; 4],
}

/// The numbers of one mode.
pub(crate) struct Member {
    pub(crate) drift: f64,
    pub(crate) turns: [f64; FREQUENCIES],
    pub(crate) amplitude: [[f64; 4]; FREQUENCIES],
    /// The potential of each polarisation for an amplitude of 1, in the axes of the lattice.
    pub(crate) potential: [Vector3<f64>; 2],
    pub(crate) indices: [u32; 2],
}

/// Turns of phase at an instant, for a number of turns per metre: of drift, or of decorrelation.
#[derive(Clone, Copy, Debug)]
struct Path {
    metres: f64,
    /// The metres of a period, and the share of it that has passed: over a period, phases turn a whole number of times.
    lap: f64,
    share: f64,
}

impl Path {
    /// Drift and decorrelation.
    #[inline(always)]
    fn both(at: Instant, lap: Option<Lap>) -> [Path; 2] {
        let Lap { drift, swept } = lap.unwrap_or(Lap { drift: 0.0, swept: 0.0 });
        [
            Path { metres: at.drift, lap: drift, share: at.share },
            Path { metres: at.swept, lap: swept, share: at.share },
        ]
    }

    #[inline(always)]
    fn phase(self, turns: f64) -> f64 {
        turns * self.metres + nearest(turns * self.lap) * self.share
    }
}

/// Writes the amplitudes of the potential of groups at an instant into a transform, times a factor.
pub(crate) struct Amplitudes<'a> {
    pub(crate) groups: &'a [Group],
    pub(crate) at: Instant,
    pub(crate) lap: Option<Lap>,
    pub(crate) factor: f64,
    pub(crate) transform: &'a mut Transform,
}

impl Kernel for Amplitudes<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        for group in self.groups {
            group.write(self.at, self.lap, self.factor, self.transform);
        }
    }
}

impl Group {
    /// Groups of modes in their order.
    pub(crate) fn of(members: &[Member]) -> Vec<Group> {
        members.chunks(GROUP).map(Group::new).collect()
    }

    fn new(members: &[Member]) -> Group {
        let mut group = Group { count: members.len(), ..Group::default() };
        for (l, member) in members.iter().enumerate() {
            group.drift[l] = member.drift;
            group.indices[l] = member.indices;
            for (line, (turns, amplitude)) in
                group.lines.iter_mut().zip(member.turns.into_iter().zip(member.amplitude))
            {
                line.turns[l] = turns;
                for (each, value) in line.amplitude.iter_mut().zip(amplitude) {
                    each[l] = value;
                }
            }
            for (axes, vector) in group.potential.iter_mut().zip(member.potential) {
                for (each, value) in axes.iter_mut().zip(vector.iter()) {
                    each[l] = *value;
                }
            }
        }
        group
    }

    /// The sums over frequencies: complex amplitudes of both polarisations.
    #[inline(always)]
    fn sums(&self, [drift, swept]: [Path; 2], periodic: bool) -> [Each<f64>; 4] {
        let mut sums = [[0.0; GROUP]; 4];
        for Line { turns, amplitude: [a, b, d, e] } in &self.lines {
            let mut phases = [0.0; GROUP];
            for (reduced, turns) in phases.iter_mut().zip(turns) {
                let phase = if periodic { swept.phase(*turns) } else { turns * swept.metres };
                *reduced = phase - nearest(phase);
            }
            let (c, s) = cos_sin_each(phases);
            for l in 0..GROUP {
                sums[0][l] += a[l] * c[l] - b[l] * s[l];
                sums[1][l] += a[l] * s[l] + b[l] * c[l];
                sums[2][l] += d[l] * c[l] - e[l] * s[l];
                sums[3][l] += d[l] * s[l] + e[l] * c[l];
            }
        }
        let mut phases = [0.0; GROUP];
        for (reduced, turns) in phases.iter_mut().zip(self.drift) {
            let phase = drift.phase(turns);
            *reduced = phase - nearest(phase);
        }
        let (c, s) = cos_sin_each(phases);
        let [mut a, mut b, mut d, mut e] = sums;
        for l in 0..GROUP {
            (a[l], b[l]) = (a[l] * c[l] - b[l] * s[l], a[l] * s[l] + b[l] * c[l]);
            (d[l], e[l]) = (d[l] * c[l] - e[l] * s[l], d[l] * s[l] + e[l] * c[l]);
        }
        [a, b, d, e]
    }

    /// Writes the amplitudes of the potential at an instant into a transform, times a factor.
    #[inline(always)]
    fn write(&self, at: Instant, lap: Option<Lap>, factor: f64, transform: &mut Transform) {
        let [a, b, d, e] = self.sums(Path::both(at, lap), lap.is_some());
        let [p, q] = &self.potential;
        for l in 0..self.count {
            let vector = |each: &[Each<f64>; 3]| Lanes([each[0][l], each[1][l], each[2][l], 0.0]);
            let (p, q) = (vector(p), vector(q));
            let part =
                |first: f64, second: f64| p * Lanes::all(first * factor) + q * Lanes::all(second * factor);
            let (re, im) = (part(a[l], d[l]), part(b[l], e[l]));
            let [here, conjugate] = self.indices[l].map(|index| index as usize);
            // Both indices are the same where there is no conjugate.
            transform.modes[conjugate] = Complex { re, im: Lanes::default() - im };
            transform.modes[here] = Complex { re, im };
        }
    }

    /// The sums over frequencies of one mode in double precision: the reference for [`Amplitudes`].
    pub(crate) fn exact(&self, l: usize, at: Instant, lap: Option<Lap>) -> [f64; 4] {
        let [drift, swept] = Path::both(at, lap);
        let drift = drift.phase(self.drift[l]);
        let mut sum = [0.0f64; 4];
        for line in &self.lines {
            let (c, s) = cos_sin(drift + swept.phase(line.turns[l]));
            let [a, b, d, e] = line.amplitude.map(|each| each[l]);
            sum[0] += a * c - b * s;
            sum[1] += a * s + b * c;
            sum[2] += d * c - e * s;
            sum[3] += d * s + e * c;
        }
        sum
    }
}
