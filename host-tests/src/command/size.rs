//! `winder size`

use std::process::ExitCode;

use anyhow::Result;

use super::timing::tell;
use crate::setup::{self, Warnings};
use crate::timing::{golden, sizes};

/// What to do with the sizes.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct Args {
    /// Keep them as those to compare with
    #[arg(long)]
    bless: bool,
}

/// The table that is kept.
const TABLE: &str = "sizes.md";

/// Fails where a chip is too small. A difference from what is kept is shown, but does not fail: names of directories
/// are in the images, and their lengths are not the same everywhere.
pub fn check() -> Result<()> {
    let table = golden::with_compiler(&setup::compiler()?, &sizes::table(Warnings::Denied)?);
    tell(&golden::compare(TABLE, &table)?, "cargo winder size");
    Ok(())
}

/// Prints what the firmware takes of the memories, and compares it with what is kept.
pub fn main(args: Args) -> Result<ExitCode> {
    let table = golden::with_compiler(&setup::compiler()?, &sizes::table(Warnings::Shown)?);
    print!("{table}");
    if args.bless {
        golden::keep(TABLE, &table)?;
        println!("\nkept as {}", golden::path(TABLE).display());
        return Ok(ExitCode::SUCCESS);
    }
    let as_kept = tell(&golden::compare(TABLE, &table)?, "cargo winder size");
    Ok(if as_kept {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}
