//! A QEMU plugin that counts the instructions of marked sections.
//!
//! Does not know cycles: QEMU has no model of a pipeline, a cache or a bus, so an instruction is an instruction,
//! a division as well as a move. Counts are exact and the same in every run.
//!
//! The guest calls functions of one instruction, which the plugin finds by their unmangled names: `count_begin`,
//! `count_end`, and then `count_as_NAME`, which says what the section was. It says so afterwards, since what a
//! section was may show only in it, and finding out must not count.
//!
//! A section counts what is executed after the mark that begins it and before the one that ends it. The call of
//! the ending mark is among that: a guest that marks nothing as a section of its own gets the number to subtract.
//! Instructions that their condition skips count; so does what interrupts a section.
//!
//! Arguments: `out=FILE`, the table that is written when QEMU ends: `section,times,min,total,max`.

// QEMU looks the plugin up by unmangled names.
#![allow(unsafe_code)]

use std::collections::BTreeMap;
use std::fmt::Write;
use std::fs;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use qemu_plugin::{Block, Plugin};

/// Instructions that have been executed, the block that runs now included.
static EXECUTED: AtomicU64 = AtomicU64::new(0);

/// What a mark does: begins a section, ends it, or names it, by what is added to its place in the list.
const BEGIN: usize = 0;
const END: usize = 1;
const NAMES: usize = 2;
const NAME_PREFIX: &str = "count_as_";

/// The counts of one section.
struct Section {
    name: String,
    times: u64,
    min: u64,
    total: u64,
    max: u64,
}

#[derive(Default)]
struct State {
    sections: Vec<Section>,
    /// Where a section is in the list.
    places: BTreeMap<String, usize>,
    began: Option<u64>,
    ended: Option<u64>,
}

struct Count {
    out: String,
    state: Mutex<State>,
}

qemu_plugin::plugin!(Count);

impl State {
    fn place(&mut self, name: &str) -> usize {
        let sections = &mut self.sections;
        *self.places.entry(name.to_owned()).or_insert_with(|| {
            sections.push(Section {
                name: name.to_owned(),
                times: 0,
                min: u64::MAX,
                total: 0,
                max: 0,
            });
            sections.len() - 1
        })
    }

    fn mark(&mut self, mark: usize, executed: u64) {
        match mark {
            BEGIN => self.began = Some(executed),
            // the mark's own instruction has been counted with its block
            END => self.ended = self.began.take().map(|began| executed - began - 1),
            named => {
                let (Some(count), Some(section)) =
                    (self.ended.take(), self.sections.get_mut(named - NAMES))
                else {
                    return;
                };
                section.times += 1;
                section.min = section.min.min(count);
                section.total += count;
                section.max = section.max.max(count);
            }
        }
    }
}

impl Count {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Plugin for Count {
    const NAME: &'static str = "qemu-count";

    fn new(arguments: &[String]) -> Result<Self, String> {
        match arguments {
            [argument] if argument.strip_prefix("out=").is_some_and(|f| !f.is_empty()) => {
                Ok(Self {
                    out: argument["out=".len()..].to_owned(),
                    state: Mutex::default(),
                })
            }
            _ => Err(format!(
                "needs out=FILE and nothing else, not {arguments:?}"
            )),
        }
    }

    /// Counts every block, and looks for marks: each is a block of its own, for a call leads to it and a return
    /// from it.
    fn translated(&self, block: &Block<'_>) {
        block.count(&EXECUTED, block.len() as u64);
        for instruction in block.instructions() {
            let symbol = instruction.symbol().map(|symbol| symbol.to_string_lossy());
            let mark = match symbol.as_deref() {
                Some("count_begin") => BEGIN,
                Some("count_end") => END,
                Some(symbol) => match symbol.strip_prefix(NAME_PREFIX) {
                    Some(name) => NAMES + self.state().place(name),
                    None => continue,
                },
                None => continue,
            };
            instruction.call::<Self>(mark);
        }
    }

    fn executed(&self, mark: usize) {
        self.state().mark(mark, EXECUTED.load(Ordering::Relaxed));
    }

    fn ended(&self) {
        let mut table = String::from("section,times,min,total,max\n");
        for section in self.state().sections.iter().filter(|s| s.times > 0) {
            let Section {
                name,
                times,
                min,
                total,
                max,
            } = section;
            // a string takes all that is written to it
            let _ = writeln!(table, "{name},{times},{min},{total},{max}");
        }
        if let Err(error) = fs::write(&self.out, table) {
            eprintln!("{}: cannot write {}: {error}", Self::NAME, self.out);
        }
    }
}
