//! Results of the analysis: the solution of each equation and the zero-crossing function of each comparison.
//!
//! A parameter whose solution is a formula needs no steps, and an event whose time is a formula needs no search. These
//! classes are properties of the equations; `dlsys-compile` determines them once, when the model is loaded.

use std::sync::Arc;

use dlsys_expr::{Curve, Program};

/// The solution method of the equation of a parameter. Coefficients are computed from the variables of the rule when
/// the clause becomes active for a module.
#[derive(Clone, Debug)]
pub enum SolutionForm {
    /// `x' = c_0 + c_1 age + … + c_n age^n`; the outputs are the coefficients.
    Polynomial(Program),
    /// `x' = c + b x + a x²`; the outputs are c, b and a. Exponential and logistic growth are of this form.
    Quadratic(Program),
    /// `x' = b x + g(age, t, y, …)` with g a sum of products of polynomials, exponentials, sines and cosines of time, and
    /// other parameters of this form.
    Sum {
        /// The coefficient b.
        factor: Program,
        /// The inflow g.
        inflow: Program,
    },
    /// `x' = h(time) q(x)` with a known integral of h: curves, growth functions of time, and the growth laws of Gompertz,
    /// Richards and von Bertalanffy.
    Driven(Box<DrivenGrowth>),
    /// Integrated numerically.
    Numeric(Numeric),
}

/// The formula of a parameter with `x' = h(time) q(x)`.
#[derive(Clone, Debug)]
pub struct DrivenGrowth {
    /// The form of q.
    pub growth: GrowthLaw,
    /// Coefficients of q, in the order given at [`GrowthLaw`].
    pub coefficients: Program,
    /// The integral H of h; the solution uses its difference from the start of the trajectory. None if h is 1.
    pub pace: Option<Arc<Program>>,
    /// True if H is monotone.
    pub monotone: bool,
    /// The curves in h.
    pub curves: Vec<Arc<Curve>>,
}

/// The form of q.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GrowthLaw {
    /// `c + b x + a x²`: c, b, a.
    Quadratic,
    /// `x (a + b ln x)`: a, b.
    Gompertz,
    /// `a x + b x^p`: a, b, p.
    Bernoulli,
}

/// A parameter without a formula, which is integrated numerically.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Numeric {
    /// True if its rate reads values of neighbours that change.
    pub coupled: bool,
    /// True if its rate is linear, with constant coefficients, in all variables that change.
    pub linear: bool,
    /// The reason why there is no formula.
    pub obstacle: Obstacle,
}

/// The reason why an equation has no formula.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Obstacle {
    /// The rate reads values of neighbours that change.
    Neighbours,
    /// The rate is not a polynomial in the parameter.
    NotPolynomial,
    /// The rate is a polynomial of this degree, greater than 2.
    Degree(u32),
    /// The factor of the parameter changes.
    Factor,
    /// The inflow is not a sum of products of polynomials, exponentials, sines and cosines of time, or reads a parameter
    /// that is not such a sum.
    Inflow,
}

impl SolutionForm {
    /// True if the parameter follows a formula, so that nothing is integrated.
    pub fn is_closed(&self) -> bool {
        !matches!(self, SolutionForm::Numeric(_))
    }
}

/// The zero-crossing function of a comparison: how the zero of the difference of its two sides is located.
#[derive(Clone, Debug)]
pub enum ZeroCrossing {
    /// The difference does not change between events, and neither does its sign.
    Constant,
    /// The difference is zero where one monotone variable reaches a level, so that the instant is a formula.
    Formula {
        /// The number of the monotone variable.
        variable: usize,
        /// The level, a function of the variables that do not change.
        level: Program,
    },
    /// The zero is searched for along the trajectory (formulas or dense output).
    Search {
        /// The difference, if it is affine.
        sum: Option<AffineSum>,
        /// The one variable that moves, and the level at which the difference is zero, a function of the others.
        level: Option<(usize, Program)>,
    },
}

/// `constant + Σ factor · variable`.
#[derive(Clone, Debug)]
pub struct AffineSum {
    /// The value at the origin.
    pub constant: f64,
    /// Numbers of variables with their factors.
    pub terms: Vec<(usize, f64)>,
}

/// Linear equations with constant coefficients: `x_k' = constant + Σ coefficient · variable`.
#[derive(Clone, Debug)]
pub struct LinearRates {
    /// By equation, in the order of [`Solve::numeric`](super::Solve::numeric): the variables that it reads.
    pub variables: Vec<Vec<usize>>,
    /// By equation: the constant, then the coefficients of those variables.
    pub coefficients: Program,
}

/// Partial derivatives of the rates of a clause with respect to the variables that change.
#[derive(Clone, Debug, Default)]
pub struct Jacobian {
    /// Index of the rate and number of the variable of each derivative.
    pub entries: Vec<(usize, usize)>,
    /// The derivatives, in the order of the entries.
    pub values: Program,
}
