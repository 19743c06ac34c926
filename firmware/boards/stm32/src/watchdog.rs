//! The watchdog: a firmware in which a task hangs starts anew, and knows why.
//!
//! Does not save anything of the winder: after a restart it stands, drives off, brakes closed, as at power-up.
//!
//! At the plant's priority somebody looks whether every task has been seen lately. Who hangs below is noted in memory
//! that a start does not clear, and the chip resets itself. A plant that hangs stops that, too, and the independent
//! watchdog resets the chip.

use board_cortex_m::record;
use cortex_m::peripheral::SCB;
use embassy_stm32::Peri;
use embassy_stm32::wdg::{IndependentWatchdog, Instance};
use embassy_time::{Duration, Instant, Timer};
use firmware::life::{Life, PATIENCE, Started};
use model_core::restart::Restart;

/// What the tasks show.
pub static LIFE: Life = Life::new();

/// Not fed for so long, it resets the chip.
const TIMEOUT: Duration = Duration::from_millis(500);
/// Feeding: often enough that a task which is seen late is not taken for one that hangs.
const EVERY: Duration = Duration::from_millis(50);
const _: () = assert!(EVERY.as_ticks() + PATIENCE.as_ticks() < TIMEOUT.as_ticks());

/// What the chip knows of its reset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reset {
    /// Power came, or came back.
    Power,
    /// The independent watchdog was not fed.
    Watchdog,
    /// The program asked for it.
    Program,
    /// Anything else: the reset pin, a debugger.
    Other,
}

impl Reset {
    /// From the chip's flags: power came or sagged, the independent watchdog, the program. That of the reset pin is not
    /// asked for: every reset of the chip sets it, so it says something only alone.
    pub fn of(power: bool, watchdog: bool, program: bool) -> Self {
        if power {
            Self::Power
        } else if watchdog {
            Self::Watchdog
        } else if program {
            Self::Program
        } else {
            Self::Other
        }
    }
}

/// How this start has come about; called once.
pub fn started(reset: Reset) -> Started {
    let noted = record::noted().unwrap_or_default();
    let started = match reset {
        Reset::Power => Started::default(),
        Reset::Watchdog => Started {
            why: Restart::Plant,
            times: noted.times.saturating_add(1),
        },
        Reset::Program => noted,
        Reset::Other => Started {
            why: Restart::Outside,
            ..noted
        },
    };
    record::note(started);
    started
}

/// Starts anew, for this reason.
pub fn restart(why: Restart) -> ! {
    record::note_restart(why);
    SCB::sys_reset()
}

/// Looks and feeds: the task of the plant's priority.
pub async fn run<T: Instance>(device: Peri<'static, T>) -> ! {
    let timeout_us = u32::try_from(TIMEOUT.as_micros()).unwrap_or(u32::MAX);
    let mut watchdog = IndependentWatchdog::new(device, timeout_us);
    watchdog.unleash();
    loop {
        watchdog.pet();
        Timer::after(EVERY).await;
        if let Some(why) = LIFE.hung(Instant::now()) {
            defmt::error!(
                "{=str}: restarting",
                Restart::TEXTS[usize::from(why.number())]
            );
            restart(why);
        }
    }
}
