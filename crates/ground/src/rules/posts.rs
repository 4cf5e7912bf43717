//! Slices between posts, of Li and Moshell (1993), made stable.

use super::board::{Board, Moves, Site, SpeedLists};
use crate::material::REST;
use crate::tile::QUANTA;

/// Acceleration of gravity in m/s².
pub(super) const GRAVITY: f64 = 9.81;
/// The planes of section 6: x, z, and the diagonal of the prisms, with their slices' lengths in cells.
const PLANES: [((i32, i32), f64); 3] = [((1, 0), 1.0), ((0, 1), 1.0), ((1, 1), std::f64::consts::SQRT_2)];
/// Largest part of its length that a slice moves in a sweep: what a post gives and gets then changes no difference beyond what is too steep.
const WAY: f64 = 0.125;

/// A slice whose upper end slides.
struct Slide {
    /// What is above the worst plane, at the upper post, in m.
    above: f64,
    /// Its acceleration in m/s².
    acceleration: f64,
}

/// The slice between two posts of a height difference h at a distance, with the strength of the soil (equations 3.1 to 3.7); none if it stands.
fn slice(h: f64, length: f64, repose: f64, cohesion: f64, weight: f64) -> Option<Slide> {
    let (theta, phi) = (libm::atan2(h, length), libm::atan(repose));
    if h <= length * repose * (1.0 + REST) {
        return None;
    }
    // The plane at which strength and weight are equal.
    let cosine = libm::cos(theta - phi) + 4.0 * cohesion * libm::cos(phi) / (weight * h.hypot(length));
    if cosine >= 1.0 {
        return None;
    }
    let beta = (theta + phi) / 2.0 - libm::acos(cosine) / 2.0;
    let foot = length * libm::tan(beta);
    let above = h - foot;
    if above <= 0.0 {
        return None;
    }
    let square = length * length;
    let ratio = (h * h + square) / (foot * foot + square);
    // Force over the weight per volume, and the area that it moves.
    let force = square / 4.0 * libm::log(ratio) * libm::cos(beta)
        + length / 2.0 * (h - foot - length * (theta - beta)) * libm::sin(beta);
    Some(Slide { above, acceleration: GRAVITY * force / (above * length / 2.0) })
}

/// All slices move at once, by the heights before.
pub(super) fn slide(board: &Board) -> (Moves, f64, SpeedLists) {
    let ground = board.ground;
    let (soil, cell) = (*ground.soil(), ground.cell());
    let pace = ground.setup.settings.tick / f64::from(ground.setup.sweeps);
    let columns = ground.setup.settings.side.pow(2);
    let (mut moves, mut speeds, mut steepest) = (board.still(), Vec::new(), 0.0_f64);
    for (tile, (key, _)) in board.tiles[..board.computed].iter().enumerate() {
        let before = ground.speeds.get(key);
        let mut after = vec![0.0; 3 * columns];
        for site in (0..columns).map(|index| (tile, index)) {
            for (plane, (step, distance)) in PLANES.into_iter().enumerate() {
                let Some(beside) = board.beside(site, step) else { continue };
                let drop = board.top(site) - board.top(beside);
                // Downhill from the one to the other, or the other way.
                let (from, to, sign) = if drop > 0 { (site, beside, 1.0) } else { (beside, site, -1.0) };
                let (h, length) = (drop.unsigned_abs() as f64 / QUANTA * cell, distance * cell);
                if limits(board, from, to) == 0 {
                    continue;
                }
                let repose = board.repose(from, to);
                let Some(Slide { above, acceleration }) =
                    slice(h, length, repose, soil.cohesion, soil.weight)
                else {
                    continue;
                };
                steepest = steepest.max(h / length);
                let at = 3 * site.1 + plane;
                let old = before.map_or(0.0, |before| (sign * before[at]).max(0.0));
                let speed = (old + acceleration * pace).min(WAY * length / pace);
                after[at] = sign * speed;
                let height = above / 2.0 * speed * pace / length;
                let part = ((height / cell * QUANTA) as i64).min(limits(board, from, to));
                moves[from.0][from.1] -= part;
                moves[to.0][to.1] += part;
            }
        }
        speeds.push((*key, after));
    }
    (moves, steepest, speeds)
}

/// What one slice may take from a post and bring to another, of the six around each.
fn limits(board: &Board, from: Site, to: Site) -> i64 {
    (board.loose(from) / 6).min(board.room(to) / 6)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Strength over load of a plane at an angle (equation 2.8 and the factor of safety of section 2).
    fn safety(h: f64, length: f64, phi: f64, cohesion: f64, weight: f64, alpha: f64) -> f64 {
        let wedge = h * libm::cos(alpha) - length * libm::sin(alpha);
        (2.0 * cohesion + weight * libm::tan(phi) * wedge * libm::cos(alpha))
            / (weight * wedge * libm::sin(alpha))
    }

    #[test]
    fn a_slice_slides_on_the_lowest_plane_that_is_too_weak_under_what_its_parts_weigh_along_it() {
        for (h, length, degrees, cohesion) in
            [(0.3, 0.1, 30.0, 0.0), (1.2, 0.5, 25.0, 1.0), (2.9, 0.4, 14.0, 2.0), (3.0, 0.2, 33.0, 5.0)]
        {
            let (phi, weight) = (f64::to_radians(degrees), 18.0);
            let found = slice(h, length, libm::tan(phi), cohesion, weight).expect("too steep");
            let beta = libm::atan2(h - found.above, length);
            assert!((safety(h, length, phi, cohesion, weight, beta) - 1.0).abs() < 1e-9, "{h}");
            let least = (1..1000).map(|n| beta * f64::from(n) / 1000.0);
            assert!(least.into_iter().all(|alpha| safety(h, length, phi, cohesion, weight, alpha) > 1.0));
            // Each part slides along a plane of its own; what of its weight is along that counts in the direction of the lowest one.
            let (parts, mut force) = (100_000, 0.0);
            for n in 0..parts {
                let y = h - found.above + found.above * (f64::from(n) + 0.5) / f64::from(parts);
                let alpha = libm::atan2(y, length);
                force += libm::sin(alpha) * libm::cos(alpha - beta) * found.above / f64::from(parts);
            }
            assert!((found.acceleration / (GRAVITY * force / found.above) - 1.0).abs() < 1e-8, "{h}");
        }
        // A bank within its strength stands, and so does one at the angle of friction.
        assert!(slice(0.5, 0.5, 0.5, 10.0, 18.0).is_none());
        assert!(slice(0.05, 0.1, 0.5, 0.0, 18.0).is_none());
    }
}
