//! The journal goes to the log: commands for a replay, states for people.

use firmware::journal::Journal;
use model_core::logic::{Fault, Mode, Refusal};

/// The way to the log.
pub struct Log;

impl Journal for Log {
    fn command(&mut self, cycle: u32, word: u16, value: u16) {
        defmt::debug!("command {=u32} {=u16} {=u16}", cycle, word, value);
    }

    fn state(&mut self, _: u32, mode: Mode, fault: Fault, refusal: Refusal) {
        match (fault, refusal) {
            (Fault::None, Refusal::None) => defmt::info!("{=str}", mode.name()),
            (Fault::None, _) => {
                defmt::warn!("{=str}; refused: {=str}", mode.name(), refusal.name())
            }
            (_, Refusal::None) => defmt::error!("{=str}; fault: {=str}", mode.name(), fault.name()),
            (_, _) => defmt::error!(
                "{=str}; fault: {=str}; refused: {=str}",
                mode.name(),
                fault.name(),
                refusal.name()
            ),
        }
    }
}
