//! A QEMU plugin that holds virtual time to real time.
//!
//! Does not make QEMU faster than it is, and does not change what the guest computes or when in
//! virtual time: it only waits.
//!
//! `-icount shift=1,sleep=off` makes virtual time a count of instructions and skips idle time: the
//! guest's timers are exact whatever the host does, but seconds pass in a fraction of one. The
//! guest calls an empty function, `pace_mark_1ms`, once every virtual millisecond; there the plugin
//! sleeps until that millisecond is over on the host's clock too. QEMU runs guest code without its
//! big lock, so meanwhile it serves network and monitor.
//!
//! Arguments: `speed=4` runs four times real time, 1 is the default.
//!
//! A host that stalls is caught up with if it stalls for less than 250 ms; a longer stall
//! (a laptop put to sleep) is not replayed, real time goes on from there.

// QEMU looks the plugin up by unmangled names.
#![allow(unsafe_code)]

use std::ffi::CStr;
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use qemu_plugin::{Block, Plugin};

/// The guest's function of one instruction that it calls once every virtual millisecond.
const MARK: &CStr = c"pace_mark_1ms";
/// Virtual time from mark to mark.
const BEAT: Duration = Duration::from_millis(1);
/// How late on real time the guest may be and still be let catch up.
const FORGIVEN: Duration = Duration::from_millis(250);

/// When the next millisecond is over.
struct Pace {
    beat: Duration,
    due: Mutex<Option<Instant>>,
}

qemu_plugin::plugin!(Pace);

impl Pace {
    /// The end of the beat that passes now, in real time: `due[n] = due[n−1] + beat`, from the
    /// first mark on, and from here anew after a long stall.
    fn next(&self, now: Instant) -> Instant {
        // There is no state between states that a panic could leave behind.
        let mut last = self.due.lock().unwrap_or_else(PoisonError::into_inner);
        let due = match *last {
            Some(last) if now <= last + self.beat + FORGIVEN => last + self.beat,
            _ => now,
        };
        *last = Some(due);
        due
    }
}

impl Plugin for Pace {
    const NAME: &'static str = "qemu-pace";

    fn new(arguments: &[String]) -> Result<Self, String> {
        let mut beat = BEAT;
        for argument in arguments {
            let speed = argument.strip_prefix("speed=").and_then(|s| s.parse().ok());
            match speed {
                Some(speed) if (0.01..=1000.0).contains(&speed) => beat = BEAT.div_f64(speed),
                _ => return Err(format!("`{argument}` is not speed=0.01 to speed=1000")),
            }
        }
        Ok(Self {
            beat,
            due: Mutex::new(None),
        })
    }

    /// Looks for the mark.
    fn translated(&self, block: &Block<'_>) {
        for instruction in block.instructions() {
            if instruction.symbol() == Some(MARK) {
                instruction.call::<Self>(0);
            }
        }
    }

    /// A virtual millisecond is over: waits until it is over in reality.
    fn executed(&self, _: usize) {
        let now = Instant::now();
        thread::sleep(self.next(now).saturating_duration_since(now));
    }
}
