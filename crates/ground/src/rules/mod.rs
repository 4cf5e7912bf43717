//! The rules of the papers in the place of the law of slipping, for comparison, as `euler` is among the methods.
//!
//! Columns, volumes, pours and bodies stay what they are; only what a sweep moves differs. So errors and work of the rules can be set side by side
//! with those of the law. What lies on bodies always slips by the law.

mod board;
mod erosion;
mod posts;

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::kernel::Law;
use crate::tile::Key;
use crate::{Error, Ground, Soil};

/// What moves material that is too steep.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Rule {
    /// The conservative law of this crate.
    #[default]
    Law,
    /// Erosion of Sumner, O'Brien, Hodgins (*Animating Sand, Mud, and Snow*, 1999, section 3): a column gives a fifth of its mean excess height to those
    /// of its eight neighbours to which the slope is too large, all at once, in each tick until no slope is above that of liquidity.
    Sumner,
    /// Erosion of Onoue, Nishita (*Virtual Sandbox*, 2003, section 3.3.3): as Sumner's with one angle of repose, column by column, those that were changed
    /// first and from there outwards.
    Sandbox,
    /// Slices of Li, Moshell (*Modeling Soil*, 1993, sections 3 to 6): the wedge above the worst plane between two posts slides under its weight less
    /// friction and cohesion, along x, z and one diagonal. Three things differ from the paper, whose recurrence is not stable: what a slice loses the next post gets
    /// (section 5 distributes it over all posts beyond with alternating signs), gravity multiplies the forces, and a slice moves at most an eighth
    /// of its length in a sweep.
    Li,
}

/// Speeds of slices: three for each column of a tile.
pub(crate) type Speeds = Arc<BTreeMap<Key, Arc<[f64]>>>;

/// Most sweeps of a tick, of rules that repeat.
const MOST: u32 = 10_000;
/// Parts of the time in which a body falls its own cell in which slices move.
const PARTS: f64 = 4.0;

impl Rule {
    /// All rules with their names.
    pub const NAMED: [(&'static str, Rule); 4] =
        [("law", Rule::Law), ("sumner", Rule::Sumner), ("sandbox", Rule::Sandbox), ("li", Rule::Li)];

    /// Its name.
    pub fn name(self) -> &'static str {
        Rule::NAMED.iter().find(|(_, rule)| *rule == self).map_or("", |(name, _)| name)
    }

    /// Number of sweeps of a tick (s) with cells of a size (m), where the law has its own.
    pub(crate) fn sweeps(self, tick: f64, cell: f64, of_the_law: f64) -> f64 {
        match self {
            Rule::Law => of_the_law,
            // These repeat until they are done.
            Rule::Sumner | Rule::Sandbox => 1.0,
            Rule::Li => (tick * PARTS / libm::sqrt(cell / posts::GRAVITY)).ceil().max(1.0),
        }
    }

    /// Whether cohesion bonds material, which comes loose along the failing planes of whole banks. Slices have their own.
    pub(crate) fn bonds(self, soil: &Soil) -> bool {
        soil.cohesion > 0.0 && self != Rule::Li
    }
}

impl Ground {
    /// The sweeps between two parts of the motion of bodies.
    pub(crate) fn slip(&mut self, law: &Law) -> Result<(), Error> {
        self.step(law)?;
        let rule = self.setup.settings.rule;
        if !matches!(rule, Rule::Sumner | Rule::Sandbox) {
            return Ok(());
        }
        let most = self.soil().liquidity_slope(rule);
        for _ in 0..MOST {
            if self.is_at_rest() || self.book.steepest <= most {
                return Ok(());
            }
            self.step(law)?;
        }
        Err(Error::Sweeps { sweeps: u64::from(MOST), at: self.unrest() })
    }

    /// One sweep by a rule of the papers.
    pub(crate) fn sweep_by(&mut self, rule: Rule) -> Result<(), Error> {
        self.book.sweeps += 1;
        if self.is_at_rest() {
            return Ok(());
        }
        self.spread_fresh();
        let list = self.to_compute();
        let board = board::Board::new(self, &list)?;
        let (moves, steepest, speeds) = match rule {
            Rule::Law | Rule::Sumner => erosion::at_once(&board),
            Rule::Sandbox => erosion::outwards(&board),
            Rule::Li => posts::slide(&board),
        };
        let outcome = board.outcome(&list, &moves);
        self.book.steepest = steepest;
        self.fresh.clear();
        for (key, speeds) in speeds {
            let all = Arc::make_mut(&mut self.speeds);
            match speeds.iter().any(|speed| *speed != 0.0) {
                true => drop(all.insert(key, speeds.into())),
                false => drop(all.remove(&key)),
            }
        }
        self.take_over_moves(outcome)
    }
}
