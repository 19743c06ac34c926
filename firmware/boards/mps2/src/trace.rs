//! Marks for QEMU's tracing plugin: which task runs, when it began, which handler interrupts.
//!
//! Does not measure anything and keeps nothing: without the plugin a mark is a call that returns, and the firmware is
//! the same whether it is watched or not.
//!
//! The plugin finds the marks by their unmangled names, and sees which addresses they read: that of the task, executor
//! or handler, and the stack pointer. A time is an address as well, in the lowest 4 MB, where there is memory whatever
//! the time. Nothing comes of what is read.

// Embassy calls its hooks by their unmangled names; the marks are assembler.
#![allow(unsafe_code)]

use core::arch::asm;

use firmware::tasks::Stopwatch;

use crate::stopwatch;

/// Times are told modulo this: 168 ms at 25 MHz, far more than any period.
const TIMES: u32 = 1 << 22;

macro_rules! marks {
    ($($(#[$doc:meta])* $name:ident($address:ident $(, $other:ident)?);)*) => {
        $(
            $(#[$doc])*
            #[unsafe(no_mangle)]
            #[inline(never)]
            fn $name($($other: u32,)? $address: u32) {
                $(let _ = $other;)?
                // SAFETY: reads a byte of what the address names, and one of the stack, and forgets both.
                unsafe {
                    asm!(
                        // equal functions would become one
                        concat!("@ ", stringify!($name)),
                        "ldrb {0}, [{0}]",
                        "ldrb {0}, [sp]",
                        inout(reg) $address => _,
                        options(nostack, readonly, preserves_flags)
                    );
                }
            }
        )*
    };
}

marks! {
    /// A task is polled.
    _embassy_trace_task_exec_begin(task, _executor);
    /// It has been.
    _embassy_trace_task_exec_end(task, _executor);
    /// A task is woken.
    _embassy_trace_task_ready_begin(task, _executor);
    /// An executor begins to look for tasks.
    _embassy_trace_poll_start(executor);
    /// It has found no more.
    _embassy_trace_executor_idle(executor);
    /// A handler of an interrupt begins.
    trace_handler_begin(handler);
    /// It ends.
    trace_handler_end(handler);
    /// A task reads the stopwatch.
    trace_time(time);
}

#[unsafe(no_mangle)]
fn _embassy_trace_task_new(_executor: u32, _task: u32) {}

#[unsafe(no_mangle)]
fn _embassy_trace_task_end(_executor: u32, _task: u32) {}

/// The handler of an interrupt, between its marks.
pub fn handler(handler: extern "C" fn(), body: impl FnOnce()) {
    let address = handler as usize as u32;
    trace_handler_begin(address);
    body();
    trace_handler_end(address);
}

/// The stopwatch, whose readings the plugin sees.
pub struct Traced;

impl Stopwatch for Traced {
    const PER_US: u32 = stopwatch::PER_US;

    fn count() -> u32 {
        let count = stopwatch::count();
        trace_time(count % TIMES);
        count
    }
}
