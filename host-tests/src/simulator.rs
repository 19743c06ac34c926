//! A simulator to command: on a microcontroller in QEMU, or natively in this process.
//!
//! Not here: a simulator on hardware. It is at an address of its own, and nobody has to start it.

use std::net::SocketAddr;
use std::ops::RangeInclusive;

use anyhow::{Context, Result, ensure};
use board_host::{Line, STEP};
use firmware::journal::Journal;
use firmware::link::control::Access;
use firmware::link::modbus::tcp::Timeouts;
use model_core::logic::{Fault, Mode, Refusal};

use crate::log::{self, Level, Log};
use crate::qemu::{Qemu, SERIAL};
use crate::setup;

/// What the simulator runs on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Board {
    /// Arm Cortex-M7 microcontroller (mps2-an500) in QEMU
    Mps2,
    /// This PC, without QEMU
    Host,
}

impl Board {
    /// For people.
    pub fn name(self) -> &'static str {
        match self {
            Board::Mps2 => "Cortex-M7 in QEMU",
            Board::Host => "this PC",
        }
    }
}

/// Simulated time over real time: from slow motion to faster than any PC.
const PACES: RangeInclusive<f64> = 0.01..=1000.0;

/// How the board in QEMU is reached.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Network {
    /// At two ports of 127.0.0.1, through QEMU's user network.
    #[default]
    Ports,
    /// At its own address, by the TAP of [`crate::namespace`].
    Tap,
}

/// The link of the board that is a process; the one in QEMU has its own.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Link {
    /// Its serial line.
    pub serial: Line,
    /// Which client may do what.
    pub access: Access,
    /// How long its clients may keep a place without using it.
    pub timeouts: Timeouts,
}

impl Default for Link {
    fn default() -> Self {
        Self {
            serial: Line::Pseudoterminal,
            access: Access::default(),
            timeouts: Timeouts::default(),
        }
    }
}

/// How to run a simulator.
#[derive(Clone, Debug)]
pub struct Options {
    /// Port of 127.0.0.1 for Modbus TCP; 0 takes any free one.
    pub port: u16,
    /// Port of 127.0.0.1 for the HMI; 0 takes any free one.
    pub http_port: u16,
    /// How it is reached in QEMU.
    pub network: Network,
    /// What only the board that is a process can be told.
    pub link: Link,
    /// Simulated time over real time.
    pub pace: f64,
    /// Where its log goes.
    pub log: Log,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            port: 0,
            http_port: 0,
            network: Network::Ports,
            link: Link::default(),
            pace: 1.0,
            log: Log::default(),
        }
    }
}

impl Options {
    /// Refuses a pace that no clock can keep.
    fn check(&self) -> Result<()> {
        ensure!(
            PACES.contains(&self.pace),
            "pace {} is outside {} to {}: 1 is real time, 10 ten times faster",
            self.pace,
            PACES.start(),
            PACES.end()
        );
        Ok(())
    }
}

/// A running simulator; it ends when dropped.
pub enum Simulator {
    /// In QEMU.
    Mps2(Qemu),
    /// In this process.
    Host(board_host::Board),
}

impl Simulator {
    /// Installs and builds what is missing, starts the simulator, and waits until it answers.
    pub fn start(board: Board, options: Options) -> Result<Self> {
        options.check()?;
        ensure!(
            board == Board::Host || options.link == Link::default(),
            "serial line, access table and timeouts are those of --board host; the board in QEMU has its own"
        );
        match board {
            Board::Mps2 => Ok(Self::Mps2(Qemu::start(&setup::mps2()?, options)?)),
            Board::Host => Ok(Self::Host(host(options)?)),
        }
    }

    /// Where it answers Modbus TCP.
    pub fn address(&self) -> SocketAddr {
        match self {
            Self::Mps2(qemu) => qemu.address(),
            Self::Host(board) => board.address,
        }
    }

    /// Where its HMI is.
    pub fn http(&self) -> SocketAddr {
        match self {
            Self::Mps2(qemu) => qemu.http(),
            Self::Host(board) => board.http,
        }
    }

    /// Where the other end of its serial line is.
    pub fn serial(&self) -> Option<String> {
        match self {
            Self::Mps2(qemu) => qemu.serial(),
            Self::Host(board) => board.serial.clone(),
        }
    }

    /// An error that says why, once it has ended by itself.
    pub fn check(&mut self) -> Result<()> {
        match self {
            Self::Mps2(qemu) => qemu.check(),
            Self::Host(_) => Ok(()),
        }
    }
}

fn host(options: Options) -> Result<board_host::Board> {
    let Options {
        port,
        http_port,
        network: _,
        link,
        pace,
        log,
    } = options;
    let options = board_host::Options {
        port,
        http_port,
        serial: Some(link.serial),
        access: link.access,
        timeouts: link.timeouts,
        pace,
        ..board_host::Options::default()
    };
    let board = board_host::Board::simulate(options, HostJournal(log.clone()));
    let board = board.with_context(|| {
        format!("cannot start the simulator at the ports {port} and {http_port} of 127.0.0.1")
    })?;
    if let Some(path) = &board.serial {
        log.push(log::Line {
            level: Level::Info,
            time: None,
            text: format!("{SERIAL}{path}"),
        });
    }
    Ok(board)
}

/// The native board's journal, in the words of the firmware's log.
struct HostJournal(Log);

impl HostJournal {
    fn push(&mut self, level: Level, cycle: u32, text: String) {
        let time = Some(format!("{:.6}", f64::from(cycle) * STEP.as_secs_f64()));
        self.0.push(log::Line { level, time, text });
    }
}

impl Journal for HostJournal {
    fn command(&mut self, cycle: u32, word: u16, value: u16) {
        self.push(
            Level::Debug,
            cycle,
            format!("command {cycle} {word} {value}"),
        );
    }

    fn state(&mut self, cycle: u32, mode: Mode, fault: Fault, refusal: Refusal) {
        let mut text = mode.name().to_owned();
        let mut level = Level::Info;
        if refusal != Refusal::None {
            level = Level::Warn;
            text += &format!("; refused: {}", refusal.name());
        }
        if fault != Fault::None {
            level = Level::Error;
            text += &format!("; fault: {}", fault.name());
        }
        self.push(level, cycle, text);
    }
}
