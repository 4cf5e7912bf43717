//! Random numbers in the parameters of new modules, and choices between successors.
//!
//! A draw is the quantile function of its distribution at a number between 0 and 1 that belongs to the module
//! ([`Seed`](dlsys_tree::Seed)). So it moves smoothly with the distribution's parameters: a plant does not become
//! another one because a deviation is changed by a little.

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
    /// `integer(a, b)`: a whole number from a to b, both ends included.
    Integer,
    /// `choice(a, b, …)`: one of the values, each as likely as the others.
    Choice,
}

impl Distribution {
    /// The names of the distributions, with their parameters as people write them.
    pub const NAMED: [(&'static str, Distribution, &'static str); 6] = [
        ("uniform", Distribution::Uniform, "uniform(a, b)"),
        ("normal", Distribution::Normal, "normal(mean, sd)"),
        ("lognormal", Distribution::Lognormal, "lognormal(mu, sigma)"),
        ("exponential", Distribution::Exponential, "exponential(rate)"),
        ("integer", Distribution::Integer, "integer(a, b)"),
        ("choice", Distribution::Choice, "choice(a, b, c)"),
    ];

    /// The distribution of a name.
    pub fn named(name: &str) -> Option<Distribution> {
        Distribution::NAMED.iter().find(|(n, ..)| *n == name).map(|(_, distribution, _)| *distribution)
    }

    fn entry(self) -> (&'static str, Distribution, &'static str) {
        Distribution::NAMED.into_iter().find(|(_, d, _)| *d == self).expect("all are named")
    }

    /// The word of the language for it.
    pub fn name(self) -> &'static str {
        self.entry().0
    }

    /// How it is written.
    pub fn usage(self) -> &'static str {
        self.entry().2
    }

    /// What it needs, and what to do.
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
            Distribution::Choice => "choice(a, b, …) needs finite values",
        }
    }

    /// Number of its parameters; None for any number from 1 on.
    pub fn parameters(self) -> Option<usize> {
        match self {
            Distribution::Uniform
            | Distribution::Normal
            | Distribution::Lognormal
            | Distribution::Integer => Some(2),
            Distribution::Exponential => Some(1),
            Distribution::Choice => None,
        }
    }

    /// What is wrong with its parameters, if anything is. Values that are not finite are wrong.
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
                // Beyond, floats are not dense in the whole numbers.
                let large = p.iter().any(|x| x.abs() > (1u64 << 52) as f64);
                large.then(|| "whole numbers are drawn between -2^52 and 2^52".to_owned())
            }
            Distribution::Normal | Distribution::Lognormal if second < 0.0 => {
                Some(format!("its deviation is {second}"))
            }
            Distribution::Exponential if p[0] <= 0.0 => Some(format!("its rate is {}", p[0])),
            _ => None,
        }
    }

    /// The value below which a part `u` of the distribution lies; NaN for parameters at fault.
    pub fn quantile(self, p: &[f64], u: f64) -> f64 {
        if self.fault(p).is_some() {
            return f64::NAN;
        }
        match self {
            Distribution::Uniform => p[0] + (p[1] - p[0]) * u,
            Distribution::Normal => p[0] + p[1] * normal(u),
            Distribution::Lognormal => (p[0] + p[1] * normal(u)).exp(),
            // Of 1 - u the logarithm of u: the same distribution, and small values keep their digits.
            Distribution::Exponential => -(-u).ln_1p() / p[0],
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

/// A random number in the parameters of a module of a successor.
#[derive(Clone, Debug)]
pub struct Draw {
    /// The family from which the number is drawn.
    pub distribution: Distribution,
    /// Its parameters. They read the variables of the rule, then the draws before this one.
    pub parameters: Program,
    /// Place in the successor of the module that it belongs to, brackets not counted.
    pub place: usize,
    /// Its number among the draws of that module.
    pub number: u32,
    /// It is needed in one branch of an `if` only, so that wrong parameters may not matter.
    pub conditional: bool,
    /// Where the draw is written.
    pub span: Span,
}

/// The clock of an event at a rate that a new module gets: see [`Clock`].
#[derive(Clone, Copy, Debug)]
pub struct NewClock {
    /// Place in the successor of the module, brackets not counted.
    pub place: usize,
    /// Number of arguments before it, clocks not counted.
    pub after: usize,
    /// Of the clause: [`key`](dlsys_tree::key).
    pub key: u64,
}

/// What makes an event at a rate happen: a hidden parameter of the module.
///
/// It begins with an exponentially distributed number of mean 1 and runs down at the rate λ while the clause's condition
/// holds; the event is when it is 0. That is the first event of a Poisson process with the intensity λ, however λ
/// depends on the state, and there is no time step in it (Davis 1984, piecewise-deterministic Markov processes).
#[derive(Clone, Copy, Debug)]
pub struct Clock {
    /// Number of the hidden parameter among the rule's variables.
    pub parameter: usize,
    /// Index of the `produce` clause.
    pub produce: usize,
}

/// The successor that a part `u` of all weights leads to; why there is none.
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
    // By rounding, nothing may be left for the last that has a weight.
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
