//! Erosion between neighbouring columns, of Sumner, O'Brien, Hodgins (1999) and of Onoue, Nishita (2003).

use std::collections::BTreeSet;

use super::Rule;
use super::board::{AROUND, Board, Moves, Site, SpeedLists};
use crate::Soil;
use crate::tile::QUANTA;

/// σ, the part of the mean excess that a column gives in a pass: 0.2 for all materials of Sumner's table 1.
const ROUGHNESS: f64 = 0.2;

impl Soil {
    /// Tangent of θ_stop, to which erosion is repeated within a tick. Sumner's table 1 has the inner angle for sand and that of repose for mud and snow;
    /// that is the inner one, unless it is so steep that nothing would be repeated.
    pub(super) fn liquidity_slope(&self, rule: Rule) -> f64 {
        const STANDS: f64 = 85.0;
        match rule {
            Rule::Sumner if self.inner < STANDS => self.inner_slope(),
            _ => self.slope(),
        }
    }
}

/// What a column gives to its neighbours, and the largest slope down from it.
fn given(
    board: &Board,
    site: Site,
    top: impl Fn(Site) -> i64,
    loose: i64,
    angle: Rule,
) -> (Vec<(Site, i64)>, f64) {
    let (own, outer) = (top(site), board.ground.setup.law.slope / QUANTA);
    let (mut steepest, mut sum, mut low) = (0.0_f64, 0.0, Vec::new());
    for (step, distance) in AROUND {
        let Some(beside) = board.beside(site, step) else { continue };
        let drop = (own - top(beside)) as f64;
        if drop <= 0.0 {
            continue;
        }
        let slope = drop / (distance * QUANTA);
        let repose = if angle == Rule::Sandbox { outer } else { board.repose(site, beside) };
        if slope > repose && loose > 0 && board.room(beside) > 0 {
            steepest = steepest.max(slope);
            sum += drop;
            low.push(beside);
        }
    }
    if low.is_empty() {
        return (Vec::new(), 0.0);
    }
    let count = low.len() as i64;
    let amount = ((ROUGHNESS * sum / count as f64) as i64).min(loose);
    // Eight neighbours may fill one column.
    let share = |beside: &Site| (amount / count).min(board.room(*beside) / 8);
    let given: Vec<_> =
        low.iter().map(|beside| (*beside, share(beside))).filter(|(_, part)| *part > 0).collect();
    (given, steepest)
}

/// All columns give at once, by the heights before.
pub(super) fn at_once(board: &Board) -> (Moves, f64, SpeedLists) {
    let (mut moves, mut steepest) = (board.still(), 0.0_f64);
    for site in board.sites() {
        let (given, slope) = given(board, site, |site| board.top(site), board.loose(site), Rule::Sumner);
        steepest = steepest.max(slope);
        for (to, part) in given {
            moves[site.0][site.1] -= part;
            moves[to.0][to.1] += part;
        }
    }
    (moves, steepest, Vec::new())
}

/// Column after column, those that were changed first and from there outwards, by the heights that those before have made.
pub(super) fn outwards(board: &Board) -> (Moves, f64, SpeedLists) {
    let (mut moves, mut steepest) = (board.still(), 0.0_f64);
    let side = board.ground.setup.settings.side;
    let stirred = |(tile, index): &Site| board.tiles[*tile].1.awake[index / side] >> (index % side) & 1 != 0;
    let is_fresh = |(tile, _): &Site| board.ground.fresh.binary_search(&board.tiles[*tile].0).is_ok();
    let mut front: Vec<Site> = board.sites().filter(|site| stirred(site) || is_fresh(site)).collect();
    let mut known: BTreeSet<Site> = front.iter().copied().collect();
    while !front.is_empty() {
        let mut next = Vec::new();
        for site in front {
            let top = |(tile, index): Site| board.top((tile, index)) + moves[tile][index];
            let loose = board.loose(site) + moves[site.0][site.1];
            let (given, slope) = given(board, site, top, loose, Rule::Sandbox);
            steepest = steepest.max(slope);
            for (to, part) in given {
                moves[site.0][site.1] -= part;
                moves[to.0][to.1] += part;
                if to.0 < board.computed && known.insert(to) {
                    next.push(to);
                }
            }
            for (step, _) in AROUND {
                let beside = board.beside(site, step).filter(|beside| beside.0 < board.computed);
                let high = beside.filter(|beside| board.top(*beside) > board.top(site));
                if let Some(beside) = high.filter(|_| moves[site.0][site.1] != 0)
                    && known.insert(beside)
                {
                    next.push(beside);
                }
            }
        }
        front = next;
    }
    (moves, steepest, Vec::new())
}
