//! Measures: numbers computed from a whole string, as sums over its modules.

use dlsys_expr::Program;

use super::KindId;

/// The sum of an expression over all modules of some kinds.
#[derive(Clone, Debug)]
pub struct Measure {
    /// The text of the measure.
    pub name: String,
    /// By index of a kind: true if its modules are included.
    pub kinds: Vec<bool>,
    /// The term; it reads the parameters of a module, then `t`, then the age of the module.
    pub program: Program,
}

impl Measure {
    /// The sum over modules, given as kind, parameters and age, at the time `t`.
    pub fn over<'a>(&self, t: f64, modules: impl Iterator<Item = (KindId, &'a [f64], f64)>) -> f64 {
        let (mut variables, mut scratch, mut out) = (Vec::new(), Vec::new(), [0.0]);
        let mut sum = 0.0;
        for (kind, parameters, age) in modules {
            if self.kinds.get(kind.index()) != Some(&true) {
                continue;
            }
            variables.clear();
            variables.extend_from_slice(parameters);
            variables.extend([t, age]);
            self.program.eval(&variables, &mut scratch, &mut out);
            sum += out[0];
        }
        sum
    }
}
