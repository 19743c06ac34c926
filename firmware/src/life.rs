//! Whether every task lives, and why the firmware has started.
//!
//! Not here: the watchdog; that is a board's. It feeds it only while [`Life::all`] says so, and asks
//! [`Life::hung`] when it is too late.

use core::sync::atomic::{AtomicU32, Ordering};

use embassy_time::{Duration, Instant};
use model_core::restart::Restart;

/// A task that is watched, the most urgent first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Task {
    /// The plant, every 4 ms.
    Plant,
    /// The regulators, every 10 ms.
    Drive,
    /// The logic, every 10 ms.
    Logic,
    /// The network, when a frame comes, or the board asks whether it is there.
    Network,
}

const TASKS: usize = 4;

/// A task that has not been seen for so long hangs: ten periods of the slowest.
pub const PATIENCE: Duration = Duration::from_millis(100);

/// When each task was seen last.
#[derive(Debug)]
pub struct Life {
    /// µs since power-up; they wrap, long after anything that is asked.
    seen: [AtomicU32; TASKS],
}

/// How the firmware has come to run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Started {
    /// Why.
    pub why: Restart,
    /// How often by itself, since power came.
    pub times: u16,
}

impl Default for Life {
    fn default() -> Self {
        Self::new()
    }
}

impl Life {
    /// All have been seen at power-up.
    pub const fn new() -> Self {
        Self {
            seen: [const { AtomicU32::new(0) }; TASKS],
        }
    }

    /// A task runs.
    pub fn see(&self, task: Task, now: Instant) {
        self.seen[task as usize].store(wrapped(now), Ordering::Relaxed);
    }

    /// Every task has been seen lately.
    pub fn all(&self, now: Instant) -> bool {
        self.missing(now) == [false; TASKS]
    }

    /// Who hangs. A task keeps those below it from running, so it is the most urgent one that is missing.
    pub fn hung(&self, now: Instant) -> Option<Restart> {
        match self.missing(now) {
            [true, ..] => Some(Restart::Plant),
            [_, true, ..] => Some(Restart::Drive),
            [_, _, true, true] => Some(Restart::Background),
            [_, _, true, _] => Some(Restart::Logic),
            [_, _, _, true] => Some(Restart::Network),
            [false, false, false, false] => None,
        }
    }

    fn missing(&self, now: Instant) -> [bool; TASKS] {
        self.seen.each_ref().map(|seen| {
            let since = wrapped(now).wrapping_sub(seen.load(Ordering::Relaxed));
            // a task that preempts who asks may have been seen after `now`
            let since = since.cast_signed().max(0).cast_unsigned();
            u64::from(since) > PATIENCE.as_micros()
        })
    }
}

/// µs, of which the lowest 32 bits do.
fn wrapped(now: Instant) -> u32 {
    now.as_micros() as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Task; TASKS] = [Task::Plant, Task::Drive, Task::Logic, Task::Network];

    fn at(ms: u64) -> Instant {
        Instant::from_millis(ms)
    }

    /// All live to a time, then only some do.
    fn hung_with(alive: &[Task]) -> Option<Restart> {
        let life = Life::new();
        for task in ALL {
            life.see(task, at(5000));
        }
        assert!(life.all(at(5100)));
        for task in alive {
            life.see(*task, at(5500));
        }
        assert_eq!(life.all(at(5500)), alive.len() == ALL.len());
        life.hung(at(5500))
    }

    #[test]
    fn who_keeps_the_others_off_is_the_one_that_hangs() {
        use Task::{Drive, Logic, Network, Plant};
        assert_eq!(hung_with(&ALL), None);
        assert_eq!(hung_with(&[]), Some(Restart::Plant));
        assert_eq!(hung_with(&[Plant]), Some(Restart::Drive));
        assert_eq!(hung_with(&[Plant, Drive]), Some(Restart::Background));
        assert_eq!(hung_with(&[Plant, Drive, Network]), Some(Restart::Logic));
        assert_eq!(hung_with(&[Plant, Drive, Logic]), Some(Restart::Network));
    }

    #[test]
    fn the_time_may_wrap_and_be_overtaken() {
        let life = Life::new();
        let wrap = (1 << 32) / 1000;
        for task in ALL {
            life.see(task, at(wrap - 20));
        }
        assert!(life.all(at(wrap + 20)));
        assert!(life.all(at(wrap - 30)), "seen after it was asked");
        assert!(!life.all(at(wrap + 200)));
    }
}
