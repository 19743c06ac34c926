//! `winder plc`

use std::fs;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, Result};
use model_core::image;

use crate::accept::controller::{REFERENCE, StPlc};
use crate::accept::wired::{self, Event};
use crate::link::resolve;
use crate::plc::shown;

/// Which program, and where.
#[derive(Clone, Debug, clap::Args)]
pub struct Args {
    /// Modbus TCP of the simulator
    #[arg(value_name = "HOST:PORT")]
    address: String,
    /// The program [default: the reference winder PLC]
    #[arg(long, value_name = "FILE.st")]
    program: Option<PathBuf>,
}

/// Runs the program; exit status 1 if it stops by itself.
pub fn main(args: &Args) -> Result<ExitCode> {
    let (name, text) = match &args.program {
        Some(file) => {
            let name = file.display().to_string();
            let text = fs::read_to_string(file).with_context(|| format!("cannot read {name}"))?;
            (name, text)
        }
        None => ("the reference winder PLC".to_owned(), REFERENCE.to_owned()),
    };
    let plc = StPlc::new(&text).with_context(|| name.clone())?;
    let address = resolve(&args.address)?;
    let mut last = None;
    let why = wired::run(address, plc, |event| match event {
        Event::Connected => println!("{name} is wired to {}", args.address),
        Event::Lost(error) => eprintln!("winder: {error:#}; trying again"),
        Event::Cycle(image) => {
            let now = Some((
                image.commands.word(&image::PLC_STATE),
                image.commands.word(&image::PLC_ALARMS),
            ));
            if now != last {
                last = now;
                let (state, alarms) = shown(&image.commands);
                println!("{}", [&[state], &alarms[..]].concat().join(", "));
            }
        }
    })?;
    eprintln!("winder: the program has stopped: {name}, {why}");
    Ok(ExitCode::FAILURE)
}
