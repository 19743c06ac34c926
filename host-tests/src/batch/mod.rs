//! Many runs of the plant at once: a machine in many variations under one schedule, on all cores.
//!
//! Not here: a single run, which has rows over time; the winder itself.
//!
//! In single precision sixteen winders go side by side in the lanes of vector registers, see [`group`]; each has the
//! bits of a run by itself. What comes of a run is a row of CSV:
//!
//! - the varied parameters, named as in a machine file;
//! - `largest_t`, `largest_t_s`, `smallest_t`: the largest tension in any span of the whole web, N, its time, s, and
//!   the smallest;
//! - the speeds, tensions and radii at the end, as [`plant`] names them;
//! - `web_break_s`, `slip_s`, `burst_s`: when the web broke, when a roll of the windup first lost traction, when the
//!   shipping roll burst, s; empty where it did not. The last two are known only of machines that may slip or whose
//!   layers compress. A web that breaks has no tension at the end of that step: `largest_t` is the one before.

pub mod group;
pub mod lanes;
pub mod sweep;

use std::collections::BTreeMap;
use std::fs::File;
use std::hint::black_box;
use std::io::{self, BufWriter, IsTerminal, Write};
use std::ops::Range;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, Result};
use indicatif::{ProgressBar, ProgressStyle};
use model_core::fixed::Word;
use model_core::machine::Machine;
use model_core::real;

use crate::plant::{
    Options, Scalar, Schedule, columns, fields_of, seconds, stall_tension, with_spans,
};
use group::{Progress, Run, alone, side_by_side};
use lanes::LANES;
use sweep::Sweep;

/// The most runs that a core takes at a time.
const LARGEST_SHARE: usize = 256;
/// Shares of a core at least, so that all cores end at about the same time.
const SHARES: usize = 4;
/// How often the progress bar moves.
const BAR_EVERY: Duration = Duration::from_millis(100);
/// Where there is no terminal for a progress bar, a line so often.
const LINE_EVERY: Duration = Duration::from_secs(5);

/// Reads sweep and schedule, runs everything, writes a row for each run in the order of the sweep.
///
/// `console` gets a line about what was done, or the rows themselves when the output file is `-`. Nothing is written
/// before sweep, schedule and options have been found good.
pub fn run(options: &Options, sweep: &Path, console: &mut dyn Write) -> Result<()> {
    let sweep = Sweep::open(sweep, options.machine.as_deref())?;
    let schedule = Schedule::open(&options.schedule)?;
    let batch = Batch {
        sweep: &sweep,
        schedule: &schedule,
        scalar: options.scalar.unwrap_or(Scalar::F32),
        progress: Progress::default(),
    };
    let path = options.out.display();
    let began = Instant::now();
    if options.out.as_os_str() == "-" {
        return batch.write(console);
    }
    let cannot = || format!("cannot write {path}");
    let file = File::create(&options.out).with_context(cannot)?;
    let mut file = BufWriter::new(file);
    batch.write(&mut file)?;
    file.flush().with_context(cannot)?;
    let took = began.elapsed().as_secs_f64();
    let (runs, each) = (sweep.runs(), seconds(schedule.end()));
    writeln!(
        console,
        "{path}: {runs} runs of {each} s in {took:.1} s: {:.0} times real time",
        runs as f64 * each / took
    )?;
    Ok(())
}

/// Everything that a core needs to do its share.
struct Batch<'a> {
    sweep: &'a Sweep,
    schedule: &'a Schedule,
    scalar: Scalar,
    progress: Progress,
}

/// The rows of a share, or what has gone wrong.
type Rows = Result<Vec<String>>;

impl Batch<'_> {
    /// Does all runs on all cores and writes their rows in order.
    fn write(&self, out: &mut dyn Write) -> Result<()> {
        writeln!(out, "{}", self.header())?;
        let runs = self.sweep.runs();
        let cores = thread::available_parallelism().map_or(1, usize::from);
        let share = share(runs, cores);
        let next = AtomicUsize::new(0);
        let (sender, receiver) = mpsc::channel();
        thread::scope(|scope| {
            for _ in 0..cores.min(runs.div_ceil(share)) {
                let (sender, next) = (sender.clone(), &next);
                scope.spawn(move || {
                    loop {
                        let start = next.fetch_add(share, Ordering::Relaxed);
                        let rows = match start {
                            start if start < runs => self.rows(start..runs.min(start + share)),
                            _ => break,
                        };
                        let failed = rows.is_err();
                        if sender.send((start, rows)).is_err() || failed {
                            break;
                        }
                    }
                });
            }
            drop(sender);
            let written = self.collect(out, &receiver);
            // whoever has not been asked for more need not go on
            self.progress.stop.store(true, Ordering::Relaxed);
            written
        })
    }

    /// Writes rows as they come, in order, and shows how far it is.
    fn collect(&self, out: &mut dyn Write, rows: &mpsc::Receiver<(usize, Rows)>) -> Result<()> {
        let mut display = Display::new(self.sweep.runs(), self.schedule.end());
        let (mut written, mut waiting) = (0, BTreeMap::new());
        loop {
            match rows.recv_timeout(BAR_EVERY) {
                Ok((start, rows)) => {
                    waiting.insert(start, rows?);
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
            while let Some(rows) = waiting.remove(&written) {
                written += rows.len();
                for row in rows {
                    writeln!(out, "{row}")?;
                }
            }
            display.show(self.progress.steps.load(Ordering::Relaxed));
        }
        Ok(())
    }

    fn header(&self) -> String {
        let axes = self.sweep.axes().iter();
        let varied: String = axes
            .map(|axis| format!("{},", axis.parameter.name))
            .collect();
        let end = columns(self.sweep.spans());
        format!("{varied}largest_t,largest_t_s,smallest_t,{end},web_break_s,slip_s,burst_s")
    }

    /// [`Batch::rows_of`] with the machine's number of spans.
    fn rows(&self, runs: Range<usize>) -> Rows {
        with_spans!(self.sweep.spans(), |SPANS| self.rows_of::<SPANS>(runs))
    }

    fn rows_of<const SPANS: usize>(&self, runs: Range<usize>) -> Rows {
        match self.scalar {
            Scalar::F32 => {
                let machines: Vec<_> = runs.clone().map(|run| self.sweep.machine(run)).collect();
                let done = side_by_side::<SPANS>(&machines, self.schedule, &self.progress);
                let done = done.with_context(|| self.of(&runs))?;
                let rows = runs.zip(&done);
                Ok(rows.map(|(run, done)| self.row(run, done)).collect())
            }
            Scalar::F64 => self.rows_alone::<f64, SPANS>(runs),
            Scalar::Fixed => self.rows_alone::<Word, SPANS>(runs),
        }
    }

    fn rows_alone<R: real::Scalar, const SPANS: usize>(&self, runs: Range<usize>) -> Rows {
        let row = |run: usize| {
            let machine = self.sweep.machine(run);
            let done = alone::<R, SPANS>(&machine, self.schedule, &self.progress);
            let done = done.with_context(|| self.of(&(run..run + 1)))?;
            Ok(self.row(run, &done))
        };
        runs.map(row).collect()
    }

    /// Some runs in words.
    fn of(&self, runs: &Range<usize>) -> String {
        self.sweep.describe(runs.start)
    }

    fn row<R: real::Scalar, const SPANS: usize>(&self, run: usize, done: &Run<R, SPANS>) -> String {
        let values: String = self.sweep.values(run).map(|v| format!("{v},")).collect();
        let time = |step: Option<u32>| step.map_or(String::new(), |s| format!("{:?}", at(s)));
        let tension = &done.extremes;
        format!(
            "{values}{:?},{:?},{:?},{},{},{},{}",
            tension.largest,
            at(tension.at),
            tension.smallest,
            fields_of(&done.winder),
            time(done.web_break),
            time(done.slip),
            time(done.burst)
        )
    }
}

/// Steps of winders in a second on one core, in single precision.
#[derive(Clone, Copy, Debug)]
pub struct Rates {
    /// Of a winder by itself.
    pub alone: f64,
    /// Of sixteen side by side, together.
    pub side_by_side: f64,
}

impl Rates {
    /// How many times as many they are side by side.
    pub fn ratio(&self) -> f64 {
        self.side_by_side / self.alone
    }
}

/// Measures the rates of a machine on this core: the best of so many rounds, in which both take turns, for other
/// programs may come between.
pub fn rates(machine: &Machine, rounds: usize) -> Result<Rates> {
    with_spans!(machine.idle.len() + 1, |SPANS| {
        rates_of::<SPANS>(machine, rounds)
    })
}

/// How long a winder runs in a round, s.
const ROUND_S: f64 = 160.0;

fn rates_of<const SPANS: usize>(machine: &Machine, rounds: usize) -> Result<Rates> {
    // slowly on from stall tension, so that neither the web breaks nor the roll ends
    let stall = stall_tension(machine);
    let uw = -stall * machine.parent_roll.full_radius_m;
    let rd = 1.5 * stall * machine.rear_drum.radius_m;
    let text = format!("t_s,T_uw,T_rd,T_fd,T_rr\n0,{uw},{rd},0,0\n{ROUND_S},0,0,0,0");
    let schedule = Schedule::read("", text.as_bytes())?;
    let progress = Progress::default();
    let machines = vec![machine.clone(); LANES];
    let steps = schedule.end() as f64;
    let mut best = Rates {
        alone: 0.0,
        side_by_side: 0.0,
    };
    for _ in 0..rounds {
        let began = Instant::now();
        black_box(alone::<f32, SPANS>(machine, &schedule, &progress)?);
        let middle = Instant::now();
        black_box(side_by_side::<SPANS>(&machines, &schedule, &progress)?);
        let rate = |steps: f64, took: Duration| steps / took.as_secs_f64();
        best = Rates {
            alone: best.alone.max(rate(steps, middle - began)),
            side_by_side: best
                .side_by_side
                .max(rate(steps * LANES as f64, middle.elapsed())),
        };
    }
    Ok(best)
}

/// The time after a step, s.
fn at(step: u32) -> f64 {
    seconds(u64::from(step))
}

/// Runs that a core takes at a time: whole groups, and not so many that some cores wait for others.
fn share(runs: usize, cores: usize) -> usize {
    let share = runs / (SHARES * cores);
    share.next_multiple_of(LANES).clamp(LANES, LARGEST_SHARE)
}

/// What is seen of the progress: a bar, or lines where there is no terminal.
struct Display {
    bar: ProgressBar,
    runs: usize,
    all: u64,
    began: Instant,
    next_line: Duration,
}

impl Display {
    fn new(runs: usize, steps: u64) -> Self {
        let all = runs as u64 * steps;
        let bar = ProgressBar::new(all);
        let template = "{wide_bar} {percent:>3}%  {msg}  {eta} left";
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        Self {
            bar,
            runs,
            all,
            began: Instant::now(),
            next_line: LINE_EVERY,
        }
    }

    fn show(&mut self, steps: u64) {
        self.bar.set_position(steps);
        self.bar.set_message(format!("{} runs", self.runs));
        let past = self.began.elapsed();
        if !io::stderr().is_terminal() && past >= self.next_line {
            self.next_line = past + LINE_EVERY;
            let percent = 100 * steps / self.all.max(1);
            eprintln!(
                "winder: {percent} % of {} runs, {:.0} s",
                self.runs,
                past.as_secs_f64()
            );
        }
    }
}

impl Drop for Display {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
