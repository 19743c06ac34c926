//! What the program needs of core and host: vector table, command line, an end whatever happens.
//!
//! Does not handle any interrupt: none is enabled.

// The vector table is placed by section, semihosting hands memory to the host, and fault handlers are unsafe to define.
#![allow(unsafe_code)]

use core::panic::PanicInfo;

use cortex_m_rt::{ExceptionFrame, exception};
use cortex_m_semihosting::debug::{self, ExitStatus};
use cortex_m_semihosting::hprintln;

type Vector = unsafe extern "C" fn();

unsafe extern "C" {
    fn DefaultHandler();
}

/// The interrupt part of the vector table, by the name that cortex-m-rt expects.
#[unsafe(link_section = ".vector_table.interrupts")]
#[unsafe(no_mangle)]
static __INTERRUPTS: [Vector; 32] = [DefaultHandler; 32];

/// What QEMU was given to run; empty when it does not fit.
pub fn command_line(buffer: &mut [u8]) -> &str {
    /// SYS_GET_CMDLINE (Arm, Semihosting for AArch32 and AArch64).
    const GET_COMMAND_LINE: usize = 0x15;
    let mut block = [buffer.as_mut_ptr() as usize, buffer.len()];
    // SAFETY: the host writes at most the buffer, and into the block how much.
    let failed =
        unsafe { cortex_m_semihosting::syscall1(GET_COMMAND_LINE, block.as_mut_ptr() as usize) };
    // SAFETY: the block is ours again.
    let length = unsafe { block.as_ptr().add(1).read_volatile() };
    let text = if failed == 0 {
        buffer.get(..length)
    } else {
        None
    };
    text.and_then(|text| core::str::from_utf8(text).ok())
        .unwrap_or_default()
}

/// Ends QEMU.
pub fn end(status: ExitStatus) -> ! {
    debug::exit(status);
    // without semihosting there is nobody to tell
    loop {
        cortex_m::asm::wfi();
    }
}

#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    hprintln!("{}", info);
    end(debug::EXIT_FAILURE)
}

// SAFETY: never returns to the code that failed.
#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    hprintln!("hard fault at {:#010x}", frame.pc());
    end(debug::EXIT_FAILURE)
}

// SAFETY: as above.
#[exception]
unsafe fn DefaultHandler(number: i16) -> ! {
    hprintln!("unexpected interrupt {}", number);
    end(debug::EXIT_FAILURE)
}
