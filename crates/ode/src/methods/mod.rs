//! The table of methods, and the dispatch to them.
//!
//! **To add a method**: write a file here that implements [`OneStep`] (for an explicit pair, `Pair` in `explicit.rs`: a tableau and
//! a dense output), and add its `mod` line and its line in the table `methods!` below. The command line, the studies and the tests
//! that run every method read the table.

pub(crate) mod dop853;
mod dopri5;
mod euler;
pub(crate) mod explicit;
mod radau;
mod rk4;

use crate::Rates;
use crate::dense::Dense;
use crate::one_step::{InteriorError, OneStep, Step, Trial};
use crate::workspace::Workspace;
use dlsys_expr::SimTime;
use explicit::Explicit;

/// From the table: the enums of methods, what the table says of each, and one `match` for every operation of [`OneStep`]. So a step
/// costs one branch for its method, and no allocation or virtual call.
macro_rules! methods {
    ($($(#[$doc:meta])* $variant:ident = $name:literal, order $order:literal, $length:ident, $kind:ident, $field:ident: $type:ty;)*) => {
        /// How equations are integrated.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
        #[non_exhaustive]
        pub enum Method {
            /// The exact solution where there is one, otherwise the method that suits the equations.
            #[default]
            Auto,
            $($(#[$doc])* $variant,)*
        }

        impl Method {
            /// The methods by their names on the command line.
            pub const NAMED: [(&'static str, Method); 1 + [$($name),*].len()] =
                [("auto", Method::Auto), $(($name, Method::$variant)),*];

            /// The scheme of the method; None for `auto`, which chooses one for each step.
            pub(crate) fn scheme(self) -> Option<Scheme> {
                match self {
                    Method::Auto => None,
                    $(Method::$variant => Some(Scheme::$variant),)*
                }
            }
        }

        /// A method that makes a step: any but `auto`.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub(crate) enum Scheme {
            $($variant,)*
        }

        impl Scheme {
            pub(crate) fn facts(self) -> Facts {
                match self {
                    $(Scheme::$variant => Facts {
                        order: $order,
                        is_fixed_step: matches!(Length::$length, Length::Fixed),
                        is_implicit: matches!(Kind::$kind, Kind::Implicit),
                        tolerance_share: <$type>::TOLERANCE_SHARE,
                        interior_is_measured: <$type>::INTERIOR_IS_MEASURED,
                        stages_are_kept: <$type>::STAGES_ARE_KEPT,
                    },)*
                }
            }
        }

        /// All methods, each with what it remembers of its steps.
        #[derive(Clone, Default)]
        pub(crate) struct Schemes {
            $($field: $type,)*
        }

        /// The operations of [`OneStep`], for the scheme named.
        impl Schemes {
            pub fn prepare(&mut self, scheme: Scheme, tolerance: f64) {
                match scheme { $(Scheme::$variant => self.$field.prepare(tolerance),)* }
            }

            /// Drops what all methods remember.
            pub fn forget(&mut self) {
                $(self.$field.forget();)*
            }

            pub fn error_order(&self, scheme: Scheme) -> u32 {
                match scheme { $(Scheme::$variant => self.$field.error_order(),)* }
            }

            pub fn starting_order(&self, scheme: Scheme) -> u32 {
                match scheme { $(Scheme::$variant => self.$field.starting_order(),)* }
            }

            pub fn stages(&self, scheme: Scheme) -> usize {
                match scheme { $(Scheme::$variant => self.$field.stages(),)* }
            }

            pub fn carried(&self, scheme: Scheme) -> usize {
                match scheme { $(Scheme::$variant => self.$field.carried(),)* }
            }

            pub fn nodes(&self, scheme: Scheme) -> &[f64] {
                match scheme { $(Scheme::$variant => self.$field.nodes(),)* }
            }

            pub fn attempt(
                &mut self,
                scheme: Scheme,
                work: &mut Workspace,
                system: &mut impl Rates,
                step: Step<'_>,
                tolerance: f64,
            ) -> Trial {
                match scheme { $(Scheme::$variant => self.$field.attempt(work, system, step, tolerance),)* }
            }

            pub fn absolute_error(
                &self,
                scheme: Scheme,
                work: &Workspace,
                step: Step<'_>,
                error: f64,
                tolerance: f64,
            ) -> f64 {
                match scheme { $(Scheme::$variant => self.$field.absolute_error(work, step, error, tolerance),)* }
            }

            pub fn component_errors(&self, scheme: Scheme) -> &[f64] {
                match scheme { $(Scheme::$variant => self.$field.component_errors(),)* }
            }

            pub fn is_limited_by_stability(&self, scheme: Scheme, work: &Workspace, h: f64) -> Option<bool> {
                match scheme { $(Scheme::$variant => self.$field.is_limited_by_stability(work, h),)* }
            }

            pub fn dense(
                &mut self,
                scheme: Scheme,
                work: &mut Workspace,
                system: &mut impl Rates,
                step: Step<'_>,
                end: Option<SimTime>,
            ) -> Dense {
                match scheme { $(Scheme::$variant => self.$field.dense(work, system, step, end),)* }
            }

            pub fn interior_error(
                &self,
                scheme: Scheme,
                work: &mut Workspace,
                system: &mut impl Rates,
                y: &[f64],
                dense: &Dense,
            ) -> InteriorError {
                match scheme { $(Scheme::$variant => self.$field.interior_error(work, system, y, dense),)* }
            }

            pub fn accept(&mut self, scheme: Scheme, work: &mut Workspace) -> bool {
                match scheme { $(Scheme::$variant => self.$field.accept(work),)* }
            }
        }
    };
}

// The table, in the order in which methods are listed to users: name, order, step control, kind, and the type that implements it.
methods! {
    /// Dormand and Prince's pair of orders 5 and 4 with step control.
    Dopri5 = "dopri5", order 5, Adaptive, Explicit, dopri5: Explicit<dopri5::Dopri5>;
    /// Dormand and Prince's pair of orders 8, 5 and 3, for tight tolerances (Hairer's DOP853).
    Dop853 = "dop853", order 8, Adaptive, Explicit, dop853: Explicit<dop853::Dop853>;
    /// Radau IIA collocation with step control: implicit and L-stable, for stiff equations.
    Radau = "radau", order 9, Adaptive, Implicit, radau: radau::Radau;
    /// The classical Runge-Kutta method with a fixed step.
    Rk4 = "rk4", order 4, Fixed, Explicit, rk4: rk4::Rk4;
    /// Forward Euler with a fixed step: the paper's method (section 8).
    Euler = "euler", order 1, Fixed, Explicit, euler: euler::Euler;
}

/// Words of the table: where the length of steps comes from.
enum Length {
    /// Chosen by step control.
    Adaptive,
    /// Given.
    Fixed,
}

/// Words of the table: how the stages of a step are found.
enum Kind {
    /// Stages follow one from the other.
    Explicit,
    /// Stages are the solution of a system of equations.
    Implicit,
}

/// What the table and the implementation say of a method.
#[derive(Clone, Copy)]
pub(crate) struct Facts {
    order: u32,
    is_fixed_step: bool,
    pub is_implicit: bool,
    pub tolerance_share: f64,
    pub interior_is_measured: bool,
    pub stages_are_kept: bool,
}

impl Method {
    /// The order: on a smooth solution the error of a step of length h is O(h^(order + 1)). None for `auto`. A family of methods
    /// (Radau IIA with three or five stages) has that of its highest member.
    pub fn order(self) -> Option<u32> {
        self.scheme().map(|scheme| scheme.facts().order)
    }

    /// True if the method needs a step size and ignores the tolerance.
    pub fn is_fixed_step(self) -> bool {
        self.scheme().is_some_and(|scheme| scheme.facts().is_fixed_step)
    }

    /// True if each step solves a system of equations for its stages. False for `auto`, which takes the implicit method only where
    /// the equations are stiff.
    pub fn is_implicit(self) -> bool {
        self.scheme().is_some_and(|scheme| scheme.facts().is_implicit)
    }

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        Method::NAMED.iter().find(|(_, method)| *method == self).map_or("", |(name, _)| name)
    }
}

/// Up to this tolerance few steps of high order are cheaper than many of low order: a step costs more than its rates.
const HIGH_ORDER_UP_TO: f64 = 1e-4;
/// The same where limits cut the steps, so that a higher order does not make them longer.
const HIGH_ORDER_UP_TO_IF_CUT: f64 = 5e-8;

impl Scheme {
    /// What `auto` chooses for a step, given the tolerance of the run, and whether limits cut the steps.
    pub(crate) fn automatic(tolerance: f64, is_stiff: bool, is_cut: bool) -> Scheme {
        let high_order_up_to = if is_cut { HIGH_ORDER_UP_TO_IF_CUT } else { HIGH_ORDER_UP_TO };
        if is_stiff {
            Scheme::Radau
        } else if tolerance <= high_order_up_to {
            Scheme::Dop853
        } else {
            Scheme::Dopri5
        }
    }
}

#[cfg(test)]
mod tests;
