//! The drive bus between PLC and drives: what it delays, and when it is silent.
//!
//! Not here: protocols. The simulator's own words do not travel by the bus of a winder and are neither late nor lost.

use crate::image::{
    BUS_DELAY, Block, COMMAND_WORDS, Commands, Direction, FAULT_DRIVES, FEEDBACK_WORDS, Feedback,
    SIGNALS, Section,
};
use crate::logic::inject;

/// Longest delay, drive cycles.
pub const MAX_DELAY: usize = 10;

/// Which words of the commands are the simulator's own.
const OWN_COMMANDS: [bool; COMMAND_WORDS] = own(Direction::Command);
/// Which words of the feedback are.
const OWN_FEEDBACK: [bool; FEEDBACK_WORDS] = own(Direction::Feedback);

const fn own<const N: usize>(direction: Direction) -> [bool; N] {
    let (mut own, mut i) = ([false; N], 0);
    while i < SIGNALS.len() {
        let s = &SIGNALS[i];
        let same = s.direction as u8 == direction as u8;
        if same && matches!(s.section, Section::Simulator) {
            let mut word = s.word;
            while word < s.word + s.kind.words() {
                own[word as usize] = true;
                word += 1;
            }
        }
        i += 1;
    }
    own
}

/// The last cycles of both directions.
#[derive(Clone, Debug)]
pub struct Bus {
    commands: [Commands; MAX_DELAY],
    feedback: [Feedback; MAX_DELAY],
    now: usize,
    /// Cycles that are on record, up to the longest delay.
    known: usize,
    /// Cycles that both directions are late, beyond the present one.
    late: usize,
    silent: bool,
}

impl Default for Bus {
    fn default() -> Self {
        Self {
            commands: [Commands::default(); MAX_DELAY],
            feedback: [Feedback::default(); MAX_DELAY],
            now: 0,
            known: 0,
            late: 0,
            silent: false,
        }
    }
}

impl Bus {
    /// A new cycle: what the drives get of the PLC's commands. With a delay of one cycle that is what stands in the
    /// image; the answer of the drives follows in the cycle after it.
    pub fn receive(&mut self, commands: &Commands) -> Commands {
        let delay: f32 = commands.get(&BUS_DELAY);
        self.silent = commands.word(&FAULT_DRIVES) & inject::BUS_SILENT != 0;
        let (before, now) = (self.now, (self.now + 1) % MAX_DELAY);
        self.commands[now] = if self.silent && self.known > 0 {
            self.commands[before]
        } else {
            *commands
        };
        self.now = now;
        self.known = (self.known + 1).min(MAX_DELAY);
        self.late = (delay as usize).saturating_sub(1).min(self.known - 1);
        let mut seen = *commands;
        overlay(&mut seen, &self.commands[self.past()], &OWN_COMMANDS);
        seen
    }

    /// The end of the cycle: what the PLC sees of the drives' answer. The simulator's own words are the caller's.
    pub fn send(&mut self, answer: &Feedback, seen: &mut Feedback) {
        self.feedback[self.now] = if self.silent && self.known > 1 {
            self.feedback[(self.now + MAX_DELAY - 1) % MAX_DELAY]
        } else {
            *answer
        };
        overlay(seen, &self.feedback[self.past()], &OWN_FEEDBACK);
    }

    fn past(&self) -> usize {
        (self.now + MAX_DELAY - self.late) % MAX_DELAY
    }
}

/// Puts what travels by the bus over a block, and leaves it what is the simulator's own.
fn overlay<const N: usize>(block: &mut Block<N>, travelled: &Block<N>, own: &[bool; N]) {
    for ((word, own), travelled) in block.words.iter_mut().zip(own).zip(travelled.words) {
        if !own {
            *word = travelled;
        }
    }
}
