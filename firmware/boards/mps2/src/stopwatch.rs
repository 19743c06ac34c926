//! The clock that activations are measured with: 25 MHz, 32 bits wide.
//!
//! Does not count cycles: QEMU's DWT stands at zero. It is the second of the dual timer's counters, counting freely.

use crate::register::Register;

/// Its counts in a microsecond (Arm AN500, AN385, AN386: 25 MHz).
pub const PER_US: u32 = 25;

/// The device (CMSDK dual timer, Arm DDI 0479).
mod device {
    #![allow(unsafe_code)] // The addresses are those of the board's manual.
    use super::Register;

    // SAFETY (all): registers of the dual timer, which accesses no memory.
    pub const LOAD: Register = unsafe { Register::at(0x4000_2020) };
    pub const VALUE: Register = unsafe { Register::at(0x4000_2024) };
    pub const CTRL: Register = unsafe { Register::at(0x4000_2028) };

    /// Enabled, without interrupt, 32 bits wide, wrapping.
    pub const FREE_RUNNING: u32 = 1 << 7 | 1 << 1;
}

/// Starts it.
pub fn start() {
    device::LOAD.write(u32::MAX);
    device::CTRL.write(device::FREE_RUNNING);
}

/// Its count, upwards.
pub fn count() -> u32 {
    // it counts down
    !device::VALUE.read()
}
