//! The plant alone, driven open loop by a schedule of torques.
//!
//! Not here: regulators, logic, sensors, limits of the motors. A row of the schedule acts on the rolls as it
//! stands, so that the winder can be compared with other models of it.
//!
//! A schedule is CSV with a header, its columns in any order: `t_s`, the torques `T_uw`, `T_rd`, `T_fd`, `T_rr`
//! in N·m, and if wanted the brakes `brake_uw`, `brake_rd`, `brake_fd`, 0 or 1. The first row is at 0. A row holds
//! from the first step of 4 ms at or after its time until the next row does; the last row only says when the run
//! ends. Time is counted in whole steps.
//!
//! The output is CSV, too: `t_s`; the surface speeds of unwind, idle rolls and rear drum, m/s; the tensions of the
//! spans, each named after the roll it leaves, N; the radii `r_uw` and `r_wu`, m. The idle rolls of a machine with
//! two of them are `gr` and `sr`, those of any other are numbered from 1 in the web's direction:
//! `t_s,v_uw,v_1,…,v_7,v_rd,t_uw,t_1,…,t_7,r_uw,r_wu`.
//!
//! The run starts at standstill: all spans at stall tension, full parent roll, bare core, brakes off.

use std::fs::File;
use std::io::{self, BufRead, BufReader, BufWriter, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow, bail, ensure};
use clap::ValueEnum;
use model_core::exchange::{Actuators, Brakes, BySection};
use model_core::fixed::Word;
use model_core::machine::{Machine, MachineError, PRESETS};
use model_core::plant::windup::ROLLS;
use model_core::plant::{PLANT_PERIOD_MS, Winder};
use model_core::real::{self, Real};
use offline::Strider;

use crate::batch;
use crate::machine_file::Description;

/// Spans of a machine whose idle rolls are lumped: guide rolls `gr`, spreader rolls `sr`.
const LUMPED: usize = 3;
/// Step of the plant, ns.
const STEP_NS: u64 = 1_000_000 * PLANT_PERIOD_MS as u64;
/// Step of the plant, s.
pub(crate) const H: f64 = 1e-3 * PLANT_PERIOD_MS as f64;
/// Longest schedule, s: eleven days.
const LONGEST_S: f64 = 1e6;
/// Largest torque, N·m: the largest motor that a machine's description may have.
const LARGEST_N_M: f64 = 1e6;

/// Columns that a schedule must have, …
const NEEDED: [&str; 5] = ["t_s", "T_uw", "T_rd", "T_fd", "T_rr"];
/// … and those it may have.
const OPTIONAL: [&str; 3] = ["brake_uw", "brake_rd", "brake_fd"];

/// What to run, and where the result goes.
#[derive(Clone, Debug, clap::Args)]
pub struct Options {
    /// Torques over time: CSV with the columns t_s,T_uw,T_rd,T_fd,T_rr (s, N·m) and, if wanted,
    /// brake_uw,brake_rd,brake_fd (0 or 1). Each row holds until the next; the last one ends the run
    #[arg(long, value_name = "FILE.csv")]
    pub schedule: PathBuf,
    /// Speeds, tensions and radii over time, as CSV in SI units; with --sweep a row for each run; `-` prints them
    #[arg(long, value_name = "FILE.csv")]
    pub out: PathBuf,
    /// Machine: a preset or a machine file, see `cargo winder machine` [default: NEWS-8000, or the sweep's]
    #[arg(long, value_name = "NAME|FILE")]
    pub machine: Option<String>,
    /// Numbers to compute with; the microcontroller has f32 [default: f64; with --sweep f32, which is quickest]
    #[arg(long, value_enum)]
    pub scalar: Option<Scalar>,
    /// How the winder gets on; with `series` a steady stretch takes half the time, and has digits that `rk4` has not.
    /// In f64
    #[arg(long, value_enum, default_value_t = Stepper::Rk4, conflicts_with = "sweep")]
    pub stepper: Stepper,
    /// Time from row to row of the output, a multiple of 0.004 s
    #[arg(
        long = "every",
        value_name = "SECONDS",
        default_value_t = 1.0,
        allow_negative_numbers = true,
        conflicts_with = "sweep"
    )]
    pub every_s: f64,
    /// Runs many winders at once: one for each combination of the values that this file gives to parameters of the
    /// machine
    ///
    /// The file reads, for example:
    ///
    ///     machine = "NEWS-8000"
    ///     [vary]
    ///     web.stiffness_n_m = [220e3, 260e3, 300e3]
    ///     parent_roll.full_radius_m = { from = 1.0, to = 1.5, steps = 6 }
    ///
    /// The output has a row for each run: the parameters' values; the largest tension in any span of the whole web, N,
    /// with its time, and the smallest; the final speeds, tensions and radii; the times at which the web broke, a
    /// roll of the windup first lost traction and the shipping roll burst, empty where that did not happen (slip and
    /// burst: if nips.slip or wound_on_tension.compresses is on)
    #[arg(long, value_name = "FILE.toml", verbatim_doc_comment)]
    pub sweep: Option<PathBuf>,
}

/// Numbers to compute with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Scalar {
    /// Single precision.
    F32,
    /// Double precision.
    F64,
    /// Fixed point, as a microcontroller without floating-point unit.
    Fixed,
}

/// How a winder gets on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Stepper {
    /// The steps of the real-time path.
    Rk4,
    /// Strides by a series where nothing but the motors moves the winder and its web stays taut; else the same steps.
    Series,
}

/// Reads the schedule, runs the plant, writes the result.
///
/// `console` gets a line about what was done, or the result itself when the output file is `-`. Nothing is
/// written before machine, schedule and options have been found good.
pub fn run(options: &Options, console: &mut dyn Write) -> Result<()> {
    if let Some(file) = &options.sweep {
        return batch::run(options, file, console);
    }
    if let (Stepper::Series, Some(scalar @ (Scalar::F32 | Scalar::Fixed))) =
        (options.stepper, options.scalar)
    {
        let name = scalar.to_possible_value();
        let name = name.as_ref().map_or("", |value| value.get_name());
        bail!("--stepper series computes in f64 only, not in {name}; --stepper rk4 does");
    }
    let machine = options.machine.as_deref().unwrap_or(PRESETS[0].0);
    let machine = Description::find(machine)?.machine;
    let every = output_period(options.every_s)?;
    let schedule = Schedule::open(&options.schedule)?;
    let simulate = |out: &mut dyn Write| match (options.stepper, options.scalar) {
        (Stepper::Rk4, None | Some(Scalar::F64)) => {
            simulate::<f64>(&machine, &schedule, every, &Steps, out)
        }
        (Stepper::Rk4, Some(Scalar::F32)) => {
            simulate::<f32>(&machine, &schedule, every, &Steps, out)
        }
        (Stepper::Rk4, Some(Scalar::Fixed)) => {
            simulate::<Word>(&machine, &schedule, every, &Steps, out)
        }
        (Stepper::Series, _) => {
            let strider = Strider::new(&machine, H);
            simulate::<f64>(&machine, &schedule, every, &strider, out)
        }
    };
    if options.out.as_os_str() == "-" {
        simulate(console)?;
        return Ok(());
    }
    let path = options.out.display();
    let file = File::create(&options.out).with_context(|| format!("cannot write {path}"))?;
    let mut file = BufWriter::new(file);
    let run = simulate(&mut file)
        .and_then(|run| Ok(file.flush().map(|()| run)?))
        .with_context(|| format!("cannot write {path}"))?;
    for event in run.events {
        writeln!(console, "{event}")?;
    }
    writeln!(console, "{path}: {} rows", run.rows)?;
    Ok(())
}

/// Events that are told of a run; a roll on the verge of its traction may lose it again and again.
const MOST_EVENTS: usize = 20;

/// What came of a run besides its rows.
#[derive(Clone, Debug, Default)]
struct Run {
    rows: u64,
    /// What happened, with its time.
    events: Vec<String>,
}

/// Sees what happens to web and shipping roll from step to step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Incidents {
    web_broken: bool,
    slides: [bool; ROLLS],
    burst: bool,
}

impl Incidents {
    fn of<R: real::Scalar, const SPANS: usize>(winder: &Winder<R, SPANS>) -> Self {
        let winding = winder.winding();
        Self {
            web_broken: !winder.threaded(),
            slides: winding.slides,
            burst: winding.burst,
        }
    }

    /// What is new since `before`.
    fn since(&self, before: &Self) -> impl Iterator<Item = &'static str> {
        const LOST: [&str; ROLLS] = [
            "the rear drum loses traction",
            "the front drum loses traction",
            "the rider roll loses traction",
        ];
        let slips = (0..ROLLS).filter(|i| self.slides[*i] && !before.slides[*i]);
        let breaks = (self.web_broken && !before.web_broken).then_some("the web breaks");
        let bursts = (self.burst && !before.burst).then_some("the shipping roll bursts");
        let slips: Vec<_> = slips.map(|i| LOST[i]).collect();
        slips.into_iter().chain(breaks).chain(bursts)
    }
}

/// Steps from row to row of the output.
fn output_period(every_s: f64) -> Result<u64> {
    let steps = nanoseconds(every_s) / STEP_NS;
    ensure!(
        every_s <= LONGEST_S && steps > 0 && nanoseconds(every_s).is_multiple_of(STEP_NS),
        "--every {every_s} is not a multiple of the plant's step, 0.004 s, from 0.004 to {LONGEST_S:.0} s"
    );
    Ok(steps)
}

/// A time to the nearest nanosecond, so that no multiple of the step is missed by rounding. What is negative or
/// not a number gives 0.
fn nanoseconds(seconds: f64) -> u64 {
    (seconds * 1e9).round() as u64
}

/// Torques and brakes over time.
#[derive(Clone, Debug, PartialEq)]
pub struct Schedule {
    rows: Vec<Row>,
}

/// What holds from a step on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Row {
    tick: u64,
    pub torque: BySection<f64>,
    pub brakes: Brakes<bool>,
}

impl Schedule {
    /// Reads a file.
    pub fn open(path: &Path) -> Result<Self> {
        let name = path.display().to_string();
        let file = File::open(path).with_context(|| format!("cannot read {name}"))?;
        Self::read(&name, BufReader::new(file))
    }

    /// Reads CSV from anywhere; an error gives the source's `name`, the line and the reason.
    ///
    /// Numbers need no CSV library: what one would add here, escapes in quotes, a schedule has no use for, and
    /// the line of an error must be right after empty lines, too.
    pub fn read(name: &str, source: impl BufRead) -> Result<Self> {
        let (mut line, mut columns, mut time) = (0, None, None);
        let mut rows = Vec::new();
        for (number, text) in (1..).zip(source.lines()) {
            let at = || format!("{name}:{number}");
            let text = text.with_context(at)?;
            let fields = fields(&text);
            if fields == [""] {
                continue;
            }
            line = number;
            let Some(columns) = &columns else {
                columns = Some(Columns::of(&fields).with_context(at)?);
                continue;
            };
            let (t_s, row) = columns.row(&fields).with_context(at)?;
            follows(time, t_s).with_context(at)?;
            time = Some(t_s);
            rows.push(row);
        }
        ensure!(!rows.is_empty(), "{name}:{}: there is no row", line + 1);
        Ok(Self { rows })
    }

    /// The step at which the run ends.
    pub(crate) fn end(&self) -> u64 {
        self.rows.last().map_or(0, |row| row.tick)
    }

    /// The rows, each with the steps in which it holds, counted from 0.
    pub(crate) fn rows(&self) -> impl Iterator<Item = (&Row, Range<u64>)> {
        let pairs = self.rows.windows(2);
        pairs.map(|pair| (&pair[0], pair[0].tick..pair[1].tick))
    }
}

/// The fields of a line, without blanks, quotes and the mark that some programs put before the first.
fn fields(line: &str) -> Vec<&str> {
    line.trim_start_matches('\u{feff}')
        .split(',')
        .map(|field| field.trim().trim_matches('"'))
        .collect()
}

/// Refuses a time that does not follow the one before.
fn follows(before_s: Option<f64>, t_s: f64) -> Result<()> {
    match before_s {
        None => ensure!(t_s == 0.0, "t_s = {t_s}: the first row must be at 0"),
        Some(before_s) => ensure!(t_s > before_s, "t_s = {t_s} does not come after {before_s}"),
    }
    Ok(())
}

/// Where in a record the columns stand, in the order of [`NEEDED`] and [`OPTIONAL`].
struct Columns {
    needed: [usize; NEEDED.len()],
    optional: [Option<usize>; OPTIONAL.len()],
    width: usize,
}

impl Columns {
    fn of(header: &[&str]) -> Result<Self> {
        let known = || NEEDED.iter().chain(&OPTIONAL);
        let find = |name: &str| header.iter().position(|column| *column == name);
        for (i, column) in header.iter().enumerate() {
            ensure!(
                known().any(|name| name == column),
                "unknown column {column:?}; a schedule has {} and may have {}",
                NEEDED.join(","),
                OPTIONAL.join(",")
            );
            ensure!(find(column) == Some(i), "column {column} stands twice");
        }
        let mut needed = [0; NEEDED.len()];
        for (place, name) in needed.iter_mut().zip(NEEDED) {
            *place = find(name).ok_or_else(|| anyhow!("column {name} is missing"))?;
        }
        Ok(Self {
            needed,
            optional: OPTIONAL.map(find),
            width: header.len(),
        })
    }

    /// A row with its time as it was written, s.
    fn row(&self, record: &[&str]) -> Result<(f64, Row)> {
        ensure!(
            record.len() == self.width,
            "{} fields, but the header has {}",
            record.len(),
            self.width
        );
        let number =
            |column: usize, limit| number(NEEDED[column], record[self.needed[column]], limit);
        let brake = |brake: usize| match self.optional[brake] {
            None => Ok(false),
            Some(place) => switch(OPTIONAL[brake], record[place]),
        };
        let t_s = number(0, LONGEST_S)?;
        let row = Row {
            tick: nanoseconds(t_s).div_ceil(STEP_NS),
            torque: BySection {
                uw: number(1, LARGEST_N_M)?,
                rd: number(2, LARGEST_N_M)?,
                fd: number(3, LARGEST_N_M)?,
                rr: number(4, LARGEST_N_M)?,
            },
            brakes: Brakes {
                uw: brake(0)?,
                rd: brake(1)?,
                fd: brake(2)?,
            },
        };
        Ok((t_s, row))
    }
}

/// A number in ±`limit`.
fn number(column: &str, field: &str, limit: f64) -> Result<f64> {
    let value: f64 = field
        .parse()
        .map_err(|_| anyhow!("{column} = {field:?} is not a number"))?;
    ensure!(
        value.abs() <= limit,
        "{column} = {field} is outside ±{limit}"
    );
    Ok(value)
}

/// 0 or 1.
fn switch(column: &str, field: &str) -> Result<bool> {
    match field {
        "0" => Ok(false),
        "1" => Ok(true),
        _ => bail!("{column} = {field:?} is neither 0 nor 1"),
    }
}

/// An expression for the number of spans of a machine, which it has as a constant.
macro_rules! with_spans {
    ($spans:expr, |$SPANS:ident| $body:expr) => {
        with_spans!(@arms $spans, $SPANS, $body, 2 3 4 5 6 7)
    };
    (@arms $spans:expr, $SPANS:ident, $body:expr, $($few:literal)*) => {
        match $spans {
            $($few => {
                const $SPANS: usize = $few;
                $body
            })*
            _ => {
                const $SPANS: usize = model_core::machine::MAX_SPANS;
                $body
            }
        }
    };
}
pub(crate) use with_spans;

/// What takes a winder on.
trait Pace<R: real::Scalar> {
    /// By at most so many steps, and at least one, under held actuators; tells by how many.
    fn advance<const SPANS: usize>(
        &self,
        winder: &mut Winder<R, SPANS>,
        actuators: &Actuators<R::Si>,
        most: u64,
    ) -> u64;
}

/// Step by step.
struct Steps;

impl<R: real::Scalar> Pace<R> for Steps {
    fn advance<const SPANS: usize>(
        &self,
        winder: &mut Winder<R, SPANS>,
        actuators: &Actuators<R::Si>,
        _: u64,
    ) -> u64 {
        winder.step(actuators);
        1
    }
}

impl Pace<f64> for Strider {
    fn advance<const SPANS: usize>(
        &self,
        winder: &mut Winder<f64, SPANS>,
        actuators: &Actuators<f64>,
        most: u64,
    ) -> u64 {
        Strider::advance(self, winder, actuators, most)
    }
}

/// [`simulate_spans`] with the machine's number of spans.
fn simulate<R: real::Scalar>(
    machine: &Machine,
    schedule: &Schedule,
    every: u64,
    pace: &impl Pace<R>,
    out: &mut dyn Write,
) -> Result<Run> {
    with_spans!(machine.idle.len() + 1, |SPANS| {
        simulate_spans::<R, SPANS>(machine, schedule, every, pace, out)
    })
}

/// Runs the plant and writes a row at the start and every `every` steps.
fn simulate_spans<R: real::Scalar, const SPANS: usize>(
    machine: &Machine,
    schedule: &Schedule,
    every: u64,
    pace: &impl Pace<R>,
    out: &mut dyn Write,
) -> Result<Run> {
    let mut winder = at_start::<R, SPANS>(machine)?;
    writeln!(out, "t_s,{}", columns(SPANS))?;
    write_row(out, 0, &winder)?;
    let mut run = Run {
        rows: schedule.end() / every + 1,
        events: Vec::new(),
    };
    if winder.substeps() > 1 {
        let note = "light rolls or short spans make the web too fast for one";
        let steps = winder.substeps();
        run.events
            .push(format!("{steps} steps of integration in 4 ms: {note}"));
    }
    let mut before = Incidents::of(&winder);
    for (row, steps) in schedule.rows() {
        let actuators = Actuators {
            torque: row.torque.map(R::Si::of),
            brakes: row.brakes,
            ..Actuators::default()
        };
        let mut step = steps.start;
        while step < steps.end {
            // no further than the row goes, and the next one of the output
            let most = (steps.end - step).min(every - step % every);
            step += pace.advance(&mut winder, &actuators, most);
            let now = Incidents::of(&winder);
            if now != before {
                let time = seconds(step);
                let events = now.since(&before).map(|what| format!("{time} s: {what}"));
                let room = MOST_EVENTS.saturating_sub(run.events.len());
                run.events.extend(events.take(room));
                before = now;
            }
            if step.is_multiple_of(every) {
                write_row(out, step, &winder)?;
            }
        }
    }
    Ok(run)
}

/// The columns of a state: speeds of the rolls, tensions of the spans behind them, radii.
pub(crate) fn columns(spans: usize) -> String {
    let idle: Vec<_> = match spans {
        LUMPED => vec!["gr".into(), "sr".into()],
        spans => (1..spans).map(|roll| roll.to_string()).collect(),
    };
    let columns = |prefix| idle.iter().map(move |roll| format!("{prefix}_{roll},"));
    let (v, t): (String, String) = (columns("v").collect(), columns("t").collect());
    format!("v_uw,{v}v_rd,t_uw,{t}r_uw,r_wu")
}

/// The winder as every run begins with it: threaded at stall tension.
pub(crate) fn at_start<R: real::Scalar, const SPANS: usize>(
    machine: &Machine,
) -> Result<Winder<R, SPANS>, MachineError> {
    let mut winder = Winder::new(machine, H)?;
    winder.thread_at(R::Si::of(stall_tension(machine)));
    Ok(winder)
}

/// Tension at standstill, N.
pub(crate) fn stall_tension(machine: &Machine) -> f64 {
    machine.operation.stall_share * machine.operation.tension_n_m * machine.web.width_m
}

/// The time of a step, s.
pub(crate) fn seconds(step: u64) -> f64 {
    (step * u64::from(PLANT_PERIOD_MS)) as f64 / 1e3
}

/// One row of the output.
fn write_row<R: real::Scalar, const SPANS: usize>(
    out: &mut dyn Write,
    step: u64,
    winder: &Winder<R, SPANS>,
) -> io::Result<()> {
    writeln!(out, "{:?},{}", seconds(step), fields_of(winder))
}

/// A state, in the order of [`columns`]. `Debug` gives the shortest digits that read back as the same number.
pub(crate) fn fields_of<R: real::Scalar, const SPANS: usize>(winder: &Winder<R, SPANS>) -> String {
    let (x, t) = (winder.state(), winder.tension());
    let mut fields = format!("{:?}", x.omega_uw * x.r_uw);
    for value in x.v.into_iter().chain(t).chain([x.r_uw, x.r_wu]) {
        fields += &format!(",{value:?}");
    }
    fields
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = "t_s,T_uw,T_rd,T_fd,T_rr";

    fn read(text: &str) -> Result<Schedule> {
        Schedule::read("s.csv", text.as_bytes())
    }

    #[test]
    fn bad_schedules_are_refused_with_file_line_and_reason() {
        for (text, reason) in [
            ("", "s.csv:1: there is no row"),
            ("{}\n", "s.csv:2: there is no row"),
            (
                "t_s,T_uw,T_rd,T_fd\n0,0,0,0",
                "s.csv:1: column T_rr is missing",
            ),
            ("{},T_xx\n", "s.csv:1: unknown column \"T_xx\""),
            ("{},T_uw\n", "s.csv:1: column T_uw stands twice"),
            ("0,0,0,0,0\n", "s.csv:1: unknown column \"0\""),
            (
                "{}\n0.1,0,0,0,0",
                "s.csv:2: t_s = 0.1: the first row must be at 0",
            ),
            (
                "{}\n-1,0,0,0,0",
                "s.csv:2: t_s = -1: the first row must be at 0",
            ),
            (
                "{}\n0,0,0,0,0\n2,0,0,0,0\n\n1,0,0,0,0",
                "s.csv:5: t_s = 1 does not come after 2",
            ),
            (
                "{}\n0,0,0,0,0\n0,1,0,0,0",
                "s.csv:3: t_s = 0 does not come after 0",
            ),
            ("{}\n0,x,0,0,0", "s.csv:2: T_uw = \"x\" is not a number"),
            ("{}\n0,,0,0,0", "s.csv:2: T_uw = \"\" is not a number"),
            ("{}\n0,0,NaN,0,0", "s.csv:2: T_rd = NaN is outside ±1000000"),
            (
                "{}\n0,0,0,-inf,0",
                "s.csv:2: T_fd = -inf is outside ±1000000",
            ),
            (
                "{}\n0,0,0,0,1e39",
                "s.csv:2: T_rr = 1e39 is outside ±1000000",
            ),
            (
                "{}\n0,0,0,0,0\n1e9,0,0,0,0",
                "s.csv:3: t_s = 1e9 is outside ±1000000",
            ),
            ("{}\n0,0,0,0\n", "s.csv:2: 4 fields, but the header has 5"),
            (
                "{}\n0,0,0,0,0,\n",
                "s.csv:2: 6 fields, but the header has 5",
            ),
            (
                "{},brake_rd\n0,0,0,0,0,on",
                "s.csv:2: brake_rd = \"on\" is neither 0 nor 1",
            ),
            (
                "{}\n0,0,0,0,\u{0}",
                "s.csv:2: T_rr = \"\\0\" is not a number",
            ),
        ] {
            let text = text.replace("{}", HEADER);
            let error = format!("{:#}", read(&text).expect_err(&text));
            assert!(error.starts_with(reason), "{text:?}: {error}");
        }
        let error = Schedule::read("s.csv", &b"t_s\xff"[..]).unwrap_err();
        assert!(format!("{error:#}").starts_with("s.csv:1: "), "{error:#}");
    }

    #[test]
    fn columns_stand_in_any_order_with_spaces_quotes_and_empty_lines() {
        let plain = read(&format!("{HEADER},brake_fd\n0,1,2,3,4,0\n0.5,-1,0,0,0,1")).unwrap();
        let other = "\u{feff}T_fd, brake_fd, T_rd,\"T_rr\", T_uw, t_s\r\n\r\n3,0,2,4,1e0,0\r\n0,1,0,0,-1,.5\r\n";
        assert_eq!(read(other).unwrap(), plain);
    }

    /// A time between two steps counts for the later one.
    #[test]
    fn a_row_holds_from_the_first_step_at_or_after_its_time() {
        for (t_s, step) in [
            ("0.004", 1),
            ("0.012", 3),
            ("0.005", 2),
            ("0.3", 75),
            ("4.1", 1025),
            ("1e5", 25_000_000),
        ] {
            let schedule = read(&format!("{HEADER}\n0,0,0,0,0\n{t_s},0,0,0,0")).unwrap();
            assert_eq!(schedule.end(), step, "{t_s}");
        }
    }

    #[test]
    fn the_output_period_is_a_multiple_of_the_step() {
        for (every_s, steps) in [(0.004, 1), (0.1, 25), (1.0, 250), (0.012, 3), (0.7, 175)] {
            assert_eq!(output_period(every_s).unwrap(), steps, "{every_s}");
        }
        for every_s in [0.0, -1.0, 0.001, 0.01, 1e-300, f64::NAN, f64::INFINITY, 1e7] {
            let error = output_period(every_s).unwrap_err().to_string();
            assert!(error.starts_with(&format!("--every {every_s} ")), "{error}");
        }
    }

    #[test]
    fn what_happens_to_web_and_roll_is_told_with_its_time() {
        let mut machine = Machine::news_8000();
        machine.nips.slip = true;
        machine.nips.friction = 0.05;
        let schedule = read(&format!(
            "{HEADER}\n0,0,180,180,0\n1,4000,180,3400,0\n9,0,0,9e5,0\n10,0,0,0,0"
        ));
        let run = simulate::<f64>(&machine, &schedule.unwrap(), 250, &Steps, &mut io::sink());
        let run = run.unwrap();
        assert_eq!(run.rows, 11);
        let told = |what: &str| run.events.iter().find(|event| event.ends_with(what));
        let slip = told("the front drum loses traction").unwrap();
        let time: f64 = slip.split(' ').next().unwrap().parse().unwrap();
        assert!((1.0..1.2).contains(&time), "{slip}");
        assert!(run.events.len() <= MOST_EVENTS);
    }
}
