//! What the firmware takes of the memories on each board.
//!
//! Not here: how deep the stack is used while it runs; that is measured.

use std::fmt::Write;
use std::path::PathBuf;

use anyhow::{Result, ensure};

use super::elf::Elf;
use crate::setup::{self, TARGET, TARGET_SOFT, Warnings};

/// A firmware, and the memories of its chip.
struct Board {
    package: &'static str,
    cores: &'static str,
    numbers: &'static str,
    build: fn(Warnings) -> Result<PathBuf>,
    /// Flash and RAM of the chip in bytes, where it is a real one, and the part of them that the firmware may take.
    chip: Option<(u64, u64, f64)>,
}

const KIB: u64 = 1024;

/// The part of the stack that the deepest calls may take; the rest is for those that interrupt them, and for calls that
/// are not seen.
const DEEPEST: f64 = 0.6;

const BOARDS: [Board; 4] = [
    Board {
        package: "board-mps2",
        cores: "M7, M4F",
        numbers: "f32",
        build: |warnings| setup::mps2_for(TARGET, warnings),
        chip: None,
    },
    Board {
        package: "board-mps2",
        cores: "M3",
        numbers: "fixed",
        build: |warnings| setup::mps2_for(TARGET_SOFT, warnings),
        chip: None,
    },
    // Source: DS12110, table 2; all RAM that is not a copy of another
    Board {
        package: "board-nucleo-h743zi2",
        cores: "M7",
        numbers: "f32",
        build: setup::nucleo_h743zi2,
        chip: Some((2048 * KIB, 1024 * KIB, 0.5)),
    },
    // Source: DS6329, table 2; a chip that is only just large enough
    Board {
        package: "board-nucleo-f207zg",
        cores: "M3",
        numbers: "fixed",
        build: setup::nucleo_f207zg,
        chip: Some((1024 * KIB, 128 * KIB, 1.0)),
    },
];

/// The table of all boards, as Markdown; fails where a chip is too small.
pub fn table(warnings: Warnings) -> Result<String> {
    let mut out = String::from(
        "# Sizes in bytes\n\n\
         | Package | Cores | Numbers | Flash | Static RAM | Stack reserved | Deepest calls | Of the chip: flash, RAM |\n\
         |---|---|---|---:|---:|---:|---:|---:|\n",
    );
    for board in &BOARDS {
        let sizes = Elf::read(&(board.build)(warnings)?)?.sizes();
        ensure!(
            sizes.deepest as f64 <= DEEPEST * sizes.stack as f64,
            "the deepest calls of {} take {} bytes, which is more than {DEEPEST} of its stack's {}",
            board.package,
            sizes.deepest,
            sizes.stack,
        );
        let ram = sizes.ram + sizes.stack;
        let share = match board.chip {
            None => "–".into(),
            Some((flash_of_chip, ram_of_chip, part)) => {
                let shares = [(sizes.flash, flash_of_chip), (ram, ram_of_chip)]
                    .map(|(taken, there)| taken as f64 / there as f64);
                ensure!(
                    shares.iter().all(|share| *share <= part),
                    "{} takes {} bytes of flash and {ram} of RAM, which is more than {part} of its chip's \
                     {flash_of_chip} and {ram_of_chip}",
                    board.package,
                    sizes.flash,
                );
                let [flash, ram] = shares.map(|share| 100.0 * share);
                format!("{flash:.0} %, {ram:.0} %")
            }
        };
        // a string takes all that is written to it
        let _ = writeln!(
            out,
            "| {} | {} | {} | {} | {} | {} | {} | {share} |",
            board.package,
            board.cores,
            board.numbers,
            sizes.flash,
            sizes.ram,
            sizes.stack,
            sizes.deepest
        );
    }
    Ok(out)
}
