//! The drive bus between PLC and drives: what it delays, and when it is silent.
//!
//! Not here: protocols. The simulator's own words do not travel by the bus of a winder and are neither late nor lost.

use crate::image::{
    BUS_DELAY, Commands, Direction, FAULT_DRIVES, FEEDBACK_WORDS, Feedback, PLC_COMMAND_WORDS,
    SIGNALS, Section,
};
use crate::logic::inject;

/// Longest delay, drive cycles.
pub const MAX_DELAY: usize = 10;

/// Which words of the feedback are the simulator's own.
const OWN: [bool; FEEDBACK_WORDS] = {
    let (mut own, mut i) = ([false; FEEDBACK_WORDS], 0);
    while i < SIGNALS.len() {
        let s = &SIGNALS[i];
        if matches!(s.direction, Direction::Feedback) && matches!(s.section, Section::Simulator) {
            let mut word = s.word;
            while word < s.word + s.kind.words() {
                own[word as usize] = true;
                word += 1;
            }
        }
        i += 1;
    }
    own
};

/// The last cycles of both directions.
#[derive(Clone, Debug)]
pub struct Bus {
    commands: [[u16; PLC_COMMAND_WORDS]; MAX_DELAY],
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
            commands: [[0; PLC_COMMAND_WORDS]; MAX_DELAY],
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
        let (plc, _) = commands.words.split_at(PLC_COMMAND_WORDS);
        if !self.silent || self.known == 0 {
            self.commands[now].copy_from_slice(plc);
        } else {
            self.commands[now] = self.commands[before];
        }
        self.now = now;
        self.known = (self.known + 1).min(MAX_DELAY);
        self.late = (delay as usize).saturating_sub(1).min(self.known - 1);
        let mut seen = *commands;
        seen.words[..PLC_COMMAND_WORDS].copy_from_slice(&self.commands[self.past()]);
        seen
    }

    /// The end of the cycle: what the PLC sees of the drives' answer. The simulator's own words are the caller's.
    pub fn send(&mut self, answer: &Feedback, seen: &mut Feedback) {
        self.feedback[self.now] = if self.silent && self.known > 1 {
            self.feedback[(self.now + MAX_DELAY - 1) % MAX_DELAY]
        } else {
            *answer
        };
        let past = &self.feedback[self.past()];
        for ((word, own), old) in seen.words.iter_mut().zip(OWN).zip(past.words) {
            if !own {
                *word = old;
            }
        }
    }

    fn past(&self) -> usize {
        (self.now + MAX_DELAY - self.late) % MAX_DELAY
    }
}
