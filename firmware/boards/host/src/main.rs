//! `board_host`: serves until Ctrl-C or SIGTERM. Its options are those of [`USAGE`].

use std::env;
use std::process::ExitCode;
use std::str::FromStr;

use board_host::{Board, Options, STEP, access};
use embassy_futures::select::select;
use embassy_time::Duration;
use firmware::journal::Journal;
use model_core::logic::{Fault, Mode, Refusal};
use tokio::signal::unix::{SignalKind, signal};

/// Unlike Modbus's own 502, it needs no privilege.
const PORT: u16 = 5020;

/// Unlike HTTP's own 80, it needs no privilege, either.
const HTTP_PORT: u16 = 8080;

const USAGE: &str = "usage: board_host [--port N] [--http-port N] [--serial pty|DEVICE[:BAUD]] [--idle SECONDS] \
    [--access ADDRESS|others=none|read|write]…";

fn main() -> ExitCode {
    let served = options(env::args().skip(1))
        .and_then(|options| run(options).map_err(|error| error.to_string()));
    match served {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("board_host: {error}");
            ExitCode::FAILURE
        }
    }
}

fn options(mut arguments: impl Iterator<Item = String>) -> Result<Options, String> {
    let mut options = Options {
        port: PORT,
        http_port: HTTP_PORT,
        ..Options::default()
    };
    let mut rules = Vec::new();
    while let Some(option) = arguments.next() {
        let mut value = || arguments.next().ok_or(USAGE);
        match option.as_str() {
            "--port" => options.port = number(&value()?, "port")?,
            "--http-port" => options.http_port = number(&value()?, "port")?,
            "--serial" => options.serial = Some(value()?.parse()?),
            "--idle" => {
                let seconds = number::<u32>(&value()?, "number of seconds")?;
                options.timeouts.idle = Duration::from_secs(seconds.into());
            }
            "--access" => rules.push(value()?.parse()?),
            _ => return Err(USAGE.into()),
        }
    }
    options.access = access(&rules)?;
    Ok(options)
}

fn number<N: FromStr>(text: &str, what: &str) -> Result<N, String> {
    text.parse().map_err(|_| format!("no such {what}: {text}"))
}

fn run(options: Options) -> std::io::Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()?;
    runtime.block_on(async {
        // Before the board says that it is ready, for whoever then stops it at once.
        let mut interrupt = signal(SignalKind::interrupt())?;
        let mut terminate = signal(SignalKind::terminate())?;
        let board = Board::simulate(options, Log)?;
        let serial = board.serial.iter().map(|path| format!(" serial={path}"));
        let serial: String = serial.collect();
        println!(
            "ready modbus={} http=http://{}{serial}",
            board.address, board.http
        );
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
