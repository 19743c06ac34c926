//! The end: what the firmware does when it cannot go on, and what the next start knows of it.

use core::panic::PanicInfo;

use cortex_m::peripheral::SCB;
use cortex_m_rt::{ExceptionFrame, exception};
use embassy_stm32::pac;

/// Why the chip has started, from its own flags; they are cleared by looking.
///
/// Source: RM0433 rev. 8, section 8.7.37 (RCC_RSR).
pub fn reset_reason() -> &'static str {
    let flags = pac::RCC.rsr().read();
    pac::RCC.rsr().modify(|w| w.set_rmvf(true));
    // The pin is pulled by every reset of the chip, so it says something only alone.
    if flags.iwdg1rstf() {
        "the watchdog has reset it"
    } else if flags.sftrstf() {
        "it has reset itself"
    } else if flags.porrstf() {
        "power has come"
    } else if flags.borrstf() {
        "power has failed"
    } else if flags.pinrstf() {
        "the reset button"
    } else {
        "reset for another reason"
    }
}

#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    defmt::error!("{}", defmt::Display2Format(info));
    SCB::sys_reset()
}

// SAFETY: never returns to the code that was interrupted.
#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    defmt::error!(
        "hard fault at {=u32:#010x}, called from {=u32:#010x}",
        frame.pc(),
        frame.lr()
    );
    SCB::sys_reset()
}
