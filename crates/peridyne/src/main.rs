//! The program `peridyne`.

use std::process::ExitCode;

fn main() -> ExitCode {
    peridyne::cli::main()
}
