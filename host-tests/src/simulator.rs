//! A simulator to command: on a microcontroller in QEMU, or natively in this process.
//!
//! Not here: a simulator on hardware. It is at an address of its own, and nobody has to start it.

use std::net::SocketAddr;

use anyhow::{Context, Result};
use model_core::machine::Machine;

use crate::qemu::{self, Qemu};
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

/// A running simulator; it ends when dropped.
pub enum Simulator {
    /// In QEMU.
    Mps2(Qemu),
    /// In this process.
    Host(board_host::Board),
}

impl Simulator {
    /// Installs and builds what is missing, starts the simulator, and waits until it answers.
    pub fn start(board: Board, options: qemu::Options) -> Result<Self> {
        options.check()?;
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

    /// An error that says why, once it has ended by itself.
    pub fn check(&mut self) -> Result<()> {
        match self {
            Self::Mps2(qemu) => qemu.check(),
            Self::Host(_) => Ok(()),
        }
    }
}

/// Spans of the machine that the boards simulate, NEWS-8000.
const SPANS: usize = 3;

fn host(options: qemu::Options) -> Result<board_host::Board> {
    let qemu::Options { port, pace, .. } = options;
    let mut simulator = model_core::simulator::Simulator::<f32, SPANS>::new(&Machine::news_8000())?;
    let options = board_host::Options {
        port,
        ..board_host::Options::default()
    };
    // the board steps in real time: at another pace, more or fewer drive cycles to the step
    let mut owed = 0.0;
    let step = move |image: &mut _| {
        owed += pace;
        while owed >= 1.0 {
            simulator.drive_cycle(image);
            owed -= 1.0;
        }
    };
    board_host::Board::start(options, step)
        .with_context(|| format!("cannot start the simulator at port {port} of 127.0.0.1"))
}
