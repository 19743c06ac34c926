//! Scenarios: timed commands to a simulator, and what is expected of it.
//!
//! Not here: a PLC's program, which decides by itself (that is [`crate::plc`]). A scenario does the same every
//! time.
//!
//! A scenario is a TOML file of steps, one after the other:
//!
//! ```toml
//! title = "Normal stop from 1 200 m/min"
//! start = "to_run"                 # what comes before: a prelude by its name, or another file
//! set = { v_set = 1200 }           # set-points from power-up on
//!
//! [[step]]
//! say = "run back to 0"
//! at = 20                          # s since the start was done
//! set = { "winder_command.run" = false }
//! until = "winder_status.zero_speed and mode = stall"
//! within = 60                      # s, or the scenario has failed
//! expect = [
//!     "not winder_status.fault",
//!     { signal = "tension", of = "tension_ref", min = 0.9, max = 1.1, during = "step" },
//! ]
//! ```
//!
//! Names are those of the signal list (`cargo winder signals`), bits as `word.bit`; a `*` stands for the sections
//! `uw`, `rd`, `fd` and `rr`, so that `"stw1_*.on"` is a bit of all four drives. Values are in the signal's unit, times in s and whole drive cycles
//! of 10 ms.
//!
//! | Top level | |
//! |---|---|
//! | `title`, `about` | for people |
//! | `start` | prelude or file that is played first |
//! | `machine` | preset or machine file, instead of `NEWS-8000` |
//! | `set` | commands from power-up on |
//! | `always` | expectations from the end of the start to the end of the file |
//!
//! | Step | |
//! |---|---|
//! | `say` | for people |
//! | `at` | begins then, counted from the file's own first step; otherwise when the step before ends |
//! | `set` | commands that change together |
//! | `press` | bits that are set for 0.1 s, as by a push-button; the step lasts 0.2 s at least |
//! | `heartbeat` | `false` stops the PLC's heartbeat, which the player counts up otherwise |
//! | `for` | lasts so long |
//! | `until`, `within` | lasts until a condition holds, and fails if that takes longer |
//! | `expect` | expectations |
//! | `include` | plays another file's steps here; stands alone in its step |
//!
//! An expectation is a condition as text, or a table: `signal` with `is`, or with `min` and `max`, which are shares
//! of a second signal where there is an `of`. It is looked at when its step ends, `during = "step"` as long as the
//! step lasts, or `during = [from, to]` in s since the step began, which may reach beyond its end. What a step
//! commands has its effect in the feedback 0.03 s later: there conditions and `during = "step"` begin, and no step
//! that they belong to is shorter.
//!
//! Conditions: `word.bit`, `not word.bit`, or a signal compared (`=`, `!=`, `<`, `<=`, `>`, `>=`) with a number, with a
//! share of another signal (`tension > 1.1 * tension_ref`) or with the beginning of a code's text (`mode = run`,
//! `refusal = 'no web tension'`), joined by `and`.

pub mod live;
pub mod lockstep;
pub mod place;
pub mod player;
mod read;
pub mod record;

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use model_core::drive::DRIVE_PERIOD_MS;

use crate::machine_file::Description;
use place::{Assignment, Condition, Place};

/// Drive cycles in a second.
pub const CYCLES_PER_S: u64 = 1000 / DRIVE_PERIOD_MS as u64;

/// A scenario, with all that it includes.
#[derive(Clone, Debug)]
pub struct Scenario {
    /// The file's name without its ending.
    pub name: String,
    /// What it shows.
    pub title: String,
    /// The machine it is played on.
    pub machine: Description,
    /// Commands from power-up on.
    pub set: Vec<Assignment>,
    /// What happens, in order.
    pub acts: Vec<Act>,
}

/// A place in a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct At {
    /// The file.
    pub file: String,
    /// Its line.
    pub line: usize,
}

impl std::fmt::Display for At {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}:{}", self.file, self.line)
    }
}

/// Something that happens.
#[derive(Clone, Debug)]
pub enum Act {
    /// The steps of a file begin; times of the clock with this number count from here.
    Begin(usize),
    /// A step.
    Step(Step),
    /// From here on something is always expected.
    Always(usize, Expectation),
    /// What was always expected under this number, is no more.
    Release(usize),
}

/// A step.
#[derive(Clone, Debug)]
pub struct Step {
    /// Where it stands.
    pub at: At,
    /// What happens, for people.
    pub say: Option<String>,
    /// When it begins, in drive cycles of a clock.
    pub begins: Option<Time>,
    /// Commands that change.
    pub set: Vec<Assignment>,
    /// Bits that are pressed.
    pub press: Vec<Place>,
    /// The heartbeat goes on or stops.
    pub heartbeat: Option<bool>,
    /// When it ends.
    pub ends: Ends,
    /// What is expected.
    pub expect: Vec<Expectation>,
}

impl Step {
    /// It waits for something, or something is expected as long as it lasts or when it ends.
    pub fn is_judged(&self) -> bool {
        let window = |e: &Expectation| matches!(e.during, During::Window(..));
        matches!(self.ends, Ends::When(..)) || !self.expect.iter().all(window)
    }
}

/// A time of a file's clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Time {
    /// Number of the clock.
    pub clock: usize,
    /// Drive cycles.
    pub cycles: u64,
}

/// When a step ends.
#[derive(Clone, Debug)]
pub enum Ends {
    /// After so many drive cycles.
    After(u64),
    /// When a condition holds, or the scenario has failed after so many drive cycles.
    When(Condition, u64),
}

/// Something that must be so.
#[derive(Clone, Debug)]
pub struct Expectation {
    /// Where it stands.
    pub at: At,
    /// What.
    pub condition: Condition,
    /// When.
    pub during: During,
}

/// When an expectation is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum During {
    /// When its step ends.
    End,
    /// As long as its step lasts.
    Step,
    /// From … to, drive cycles since its step began.
    Window(u64, u64),
}

impl Scenario {
    /// Reads a file and all that it includes; an error gives file, line and reason.
    pub fn open(path: &Path) -> Result<Self> {
        read::open(path)
    }
}

/// Where the scenarios are that ship.
pub fn library() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios")
}

/// Every scenario that ships, by name.
pub fn shipped() -> Result<Vec<PathBuf>> {
    files(&library())
}

/// The scenario files of a directory, by name.
fn files(directory: &Path) -> Result<Vec<PathBuf>> {
    let cannot = || format!("cannot read {}", directory.display());
    let mut files = Vec::new();
    for entry in std::fs::read_dir(directory).with_context(cannot)? {
        let path = entry.with_context(cannot)?.path();
        if path.extension().is_some_and(|ending| ending == "toml") {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
}

/// Drive cycles in s.
pub fn seconds(cycles: u64) -> f64 {
    cycles as f64 / CYCLES_PER_S as f64
}
