//! `winder signals`

use std::io::{self, Write as _};
use std::process::ExitCode;

use anyhow::{Context, Result};

use crate::handbook;

/// Options of `winder signals`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Print docs/drive.md instead, with its tables of modes, refusals, faults and signals as they are now
    #[arg(long, conflicts_with = "format")]
    markdown: bool,
    /// How to print the list
    #[arg(long, value_enum, default_value_t = Format::Csv)]
    format: Format,
}

/// The forms of the list.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Format {
    /// A row for each signal and each named bit: name, address, type, scale, comment
    Csv,
    /// A VAR_GLOBAL block of IEC 61131-3
    Iec,
    /// The page docs/signals.md
    Markdown,
}

/// Prints the signal list.
pub fn main(args: &Args) -> Result<ExitCode> {
    let mut out = io::stdout().lock();
    let written = if args.markdown {
        out.write_all(handbook::refreshed(handbook::PAGE).as_bytes())
    } else {
        match args.format {
            Format::Csv => crate::signals::write(out).map_err(io::Error::from),
            Format::Iec => out.write_all(crate::signals::iec().as_bytes()),
            Format::Markdown => out.write_all(crate::signals::page().as_bytes()),
        }
    };
    match written {
        // whoever reads us has seen enough
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => {}
        written => written.context("cannot write the signal list")?,
    }
    Ok(ExitCode::SUCCESS)
}
