//! How long the firmware's tasks take, and when they begin: measured in QEMU, the same in every run.
//!
//! Not here: cycles. QEMU has no model of a pipeline, a cache or a bus: an instruction is an instruction. With
//! `-icount shift=1` it takes 2 ns of virtual time, and nothing else takes any.
//!
//! The firmware is the one that is wired to a PLC, and runs as it always does: the tracing plugin sees which task runs
//! by calls that are in it anyway. What it has to do comes over its network cable, at exact instants (see [`bench`]).

pub mod bench;
pub mod elf;
pub mod frames;
pub mod golden;
pub mod hang;
pub mod load;
pub mod report;
pub mod sizes;

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::PathBuf;

use anyhow::{Context, Result, ensure};
use model_core::drive::DRIVE_PERIOD_MS;
use model_core::image::Feedback;
use model_core::plant::PLANT_PERIOD_MS;

use crate::setup::{self, Warnings};
use crate::twin::{CORES, Core};
use bench::{Bench, Files, Watch};
use elf::Elf;
use load::Kind;
use report::{Seen, Spread};

/// Counts of the boards' stopwatch in a microsecond.
const COUNTS_PER_US: f64 = 25.0;
/// Virtual time of an instruction under `-icount shift=1`, s.
const SECONDS_PER_INSTRUCTION: f64 = 2e-9;
/// After power-up, before anything is counted, ms.
const WARM_UP: u64 = 100;
/// The core that the shares are told of, instructions a second: one in a cycle at 400 MHz.
const BUDGET: f64 = 400e6;

/// The tasks of the simulator, by the ends of their names, with their periods.
const PLANT: &str = "simulator::plant";
const DRIVE: &str = "simulator::drive";
const LOGIC: &str = "simulator::logic";
const PERIODS: [(&str, u32); 3] = [
    (PLANT, PLANT_PERIOD_MS),
    (DRIVE, DRIVE_PERIOD_MS),
    (LOGIC, DRIVE_PERIOD_MS),
];
/// Where embassy keeps a task.
const POOL: &str = "::POOL";
/// The packages of the board.
const PACKAGES: [&str; 2] = ["board_mps2::", "board_cortex_m::"];

/// What the firmware computes with on a core.
pub fn scalar(core: &Core) -> &'static str {
    if core.target == setup::TARGET {
        "f32"
    } else {
        "fixed"
    }
}

/// The firmware on a core under a load.
#[derive(Clone, Debug, Default)]
pub struct Measured {
    /// What the load did.
    pub done: String,
    /// Virtual time, s.
    pub seconds: f64,
    /// Instructions executed.
    pub executed: u64,
    /// By name.
    pub rows: BTreeMap<String, Seen>,
    /// The longest masked sections, by the functions that they begin in.
    pub masked: Vec<(String, Spread)>,
    /// Writes to mask registers that could not be followed.
    pub unknown_masks: u64,
}

/// What the firmware says of itself after many ticks.
#[derive(Clone, Debug)]
pub struct Endured {
    /// What the load did.
    pub done: String,
    /// Its own counters among it.
    pub feedback: Feedback,
}

/// The firmware for each core.
#[derive(Clone, Debug)]
pub struct Firmware {
    qemu: PathBuf,
    plugin: PathBuf,
}

impl Firmware {
    /// Installs and builds what is missing.
    pub fn prepare(warnings: Warnings) -> Result<Self> {
        Ok(Self {
            qemu: setup::qemu()?,
            plugin: setup::tracer(warnings)?,
        })
    }

    fn files(&self, core: &Core) -> Result<Files> {
        Ok(Files {
            qemu: self.qemu.clone(),
            plugin: self.plugin.clone(),
            firmware: setup::mps2_for(core.target, Warnings::Shown)?,
        })
    }

    /// Runs it for many ticks of the plant under a load, and asks it itself what it has noticed; `tell` hears of the
    /// progress, and what it has noticed until then.
    pub fn endure(
        &self,
        core: &Core,
        kind: &Kind,
        ticks: u64,
        mut tell: impl FnMut(u64, &Feedback),
    ) -> Result<Endured> {
        /// Often enough to notice what goes on, ms.
        const BEAT: u64 = 10;
        const TOLD: u64 = 100_000;
        let files = self.files(core)?;
        let elf = Elf::read(&files.firmware)?;
        let mut load = (kind.load)();
        let asks = || format!("under {} nobody asks the firmware", kind.name);
        let mut bench = Bench::start(&files, core, &elf, Watch::Beats)?;
        let (mut now, end) = (0, ticks * u64::from(PLANT_PERIOD_MS));
        while now < end {
            let received = bench.received()?;
            bench.send(&load.beat(now, received)?)?;
            bench.pass(BEAT)?;
            now += BEAT;
            if now.is_multiple_of(TOLD) {
                let feedback = load.feedback().with_context(asks)?;
                tell(now / u64::from(PLANT_PERIOD_MS), feedback);
            }
        }
        let done = load.done()?;
        let feedback = *load.feedback().with_context(asks)?;
        Ok(Endured { done, feedback })
    }

    /// Measures it on a core under a load.
    pub fn measure(&self, core: &Core, kind: &Kind) -> Result<Measured> {
        let files = self.files(core)?;
        let elf = Elf::read(&files.firmware)?;
        let period = |(task, ms): (&str, u32)| {
            let address = elf.find(&format!("{task}{POOL}"));
            let address = address.with_context(|| format!("the firmware has no task {task}"))?;
            Ok((address, (f64::from(ms) * 1e3 * COUNTS_PER_US) as u64))
        };
        let periods = PERIODS
            .map(period)
            .into_iter()
            .collect::<Result<Vec<_>>>()?;

        let mut load = (kind.load)();
        let mut bench = Bench::start(&files, core, &elf, Watch::Tasks(&periods))?;
        let mut now = 0;
        while now < WARM_UP + kind.milliseconds {
            if now == WARM_UP {
                // the firmware starts its executors with interrupts off: none of that seen means that none is seen
                ensure!(
                    !bench.report()?.masked.is_empty(),
                    "the plugin sees no masked section, not even those of the start"
                );
                bench.zero()?;
            }
            let received = bench.received()?;
            bench.send(&load.beat(now, received)?)?;
            bench.pass(kind.every)?;
            now += kind.every;
        }
        let report = bench.report()?;
        let mut measured = Measured {
            done: load.done()?,
            seconds: 1e-3 * (now - WARM_UP) as f64,
            executed: report.executed,
            unknown_masks: report.unknown_masks,
            ..Measured::default()
        };
        for (who, seen) in &report.seen {
            let row = measured.rows.entry(name(&elf, *who));
            row.and_modify(|row| row.join(seen)).or_insert(*seen);
        }
        measured.masked = report
            .masked
            .iter()
            .map(|(place, spread)| (place_name(&elf, *place), *spread))
            .collect();
        measured
            .masked
            .sort_by(|(a, x), (b, y)| y.max.cmp(&x.max).then(a.cmp(b)));
        ensure!(
            measured.rows.contains_key(PLANT),
            "the plant's task has not run"
        );
        Ok(measured)
    }
}

/// A task by its function, an executor or a handler by its own name.
fn name(elf: &Elf, address: u64) -> String {
    if address == 0 {
        return "before and between".to_owned();
    }
    let Some(name) = elf.name(address) else {
        return format!("{address:#x}");
    };
    let own = PACKAGES.iter().find_map(|p| name.strip_prefix(p));
    let name = own.unwrap_or(name);
    match name.strip_suffix(POOL) {
        Some(task) => task.to_owned(),
        None if name.contains("::") => name.to_owned(),
        None => format!("executor {}", name.to_lowercase()),
    }
}

/// A masked section begins in a function, which has been inlined into others.
fn place_name(elf: &Elf, address: u64) -> String {
    let mut names: Vec<_> = elf
        .functions(address)
        .into_iter()
        // those that mask for others say nothing
        .filter(|name| {
            !["cortex_m::", "critical_section::", "core::"]
                .iter()
                .any(|p| name.contains(p))
        })
        .take(3)
        .collect();
    if names.is_empty() {
        names.extend(elf.name(address).map(str::to_owned));
    }
    names.join(" < ")
}

impl Measured {
    fn seen(&self, task: &str) -> Seen {
        self.rows.get(task).copied().unwrap_or_default()
    }

    /// The longest masked section.
    pub fn longest_masked(&self) -> u64 {
        self.rows
            .values()
            .map(|row| row.masked.max)
            .max()
            .unwrap_or(0)
    }

    /// Overruns of all tasks with a period.
    pub fn overruns(&self) -> u64 {
        PERIODS
            .iter()
            .map(|(task, _)| self.seen(task).overruns)
            .sum()
    }

    /// Instructions of the simulator in a second: plant, regulators, logic.
    pub fn simulator(&self) -> f64 {
        let total: u64 = PERIODS
            .iter()
            .map(|(task, _)| self.seen(task).net.total)
            .sum();
        total as f64 / self.seconds
    }

    /// The table, as Markdown.
    pub fn table(&self) -> String {
        let mut out = String::new();
        let _ = writeln!(
            out,
            "| What | Times | Period, µs | Jitter, µs | Net | Gross | Share | Overruns | Masked | Stack own/all |\n\
             |---|---:|---:|---:|---:|---:|---:|---:|---:|---:|"
        );
        for (name, row) in &self.rows {
            let us = |counts: u64| counts as f64 / COUNTS_PER_US;
            let timed = row.period.times > 0;
            let period = if timed {
                format!("{:.2} … {:.2}", us(row.period.min), us(row.period.max))
            } else {
                NOTHING.to_owned()
            };
            let known = PERIODS.iter().any(|(task, _)| task == name);
            let (jitter, overruns) = if known {
                let jitter = us((row.late - row.early).unsigned_abs());
                (format!("{jitter:.2}"), row.overruns.to_string())
            } else {
                (NOTHING.to_owned(), NOTHING.to_owned())
            };
            let share = 100.0 * row.net.total as f64 / self.seconds / BUDGET;
            let _ = writeln!(
                out,
                "| {name} | {} | {period} | {jitter} | {} | {} | {share:.4} % | {overruns} | {} | {} / {} |",
                row.net.times,
                spread(&row.net),
                spread(&row.gross),
                row.masked.max,
                row.own_stack,
                row.stack
            );
        }
        let _ = writeln!(
            out,
            "\nAll: {} instructions in {} s, {:.3} % of the budget. Simulator: {:.3} %.",
            self.executed,
            self.seconds,
            100.0 * self.executed as f64 / self.seconds / BUDGET,
            100.0 * self.simulator() / BUDGET
        );
        let deepest = self.rows.values().map(|row| row.stack).max().unwrap_or(0);
        let _ = writeln!(out, "Stack: at most {deepest} bytes in use.");
        for (place, spread) in self.masked.iter().take(MASKED_SHOWN) {
            let _ = writeln!(
                out,
                "Masked: at most {}, {} times, in {place}",
                spread.max, spread.times
            );
        }
        if self.unknown_masks > 0 {
            let _ = writeln!(
                out,
                "{} writes to mask registers could not be followed: masked sections may be longer.",
                self.unknown_masks
            );
        }
        out
    }
}

/// An empty cell.
const NOTHING: &str = "–";
/// The longest masked sections that are named.
const MASKED_SHOWN: usize = 3;

fn spread(s: &Spread) -> String {
    if s.times == 0 {
        return NOTHING.to_owned();
    }
    format!("{} {:.1} {}", s.min, s.mean(), s.max)
}

/// What must be reached, whatever the compiler.
#[derive(Clone, Debug, PartialEq)]
pub struct Bar {
    /// What, where.
    pub what: String,
    /// What it is.
    pub value: f64,
    /// What it may be at most.
    pub limit: f64,
}

impl Bar {
    /// It is reached.
    pub fn reached(&self) -> bool {
        self.value <= self.limit
    }
}

/// The plant's period may be off by this, µs.
const PERIOD_LIMIT_US: f64 = 1.0;
/// Instructions with interrupts masked, at most.
const MASKED_LIMIT: f64 = 100.0;
/// Instructions of a 4 ms activation and of a 10 ms activation of the M7, on average.
const PLANT_LIMIT: f64 = 1500.0;
const DRIVE_LIMIT: f64 = 1000.0;
/// Share of the M7's budget that the simulator takes, %.
const SHARE_LIMIT: f64 = 1.0;
/// The M3's instructions against the M7's.
const RATIO_LIMIT: f64 = 8.0;

/// The bars of one measurement.
pub fn bars(core: &Core, kind: &Kind, measured: &Measured) -> Vec<Bar> {
    let at = |what: &str| format!("{what}, {} under {}", core.name, kind.name);
    let plant = measured.seen(PLANT);
    let nominal = 1e3 * f64::from(PLANT_PERIOD_MS);
    let off = |counts: u64| (counts as f64 / COUNTS_PER_US - nominal).abs();
    let mut bars = vec![
        Bar {
            what: at("plant's period off by, µs"),
            value: off(plant.period.min).max(off(plant.period.max)),
            limit: PERIOD_LIMIT_US,
        },
        Bar {
            what: at("longest masked section"),
            value: measured.longest_masked() as f64,
            limit: MASKED_LIMIT,
        },
        Bar {
            what: at("overruns"),
            value: measured.overruns() as f64,
            limit: 0.0,
        },
    ];
    if core == &CORES[0] {
        bars.push(Bar {
            what: at("4 ms activation, mean"),
            value: plant.net.mean(),
            limit: PLANT_LIMIT,
        });
        bars.push(Bar {
            what: at("10 ms activation, mean"),
            value: measured.seen(DRIVE).net.mean(),
            limit: DRIVE_LIMIT,
        });
        bars.push(Bar {
            what: at("share of the simulator, %"),
            value: 100.0 * measured.simulator() / BUDGET,
            limit: SHARE_LIMIT,
        });
    }
    bars
}

/// The M3 in fixed point against the M7 in floating point, under the same load.
pub fn ratio(kind: &Kind, m7: &Measured, m3: &Measured) -> Bar {
    Bar {
        what: format!("M3 in fixed point against M7, times, under {}", kind.name),
        value: m3.simulator() / m7.simulator(),
        limit: RATIO_LIMIT,
    }
}
