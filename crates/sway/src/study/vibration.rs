//! Natural frequencies: cantilever, cone, hanging chain.

use dlsys_wind::study::Convergence;

use super::{rigidity, stem, weightless};
use crate::{Error, Segment, Settings, Skeleton, Solver};

/// Roots β of cos β cosh β = -1.
pub(super) const BETA: [f64; 5] = [
    1.875_104_068_711_961,
    4.694_091_132_974_175,
    7.854_757_438_237_613,
    10.995_540_734_875_467,
    14.137_168_391_046_47,
];

/// The angular frequencies of the bending modes, without the second of each pair, for three numbers of segments.
fn frequencies(
    settings: Settings,
    numbers: [usize; 3],
    count: usize,
    skeleton: impl Fn(usize) -> Skeleton,
) -> Result<Vec<Vec<(f64, f64)>>, Error> {
    let mut found = vec![Vec::new(); count];
    for n in numbers {
        let skeleton = skeleton(n);
        let rest = vec![crate::Vector::zeros(); n];
        let modes = Solver::new(settings).modes(&skeleton, &rest, 2 * count)?;
        for (k, list) in found.iter_mut().enumerate() {
            list.push((n as f64, modes.get(2 * k).map_or(f64::NAN, |mode| mode.squared.sqrt())));
        }
    }
    Ok(found)
}

/// The first three frequencies of a uniform cantilever, ω = β² √(EI/μL⁴), β = 1.8751, 4.6941, 7.8548.
///
/// # Errors
///
/// An error of the solver, which is a defect.
pub fn cantilever_modes() -> Result<Vec<Convergence>, Error> {
    let (length, diameter, stiffness, density) = (2.0_f64, 1e-4_f64, 1e10, 900.0);
    let mass = density * std::f64::consts::PI * diameter * diameter / 4.0;
    let unit = (rigidity(diameter, stiffness) / (mass * length.powi(4))).sqrt();
    let names = ["cantilever: ω₁ (1/s)", "cantilever: ω₂ (1/s)", "cantilever: ω₃ (1/s)"];
    let found =
        frequencies(weightless(), [8, 16, 32], 3, |n| stem(n, length, diameter, stiffness, density, false))?;
    let cases = names.iter().zip(BETA).zip(&found);
    Ok(cases.flat_map(|((name, beta), found)| Convergence::rows(name, beta * beta * unit, found)).collect())
}

/// The first two frequencies of a cone, ω = 8.7193 and 21.1457 √(EI₀/μ₀L⁴), from the roots of J₂ I₂' = I₂ J₂' at 2 √ω (Kirchhoff).
///
/// # Errors
///
/// An error of the solver, which is a defect.
pub fn cone_modes() -> Result<Vec<Convergence>, Error> {
    let (length, diameter, stiffness, density) = (1.5_f64, 1e-4_f64, 1e10, 900.0);
    let mass = density * std::f64::consts::PI * diameter * diameter / 4.0;
    let unit = (rigidity(diameter, stiffness) / (mass * length.powi(4))).sqrt();
    let found = frequencies(weightless(), [16, 32, 64], 2, |n| {
        let mut cone = Skeleton::new();
        let mut parent = None;
        for k in 0..n {
            let width = diameter * (1.0 - (k as f64 + 0.5) / n as f64);
            let segment = Segment::solid(parent, length / n as f64, width, stiffness, density);
            parent = Some(cone.push(Segment { drag_diameter: 0.0, ..segment }));
        }
        cone
    })?;
    let mut all = Convergence::rows("cone: ω₁ (1/s)", CONE[0] * unit, &found[0]);
    all.extend(Convergence::rows("cone: ω₂ (1/s)", CONE[1] * unit, &found[1]));
    Ok(all)
}

const CONE: [f64; 2] = [8.719_264_2, 21.145_662_4];

/// The first frequency of a hanging chain, ω = 1.202413 √(g/L), as the limit of a stem with a Young's modulus of 1 Pa. The clamped base keeps
/// half a segment from swinging, so the order is 1.
///
/// # Errors
///
/// An error of the solver, which is a defect.
pub fn hanging_chain() -> Result<Vec<Convergence>, Error> {
    let length = 1.0_f64;
    let found = frequencies(Settings::default(), [50, 100, 200], 1, |n| {
        let mut chain = stem(n, length, 0.004, 1.0, 900.0, true);
        if let Some(first) = chain.segments_mut().first_mut() {
            let heading = nalgebra::Matrix3::new(0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0);
            first.joint.rotation = heading;
        }
        chain
    })?;
    Ok(Convergence::rows(
        "hanging chain: ω₁ (1/s)",
        1.202_412_778_847_886 * (9.81_f64 / length).sqrt(),
        &found[0],
    ))
}
