//! What the firmware takes of the memories on each board.
//!
//! Not here: how deep the stack is used; that is measured.

use std::fmt::Write;

use anyhow::Result;

use super::elf::Elf;
use super::scalar;
use crate::setup::{self, Warnings};
use crate::twin::CORES;

/// The table of all boards, as Markdown.
pub fn table(warnings: Warnings) -> Result<String> {
    let mut out = String::from(
        "# Sizes in bytes\n\n\
         | Package | Cores | Numbers | Flash | Static RAM | Stack reserved |\n|---|---|---|---:|---:|---:|\n",
    );
    let mut targets: Vec<&str> = CORES.iter().map(|core| core.target).collect();
    targets.dedup();
    for target in targets {
        let cores: Vec<_> = CORES.iter().filter(|core| core.target == target).collect();
        let names: Vec<_> = cores.iter().map(|core| core.name).collect();
        let numbers = cores.first().map_or("", |core| scalar(core));
        let firmware = setup::mps2_for(target, warnings)?;
        let sizes = Elf::read(&firmware)?.sizes();
        // a string takes all that is written to it
        let _ = writeln!(
            out,
            "| board-mps2 | {} | {numbers} | {} | {} | {} |",
            names.join(", "),
            sizes.flash,
            sizes.ram,
            sizes.stack
        );
    }
    Ok(out)
}
