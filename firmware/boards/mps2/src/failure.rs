//! The end: what the firmware does when it cannot go on.
//!
//! Does not try to go on. It says why in the log and stops QEMU with exit code 1; on a QEMU
//! without `-semihosting` it stands still.

// Fault handlers are unsafe to define.
#![allow(unsafe_code)]

use core::panic::PanicInfo;
use core::sync::atomic::{AtomicBool, Ordering};

use cortex_m::peripheral::SCB;
use cortex_m_rt::{ExceptionFrame, exception};
use cortex_m_semihosting::debug;

use crate::uart_log;

static STOPPING: AtomicBool = AtomicBool::new(false);

#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    stop(|| defmt::error!("{}", defmt::Display2Format(info)))
}

// SAFETY: never returns to the code that faulted.
#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    stop(|| {
        // SAFETY: reading the fault status has no side effect.
        let cfsr = unsafe { (*SCB::PTR).cfsr.read() };
        defmt::error!(
            "hard fault at {=u32:#010x}, called from {=u32:#010x}, CFSR {=u32:#010x}",
            frame.pc(),
            frame.lr(),
            cfsr
        );
    })
}

// SAFETY: never returns to the code that was interrupted.
#[exception]
unsafe fn DefaultHandler(number: i16) -> ! {
    stop(|| defmt::error!("unexpected interrupt {=i16}", number))
}

fn stop(say_why: impl FnOnce()) -> ! {
    cortex_m::interrupt::disable();
    // Without semihosting its breakpoint is a fault and leads back here; so may saying why.
    if !STOPPING.swap(true, Ordering::Relaxed) {
        uart_log::reclaim();
        say_why();
        debug::exit(debug::EXIT_FAILURE);
    }
    loop {
        cortex_m::asm::wfi();
    }
}
