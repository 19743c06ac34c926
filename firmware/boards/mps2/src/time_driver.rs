//! embassy-time's clock and alarm: microseconds since `start`, 64 bits wide.
//!
//! Does not correct for anything: in QEMU both devices count the same virtual time.
//!
//! The FPGAIO's counter makes the microseconds, TIMER0 the alarm. Neither is wide enough alone:
//! the counter wraps after 2³² µs = 71 min, the alarm reaches 2³²/25 µs = 171 s. So an alarm is
//! armed always, at most [`LONGEST_ALARM`] ahead; its handler reads the clock and thus sees every
//! wrap of the counter.

use core::cell::{Cell, RefCell};
use core::task::Waker;

use critical_section::{CriticalSection, Mutex};
use embassy_time_driver::{Driver, TICK_HZ};
use embassy_time_queue_utils::Queue;

use crate::interrupts::{self, Interrupt};
use crate::register::Register;

/// Clock of FPGAIO and timers, in Hz (Arm AN500).
const CLOCK_HZ: u32 = 25_000_000;
/// Clock cycles in a tick of embassy-time.
const CYCLES_PER_TICK: u32 = CLOCK_HZ / TICK_HZ as u32;
const _: () = assert!(CYCLES_PER_TICK as u64 * TICK_HZ == CLOCK_HZ as u64);
/// In ticks, 100 s: within the reach of the alarm and far within that of the counter.
const LONGEST_ALARM: u64 = 100 * TICK_HZ;
const _: () = assert!(LONGEST_ALARM * CYCLES_PER_TICK as u64 <= u32::MAX as u64);

/// The devices (Arm AN500; the timer is that of the CMSDK, Arm DDI 0479).
mod device {
    #![allow(unsafe_code)] // The addresses are those of the board's manual.
    use super::Register;

    // SAFETY (all): registers of TIMER0 and FPGAIO, which access no memory.
    pub const TIMER_CTRL: Register = unsafe { Register::at(0x4000_0000) };
    pub const TIMER_VALUE: Register = unsafe { Register::at(0x4000_0004) };
    pub const TIMER_RELOAD: Register = unsafe { Register::at(0x4000_0008) };
    pub const TIMER_INTCLEAR: Register = unsafe { Register::at(0x4000_000c) };
    pub const FPGAIO_COUNTER: Register = unsafe { Register::at(0x4002_8018) };
    pub const FPGAIO_PRESCALE: Register = unsafe { Register::at(0x4002_801c) };

    pub const CTRL_ENABLE: u32 = 1 << 0;
    pub const CTRL_INTERRUPT: u32 = 1 << 3;
}

struct Clock {
    /// The time when the counter was read last.
    last: Mutex<Cell<u64>>,
    queue: Mutex<RefCell<Queue>>,
}

embassy_time_driver::time_driver_impl!(static CLOCK: Clock = Clock {
    last: Mutex::new(Cell::new(0)),
    queue: Mutex::new(RefCell::new(Queue::new())),
});

impl Driver for Clock {
    fn now(&self) -> u64 {
        critical_section::with(|cs| self.read(cs))
    }

    fn schedule_wake(&self, at: u64, waker: &Waker) {
        critical_section::with(|cs| {
            if self.queue.borrow_ref_mut(cs).schedule_wake(at, waker) {
                self.serve(cs);
            }
        });
    }
}

impl Clock {
    /// Extends the counter: since the last reading it has advanced by less than one turn.
    ///
    /// Within a critical section, so that no reading that preempts this one is newer than what
    /// this one then stores.
    fn read(&self, cs: CriticalSection) -> u64 {
        let last = self.last.borrow(cs);
        let advance = device::FPGAIO_COUNTER
            .read()
            .wrapping_sub(last.get() as u32);
        last.set(last.get() + u64::from(advance));
        last.get()
    }

    /// Wakes what is due and arms the alarm for the next.
    fn serve(&self, cs: CriticalSection) {
        let now = self.read(cs);
        let next = self.queue.borrow_ref_mut(cs).next_expiration(now);
        // `next` is later than `now`: what was due is out of the queue.
        let wait = (next - now).min(LONGEST_ALARM) as u32;
        device::TIMER_VALUE.write(wait * CYCLES_PER_TICK);
    }
}

/// Starts the clock at zero. Before this it stands, and no alarm goes off.
pub fn start() {
    device::FPGAIO_PRESCALE.write(CYCLES_PER_TICK - 1);
    device::FPGAIO_COUNTER.write(0);
    // Not reloading makes the timer a one-shot. It gets its first value before it is let run.
    device::TIMER_RELOAD.write(0);
    critical_section::with(|cs| CLOCK.serve(cs));
    device::TIMER_CTRL.write(device::CTRL_ENABLE | device::CTRL_INTERRUPT);
    interrupts::enable(Interrupt::Timer0);
}

/// The alarm's interrupt handler.
pub extern "C" fn on_alarm() {
    critical_section::with(|cs| {
        // Before arming anew: an alarm that goes off from then on is the new one's.
        device::TIMER_INTCLEAR.write(1);
        CLOCK.serve(cs);
    });
}
