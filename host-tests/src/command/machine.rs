//! `winder machine`

use std::io::{self, Write};
use std::process::ExitCode;

use anyhow::{Context, Result};
use model_core::machine::PRESETS;

use crate::machine_file::Description;

/// Which machine to print.
#[derive(Clone, Debug, clap::Args)]
pub struct Args {
    /// Preset or machine file
    #[arg(value_name = "NAME|FILE", default_value = PRESETS[0].0)]
    machine: String,
    /// Name the presets instead
    #[arg(long)]
    list: bool,
}

/// Prints a machine as a file, or the names of the presets.
pub fn main(args: &Args) -> Result<ExitCode> {
    let mut out = io::stdout().lock();
    let written = if args.list {
        list(&mut out)
    } else {
        Description::find(&args.machine)?.write(&mut out)
    };
    match written {
        // whoever reads us has seen enough
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => {}
        written => written.context("cannot write the machine")?,
    }
    Ok(ExitCode::SUCCESS)
}

/// A line for each preset: its name, then width, run speed and number of spans.
fn list(out: &mut dyn Write) -> io::Result<()> {
    for (name, preset) in PRESETS {
        let machine = preset();
        writeln!(
            out,
            "{name:<20}{} m wide, {:.0} m/min, {} spans",
            machine.web.width_m,
            machine.operation.run_speed_m_s * 60.0,
            machine.idle.len() + 1
        )?;
    }
    Ok(())
}
