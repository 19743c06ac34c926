//! A beat for QEMU's pace plugin: every virtual millisecond passes through [`pace_mark_1ms`].
//!
//! Does not keep any time itself. Without the plugin the beat means nothing and costs next to
//! nothing.

// The plugin finds the function by its unmangled name; its body is one instruction of assembler.
#![allow(unsafe_code)]

use embassy_time::{Duration, Ticker};

/// One virtual millisecond has passed.
///
/// One instruction long, so that QEMU's plugin interface, which names the function that an
/// instruction belongs to, names it exactly once a call.
#[unsafe(no_mangle)]
#[unsafe(naked)]
extern "C" fn pace_mark_1ms() {
    core::arch::naked_asm!("bx lr")
}

/// Beats. The ticker makes up for beats that are late, so their number is exact.
#[embassy_executor::task]
pub async fn pace() -> ! {
    let mut ticker = Ticker::every(Duration::from_millis(1));
    loop {
        ticker.next().await;
        pace_mark_1ms();
    }
}
