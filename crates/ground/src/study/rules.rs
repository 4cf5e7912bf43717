//! The law of slipping and the rules of the papers side by side.

use std::time::Instant;

use super::SLOPE;
use super::heaps::{collapsed, cone_error, poured, roundness};
use crate::{Error, Ground, Rule};

/// What a rule makes of the exact heaps.
#[derive(Clone, Debug)]
pub struct RuleRow {
    /// The rule.
    pub rule: Rule,
    /// Columns in the radius of the heaps.
    pub columns: i32,
    /// Collapsed cylinder: difference from the exact heap, in volumes.
    pub cylinder: f64,
    /// Poured cone: difference from the exact one in one portion and in ten, in volumes.
    pub cone: [f64; 2],
    /// Poured cone: radius between two axes relative to that along an axis, less 1.
    pub bias: f64,
    /// The slope at rest of the cone along an axis and between two, in degrees.
    pub rest: [f64; 2],
    /// Difference of volumes, in 2^-16 quanta.
    pub imbalance: i128,
    /// Columns computed for the cylinder.
    pub updates: u64,
    /// Seconds for it.
    pub seconds: f64,
}

/// The angle of repose of the heaps in degrees.
pub fn repose() -> f64 {
    libm::atan(SLOPE).to_degrees()
}

/// All rules with 8 and 16 columns in the radius.
///
/// # Errors
///
/// More sweeps or memory than allowed, which is a defect.
pub fn rules() -> Result<Vec<RuleRow>, Error> {
    let mut rows = Vec::new();
    for (_, rule) in Rule::NAMED {
        for columns in [8, 16] {
            let begun = Instant::now();
            let (ground, cylinder) = collapsed(columns, rule)?;
            let seconds = begun.elapsed().as_secs_f64();
            let [once, often] = [1, 10].map(|portions| poured(columns, portions, rule));
            let (once, often) = (once?, often?);
            let cone = [&once, &often].map(cone_error);
            let rest = [[1, 0], [1, 1]].map(|direction| slope(&once, direction, columns));
            let imbalance = ground.imbalance() + once.imbalance() + often.imbalance();
            let (bias, updates) = (roundness(&once) - 1.0, ground.updates());
            rows.push(RuleRow { rule, columns, cylinder, cone, bias, rest, imbalance, updates, seconds });
        }
    }
    Ok(rows)
}

/// The mean slope of a cone's side in degrees, from a quarter to three quarters of its radius.
fn slope(ground: &Ground, [i, k]: [i32; 2], columns: i32) -> f64 {
    let length = f64::from(i * i + k * k).sqrt();
    let at = |part: f64| (part * f64::from(columns) / length).round() as i32;
    let (near, far) = (at(0.25), at(0.75));
    let drop = ground.column(near * i, near * k) - ground.column(far * i, far * k);
    libm::atan(drop / (f64::from(far - near) * length * ground.cell())).to_degrees()
}
