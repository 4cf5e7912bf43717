//! The classical Runge-Kutta method, order 4, with a fixed step (Hairer, Nørsett and Wanner 1993, section II.1).

use crate::Rates;
use crate::dense::Dense;
use crate::one_step::{OneStep, Step, Trial};
use crate::workspace::Workspace;
use dlsys_expr::SimTime;

/// The method; its dense output is the cubic Hermite interpolant.
#[derive(Clone, Debug, Default)]
pub struct Rk4;

/// The stage at the end of the step: it gives the interpolant and is the first stage of the next step.
const LAST: usize = 4;

impl OneStep for Rk4 {
    fn error_order(&self) -> u32 {
        1
    }

    fn stages(&self) -> usize {
        LAST + 1
    }

    fn carried(&self) -> usize {
        LAST
    }

    fn nodes(&self) -> &[f64] {
        &[0.0, 0.5, 1.0]
    }

    fn attempt(&mut self, work: &mut Workspace, system: &mut impl Rates, step: Step<'_>, _: f64) -> Trial {
        let Step { y, h, .. } = step;
        for (i, c) in [(1, 0.5), (2, 0.5), (3, 1.0)] {
            for (s, (y, k)) in work.stage.iter_mut().zip(y.iter().zip(work.k[i - 1].iter())) {
                *s = y + h * c * k;
            }
            work.evaluate(system, c * h, i);
        }
        for (i, end) in work.end.iter_mut().enumerate() {
            let [a, b, c, d] = [0, 1, 2, 3].map(|s| work.k[s][i]);
            *end = y[i] + h / 6.0 * (a + 2.0 * (b + c) + d);
        }
        work.stage[..y.len()].copy_from_slice(&work.end);
        work.evaluate(system, h, LAST);
        work.outcome(0.0, 0.0, LAST)
    }

    fn dense(
        &mut self,
        work: &mut Workspace,
        _: &mut impl Rates,
        step: Step<'_>,
        end: Option<SimTime>,
    ) -> Dense {
        let h = step.h;
        let mut c = Vec::with_capacity(4 * step.y.len());
        for (j, (a, b)) in step.y.iter().zip(&work.end).enumerate() {
            c.extend([*a, a + h * work.k[0][j] / 3.0, b - h * work.k[LAST][j] / 3.0, *b]);
        }
        Dense::new(step.start, end, h, 3, c)
    }

    fn accept(&mut self, work: &mut Workspace) -> bool {
        work.k.swap(0, self.carried());
        true
    }
}
