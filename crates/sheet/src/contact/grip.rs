//! Forces of contacts of sheets with solids.

use crate::Error;
use crate::error::check;

/// Forces of a contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grip {
    /// Coulomb's coefficient of friction.
    pub friction: f64,
    /// Speed in m/s up to which friction is proportional to the speed: what sticks creeps more slowly.
    pub creep: f64,
    /// Damping a in s/m: a normal force is `1 - a ġ` times that of the spring while the gap g changes, but not negative (Hunt, Crossley, *Coefficient
    /// of restitution interpreted as damping in vibroimpact*, J. Appl. Mech. 42, 1975).
    pub damping: f64,
    /// Stiffness of a contact, in units of that of the face (E t) or cord (EA/L) which is touched.
    pub stiffness: f64,
}

impl Default for Grip {
    /// A friction of 0.4 above 5 mm/s, a damping of 0.5 s/m, a stiffness of 50.
    fn default() -> Grip {
        Grip { friction: 0.4, creep: 5e-3, damping: 0.5, stiffness: 50.0 }
    }
}

impl Grip {
    pub(crate) fn check(&self) -> Result<(), Error> {
        check("a friction", self.friction, self.friction >= 0.0, "0 or more")?;
        check("a speed of creep (m/s)", self.creep, self.creep > 0.0, "more than 0")?;
        check("a damping of contacts (s/m)", self.damping, self.damping >= 0.0, "0 or more")?;
        check("a stiffness of contacts", self.stiffness, self.stiffness > 0.0, "more than 0")
    }
}

/// The force that presses on what is `depth` m in a solid, its slope, and its energy, for a stiffness of 1 N/m: `d/(1 - d/b)²`, a spring that is
/// stiffer in the depth b and infinite there. It is followed to 0.9 b; steps that come so deep are not taken.
pub(crate) fn press(depth: f64, most: f64) -> [f64; 3] {
    if depth <= 0.0 {
        return [0.0; 3];
    }
    if most.is_infinite() {
        return [depth, 1.0, 0.5 * depth * depth];
    }
    let part = (depth / most).min(0.9);
    let rest = 1.0 - part;
    let energy = most * most * (1.0 / rest - 1.0 + libm::log(rest));
    [part * most / (rest * rest), (1.0 + part) / (rest * rest * rest), energy]
}
