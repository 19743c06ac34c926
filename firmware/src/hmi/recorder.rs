//! The recording of a run: every command with the drive cycle in which it counted, from power-up or a snapshot on.
//!
//! Not here: the state at its beginning. From that state, the commands give the same run to the bit.

use heapless::Vec;
use model_core::image::{self, Commands, Image};

/// Commands that are recorded; then the recording has its end.
pub const ENTRIES: usize = 8192;

/// A word of the command block, and from which cycle after the beginning on it counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Entry {
    /// Drive cycles since the beginning.
    pub after: u32,
    /// The word.
    pub word: u16,
    /// Its value; none counts it up in every cycle until its next entry, as the panel's heartbeat does.
    pub value: Option<u16>,
}

/// An entry as it is kept: a third less than as it is looked at.
#[derive(Clone, Copy, Debug)]
struct Kept {
    after: u32,
    /// The word; with the highest bit it counts up.
    word: u16,
    value: u16,
}

impl Kept {
    const COUNTS: u16 = 1 << 15;

    fn of(entry: Entry) -> Self {
        let counts = if entry.value.is_none() {
            Self::COUNTS
        } else {
            0
        };
        Self {
            after: entry.after,
            word: entry.word | counts,
            value: entry.value.unwrap_or_default(),
        }
    }

    fn entry(&self) -> Entry {
        Entry {
            after: self.after,
            word: self.word & !Self::COUNTS,
            value: (self.word & Self::COUNTS == 0).then_some(self.value),
        }
    }
}

const _: () = assert!(image::COMMAND_WORDS < Kept::COUNTS as usize);

/// The word that may count up by itself.
const BEAT: u16 = image::HEARTBEAT_PLC.word;

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
    entries: Vec<Kept, ENTRIES>,
    begun: u32,
    known: Commands,
    /// The heartbeat counts up by itself ...
    counting: bool,
    /// ... or has done so in the last cycle.
    beaten: bool,
    end: Mark,
    full: bool,
    /// The next entry to be played.
    playing: Option<usize>,
}

impl Recorder {
    /// A recording from power-up.
    pub const fn new(first: Commands) -> Self {
        Self {
            beginning: Beginning::PowerUp,
            first,
            entries: Vec::new(),
            begun: 0,
            known: first,
            counting: false,
            beaten: false,
            end: Mark {
                after: 0,
                ticks: 0,
                trajectory: 0,
            },
            full: false,
            playing: None,
        }
    }

    /// A new recording, whose first drive cycle is this one.
    pub fn begin(&mut self, cycle: u32, beginning: Beginning, first: Commands) {
        (self.beginning, self.begun) = (beginning, cycle);
        (self.first, self.known) = (first, first);
        (self.counting, self.beaten) = (false, false);
        self.entries.clear();
        (self.end, self.full, self.playing) = (Mark::default(), false, None);
    }

    /// Plays the recording again from this drive cycle on, at which the simulator is as it was at its beginning.
    pub fn play(&mut self, cycle: u32) {
        (self.begun, self.known) = (cycle, self.first);
        (self.counting, self.beaten) = (false, false);
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

    /// How many entries it has.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Its entry of a number.
    pub fn entry(&self, number: usize) -> Option<Entry> {
        self.entries.get(number).map(Kept::entry)
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
        while let Some(entry) = self.entries.get(*next).map(Kept::entry)
            && entry.after <= after
        {
            if entry.word == BEAT {
                self.counting = entry.value.is_none();
            }
            if let Some(value) = entry.value {
                self.known.words[usize::from(entry.word)] = value;
            }
            *next += 1;
        }
        if self.counting {
            let beat = &mut self.known.words[usize::from(BEAT)];
            *beat = beat.wrapping_add(1);
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
            let mut value = Some(new);
            let mut is_news = old != new;
            if word == BEAT {
                let beats = new == old.wrapping_add(1);
                let (counts, counted) = (beats && self.beaten, self.counting);
                (self.counting, self.beaten) = (counts, beats);
                is_news = counts != counted || is_news && !counts;
                if counts {
                    value = None;
                }
            }
            let entry = Entry { after, word, value };
            if is_news && self.entries.push(Kept::of(entry)).is_err() {
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

#[cfg(test)]
mod tests {
    use super::*;
    use model_core::image::Feedback;
    use model_core::machine::Machine;
    use proptest::prelude::*;

    fn image(commands: Commands) -> Image {
        Image {
            commands,
            feedback: Feedback::default(),
        }
    }

    proptest! {
        /// Whatever was commanded is commanded again, cycle by cycle.
        #[test]
        fn a_replay_commands_what_was_recorded(
            writes in prop::collection::vec((0..4_u16, prop_oneof![Just(None), (0..3_u16).prop_map(Some)]), 0..200)
        ) {
            let first = Commands::of(&Machine::news_8000());
            let (mut recorder, mut commands) = (Recorder::new(first), first);
            recorder.begin(7, Beginning::Snapshot, first);
            let mut run = std::vec::Vec::new();
            for (cycle, (word, value)) in (7..).zip(&writes) {
                let word = &mut commands.words[usize::from(*word)];
                *word = value.unwrap_or(word.wrapping_add(1));
                prop_assert_eq!(recorder.after(cycle, &image(commands)), None);
                run.push(commands);
            }
            recorder.play(1000);
            for (cycle, expected) in (1000..).zip(&run) {
                let mut played = Commands::default();
                recorder.before(cycle, &mut played);
                prop_assert_eq!(played, *expected);
                let last = cycle + 1 == 1000 + run.len() as u32;
                let replayed = recorder.after(cycle, &image(played));
                prop_assert_eq!(replayed, last.then_some(Replayed::Same));
            }
        }
    }

    #[test]
    fn a_heartbeat_of_every_cycle_takes_three_entries() {
        let mut commands = Commands::default();
        let mut recorder = Recorder::new(commands);
        for cycle in 0..100_000 {
            commands.set_word(&image::HEARTBEAT_PLC, cycle as u16);
            recorder.after(cycle, &image(commands));
        }
        assert!(recorder.entry(1).is_some() && recorder.entry(3).is_none());
        assert!(!recorder.is_full());
    }
}
