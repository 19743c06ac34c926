//! A QEMU plugin that holds virtual time to real time.
//!
//! Does not make QEMU faster than it is, and does not change what the guest computes or when in
//! virtual time: it only waits.
//!
//! `-icount shift=1,sleep=off` makes virtual time a count of instructions and skips idle time: the
//! guest's timers are exact whatever the host does, but seconds pass in a fraction of one. The
//! guest calls an empty function, `pace_mark_1ms`, once every virtual millisecond; there the plugin
//! sleeps until that millisecond is over on the host's clock too. QEMU runs guest code without its
//! big lock, so meanwhile it serves network and monitor.
//!
//! Arguments: `speed=4` runs four times real time, 1 is the default.
//!
//! A host that stalls is caught up with if it stalls for less than 250 ms; a longer stall
//! (a laptop put to sleep) is not replayed, real time goes on from there.
//!
//! The interface is QEMU's plugin API, version 1 (`qemu-plugin.h`), declared as far as it is used.

// A C interface, called by C.
#![allow(unsafe_code)]

use std::ffi::{CStr, c_char, c_int, c_uint, c_void};
use std::sync::Mutex;
use std::thread;
use std::time::{Duration, Instant};

/// The guest's function of one instruction that it calls once every virtual millisecond.
const MARK: &CStr = c"pace_mark_1ms";
/// Virtual time from mark to mark.
const BEAT: Duration = Duration::from_millis(1);
/// How late on real time the guest may be and still be let catch up.
const FORGIVEN: Duration = Duration::from_millis(250);

/// The plugin API version this was written against; QEMU reads it before anything else.
#[unsafe(no_mangle)]
#[allow(non_upper_case_globals)] // The name is QEMU's.
pub static qemu_plugin_version: c_int = 1;

/// `QEMU_PLUGIN_CB_NO_REGS`: the callback looks at no register.
const CB_NO_REGS: c_int = 0;

type PluginId = u64;

#[repr(C)]
struct Block {
    _opaque: [u8; 0],
}

#[repr(C)]
struct Instruction {
    _opaque: [u8; 0],
}

unsafe extern "C" {
    fn qemu_plugin_register_vcpu_tb_trans_cb(
        id: PluginId,
        callback: unsafe extern "C" fn(PluginId, *mut Block),
    );
    fn qemu_plugin_tb_n_insns(block: *const Block) -> usize;
    fn qemu_plugin_tb_get_insn(block: *const Block, index: usize) -> *mut Instruction;
    fn qemu_plugin_insn_symbol(instruction: *const Instruction) -> *const c_char;
    fn qemu_plugin_register_vcpu_insn_exec_cb(
        instruction: *mut Instruction,
        callback: unsafe extern "C" fn(c_uint, *mut c_void),
        flags: c_int,
        data: *mut c_void,
    );
}

/// When the next millisecond is over.
struct Pace {
    beat: Duration,
    due: Option<Instant>,
}

static PACE: Mutex<Pace> = Mutex::new(Pace {
    beat: BEAT,
    due: None,
});

impl Pace {
    /// The end of the beat that passes now, in real time: `due[n] = due[n−1] + beat`, from the
    /// first mark on, and from here anew after a long stall.
    fn next(&mut self, now: Instant) -> Instant {
        let due = match self.due {
            Some(last) if now <= last + self.beat + FORGIVEN => last + self.beat,
            _ => now,
        };
        self.due = Some(due);
        due
    }
}

/// QEMU's entry: reads the arguments and asks to see code as it is translated.
///
/// # Safety
/// QEMU calls it, once, with `argc` strings in `argv`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn qemu_plugin_install(
    id: PluginId,
    _info: *const c_void,
    argc: c_int,
    argv: *const *const c_char,
) -> c_int {
    for index in 0..argc as usize {
        // SAFETY: QEMU passes `argc` terminated strings.
        let argument = unsafe { CStr::from_ptr(*argv.add(index)) }.to_string_lossy();
        let speed = argument.strip_prefix("speed=").and_then(|s| s.parse().ok());
        match speed {
            Some(speed) if (0.01..=1000.0).contains(&speed) => lock().beat = BEAT.div_f64(speed),
            _ => {
                eprintln!("qemu-pace: `{argument}` is not speed=0.01 to speed=1000");
                return -1;
            }
        }
    }
    // SAFETY: the callback has the type that QEMU expects and stays loaded.
    unsafe { qemu_plugin_register_vcpu_tb_trans_cb(id, on_translation) };
    0
}

/// Looks for the mark in newly translated code.
unsafe extern "C" fn on_translation(_: PluginId, block: *mut Block) {
    // SAFETY: the block is QEMU's for the time of this call, and the indices are within it.
    unsafe {
        for index in 0..qemu_plugin_tb_n_insns(block) {
            let instruction = qemu_plugin_tb_get_insn(block, index);
            let symbol = qemu_plugin_insn_symbol(instruction);
            if !symbol.is_null() && CStr::from_ptr(symbol) == MARK {
                let nothing = std::ptr::null_mut();
                qemu_plugin_register_vcpu_insn_exec_cb(instruction, on_mark, CB_NO_REGS, nothing);
            }
        }
    }
}

/// A virtual millisecond is over: waits until it is over in reality.
unsafe extern "C" fn on_mark(_cpu: c_uint, _: *mut c_void) {
    let now = Instant::now();
    let due = lock().next(now);
    thread::sleep(due.saturating_duration_since(now));
}

fn lock() -> std::sync::MutexGuard<'static, Pace> {
    // There is no state between states that a panic could leave behind.
    PACE.lock()
        .unwrap_or_else(std::sync::PoisonError::into_inner)
}
