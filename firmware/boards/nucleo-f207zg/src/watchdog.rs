//! The watchdog: a firmware in which a task hangs starts anew; the chip tells that it was the watchdog, not who hung.
//!
//! Source: RM0033 rev. 9, sections 18 (IWDG) and 5.3.21 (RCC_CSR).

use embassy_stm32::Peri;
use embassy_stm32::pac;
use embassy_stm32::peripherals::IWDG;
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

/// How this start has come about; called once.
pub fn started() -> Started {
    let flags = pac::RCC.csr().read();
    pac::RCC.csr().modify(|w| w.set_rmvf(true));
    // The pin's flag is set by every reset of the chip, so it says something only alone.
    let why = if flags.porrstf() || flags.borrstf() {
        Restart::PowerOn
    } else if flags.wdgrstf() || flags.sftrstf() {
        Restart::GaveUp
    } else {
        Restart::Outside
    };
    Started {
        why,
        times: why.is_by_itself().into(),
    }
}

/// Feeds, while every task has been seen lately.
#[embassy_executor::task]
pub async fn run(device: Peri<'static, IWDG>) -> ! {
    let timeout_us = u32::try_from(TIMEOUT.as_micros()).unwrap_or(u32::MAX);
    let mut watchdog = IndependentWatchdog::new(device, timeout_us);
    watchdog.unleash();
    loop {
        if LIFE.all(Instant::now()) {
            watchdog.pet();
        }
        Timer::after(EVERY).await;
    }
}
