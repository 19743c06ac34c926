//! Which check finds which seeded error: a table that a person can read.
//!
//! Not here: the errors and the checks. Runs share nothing but the program's text, so all cores work.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use anyhow::{Context, Result};
use model_core::machine::Machine;

use super::checks::{Area, CHECKS, Miss};
use super::controller::{REFERENCE, StPlc};
use super::seeds::SEEDS;
use super::world::Lockstep;
use super::{Outcome, accept};

/// A program's run.
pub fn run(program: &str) -> Result<Outcome> {
    let machine = Machine::news_8000();
    let mut world =
        Lockstep::new(&machine, StPlc::new(program)?).context("the machine cannot be simulated")?;
    Ok(accept(&mut world))
}

/// What was found in one program.
#[derive(Clone, Debug)]
pub struct Row {
    /// The error's name; that of the reference program is empty.
    pub name: &'static str,
    /// Where it belongs.
    pub area: Option<Area>,
    /// What each check says: passed, finding or not seen.
    pub marks: String,
    /// Areas with findings.
    pub found: Vec<Area>,
}

/// The reference program, and each error.
pub fn rows() -> Result<Vec<Row>> {
    let next = AtomicUsize::new(0);
    let done: Mutex<Vec<(usize, Result<Row>)>> = Mutex::default();
    let cores = thread::available_parallelism().map_or(1, usize::from);
    thread::scope(|scope| {
        for _ in 0..cores {
            scope.spawn(|| {
                loop {
                    let i = next.fetch_add(1, Ordering::Relaxed);
                    if i > SEEDS.len() {
                        return;
                    }
                    let row = row(i);
                    // a thread that panics ends the run anyway
                    if let Ok(mut done) = done.lock() {
                        done.push((i, row));
                    }
                }
            });
        }
    });
    let mut done = done.into_inner().unwrap_or_default();
    done.sort_by_key(|(i, _)| *i);
    done.into_iter().map(|(_, row)| row).collect()
}

fn row(i: usize) -> Result<Row> {
    let seed = i.checked_sub(1).map(|i| &SEEDS[i]);
    let program = match seed {
        Some(seed) => seed.sow(REFERENCE)?,
        None => REFERENCE.to_owned(),
    };
    let name = seed.map_or("", |seed| seed.name);
    let outcome = run(&program).with_context(|| format!("the program with the error {name}"))?;
    let mark = |verdict: &super::Verdict| match verdict {
        Ok(_) => '.',
        Err(Miss::Failed(..)) => 'x',
        Err(Miss::NotSeen(_)) => '?',
    };
    let mut found: Vec<_> = outcome.findings().map(|(check, ..)| check.area).collect();
    found.dedup();
    Ok(Row {
        name,
        area: seed.map(|seed| seed.area),
        marks: outcome
            .verdicts
            .iter()
            .map(|(_, verdict)| mark(verdict))
            .collect(),
        found,
    })
}

/// The table.
pub fn table(rows: &[Row]) -> String {
    let mut text = String::from(
        "Seeded errors by checks: x finding, . passed, ? not seen. Renewed by `cargo winder accept --matrix --bless`.\n\n",
    );
    for line in 0..3 {
        let ids = CHECKS.iter().filter_map(|check| check.id.chars().nth(line));
        let _ = writeln!(text, "{:44}{}", "", ids.collect::<String>());
    }
    for row in rows {
        let name = if row.name.is_empty() {
            "(none)"
        } else {
            row.name
        };
        let area = row.area.map_or("", Area::name);
        let _ = writeln!(text, "{name:24}{area:20}{}", row.marks);
    }
    text
}

/// Where the table is kept.
pub fn golden() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("golden/accept-matrix.txt")
}
