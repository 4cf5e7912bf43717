//! The test suite of the whole program, in one binary, because linking takes longer than running. The header of each file
//! says what it tests; tests of a single stage stand in its crate.
//!
//! Tests that take long, or that need a program that not every machine has, are ignored by `cargo test`; `.ci/run` runs
//! them too (`cargo test -- --include-ignored`).

mod air;
mod algebraic;
mod blocks;
mod book;
mod chance;
mod cli;
mod common;
mod corners;
mod coupled;
mod coupling;
mod dice;
mod discrete;
mod editing;
mod evidence;
mod export;
mod falling;
mod files;
mod films;
mod gallery;
mod gas;
mod glb;
mod glb_reader;
mod groups;
mod inspect;
mod land;
mod language;
mod layout;
mod light;
mod limits;
mod linear;
mod listings;
mod meadow;
mod organs;
mod pages;
mod pictures;
mod plants;
mod ported;
mod precision;
mod random;
mod repl;
mod replay;
mod report;
mod scenes;
mod schedulers;
mod semantics;
mod shadows;
mod sheets;
mod signals;
mod small_plants;
mod solids;
mod strain;
mod strain_runs;
mod surroundings;
mod sway;
mod terrain;
mod textures;
mod usd;
mod usd_reader;
mod verify;
mod view;
mod wild;
mod wilting;
