//! The `dlsys` program; all of it is in the library, under [`dlsys::cli`].

use std::process::ExitCode;

fn main() -> ExitCode {
    ExitCode::from(dlsys::cli::main())
}
