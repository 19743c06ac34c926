//! `winder bench`

use std::collections::BTreeMap;
use std::hint::black_box;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, anyhow};
use model_core::drive::DRIVE_PERIOD_MS;
use model_core::fixed::Word;
use model_core::image::{Commands, Feedback, Image};
use model_core::machine::{MAX_SPANS, Machine};
use model_core::plant::{PLANT_PERIOD_MS, Winder, modes};
use model_core::real;
use model_core::simulator::Simulator;
use model_core::twin::{self, Course, Extent};

use crate::batch;
use crate::flops::{self, Floor};
use crate::interrupt;
use crate::peers;
use crate::setup::{self, Warnings};
use crate::twin::{CORES, Section, Twin};

/// What to measure.
#[derive(Clone, Debug, clap::Args)]
pub struct Args {
    /// Preset; may be given several times [default: NEWS-8000 and NEWS-8000-UNLUMPED]
    #[arg(long = "machine", value_name = "NAME")]
    machines: Vec<String>,
    /// Numbers to compute with: f32, f64 or fixed; may be given several times [default: all]
    #[arg(long = "scalar", value_name = "NAME", value_parser = scalar)]
    scalars: Vec<&'static Scalar>,
    /// Measure the link instead: requests of Modbus TCP, on both boards
    #[arg(long, conflicts_with_all = ["machines", "scalars"])]
    link: bool,
    /// With --link, a thousand connections a second for a minute too
    #[arg(long, requires = "link")]
    connects: bool,
    /// The product beside other integrators on the same winder, and nothing else
    #[arg(long, conflicts_with_all = ["machines", "scalars", "link"])]
    peers: bool,
}

type Floors = BTreeMap<&'static str, Floor>;

/// A scalar, and what can be told of it on this PC.
#[derive(Debug)]
struct Scalar {
    name: &'static str,
    /// Operations needed; only floating-point numbers are counted.
    floors: Option<fn(&Machine) -> Result<Floors>>,
    /// Winder-seconds of the plant alone, and of the whole simulator, in a second.
    speeds: fn(&Machine) -> Result<[f64; 2]>,
}

const SCALARS: &[Scalar] = &[
    Scalar {
        name: "f32",
        floors: Some(flops::floors::<f32>),
        speeds: speeds::<f32>,
    },
    Scalar {
        name: "f64",
        floors: Some(flops::floors::<f64>),
        speeds: speeds::<f64>,
    },
    Scalar {
        name: "fixed",
        floors: None,
        speeds: speeds::<Word>,
    },
];

fn scalar(name: &str) -> Result<&'static Scalar> {
    let names = || {
        SCALARS
            .iter()
            .map(|s| s.name)
            .collect::<Vec<_>>()
            .join(", ")
    };
    let found = SCALARS.iter().find(|s| s.name == name);
    found.ok_or_else(|| anyhow!("there are {}", names()))
}

/// What is measured unless machines are named.
const MACHINES: [&str; 2] = ["NEWS-8000", "NEWS-8000-UNLUMPED"];

/// The parts of the simulator, as the twin's sections are called.
const PARTS: [(&str, &str); 8] = [
    ("motion", "motion alone"),
    ("smooth", "plant step"),
    ("braked", "… with brakes"),
    ("gripping", "… with nips that may slip"),
    ("sliding", "… with a nip that slips"),
    ("tick", "plant task: step and hash"),
    ("drive", "regulators"),
    ("logic", "logic"),
];

/// Measures and prints what can be; says what cannot.
pub fn main(args: &Args) -> Result<ExitCode> {
    if args.link {
        return super::link_bench::main(args.connects);
    }
    if args.peers {
        return beside_peers();
    }
    let names: Vec<&str> = match &args.machines[..] {
        [] => MACHINES.to_vec(),
        names => names.iter().map(String::as_str).collect(),
    };
    let machine = |name| {
        let machine = Machine::preset(name).with_context(|| {
            format!("no preset is called {name:?}; `cargo winder machine --list` names them")
        })?;
        Ok((name, machine))
    };
    let machines = names.into_iter().map(machine).collect::<Result<Vec<_>>>()?;
    let scalars: Vec<&Scalar> = match &args.scalars[..] {
        [] => SCALARS.iter().collect(),
        scalars => scalars.to_vec(),
    };

    let mut missing = Vec::new();
    let bench = Bench::prepare(&mut missing)?;
    println!(
        "# Instructions of a call in QEMU\n\n\
         Mean, most in brackets, and the mean for each operation that floating point needs. QEMU has no model of cycles: a \
         division counts as a move does.\n"
    );
    for (name, machine) in &machines {
        for scalar in &scalars {
            bench.table(name, machine, scalar, &mut missing)?;
        }
    }
    println!(
        "# Speed on this PC\n\n\
         Simulated seconds in a second, on one core; the best of {ROUNDS} rounds.\n\n\
         | Machine | Scalar | Plant | Simulator |\n|---|---|---:|---:|"
    );
    for (name, machine) in &machines {
        for scalar in &scalars {
            interrupt::check()?;
            let [plant, simulator] = (scalar.speeds)(machine)?;
            println!("| {name} | {} | {plant:.0} | {simulator:.0} |", scalar.name);
        }
    }
    println!(
        "\n# Many winders at once\n\n\
         What a sweep does, on one core in f32: simulated winder-seconds in a second, of a winder by itself and of \
         sixteen side by side.\n\n\
         | Machine | Alone | Side by side | Ratio |\n|---|---:|---:|---:|"
    );
    for (name, machine) in &machines {
        interrupt::check()?;
        let rates = batch::rates(machine, ROUNDS)?;
        let seconds = |steps: f64| steps * 1e-3 * f64::from(PLANT_PERIOD_MS);
        println!(
            "| {name} | {:.0} | {:.0} | {:.1} |",
            seconds(rates.alone),
            seconds(rates.side_by_side),
            rates.ratio()
        );
    }
    for what in missing {
        println!("\nNot measured: {what}");
    }
    Ok(ExitCode::SUCCESS)
}

/// Fails where something was not measured, is wrong, or slower than wanted.
fn beside_peers() -> Result<ExitCode> {
    let mut missing = Vec::new();
    peers::compare(&mut missing)?;
    for what in &missing {
        println!("\nMissed: {what}");
    }
    Ok(if missing.is_empty() {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

/// The twins that could be had, by the places of their cores.
struct Bench {
    counter: Option<PathBuf>,
    twins: [Option<Twin>; CORES.len()],
}

impl Bench {
    fn prepare(missing: &mut Vec<String>) -> Result<Self> {
        let counter = setup::counter(Warnings::Shown);
        let counter = present(counter, "instructions", missing)?;
        let mut twins = [const { None }; CORES.len()];
        if counter.is_some() && present(setup::qemu(), "instructions", missing)?.is_some() {
            for (twin, core) in twins.iter_mut().zip(CORES) {
                let what = format!("instructions on {}", core.name);
                *twin = present(Twin::on(core), &what, missing)?;
            }
        }
        Ok(Self { counter, twins })
    }

    fn table(
        &self,
        name: &str,
        machine: &Machine,
        scalar: &Scalar,
        missing: &mut Vec<String>,
    ) -> Result<()> {
        let floors = match scalar.floors {
            Some(floors) => floors(machine)?,
            None => Floors::new(),
        };
        let mut counts = [const { None }; CORES.len()];
        for ((count, twin), core) in counts.iter_mut().zip(&self.twins).zip(CORES) {
            interrupt::check()?;
            if let (Some(counter), Some(twin)) = (&self.counter, twin) {
                let what = format!("{name} in {} on {}", scalar.name, core.name);
                *count = present(twin.count(counter, scalar.name, name), &what, missing)?;
            }
        }
        let titles = CORES.map(|core| format!("{} ({})", core.name, core.board));
        println!("## {name}, {}\n", scalar.name);
        let substeps = modes::substeps(machine, PERIOD_S);
        if substeps > 1 {
            println!("A plant step is {substeps} steps of the motion.\n");
        }
        println!("| Part | Needed | {} |", titles.join(" | "));
        println!("|---|---:|{}", "---:|".repeat(CORES.len()));
        for (section, part) in PARTS {
            let floor = floors.get(section);
            let needed = floor.map_or(NOTHING.to_owned(), needed);
            let cells = counts
                .each_ref()
                .map(|count| cell(count.as_deref(), section, floor));
            println!("| {part} | {needed} | {} |", cells.join(" | "));
        }
        println!();
        Ok(())
    }
}

/// Period of the plant task, s.
const PERIOD_S: f64 = 1e-3 * PLANT_PERIOD_MS as f64;

/// A cell without a measurement.
const NOTHING: &str = "–";

fn needed(floor: &Floor) -> String {
    let needed = &floor.needed;
    let mut text = format!("{:.0}", needed.total());
    for (sign, number) in [
        ("÷", needed.quotients),
        ("√", needed.roots),
        ("cos", needed.cosines),
    ] {
        if number >= 0.5 {
            text += &format!(", {number:.0} {sign}");
        }
    }
    text
}

fn cell(sections: Option<&[Section]>, name: &str, floor: Option<&Floor>) -> String {
    let sections = sections.unwrap_or_default();
    let Some(section) = sections.iter().find(|section| section.name == name) else {
        return NOTHING.to_owned();
    };
    let mut text = format!("{:.0} ({})", section.mean, section.max);
    if let Some(floor) = floor {
        text += &format!(", {:.2}×", section.mean / floor.needed.total());
    }
    text
}

/// What there is; otherwise why not, for the end. An interruption is an error all the same.
fn present<T>(outcome: Result<T>, what: &str, missing: &mut Vec<String>) -> Result<Option<T>> {
    interrupt::check()?;
    match outcome {
        Ok(there) => Ok(Some(there)),
        Err(error) => {
            missing.push(format!("{what}: {error:#}"));
            Ok(None)
        }
    }
}

/// How often a speed is measured: whatever else the PC does makes it slower, never faster.
const ROUNDS: usize = 5;
/// How long a round takes at least.
const ROUND: Duration = Duration::from_millis(200);

fn speeds<R: real::Scalar>(machine: &Machine) -> Result<[f64; 2]> {
    match machine.idle.len() + 1 {
        3 => speeds_with::<R, 3>(machine),
        MAX_SPANS => speeds_with::<R, MAX_SPANS>(machine),
        spans => Err(anyhow!(
            "a machine of {spans} spans is not measured: 3 or {MAX_SPANS}"
        )),
    }
}

fn speeds_with<R: real::Scalar, const SPANS: usize>(machine: &Machine) -> Result<[f64; 2]> {
    let course = Course::of(machine, Extent::Short);
    let plant = best(|| {
        let mut winder = Winder::<R, SPANS>::new(machine, PERIOD_S)?;
        let mut steps = 0;
        for (_, actuators) in course.steps::<R::Si>() {
            black_box(winder.step(black_box(&actuators)));
            steps += 1;
        }
        Ok(f64::from(steps) * PERIOD_S)
    })?;
    let cycle_s = 1e-3 * f64::from(DRIVE_PERIOD_MS);
    let commands: Vec<Commands> = (0..twin::CYCLES)
        .map(|cycle| twin::commands(machine, cycle))
        .collect();
    let simulator = best(|| {
        let mut simulator = Simulator::<R, SPANS>::new(machine)?;
        let mut image = Image {
            commands: Commands::of(machine),
            feedback: Feedback::default(),
        };
        for commands in &commands {
            image.commands = *commands;
            simulator.drive_cycle(black_box(&mut image));
        }
        Ok(commands.len() as f64 * cycle_s)
    })?;
    Ok([plant, simulator])
}

/// Simulated seconds in a second, of a run that says how long it was.
fn best(mut run: impl FnMut() -> Result<f64>) -> Result<f64> {
    let mut best = 0.0_f64;
    for _ in 0..ROUNDS {
        let (began, mut simulated) = (Instant::now(), 0.0);
        while began.elapsed() < ROUND {
            simulated += run()?;
        }
        best = best.max(simulated / began.elapsed().as_secs_f64());
    }
    Ok(best)
}
