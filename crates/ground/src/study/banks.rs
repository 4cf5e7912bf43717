//! Vertical banks of cohesive soil: the height up to which they stand.

use dlsys_wind::study::Convergence;

use crate::{Description, Error, Extent, Ground, Relief, Settings, Soil};

/// A vertical bank on a grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bank {
    /// Distance of columns in m.
    pub cell: f64,
    /// Its soil.
    pub soil: Soil,
}

impl Bank {
    /// A bank of sandy loam: 5 kPa, 25°, 18 kN/m³.
    pub fn of_loam(cell: f64) -> Bank {
        let soil = Soil { repose: 25.0, inner: 45.0, cohesion: 5.0, weight: 18.0, ..Soil::sand() };
        Bank { cell, soil }
    }

    /// Whether a bank of a height in m stands: nothing of it comes loose.
    ///
    /// # Errors
    ///
    /// An error of the ground, which is a defect.
    pub fn stands(&self, height: f64) -> Result<bool, Error> {
        let far = (2.0 * height / self.cell).ceil() as i32 + 2;
        let description = Description {
            cell: self.cell,
            extent: Extent { x: [-far, far], z: [0, 0] },
            soil: self.soil,
            bed: Relief::Level(0.0),
            depth: Relief::function(move |x, _| if x > 0.0 { height } else { 0.0 }),
        };
        let mut ground = Ground::new(description, Settings::default())?;
        ground.advance(&[], &[])?;
        Ok((-far..=far).all(|i| ground.loose(i, 0) == 0.0))
    }

    /// The height up to which it stands, by bisection, in m.
    ///
    /// # Errors
    ///
    /// An error of the ground, which is a defect.
    pub fn limit(&self) -> Result<f64, Error> {
        let highest = self.soil.standing_height(90.0);
        let [mut low, mut high] = [0.5 * highest, 2.0 * highest];
        while high - low > 1e-7 * highest {
            let middle = (low + high) / 2.0;
            (low, high) = if self.stands(middle)? { (middle, high) } else { (low, middle) };
        }
        Ok(low)
    }
}

/// A vertical bank: the height up to which it stands, against that of a vertical wall; columns are a tenth of that and finer.
///
/// # Errors
///
/// An error of the ground, which is a defect.
pub fn bank() -> Result<Vec<Convergence>, Error> {
    let exact = Bank::of_loam(1.0).soil.standing_height(90.0);
    let mut found = Vec::new();
    for n in [10.0, 20.0, 40.0] {
        found.push((n, Bank::of_loam(exact / n).limit()?));
    }
    Ok(Convergence::rows("vertical bank: height up to which it stands (m)", exact, &found))
}
