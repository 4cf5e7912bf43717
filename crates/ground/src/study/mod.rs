//! Exact cases, as rows of a table. Each is computed with three sizes of columns; the order is that of the error from one row to the next.

use dlsys_wind::study::Convergence;

use crate::{Description, Error, Extent, Ground, Relief, Rule, Settings, Soil};

mod banks;
mod hard;
mod heaps;
mod presses;
mod rules;
mod scenes;
mod shelves;
mod sinking;
mod speed;
mod throws;
mod vessels;

pub use banks::{Bank, bank};
pub use hard::{HardCase, hard_cases};
pub use heaps::{cone, cone_on_incline, cylinder, dam, portions, round, strip};
pub use presses::{ball, sphere, sphere_rim};
pub use rules::{RuleRow, repose, rules};
pub use scenes::{footprints, posts, runner, sandbox, torus};
pub use shelves::{bucket, disc, square};
pub use sinking::{Ram, dropped, fall, released};
pub use speed::{Speed, speeds};
pub use throws::{flight, shed};
pub use vessels::{scoop, tip, vessel};

/// A case: computes its rows.
pub type Case = fn() -> Result<Vec<Convergence>, Error>;

/// The exact case that takes as long as all others.
pub const SLOW_CASE: Case = cone_on_incline;

/// The other exact cases.
pub const EXACT_CASES: [Case; 17] = [
    cylinder, dam, strip, cone, portions, round, disc, square, bucket, bank, sphere_rim, scoop, tip, shed,
    flight, dropped, released,
];

/// Most sweeps until a heap rests.
const SWEEPS: u64 = 200_000;
/// Tangent of the angle of repose of the heaps.
const SLOPE: f64 = 0.7;

/// Dry material with a tangent of the angle of repose.
fn dry(slope: f64) -> Soil {
    let angle = libm::atan(slope).to_degrees();
    Soil { repose: angle, inner: angle.max(45.0), ..Soil::sand() }
}

/// Loose material on a bed.
fn heap(
    cell: f64,
    extent: Extent,
    soil: Soil,
    bed: Relief,
    depth: impl Fn(f64, f64) -> f64 + Send + Sync + 'static,
) -> Result<Ground, Error> {
    heap_by(Rule::Law, cell, extent, soil, bed, depth)
}

/// Loose material on a bed that slips by a rule.
fn heap_by(
    rule: Rule,
    cell: f64,
    extent: Extent,
    soil: Soil,
    bed: Relief,
    depth: impl Fn(f64, f64) -> f64 + Send + Sync + 'static,
) -> Result<Ground, Error> {
    let description = Description { cell, extent, soil, bed, depth: Relief::function(depth) };
    Ground::new(description, Settings { rule, ..Settings::default() })
}

/// The mean over a column of a function that jumps, from 16 × 16 places.
fn mean(cell: f64, f: impl Fn(f64, f64) -> f64) -> impl Fn(f64, f64) -> f64 {
    const PLACES: i32 = 16;
    move |x, z| {
        let at = |n: i32| ((f64::from(n) + 0.5) / f64::from(PLACES) - 0.5) * cell;
        let places = (0..PLACES * PLACES).map(|n| f(x + at(n % PLACES), z + at(n / PLACES)));
        places.sum::<f64>() / f64::from(PLACES * PLACES)
    }
}

/// The sum over all columns of a function of x, z and the height, times the area of a column.
fn integral(ground: &Ground, f: impl Fn(f64, f64, f64) -> f64) -> f64 {
    let (cell, Extent { x, z }) = (ground.cell(), ground.extent());
    let mut sum = 0.0;
    for k in z[0]..=z[1] {
        for i in x[0]..=x[1] {
            sum += f(f64::from(i) * cell, f64::from(k) * cell, ground.column(i, k));
        }
    }
    sum * cell * cell
}
