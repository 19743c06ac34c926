//! `winder size`

use std::process::ExitCode;

use anyhow::{Result, ensure};

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

/// Fails where they are not as kept.
pub fn check() -> Result<()> {
    let outcome = main(Args { bless: false })?;
    ensure!(
        outcome == ExitCode::SUCCESS,
        "the firmware's sizes are not as kept, see above"
    );
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
