//! Rates of values that depend on neighbours, as far as they were found at an instant.
//!
//! The rate of a value that reads others is a sum over theirs (the chain rule), and theirs are sums in turn: along a
//! chain of modules, or where each reads several, the same rates are wanted over and over. Each is found once. One that
//! is wanted while it is being looked for, because values hang together in a circle, counts as nothing.

use std::collections::HashMap;

use smallvec::SmallVec;

use dlsys_tree::ModuleId;

/// The rates that were found at an instant.
#[derive(Clone, Debug, Default)]
pub struct KnownRates {
    /// Of each module, by the time ahead of the instant.
    rates: HashMap<ModuleId, SmallVec<[Known; 1]>>,
    /// The modules whose rates were found from those of a module.
    readers: HashMap<ModuleId, Vec<ModuleId>>,
}

#[derive(Clone, Debug)]
struct Known {
    tau: u64,
    rates: SmallVec<[f64; 4]>,
}

impl KnownRates {
    /// Forgets everything: another instant, or other equations of many modules.
    pub fn clear(&mut self) {
        self.rates.clear();
        self.readers.clear();
    }

    /// Removes the rates that follow from the equations of a module, for these have changed.
    pub fn forget(&mut self, id: ModuleId) {
        let mut stale = vec![id];
        while let Some(module) = stale.pop() {
            self.rates.remove(&module);
            stale.extend(self.readers.remove(&module).unwrap_or_default());
        }
    }

    /// The rates of a module's algebraic parameters, `tau` ahead.
    pub fn get(&self, id: ModuleId, tau: f64) -> Option<&[f64]> {
        let known = self.rates.get(&id)?.iter().find(|known| known.tau == tau.to_bits())?;
        Some(&known.rates)
    }

    /// Begins to look for so many rates, which are made of those of the modules that are `read`.
    pub fn begin(&mut self, id: ModuleId, tau: f64, count: usize, read: &[ModuleId]) {
        self.rates
            .entry(id)
            .or_default()
            .push(Known { tau: tau.to_bits(), rates: smallvec::smallvec![0.0; count] });
        for module in read {
            self.readers.entry(*module).or_default().push(id);
        }
    }

    /// Rates that were found.
    pub fn set(&mut self, id: ModuleId, tau: f64, rates: impl Iterator<Item = f64>) {
        let known =
            self.rates.get_mut(&id).and_then(|all| all.iter_mut().find(|known| known.tau == tau.to_bits()));
        if let Some(known) = known {
            known.rates = rates.collect();
        }
    }
}
