//! What a start leaves for the next, in memory that a start does not clear.
//!
//! Not here: what a chip itself knows of its reset. After power-up the memory is anything, which is seen by its check.

// Such memory lies where no Rust code initializes it.
#![allow(unsafe_code)]

use core::mem::MaybeUninit;

use firmware::life::Started;
use model_core::restart::Restart;

/// The reason's number and how often, in the upper half, and the same inverted in the lower.
#[unsafe(link_section = ".uninit.RECORD")]
static mut RECORD: MaybeUninit<u32> = MaybeUninit::uninit();

/// Most restarts that are counted.
const TIMES_MAX: u16 = 0xff;

/// Leaves this for the next start.
pub fn note(started: Started) {
    let word = u16::from(started.why.number()) << 8 | started.times.min(TIMES_MAX);
    let record = u32::from(word) << 16 | u32::from(!word);
    // SAFETY: nobody else touches it meanwhile: the start before any task runs, or who is about to restart the chip.
    unsafe { (&raw mut RECORD).cast::<u32>().write_volatile(record) };
}

/// What the last start has left; nothing after power-up.
pub fn noted() -> Option<Started> {
    // SAFETY: any bits are a number; as for `note`.
    let record = unsafe { (&raw const RECORD).cast::<u32>().read_volatile() };
    let (word, check) = ((record >> 16) as u16, record as u16);
    let why = Restart::ALL.get(usize::from(word >> 8));
    why.filter(|_| word == !check).map(|why| Started {
        why: *why,
        times: word & TIMES_MAX,
    })
}

/// Leaves that the next start is one for this reason.
pub fn note_restart(why: Restart) {
    let times = noted().unwrap_or_default().times.saturating_add(1);
    note(Started { why, times });
}
