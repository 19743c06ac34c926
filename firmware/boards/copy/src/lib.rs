//! How the Cortex-M boards copy memory: `memcpy` in place of the compiler's own.
//!
//! Not here: moving within one place, filling and comparing; those stay the compiler's.
//!
//! The compiler's `memcpy` takes four to five instructions for a word. What the tasks hand to each other is copied
//! every few milliseconds, so this one loads and stores eight words with an instruction each. It needs a core that
//! loads and stores words at any address: Armv7-M does (Armv7-M architecture reference manual, A3.2.1), unless
//! `CCR.UNALIGN_TRP` is set, which no board does. Device memory, where that does not hold, is accessed through
//! registers and never copied.

#![no_std]
// The compiler looks it up by unmangled names, and it is in assembly.
#![allow(unsafe_code)]

use core::arch::naked_asm;

/// Copies `n` bytes and gives `to`, as C and the Arm run-time ABI have it.
///
/// # Safety
///
/// `from` must be readable and `to` writable for `n` bytes, and they must not overlap.
// SAFETY: only C's function has this name, and this is one.
#[unsafe(no_mangle)]
#[unsafe(naked)]
pub unsafe extern "C" fn memcpy(to: *mut u8, from: *const u8, n: usize) -> *mut u8 {
    naked_asm!(
        // the run-time ABI's names for it (Arm run-time ABI, 4.3.4)
        ".global __aeabi_memcpy",
        ".thumb_set __aeabi_memcpy, {memcpy}",
        ".global __aeabi_memcpy4",
        ".thumb_set __aeabi_memcpy4, {memcpy}",
        ".global __aeabi_memcpy8",
        ".thumb_set __aeabi_memcpy8, {memcpy}",
        // r0 stays, for it is what is given back; ip goes on in its place
        "mov    ip, r0",
        "orr    r3, r0, r1",
        "lsls   r3, r3, #30",
        "bne    3f",
        "push   {{r4-r10}}",
        "subs   r2, #32",
        "blo    2f",
        // eight words at a time
        "1:",
        "ldmia  r1!, {{r3-r10}}",
        "subs   r2, #32",
        "stmia  ip!, {{r3-r10}}",
        "bhs    1b",
        // the rest by the bits of its length, which the subtractions have left as they were: 16 is the carry's, 8 the sign's …
        "2:",
        "lsls   r2, r2, #28",
        "itt    cs",
        "ldmcs  r1!, {{r3-r6}}",
        "stmcs  ip!, {{r3-r6}}",
        "itt    mi",
        "ldmmi  r1!, {{r3-r4}}",
        "stmmi  ip!, {{r3-r4}}",
        "pop    {{r4-r10}}",
        "b      5f",
        // unaligned: four words at a time, each by itself
        "3:",
        "subs   r2, #16",
        "blo    4f",
        "6:",
        "ldr    r3, [r1], #4",
        "str    r3, [ip], #4",
        "ldr    r3, [r1], #4",
        "str    r3, [ip], #4",
        "ldr    r3, [r1], #4",
        "str    r3, [ip], #4",
        "ldr    r3, [r1], #4",
        "subs   r2, #16",
        "str    r3, [ip], #4",
        "bhs    6b",
        "4:",
        "lsls   r2, r2, #28",
        "itttt  mi",
        "ldrmi  r3, [r1], #4",
        "strmi  r3, [ip], #4",
        "ldrmi  r3, [r1], #4",
        "strmi  r3, [ip], #4",
        // … then 4 is the carry's, 2 the sign's, and last 1
        "5:",
        "lsls   r2, r2, #2",
        "itt    cs",
        "ldrcs  r3, [r1], #4",
        "strcs  r3, [ip], #4",
        "itt    mi",
        "ldrhmi r3, [r1], #2",
        "strhmi r3, [ip], #2",
        "lsls   r2, r2, #1",
        "itt    mi",
        "ldrbmi r3, [r1]",
        "strbmi r3, [ip]",
        "bx     lr",
        memcpy = sym memcpy,
    )
}
