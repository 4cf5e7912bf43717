//! Lives in which all parameters that move do so at constant rates: the events of up to [`LANES`] newborns of one class in one pass over the
//! lanes, without a trajectory for each. The same formulas on the same numbers as [`meeting`](crate::flow::prediction::meeting) and
//! [`first_crossing`](crate::flow::prediction::first_crossing), hence the same bits.

use dlsys_expr::{LANES, Lanes};
use dlsys_model::{Rule, SolutionForm, Solve, ZeroCrossing};
use dlsys_tree::SimTime;

/// The first events of newborns.
#[derive(Clone, Debug)]
pub struct Firsts {
    /// The module goes the general way.
    pub general: [bool; LANES],
    /// The atom whose sides meet first; [`NEVER`] if none ever do.
    pub atom: [u32; LANES],
    pub at: [SimTime; LANES],
    /// The level that a parameter meets then; 0 if it is no parameter.
    pub level: Lanes,
}

/// No atom.
pub const NEVER: u32 = u32::MAX;

impl Default for Firsts {
    fn default() -> Firsts {
        Firsts {
            general: [false; LANES],
            atom: [NEVER; LANES],
            at: [SimTime::ZERO; LANES],
            level: Lanes::default(),
        }
    }
}

/// The number of newborns, their variables and births; the coefficients of the equations and the levels of the atoms.
pub struct Newborns<'b> {
    pub count: usize,
    pub registers: &'b [Lanes],
    pub births: &'b [SimTime],
    pub coefficients: &'b [[Lanes; 4]],
    pub levels: &'b [Lanes],
}

/// How a variable moves.
enum Motion<'b> {
    /// It is `t`.
    Time,
    /// It is `age`.
    Age,
    /// At these rates.
    Steady(&'b Lanes),
}

/// True for a function of time with a constant rate.
pub fn is_linear(law: &SolutionForm) -> bool {
    matches!(law, SolutionForm::Polynomial(program) if program.outputs() == 1)
}

/// True if all parameters that move under a clause do so at constant rates.
pub fn is_straight(clause: Option<&Solve>) -> bool {
    clause.is_none_or(|clause| clause.solution_forms.iter().all(is_linear))
}

impl Firsts {
    /// Finds the first event of each newborn under a clause that is [straight](is_straight).
    pub fn find(&mut self, rule: &Rule, solve: Option<usize>, newborns: &Newborns) {
        let Newborns { count, registers, births, coefficients, levels } = *newborns;
        let (clause, time) = (solve.map(|solve| &rule.solves[solve]), rule.time_variable());
        self.general = [false; LANES];
        self.atom = [NEVER; LANES];
        let laws = clause.map_or(0, |clause| clause.solution_forms.len());
        for [rates, ..] in &coefficients[..laws] {
            for (general, rate) in self.general.iter_mut().zip(rates.iter()) {
                *general |= !rate.is_finite();
            }
        }
        for (atom, watch) in rule.zero_crossings(solve).iter().enumerate() {
            let ZeroCrossing::Formula { variable, .. } = watch else { continue };
            if clause.is_some_and(|clause| clause.unreachable[atom]) {
                continue;
            }
            let steady = || {
                let clause = clause?;
                let equation = clause.of.iter().position(|of| of == variable)?;
                Some(Motion::Steady(&coefficients[equation][0]))
            };
            let motion = match *variable {
                variable if variable == time => Some(Motion::Time),
                variable if variable == time + 1 => Some(Motion::Age),
                _ => steady(),
            };
            let (levels, starts, atom) = (&levels[atom], &registers[*variable], atom as u32);
            let births = &births[..count.min(LANES)];
            match motion {
                None => {}
                Some(Motion::Time) => {
                    self.meet(atom, births, |lane, _| {
                        (SimTime::new(levels[lane]), levels[lane].is_finite(), 0.0)
                    });
                }
                Some(Motion::Age) => self.meet(atom, births, |lane, birth| {
                    let level = levels[lane];
                    (birth.after(level - starts[lane]), level.is_finite(), 0.0)
                }),
                Some(Motion::Steady(rates)) => self.meet(atom, births, |lane, birth| {
                    let level = levels[lane];
                    let tau = (level - starts[lane]) / rates[lane];
                    let meets = level.is_finite() & (tau > 0.0) & tau.is_finite();
                    (birth.after(tau), meets, level)
                }),
            }
        }
    }

    /// Takes the instants at which the sides of an atom meet, whether they do, and the levels.
    #[inline(always)]
    fn meet(
        &mut self,
        atom: u32,
        births: &[SimTime],
        meeting: impl Fn(usize, SimTime) -> (SimTime, bool, f64),
    ) {
        for (lane, &birth) in births.iter().enumerate() {
            let (time, meets, level) = meeting(lane, birth);
            if !meets || time.since(birth) <= 0.0 {
                continue;
            }
            if self.atom[lane] != NEVER {
                let later = time.since(self.at[lane]);
                // The order of two events at nearly one instant is decided in the general way.
                self.general[lane] |= later.abs() <= 2.0 * time.resolution();
                if later >= 0.0 {
                    continue;
                }
            }
            (self.atom[lane], self.at[lane], self.level[lane]) = (atom, time, level);
        }
    }
}
