//! Light along rays, against quadrature.

use dlsys_wind::study::Convergence;

use crate::chance::Chance;
use crate::{Blob, Error, Light, Look, Ray, Smoke, Span, Vector};

/// Blobs of many sizes in a ball of radius 1 around the origin.
pub fn random_smoke(seed: u64, count: u64) -> Vec<Blob> {
    let blob = |k: u64| {
        let chance = Chance::new(seed).of(k);
        let size = 0.02 + 0.2 * chance.of(10).unit();
        Blob { centre: chance.in_ball(), variance: size * size, mass: 1e-3 * chance.of(11).unit() }
    };
    (0..count).map(blob).collect()
}

/// A grey gas with a glow.
const LOOK: Look = Look { extinction: 20.0, albedo: [0.9, 0.6, 0.3], glow: [0.0, 0.1, 0.5] };

/// The integral of a function over 0..length by Simpson's rule, of a step and of a half, with Richardson's extrapolation.
fn quadrature(length: f64, steps: usize, f: impl Fn(f64) -> f64) -> f64 {
    let simpson = |steps: usize| {
        let h = length / steps as f64;
        let weight = |k: usize| match k {
            0 => 1.0,
            k if k == steps => 1.0,
            k if k % 2 == 1 => 4.0,
            _ => 2.0,
        };
        (0..=steps).map(|k| weight(k) * f(h * k as f64)).sum::<f64>() * h / 3.0
    };
    let (coarse, fine) = (simpson(steps), simpson(2 * steps));
    fine + (fine - coarse) / 15.0
}

/// A ray through the middle of the smoke, which it enters and leaves between the ends of the span.
fn through() -> Result<(Ray, Span), Error> {
    Ok((Ray::new(Vector::new(-3.0, 0.2, 0.1), Vector::new(1.0, -0.03, 0.05))?, Span { from: 2.4, to: 4.1 }))
}

/// Transmittance through 300 blobs along a part of a ray that begins and ends within them, by the distance in standard deviations at which
/// blobs are cut, against quadrature of the densities of all blobs.
///
/// # Errors
///
/// A value out of range, which is a defect.
pub fn transmittance() -> Result<Vec<Convergence>, Error> {
    let blobs = random_smoke(3, 300);
    let (ray, span) = through()?;
    let density = |s: f64| {
        let point = ray.origin + ray.direction * (span.from + s);
        blobs.iter().map(|blob| blob.density(&point)).sum()
    };
    let exact = (-LOOK.extinction * quadrature(span.to - span.from, 2000, density)).exp();
    let mut found = Vec::new();
    for reach in [2.0, 4.0, 6.0] {
        found.push((reach, Smoke::cut(LOOK, blobs.clone(), reach)?.transmittance(&ray, span)));
    }
    Ok(Convergence::rows("transmittance through 300 blobs, by their reach (σ)", exact, &found))
}

/// Light from 300 blobs in the light of the sun and the sky, by the number of intervals of a ray, against quadrature of equation 22.
///
/// # Errors
///
/// A value out of range, which is a defect.
pub fn light() -> Result<Vec<Convergence>, Error> {
    let lights = [
        Light::Distant { towards: Vector::new(0.48, 0.8, 0.36), colour: [1.0, 0.9, 0.8] },
        Light::Ambient([0.1, 0.15, 0.2]),
    ];
    let blobs = random_smoke(3, 300);
    let (ray, span) = through()?;
    let smoke = Smoke::new(LOOK, blobs.clone())?.lit(&lights, 1)?;
    // What the gas at a centre sends out, from the depth towards the sun, written here a second time.
    let towards = Ray::new(Vector::zeros(), Vector::new(0.48, 0.8, 0.36))?;
    let source = |blob: &Blob| {
        let ray = Ray { origin: blob.centre, ..towards };
        let depth = LOOK.extinction * blobs.iter().map(|other| other.column(&ray, Span::ALL)).sum::<f64>();
        LOOK.albedo[0] * ((-depth).exp() + 0.1) + (1.0 - LOOK.albedo[0]) * LOOK.glow[0]
    };
    let sources: Vec<f64> = blobs.iter().map(source).collect();
    let sent = |s: f64| {
        let point = ray.origin + ray.direction * (span.from + s);
        let sum: f64 = blobs.iter().zip(&sources).map(|(blob, source)| blob.density(&point) * source).sum();
        let before = Span { from: span.from, to: span.from + s };
        let depth = LOOK.extinction * blobs.iter().map(|blob| blob.column(&ray, before)).sum::<f64>();
        LOOK.extinction * sum * (-depth).exp()
    };
    let exact = quadrature(span.to - span.from, 1000, sent);
    let mut found = Vec::new();
    for intervals in [12, 48, 192] {
        let ([red, ..], _) = smoke.clone().with_intervals(intervals).light(&ray, span);
        found.push((intervals as f64, red));
    }
    Ok(Convergence::rows("light from 300 blobs, by intervals of a ray", exact, &found))
}
