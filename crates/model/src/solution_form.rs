//! How much work the equations and conditions of a rule are: what the analysis of a model finds out.
//!
//! "Model only what a scene needs": a parameter whose solution is a formula is never stepped, an event whose time
//! is a formula is never searched for. The classes are facts about the mathematics of a rule; the simulation
//! looks them up.

use std::sync::Arc;

use dlsys_expr::{Curve, Program};

/// How the equation of a parameter is solved. Coefficients are computed when a module takes the equation up,
/// from the variables of its rule.
#[derive(Clone, Debug)]
pub enum SolutionForm {
    /// `x' = c_0 + c_1 age + … + c_n age^n`; the outputs are the coefficients.
    Polynomial(Program),
    /// `x' = c + b x + a x²`; the outputs are c, b and a. Exponential and logistic growth, and all of their kind.
    Quadratic(Program),
    /// `x' = b x + g(age, t, y, …)`, g made of sums and products of polynomials, exponentials, sines and cosines
    /// and of other parameters of this class.
    Sum {
        /// b
        factor: Program,
        /// g
        inflow: Program,
    },
    /// `x' = h(time) q(x)`, with the integral of h known: curves, growth functions of time, and the growth laws of
    /// Gompertz, Richards and von Bertalanffy.
    Driven(Box<DrivenGrowth>),
    /// Integrated numerically.
    Numeric(Numeric),
}

/// The growth of one parameter by a formula; `x' = h(time) q(x)`.
#[derive(Clone, Debug)]
pub struct DrivenGrowth {
    /// The form of q.
    pub growth: GrowthLaw,
    /// Coefficients of q, in the order that [`GrowthLaw`] says.
    pub coefficients: Program,
    /// H, to be taken from the start of the motion on; None for time itself.
    pub pace: Option<Arc<Program>>,
    /// H goes one way only.
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

/// Why a parameter is integrated numerically, and how it can be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Numeric {
    /// It reads something of its neighbours that changes.
    pub coupled: bool,
    /// Its rate is linear, with constant coefficients, in everything that changes.
    pub linear: bool,
    /// The reason why there is no formula.
    pub obstacle: Obstacle,
}

/// What stands in the way of a formula.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Obstacle {
    /// The rate reads something of neighbours that changes.
    Neighbours,
    /// The rate is no polynomial in the parameter itself.
    NotPolynomial,
    /// It is one of this degree, greater than 2.
    Degree(u32),
    /// The parameter is multiplied by something that changes.
    Factor,
    /// What is added to it is no sum of products of polynomials, exponentials, sines and cosines of time, or reads a
    /// parameter that is none.
    Inflow,
}

impl SolutionForm {
    /// True if the parameter follows a formula, so that nothing is integrated.
    pub fn is_closed(&self) -> bool {
        !matches!(self, SolutionForm::Numeric(_))
    }
}

/// How the zero of a difference of two sides is found: the zero-crossing function of a comparison.
#[derive(Clone, Debug)]
pub enum ZeroCrossing {
    /// Nothing in it changes: its sign stays.
    Constant,
    /// The sides meet where one variable that moves one way only takes a value, which the program computes: the instant
    /// is a formula.
    Formula {
        /// The variable that moves.
        variable: usize,
        /// The value at which the sides meet, a function of the variables that stand still.
        level: Program,
    },
    /// The first root of a function of time (formulas or dense output) is searched for. The difference of the sides, if
    /// it is linear.
    Search(Option<AffineSum>),
}

/// `constant + Σ factor · variable`.
#[derive(Clone, Debug)]
pub struct AffineSum {
    /// The value where all variables are 0.
    pub constant: f64,
    /// Variables and their factors.
    pub terms: Vec<(usize, f64)>,
}

/// Linear equations: `x_k' = constant + Σ coefficient · variable`.
#[derive(Clone, Debug)]
pub struct LinearRates {
    /// Per numeric parameter, in their order: the variables it depends on.
    pub variables: Vec<Vec<usize>>,
    /// Per numeric parameter: the constant, then the coefficients of those variables.
    pub coefficients: Program,
}

/// Partial derivatives of the rates of a clause by what changes.
#[derive(Clone, Debug, Default)]
pub struct Jacobian {
    /// Position of the rate in the clause, and number of the variable.
    pub entries: Vec<(usize, usize)>,
    /// The derivatives, in the order of the entries.
    pub values: Program,
}
