//! The last events: what the winder did and what people did to it.
//!
//! Not here: what happened long ago; the oldest event goes for the newest.

use core::fmt::{self, Write as _};

use heapless::{Deque, String};
use model_core::image::{self, Image, Kind, Signal};

/// How many are kept.
const EVENTS: usize = 128;

/// An event.
#[derive(Clone, Debug)]
pub struct Event {
    /// Counts from 1.
    pub number: u32,
    /// The drive cycle.
    pub cycle: u32,
    /// What kind of thing.
    pub kind: &'static str,
    /// What it was.
    pub text: String<96>,
}

/// The events.
#[derive(Debug)]
pub struct Events {
    ring: Deque<Event, EVENTS>,
    last: u32,
    seen: [u16; CODES.len()],
}

/// Codes whose changes are events.
const CODES: [(&Signal, &str); 4] = [
    (&image::MODE, "mode"),
    (&image::FAULT, "fault"),
    (&image::REFUSAL, "refusal"),
    (&image::AUTOTUNE_STEP, "autotune"),
];

impl Events {
    /// Nothing has happened yet.
    pub const fn new() -> Self {
        Self {
            ring: Deque::new(),
            last: 0,
            seen: [0; _],
        }
    }

    /// Something has happened.
    pub fn add(&mut self, cycle: u32, kind: &'static str, text: fmt::Arguments) {
        self.last = self.last.wrapping_add(1);
        let mut event = Event {
            number: self.last,
            cycle,
            kind,
            text: String::new(),
        };
        // A text that is too long ends early.
        let _ = event.text.write_fmt(text);
        if self.ring.is_full() {
            self.ring.pop_front();
        }
        // There is room now.
        let _ = self.ring.push_back(event);
    }

    /// Looks at the image after a drive cycle.
    pub fn look(&mut self, cycle: u32, image: &Image) {
        for (i, (signal, kind)) in CODES.into_iter().enumerate() {
            let word = image.feedback.word(signal);
            if word != self.seen[i] {
                self.seen[i] = word;
                let text = match signal.kind {
                    Kind::Code(texts) => texts.get(usize::from(word)).copied(),
                    _ => None,
                };
                self.add(cycle, kind, format_args!("{}", text.unwrap_or("unknown")));
            }
        }
    }

    /// The first event after this number.
    pub fn after(&self, number: u32) -> Option<&Event> {
        self.ring.iter().find(|event| event.number > number)
    }
}
