//! `winder conformance`

use std::net::{SocketAddr, ToSocketAddrs};
use std::process::ExitCode;

use anyhow::{Context, Result};

use crate::conformance::{self, Map, Server};
use crate::simulator::{Board, Options, Simulator};

/// Which server, and what it has.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// HOST:PORT of a Modbus TCP server that runs; without it, the simulator's own
    server: Option<String>,
    /// What the simulator's own server runs on
    #[arg(long, value_enum, default_value_t = Board::Host)]
    board: Board,
    #[command(flatten)]
    map: Map,
}

/// Runs every case and prints the table.
pub fn main(args: &Args) -> Result<ExitCode> {
    let mut own = None;
    let address = match &args.server {
        Some(name) => resolve(name)?,
        None => own
            .insert(Simulator::start(args.board, Options::default())?)
            .address(),
    };
    let server = Server {
        address,
        map: args.map,
    };
    let outcomes = conformance::run(server, |_| ());
    print!("{}", conformance::table(&outcomes));
    let passed = outcomes.iter().all(|outcome| outcome.failed.is_none());
    Ok(if passed {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

fn resolve(name: &str) -> Result<SocketAddr> {
    let mut addresses = name
        .to_socket_addrs()
        .with_context(|| format!("{name} is not HOST:PORT, as 127.0.0.1:502"))?;
    addresses
        .next()
        .with_context(|| format!("{name} has no address"))
}
