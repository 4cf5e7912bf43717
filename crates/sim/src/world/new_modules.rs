//! The modules of successors, between their computation and their place in the tree.

use dlsys_model::{KindId, Successor};

/// Modules of successors: the parameters of all; the kinds of those whose repetitions and conditions decide which there are.
#[derive(Clone, Debug, Default)]
pub struct NewModules {
    /// Kinds, brackets included, of the successors that are not [`Successor::Plain`].
    pub kinds: Vec<KindId>,
    /// Parameters in string order, hidden ones included.
    pub arguments: Vec<f64>,
}

impl NewModules {
    /// Forgets all modules.
    pub fn clear(&mut self) {
        self.kinds.clear();
        self.arguments.clear();
    }
}

/// The kinds of the modules of a successor, brackets included; `expanded` are those of [`NewModules`].
#[inline]
pub fn kinds_of<'k>(successor: &'k Successor, expanded: &'k [KindId]) -> &'k [KindId] {
    match successor {
        Successor::Plain(stretch) => &stretch.kinds,
        Successor::Parts(_) => expanded,
    }
}
