//! `winder scenario`

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::net::{SocketAddr, ToSocketAddrs};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use anyhow::{Context, Result, ensure};

use crate::scenario::lockstep::{self, Outcome};
use crate::scenario::player::Player;
use crate::scenario::record::Recorder;
use crate::scenario::{Scenario, Step, live, seconds, shipped};

/// What to play, and where.
#[derive(Clone, Debug, clap::Args)]
pub struct Args {
    /// Scenario files; without any, all that ship (host-tests/scenarios)
    #[arg(value_name = "FILE.toml")]
    files: Vec<PathBuf>,
    /// Play on the simulator that runs there (Modbus TCP), instead of one in this process
    #[arg(long, value_name = "HOST:PORT")]
    connect: Option<String>,
    /// Write every command with its drive cycle to this file, for `cargo winder replay`
    #[arg(long, value_name = "RUN.csv", conflicts_with = "connect")]
    record: Option<PathBuf>,
    /// Tell every step as it begins
    #[arg(long, short)]
    verbose: bool,
}

/// Plays scenarios; exit status 1 if anything was not as expected.
pub fn main(args: &Args) -> Result<ExitCode> {
    match play(args, &mut io::stdout().lock()) {
        Ok(0) => Ok(ExitCode::SUCCESS),
        Ok(_) => Ok(ExitCode::FAILURE),
        // whoever reads us has seen enough
        Err(error) if is_broken_pipe(&error) => Ok(ExitCode::SUCCESS),
        Err(error) => Err(error),
    }
}

fn is_broken_pipe(error: &anyhow::Error) -> bool {
    let io = error.downcast_ref::<io::Error>();
    io.is_some_and(|error| error.kind() == io::ErrorKind::BrokenPipe)
}

/// Gives the number of scenarios that went otherwise than expected.
fn play(args: &Args, out: &mut dyn Write) -> Result<usize> {
    let files = if args.files.is_empty() {
        shipped()?
    } else {
        args.files.clone()
    };
    let address = args.connect.as_deref().map(resolve).transpose()?;
    ensure!(
        args.record.is_none() || files.len() == 1,
        "--record takes the run of one scenario, not of {}",
        files.len()
    );
    // all are read before the first is played
    let scenarios: Result<Vec<_>> = files.iter().map(|file| Scenario::open(file)).collect();
    let scenarios = scenarios?;
    let width = scenarios.iter().map(|s| s.name.chars().count()).max();
    let width = width.unwrap_or_default();
    let mut failed = 0;
    for scenario in &scenarios {
        let began = Instant::now();
        let mut teller = Teller::new(args.verbose);
        let outcome = match (address, &args.record) {
            (Some(address), _) => live::play(scenario, address, |player| teller.look(player, out))?,
            (None, Some(path)) => recorded(scenario, path, |player| teller.look(player, out))?,
            (None, None) => lockstep::play(scenario, |_, player| teller.look(player, out))?,
        };
        teller.told?;
        let took = began.elapsed().as_secs_f64();
        tell(scenario, &outcome, took, width, out)?;
        if let Some(path) = &args.record {
            let (cycles, trajectory) = (outcome.cycles, outcome.trajectory);
            let path = path.display();
            writeln!(
                out,
                "{path}: {cycles} drive cycles, trajectory {trajectory:08x}"
            )?;
        }
        failed += usize::from(!outcome.failures.is_empty());
    }
    if scenarios.len() > 1 {
        let all = scenarios.len();
        writeln!(out, "{} of {all} as expected", all - failed)?;
    }
    Ok(failed)
}

fn tell(
    scenario: &Scenario,
    outcome: &Outcome,
    took_s: f64,
    width: usize,
    out: &mut dyn Write,
) -> io::Result<()> {
    let simulated = seconds(outcome.cycles);
    let verdict = if outcome.failures.is_empty() {
        "ok"
    } else {
        "FAILED"
    };
    writeln!(
        out,
        "{:<width$}  {verdict:<6}  {simulated:>8.2} s  {:>5.0} times real time  {}",
        scenario.name,
        simulated / took_s.max(f64::MIN_POSITIVE),
        scenario.title
    )?;
    outcome
        .failures
        .iter()
        .try_for_each(|failure| writeln!(out, "    {failure}"))
}

/// Plays a scenario and writes what it commanded.
fn recorded<'a>(
    scenario: &'a Scenario,
    path: &Path,
    mut look: impl FnMut(&Player<'a>),
) -> Result<Outcome> {
    let cannot = || format!("cannot write {}", path.display());
    let file = BufWriter::new(File::create(path).with_context(cannot)?);
    let mut recorder = Recorder::new(file, &scenario.machine).with_context(cannot)?;
    let mut written = Ok(());
    let outcome = lockstep::play(scenario, |bench, player| {
        look(player);
        if written.is_ok() {
            written = recorder.look(bench);
        }
    })?;
    written
        .and_then(|()| recorder.finish())
        .with_context(cannot)?;
    Ok(outcome)
}

/// Tells every step as it begins.
struct Teller<'a> {
    verbose: bool,
    step: Option<&'a Step>,
    told: io::Result<()>,
}

impl<'a> Teller<'a> {
    fn new(verbose: bool) -> Self {
        Self {
            verbose,
            step: None,
            told: Ok(()),
        }
    }

    fn look(&mut self, player: &Player<'a>, out: &mut dyn Write) {
        let Some(step) = player.step().filter(|_| self.verbose) else {
            return;
        };
        let known = self.step.replace(step);
        if self.told.is_ok() && !known.is_some_and(|known| std::ptr::eq(known, step)) {
            let say = step.say.as_deref().unwrap_or_default();
            let time = seconds(player.now());
            self.told = writeln!(out, "{time:>9.2} s  {}  {say}", step.at);
        }
    }
}

fn resolve(address: &str) -> Result<SocketAddr> {
    let wrong = || format!("--connect {address} is not HOST:PORT");
    let mut found = address.to_socket_addrs().with_context(wrong)?;
    found.next().with_context(wrong)
}
