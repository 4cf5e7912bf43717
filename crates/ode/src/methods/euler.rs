//! The forward Euler method, order 1, with a fixed step: the method of the paper (Prusinkiewicz, Hammel and Mjolsness 1993, section 8).

use crate::Rates;
use crate::dense::Dense;
use crate::one_step::{OneStep, Step, Trial};
use crate::workspace::Workspace;
use dlsys_expr::SimTime;

/// The method; its dense output is a straight line.
#[derive(Clone, Debug, Default)]
pub struct Euler;

impl OneStep for Euler {
    fn error_order(&self) -> u32 {
        1
    }

    fn stages(&self) -> usize {
        2
    }

    fn nodes(&self) -> &[f64] {
        &[0.0, 0.5, 1.0]
    }

    fn attempt(&mut self, work: &mut Workspace, _: &mut impl Rates, step: Step<'_>, _: f64) -> Trial {
        for (end, (y, k)) in work.end.iter_mut().zip(step.y.iter().zip(work.k[0].iter())) {
            *end = y + step.h * k;
        }
        work.outcome(0.0, 0.0, 0)
    }

    fn dense(
        &mut self,
        work: &mut Workspace,
        _: &mut impl Rates,
        step: Step<'_>,
        end: Option<SimTime>,
    ) -> Dense {
        let c = step.y.iter().zip(&work.end).flat_map(|(&a, &b)| [a, b]).collect();
        Dense::new(step.start, end, step.h, 1, c)
    }

    fn accept(&mut self, _: &mut Workspace) -> bool {
        false
    }
}
