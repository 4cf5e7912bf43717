//! Rays, and the mass of a blob along one.

use std::sync::OnceLock;

use crate::error::check;
use crate::{Blob, Error, Vector};

/// A ray of light or of sight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where it begins, in m.
    pub origin: Vector,
    /// Its direction, of length 1.
    pub direction: Vector,
}

/// A part of a ray: distances from its origin in m. The far end may be infinite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// The near end.
    pub from: f64,
    /// The far end.
    pub to: f64,
}

impl Ray {
    /// A ray towards a direction of any length but 0.
    ///
    /// # Errors
    ///
    /// Values that are not finite, a direction of length 0.
    pub fn new(origin: Vector, direction: Vector) -> Result<Ray, Error> {
        for value in origin.iter().chain(direction.iter()) {
            check("a coordinate of a ray", *value, true, "a finite number")?;
        }
        let length = direction.norm();
        check("the length of the direction of a ray", length, length > 0.0, "more than 0")?;
        Ok(Ray { origin, direction: direction / length })
    }

    /// Where it passes nearest to a point, as the distance from its origin, and the square of the distance from the point there.
    pub(crate) fn nearest(&self, point: &Vector) -> (f64, f64) {
        let aside = point - self.origin;
        let along = aside.dot(&self.direction);
        (along, (aside - self.direction * along).norm_squared())
    }
}

impl Span {
    /// The whole ray.
    pub const ALL: Span = Span { from: 0.0, to: f64::INFINITY };
}

impl Blob {
    /// ∫ρ ds along a span of a ray, in kg/m²: equation 29 of Stam and Fiume with the error function,
    /// m/(2πσ²) e^(-r²/2σ²) ½[erf((s - s₀)/√2σ)] between the ends, with the least distance r of the ray from the centre, at s₀.
    pub fn column(&self, ray: &Ray, span: Span) -> f64 {
        let (along, square) = ray.nearest(&self.centre);
        let unit = 1.0 / libm::sqrt(2.0 * self.variance);
        let [from, to] = [span.from, span.to].map(|end| (end - along) * unit);
        self.through(square) * between(from, to)
    }

    /// ∫ρ ds along a whole line at a distance whose square is given, in kg/m².
    pub(crate) fn through(&self, square: f64) -> f64 {
        self.mass / (std::f64::consts::TAU * self.variance) * libm::exp(-square / (2.0 * self.variance))
    }

    /// Density at a point, in kg/m³.
    pub fn density(&self, point: &Vector) -> f64 {
        let square = (point - self.centre).norm_squared();
        self.through(square) / libm::sqrt(std::f64::consts::TAU * self.variance)
    }
}

/// ½(erf b - erf a) without cancellation where both are on one side.
pub(crate) fn between(a: f64, b: f64) -> f64 {
    let tail = |x: f64| if x == f64::INFINITY { 0.0 } else { libm::erfc(x) };
    let both = if a >= 0.0 {
        tail(a) - tail(b)
    } else if b <= 0.0 {
        tail(-b) - tail(-a)
    } else {
        2.0 - tail(-a) - tail(b)
    };
    0.5 * both
}

/// Width of a cell of the table of the error function, and the number of cells; beyond it, the function is 1 to 1e-17.
const CELLS_IN_ONE: f64 = 64.0;
const CELLS: usize = 384;

/// ½ erf x, by cubics between the values and slopes of a table: within 1e-9.
pub(crate) struct HalfErf(Vec<[f64; 2]>);

impl HalfErf {
    /// The table, made at its first use.
    pub(crate) fn table() -> &'static HalfErf {
        static TABLE: OnceLock<HalfErf> = OnceLock::new();
        TABLE.get_or_init(|| {
            let entry = |k: usize| {
                let x = k as f64 / CELLS_IN_ONE;
                let slope = libm::exp(-x * x) * std::f64::consts::FRAC_2_SQRT_PI / 2.0;
                [libm::erf(x) / 2.0, slope / CELLS_IN_ONE]
            };
            HalfErf((0..=CELLS).map(entry).collect())
        })
    }

    pub(crate) fn at(&self, x: f64) -> f64 {
        let place = x.abs() * CELLS_IN_ONE;
        let cell = place as usize;
        let (Some([a, p]), Some([b, q])) = (self.0.get(cell), self.0.get(cell.saturating_add(1))) else {
            return 0.5_f64.copysign(x);
        };
        let s = place - cell as f64;
        let rise = b - a;
        let value = a + s * (p + s * (3.0 * rise - 2.0 * p - q + s * (p + q - 2.0 * rise)));
        value.copysign(x)
    }

    /// ½(erf b - erf a).
    pub(crate) fn between(&self, a: f64, b: f64) -> f64 {
        self.at(b) - self.at(a)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_has_the_error_function() {
        let table = HalfErf::table();
        for k in -70_000..=70_000 {
            let x = f64::from(k) * 1e-4;
            assert!((table.at(x) - libm::erf(x) / 2.0).abs() < 1e-9, "{x}");
        }
        assert_eq!([table.at(f64::INFINITY), table.at(f64::NEG_INFINITY)], [0.5, -0.5]);
    }
}
