//! The right-hand side of a system of differential equations, as integrators see it.

use std::ops::Range;

/// A system of equations `y' = f(tau, y)`.
///
/// `tau` is the time since the start of the step, in units of simulated time, so that equations keep their digits when the clock
/// shows large numbers. All slices of components have the same length and order throughout a run of steps.
pub trait Rates {
    /// Writes `f(tau, y)` to `out`, which is as long as `y`. A rate that is undefined is NaN or infinite.
    fn rates(&mut self, tau: f64, y: &[f64], out: &mut [f64]);

    /// The structure of the Jacobian: pairs (row, column) such that the rate of component `row` depends on component `column`.
    fn couplings(&self) -> Vec<(u32, u32)>;

    /// Writes the partial derivatives at `(tau, y)` to `out`: one for each of [`couplings`](Rates::couplings), in the same order.
    fn partials(&mut self, tau: f64, y: &[f64], out: &mut Vec<f64>);

    /// True if the partial derivatives are the same for all states and times. False by default.
    fn is_linear(&self) -> bool {
        false
    }

    /// True if the rates depend on the state alone. False by default.
    fn is_steady(&self) -> bool {
        false
    }

    /// Adds to `out` the error of each rate by the rounding of its terms, where these are known: `tanh(50*t) - 1` may be much less than both. Nothing
    /// by default.
    fn add_rounding(&mut self, _tau: f64, _y: &[f64], _out: &mut [f64]) {}

    /// The number that one evaluation of the rates adds to [`Stepper::evaluations`](crate::Stepper::evaluations): how many modules
    /// share the system.
    fn modules(&self) -> u64;

    /// The error at `tau` of the unknowns that are solved for along with the components, in units of the tolerated error, given the
    /// components there and their estimated errors. Zero by default.
    fn algebraic_error(&mut self, _tau: f64, _end: &[f64], _errors: &[f64], _tolerance: f64) -> f64 {
        0.0
    }

    /// True if the components are those of one module, and nothing else is integrated with them. False by default.
    fn stands_alone(&self) -> bool {
        false
    }

    /// True if the rates depend on absolute time, which has the resolution of a float. False by default.
    fn is_timed(&self) -> bool {
        false
    }

    /// True if they depend on time or on an age, which both advance within a step as a float does. Those that are [timed](Rates::is_timed) do.
    fn reads_clock(&self) -> bool {
        self.is_timed()
    }

    /// Marks the components that no rate reads, not their own either. What errs in them stays and adds up, so it is tolerated in proportion to
    /// how far they go in a step, not to how far they have come. None by default.
    fn mark_sums(&self, _is_sum: &mut [bool]) {}

    /// True if unknowns are solved for along with the components. False by default.
    fn is_algebraic(&self) -> bool {
        false
    }

    /// The same system in parts, one for each thread that shall work on a step. None by default: the step is made by the thread that asks for
    /// it.
    fn parts(&mut self) -> Vec<Box<dyn Part + '_>> {
        Vec::new()
    }
}

/// Some components of a system, one after another, whose rates one thread evaluates beside those of others. Each rate is what
/// [`Rates::rates`] writes, to the same bits.
pub trait Part: Send {
    /// The components; each is in one part, and parts come in their order.
    fn components(&self) -> Range<usize>;

    /// The components of other parts that rates of this one depend on, each once.
    fn foreign(&self) -> &[u32];

    /// Writes the rates of the components to `out`. In `y` are their values, then those of the foreign ones.
    fn rates(&mut self, tau: f64, y: &[f64], out: &mut [f64]);
}

/// A system whose time begins `by` later: `tau = 0` here is `tau = by` there.
pub(crate) struct Shifted<'s, R> {
    pub system: &'s mut R,
    pub by: f64,
}

impl<R: Rates> Rates for Shifted<'_, R> {
    fn rates(&mut self, tau: f64, y: &[f64], out: &mut [f64]) {
        self.system.rates(self.by + tau, y, out);
    }

    fn couplings(&self) -> Vec<(u32, u32)> {
        self.system.couplings()
    }

    fn partials(&mut self, tau: f64, y: &[f64], out: &mut Vec<f64>) {
        self.system.partials(self.by + tau, y, out);
    }

    fn is_linear(&self) -> bool {
        self.system.is_linear()
    }

    fn is_steady(&self) -> bool {
        self.system.is_steady()
    }

    fn modules(&self) -> u64 {
        self.system.modules()
    }

    fn stands_alone(&self) -> bool {
        self.system.stands_alone()
    }

    fn is_timed(&self) -> bool {
        self.system.is_timed()
    }

    fn reads_clock(&self) -> bool {
        self.system.reads_clock()
    }

    fn mark_sums(&self, is_sum: &mut [bool]) {
        self.system.mark_sums(is_sum);
    }
}
