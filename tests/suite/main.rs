//! The test suite, in one binary, because linking takes longer than running.
//!
//! - [`book`]: the book in `docs/`, followed literally; [`pages`] reads its Markdown.
//! - [`light`]: modules with formulas only, the quick way against the general one.
//! - [`limits`]: what runs away, extreme numbers, killed processes, full disks, little memory.
//! - [`linear`]: neighbours with linear equations against closed forms: transport one way, large starts, stiff chains.
//! - [`layout`]: what `fmt` may not do to any text.
//! - [`listings`]: the paper's models against results of an independent program.
//! - [`algebraic`], [`signals`]: values and equations instead of rates; sums over what is attached; contexts with branches.
//! - [`semantics`]: what happens when (events, contexts, errors of a run), model by small model.
//! - [`language`]: text to model and back; hostile input.
//! - [`gallery`]: every mistake in `tests/errors` and the message it gets.
//! - [`chance`]: times, draws and choices against their distributions; what they depend on.
//! - [`discrete`]: derivation steps, against the models of a book; cuts.
//! - [`blocks`]: curves, growth functions, arrays, `match` and `let` against exact values; [`files`]: includes and tables.
//! - [`cli`]: the program as it is typed.
//! - [`editing`]: layout, `new`, `render --watch`, completions.
//! - [`inspect`]: what `explain`, `--events` and `check --continuity` say.
//! - [`evidence`]: events of integrated values: found, not there, or in doubt; pulses; ties.
//! - [`export`]: SVG and OBJ, read back by other people's code.
//! - [`schedulers`]: local repair against one clock, remembered neighbours against the whole string.
//! - [`pictures`]: pixels, perspective, and sheets of several frames.
//! - [`plants`]: the paper's plants: order of flowering, continuity, the gallery.
//! - [`random`]: random coupled models by four ways of solving.
//! - [`repl`]: the interactive session, without a terminal and with one.
//! - [`replay`]: any time after any other, to the bits of a run.
//! - [`report`]: studies of methods, and hard cases with exact answers.
//! - [`wild`]: texts that nobody would write.
//! - [`verify`]: runs that are computed again by an independent way.
//! - [`view`]: pages that play a recording, read back.

mod algebraic;
mod blocks;
mod book;
mod chance;
mod cli;
mod common;
mod corners;
mod discrete;
mod editing;
mod evidence;
mod export;
mod files;
mod gallery;
mod inspect;
mod language;
mod layout;
mod light;
mod limits;
mod linear;
mod listings;
mod organs;
mod pages;
mod pictures;
mod plants;
mod random;
mod repl;
mod replay;
mod report;
mod schedulers;
mod semantics;
mod signals;
mod verify;
mod view;
mod wild;
