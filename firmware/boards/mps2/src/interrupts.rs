//! The interrupts that the firmware uses, their priorities, and the vector table.
//!
//! Does not handle any interrupt: the handlers stand with what they serve.
//!
//! # Who may preempt whom
//!
//! The plant preempts the drive, the drive preempts the background, and that is all there is:
//!
//! - An alarm has the priority of the tasks that it wakes, which have to wait for each other
//!   anyway. Both pending, the lower number goes first, so the plant's alarm delays the plant by
//!   its own few instructions, and nothing else does.
//! - The Ethernet and the serial line have the background's priority. All they do is wake their
//!   tasks, which run there: they never disturb a timed task, and never meet a driver half-way.
//!
//! The steps are multiples of 0x10, so that they hold also where the core has four priority bits.

// The vector table is placed by section, and interrupt numbers are a promise to the compiler.
#![allow(unsafe_code)]

use cortex_m::interrupt::InterruptNumber;
use cortex_m::peripheral::NVIC;

/// Interrupts by their number in the NVIC (Arm AN500 and its QEMU model).
#[derive(Clone, Copy)]
#[repr(u16)]
pub enum Interrupt {
    /// UART1 has received.
    Serial = 2,
    /// TIMER0: alarm of the plant.
    AlarmPlant = 8,
    /// TIMER1: alarm of the drive.
    AlarmDrive = 9,
    /// Dual timer: alarm of the background.
    AlarmBackground = 10,
    /// LAN9118.
    Ethernet = 13,
    /// No device's: runs the plant's executor.
    Plant = 28,
    /// No device's: runs the drive's executor.
    Drive = 29,
    /// No device's: runs the background's executor.
    Background = 30,
}

// SAFETY: the discriminants are the numbers of the NVIC, and no two are the same.
unsafe impl InterruptNumber for Interrupt {
    fn number(self) -> u16 {
        self as u16
    }
}

impl Interrupt {
    /// The lower, the more urgent.
    const fn priority(self) -> u8 {
        match self {
            Self::AlarmPlant | Self::Plant => 0x10,
            Self::AlarmDrive | Self::Drive => 0x20,
            Self::AlarmBackground | Self::Serial | Self::Ethernet | Self::Background => 0x30,
        }
    }
}

/// Gives every interrupt its priority; enables none.
pub fn set_priorities(nvic: &mut NVIC) {
    use Interrupt::{
        AlarmBackground, AlarmDrive, AlarmPlant, Background, Drive, Ethernet, Plant, Serial,
    };
    for interrupt in [
        AlarmPlant,
        AlarmDrive,
        AlarmBackground,
        Serial,
        Ethernet,
        Plant,
        Drive,
        Background,
    ] {
        // SAFETY: no critical section of this firmware is based on priorities.
        unsafe { nvic.set_priority(interrupt, interrupt.priority()) };
    }
}

/// Lets an interrupt through that has its priority and whose handler is ready.
pub fn enable(interrupt: Interrupt) {
    // SAFETY: as for `set_priorities`.
    unsafe { NVIC::unmask(interrupt) };
}

type Vector = unsafe extern "C" fn();

unsafe extern "C" {
    fn DefaultHandler();
}

/// The interrupt part of the vector table, by the name that cortex-m-rt expects.
#[unsafe(link_section = ".vector_table.interrupts")]
#[unsafe(no_mangle)]
static __INTERRUPTS: [Vector; 32] = {
    let mut table: [Vector; 32] = [DefaultHandler; 32];
    table[Interrupt::Serial as usize] = crate::serial::on_interrupt;
    table[Interrupt::AlarmPlant as usize] = crate::time_driver::on_alarm_plant;
    table[Interrupt::AlarmDrive as usize] = crate::time_driver::on_alarm_drive;
    table[Interrupt::AlarmBackground as usize] = crate::time_driver::on_alarm_background;
    table[Interrupt::Ethernet as usize] = crate::lan9118::on_interrupt;
    table[Interrupt::Plant as usize] = crate::on_plant;
    table[Interrupt::Drive as usize] = crate::on_drive;
    table[Interrupt::Background as usize] = crate::on_background;
    table
};
