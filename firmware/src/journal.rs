//! The journal of a run: every command with the drive cycle in which it counted, and what became of it.
//!
//! Not here: where the lines go; that is the board's. Played back into the same simulator, the commands of a
//! journal give the same trajectory to the bit.

use model_core::image::{self, Commands, Image};
use model_core::logic::{Fault, Mode, Refusal};

/// Takes the entries of a journal.
pub trait Journal {
    /// A word of the command block has a new value from this drive cycle on.
    fn command(&mut self, cycle: u32, word: u16, value: u16);
    /// The mode, the latched fault or the refusal has changed in this drive cycle.
    fn state(&mut self, cycle: u32, mode: Mode, fault: Fault, refusal: Refusal);
}

/// No journal.
impl Journal for () {
    fn command(&mut self, _: u32, _: u16, _: u16) {}
    fn state(&mut self, _: u32, _: Mode, _: Fault, _: Refusal) {}
}

/// Sees what has changed from one drive cycle to the next.
#[derive(Clone, Debug)]
pub struct Observer {
    commands: Commands,
    state: [u16; 3],
}

impl Observer {
    /// Starts from the command block at power-up.
    pub fn new(commands: Commands) -> Self {
        Self {
            commands,
            state: [0; 3],
        }
    }

    /// Looks at the image after a drive cycle.
    pub fn look(&mut self, cycle: u32, image: &Image, journal: &mut impl Journal) {
        let (old, new) = (self.commands.words, image.commands.words);
        for (word, (old, new)) in (0..).zip(old.into_iter().zip(new)) {
            if old != new {
                journal.command(cycle, word, new);
            }
        }
        self.commands = image.commands;

        let f = &image.feedback;
        let state = [&image::MODE, &image::FAULT, &image::REFUSAL].map(|signal| f.word(signal));
        if state != self.state {
            let [mode, fault, refusal] = state.map(usize::from);
            journal.state(
                cycle,
                Mode::ALL[mode],
                Fault::ALL[fault],
                Refusal::ALL[refusal],
            );
            self.state = state;
        }
    }
}
