//! Shared parts of the benchmarks: the same equations written for dlsys and for diffsol, their exact solutions,
//! a search for the cheapest tolerance that reaches a given error, and alternating measurements.
//!
//! Run times are comparable only at equal errors. So every comparison first determines, for each program
//! separately, the loosest tolerance that reaches the given error against exact values, and then times both
//! programs alternately, so that noise of the machine affects both.

pub mod anabaena;
pub mod blocks;
pub mod chain;
pub mod filament;
pub mod kernels;
pub mod measure;
pub mod plants;
pub mod restart;
pub mod scale;
pub mod solver;
pub mod stems;
pub mod transport;
pub mod tune;
