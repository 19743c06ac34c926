//! `winder conformance`

use std::env;
use std::process::ExitCode;

use anyhow::Result;
use board_host::STATION;

use crate::conformance::peers::{self, Column};
use crate::conformance::{self, Map, Outcome, Server, serial};
use crate::interrupt;
use crate::link::resolve;
use crate::namespace::{self, Side};
use crate::setup;
use crate::simulator::{Board, Network, Options, Simulator};

/// Which server, and what it has.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// HOST:PORT of a Modbus TCP server that runs; without it, the simulator's own
    server: Option<String>,
    /// What the simulator's own server runs on
    #[arg(long, value_enum, default_value_t = Board::Host)]
    board: Board,
    /// Compare the simulator on both boards with servers of others; prints the table of docs/conformance.md
    #[arg(long, conflicts_with_all = ["server", "board"])]
    peers: bool,
    /// Ask a station of Modbus RTU at this serial line instead
    #[arg(long, value_name = "DEVICE", conflicts_with_all = ["server", "board", "peers"])]
    serial: Option<String>,
    /// Its speed, Bd, with 8 bits and no parity
    #[arg(long, default_value_t = 19_200)]
    baud: u32,
    /// Its address
    #[arg(long, default_value_t = STATION, value_parser = clap::value_parser!(u8).range(1..=247))]
    station: u8,
    #[command(flatten)]
    map: Map,
}

/// Runs every case and prints the table.
pub fn main(args: &Args) -> Result<ExitCode> {
    if args.peers {
        return compare();
    }
    let mut outcomes = Vec::new();
    if let Some(path) = &args.serial {
        serial::run(path, args.baud, args.station, &args.map, |o| {
            outcomes.push(o)
        })?;
        return Ok(tell(&outcomes));
    }
    let mut own = None;
    let address = match &args.server {
        Some(name) => resolve(name)?,
        None => {
            let options = match args.board {
                Board::Host => Options::default(),
                Board::Mps2 => match cable()? {
                    Cable::Here(options) => options,
                    Cable::Done(code) => return Ok(code),
                },
            };
            let simulator = Simulator::start(args.board, options)?;
            own.insert(simulator).address()
        }
    };
    let server = Server {
        address,
        map: args.map,
    };
    outcomes.extend(conformance::run(server, |_| ()));
    // the simulator has a serial line, too
    if let Some(path) = own.as_ref().and_then(Simulator::serial) {
        serial::run(&path, args.baud, STATION, &args.map, |o| outcomes.push(o))?;
    }
    Ok(tell(&outcomes))
}

fn tell(outcomes: &[Outcome]) -> ExitCode {
    print!("{}", conformance::table(outcomes));
    if outcomes.iter().all(|outcome| outcome.failed.is_none()) {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    }
}

/// How the board in QEMU is reached: QEMU's user network takes connections that the guest does not.
pub(super) enum Cable {
    /// So, by this process.
    Here(Options),
    /// This command has run a second time, with a cable.
    Done(ExitCode),
}

pub(super) fn cable() -> Result<Cable> {
    // before the namespace, which has no network to fetch anything from
    setup::mps2()?;
    let arguments: Vec<_> = env::args().skip(1).collect();
    Ok(match namespace::enter(&arguments) {
        Ok(Side::Inside) => Cable::Here(Options {
            network: Network::Tap,
            ..Options::default()
        }),
        Ok(Side::Outside(status)) if status.success() => Cable::Done(ExitCode::SUCCESS),
        Ok(Side::Outside(_)) => Cable::Done(ExitCode::FAILURE),
        Err(error) => {
            interrupt::check()?;
            eprintln!(
                "winder: {error:#}; asking through QEMU's user network, which fails two cases of its own"
            );
            Cable::Here(Options::default())
        }
    })
}

/// Prints what the servers of others fail, beside the simulator.
fn compare() -> Result<ExitCode> {
    setup::pymodbus()?;
    setup::mbpoll()?;
    let options = match cable()? {
        Cable::Here(options) => options,
        Cable::Done(code) => return Ok(code),
    };
    let mut columns = Vec::new();
    for (board, options) in [(Board::Host, Options::default()), (Board::Mps2, options)] {
        interrupt::check()?;
        eprintln!("winder: the simulator, {} …", board.name());
        let simulator = Simulator::start(board, options)?;
        let server = Server {
            address: simulator.address(),
            map: Map::default(),
        };
        let name = format!("simulator, {}", board.name());
        let outcomes = conformance::run(server, |_| ());
        columns.push(Column { name, outcomes });
    }
    columns.extend(peers::measure(|name| eprintln!("winder: {name} …"))?);
    print!(
        "# Conformance of Modbus TCP servers\n\n\
         Written by `cargo winder conformance --peers`: the cases that somebody fails, and what came instead. The other\n\
         servers are made as their documentation shows, with nothing added ([how](../host-tests/src/conformance/peers.rs)).\n\
         What a case does: [requests](../host-tests/src/conformance/pdu.rs),\n\
         [connections](../host-tests/src/conformance/stream.rs).\n\n{}",
        peers::table(&columns)
    );
    Ok(ExitCode::SUCCESS)
}
