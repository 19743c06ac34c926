//! `winder demo`

use std::fs;
use std::io::{self, IsTerminal};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, ensure};
use indicatif::{ProgressBar, ProgressStyle};
use model_core::image::{self, Direction, Kind, SIGNALS};
use model_core::machine::Machine;

use crate::interrupt::Interrupted;
use crate::log::{Level, Log};
use crate::plc::{self, Recipe, Sample};
use crate::plot;
use crate::report::{Report, minutes};
use crate::simulator::{Board, Options, Simulator};

/// Where there is no terminal for a progress bar, a line so often, s of simulated time.
const LINE_EVERY_S: f64 = 10.0;

/// The short set, in mm and m/min.
const SHORT: (f64, f64) = (400.0, 1200.0);

/// What to wind, and on what.
#[derive(Clone, Debug, clap::Args)]
pub struct Args {
    /// The whole set: a full roll at the machine's run speed (1250 mm at 2200 m/min, 11 minutes)
    #[arg(long)]
    full: bool,
    /// What the simulator runs on
    #[arg(long, value_enum, default_value_t = Board::Mps2)]
    board: Board,
    /// Diameter of the finished roll [default: 400]
    #[arg(long, value_name = "MM")]
    diameter: Option<f64>,
    /// Web speed [default: 1200]
    #[arg(long, value_name = "M_MIN")]
    speed: Option<f64>,
    /// Simulated time over real time; much above 10 the PLC's heartbeat comes late on a busy PC
    #[arg(long, value_name = "N", default_value_t = 1.0)]
    pace: f64,
    /// Directory for the picture and the data
    #[arg(long, value_name = "DIR", default_value = "out")]
    out: PathBuf,
}

impl Args {
    fn recipe(&self) -> Result<Recipe> {
        let machine = Machine::news_8000();
        let full_mm = 2e3 * machine.shipping_roll.full_radius_m;
        let core_mm = 2e3 * machine.shipping_roll.core_radius_m;
        let (thread, run, max) = (
            60.0 * machine.operation.thread_speed_m_s,
            60.0 * machine.operation.run_speed_m_s,
            60.0 * machine.operation.max_speed_m_s,
        );
        let (diameter, speed) = if self.full { (full_mm, run) } else { SHORT };
        let (diameter_mm, speed_m_min) = (
            self.diameter.unwrap_or(diameter),
            self.speed.unwrap_or(speed),
        );
        // room for the first layers, wound while the machine starts and stops
        let least_mm = core_mm + 20.0;
        ensure!(
            (least_mm..=full_mm).contains(&diameter_mm),
            "--diameter {diameter_mm} mm is outside {least_mm:.0} to {full_mm:.0} mm, which this machine can wind"
        );
        ensure!(
            (2.0 * thread..=max).contains(&speed_m_min),
            "--speed {speed_m_min} m/min is outside {:.0} to {max:.0} m/min, which this machine can run",
            2.0 * thread
        );
        Ok(Recipe {
            machine,
            diameter_m: 1e-3 * diameter_mm,
            speed_m_s: speed_m_min / 60.0,
        })
    }
}

/// Winds a set and shows what came of it.
pub fn main(args: &Args) -> Result<ExitCode> {
    let recipe = args.recipe()?;
    fs::create_dir_all(&args.out)
        .with_context(|| format!("cannot make the directory {}", args.out.display()))?;
    let bar = ProgressBar::new(recipe.set_length_m().round() as u64);
    bar.set_style(ProgressStyle::with_template(
        "{prefix:<18} {wide_bar} {percent:>3}%  {msg}",
    )?);
    let screen = bar.clone();
    let options = Options {
        pace: args.pace,
        log: Log::new(move |line| {
            if line.level >= Level::Warn {
                screen.suspend(|| eprintln!("{line}"));
            }
        }),
        ..Options::default()
    };
    let mut simulator = Simulator::start(args.board, options)?;
    let title = format!(
        "{:.0} mm at {:.0} m/min on {}",
        1e3 * recipe.diameter_m,
        60.0 * recipe.speed_m_s,
        args.board.name()
    );
    eprintln!(
        "winder: {title}: {:.0} m of web, about {}; Modbus TCP {}",
        recipe.set_length_m(),
        minutes(recipe.duration_s() / args.pace),
        simulator.address()
    );

    let began = Instant::now();
    let mut samples: Vec<Sample> = Vec::new();
    let mut progress = Progress {
        bar,
        next_line_s: 0.0,
    };
    let outcome = plc::wind(simulator.address(), &recipe, args.pace, |sample| {
        progress.show(sample);
        samples.push(*sample);
    });
    progress.bar.finish_and_clear();
    let took = minutes(began.elapsed().as_secs_f64());
    let outcome = outcome.or_else(|error| {
        if !error.is::<Interrupted>() {
            // a simulator that has ended says more than a broken connection does, after a moment to end in
            thread::sleep(Duration::from_millis(200));
            simulator.check()?;
        }
        Err(error)
    });
    drop(simulator);
    let files = write(&args.out, &title, &recipe, &samples)?;
    outcome.with_context(|| format!("the set was not wound; what was recorded is in {files}"))?;
    let report = Report::of(&recipe, &samples);
    println!("{title}, wound in {took}:\n\n{report}");
    if args.board == Board::Mps2 {
        println!(
            "  (QEMU counts 2 ns for every instruction: its times compare, but are no hardware's)\n"
        );
    }
    println!("Picture and data: {files}");
    let missed = report.missed();
    if missed.is_empty() {
        return Ok(ExitCode::SUCCESS);
    }
    println!("Limit missed: {}", missed.join(", "));
    Ok(ExitCode::FAILURE)
}

/// What the operator sees while it runs.
struct Progress {
    bar: ProgressBar,
    next_line_s: f64,
}

impl Progress {
    fn show(&mut self, sample: &Sample) {
        self.bar
            .set_position(sample.value(&image::LENGTH_WU) as u64);
        self.bar.set_prefix(sample.step.name());
        self.bar.set_message(state(sample));
        if !io::stderr().is_terminal() && sample.t_s >= self.next_line_s {
            eprintln!(
                "{:6.0} s  {:<18} {}",
                sample.t_s,
                sample.step.name(),
                state(sample)
            );
            self.next_line_s = sample.t_s + LINE_EVERY_S;
        }
    }
}

fn state(sample: &Sample) -> String {
    format!(
        "{:6.1} m/min  {:4.0} N/m  parent {:6.1} mm  roll {:6.1} mm",
        sample.value(&image::V_WEB),
        sample.value(&image::TENSION),
        sample.value(&image::D_UW),
        sample.value(&image::D_WU)
    )
}

/// Writes picture and data; says where they are.
fn write(out: &Path, title: &str, recipe: &Recipe, samples: &[Sample]) -> Result<String> {
    let (svg, png, data) = (
        out.join("demo.svg"),
        out.join("demo.png"),
        out.join("demo.csv"),
    );
    let subtitle = format!(
        "newsprint {:.0} g/m², {:.0} m wide, as a winder PLC saw it over Modbus TCP",
        1e3 * recipe.machine.web.grammage_kg_m2,
        recipe.machine.web.width_m
    );
    let picture = plot::svg(&format!("A set of paper: {title}"), &subtitle, samples);
    let save = |path: &Path, bytes: &[u8]| {
        fs::write(path, bytes).with_context(|| format!("cannot write {}", path.display()))
    };
    save(&svg, picture.as_bytes())?;
    save(&png, &plot::png(&picture)?)?;
    save(&data, &csv(samples)?)?;
    Ok(format!(
        "{}, {}, {}",
        svg.display(),
        png.display(),
        data.display()
    ))
}

/// The samples as CSV: time, step, and every feedback signal in its unit.
fn csv(samples: &[Sample]) -> Result<Vec<u8>> {
    let feedback = || {
        SIGNALS
            .iter()
            .filter(|s| s.direction == Direction::Feedback)
    };
    let mut csv = csv::Writer::from_writer(Vec::new());
    csv.write_record(
        ["t_s", "step"]
            .into_iter()
            .chain(feedback().map(|s| s.name)),
    )?;
    for sample in samples {
        csv.write_field(format!("{:.3}", sample.t_s))?;
        csv.write_field(sample.step.name())?;
        for signal in feedback() {
            csv.write_field(match signal.kind {
                Kind::Bits(_) => format!("0x{:04x}", sample.feedback.word(signal)),
                _ => sample.value(signal).to_string(),
            })?;
        }
        csv.write_record(None::<&[u8]>)?;
    }
    Ok(csv.into_inner()?)
}
