//! The watchdog: a firmware in which a task hangs starts anew, and knows why.
//!
//! Does not save anything of the winder: after a restart it stands, drives off, brakes closed, as at power-up.
//!
//! It is fed in the background, while every task has been seen lately. Not fed it raises the NMI, which nothing masks:
//! that finds out who hangs, leaves it in memory that a start does not clear, and resets. Where even that fails the
//! watchdog resets by itself, as much later again.

// A test's order lies where no Rust code initializes it; an exception handler is unsafe to define.
#![allow(unsafe_code)]

use core::mem::MaybeUninit;

use board_cortex_m::record;
use cortex_m::peripheral::SCB;
use cortex_m_rt::exception;
use embassy_time::{Duration, Instant, Timer};
use firmware::life::{Life, PATIENCE, Started, Task};
use model_core::restart::Restart;

use crate::register::Register;
use crate::{lan9118, uart_log};

/// What the tasks show.
pub static LIFE: Life = Life::new();

/// The watchdog's clock, Hz (Arm AN500, AN385, AN386).
const CLOCK_HZ: u64 = 25_000_000;
/// Not fed for so long, somebody hangs.
const TIMEOUT: Duration = Duration::from_millis(500);
/// Feeding: often enough that a task which is seen late is not taken for one that hangs.
const EVERY: Duration = Duration::from_millis(50);
const _: () = assert!(EVERY.as_ticks() + PATIENCE.as_ticks() < TIMEOUT.as_ticks());

/// The device (CMSDK watchdog, Arm DDI 0479).
mod device {
    #![allow(unsafe_code)] // The addresses are those of the board's manual.
    use super::Register;

    // SAFETY (all): registers of the watchdog, which accesses no memory.
    pub const LOAD: Register = unsafe { Register::at(0x4000_8000) };
    pub const CONTROL: Register = unsafe { Register::at(0x4000_8008) };
    pub const INTCLR: Register = unsafe { Register::at(0x4000_800c) };
    pub const LOCK: Register = unsafe { Register::at(0x4000_8c00) };

    /// What opens LOCK; anything else closes it.
    pub const KEY: u32 = 0x1acc_e551;
    /// Raises the interrupt at the first time-out, resets at the second.
    pub const RESEN_INTEN: u32 = 1 << 1 | 1 << 0;
}

/// How this start has come about. A reset that nobody has announced is one from outside.
pub fn started() -> Started {
    let started = record::noted().unwrap_or_default();
    record::note(Started {
        why: Restart::Outside,
        ..started
    });
    started
}

/// Lets the watchdog run; nobody stops it any more.
pub fn start() {
    device::LOCK.write(device::KEY);
    device::LOAD.write((CLOCK_HZ * TIMEOUT.as_millis() / 1000) as u32);
    device::CONTROL.write(device::RESEN_INTEN);
    device::LOCK.write(0);
}

/// Feeds it, and asks the network whether it is there.
#[embassy_executor::task]
pub async fn feed() -> ! {
    loop {
        Timer::after(EVERY).await;
        if LIFE.all(Instant::now()) {
            device::LOCK.write(device::KEY);
            device::INTCLR.write(1);
            device::LOCK.write(0);
        }
        lan9118::ask();
    }
}

// SAFETY: never returns to the code that was interrupted.
#[exception]
unsafe fn NonMaskableInt() -> ! {
    let now = Instant::now();
    let why = LIFE.hung(now).unwrap_or(Restart::GaveUp);
    record::note_restart(why);
    uart_log::reclaim();
    defmt::error!(
        "{=str}: restarting",
        Restart::TEXTS[usize::from(why.number())]
    );
    SCB::sys_reset()
}

/// What a test orders before power comes: `-device loader` of QEMU writes it. No network leads here.
#[unsafe(no_mangle)]
#[unsafe(link_section = ".uninit.TEST_ORDER")]
static mut TEST_ORDER: MaybeUninit<u32> = MaybeUninit::uninit();

/// An order that a task hang: this, and its number in the lowest byte.
const HANG: u32 = u32::from_be_bytes(*b"han\0");

/// The level that shall hang, of the plant, the drive or the background, once since power came.
pub fn ordered_to_hang(started: Started) -> Option<Task> {
    // SAFETY: any bits are a number; nobody writes it.
    let order = unsafe { (&raw const TEST_ORDER).cast::<u32>().read_volatile() };
    let order = (started.why == Restart::PowerOn).then_some(order)?;
    [Task::Plant, Task::Drive, Task::Logic]
        .into_iter()
        .find(|task| order == HANG | *task as u32)
}

/// Hangs, some time after power-up.
#[embassy_executor::task]
pub async fn hang() -> ! {
    const AFTER: Duration = Duration::from_secs(2);
    Timer::after(AFTER).await;
    loop {
        cortex_m::asm::nop();
    }
}
