//! Random numbers in the parameters of new modules, and choices between successors.
//!
//! A draw is the quantile function of its distribution at a number between 0 and 1 that belongs to the module
//! (`dlsys_tree::Seed`). So it varies smoothly with the parameters of the distribution: a small change of a
//! deviation changes a plant slightly instead of replacing it with another one.

mod beta;

use statrs::function::erf::erfc_inv;

use dlsys_diagnostic::Span;
use dlsys_expr::Program;

/// A family of distributions that a model can draw from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Distribution {
    /// `uniform(a, b)`: between a and b.
    Uniform,
    /// `normal(mean, sd)`
    Normal,
    /// `lognormal(mu, sigma)`: its logarithm is normal, with mean mu and deviation sigma.
    Lognormal,
    /// `exponential(rate)`: of mean 1/rate.
    Exponential,
    /// `beta(a, b)`: between 0 and 1, of mean a/(a + b).
    Beta,
    /// `integer(a, b)`: a whole number from a to b, both ends included.
    Integer,
    /// `choice(a, b, …)`: one of the values, each as likely as the others.
    Choice,
}

impl Distribution {
    /// Name, distribution and notation of each.
    pub const NAMED: [(&'static str, Distribution, &'static str); 7] = [
        ("uniform", Distribution::Uniform, "uniform(a, b)"),
        ("normal", Distribution::Normal, "normal(mean, sd)"),
        ("lognormal", Distribution::Lognormal, "lognormal(mu, sigma)"),
        ("exponential", Distribution::Exponential, "exponential(rate)"),
        ("beta", Distribution::Beta, "beta(a, b)"),
        ("integer", Distribution::Integer, "integer(a, b)"),
        ("choice", Distribution::Choice, "choice(a, b, c)"),
    ];

    /// The distribution with a name.
    pub fn named(name: &str) -> Option<Distribution> {
        Distribution::NAMED.iter().find(|(n, ..)| *n == name).map(|(_, distribution, _)| *distribution)
    }

    fn entry(self) -> (&'static str, Distribution, &'static str) {
        Distribution::NAMED.into_iter().find(|(_, d, _)| *d == self).expect("all are named")
    }

    /// Its name in the language.
    pub fn name(self) -> &'static str {
        self.entry().0
    }

    /// Its notation with parameters.
    pub fn usage(self) -> &'static str {
        self.entry().2
    }

    /// The condition on its parameters and the remedy if it fails, as a sentence.
    pub fn demand(self) -> &'static str {
        match self {
            Distribution::Uniform => "uniform(a, b) needs a <= b: put the smaller number first",
            Distribution::Integer => "integer(a, b) needs a whole number between a and b, both included",
            Distribution::Normal => {
                "normal(mean, sd) needs a deviation of at least 0: bound it, as in `max(0, …)`"
            }
            Distribution::Lognormal => {
                "lognormal(mu, sigma) needs a deviation of at least 0: bound it, as in `max(0, …)`"
            }
            Distribution::Exponential => {
                "exponential(rate) needs a rate greater than 0: bound it, as in `max(0.01, …)`"
            }
            Distribution::Beta => "beta(a, b) needs a > 0 and b > 0: bound them, as in `max(0.01, …)`",
            Distribution::Choice => "choice(a, b, …) needs finite values",
        }
    }

    /// Number of its parameters; None for any number from 1 on.
    pub fn parameters(self) -> Option<usize> {
        match self {
            Distribution::Uniform
            | Distribution::Normal
            | Distribution::Lognormal
            | Distribution::Beta
            | Distribution::Integer => Some(2),
            Distribution::Exponential => Some(1),
            Distribution::Choice => None,
        }
    }

    /// The reason why these parameters are invalid, if they are. All of them must be finite.
    pub fn fault(self, p: &[f64]) -> Option<String> {
        if let Some(bad) = p.iter().find(|x| !x.is_finite()) {
            return Some(format!("a parameter of it is {bad}"));
        }
        let second = p.get(1).copied().unwrap_or(0.0);
        match self {
            Distribution::Uniform if p[0] > second => Some(format!("{} is greater than {second}", p[0])),
            Distribution::Integer => {
                if p[0].ceil() > second.floor() {
                    return Some(format!("there is no whole number from {} to {second}", p[0]));
                }
                // Beyond 2^53, floats do not represent all whole numbers.
                let large = p.iter().any(|x| x.abs() > (1u64 << 52) as f64);
                large.then(|| "whole numbers are drawn between -2^52 and 2^52".to_owned())
            }
            Distribution::Normal | Distribution::Lognormal if second < 0.0 => {
                Some(format!("its deviation is {second}"))
            }
            Distribution::Beta if p[0] <= 0.0 => Some(format!("its first parameter is {}", p[0])),
            Distribution::Beta if second <= 0.0 => Some(format!("its second parameter is {second}")),
            Distribution::Exponential if p[0] <= 0.0 => Some(format!("its rate is {}", p[0])),
            _ => None,
        }
    }

    /// The quantile at `u` from 0 to 1; NaN for invalid parameters.
    pub fn quantile(self, p: &[f64], u: f64) -> f64 {
        if self.fault(p).is_some() {
            return f64::NAN;
        }
        match self {
            Distribution::Uniform => p[0] + (p[1] - p[0]) * u,
            Distribution::Normal => p[0] + p[1] * normal(u),
            Distribution::Lognormal => (p[0] + p[1] * normal(u)).exp(),
            // The quantile at 1 - u, with the same distribution: ln(1 - u) preserves the digits of small values.
            Distribution::Exponential => -(-u).ln_1p() / p[0],
            Distribution::Beta => beta::quantile(p[0], p[1], u),
            Distribution::Integer => {
                let (low, high) = (p[0].ceil(), p[1].floor());
                (low + (u * (high - low + 1.0)).floor()).min(high)
            }
            Distribution::Choice => p[((u * p.len() as f64) as usize).min(p.len() - 1)],
        }
    }
}

/// The quantile of the standard normal distribution.
fn normal(u: f64) -> f64 {
    -std::f64::consts::SQRT_2 * erfc_inv(2.0 * u)
}

/// A random number that the arguments of a module in a successor read.
#[derive(Clone, Debug)]
pub struct Draw {
    /// The family from which the number is drawn.
    pub distribution: Distribution,
    /// Its parameters. They read the variables of the rule, then the draws before this one.
    pub parameters: Program,
    /// Index of its module in the successor, brackets not counted.
    pub place: usize,
    /// Its number among the draws of that module.
    pub number: u32,
    /// True if only one branch of an `if` reads it, so that invalid parameters are an error only where that branch is taken.
    pub conditional: bool,
    /// The place of the draw in the text.
    pub span: Span,
}

/// The initial value of a [`Clock`] of a new module.
#[derive(Clone, Copy, Debug)]
pub struct NewClock {
    /// Index of the module in the successor, brackets not counted.
    pub place: usize,
    /// Number of arguments of the successor before it, clocks not counted.
    pub after: usize,
    /// The `dlsys_tree::key` of the clause.
    pub key: u64,
}

/// The clock of an event at a rate (`at rate λ produce …`): a hidden parameter of the module.
///
/// It starts at an exponentially distributed number of mean 1 and decreases at the rate λ while the condition of the
/// clause holds; the event happens when it reaches 0. That is the first event of a Poisson process with the intensity λ,
/// for any dependence of λ on the state and without a time step (Davis 1984, piecewise-deterministic Markov processes).
#[derive(Clone, Copy, Debug)]
pub struct Clock {
    /// Number of the hidden parameter among the rule's variables.
    pub parameter: usize,
    /// Index of the `produce` clause.
    pub produce: usize,
}

/// The index at which the cumulated weights exceed the part `u`, from 0 to 1, of their sum.
///
/// # Errors
/// If a weight is negative or not finite, or if all are 0; the text gives the reason.
pub fn choose(weights: &[f64], u: f64) -> Result<usize, String> {
    if let Some(bad) = weights.iter().find(|w| !(w.is_finite() && **w >= 0.0)) {
        return Err(format!("a weight is {bad}"));
    }
    let total: f64 = weights.iter().sum();
    if !(total > 0.0 && total.is_finite()) {
        return Err(format!("the weights add up to {total}"));
    }
    let mut left = u * total;
    for (i, weight) in weights.iter().enumerate() {
        if left < *weight {
            return Ok(i);
        }
        left -= weight;
    }
    // By rounding, `left` may exceed the last positive weight.
    Ok(weights.iter().rposition(|w| *w > 0.0).expect("some weight is positive"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_of_the_normal_distribution_are_those_of_tables() {
        // Abramowitz and Stegun, table 26.5.
        for (u, z) in [(0.5, 0.0), (0.975, 1.959_963_984_540_054), (0.999, 3.090_232_306_167_813_5)] {
            assert!((normal(u) - z).abs() < 1e-13, "{u}: {}", normal(u));
            assert!((normal(1.0 - u) + z).abs() < 1e-12, "{u}");
        }
        assert!((normal(0.5 / (1u64 << 53) as f64) + 8.292_361_075_813_595).abs() < 1e-9);
    }

    #[test]
    fn choices_follow_their_weights() {
        let of = |u| choose(&[2.0, 0.0, 1.0, 1.0], u);
        assert_eq!([0.0, 0.49, 0.5, 0.74, 0.76, 1.0].map(of), [0, 0, 2, 2, 3, 3].map(Ok));
        assert!(choose(&[0.0, 0.0], 0.5).is_err());
        assert!(choose(&[1.0, -1.0], 0.5).is_err());
        assert!(choose(&[1.0, f64::NAN], 0.5).is_err());
    }

    #[test]
    fn whole_numbers_include_both_ends() {
        let die = |u| Distribution::Integer.quantile(&[1.0, 6.0], u);
        assert_eq!([1e-9, 0.17, 0.5, 1.0 - 1e-9].map(die), [1.0, 2.0, 4.0, 6.0]);
        assert!(Distribution::Integer.fault(&[1.2, 1.8]).is_some());
    }
}
