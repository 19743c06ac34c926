//! `winder signals`

use std::io;
use std::process::ExitCode;

use anyhow::{Context, Result};

/// Prints the signal list as CSV.
pub fn main() -> Result<ExitCode> {
    match crate::signals::write(io::stdout().lock()) {
        // whoever reads us has seen enough
        Err(error) if matches!(error.kind(), csv::ErrorKind::Io(e) if e.kind() == io::ErrorKind::BrokenPipe) =>
            {}
        written => written.context("cannot write the signal list")?,
    }
    Ok(ExitCode::SUCCESS)
}
