//! What bodies throw up: its volume against the exponential, and its flight against the parabola.

use std::sync::Arc;

use dlsys_wind::study::Convergence;

use super::sphere;
use crate::barrier::Barriers;
use crate::particles::Particle;
use crate::{Body, Description, Error, Extent, Ground, Relief, Settings, Soil, Vector};

/// Level ground that stands at any slope, of columns of 1 cm.
fn standing(soil: Soil) -> Result<Ground, Error> {
    let description = Description {
        cell: 0.01,
        extent: Extent::around(40),
        soil,
        bed: Relief::Level(-0.2),
        depth: Relief::Level(0.2),
    };
    Ground::new(description, Settings::default())
}

/// A ball that is lifted out of the ground in one tick: volume that still sticks to it when a time constant has passed, a part 1/e of what it took. By particles in what a
/// column of the ground gives.
///
/// # Errors
///
/// An error of the ground, which is a defect.
pub fn shed() -> Result<Vec<Convergence>, Error> {
    let (stick, constant, tick) = (0.001, 0.1, Settings::default().tick);
    let mut found = Vec::new();
    for count in [1.0, 8.0, 64.0] {
        // Balls of a part of the volume over a column.
        let grain = (6.0 * stick * 1e-4 / (count * std::f64::consts::PI)).cbrt();
        let mut ground = standing(Soil { stick, shed: constant, grain: Some(grain), ..Soil::snow() })?;
        let at = |y: f64| sphere(Vector::new(0.003, y, -0.002), 0.1, 32);
        let (triangles, low, high): (_, Arc<[Vector]>, Arc<[Vector]>) = (at(0.0).1, at(0.05).0, at(5.05).0);
        let still = Body::still(1, "a ball", triangles, Arc::clone(&low));
        ground.advance(&[], std::slice::from_ref(&still))?;
        let whole = ground.sticking();
        ground.advance(&[], &[Body { from: low, to: Arc::clone(&high), ..still.clone() }])?;
        let high = Body { from: Arc::clone(&high), to: high, ..still };
        // It has left the ground in the first thousandths of that tick.
        while ground.time() < constant + 1.5 * tick {
            ground.advance(&[], std::slice::from_ref(&high))?;
        }
        let since = ground.time() - tick;
        found.push((count, ground.sticking() / whole * libm::exp((since - constant) / constant)));
    }
    Ok(Convergence::rows("what still sticks after a time constant", libm::exp(-1.0), &found))
}

/// A particle thrown over a slope of 0.3 in parts of a tick of 1/120 s: how far it comes (m), against the parabola and the plane. By the columns in 10 cm.
///
/// # Errors
///
/// An error of the ground, which is a defect.
pub fn flight() -> Result<Vec<Convergence>, Error> {
    let slope = 0.3;
    let (place, velocity) = (Vector::new(0.1, 0.4, 0.0), Vector::new(1.5, 2.0, -0.5));
    let (rise, over) = (velocity.y - slope * velocity.x, place.y - slope * place.x);
    let after = (rise + (rise * rise + 2.0 * 9.81 * over).sqrt()) / 9.81;
    let mut found = Vec::new();
    for columns in [5, 10, 20] {
        let cell = 0.1 / f64::from(columns);
        let description = Description {
            cell,
            extent: Extent { x: [-columns, 20 * columns], z: [-10 * columns, columns] },
            soil: Soil::snow(),
            bed: Relief::function(move |x, _| slope * x - 1.0),
            depth: Relief::Level(1.0),
        };
        let mut ground = Ground::new(description, Settings::default())?;
        let end = Settings::default().tick;
        let thrown = Particle { id: 1, born: 0.0, place, velocity, volume: 1 << 20 };
        ground.throw(thrown, end, &Barriers::default())?;
        let mut far = 0.0;
        while let Some(flight) = ground.flights(ground.time() + end).first() {
            far = flight.place.x - place.x;
            ground.advance(&[], &[])?;
        }
        found.push((f64::from(columns), far));
    }
    Ok(Convergence::rows("particle over a slope: its way (m)", velocity.x * after, &found))
}
