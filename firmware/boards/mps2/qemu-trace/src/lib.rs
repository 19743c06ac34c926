//! A QEMU plugin that sees what the firmware's tasks do: how often, how long, when, how deep in the stack, and how long
//! they keep interrupts off. It also stops virtual time at whole milliseconds for somebody on the host.
//!
//! Does not know cycles: an instruction is an instruction. Does not change what the guest computes, or when in virtual
//! time. Does not know names: what runs is told by its address.
//!
//! The guest marks, in functions that the plugin finds by their unmangled names, what begins and ends; each of them
//! reads a byte at the address that names it, then one at the stack pointer. `trace_time` reads at the time, modulo
//! 2²² counts. `pace_mark_1ms` is called once every virtual millisecond, the beat.
//!
//! *Gross* is all that is executed between begin and end, *net* is gross without whatever preempted it between marks
//! of its own. What the core executes from an interrupt to the first mark and from the last mark back, some dozen
//! instructions, counts to what was interrupted.
//!
//! Interrupts are off from a `cpsid i` to the `cpsie i` or `msr PRIMASK` that belongs to it; what lies between is a
//! masked section. Sections are taken to be nested, each with an end of its own, as those of `critical-section` are. A
//! write to BASEPRI or FAULTMASK, or one to PRIMASK outside a section, has a value that no plugin sees: such writes are
//! counted, and who sees one must not believe the masked sections.
//!
//! Arguments: `gate=NAME`, an abstract Unix socket that somebody listens at; `stack=LOW:HIGH`, its addresses in hex;
//! any number of `period=ADDRESS:COUNTS` in hex and decimal, for tasks whose starts are compared with a clock;
//! `only=beats` sees nothing and stops at beats, which is quicker.
//!
//! At the gate the plugin says `beat` and obeys a line: `go N` lets N beats pass, `zero` forgets all that was counted,
//! `report` gives the tables, with an empty line at their end.

// QEMU looks the plugin up by unmangled names.
#![allow(unsafe_code)]

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::{self, BufRead, BufReader, Write as _};
use std::os::linux::net::SocketAddrExt;
use std::os::unix::net::{SocketAddr, UnixStream};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use qemu_plugin::{Access, Block, Instruction, Plugin};

/// Instructions that have been executed, the one that runs now included.
static EXECUTED: AtomicU64 = AtomicU64::new(0);

/// What is put into the code: the kind in the lowest bits, above it what goes with it.
mod kind {
    pub const BITS: u32 = 4;
    pub const BEGIN: usize = 0;
    pub const END: usize = 1;
    pub const TIME: usize = 2;
    pub const STORE: usize = 3;
    pub const BEAT: usize = 4;
    pub const MASK: usize = 5;
    pub const UNMASK: usize = 6;
    pub const RESTORE: usize = 7;
    /// The first read of a mark, which tells what it names; the second tells the stack pointer.
    pub const NAME: usize = 8;
    pub const UNKNOWN_MASK: usize = 9;
}

/// The guest's functions that mark.
const MARKS: [(&str, usize); 7] = [
    ("_embassy_trace_task_exec_begin", kind::BEGIN),
    ("_embassy_trace_task_exec_end", kind::END),
    ("_embassy_trace_poll_start", kind::BEGIN),
    ("_embassy_trace_executor_idle", kind::END),
    ("trace_handler_begin", kind::BEGIN),
    ("trace_handler_end", kind::END),
    ("trace_time", kind::TIME),
];

/// The function that is called once every virtual millisecond.
const BEAT: &str = "pace_mark_1ms";

/// Times are told modulo this.
const TIMES: u64 = 1 << 22;

/// `cpsid i`, `cpsie i`, and `msr`, which has the register in its first half-word (Armv7-M architecture reference
/// manual, A7.7).
const CPSID_I: [u8; 2] = [0x72, 0xb6];
const CPSIE_I: [u8; 2] = [0x62, 0xb6];
/// The marks' two reads: the first half-word of `ldrb.w Rt, [sp, #imm]`, and the upper byte of `ldrb Rt, [Rn, #imm]`
/// under its mask.
const LDRB_SP: [u8; 2] = [0x9d, 0xf8];
const LDRB: u8 = 0x78;
const LDRB_MASK: u8 = 0xf8;
/// Special registers that mask, by their number: PRIMASK; BASEPRI, BASEPRI_MAX, FAULTMASK.
const PRIMASK: u8 = 16;
const OTHER_MASKS: [u8; 3] = [17, 18, 19];

/// Fewest, sum and most.
#[derive(Clone, Copy, Default)]
struct Spread {
    times: u64,
    min: u64,
    total: u64,
    max: u64,
}

impl Spread {
    fn add(&mut self, value: u64) {
        self.min = if self.times == 0 {
            value
        } else {
            self.min.min(value)
        };
        self.times += 1;
        self.total += value;
        self.max = self.max.max(value);
    }
}

/// What is known of a task, an executor or a handler.
#[derive(Clone, Copy, Default)]
struct Seen {
    net: Spread,
    gross: Spread,
    /// Masked sections.
    masked: Spread,
    /// Its own stack, and all that was in use while it ran, in bytes.
    own_stack: u64,
    stack: u64,
    /// From one start to the next, in counts.
    period: Spread,
    /// Starts against a clock of its period, in counts: the earliest and the latest.
    early: i64,
    late: i64,
    /// Activations not done when the next was due.
    overruns: u64,
}

/// When a task last started.
#[derive(Clone, Copy, Default)]
struct Clock {
    last: Option<u64>,
    /// Against the clock of its period, since it first started.
    late: i64,
}

/// Something that runs, above what it has preempted.
#[derive(Clone, Copy, Default)]
struct Frame {
    who: u64,
    began: u64,
    /// Executed meanwhile by what has preempted it.
    others: u64,
    /// The stack pointer when it began, and the lowest address written since.
    stack_pointer: u64,
    deepest: u64,
    started: bool,
}

/// A masked section that has begun.
#[derive(Clone, Copy)]
struct Masked {
    place: u64,
    began: u64,
    /// Sections in it that have begun.
    nested: u32,
}

struct State {
    gate: Option<(BufReader<UnixStream>, UnixStream)>,
    /// Beats that pass before the gate is asked again.
    beats: u64,
    stack: (u64, u64),
    periods: BTreeMap<u64, u64>,
    seen: BTreeMap<u64, Seen>,
    clocks: BTreeMap<u64, Clock>,
    /// Masked sections by the place where they begin.
    places: BTreeMap<u64, Spread>,
    unknown_masks: u64,
    frames: Vec<Frame>,
    /// Addresses that marks have named, before they tell the stack pointer: an interrupt may come in between.
    named: Vec<u64>,
    masked: Option<Masked>,
    zero_at: u64,
}

struct Trace {
    only_beats: bool,
    state: Mutex<State>,
}

qemu_plugin::plugin!(Trace);

impl State {
    fn begin(&mut self, who: u64, stack_pointer: u64) {
        self.frames.push(Frame {
            who,
            began: EXECUTED.load(Ordering::Relaxed),
            others: 0,
            stack_pointer,
            deepest: stack_pointer,
            started: false,
        });
    }

    fn end(&mut self) {
        let Some(frame) = self.frames.pop() else {
            return;
        };
        let gross = EXECUTED.load(Ordering::Relaxed) - frame.began;
        let seen = self.seen.entry(frame.who).or_default();
        seen.net.add(gross - frame.others);
        seen.gross.add(gross);
        let own = frame.stack_pointer - frame.deepest;
        seen.own_stack = seen.own_stack.max(own);
        seen.stack = seen.stack.max(self.stack.1 - frame.deepest);
        if let Some(below) = self.frames.last_mut() {
            below.others += gross;
        }
    }

    /// The first reading of an activation is its start, the others are ends.
    fn time(&mut self, count: u64) {
        let Some(frame) = self.frames.last_mut() else {
            return;
        };
        let starts = !frame.started;
        frame.started = true;
        let who = frame.who;
        let clock = self.clocks.entry(who).or_default();
        let seen = self.seen.entry(who).or_default();
        if !starts {
            if let (Some(start), Some(&period)) = (clock.last, self.periods.get(&who)) {
                let took = (count + TIMES - start) % TIMES;
                seen.overruns += u64::from(clock.late + took as i64 >= period as i64);
            }
            return;
        }
        if let Some(last) = clock.last {
            let since = (count + TIMES - last) % TIMES;
            if let Some(&period) = self.periods.get(&who) {
                clock.late += since as i64 - period as i64;
            }
            seen.period.add(since);
            if seen.period.times == 1 {
                (seen.early, seen.late) = (clock.late, clock.late);
            }
            seen.early = seen.early.min(clock.late);
            seen.late = seen.late.max(clock.late);
        }
        clock.last = Some(count);
    }

    fn store(&mut self, address: u64) {
        if (self.stack.0..self.stack.1).contains(&address)
            && let Some(frame) = self.frames.last_mut()
        {
            frame.deepest = frame.deepest.min(address);
        }
    }

    fn mask(&mut self, place: u64) {
        match &mut self.masked {
            Some(masked) => masked.nested += 1,
            None => {
                self.masked = Some(Masked {
                    place,
                    began: EXECUTED.load(Ordering::Relaxed),
                    nested: 0,
                });
            }
        }
    }

    fn restore(&mut self) {
        match &mut self.masked {
            None => self.unknown_masks += 1,
            Some(masked) if masked.nested > 0 => masked.nested -= 1,
            Some(_) => self.unmask(),
        }
    }

    fn unmask(&mut self) {
        let Some(masked) = self.masked.take() else {
            return;
        };
        let length = EXECUTED.load(Ordering::Relaxed) - masked.began;
        let who = self.frames.last().map_or(0, |frame| frame.who);
        self.seen.entry(who).or_default().masked.add(length);
        self.places.entry(masked.place).or_default().add(length);
    }

    fn zero(&mut self) {
        self.seen.clear();
        self.places.clear();
        self.unknown_masks = 0;
        self.zero_at = EXECUTED.load(Ordering::Relaxed);
    }

    fn report(&self) -> String {
        let mut out = String::new();
        // a string takes all that is written to it
        let executed = EXECUTED.load(Ordering::Relaxed) - self.zero_at;
        let _ = writeln!(out, "all {executed} {}", self.unknown_masks);
        let spread = |s: &Spread| format!("{} {} {} {}", s.times, s.min, s.total, s.max);
        for (who, s) in &self.seen {
            let _ = writeln!(
                out,
                "seen {who:x} {} {} {} {} {} {} {} {} {}",
                spread(&s.net),
                spread(&s.gross),
                spread(&s.masked),
                s.own_stack,
                s.stack,
                spread(&s.period),
                s.early,
                s.late,
                s.overruns
            );
        }
        for (place, s) in &self.places {
            let _ = writeln!(out, "masked {place:x} {}", spread(s));
        }
        out.push('\n');
        out
    }

    /// A millisecond has passed.
    fn beat(&mut self) {
        if self.beats > 1 {
            self.beats -= 1;
            return;
        }
        if self.ask().is_err() {
            // nobody is there any more: the guest runs on
            self.gate = None;
            self.beats = u64::MAX;
        }
    }

    fn ask(&mut self) -> io::Result<()> {
        let mut gate = self.gate.take();
        let (from, to) = gate.as_mut().ok_or(io::ErrorKind::NotConnected)?;
        to.write_all(b"beat\n")?;
        loop {
            let mut line = String::new();
            if from.read_line(&mut line)? == 0 {
                return Err(io::ErrorKind::UnexpectedEof.into());
            }
            match line.trim_end() {
                "zero" => self.zero(),
                "report" => to.write_all(self.report().as_bytes())?,
                go => {
                    let beats = go.strip_prefix("go ").and_then(|n| n.parse().ok());
                    self.beats = beats.ok_or(io::ErrorKind::InvalidInput)?;
                    break;
                }
            }
        }
        self.gate = gate;
        Ok(())
    }
}

impl Trace {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn look_for_masks(instruction: &Instruction<'_>, bytes: &[u8]) {
        let place = (instruction.address() as usize) << kind::BITS;
        match *bytes {
            [a, b] if [a, b] == CPSID_I => instruction.call::<Self>(place | kind::MASK),
            [a, b] if [a, b] == CPSIE_I => instruction.call::<Self>(place | kind::UNMASK),
            [n, 0xf3, register, b] if n & 0xf0 == 0x80 && b & 0xf0 == 0x80 => {
                if register == PRIMASK {
                    instruction.call::<Self>(place | kind::RESTORE);
                } else if OTHER_MASKS.contains(&register) {
                    instruction.call::<Self>(place | kind::UNKNOWN_MASK);
                }
            }
            _ => {}
        }
    }
}

fn hex(text: &str) -> Option<u64> {
    u64::from_str_radix(text, 16).ok()
}

impl Plugin for Trace {
    const NAME: &'static str = "qemu-trace";

    fn new(arguments: &[String]) -> Result<Self, String> {
        let (mut gate, mut stack, mut periods) = (None, None, BTreeMap::new());
        let mut only_beats = false;
        for argument in arguments {
            let (name, value) = argument.split_once('=').unwrap_or((argument, ""));
            let pair = value.split_once(':');
            match (name, pair) {
                ("only", _) if value == "beats" => only_beats = true,
                ("gate", _) => gate = Some(value.to_owned()),
                ("stack", Some((low, high))) => stack = hex(low).zip(hex(high)),
                ("period", Some((who, counts))) => {
                    let (who, counts) = hex(who)
                        .zip(counts.parse().ok())
                        .ok_or_else(|| format!("`{argument}` is not an address and a count"))?;
                    periods.insert(who, counts);
                }
                _ => return Err(format!("`{argument}` is none of its arguments")),
            }
        }
        let gate = gate.ok_or("needs gate=NAME")?;
        let connect = || {
            let stream = UnixStream::connect_addr(&SocketAddr::from_abstract_name(&gate)?)?;
            Ok((BufReader::new(stream.try_clone()?), stream))
        };
        let gate = connect().map_err(|error: io::Error| format!("gate {gate}: {error}"))?;
        Ok(Self {
            only_beats,
            state: Mutex::new(State {
                gate: Some(gate),
                beats: 0,
                stack: stack.ok_or("needs stack=LOW:HIGH")?,
                periods,
                seen: BTreeMap::new(),
                clocks: BTreeMap::new(),
                places: BTreeMap::new(),
                unknown_masks: 0,
                frames: Vec::new(),
                named: Vec::new(),
                masked: None,
                zero_at: 0,
            }),
        })
    }

    fn translated(&self, block: &Block<'_>) {
        for instruction in block.instructions() {
            let symbol = instruction.symbol().map(|symbol| symbol.to_string_lossy());
            let symbol = symbol.as_deref().unwrap_or_default();
            if self.only_beats {
                if symbol == BEAT {
                    instruction.call::<Self>(kind::BEAT);
                }
                continue;
            }
            instruction.count(&EXECUTED);
            if let Some((_, mark)) = MARKS.iter().find(|(name, _)| *name == symbol) {
                match *instruction.bytes() {
                    [a, b, ..] if [a, b] == LDRB_SP => {
                        instruction.watch::<Self>(Access::Read, *mark);
                    }
                    [_, b] if b & LDRB_MASK == LDRB => {
                        instruction.watch::<Self>(Access::Read, kind::NAME);
                    }
                    _ => {}
                }
                continue;
            }
            if symbol == BEAT {
                instruction.call::<Self>(kind::BEAT);
                continue;
            }
            instruction.watch::<Self>(Access::Write, kind::STORE);
            Self::look_for_masks(&instruction, instruction.bytes());
        }
    }

    fn executed(&self, value: usize) {
        let mut state = self.state();
        let place = (value >> kind::BITS) as u64;
        match value & ((1 << kind::BITS) - 1) {
            kind::BEAT => state.beat(),
            kind::MASK => state.mask(place),
            kind::UNMASK => state.unmask(),
            kind::RESTORE => state.restore(),
            kind::UNKNOWN_MASK => state.unknown_masks += 1,
            _ => {}
        }
    }

    fn accessed(&self, value: usize, address: u64) {
        let mut state = self.state();
        match value {
            kind::STORE => state.store(address),
            kind::NAME => state.named.push(address),
            mark => {
                let Some(named) = state.named.pop() else {
                    return;
                };
                match mark {
                    kind::BEGIN => state.begin(named, address),
                    kind::END => state.end(),
                    kind::TIME => state.time(named),
                    _ => {}
                }
            }
        }
    }
}
