//! `winder flash`

use std::process::{Command, ExitCode, Stdio};

use anyhow::{Context, Result, bail, ensure};

use crate::interrupt;
use crate::setup::{self, Warnings};

/// The tool that talks to the board's debugger.
const PROBE_RS: &str = "probe-rs";
/// The chip, by probe-rs's name.
const CHIP: &str = "STM32H743ZITx";

/// How to flash.
#[derive(Clone, Debug, clap::Args)]
pub struct Args {
    /// Only build, and say what would be done
    #[arg(long)]
    dry_run: bool,
    /// Probe to use, as `probe-rs list` names it, when several are connected
    #[arg(long)]
    probe: Option<String>,
}

/// Builds the firmware for the NUCLEO-H743ZI2, flashes it and shows its log until Ctrl-C.
pub fn main(args: &Args) -> Result<ExitCode> {
    let image = setup::nucleo_h743zi2(Warnings::Shown)?;
    let mut command = Command::new(PROBE_RS);
    command.args(["run", "--chip", CHIP]);
    if let Some(probe) = &args.probe {
        command.args(["--probe", probe]);
    }
    command.arg(&image);
    if args.dry_run {
        println!("{}", format!("{command:?}").replace('"', ""));
        return Ok(ExitCode::SUCCESS);
    }
    ensure!(
        setup::on_path(PROBE_RS).is_some(),
        "{PROBE_RS} is not installed: `cargo install probe-rs-tools --locked` brings it (it needs libudev's headers: \
         `apt-get install libudev-dev pkg-config`). The image is built: {}",
        image.display()
    );
    look_for_a_probe()?;
    let mut child = command
        .stdin(Stdio::null())
        .spawn()
        .with_context(|| format!("cannot start {PROBE_RS}"))?;
    let status = interrupt::wait(&mut child)?;
    ensure!(
        status.success(),
        "{PROBE_RS} ended with {status}: see its messages above"
    );
    Ok(ExitCode::SUCCESS)
}

fn look_for_a_probe() -> Result<()> {
    let output = Command::new(PROBE_RS)
        .arg("list")
        .output()
        .with_context(|| format!("cannot start {PROBE_RS}"))?;
    let told = String::from_utf8_lossy(&output.stdout);
    if told.contains("No debug probes") || told.trim().is_empty() {
        bail!(
            "no board is connected: the USB socket CN1 of the NUCLEO-H743ZI2 goes to this PC. If it does, this user \
             may not open it: see probe-rs's page on udev rules"
        );
    }
    Ok(())
}
