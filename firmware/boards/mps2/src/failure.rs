//! The end: what the firmware does when it cannot go on.
//!
//! Does not try to go on. It says why in the log and stops QEMU with exit code 1. On a QEMU
//! without `-semihosting` it stands still after a panic, and a fault ends QEMU as a lockup.

// Fault handlers are unsafe to define.
#![allow(unsafe_code)]

use core::panic::PanicInfo;
use core::sync::atomic::{AtomicBool, Ordering};

use cortex_m::peripheral::{MPU, SCB};
use cortex_m_rt::{ExceptionFrame, exception};
use cortex_m_semihosting::debug;

use crate::uart_log;

static STOPPING: AtomicBool = AtomicBool::new(false);

#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    stop(|| defmt::error!("{}", defmt::Display2Format(info)))
}

/// Makes the memory below the stack inaccessible, so that overflowing it is a fault. Where nothing
/// is, QEMU's board would swallow the writes.
pub fn guard_stack(mpu: &mut MPU) {
    // Armv7-M architecture reference manual, B3.5: protected memory system.
    const REGION_VALID: u32 = 1 << 4;
    const NO_ACCESS: u32 = 1 << 28;
    const REGION_ENABLE: u32 = 1 << 0;
    const GUARD_LOG2_BYTES: u32 = 20;
    const DEFAULT_MAP_AND_ENABLE: u32 = 1 << 2 | 1 << 0;

    let guard = stack_end() - (1 << GUARD_LOG2_BYTES);
    // SAFETY: takes away no memory that the firmware has; all other memory stays as it is.
    unsafe {
        mpu.rbar.write(guard | REGION_VALID);
        mpu.rasr
            .write(NO_ACCESS | (GUARD_LOG2_BYTES - 1) << 1 | REGION_ENABLE);
        mpu.ctrl.write(DEFAULT_MAP_AND_ENABLE);
    }
    cortex_m::asm::dsb();
    cortex_m::asm::isb();
}

/// The lowest address of the stack.
fn stack_end() -> u32 {
    unsafe extern "C" {
        /// A symbol of the linker script; only its address means something.
        static _stack_end: u32;
    }
    (&raw const _stack_end) as u32
}

/// Begins a new stack, since the old one may be what is wrong; nobody returns to it.
#[unsafe(no_mangle)]
#[unsafe(naked)]
extern "C" fn HardFault() -> ! {
    core::arch::naked_asm!(
        "mov r0, sp",
        "movw r1, #:lower16:_stack_start",
        "movt r1, #:upper16:_stack_start",
        "mov sp, r1",
        "b {}",
        sym hard_fault
    )
}

extern "C" fn hard_fault(sp: u32) -> ! {
    stop(|| {
        if sp < stack_end() {
            defmt::error!("stack overflow");
            return;
        }
        // SAFETY: on entry the core has put the frame there, and the stack is intact.
        let frame = unsafe { &*(sp as *const ExceptionFrame) };
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
