//! `winder plc`

use std::fs;
use std::net::ToSocketAddrs;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, Result};
use model_core::desk::{ALARM_BITS, STATES};
use model_core::image::{self, Image};

use crate::accept::controller::{REFERENCE, StPlc};
use crate::accept::wired::{self, Event};

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
    let wrong = || format!("{} is not HOST:PORT", args.address);
    let address = args.address.to_socket_addrs().with_context(wrong)?.next();
    let mut last = None;
    let why = wired::run(address.with_context(wrong)?, plc, |event| match event {
        Event::Connected => println!("{name} is wired to {}", args.address),
        Event::Lost(error) => eprintln!("winder: {error:#}; trying again"),
        Event::Cycle(image) => {
            let now = Some((
                image.commands.word(&image::PLC_STATE),
                image.commands.word(&image::PLC_ALARMS),
            ));
            if now != last {
                last = now;
                println!("{}", shown(image));
            }
        }
    })?;
    eprintln!("winder: the program has stopped: {name}, {why}");
    Ok(ExitCode::FAILURE)
}

/// What the program shows its operator.
fn shown(image: &Image) -> String {
    let state = usize::from(image.commands.word(&image::PLC_STATE));
    let alarms = image.commands.word(&image::PLC_ALARMS);
    let alarms = ALARM_BITS
        .iter()
        .filter(|bit| alarms >> bit.number & 1 == 1);
    let mut text = STATES
        .get(state)
        .copied()
        .unwrap_or("unknown state")
        .to_owned();
    for bit in alarms {
        text += ", ";
        text += bit.name;
    }
    text
}
