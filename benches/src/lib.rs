//! What the benchmarks share: the same equations written for dlsys and for diffsol, their exact solutions,
//! a search for the cheapest tolerance that gives a wanted error, and measurements in turns.
//!
//! Run times say nothing unless both programs are equally wrong. So every comparison first looks, for each
//! program on its own, for the loosest tolerance that reaches the error asked for, against exact values; only
//! then are the two timed, alternating, so that noise of the machine hits both.

pub mod anabaena;
pub mod blocks;
pub mod chain;
pub mod filament;
pub mod measure;
pub mod plants;
pub mod restart;
pub mod scale;
pub mod solver;
pub mod transport;
pub mod tune;
