//! `winder timing`

use std::fmt::Write;
use std::process::ExitCode;

use anyhow::{Result, ensure};
use model_core::image::{
    DRIVE_JITTER_MAX, DRIVE_OVERRUNS, DRIVE_TIME_MAX, LOGIC_OVERRUNS, PLANT_JITTER_MAX,
    PLANT_OVERRUNS, PLANT_TICKS, PLANT_TIME_MAX, Signal, TRAJECTORY,
};

use crate::interrupt::Interrupted;
use crate::setup::{self, Warnings};
use crate::timing::golden::{self, Outcome};
use crate::timing::load::{Kind, LOADS, POLLING};
use crate::timing::{self, Bar, Firmware, Measured};
use crate::twin::{CORES, Core};

/// What to measure.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct Args {
    /// Core: M7, M4F or M3; may be given several times [default: all]
    #[arg(long = "core", value_name = "NAME")]
    cores: Vec<String>,
    /// Load, by a name that the table has, like "polling PLC"; may be given several times [default: all]
    #[arg(long = "load", value_name = "NAME")]
    loads: Vec<String>,
    /// Run so many activations of the plant's task under the polling PLC, and ask the firmware what it has noticed
    #[arg(long, value_name = "N")]
    ticks: Option<u64>,
    /// Keep the table as the one to compare with
    #[arg(long)]
    bless: bool,
}

/// The table that is kept.
const TABLE: &str = "timing.md";

/// Measures, prints, and compares with the table that is kept.
pub fn main(args: &Args) -> Result<ExitCode> {
    let cores = chosen(&args.cores, &CORES, |core| core.name)?;
    let loads = chosen(&args.loads, LOADS, |kind| kind.name)?;
    let whole = args.cores.is_empty() && args.loads.is_empty();
    ensure!(
        whole || !args.bless,
        "only the whole table can be kept: --bless goes without --core and --load"
    );
    let firmware = Firmware::prepare(Warnings::Shown)?;
    if let Some(ticks) = args.ticks {
        return endure(&firmware, &cores, ticks);
    }
    let (table, bars, missing) = measure(&firmware, &cores, &loads)?;
    let table = golden::with_compiler(&setup::compiler()?, &table);
    print!("{table}");
    let missed = judge(&bars);
    for what in &missing {
        println!("\nNot measured: {what}");
    }
    if !missing.is_empty() {
        return Ok(ExitCode::FAILURE);
    }
    let mut as_kept = true;
    if args.bless {
        golden::keep(TABLE, &table)?;
        println!("\nkept as {}", golden::path(TABLE).display());
    } else if whole {
        as_kept = tell(&golden::compare(TABLE, &table)?, "cargo winder timing");
    }
    Ok(if missed || !as_kept {
        ExitCode::FAILURE
    } else {
        ExitCode::SUCCESS
    })
}

/// Fails where a bar is missed, or something could not be measured. A difference from the kept
/// table is shown, but does not fail: on a PC that is busy with other things QEMU may hand over a frame a moment
/// later, and then some polls more or less are counted.
pub fn check() -> Result<()> {
    let firmware = Firmware::prepare(Warnings::Denied)?;
    let every: Vec<_> = LOADS.iter().collect();
    let cores: Vec<_> = CORES.iter().collect();
    let (table, bars, missing) = measure(&firmware, &cores, &every)?;
    let table = golden::with_compiler(&setup::compiler()?, &table);
    tell(&golden::compare(TABLE, &table)?, "cargo winder timing");
    judge(&bars);
    ensure!(missing.is_empty(), "not measured: {}", missing.join("; "));
    let lost: Vec<_> = bars
        .iter()
        .filter(|bar| !bar.reached())
        .map(|bar| bar.what.as_str())
        .collect();
    ensure!(lost.is_empty(), "no longer reached: {}", lost.join("; "));
    Ok(())
}

/// Says how a table compares with the one that is kept; whether that is well.
pub fn tell(outcome: &Outcome, command: &str) -> bool {
    match outcome {
        Outcome::Same => println!("\nas kept"),
        Outcome::OtherCompiler(kept) => println!(
            "\nnot compared: the kept table is of {kept}, and another compiler makes other instructions; only the bars \
             count"
        ),
        Outcome::Differs(lines) => {
            println!("\nnot as kept:\n{lines}\nif it shall be so, `{command} --bless` keeps it");
        }
        Outcome::Missing => println!("\nno table is kept: `{command} --bless` keeps this one"),
    }
    matches!(outcome, Outcome::Same | Outcome::OtherCompiler(_))
}

/// What the tasks with a period have counted.
const OVERRUNS: [&Signal; 3] = [&PLANT_OVERRUNS, &DRIVE_OVERRUNS, &LOGIC_OVERRUNS];

/// A long run: the first load whose PLC asks, on each core.
fn endure(firmware: &Firmware, cores: &[&Core], ticks: u64) -> Result<ExitCode> {
    let mut none = true;
    for core in cores {
        let endured = firmware.endure(core, &LOADS[POLLING], ticks, |ticks, feedback| {
            let overruns = OVERRUNS.map(|signal| feedback.word(signal));
            eprintln!("winder: {ticks} ticks, overruns {overruns:?}");
        })?;
        println!("{}: {}", core.name, endured.done);
        let f = &endured.feedback;
        println!(
            "  ticks {}, hash {:08x}",
            f.double(&PLANT_TICKS),
            f.double(&TRAJECTORY)
        );
        for (task, overruns, time, jitter) in [
            ("plant", &PLANT_OVERRUNS, &PLANT_TIME_MAX, &PLANT_JITTER_MAX),
            ("drive", &DRIVE_OVERRUNS, &DRIVE_TIME_MAX, &DRIVE_JITTER_MAX),
        ] {
            println!(
                "  {task}: {} overruns, longest {} µs, latest start {} µs",
                f.word(overruns),
                f.word(time),
                f.word(jitter)
            );
        }
        println!("  logic: {} overruns", f.word(&LOGIC_OVERRUNS));
        none &= OVERRUNS.iter().all(|signal| f.word(signal) == 0);
    }
    Ok(if none {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

fn chosen<'a, T>(names: &[String], all: &'a [T], name: fn(&T) -> &str) -> Result<Vec<&'a T>> {
    for wanted in names {
        let known: Vec<_> = all.iter().map(name).collect();
        ensure!(
            known.contains(&wanted.as_str()),
            "{wanted:?} is none of {}",
            known.join(", ")
        );
    }
    let wanted = |item: &&T| names.is_empty() || names.iter().any(|wanted| wanted == name(item));
    Ok(all.iter().filter(wanted).collect())
}

fn measure(
    firmware: &Firmware,
    cores: &[&Core],
    loads: &[&Kind],
) -> Result<(String, Vec<Bar>, Vec<String>)> {
    let (mut table, mut bars, mut missing) = (String::new(), Vec::new(), Vec::new());
    for kind in loads {
        let mut all: Vec<(&Core, Measured)> = Vec::new();
        for core in cores {
            let measured = match firmware.measure(core, kind) {
                Ok(measured) => measured,
                Err(error) if error.is::<Interrupted>() => return Err(error),
                Err(error) => {
                    missing.push(format!("{} under {}: {error:#}", core.name, kind.name));
                    continue;
                }
            };
            // a string takes all that is written to it
            let _ = writeln!(
                table,
                "# {} ({}, {}), {}\n\nLoad: {}.\n\n{}",
                core.name,
                core.board,
                timing::scalar(core),
                kind.name,
                measured.done,
                measured.table()
            );
            bars.extend(timing::bars(core, kind, &measured));
            all.push((core, measured));
        }
        let of = |core: &Core| all.iter().find(|(c, _)| *c == core).map(|(_, m)| m);
        if let (Some(m7), Some(m3)) = (of(&CORES[0]), of(&CORES[2])) {
            bars.push(timing::ratio(kind, m7, m3));
        }
    }
    Ok((table, bars, missing))
}

/// Says which bars are missed; whether there are any.
fn judge(bars: &[Bar]) -> bool {
    println!("# Bars\n\n| What | Is | At most | |\n|---|---:|---:|---|");
    for bar in bars {
        let verdict = if bar.reached() { "reached" } else { "MISSED" };
        println!(
            "| {} | {:.2} | {} | {verdict} |",
            bar.what, bar.value, bar.limit
        );
    }
    bars.iter().any(|bar| !bar.reached())
}
