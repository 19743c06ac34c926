//! The log: defmt frames (rzcobs) on UART0.
//!
//! Does not model the baud rate (QEMU takes bytes at once), and does not take log lines of a task
//! that preempts one which is logging: these are lost.
//!
//! The usual logger holds a critical section from the first byte of a frame to the last, and would
//! make the plant wait for a serial port. Here the rule is that only the background logs. Whoever
//! breaks it neither waits nor garbles: tasks preempt each other strictly nested, so a depth tells
//! whose turn it is, and only depth one writes. The firmware's last words are let through at any
//! depth, see [`reclaim`].

// defmt's logger is an unsafe trait, and the encoder is guarded by the depth, not by a type.
#![allow(unsafe_code)]

use core::cell::UnsafeCell;
use core::sync::atomic::{AtomicU32, Ordering};

use embassy_time::Instant;

use crate::register::Register;

// SAFETY (all): registers of UART0 (Arm AN500; CMSDK UART, Arm DDI 0479), which access no memory.
const DATA: Register = unsafe { Register::at(0x4000_4000) };
const STATE: Register = unsafe { Register::at(0x4000_4004) };
const CTRL: Register = unsafe { Register::at(0x4000_4008) };
const BAUDDIV: Register = unsafe { Register::at(0x4000_4010) };

const STATE_TX_FULL: u32 = 1 << 0;
const CTRL_TX_ENABLE: u32 = 1 << 0;
/// The smallest that the UART accepts.
const BAUDDIV_MIN: u32 = 16;

#[defmt::global_logger]
struct Logger;

/// How many frames are begun and not ended; the first one owns the encoder.
static DEPTH: AtomicU32 = AtomicU32::new(0);

struct Encoder(UnsafeCell<defmt::Encoder>);
// SAFETY: only the owner of depth one touches it, and nobody reaches depth one twice.
unsafe impl Sync for Encoder {}
static ENCODER: Encoder = Encoder(UnsafeCell::new(defmt::Encoder::new()));

defmt::timestamp!("{=u64:us}", Instant::now().as_micros());

/// Switches the UART on.
pub fn start() {
    BAUDDIV.write(BAUDDIV_MIN);
    CTRL.write(CTRL_TX_ENABLE);
}

/// Takes the log away from whoever is in the middle of a frame, for the last words: the other will
/// never run again.
pub fn reclaim() {
    // A zero ends the broken frame; the decoder drops it.
    send(&[0]);
    DEPTH.store(0, Ordering::Relaxed);
}

fn send(bytes: &[u8]) {
    for &byte in bytes {
        while STATE.read() & STATE_TX_FULL != 0 {}
        DATA.write(byte.into());
    }
}

// SAFETY: a frame is written by one context from acquire to release: what preempts it finds the
// depth above one and writes nothing.
unsafe impl defmt::Logger for Logger {
    fn acquire() {
        if DEPTH.fetch_add(1, Ordering::Acquire) == 0 {
            // SAFETY: depth one is reached, the encoder is ours.
            unsafe { &mut *ENCODER.0.get() }.start_frame(send);
        }
    }

    unsafe fn flush() {}

    unsafe fn release() {
        if DEPTH.load(Ordering::Relaxed) == 1 {
            // SAFETY: as in `acquire`; the depth is left after the frame's end.
            unsafe { &mut *ENCODER.0.get() }.end_frame(send);
        }
        DEPTH.fetch_sub(1, Ordering::Release);
    }

    unsafe fn write(bytes: &[u8]) {
        if DEPTH.load(Ordering::Relaxed) == 1 {
            // SAFETY: as in `acquire`.
            unsafe { &mut *ENCODER.0.get() }.write(bytes, send);
        }
    }
}
