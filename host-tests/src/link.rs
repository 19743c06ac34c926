//! The process image over Modbus TCP, seen from the PLC.
//!
//! Not here: single signals, coils, reconnecting. A PLC reads the whole feedback block and writes all of its own
//! commands, one request each, so that what belongs together travels together. The faults that somebody else puts in
//! stand behind its commands and are none of its business.

use std::net::{SocketAddr, ToSocketAddrs};
use std::time::Duration;

use anyhow::{Context, Result, anyhow};
use model_core::image::{COMMAND_WORDS, Commands, FEEDBACK_WORDS, Feedback, PLC_COMMAND_WORDS};
use tokio_modbus::client::sync::{self, Reader as _, Writer as _};

/// An answer takes milliseconds; this long without one, the simulator is gone.
const TIMEOUT: Duration = Duration::from_secs(2);

/// The place of a Modbus TCP server, as it is given on the command line.
pub fn resolve(address: &str) -> Result<SocketAddr> {
    let wrong = || format!("{address} is not HOST:PORT, as 127.0.0.1:502");
    let found = address.to_socket_addrs().with_context(wrong)?.next();
    found.with_context(wrong)
}

/// A connection to a simulator.
pub struct Link {
    context: sync::Context,
    address: SocketAddr,
}

impl Link {
    /// Connects.
    pub fn connect(address: SocketAddr) -> Result<Self> {
        let mut context = sync::tcp::connect_with_timeout(address, Some(TIMEOUT))
            .with_context(|| format!("no simulator listens at {address} (Modbus TCP)"))?;
        context.set_timeout(TIMEOUT);
        Ok(Self { context, address })
    }

    /// Reads the feedback block (function code 4).
    pub fn read(&mut self) -> Result<Feedback> {
        let words = self
            .context
            .read_input_registers(0, FEEDBACK_WORDS as u16)
            .map_err(anyhow::Error::from)
            .and_then(|answer| answer.map_err(|exception| anyhow!("exception: {exception}")))
            .with_context(|| self.failed("read the feedback block"))?;
        let words = words.try_into().map_err(|words: Vec<u16>| {
            anyhow!(
                "asked for {FEEDBACK_WORDS} feedback words, got {}",
                words.len()
            )
        })?;
        Ok(Feedback { words })
    }

    /// Reads the command block, as its writers have left it (function code 3).
    pub fn read_commands(&mut self) -> Result<Commands> {
        let words = self
            .context
            .read_holding_registers(0, COMMAND_WORDS as u16)
            .map_err(anyhow::Error::from)
            .and_then(|answer| answer.map_err(|exception| anyhow!("exception: {exception}")))
            .with_context(|| self.failed("read the command block"))?;
        let words = words.try_into().map_err(|words: Vec<u16>| {
            anyhow!(
                "asked for {COMMAND_WORDS} command words, got {}",
                words.len()
            )
        })?;
        Ok(Commands { words })
    }

    /// Writes the commands of a winder PLC (function code 16).
    pub fn write(&mut self, commands: &Commands) -> Result<()> {
        self.write_at(0, &commands.words[..PLC_COMMAND_WORDS])
    }

    /// Writes the whole command block, with the faults that a test puts in.
    pub fn write_all(&mut self, commands: &Commands) -> Result<()> {
        self.write_at(0, &commands.words)
    }

    /// Writes a part of the command block, from this word on.
    pub fn write_at(&mut self, first: usize, words: &[u16]) -> Result<()> {
        self.context
            .write_multiple_registers(first as u16, words)
            .map_err(anyhow::Error::from)
            .and_then(|answer| answer.map_err(|exception| anyhow!("exception: {exception}")))
            .with_context(|| self.failed("write the command block"))
    }

    fn failed(&self, what: &str) -> String {
        format!("cannot {what} at {} (Modbus TCP)", self.address)
    }
}
