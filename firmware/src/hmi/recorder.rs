//! The recording of a run: every command with the drive cycle in which it counted, from power-up or a snapshot on.
//!
//! Not here: the state at its beginning. From that state, the commands give the same run to the bit.

use heapless::Vec;
use model_core::image::{self, Commands, Image};

/// Commands that are recorded; then the recording has its end.
const ENTRIES: usize = 8192;

/// A word of the command block, and from which cycle after the beginning on it counts.
#[derive(Clone, Copy, Debug)]
pub struct Entry {
    /// Drive cycles since the beginning.
    pub after: u32,
    /// The word.
    pub word: u16,
    /// Its value.
    pub value: u16,
}

/// What a recording begins with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Beginning {
    /// The machine at power-up.
    PowerUp,
    /// The snapshot.
    Snapshot,
}

/// Where the plant is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Mark {
    /// Drive cycles since the beginning.
    pub after: u32,
    /// Plant steps.
    pub ticks: u32,
    /// Hash over all of them.
    pub trajectory: u32,
}

/// What becomes of a replay.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Replayed {
    /// The run is the recorded one to the bit.
    Same,
    /// It is another one.
    Other,
}

/// The recording.
#[derive(Debug)]
pub struct Recorder {
    /// What it begins with.
    pub beginning: Beginning,
    /// The command block at the beginning.
    pub first: Commands,
    entries: Vec<Entry, ENTRIES>,
    begun: u32,
    known: Commands,
    end: Mark,
    full: bool,
    /// The next entry to be played.
    playing: Option<usize>,
}

impl Recorder {
    /// A recording from power-up.
    pub fn new(first: Commands) -> Self {
        Self {
            beginning: Beginning::PowerUp,
            first,
            entries: Vec::new(),
            begun: 0,
            known: first,
            end: Mark::default(),
            full: false,
            playing: None,
        }
    }

    /// A new recording, whose first drive cycle is this one.
    pub fn begin(&mut self, cycle: u32, beginning: Beginning, first: Commands) {
        (self.beginning, self.begun) = (beginning, cycle);
        (self.first, self.known) = (first, first);
        self.entries.clear();
        (self.end, self.full, self.playing) = (Mark::default(), false, None);
    }

    /// Plays the recording again from this drive cycle on, at which the simulator is as it was at its beginning.
    pub fn play(&mut self, cycle: u32) {
        (self.begun, self.known) = (cycle, self.first);
        self.playing = Some(0);
    }

    /// It is being played.
    pub fn is_playing(&self) -> bool {
        self.playing.is_some()
    }

    /// There was no room for all commands.
    pub fn is_full(&self) -> bool {
        self.full
    }

    /// Its entry of a number.
    pub fn entry(&self, number: usize) -> Option<Entry> {
        self.entries.get(number).copied()
    }

    /// Where it ends.
    pub fn end(&self) -> Mark {
        self.end
    }

    /// Before a drive cycle: commands what was recorded, if it is being played.
    pub fn before(&mut self, cycle: u32, commands: &mut Commands) {
        let Some(next) = &mut self.playing else {
            return;
        };
        let after = cycle.wrapping_sub(self.begun);
        while let Some(entry) = self.entries.get(*next)
            && entry.after <= after
        {
            self.known.words[usize::from(entry.word)] = entry.value;
            *next += 1;
        }
        *commands = self.known;
    }

    /// After a drive cycle: records what was commanded in it, or tells what became of the replay at its end.
    pub fn after(&mut self, cycle: u32, image: &Image) -> Option<Replayed> {
        let after = cycle.wrapping_sub(self.begun);
        let feedback = &image.feedback;
        let now = Mark {
            after: after.wrapping_add(1),
            ticks: feedback.double(&image::PLANT_TICKS),
            trajectory: feedback.double(&image::TRAJECTORY),
        };
        if self.is_playing() {
            if now.after < self.end.after {
                return None;
            }
            self.playing = None;
            return Some(match now == self.end {
                true => Replayed::Same,
                false => Replayed::Other,
            });
        }
        if self.full {
            return None;
        }
        let (known, commanded) = (self.known.words, image.commands.words);
        for (word, (old, new)) in (0..).zip(known.into_iter().zip(commanded)) {
            let entry = Entry {
                after,
                word,
                value: new,
            };
            if old != new && self.entries.push(entry).is_err() {
                self.full = true;
                // What was commanded in this cycle is not known as a whole.
                self.entries.retain(|entry| entry.after != after);
                return None;
            }
        }
        (self.known, self.end) = (image.commands, now);
        None
    }
}
