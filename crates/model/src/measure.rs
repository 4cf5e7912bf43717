//! A number that is measured of a whole string: a sum over modules.

use dlsys_expr::Program;

use super::KindId;

/// The sum of an expression over all modules of some kinds.
#[derive(Clone, Debug)]
pub struct Measure {
    /// As it is written.
    pub name: String,
    /// By kind: it is one of those.
    pub kinds: Vec<bool>,
    /// Of a module's parameters, then `t` and its age.
    pub program: Program,
}

impl Measure {
    /// The sum over some modules: kind, parameters and age of each, at the time `t`.
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
