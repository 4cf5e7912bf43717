//! Random numbers as functions of seed, module and purpose.
//!
//! A random number is a function of the seed, of the lineage of the module that it belongs to, and of the place in the
//! text that uses it, and of nothing else: there is no generator whose state goes from one draw to the next. So no
//! draw depends on threads, on the order of events, on what is observed, or on what happens elsewhere in the plant.
//!
//! The function is the finalizer of SplitMix64 (Steele, Lea, Flood 2014) over the three numbers, one after another:
//! a counter-based generator in the sense of Salmon et al. (SC '11), with the lineage as the counter.

use super::lineage::mix;
use super::{Family, Lineage};

/// The seed of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Seed(u64);

/// The use of a random number: numbers for different purposes are independent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// The draw of this number among those in the parameters of one module.
    Parameter(u32),
    /// The time of an event at a rate, by the key of its clause.
    Clock(u64),
    /// The choice between the successors of a production, by its key.
    Choice(u64),
}

impl Seed {
    /// The seed of a run. Numbers drawn from consecutive seeds are unrelated.
    pub fn new(seed: u64) -> Seed {
        // Consecutive seeds must give unrelated numbers.
        Seed(mix(0x6469_6365, seed))
    }

    /// A number uniformly distributed in the open interval from 0 to 1, with 53 random bits.
    pub fn unit(self, module: Lineage, purpose: Purpose) -> f64 {
        let (sort, number) = match purpose {
            Purpose::Parameter(number) => (1, u64::from(number)),
            Purpose::Clock(key) => (2, key),
            Purpose::Choice(key) => (3, key),
        };
        let bits = mix(mix(mix(self.0, module.id), sort), number);
        ((bits >> 11) as f64 + 0.5) / (1u64 << 53) as f64
    }

    /// The same, for the module at a place of a successor.
    pub fn unit_of_child(self, family: Family, place: usize, purpose: Purpose) -> f64 {
        self.unit(family.child(place), purpose)
    }

    /// The cumulative hazard at which the clock of a module fires: exponentially distributed with mean 1.
    pub fn endurance(self, module: Lineage, key: u64) -> f64 {
        -self.unit(module, Purpose::Clock(key)).ln()
    }
}

/// A key for a clause, from the head of its rule and its number there. It does not depend on other rules, or on the position of
/// the rule in the text.
pub fn key(head: &str, clause: usize) -> u64 {
    let letters = head.bytes().fold(0x6865_6164, |state, byte| mix(state, u64::from(byte)));
    mix(letters, clause as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Chi-square with 255 degrees of freedom: mean 255, deviation 22.6.
    fn chi_square(values: impl Iterator<Item = f64>) -> f64 {
        let (mut bins, mut n) = ([0.0; 256], 0.0);
        for u in values {
            bins[(u * 256.0) as usize] += 1.0;
            n += 1.0;
        }
        bins.iter().map(|b| (b - n / 256.0) * (b - n / 256.0) / (n / 256.0)).sum()
    }

    #[test]
    fn numbers_are_uniform_along_each_of_their_arguments() {
        let root = Lineage::of_axiom(0);
        let mut line = root;
        let along: [Vec<f64>; 5] = [
            (0..100_000).map(|s| Seed::new(s).unit(root, Purpose::Parameter(0))).collect(),
            (0..100_000).map(|i| Seed::new(0).unit(Lineage::of_axiom(i), Purpose::Parameter(0))).collect(),
            (0..100_000).map(|i| Seed::new(0).unit(root, Purpose::Parameter(i))).collect(),
            (0..100_000).map(|i| Seed::new(0).unit(root, Purpose::Choice(key("A/1", i)))).collect(),
            (0..100_000)
                .map(|_| {
                    line = line.child(0, 0);
                    Seed::new(0).unit(line, Purpose::Clock(7))
                })
                .collect(),
        ];
        for values in along {
            // Neighbours have nothing in common, either.
            let pairs = values.windows(2).map(|w| (w[0] + w[1]).fract());
            for chi in [chi_square(values.iter().copied()), chi_square(pairs)] {
                assert!((170.0..350.0).contains(&chi), "{chi}");
            }
        }
    }
}
