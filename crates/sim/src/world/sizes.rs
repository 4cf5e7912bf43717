//! How large the values of each kind of integrated parameter are during a common step: what is next to nothing among others is so beside the largest
//! of them, whatever its unit.

use super::World;
use super::coupled_solution::CoupledSolution;
use super::trajectories::Law;
use dlsys_model::KindId;
use std::sync::OnceLock;

/// Beside values of 1 and more, values that are smaller than this are not followed to their own accuracy; see the step control of `dlsys_ode`.
pub const NEXT_TO_NOTHING: f64 = 1e-17;

/// The largest values, by kind and parameter; computed when they are first asked for.
#[derive(Clone, Debug, Default)]
pub struct Sizes(OnceLock<Vec<Vec<f64>>>);

impl Sizes {
    fn all(&self, world: &World, solution: &CoupledSolution) -> &[Vec<f64>] {
        self.0.get_or_init(|| {
            let mut sizes: Vec<Vec<f64>> = Vec::new();
            for state in world.states.iter().filter(|state| state.is_alive && state.coupled) {
                let kind = world.tree.kind(state.id).index();
                for (parameter, law) in state.trajectories.iter().enumerate() {
                    let Law::Coupled(component) = law else { continue };
                    let Some(size) = solution.largest(component as usize) else { continue };
                    if sizes.len() <= kind {
                        sizes.resize(kind + 1, Vec::new());
                    }
                    let own = &mut sizes[kind];
                    if own.len() <= parameter {
                        own.resize(parameter + 1, 0.0);
                    }
                    own[parameter] = own[parameter].max(size);
                }
            }
            sizes
        })
    }
}

impl World {
    /// What is next to nothing for a parameter of coupled modules: [`NEXT_TO_NOTHING`] times the largest that any of its kind becomes in the common
    /// step, at most that of 1. Two that differ by less may be equal.
    pub fn next_to_nothing(&self, kind: KindId, parameter: usize) -> f64 {
        let Some(solution) = &self.coupled else { return 0.0 };
        let sizes = solution.sizes.all(self, solution);
        let size = sizes.get(kind.index()).and_then(|own| own.get(parameter)).copied().unwrap_or(0.0);
        NEXT_TO_NOTHING * size.min(1.0)
    }
}
