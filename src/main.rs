//! The program: the command line of greybox.

use std::process::ExitCode;

fn main() -> ExitCode {
    greybox_service::cli::main()
}
