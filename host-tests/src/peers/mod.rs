//! The product beside what people would use instead: the same smooth winder, the same errors, one run.
//!
//! Not here: how a peer computes; their programs are in `host-tests/peers`. Each runs the [`problem`] by a method and a
//! setting, tells its CPU time and writes the states at the end of every hold.

mod problem;
mod programs;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, ensure};
use model_core::machine::Machine;

use crate::plot::{self, Curve, Figure, Ink, Panel};
use crate::{interrupt, setup};
use problem::STATES;
use programs::{Built, PROGRAMS, Processor};

/// Holds of a timed run, and of a counted one.
const HOLDS: u32 = 1000;
const COUNTED_HOLDS: u32 = 200;
/// How often each run is repeated in a process, and how often all processes are run in turn: what else the PC does makes
/// a run slower, never quicker.
const REPEATS: u32 = 20;
const ROUNDS: usize = 3;
/// Two references, by another's program and by the product, differ by less; see [`error`].
const CONVERGED: f64 = 1e-11;
/// A method at its finest setting differs from the reference by less: one of low order does not get as far in so few
/// steps, and one that starts anew in each hold is looser than its tolerance.
const AGREEMENT: f64 = 1e-7;

/// Steps in a hold.
const STEPS: &[f64] = &[1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 16.0];
/// Strides in a hold.
const STRIDES: &[f64] = &[1.0, 2.0, 4.0];
/// Relative tolerances.
const TOLERANCES: &[f64] = &[1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-10, 1e-12];
/// The same where runs are slow.
const FEW_TOLERANCES: &[f64] = &[1e-4, 1e-6, 1e-8, 1e-11];

/// A method of a program.
struct Entry {
    library: &'static str,
    program: usize,
    method: &'static str,
    settings: &'static [f64],
}

const fn entry(
    library: &'static str,
    program: usize,
    method: &'static str,
    settings: &'static [f64],
) -> Entry {
    Entry {
        library,
        program,
        method,
        settings,
    }
}

const PRODUCT: &str = "this model";
/// The motion alone, which is what the peers compute, as the real-time path takes it and as strides do. After them the
/// same with all else that a winder has.
const REAL_TIME: &str = "motion";
const SERIES: &str = "series";
const ENTRIES: &[Entry] = &[
    entry(PRODUCT, 0, REAL_TIME, STEPS),
    entry(PRODUCT, 0, SERIES, STRIDES),
    entry(PRODUCT, 0, "winder", STEPS),
    entry(PRODUCT, 0, "offline", STRIDES),
    entry("C by hand", 1, "rk4", STEPS),
    entry("Boost odeint", 2, "rk4", STEPS),
    entry("Boost odeint", 2, "rkf78", STEPS),
    entry("Boost odeint", 2, "dopri5", TOLERANCES),
    entry("GSL", 3, "rk4", STEPS),
    entry("GSL", 3, "rkf45", TOLERANCES),
    entry("GSL", 3, "rk8pd", TOLERANCES),
    entry("ode_solvers", 0, "rk4", STEPS),
    entry("ode_solvers", 0, "dopri5", TOLERANCES),
    entry("ode_solvers", 0, "dop853", TOLERANCES),
    entry("diffsol", 0, "tsit45", TOLERANCES),
    entry("ARKODE", 4, "erk4", TOLERANCES),
    entry("ARKODE", 4, "erk5", TOLERANCES),
    entry("ARKODE", 4, "erk8", TOLERANCES),
    entry("CVODE", 4, "adams", TOLERANCES),
    entry("CVODE", 4, "bdf", TOLERANCES),
    entry("SciPy", 5, "RK45", FEW_TOLERANCES),
    entry("SciPy", 5, "DOP853", FEW_TOLERANCES),
];
/// By how much the product is quicker at equal error, at least.
const BARS: &[(&str, Option<f64>)] = &[
    ("C by hand", Some(1.0)),
    ("Boost odeint", Some(2.0)),
    ("GSL", None),
    ("ode_solvers", Some(2.4)),
    ("diffsol", Some(3.6)),
    ("ARKODE", Some(16.0)),
    ("CVODE", Some(45.0)),
    ("SciPy", None),
];

/// One setting of a method, as measured.
#[derive(Clone, Debug)]
struct Point {
    error: f64,
    seconds: f64,
    instructions: Option<f64>,
}

/// Measures and prints what can be. What could not be measured, is wrong, or slower than wanted goes to `missing`.
pub fn compare(missing: &mut Vec<String>) -> Result<()> {
    let machine = Machine::news_8000();
    let write = |name: &str, holds| {
        let path = setup::scratch(name)?;
        fs::write(&path, problem::text(&machine, holds))
            .with_context(|| format!("cannot write {}", path.display()))?;
        anyhow::Ok(path)
    };
    let (timed, counted) = (
        write("peers.txt", HOLDS)?,
        write("peers-short.txt", COUNTED_HOLDS)?,
    );
    let out = setup::scratch("peers.out")?;
    let mut build = |processor| -> Result<Vec<Option<Built>>> {
        let mut all = Vec::new();
        for program in PROGRAMS {
            interrupt::check()?;
            match program.build(processor) {
                Ok(built) => all.push(built),
                Err(error) => {
                    interrupt::check()?;
                    missing.push(format!("{}: {error:#}", program.name));
                    all.push(None);
                }
            }
        }
        Ok(all)
    };
    let built = build(Processor::Native)?;
    let valgrind = setup::on_path("valgrind");
    let for_counts = match valgrind {
        Some(_) => build(Processor::Common)?,
        None => PROGRAMS.iter().map(|_| None).collect(),
    };
    if valgrind.is_none() {
        missing.push("instructions of the peers: valgrind is missing; install it, with apt-get install valgrind".into());
    }

    let Some(rust) = &built[0] else {
        return Ok(());
    };
    let reference = rust.run(&timed, "dop853", 1e-13, 1, &out)?.1;
    let converged = error(&rust.run(&timed, SERIES, 4.0, 1, &out)?.1, &reference);
    ensure!(
        converged < CONVERGED,
        "there is no reference: ode_solvers' and this model's finest results are {converged:.1e} apart, above {CONVERGED:.0e}"
    );
    let mut points: Vec<Vec<Option<Point>>> = ENTRIES
        .iter()
        .map(|entry| vec![None; entry.settings.len()])
        .collect();
    for round in 0..ROUNDS {
        for (entry, points) in ENTRIES.iter().zip(&mut points) {
            let Some(program) = &built[entry.program] else {
                continue;
            };
            // an interpreter is so slow that one round tells
            if program.interpreted() && round > 0 {
                continue;
            }
            let repeats = if program.interpreted() { 1 } else { REPEATS };
            for (setting, point) in entry.settings.iter().zip(points) {
                interrupt::check()?;
                match program.run(&timed, entry.method, *setting, repeats, &out) {
                    Ok((seconds, states)) => {
                        let seconds = seconds / f64::from(HOLDS);
                        let point = point.get_or_insert_with(|| Point {
                            error: error(&states, &reference),
                            seconds,
                            instructions: None,
                        });
                        point.seconds = point.seconds.min(seconds);
                    }
                    Err(why) if round == 0 => missing.push(format!(
                        "{} {} at {setting:e}: {why:#}",
                        entry.library, entry.method
                    )),
                    Err(_) => {}
                }
            }
        }
    }
    for (entry, points) in ENTRIES.iter().zip(&mut points) {
        let Some(program) = &for_counts[entry.program] else {
            continue;
        };
        if program.interpreted() {
            continue;
        }
        for (setting, point) in entry.settings.iter().zip(points) {
            interrupt::check()?;
            let Some(point) = point else { continue };
            match program.count(&counted, entry.method, *setting, &out) {
                Ok(count) => point.instructions = Some(count / f64::from(COUNTED_HOLDS)),
                Err(why) => missing.push(format!(
                    "instructions of {} {} at {setting:e}: {why:#}",
                    entry.library, entry.method
                )),
            }
        }
    }
    let points: Vec<Vec<Point>> = points
        .into_iter()
        .map(|p| p.into_iter().flatten().collect())
        .collect();
    print(&built, &points, missing);
    agree(&points, missing);
    draw(&points)
}

/// Largest deviation of a variable at the end of a hold, relative to its largest value in the run.
fn error(states: &[f64], reference: &[f64]) -> f64 {
    let mut largest = [0.0_f64; STATES];
    let mut worst = [0.0_f64; STATES];
    for (place, (x, wanted)) in states.iter().zip(reference).enumerate() {
        let i = place % STATES;
        largest[i] = largest[i].max(wanted.abs());
        let off = (x - wanted).abs();
        // what is not a number is as wrong as can be
        worst[i] = if off.is_nan() {
            f64::INFINITY
        } else {
            worst[i].max(off)
        };
    }
    let each = worst
        .iter()
        .zip(largest)
        .map(|(worst, largest)| worst / largest);
    each.fold(0.0, f64::max)
}

/// What a method costs at an error: of its settings, between them on a line in logarithms; no cheaper than its coarsest.
/// Nothing where it does not get there.
fn at(points: &[Point], error: f64, of: impl Fn(&Point) -> Option<f64>) -> Option<f64> {
    let mut best = f64::INFINITY;
    for (i, point) in points.iter().enumerate() {
        if point.error > error {
            continue;
        }
        let cost = of(point)?;
        best = best.min(cost);
        if let Some(before) = i.checked_sub(1).map(|i| &points[i])
            && before.error > error
        {
            let share = (error / point.error).ln() / (before.error / point.error).ln();
            let line = cost.ln() + share * (of(before)? / cost).ln();
            best = best.min(line.exp());
        }
    }
    best.is_finite().then_some(best)
}

fn number(value: Option<f64>, digits: usize) -> String {
    value.map_or("–".to_owned(), |value| format!("{value:.digits$}"))
}

/// The points of an entry.
fn points_of<'a>(points: &'a [Vec<Point>], library: &str, method: &str) -> &'a [Point] {
    let mut all = ENTRIES.iter().zip(points);
    let found = all.find(|(entry, _)| entry.library == library && entry.method == method);
    found.map_or(&[], |(_, points)| points)
}

fn print(built: &[Option<Built>], points: &[Vec<Point>], missing: &mut Vec<String>) {
    let real_time_points = points_of(points, PRODUCT, REAL_TIME);
    let series_points = points_of(points, PRODUCT, SERIES);
    // the real-time step is 4 ms; at three in a hold it is a little finer
    let (Some(real_time), Some(offline)) = (real_time_points.get(2), series_points.first()) else {
        missing.push("the model itself".into());
        return;
    };
    let (real_time, offline) = (real_time.error, offline.error);
    println!(
        "# Peers\n\nThe smooth lumped winder, torques held for 10 ms, in f64. CPU time and instructions of a hold at equal \
         error: that of the real-time path in three steps ({real_time:.1e}), and that of one offline stride ({offline:.1e}). \
         Error: largest of any variable at the end of a hold, relative to the variable's largest value.\n\n\
         | Library | Version | Method | Least error | µs at {real_time:.0e} | Instructions | µs at {offline:.0e} | Instructions |\n\
         |---|---|---|---:|---:|---:|---:|---:|"
    );
    for (entry, points) in ENTRIES.iter().zip(points) {
        let least = points.iter().map(|p| p.error).reduce(f64::min);
        let version = built[entry.program]
            .as_ref()
            .map_or("–", |b| b.version(entry.library));
        let time = |error| number(at(points, error, |p| Some(1e6 * p.seconds)), 3);
        let count = |error| number(at(points, error, |p| p.instructions), 0);
        println!(
            "| {} | {version} | {} | {} | {} | {} | {} | {} |",
            entry.library,
            entry.method,
            least.map_or("–".to_owned(), |e| format!("{e:.1e}")),
            time(real_time),
            count(real_time),
            time(offline),
            count(offline)
        );
    }
    println!(
        "\nCost relative to this model's at equal error, the quickest method of each, and what is wanted at least. The first \
         pair is beside RK4 as the real-time path takes it. The others are beside a stride, which is more exact than the first \
         error asks for; what is wanted, is wanted at its own, the last pair.\n\n\
         | Library | RK4 at {real_time:.0e} | Instructions | Wanted | At {real_time:.0e} | Instructions | At {offline:.0e} | Instructions |\n\
         |---|---:|---:|---:|---:|---:|---:|---:|"
    );
    for (library, bar) in BARS {
        let theirs = |error: f64, of: &dyn Fn(&Point) -> Option<f64>| {
            let methods = ENTRIES.iter().zip(points);
            let methods = methods.filter(|(entry, _)| entry.library == *library);
            methods
                .filter_map(|(_, points)| at(points, error, of))
                .reduce(f64::min)
        };
        let seconds = |p: &Point| Some(p.seconds);
        let instructions = |p: &Point| p.instructions;
        let ratio = |ours: &[Point], error: f64, of: &dyn Fn(&Point) -> Option<f64>| {
            Some(theirs(error, of)? / at(ours, error, of)?)
        };
        let ratios = [
            ratio(series_points, real_time, &seconds),
            ratio(series_points, real_time, &instructions),
            ratio(series_points, offline, &seconds),
            ratio(series_points, offline, &instructions),
        ];
        println!(
            "| {library} | {} | {} | {} | {} |",
            number(ratio(real_time_points, real_time, &seconds), 2),
            number(ratio(real_time_points, real_time, &instructions), 2),
            number(*bar, 1),
            ratios.map(|ratio| number(ratio, 2)).join(" | ")
        );
        // a method that does not get there has no time to compare
        if let (Some(bar), Some(ratio)) = (*bar, ratios[2])
            && ratio < bar
        {
            missing.push(format!(
                "{bar} times the speed of {library} at an error of {offline:.0e}: it is {ratio:.2} times"
            ));
        }
    }
}

/// Every method, at its finest, must give the reference.
fn agree(points: &[Vec<Point>], missing: &mut Vec<String>) {
    for (entry, points) in ENTRIES.iter().zip(points) {
        if let Some(least) = points.iter().map(|p| p.error).reduce(f64::min)
            && least > AGREEMENT
        {
            missing.push(format!(
                "agreement of {} {}: it is {least:.1e} from the reference, above {AGREEMENT:.0e}",
                entry.library, entry.method
            ));
        }
    }
}

/// What the figure shows: a diagram for a few methods each, beside this model's.
const PANELS: &[(&str, &[(&str, &str)])] = &[
    (
        "C and C++, fixed steps",
        &[("C by hand", "rk4"), ("Boost odeint", "rkf78")],
    ),
    ("Rust", &[("ode_solvers", "dop853"), ("diffsol", "tsit45")]),
    (
        "C, with step control",
        &[("GSL", "rk8pd"), ("ARKODE", "erk8")],
    ),
    (
        "Multistep; Python",
        &[("CVODE", "adams"), ("SciPy", "DOP853")],
    ),
];

/// The work–precision diagram as SVG and PNG.
fn draw(points: &[Vec<Point>]) -> Result<()> {
    let curve = |ink, library: &str, method: &str| {
        let mut points: Vec<_> = points_of(points, library, method)
            .iter()
            .filter(|p| p.error > 0.0 && p.error < 1.0)
            .map(|p| (-p.error.log10(), (1e6 * p.seconds).log10()))
            .collect();
        // where rounding has the last word, a finer setting is only dearer
        let all: Vec<(f64, f64)> = points.clone();
        points.retain(|p| !all.iter().any(|q| q.0 >= p.0 && q.1 < p.1));
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        Curve::new(&format!("{library}, {method}"), ink, points)
    };
    let panels = PANELS.iter().map(|(title, theirs)| {
        let inks = [Ink::Orange, Ink::Green].into_iter();
        let theirs = inks.zip(*theirs).map(|(ink, (l, m))| curve(ink, l, m));
        let ours = [
            curve(Ink::Blue, PRODUCT, SERIES),
            curve(Ink::Reference, PRODUCT, REAL_TIME),
        ];
        Panel {
            title: format!("{title}: log₁₀ µs of a hold"),
            height: 190.0,
            curves: ours.into_iter().chain(theirs).collect(),
            band: None,
        }
    });
    let figure = Figure {
        title: "What a hold costs".to_owned(),
        subtitle: "the smooth lumped winder, torques held for 10 ms, f64".to_owned(),
        panels: panels.collect(),
        axis: "digits that are right, −log₁₀ of the error".to_owned(),
        caption: "Lower is quicker, further right is more exact. Series: what runs without a PLC stride by. Motion: the \
                  steps of the real-time path."
            .to_owned(),
    };
    let svg = figure.svg();
    let dir = Path::new("out");
    fs::create_dir_all(dir)
        .with_context(|| format!("cannot make the directory {}", dir.display()))?;
    let pictures = [("svg", svg.clone().into_bytes()), ("png", plot::png(&svg)?)];
    for (kind, picture) in pictures {
        let path = dir.join("peers").with_extension(kind);
        fs::write(&path, picture).with_context(|| format!("cannot write {}", path.display()))?;
        println!("\nFigure: {}", path.display());
    }
    Ok(())
}

/// A program's output: its CPU time, s, and the states it has written.
fn result(program: &mut Command, out: &Path) -> Result<(f64, Vec<f64>)> {
    let said = programs::said(program)?;
    let seconds = said
        .trim()
        .parse()
        .with_context(|| format!("{said:?} is no time"))?;
    let bytes = fs::read(out).with_context(|| format!("cannot read {}", out.display()))?;
    ensure!(bytes.len() % 8 == 0, "{} bytes are no states", bytes.len());
    let states = bytes
        .chunks_exact(8)
        .map(|x| f64::from_ne_bytes(x.try_into().unwrap_or_default()));
    Ok((seconds, states.collect()))
}

/// A path among the peers' sources.
fn source(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("peers")
        .join(name)
}
