//! Memory of which the core must know something: what stays out of the caches, what may not be readable, how deep the
//! stack has been.
//!
//! Not here: which memories those are. Source: Armv7-M architecture reference manual, B3.5 (protected memory system),
//! B3.2.8 and B3.2.15 (configuration and control, configurable fault status).

// Both are the core's own registers.
#![allow(unsafe_code)]

use core::arch::asm;
use core::ops::Range;

use cortex_m::peripheral::{MPU, SCB};
use firmware::hmi::desk::Memory;

// Symbols of the linker's scripts; only their addresses mean something.
unsafe extern "C" {
    static _stack_end: u32;
    static _stack_start: u32;
    static __sdata: u32;
    static __ebss: u32;
}

/// What stands in words of the stack that were never used; no address and no small number.
const UNUSED: u32 = 0x5ac3_96e5;
/// Left free below the stack pointer while painting, bytes: what painting itself may need.
const OWN: u32 = 512;
/// Only one word of so many is looked at, so that looking takes no time that anybody waits for.
const STRIDE: u32 = 32;

/// Fills the unused stack, so that it can be seen later how deep it has been.
///
/// # Safety
/// The main stack is that of the linker's script and in use; no interrupt comes meanwhile.
pub unsafe fn paint_stack() {
    let mut at = (&raw const _stack_end) as u32;
    let end = cortex_m::register::msp::read() - OWN;
    while at < end {
        // SAFETY: between the stack's end and what is in use of it, nothing is anybody's.
        unsafe { (at as *mut u32).write_volatile(UNUSED) };
        at += 4;
    }
}

/// Static variables; the stack, and what has been used of it since it was painted.
pub fn used() -> Option<Memory> {
    let (end, start) = (
        (&raw const _stack_end) as u32,
        (&raw const _stack_start) as u32,
    );
    let mut at = end;
    // SAFETY: reads words of the stack, whatever stands in them.
    while at < start && unsafe { (at as *const u32).read_volatile() } == UNUSED {
        at += STRIDE;
    }
    Some(Memory {
        statics: (&raw const __ebss) as u32 - (&raw const __sdata) as u32,
        stack: start - end,
        stack_used: start - at.min(start),
    })
}

/// Keeps regions out of the caches, and does not execute what is there; of the rest the core has its own idea. Each is of
/// a size that is a power of two, and begins at a multiple of it.
///
/// # Safety
/// None holds anything of the program that is in a cache.
pub unsafe fn keep_uncached(mpu: &MPU, regions: &[Range<u32>]) {
    const REGION_VALID: u32 = 1 << 4;
    const NEVER_EXECUTE: u32 = 1 << 28;
    const FULL_ACCESS: u32 = 0b011 << 24;
    // normal memory, shared, not cached
    const NOT_CACHED: u32 = 0b001 << 19 | 1 << 18;
    const REGION_ENABLE: u32 = 1;
    const DEFAULT_MAP_AND_ENABLE: u32 = 1 << 2 | 1;

    for (number, region) in (0..).zip(regions) {
        let size = region.end.saturating_sub(region.start).ilog2() - 1;
        let attributes = NEVER_EXECUTE | FULL_ACCESS | NOT_CACHED | size << 1;
        // SAFETY: the caller's.
        unsafe {
            mpu.rbar.write(region.start | REGION_VALID | number);
            mpu.rasr.write(attributes | REGION_ENABLE);
        }
    }
    // SAFETY: as above.
    unsafe { mpu.ctrl.write(DEFAULT_MAP_AND_ENABLE) };
    cortex_m::asm::dsb();
    cortex_m::asm::isb();
}

/// Reads words of so many bytes, each of which may answer with a bus fault; such a word is zeros.
///
/// # Safety
/// The addresses are of memory that reading does not change. Nothing else runs while a word is read, for as long as
/// that takes.
pub unsafe fn read_or_zeros<const WORD: usize>(address: u32, bytes: &mut [u8]) {
    let (mut address, mut bytes) = (address as usize, bytes);
    while !bytes.is_empty() {
        let inside = address % WORD;
        // SAFETY: the caller's.
        let word = unsafe { word_or_zeros::<WORD>(address - inside) };
        let length = bytes.len().min(WORD - inside);
        let (now, later) = bytes.split_at_mut(length);
        now.copy_from_slice(&word[inside..inside + length]);
        (address, bytes) = (address + length, later);
    }
}

/// # Safety
/// As of [`read_or_zeros`].
unsafe fn word_or_zeros<const WORD: usize>(address: usize) -> [u8; WORD] {
    /// With FAULTMASK set, data access faults are ignored.
    const BFHFNMIGN: u32 = 1 << 8;
    /// Bits of bus faults; written, they are cleared.
    const BUS_FAULTS: u32 = 0xff00;
    // SAFETY: what is set here is set back before anything else runs; the address is the caller's.
    unsafe {
        let system = &*SCB::PTR;
        asm!("cpsid f");
        system.ccr.modify(|bits| bits | BFHFNMIGN);
        cortex_m::asm::dsb();
        let word = (address as *const [u8; WORD]).read_volatile();
        cortex_m::asm::dsb();
        system.ccr.modify(|bits| bits & !BFHFNMIGN);
        let faults = system.cfsr.read() & BUS_FAULTS;
        system.cfsr.write(faults);
        asm!("cpsie f");
        match faults {
            0 => word,
            _ => [0; WORD],
        }
    }
}
