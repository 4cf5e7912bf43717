//! Working memory that is used again and again; nothing in it lasts beyond one stage.

use dlsys_expr::Scratch as Registers;

/// Memory for the variables of a rule and for the evaluation of its programs.
#[derive(Clone, Debug, Default)]
pub struct Scratch {
    /// The variables of a rule: own parameters, those of the context, aggregates, `t`, `age`, switches.
    pub variables: Vec<f64>,
    pub registers: Registers<f64>,
    pub rates: Vec<f64>,
}

/// Lists that get longer are made as long as they may become at once: growing bit by bit, they would be there twice.
pub const LONG: usize = 1 << 18;

/// Lists that were longer are not kept for the next instant: what is done for so many modules costs much more than a new list, and
/// ten of them would be a tenth of what is kept of a tissue.
const KEPT: usize = 1 << 12;

/// Empties a list, and gives back its memory if that is much.
pub fn clear<T>(list: &mut Vec<T>) {
    list.clear();
    if list.capacity() > KEPT {
        *list = Vec::new();
    }
}
