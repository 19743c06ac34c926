//! A simulator to command: on a microcontroller in QEMU, or natively in this process.
//!
//! Not here: a simulator on hardware. It is at an address of its own, and nobody has to start it.

use std::net::SocketAddr;

use anyhow::{Result, bail};

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
#[derive(Debug)]
pub enum Simulator {
    /// In QEMU.
    Mps2(Qemu),
}

impl Simulator {
    /// Installs and builds what is missing, starts the simulator, and waits until it answers.
    pub fn start(board: Board, options: qemu::Options) -> Result<Self> {
        match board {
            Board::Mps2 => Ok(Self::Mps2(Qemu::start(&setup::mps2()?, options)?)),
            Board::Host => bail!("the board host is not there yet"),
        }
    }

    /// Where it answers Modbus TCP.
    pub fn address(&self) -> SocketAddr {
        match self {
            Self::Mps2(qemu) => qemu.address(),
        }
    }

    /// An error that says why, once it has ended by itself.
    pub fn check(&mut self) -> Result<()> {
        match self {
            Self::Mps2(qemu) => qemu.check(),
        }
    }
}
