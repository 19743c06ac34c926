//! A task that hangs, and what becomes of the simulator.
//!
//! Not here: how the firmware is made to hang; it takes an order that only somebody can give who writes its memory before
//! power comes.

use anyhow::{Context, Result, bail};
use model_core::image::{FAULT, Feedback, HEARTBEAT, MODE, RESTART, RESTARTS};
use model_core::logic::{Fault, Mode};
use model_core::restart::Restart;

use super::bench::{Bench, Watch};
use super::elf::Elf;
use super::load::{LOADS, POLLING};
use super::{Firmware, SECONDS_PER_INSTRUCTION};
use crate::twin::Core;

/// What hangs, by the number that the firmware's order has in its lowest byte.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    /// The plant's executor.
    Plant,
    /// The regulators'.
    Drive,
    /// That of all else.
    Background,
}

/// The order.
const HANG: u32 = u32::from_be_bytes(*b"han\0");
/// Where it stands.
const ORDER: &str = "TEST_ORDER";
/// Virtual milliseconds until something must have happened.
const LIMIT: u64 = 10_000;

/// What a PLC sees of a firmware that has hung.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// The mode before it hung.
    pub mode_before: Mode,
    /// Afterwards.
    pub mode: Mode,
    /// The fault that is told.
    pub fault: Fault,
    /// Why it has started.
    pub why: Restart,
    /// How often by itself.
    pub times: u16,
    /// From the last answer before to the first one after, at most, s of virtual time.
    pub dark_s: f64,
}

impl Firmware {
    /// Has a level of the firmware hang under a polling PLC.
    pub fn hang(&self, core: &Core, level: Level) -> Result<Seen> {
        let files = self.files(core)?;
        let elf = Elf::read(&files.firmware)?;
        let order = elf
            .find(ORDER)
            .with_context(|| format!("the firmware has no {ORDER}"))?;
        let word = HANG | level as u32;
        let mut bench = Bench::start_with(&files, core, &elf, Watch::Tasks(&[]), &[(order, word)])?;
        let mut load = (LOADS[POLLING].load)();
        let mut before = Feedback::default();
        // when the last answer came, in beats and in instructions
        let (mut answered, mut executed) = (0, 0);
        for now in 0..LIMIT {
            let received = bench.received()?;
            bench.send(&load.beat(now, received)?)?;
            bench.pass(1)?;
            let feedback = *load.feedback().context("nobody asks the firmware")?;
            if feedback.word(&HEARTBEAT) == before.word(&HEARTBEAT) {
                continue;
            }
            let instructions = bench.report()?.executed;
            let why = Restart::ALL.get(usize::from(feedback.word(&RESTART)));
            let why = *why.context("no such restart")?;
            if why != Restart::PowerOn {
                // while it hangs nothing beats, and every instruction takes its time
                let hung_s = (instructions - executed) as f64 * SECONDS_PER_INSTRUCTION;
                return Ok(Seen {
                    mode_before: mode(&before)?,
                    mode: mode(&feedback)?,
                    fault: *Fault::ALL
                        .get(usize::from(feedback.word(&FAULT)))
                        .context("no such fault")?,
                    why,
                    times: feedback.word(&RESTARTS),
                    dark_s: 1e-3 * (now + 1 - answered) as f64 + hung_s,
                });
            }
            (before, answered, executed) = (feedback, now, instructions);
        }
        bail!("the firmware has not restarted within {LIMIT} ms")
    }
}

fn mode(feedback: &Feedback) -> Result<Mode> {
    let mode = Mode::ALL.get(usize::from(feedback.word(&MODE)));
    mode.copied().context("no such mode")
}
