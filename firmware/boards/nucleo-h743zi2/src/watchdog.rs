//! The watchdog: a firmware in which a task hangs starts anew, and knows why.
//!
//! Does not save anything of the winder: after a restart it stands, drives off, brakes closed, as at power-up.
//!
//! At the plant's priority somebody looks whether every task has been seen lately. Who hangs below is noted in memory
//! that a start does not clear, and the chip resets itself. A plant that hangs stops that, too, and the independent
//! watchdog resets the chip. Source: RM0433 rev. 8, sections 45 (IWDG) and 8.7.37 (RCC_RSR).

use core::mem::MaybeUninit;

use cortex_m::peripheral::SCB;
use embassy_stm32::Peri;
use embassy_stm32::pac;
use embassy_stm32::peripherals::IWDG1;
use embassy_stm32::wdg::IndependentWatchdog;
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

/// What a start leaves for the next: its reason's number and how often, both in the upper and, inverted, in the lower
/// half.
#[unsafe(link_section = ".uninit.RECORD")]
static mut RECORD: MaybeUninit<u32> = MaybeUninit::uninit();

fn note(started: Started) {
    let word = u16::from(started.why.number()) << 8 | started.times.min(0xff);
    let record = u32::from(word) << 16 | u32::from(!word);
    // SAFETY: the start before any task runs, or who is about to reset the chip.
    unsafe { (&raw mut RECORD).cast::<u32>().write_volatile(record) };
}

fn noted() -> Option<Started> {
    // SAFETY: any bits are a number; as for `note`.
    let record = unsafe { (&raw const RECORD).cast::<u32>().read_volatile() };
    let (word, check) = ((record >> 16) as u16, record as u16);
    let why = Restart::ALL.get(usize::from(word >> 8));
    why.filter(|_| word == !check).map(|why| Started {
        why: *why,
        times: word & 0xff,
    })
}

/// How this start has come about; called once.
pub fn started() -> Started {
    let flags = pac::RCC.rsr().read();
    pac::RCC.rsr().modify(|w| w.set_rmvf(true));
    let noted = noted().unwrap_or_default();
    // The pin's flag is set by every reset of the chip, so it says something only alone.
    let started = if flags.porrstf() || flags.borrstf() {
        Started::default()
    } else if flags.iwdg1rstf() {
        Started {
            why: Restart::Plant,
            times: noted.times.saturating_add(1),
        }
    } else if flags.sftrstf() {
        noted
    } else {
        Started {
            why: Restart::Outside,
            ..noted
        }
    };
    note(started);
    started
}

/// Starts anew, for this reason.
pub fn restart(why: Restart) -> ! {
    let times = noted().unwrap_or_default().times.saturating_add(1);
    note(Started { why, times });
    SCB::sys_reset()
}

/// Looks and feeds.
#[embassy_executor::task]
pub async fn run(device: Peri<'static, IWDG1>) -> ! {
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
