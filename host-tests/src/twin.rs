//! The model's twins: the same runs on this PC and on microcontrollers in QEMU, to be equal to the bit.
//!
//! Not here: the runs (they are [`model_core::twin`]'s) and any judgement of them. Nor the simulator as a board has
//! it, with tasks and a network: that is [`crate::qemu`]'s.

use std::fmt;
use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, Result, anyhow, bail, ensure};
use model_core::fixed::Word;
use model_core::machine::MachineError;
use model_core::real;
use model_core::twin::{self, Extent};

use crate::interrupt;
use crate::qemu::escaped;
use crate::setup::{self, TARGET, TARGET_SOFT};

/// A microcontroller's core, on the board that QEMU has it on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Core {
    /// For people.
    pub name: &'static str,
    /// QEMU's board.
    pub board: &'static str,
    /// The Rust target.
    pub target: &'static str,
}

/// The cores: with a floating-point unit, and without.
pub const CORES: [Core; 3] = [
    Core {
        name: "M7",
        board: "mps2-an500",
        target: TARGET,
    },
    Core {
        name: "M4F",
        board: "mps2-an386",
        target: TARGET,
    },
    Core {
        name: "M3",
        board: "mps2-an385",
        target: TARGET_SOFT,
    },
];

type Tell<'a> = &'a mut dyn FnMut(Mark);

/// A scalar that all twins can compute in.
pub struct Scalar {
    /// Its name.
    pub name: &'static str,
    wind: fn(Extent, Tell) -> Result<(), MachineError>,
    operate: fn(Tell) -> Result<(), MachineError>,
}

/// Every scalar; the firmware of the twin has the same list.
pub const SCALARS: &[Scalar] = &[
    scalar::<f32>("f32"),
    scalar::<f64>("f64"),
    scalar::<Word>("fixed"),
];

const fn scalar<R: real::Scalar>(name: &'static str) -> Scalar {
    Scalar {
        name,
        wind: wind::<R>,
        operate: operate::<R>,
    }
}

fn wind<R: real::Scalar>(extent: Extent, tell: Tell) -> Result<(), MachineError> {
    twin::wind::<R>(extent, |phase, record| {
        tell(Mark {
            phase: phase.name().to_owned(),
            steps: record.ticks,
            hash: record.trajectory,
        });
    })
}

fn operate<R: real::Scalar>(tell: Tell) -> Result<(), MachineError> {
    twin::operate::<R>(|record| {
        tell(Mark {
            phase: "plc".to_owned(),
            steps: record.ticks,
            hash: record.trajectory,
        });
    })
}

/// How far a run has come at the end of a phase.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mark {
    /// The phase's name.
    pub phase: String,
    /// Steps since the run's begin.
    pub steps: u32,
    /// Hash over all that each of them has left behind.
    pub hash: u32,
}

impl fmt::Display for Mark {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {} {:08x}", self.phase, self.steps, self.hash)
    }
}

/// Marks as a twin prints them, a line each.
pub fn marks(printed: &str) -> Result<Vec<Mark>> {
    let mark = |line: &str| {
        let words: Vec<_> = line.split(' ').collect();
        let [phase, steps, hash] = words[..] else {
            return None;
        };
        Some(Mark {
            phase: phase.to_owned(),
            steps: steps.parse().ok()?,
            hash: u32::from_str_radix(hash, 16).ok()?,
        })
    };
    let line =
        |line| mark(line).ok_or_else(|| anyhow!("{line:?} is not a phase, steps and a hash"));
    printed.lines().map(line).collect()
}

/// A run by the words that name it, on this PC: what to do, scalar, and which, as the firmware of the twin takes
/// them.
pub fn here(words: &[&str]) -> Result<Vec<Mark>> {
    let [what, scalar, which] = *words else {
        bail!("a run has three words, not {words:?}");
    };
    let scalar = SCALARS
        .iter()
        .find(|s| s.name == scalar)
        .with_context(|| format!("there is no scalar {scalar:?}"))?;
    let mut marks = Vec::new();
    let mut tell = |mark| marks.push(mark);
    match (what, which) {
        ("wind", "short") => (scalar.wind)(Extent::Short, &mut tell)?,
        ("wind", "set") => (scalar.wind)(Extent::Set, &mut tell)?,
        ("operate", "plc") => (scalar.operate)(&mut tell)?,
        _ => bail!("no run is called {words:?}"),
    }
    Ok(marks)
}

/// The model on one core in QEMU.
#[derive(Clone, Debug)]
pub struct Twin {
    qemu: PathBuf,
    firmware: PathBuf,
    core: Core,
}

impl Twin {
    /// Installs and builds what is missing.
    pub fn on(core: Core) -> Result<Self> {
        Ok(Self {
            qemu: setup::qemu()?,
            firmware: setup::twin(core.target, setup::Warnings::Shown)?,
            core,
        })
    }

    /// A run by the words that name it.
    pub fn run(&self, words: &[&str]) -> Result<Vec<Mark>> {
        marks(&self.start(words, |_| ())?)
    }

    /// Instructions that the parts of the simulator take on a preset.
    pub fn count(&self, counter: &Path, scalar: &str, preset: &str) -> Result<Vec<Section>> {
        let core = self.core.name;
        let out = setup::scratch(&format!("count-{core}-{scalar}-{preset}.csv"))?;
        self.start(&["count", scalar, preset], |command| {
            let (counter, out) = (escaped(counter), escaped(&out));
            command.arg("-plugin").arg(format!("{counter},out={out}"));
        })?;
        let table = fs::read_to_string(&out)
            .with_context(|| format!("the counting plugin has left no {}", out.display()))?;
        sections(&table).with_context(|| format!("cannot read {}", out.display()))
    }

    /// Runs QEMU to its end; gives what the firmware printed.
    fn start(&self, words: &[&str], more: impl FnOnce(&mut Command)) -> Result<String> {
        let arguments: String = words.iter().map(|word| format!(",arg={word}")).collect();
        let mut command = Command::new(&self.qemu);
        command
            .args(["-M", self.core.board, "-nic", "none", "-serial", "none"])
            .args(["-display", "none", "-monitor", "none"])
            .args(["-chardev", "stdio,id=out,signal=off"])
            .arg("-semihosting-config")
            .arg(format!("enable=on,target=native,chardev=out{arguments}"))
            .arg("-kernel")
            .arg(&self.firmware)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        more(&mut command);
        let mut child = command.spawn().context("cannot start QEMU")?;
        // what is printed is less than a pipe holds, so that reading may wait for the end
        let status = interrupt::wait(&mut child)?;
        let (mut printed, mut said) = (String::new(), String::new());
        for (text, from) in [
            (
                &mut printed,
                child.stdout.take().map(|o| Box::new(o) as Box<dyn Read>),
            ),
            (
                &mut said,
                child.stderr.take().map(|e| Box::new(e) as Box<dyn Read>),
            ),
        ] {
            if let Some(mut from) = from {
                from.read_to_string(text)
                    .context("cannot read what QEMU says")?;
            }
        }
        ensure!(
            status.success(),
            "the run {words:?} on {} in QEMU failed ({status}): {}{}",
            self.core.name,
            printed.lines().last().unwrap_or_default(),
            said
        );
        Ok(printed)
    }
}

/// Instructions of one part of the simulator, over all its calls.
#[derive(Clone, Debug, PartialEq)]
pub struct Section {
    /// Its name, as the firmware marks it.
    pub name: String,
    /// How often it was called.
    pub times: u64,
    /// The fewest.
    pub min: u64,
    /// The mean.
    pub mean: f64,
    /// The most.
    pub max: u64,
}

/// A row of the counting plugin's table: the section's name; times, min, total, max.
fn row(line: &str) -> Option<(&str, [u64; 4])> {
    let (name, numbers) = line.split_once(',')?;
    let numbers: Result<Vec<_>, _> = numbers.split(',').map(str::parse).collect();
    Some((name, numbers.ok()?.try_into().ok()?))
}

/// The counting plugin's table, less what the marks themselves take.
fn sections(table: &str) -> Result<Vec<Section>> {
    let rows: Option<Vec<_>> = table.lines().skip(1).map(row).collect();
    let rows = rows.context("a line is not a name and four numbers")?;
    let empty = rows.iter().find(|(name, _)| *name == "nothing");
    let (_, [_, marks, ..]) = *empty.context("the empty section is missing")?;
    let counted = rows.iter().filter(|(name, _)| *name != "nothing");
    let section = |&(name, [times, min, total, max]): &(&str, [u64; 4])| Section {
        name: name.to_owned(),
        times,
        min: min.saturating_sub(marks),
        mean: total as f64 / times as f64 - marks as f64,
        max: max.saturating_sub(marks),
    };
    Ok(counted.map(section).collect())
}
