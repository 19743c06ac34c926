//! `winder accept`

use std::env;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result};
use model_core::machine::Machine;

use crate::accept::attend::Page;
use crate::accept::controller::{Controller, StPlc};
use crate::accept::world::{self, Live, Lockstep};
use crate::accept::{Outcome, accept, matrix};
use crate::link::resolve;

/// Which PLC, and where the report goes.
#[derive(Clone, Debug, clap::Args)]
#[command(group(clap::ArgGroup::new("which").required(true).args(["address", "program", "matrix"])))]
pub struct Args {
    /// Modbus TCP of the running simulator to which the PLC is wired
    #[arg(value_name = "HOST:PORT")]
    address: Option<String>,
    /// A program in Structured Text instead, run on the simulator's clock: host-tests/plc/winder.st is one
    #[arg(long, value_name = "FILE.st")]
    program: Option<PathBuf>,
    /// Say what to do at the PLC's own desk, where it does not read the simulator's
    #[arg(long, conflicts_with = "program")]
    ask: bool,
    /// Wait for runs that are asked for on the simulator's page, at this address; its password is read from
    /// WINDER_PASSWORD
    #[arg(
        long,
        value_name = "http://HOST:PORT",
        requires = "address",
        conflicts_with = "ask"
    )]
    attend: Option<String>,
    /// Run the reference program with each seeded error, and compare which check finds which
    #[arg(long)]
    matrix: bool,
    /// Keep the table as it is now
    #[arg(long, requires = "matrix")]
    bless: bool,
    /// Write all that was seen to this file, too
    #[arg(long, value_name = "RUN.csv")]
    trace: Option<PathBuf>,
    /// Directory of the report: accept.html and accept.xml (JUnit)
    #[arg(long, value_name = "DIR", default_value = "out")]
    out: PathBuf,
}

/// Runs the acceptance run; exit status 1 if it has findings, or could not see everything.
pub fn main(args: &Args) -> Result<ExitCode> {
    if args.matrix {
        return compare(args.bless);
    }
    if let (Some(page), Some(address)) = (&args.attend, &args.address) {
        return attend(page, address, &args.out);
    }
    let (what, outcome) = match (&args.program, &args.address) {
        (Some(file), _) => program(file)?,
        (None, Some(address)) => live(address, args.ask)?,
        // the command line asks for one of them
        (None, None) => return Ok(ExitCode::FAILURE),
    };
    write(&outcome, &what, &args.out)?;
    if let Some(path) = &args.trace {
        let cannot = || format!("cannot write {}", path.display());
        fs::write(path, outcome.csv()).with_context(cannot)?;
    }
    let mut out = io::stdout().lock();
    for (check, seen, at) in outcome.findings() {
        let at = at.map_or(String::new(), |t| format!(" (at {t:.1} s)"));
        writeln!(out, "{}  {}\n     {seen}{at}", check.id, check.requirement)?;
        writeln!(out, "     likely causes: {}", check.causes)?;
    }
    let unseen: Vec<_> = outcome.not_seen().map(|(check, _)| check.id).collect();
    if !unseen.is_empty() {
        writeln!(out, "not seen: {}", unseen.join(" "))?;
    }
    for episode in &outcome.course.episodes {
        if let Some(why) = &episode.stuck {
            writeln!(out, "\"{}\" did not come to its end: {why}", episode.name)?;
        }
    }
    writeln!(out, "{}", outcome.summary())?;
    writeln!(out, "report: {}", args.out.join("accept.html").display())?;
    Ok(if outcome.passed() {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

fn compare(bless: bool) -> Result<ExitCode> {
    let table = matrix::table(&matrix::rows()?);
    print!("{table}");
    let path = matrix::golden();
    if bless {
        if let Some(directory) = path.parent() {
            fs::create_dir_all(directory)?;
        }
        fs::write(&path, &table).with_context(|| format!("cannot write {}", path.display()))?;
    }
    let kept =
        fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
    if kept == table {
        return Ok(ExitCode::SUCCESS);
    }
    println!("it is not as {} has it", path.display());
    Ok(ExitCode::FAILURE)
}

fn program(file: &Path) -> Result<(String, Outcome)> {
    let name = file.display();
    let text = fs::read_to_string(file).with_context(|| format!("cannot read {name}"))?;
    let plc = StPlc::new(&text).with_context(|| format!("{name}"))?;
    let mut world =
        Lockstep::new(&Machine::news_8000(), plc).context("the machine cannot be simulated")?;
    let outcome = accept(&mut world);
    if let Some(why) = world.plc.stopped() {
        eprintln!("winder: the program has stopped: {name}, {why}");
    }
    let what = file.file_name().unwrap_or_default().to_string_lossy();
    Ok((what.into_owned(), outcome))
}

/// Runs what is asked for on the page, until Ctrl-C.
fn attend(page: &str, address: &str, out: &Path) -> Result<ExitCode> {
    let password = env::var("WINDER_PASSWORD").context(
        "the page's password is not there: set WINDER_PASSWORD to what was chosen on the page",
    )?;
    let page = Page::log_in(page, &password)?;
    let place = resolve(address)?;
    println!("waiting for a request on the page");
    loop {
        let (request, outcome) = page.attend(place)?;
        write(&outcome, &what(address), out)?;
        let report = out.join("accept.html");
        println!(
            "request {request}: {}; {}",
            outcome.summary(),
            report.display()
        );
    }
}

fn what(address: &str) -> String {
    format!("PLC at the simulator {address}")
}

fn live(address: &str, ask: bool) -> Result<(String, Outcome)> {
    let mut world = Live::connect(resolve(address)?, ask.then(world::typed))?;
    Ok((what(address), accept(&mut world)))
}

fn write(outcome: &Outcome, what: &str, out: &Path) -> Result<()> {
    let put = |name: &str, text: String| {
        let path = out.join(name);
        fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))
    };
    fs::create_dir_all(out)
        .with_context(|| format!("cannot make the directory {}", out.display()))?;
    put("accept.html", outcome.html(what))?;
    put("accept.xml", outcome.junit(what))
}
