//! The end: what the firmware does when it cannot go on. It says why in the log and starts anew.

// Fault handlers are unsafe to define.
#![allow(unsafe_code)]

use core::panic::PanicInfo;

use cortex_m_rt::{ExceptionFrame, exception};
use model_core::restart::Restart;

use crate::watchdog::restart;

#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    defmt::error!("{}", defmt::Display2Format(info));
    restart(Restart::GaveUp)
}

// SAFETY: never returns to the code that was interrupted.
#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    defmt::error!(
        "hard fault at {=u32:#010x}, called from {=u32:#010x}",
        frame.pc(),
        frame.lr()
    );
    restart(Restart::GaveUp)
}
