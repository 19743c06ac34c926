//! `winder signals`

use std::io::{self, Write as _};
use std::process::ExitCode;

use anyhow::{Context, Result};

use crate::handbook;

/// Options of `winder signals`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Print docs/drive.md instead, with its tables of modes, refusals, faults and signals as they are now
    #[arg(long)]
    markdown: bool,
}

/// Prints the signal list.
pub fn main(args: &Args) -> Result<ExitCode> {
    let mut out = io::stdout().lock();
    let written = if args.markdown {
        out.write_all(handbook::refreshed(handbook::PAGE).as_bytes())
    } else {
        crate::signals::write(out).map_err(io::Error::from)
    };
    match written {
        // whoever reads us has seen enough
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => {}
        written => written.context("cannot write the signal list")?,
    }
    Ok(ExitCode::SUCCESS)
}
