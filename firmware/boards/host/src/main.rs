//! `board_host [--port N] [--http-port N]`: serves until Ctrl-C or SIGTERM.

use std::env;
use std::process::ExitCode;

use board_host::{Board, Options, STEP};
use embassy_futures::select::select;
use firmware::journal::Journal;
use model_core::logic::{Fault, Mode, Refusal};
use tokio::signal::unix::{SignalKind, signal};

/// Unlike Modbus's own 502, it needs no privilege.
const PORT: u16 = 5020;

/// Unlike HTTP's own 80, it needs no privilege, either.
const HTTP_PORT: u16 = 8080;

fn main() -> ExitCode {
    let served = ports(env::args().skip(1)).and_then(|ports| run(ports).map_err(|e| e.to_string()));
    match served {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("board_host: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Modbus's and the HMI's.
fn ports(mut arguments: impl Iterator<Item = String>) -> Result<(u16, u16), String> {
    let (mut modbus, mut http) = (PORT, HTTP_PORT);
    while let Some(option) = arguments.next() {
        let port = match option.as_str() {
            "--port" => &mut modbus,
            "--http-port" => &mut http,
            _ => return Err("usage: board_host [--port N] [--http-port N]".into()),
        };
        let number = arguments.next().unwrap_or_default();
        *port = number
            .parse()
            .map_err(|_| format!("no such port: {number}"))?;
    }
    Ok((modbus, http))
}

fn run((port, http_port): (u16, u16)) -> std::io::Result<()> {
    let options = Options {
        port,
        http_port,
        ..Options::default()
    };
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()?;
    runtime.block_on(async {
        // Before the board says that it is ready, for whoever then stops it at once.
        let mut interrupt = signal(SignalKind::interrupt())?;
        let mut terminate = signal(SignalKind::terminate())?;
        let board = Board::simulate(options, Log)?;
        println!("ready modbus={} http=http://{}", board.address, board.http);
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
