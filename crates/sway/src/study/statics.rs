//! Static cases: beams, the elastica, Greenhill's length.

use dlsys_wind::study::Convergence;

use super::{loaded_stem, rigidity, stem};
use crate::{Error, Fixed, Pose, Settings, Skeleton, Solver, State, Still, Vector};

const GRAVITY: f64 = 9.81;

/// Pose of the equilibrium from the rest shape.
fn settled(skeleton: &Skeleton) -> Result<Pose, Error> {
    let mut state = State::at_rest(skeleton);
    Solver::new(Settings::default()).equilibrium(skeleton, &mut state, &Still, 0.0)?;
    Ok(Pose::new(skeleton, &state.strain))
}

/// Drop of the tip of a cantilever under an end load, P L³/3EI, at PL²/EI = 1e-4.
///
/// # Errors
///
/// An error of the solver, which is a defect.
pub fn end_load() -> Result<Vec<Convergence>, Error> {
    let (length, diameter, stiffness) = (2.0_f64, 0.01_f64, 1e9);
    let ei = rigidity(diameter, stiffness);
    let force = 1e-4 * ei / (length * length);
    let mut found = Vec::new();
    for n in [8, 16, 32] {
        let pose = settled(&loaded_stem(n, length, diameter, stiffness, force / GRAVITY))?;
        found.push((n as f64, -pose.point(n - 1, 1.0).y));
    }
    Ok(Convergence::rows("end load: drop PL³/3EI (m)", force * length.powi(3) / (3.0 * ei), &found))
}

/// Drop of the tip of a cantilever under its own weight, q L⁴/8EI, at qL³/EI = 1e-4.
///
/// # Errors
///
/// An error of the solver, which is a defect.
pub fn uniform_load() -> Result<Vec<Convergence>, Error> {
    let (length, diameter, stiffness) = (2.0_f64, 0.01_f64, 1e9);
    let ei = rigidity(diameter, stiffness);
    let q = 1e-4 * ei / length.powi(3);
    let density = q / (GRAVITY * std::f64::consts::PI * diameter * diameter / 4.0);
    let mut found = Vec::new();
    for n in [8, 16, 32] {
        let pose = settled(&stem(n, length, diameter, stiffness, density, false))?;
        found.push((n as f64, -pose.point(n - 1, 1.0).y));
    }
    Ok(Convergence::rows("own weight: drop qL⁴/8EI (m)", q * length.powi(4) / (8.0 * ei), &found))
}

/// The elastica under an end load: drop and shortening relative to the length at PL²/EI = 1 and 10. The exact values solve
/// `θ'' = -(P/EI) cos θ` with elliptic integrals (Bisshopp and Drucker, *Large deflection of cantilever beams*, 1945).
///
/// # Errors
///
/// An error of the solver, which is a defect.
pub fn elastica() -> Result<Vec<Convergence>, Error> {
    let cases = [
        (1.0, "elastica PL²/EI = 1: drop/L", "elastica PL²/EI = 1: shortening/L", ELASTICA[0]),
        (10.0, "elastica PL²/EI = 10: drop/L", "elastica PL²/EI = 10: shortening/L", ELASTICA[1]),
    ];
    let (length, diameter, stiffness) = (0.7, 0.008, 1e9);
    let ei = rigidity(diameter, stiffness);
    let mut all = Vec::new();
    for (ratio, drop_name, short_name, (drop, shortening)) in cases {
        let (mut drops, mut shorts) = (Vec::new(), Vec::new());
        for n in [8, 16, 32] {
            let mass = ratio * ei / (length * length * GRAVITY);
            let tip = settled(&loaded_stem(n, length, diameter, stiffness, mass))?.point(n - 1, 1.0);
            drops.push((n as f64, -tip.y / length));
            shorts.push((n as f64, 1.0 - tip.x / length));
        }
        all.extend(Convergence::rows(drop_name, drop, &drops));
        all.extend(Convergence::rows(short_name, shortening, &shorts));
    }
    Ok(all)
}

/// Drop and shortening at PL²/EI = 1 and 10.
const ELASTICA: [(f64, f64); 2] =
    [(0.301_720_773_799_8, 0.056_433_236_283_4), (0.810_609_024_880_3, 0.554_995_597_753_8)];

/// A stem whose length is `ratio` times Greenhill's, `q L³ = 7.8373 EI`.
fn greenhill_stem(n: usize, ratio: f64) -> Skeleton {
    let (length, diameter, density) = (1.0, 0.01, 1000.0);
    let q = density * std::f64::consts::PI * diameter * diameter / 4.0 * GRAVITY;
    let ei = q * (length / ratio).powi(3) / GREENHILL;
    stem(n, length, diameter, ei / rigidity(diameter, 1.0), density, true)
}

/// Tip of a stem 1 % longer than Greenhill's length, aside and lower, relative to the length: `θ'' = -(q/EI) (L - s) sin θ` by shooting.
const BUCKLED: (f64, f64) = (0.355_636_397_609, 0.077_848_621_495);

/// (9/4) j², where j is the first zero of the Bessel function of order -1/3: qL³/EI of Greenhill's length.
const GREENHILL: f64 = 7.837_347_438_943_481;

/// Load factor at Greenhill's length, which is 1.
///
/// # Errors
///
/// An error of the solver, which is a defect.
pub fn greenhill() -> Result<Vec<Convergence>, Error> {
    let mut found = Vec::new();
    for n in [10, 20, 40] {
        found.push((n as f64, Solver::new(Settings::default()).buckling(&greenhill_stem(n, 1.0))?));
    }
    Ok(Convergence::rows("Greenhill: load factor qL³/7.8373EI", 1.0, &found))
}

/// A stem 1 % below Greenhill's length stands: its tip goes back to the vertical. One 1 % above settles aside and below, from motion with
/// damping.
///
/// # Errors
///
/// An error of the solver, which is a defect.
pub fn greenhill_settles() -> Result<Vec<Convergence>, Error> {
    let mut all = Vec::new();
    let (mut stands, mut aside, mut lower) = (Vec::new(), Vec::new(), Vec::new());
    for n in [20, 40, 80] {
        for ratio in [0.99, 1.01] {
            let skeleton = greenhill_stem(n, ratio);
            let mut state = State::at_rest(&skeleton);
            state.strain.fill(Vector::new(0.0, 0.0, 0.05));
            let mut solver = Solver::new(Settings::default());
            let mut damped = skeleton.clone();
            damped.segments_mut().iter_mut().for_each(|segment| segment.damping = 0.3);
            solver.advance(&mut state, 0.0, 10.0, &mut Fixed(&damped), &Still, |_| ())?;
            solver.equilibrium(&skeleton, &mut state, &Still, 0.0)?;
            let tip = Pose::new(&skeleton, &state.strain).point(n - 1, 1.0);
            if ratio < 1.0 {
                stands.push((n as f64, tip.x.hypot(tip.z)));
            } else {
                aside.push((n as f64, tip.x.hypot(tip.z)));
                lower.push((n as f64, 1.0 - tip.y));
            }
        }
    }
    all.extend(Convergence::rows("Greenhill - 1 %: tip aside/L", 0.0, &stands));
    all.extend(Convergence::rows("Greenhill + 1 %: tip aside/L", BUCKLED.0, &aside));
    all.extend(Convergence::rows("Greenhill + 1 %: tip lower/L", BUCKLED.1, &lower));
    Ok(all)
}
