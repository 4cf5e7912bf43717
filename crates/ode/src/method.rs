//! The methods by name.

/// How equations are integrated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// The exact solution where there is one, otherwise the method that suits the equations.
    #[default]
    Auto,
    /// Forward Euler with a fixed step: order 1. What the paper's authors used (section 8).
    Euler,
    /// The classical Runge-Kutta method with a fixed step: order 4.
    Rk4,
    /// Dormand and Prince's pair of orders 5 and 4 with step control.
    Dopri5,
    /// Dormand and Prince's pair of orders 8, 5 and 3, for tight tolerances (Hairer's DOP853).
    Dop853,
    /// Radau IIA collocation with step control: implicit and L-stable, for stiff equations.
    Radau,
}

impl Method {
    /// Methods by the names they have on the command line.
    pub const NAMED: [(&'static str, Method); 6] = [
        ("auto", Method::Auto),
        ("dopri5", Method::Dopri5),
        ("dop853", Method::Dop853),
        ("radau", Method::Radau),
        ("rk4", Method::Rk4),
        ("euler", Method::Euler),
    ];

    /// True if the method needs a step size and ignores the tolerance.
    pub fn is_fixed_step(self) -> bool {
        matches!(self, Method::Euler | Method::Rk4)
    }
}
