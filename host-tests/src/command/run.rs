//! `winder run`

use std::io::{self, Write};
use std::process::{Command, ExitCode, Stdio};
use std::thread;
use std::time::Duration;

use anyhow::Result;
use board_host::{Line, Rule};
use firmware::link::modbus::tcp::Timeouts;

use crate::interrupt::{self, Interrupted};
use crate::log::{Level, Log};
use crate::simulator::{self, Board, Options, Simulator};

/// How to run the simulator.
#[derive(Clone, Debug, clap::Args)]
pub struct Args {
    /// What the simulator runs on
    #[arg(long, value_enum, default_value_t = Board::Mps2)]
    board: Board,
    /// Port of 127.0.0.1 for Modbus TCP; 0 takes any free one
    #[arg(long, default_value_t = 0)]
    port: u16,
    /// Port of 127.0.0.1 for the HMI; 0 takes any free one
    #[arg(long, default_value_t = 0)]
    http_port: u16,
    /// Show the HMI in a browser
    #[arg(long)]
    open: bool,
    /// Simulated time over real time
    #[arg(long, default_value_t = 1.0)]
    pace: f64,
    /// Serial line of --board host: pty, or a device as /dev/ttyUSB0:19200
    #[arg(long, value_name = "LINE", default_value = "pty")]
    serial: Line,
    /// What a client of --board host may do: ADDRESS=RIGHT or others=RIGHT, with none, read or write; may be given several
    /// times
    #[arg(long, value_name = "ADDRESS=RIGHT")]
    access: Vec<Rule>,
    /// A client of --board host that asks nothing for so many seconds loses its place
    #[arg(long, value_name = "SECONDS", default_value_t = Timeouts::default().idle.as_secs())]
    idle: u64,
}

/// Runs the simulator until Ctrl-C; your PLC does the rest.
pub fn main(args: Args) -> Result<ExitCode> {
    match serve(args) {
        Err(error) if error.is::<Interrupted>() => Ok(ExitCode::SUCCESS),
        other => other.map(|()| ExitCode::SUCCESS),
    }
}

fn serve(args: Args) -> Result<()> {
    let options = Options {
        port: args.port,
        http_port: args.http_port,
        link: simulator::Link {
            serial: args.serial,
            access: board_host::access(&args.access).map_err(anyhow::Error::msg)?,
            timeouts: Timeouts {
                idle: embassy_time::Duration::from_secs(args.idle),
                ..Timeouts::default()
            },
        },
        pace: args.pace,
        log: Log::new(|line| {
            if line.level >= Level::Info {
                eprintln!("{line}");
            }
        }),
        ..Options::default()
    };
    let mut simulator = Simulator::start(args.board, options)?;
    let mut out = io::stdout().lock();
    let page = format!("http://{}", simulator.http());
    writeln!(out, "ready modbus={} http={page}", simulator.address())?;
    out.flush()?;
    if args.open {
        open(&page);
    }
    loop {
        interrupt::check()?;
        simulator.check()?;
        thread::sleep(Duration::from_millis(100));
    }
}

/// Asks the desktop for a browser. Without a desktop, the address is on the screen all the same.
fn open(page: &str) {
    let opened = Command::new("xdg-open")
        .arg(page)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn();
    if let Err(error) = opened {
        eprintln!("winder: cannot open a browser (xdg-open: {error}); open {page} yourself");
    }
}
