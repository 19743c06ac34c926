//! `winder replay`

use std::fs::File;
use std::io::BufReader;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use anyhow::{Context, Result};

use crate::scenario::record::Recording;
use crate::scenario::seconds;

/// What to play again.
#[derive(Clone, Debug, clap::Args)]
pub struct Args {
    /// A recording, from `cargo winder scenario FILE --record`
    #[arg(value_name = "RUN.csv")]
    file: PathBuf,
}

/// Plays a recording again; exit status 1 if the run is another one.
pub fn main(args: &Args) -> Result<ExitCode> {
    let name = args.file.display().to_string();
    let file = File::open(&args.file).with_context(|| format!("cannot read {name}"))?;
    let recording = Recording::read(&name, BufReader::new(file))?;
    let began = Instant::now();
    let replay = recording.replay().with_context(|| name.clone())?;
    let speed = seconds(replay.cycles) / began.elapsed().as_secs_f64();
    println!(
        "{name}: {:.2} s at {speed:.0} times real time, trajectory {:08x}",
        seconds(replay.cycles),
        replay.trajectory
    );
    match replay.difference {
        None => {
            println!(
                "The run is the recorded one to the bit: {} values are equal.",
                replay.compared
            );
            Ok(ExitCode::SUCCESS)
        }
        Some(difference) => {
            println!("The run is another one: {difference}.");
            Ok(ExitCode::FAILURE)
        }
    }
}
