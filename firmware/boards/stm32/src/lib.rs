//! What the boards with an STM32 share: Ethernet, serial line, hard-wired signals, lamps, watchdog, and the end.
//!
//! Not here: which chip it is, its clocks, its pins. A board's package says that, once, by the features of
//! `embassy-stm32`, and so this one is built anew for each board.

#![no_std]

pub mod ethernet;
mod failure;
pub mod lamps;
pub mod pulses;
pub mod serial;
pub mod watchdog;
pub mod wires;

use cortex_m::peripheral::{DCB, DWT};
use firmware::tasks::Stopwatch;

/// The core's own count of its cycles, of which there are so many in a microsecond.
pub struct Cycles<const PER_US: u32>;

impl<const PER_US: u32> Stopwatch for Cycles<PER_US> {
    const PER_US: u32 = PER_US;

    fn count() -> u32 {
        DWT::cycle_count()
    }
}

/// Starts the count of [`Cycles`].
pub fn count_cycles(debug: &mut DCB, trace: &mut DWT) {
    debug.enable_trace();
    trace.enable_cycle_counter();
}
