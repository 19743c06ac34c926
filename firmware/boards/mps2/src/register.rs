//! Access to device registers, without naming any device.
//!
//! Does not know fields or access rights: QEMU's devices are few and small enough for the drivers
//! to say these themselves.

// Device registers are raw addresses by nature.
#![allow(unsafe_code)]

/// A 32-bit device register.
#[derive(Clone, Copy)]
pub struct Register(usize);

impl Register {
    /// The register at an address.
    ///
    /// # Safety
    /// A device register must be there, and no access to it may touch memory that Rust owns.
    pub const unsafe fn at(address: usize) -> Self {
        Self(address)
    }

    /// Reads the register, with whatever that does to the device.
    pub fn read(self) -> u32 {
        // SAFETY: `at` was promised a register here.
        unsafe { (self.0 as *const u32).read_volatile() }
    }

    /// Writes the register.
    pub fn write(self, value: u32) {
        // SAFETY: `at` was promised a register here, whose side effects leave memory alone.
        unsafe { (self.0 as *mut u32).write_volatile(value) }
    }
}
