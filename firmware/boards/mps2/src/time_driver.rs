//! embassy-time's clock and alarms: microseconds since `start`, 64 bits wide.
//!
//! Does not correct for anything: in QEMU all devices count the same virtual time.
//!
//! The FPGAIO's counter makes the microseconds. Every level of priority has a queue and an alarm of its own, whose
//! handler has the priority of the tasks that it wakes. What a level has, only its own interrupts touch, and those do
//! not preempt each other: so nothing is locked, and a long queue of the background's delays nobody but the background.
//!
//! The counter wraps after 2³² µs = 71 min. Every level extends it by itself, and an alarm is always armed in each, at
//! most [`LONGEST_ALARM`] ahead; its handler reads the clock and thus sees every wrap of the counter.

// The levels' own contents are guarded by who runs, not by a type.
#![allow(unsafe_code)]

use core::arch::asm;
use core::cell::{Cell, RefCell};
use core::task::Waker;

use embassy_time_driver::{Driver, TICK_HZ};
use embassy_time_queue_utils::Queue;

use crate::interrupts::{self, Interrupt};
use crate::register::Register;
use crate::trace;

/// Clock of FPGAIO and timers, in Hz (Arm AN500).
const CLOCK_HZ: u32 = 25_000_000;
/// Clock cycles in a tick of embassy-time.
const CYCLES_PER_TICK: u32 = CLOCK_HZ / TICK_HZ as u32;
const _: () = assert!(CYCLES_PER_TICK as u64 * TICK_HZ == CLOCK_HZ as u64);
/// In ticks, 100 s: within the reach of the alarms (2³²/25 µs = 171 s) and far within that of the counter.
const LONGEST_ALARM: u64 = 100 * TICK_HZ;
const _: () = assert!(LONGEST_ALARM * CYCLES_PER_TICK as u64 <= u32::MAX as u64);

/// The devices (Arm AN500; the timers are those of the CMSDK, Arm DDI 0479).
mod device {
    #![allow(unsafe_code)] // The addresses are those of the board's manual.
    use super::Register;

    // SAFETY (all): registers of timers and FPGAIO, which access no memory.
    pub const TIMER0: Alarm = unsafe { Alarm::simple(0x4000_0000) };
    pub const TIMER1: Alarm = unsafe { Alarm::simple(0x4000_1000) };
    pub const DUAL: Alarm = unsafe { Alarm::dual(0x4000_2000) };
    pub const FPGAIO_COUNTER: Register = unsafe { Register::at(0x4002_8018) };
    pub const FPGAIO_PRESCALE: Register = unsafe { Register::at(0x4002_801c) };
    /// Counts down from PRESCALE to 0 in each tick.
    pub const FPGAIO_PSCNTR: Register = unsafe { Register::at(0x4002_8020) };

    /// A one-shot timer, and how it runs once for each time that it is set.
    #[derive(Clone, Copy)]
    pub struct Alarm {
        count: Register,
        ctrl: Register,
        intclear: Register,
        one_shot: u32,
    }

    impl Alarm {
        /// A simple timer: that it does not load anew makes it a one-shot.
        ///
        /// # Safety
        /// A simple timer must be at the address.
        const unsafe fn simple(base: usize) -> Self {
            const ENABLE_WITH_INTERRUPT: u32 = 1 << 3 | 1 << 0;
            // SAFETY: promised by the caller. RELOAD is 0 after reset and stays so.
            unsafe {
                Self {
                    count: Register::at(base + 4),
                    ctrl: Register::at(base),
                    intclear: Register::at(base + 0xc),
                    one_shot: ENABLE_WITH_INTERRUPT,
                }
            }
        }

        /// The first counter of a dual timer.
        ///
        /// # Safety
        /// A dual timer must be at the address.
        const unsafe fn dual(base: usize) -> Self {
            /// Enabled, loading anew, with interrupt, 32 bits wide, one-shot: so it runs once for each load.
            const ONE_SHOT: u32 = 1 << 7 | 1 << 6 | 1 << 5 | 1 << 1 | 1 << 0;
            // SAFETY: promised by the caller.
            unsafe {
                Self {
                    count: Register::at(base),
                    ctrl: Register::at(base + 8),
                    intclear: Register::at(base + 0xc),
                    one_shot: ONE_SHOT,
                }
            }
        }

        /// Sets it for the first time, and lets it run.
        pub fn start(self, cycles: u32) {
            self.set(cycles);
            self.ctrl.write(self.one_shot);
        }

        /// Goes off after so many clock cycles, and not when it was to before.
        pub fn set(self, cycles: u32) {
            self.count.write(cycles);
        }

        /// It has been heard.
        pub fn clear(self) {
            self.intclear.write(1);
        }
    }
}

/// What belongs to a level of priority.
struct Level {
    alarm: device::Alarm,
    /// The time when the counter was read last.
    last: Cell<u64>,
    /// When the alarm goes off.
    armed: Cell<u64>,
    queue: RefCell<Queue>,
}

impl Level {
    const fn new(alarm: device::Alarm) -> Self {
        Self {
            alarm,
            last: Cell::new(0),
            armed: Cell::new(0),
            queue: RefCell::new(Queue::new()),
        }
    }

    /// Extends the counter: since the last reading it has advanced by less than one turn.
    fn now(&self) -> u64 {
        let last = self.last.get();
        let advance = device::FPGAIO_COUNTER.read().wrapping_sub(last as u32);
        let now = last + u64::from(advance);
        self.last.set(now);
        now
    }

    /// Sets the alarm to a time, or so late as it reaches, and gives the clock cycles to it.
    fn arm(&self, at: impl FnOnce(u64) -> u64) -> u32 {
        // Before the clock: if a tick ends in between, the alarm comes early and is set anew, never late.
        let rest_of_tick = device::FPGAIO_PSCNTR.read();
        let now = self.now();
        let at = at(now);
        let ticks = if at > now {
            (at - now).min(LONGEST_ALARM) as u32
        } else {
            1
        };
        self.armed.set(now + u64::from(ticks));
        (ticks - 1) * CYCLES_PER_TICK + rest_of_tick + 1
    }

    /// Wakes what is due, and arms the alarm for the next.
    fn wake_due(&self) -> u32 {
        self.arm(|now| self.queue.borrow_mut().next_expiration(now))
    }

    fn schedule(&self, at: u64, waker: &Waker) {
        let changed = self.queue.borrow_mut().schedule_wake(at, waker);
        // Whatever else waits does so at least until the alarm that is armed.
        if changed && at < self.armed.get() {
            self.alarm.set(self.arm(|_| at));
        }
    }

    /// The alarm has gone off.
    fn serve(&self) {
        // Before arming anew: an alarm that goes off from then on is the new one's.
        self.alarm.clear();
        self.alarm.set(self.wake_due());
    }
}

/// All levels.
struct Clock {
    plant: Level,
    drive: Level,
    background: Level,
}

// SAFETY: a level is touched only by interrupts of its priority, which do not preempt each other, see
// `Clock::level`; the background's also before any of them is enabled.
unsafe impl Sync for Clock {}

embassy_time_driver::time_driver_impl!(static CLOCK: Clock = Clock {
    plant: Level::new(device::TIMER0),
    drive: Level::new(device::TIMER1),
    background: Level::new(device::DUAL),
});

impl Clock {
    /// The level of who runs. A task is polled by its executor's interrupt and nowhere else, and so are its timers.
    fn level(&self) -> &Level {
        /// Exceptions before the first interrupt (Armv7-M architecture reference manual, B1.5).
        const SYSTEM: u32 = 16;
        const PLANT: u32 = SYSTEM + Interrupt::Plant as u32;
        const DRIVE: u32 = SYSTEM + Interrupt::Drive as u32;

        let exception: u32;
        // SAFETY: reads which exception is being handled.
        unsafe {
            asm!("mrs {}, IPSR", out(reg) exception, options(nomem, nostack, preserves_flags))
        };
        match exception {
            PLANT => &self.plant,
            DRIVE => &self.drive,
            _ => &self.background,
        }
    }
}

impl Driver for Clock {
    fn now(&self) -> u64 {
        self.level().now()
    }

    fn schedule_wake(&self, at: u64, waker: &Waker) {
        self.level().schedule(at, waker);
    }
}

/// Starts the clock at zero. Before this it stands, and no alarm goes off.
pub fn start() {
    device::FPGAIO_PRESCALE.write(CYCLES_PER_TICK - 1);
    device::FPGAIO_COUNTER.write(0);
    for level in [&CLOCK.plant, &CLOCK.drive, &CLOCK.background] {
        level.alarm.start(level.wake_due());
    }
    interrupts::enable(Interrupt::AlarmPlant);
    interrupts::enable(Interrupt::AlarmDrive);
    interrupts::enable(Interrupt::AlarmBackground);
}

/// The handler of the plant's alarm.
pub extern "C" fn on_alarm_plant() {
    trace::handler(on_alarm_plant, || CLOCK.plant.serve());
}

/// The handler of the drive's alarm.
pub extern "C" fn on_alarm_drive() {
    trace::handler(on_alarm_drive, || CLOCK.drive.serve());
}

/// The handler of the background's alarm.
pub extern "C" fn on_alarm_background() {
    trace::handler(on_alarm_background, || CLOCK.background.serve());
}
