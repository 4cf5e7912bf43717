//! Inspection: one module at a time, with its rates, its rule and its neighbours.

use crate::flow::lazy;
use crate::kernel::Simulation;
use dlsys_model::KindId;
use dlsys_tree::{Lineage, ModuleId, SimTime, Visit};

/// A module as it is seen from another.
#[derive(Clone, Debug, PartialEq)]
pub struct InspectedModule {
    /// Its kind.
    pub kind: KindId,
    /// Its lineage: the path of productions from the axiom.
    pub lineage: Lineage,
    /// At the time of the inspection.
    pub parameters: Vec<f64>,
}

/// A module with its rates and its neighbours.
#[derive(Clone, Debug, PartialEq)]
pub struct Inspection {
    /// The module itself.
    pub module: InspectedModule,
    /// Derivatives of the parameters by time, in the model's unit.
    pub rates: Vec<f64>,
    /// Time of birth.
    pub birth: f64,
    /// Index of the rule that applies; None if the kind has no rules, or no context matches.
    pub rule: Option<usize>,
    /// Index of the active `solve` clause in the rule.
    pub solve: Option<usize>,
    /// The modules that the rule's context has found, left to right as written.
    pub context: Vec<InspectedModule>,
    /// The nearest module to the left that counts as context.
    pub left: Option<InspectedModule>,
    /// The nearest module to the right that counts as context.
    pub right: Option<InspectedModule>,
}

impl Simulation<'_> {
    /// Looks at a module, by its number in string order, from 0, brackets not counted, at a time that can be shown
    /// ([`Simulation::can_show`]). None if there is no such module, or if the simulation has failed.
    ///
    /// It costs a copy of the simulation, which itself is not touched.
    pub fn inspect(&self, t: f64, number: usize) -> Option<Inspection> {
        let mut probe = self.clone();
        probe.pass(t).ok()?;
        let modules = |visit| match visit {
            Visit::Module(id) => Some(id),
            _ => None,
        };
        let id = probe.world.tree.walk().filter_map(modules).nth(number)?;
        let at = SimTime::new(t);
        if at.since(probe.instant.at) > 0.0 {
            probe.instant.at = at;
        }
        let now = probe.instant.at;
        probe.flow_stage().show_coupled(now);
        probe.materialise(id);
        probe.flow_stage().refresh(now).ok()?;
        let (rule, solve, context) = match probe.world.state(id) {
            Some(state) => (state.rule.get(), state.solve.get(), state.context.to_vec()),
            None => (None, None, Vec::new()),
        };
        let mut rates = Vec::new();
        probe.flow_stage().rates_ahead(id, 0.0, &mut rates);
        rates.truncate(probe.world.tree.shown(id));
        let skipped = |kind| self.setup.model.kinds.get(kind).skipped;
        let left = probe.world.tree.left(id, skipped);
        let right = probe.world.tree.right(id, skipped);
        Some(Inspection {
            module: probe.seen(id),
            rates,
            birth: probe.world.tree.birth(id).to_f64(),
            rule,
            solve,
            context: context.into_iter().map(|id| probe.seen(id)).collect(),
            left: left.map(|id| probe.seen(id)),
            right: right.map(|id| probe.seen(id)),
        })
    }

    /// Gives a lazy module its state.
    fn materialise(&mut self, id: ModuleId) {
        let rules = &self.setup.model.rules;
        lazy::materialise(&mut self.world, rules, id, &self.instant, &mut self.scratch);
    }

    fn seen(&mut self, id: ModuleId) -> InspectedModule {
        self.materialise(id);
        let mut parameters = Vec::new();
        self.world.values(id, self.instant.at, &mut parameters);
        let tree = &self.world.tree;
        parameters.truncate(tree.shown(id));
        InspectedModule { kind: tree.kind(id), lineage: tree.lineage(id), parameters }
    }
}
