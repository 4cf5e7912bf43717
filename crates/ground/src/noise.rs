//! Variation of a material from place to place: smooth noise of a fixed wavelength, a pure function of the place.

/// Distance of the random values between which the variation is interpolated, in m.
const WAVELENGTH: f64 = 0.05;

/// A number from -1 to 1, smooth in x and z (m).
pub(crate) fn variation(x: f64, z: f64) -> f64 {
    let (u, v) = (x / WAVELENGTH, z / WAVELENGTH);
    let (i, k) = (u.floor(), v.floor());
    let ease = |t: f64| t * t * (3.0 - 2.0 * t);
    let (s, t) = (ease(u - i), ease(v - k));
    let corner = |di: f64, dk: f64| random((i + di) as i64, (k + dk) as i64);
    let row = |dk: f64| corner(0.0, dk) * (1.0 - s) + corner(1.0, dk) * s;
    row(0.0) * (1.0 - t) + row(1.0) * t
}

/// A number from -1 to 1 for a corner of the lattice.
fn random(i: i64, k: i64) -> f64 {
    let bits =
        (i as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ (k as u64).wrapping_mul(0xc2b2_ae3d_27d4_eb4f);
    2.0 * unit(finalized(bits)) - 1.0
}

/// The finalizer of SplitMix64.
fn finalized(mut bits: u64) -> u64 {
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    bits ^ (bits >> 31)
}

/// Bits that look random, for a number (SplitMix64).
pub(crate) fn mixed(number: u64) -> u64 {
    finalized(number.wrapping_add(0x9e37_79b9_7f4a_7c15))
}

/// A number from 0 to less than 1 for random bits.
pub(crate) fn unit(bits: u64) -> f64 {
    (bits >> 11) as f64 / (1_u64 << 53) as f64
}
