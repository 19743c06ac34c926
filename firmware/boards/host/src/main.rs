//! `board_host [--port N]`: serves until Ctrl-C or SIGTERM.

use std::env;
use std::process::ExitCode;

use board_host::{Board, Options, STEP, simulator};
use embassy_futures::select::select;
use firmware::journal::Journal;
use model_core::logic::{Fault, Mode, Refusal};
use tokio::signal::unix::{SignalKind, signal};

/// Unlike Modbus's own 502, it needs no privilege.
const PORT: u16 = 5020;

fn main() -> ExitCode {
    match port(env::args().skip(1)).and_then(|port| run(port).map_err(|error| error.to_string())) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("board_host: {error}");
            ExitCode::FAILURE
        }
    }
}

fn port(mut arguments: impl Iterator<Item = String>) -> Result<u16, String> {
    let Some(option) = arguments.next() else {
        return Ok(PORT);
    };
    match (option.as_str(), arguments.next(), arguments.next()) {
        ("--port", Some(port), None) => port.parse().map_err(|_| format!("no such port: {port}")),
        _ => Err("usage: board_host [--port N]".into()),
    }
}

fn run(port: u16) -> std::io::Result<()> {
    let options = Options {
        port,
        ..Options::default()
    };
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()?;
    runtime.block_on(async {
        // Before the board says that it is ready, for whoever then stops it at once.
        let mut interrupt = signal(SignalKind::interrupt())?;
        let mut terminate = signal(SignalKind::terminate())?;
        let board = Board::start(options, simulator(Log))?;
        println!("ready modbus={}", board.address);
        select(interrupt.recv(), terminate.recv()).await;
        board.stop();
        Ok(())
    })
}

/// The journal for people.
struct Log;

impl Journal for Log {
    fn command(&mut self, _: u32, _: u16, _: u16) {}

    fn state(&mut self, cycle: u32, mode: Mode, fault: Fault, refusal: Refusal) {
        let seconds = f64::from(cycle) * STEP.as_secs_f64();
        eprintln!(
            "{seconds:.2} s: {}; fault: {}; refused: {}",
            mode.name(),
            fault.name(),
            refusal.name()
        );
    }
}
