//! Loops over numbers with the widest registers that the processor has.
//!
//! A program is built for the oldest processor that it must run on, and there a register holds two numbers. Most hold four or eight.
//! [`run`] asks the processor once what it has, and runs a loop as it was built for that: the same source, compiled three times.
//!
//! **Results are the same bits.** Each number goes through the same operations in the same order, whatever stands beside it: the compiler
//! neither joins a product and a sum to one rounding nor changes the order of a sum. So a kernel must not ask how wide registers are, and nothing
//! tells it.
//!
//! ```
//! struct Double<'n>(&'n mut [f64]);
//!
//! impl dlsys_wide::Kernel for Double<'_> {
//!     type Output = ();
//!
//!     #[inline(always)]
//!     fn run(self) {
//!         self.0.iter_mut().for_each(|x| *x *= 2.0);
//!     }
//! }
//!
//! let mut numbers = [1.0, 2.0, 3.0];
//! dlsys_wide::run(Double(&mut numbers));
//! assert_eq!(numbers, [2.0, 4.0, 6.0]);
//! ```

#![warn(missing_docs)]

use std::sync::atomic::{AtomicU8, Ordering};

/// A computation that gains from wide registers, mostly a loop over numbers.
pub trait Kernel {
    /// What it gives.
    type Output;

    /// Carries it out. To be marked `#[inline(always)]`, as all that it calls in its loops: what is not inlined is built for the oldest
    /// processor.
    fn run(self) -> Self::Output;
}

/// How wide the registers are for which a kernel is built.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Width {
    /// What every processor has that the program runs on.
    Least,
    /// Four numbers: AVX2.
    Four,
    /// Eight numbers: AVX-512.
    Eight,
}

impl Width {
    /// All of them.
    pub const ALL: [Width; 3] = [Width::Least, Width::Four, Width::Eight];

    /// The widest that this processor has.
    #[inline]
    pub fn widest() -> Width {
        match WIDEST.load(Ordering::Relaxed) {
            0 => Width::find(),
            1 => Width::Least,
            2 => Width::Four,
            _ => Width::Eight,
        }
    }

    /// Asks the processor, and remembers the answer.
    #[cold]
    fn find() -> Width {
        #[cfg(target_arch = "x86_64")]
        let [four, eight] = [
            std::arch::is_x86_feature_detected!("avx2"),
            std::arch::is_x86_feature_detected!("avx512f")
                && std::arch::is_x86_feature_detected!("avx512vl")
                && std::arch::is_x86_feature_detected!("avx512dq"),
        ];
        #[cfg(not(target_arch = "x86_64"))]
        let [four, eight] = [false; 2];
        let width = match (four, eight) {
            (true, true) => Width::Eight,
            (true, false) => Width::Four,
            _ => Width::Least,
        };
        WIDEST.store(width as u8 + 1, Ordering::Relaxed);
        width
    }
}

/// The number of the widest registers in [`Width::ALL`], plus 1; 0 until the processor has been asked.
static WIDEST: AtomicU8 = AtomicU8::new(0);

/// Carries out a kernel with the widest registers that there are.
#[inline]
pub fn run<K: Kernel>(kernel: K) -> K::Output {
    run_with(Width::widest(), kernel)
}

/// Carries out a kernel with registers of this width, or with the widest that the processor has if they are not as wide.
#[inline]
pub fn run_with<K: Kernel>(width: Width, kernel: K) -> K::Output {
    match width.min(Width::widest()) {
        // SAFETY: the processor has been asked whether it has these instructions.
        #[cfg(target_arch = "x86_64")]
        Width::Eight => unsafe { x86_64::run_eight(kernel) },
        // SAFETY: as above.
        #[cfg(target_arch = "x86_64")]
        Width::Four => unsafe { x86_64::run_four(kernel) },
        _ => kernel.run(),
    }
}

/// The only unsafe code of the project is the two calls of these functions: to call what is built for more than every processor has would
/// be an illegal instruction, or worse, on one that lacks it. What pays for it: a thousand coupled cells with nonlinear rates (`benches compare filament`)
/// take 0.77 of the time with registers of eight numbers, 0.80 with those of four.
#[cfg(target_arch = "x86_64")]
mod x86_64 {
    use super::Kernel;

    #[target_feature(enable = "avx2")]
    pub fn run_four<K: Kernel>(kernel: K) -> K::Output {
        kernel.run()
    }

    #[target_feature(enable = "avx512f,avx512vl,avx512dq")]
    pub fn run_eight<K: Kernel>(kernel: K) -> K::Output {
        kernel.run()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sums and products, quotients and roots of numbers, in an order that matters.
    struct Some<'n>(&'n [f64], &'n mut [f64]);

    impl Kernel for Some<'_> {
        type Output = f64;

        #[inline(always)]
        fn run(self) -> f64 {
            for (x, y) in self.0.iter().zip(self.1.iter_mut()) {
                *y = (0.1 * x + x * x - *y).abs().sqrt() / (x - 0.3);
            }
            self.1.iter().sum()
        }
    }

    #[test]
    fn all_widths_give_the_same_bits() {
        let numbers: Vec<f64> = (0..101).map(|n| 1.0 / f64::from(n + 3)).collect();
        let of = |width| {
            let mut out = numbers.clone();
            out.reverse();
            let sum = run_with(width, Some(&numbers, &mut out));
            out.into_iter().chain([sum]).map(f64::to_bits).collect::<Vec<_>>()
        };
        assert_eq!(of(Width::Four), of(Width::Least));
        assert_eq!(of(Width::Eight), of(Width::Least));
    }

    #[test]
    fn a_width_that_is_not_there_is_replaced() {
        assert!(Width::ALL.contains(&Width::widest()));
        assert_eq!(run_with(Width::Eight, Some(&[4.0], &mut [0.0])), run(Some(&[4.0], &mut [0.0])));
    }
}
