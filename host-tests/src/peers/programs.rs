//! The peers' programs: what they need, how they are built and run.
//!
//! Not here: what they compute.

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, Result, ensure};

use super::{result, source};
use crate::setup;

/// What a program is compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Processor {
    /// The one that it runs on: for time.
    Native,
    /// One with AVX2: valgrind knows no wider registers, so instructions are counted on this.
    Common,
}

impl Processor {
    fn name(self) -> &'static str {
        match self {
            Processor::Native => "native",
            Processor::Common => "x86-64-v3",
        }
    }
}

/// How a program is made.
#[derive(Clone, Copy, Debug)]
enum Kind {
    Rust,
    C {
        compiler: &'static str,
        source: &'static str,
        libraries: &'static [&'static str],
        package: &'static str,
    },
    Python,
}

/// A program of one or more peers.
#[derive(Clone, Copy, Debug)]
pub struct Program {
    /// What it is called.
    pub name: &'static str,
    kind: Kind,
}

const fn c(
    name: &'static str,
    compiler: &'static str,
    source: &'static str,
    libraries: &'static [&'static str],
    package: &'static str,
) -> Program {
    Program {
        name,
        kind: Kind::C {
            compiler,
            source,
            libraries,
            package,
        },
    }
}

/// All of them.
pub const PROGRAMS: &[Program] = &[
    Program {
        name: "Rust",
        kind: Kind::Rust,
    },
    c("C by hand", "gcc", "c/plain.c", &[], "gcc"),
    c("Boost odeint", "g++", "c/odeint.cpp", &[], "libboost-dev"),
    c("GSL", "gcc", "c/gsl.c", &["gsl", "gslcblas"], "libgsl-dev"),
    c(
        "SUNDIALS",
        "gcc",
        "c/sundials.c",
        &["sundials_arkode", "sundials_cvode", "sundials_nvecserial"],
        "libsundials-dev",
    ),
    Program {
        name: "SciPy",
        kind: Kind::Python,
    },
];

/// A program that can be run.
#[derive(Debug)]
pub struct Built {
    line: Vec<PathBuf>,
    versions: Vec<(String, String)>,
}

impl Program {
    /// Builds it, installs what that takes; nothing where this processor is of no use to it.
    pub fn build(&self, processor: Processor) -> Result<Option<Built>> {
        let dir = setup::scratch("peers")?.join(processor.name());
        fs::create_dir_all(&dir)
            .with_context(|| format!("cannot make the directory {}", dir.display()))?;
        match self.kind {
            Kind::Rust => rust(&dir, processor).map(Some),
            Kind::C {
                compiler,
                source: file,
                libraries,
                package,
            } => {
                let path = dir.join(self.name.replace(' ', "-"));
                let compile = || {
                    let mut command = Command::new(compiler);
                    command
                        .args(["-O3", "-ffp-contract=off"])
                        .arg(format!("-march={}", processor.name()))
                        .arg("-o")
                        .args([&path, &source(file)])
                        .args(libraries.iter().map(|library| format!("-l{library}")))
                        .arg("-lm");
                    said(&mut command)
                };
                let install = || setup::debian(package, self.name, package);
                compile().or_else(|_| install().and_then(|()| compile()))?;
                let version = said(Command::new(&path).arg("--version"))?;
                Ok(Some(Built {
                    line: vec![path],
                    versions: vec![(String::new(), version.trim().to_owned())],
                }))
            }
            Kind::Python if processor == Processor::Common => Ok(None),
            Kind::Python => python(&dir).map(Some),
        }
    }
}

fn rust(dir: &Path, processor: Processor) -> Result<Built> {
    eprintln!(
        "winder: building the peers in Rust for {} …",
        processor.name()
    );
    let manifest = source("rust/Cargo.toml");
    let mut command = setup::cargo();
    command
        .args([
            "build",
            "--release",
            "--quiet",
            "--locked",
            "--manifest-path",
        ])
        .arg(&manifest)
        .arg("--target-dir")
        .arg(dir)
        .env("RUSTFLAGS", format!("-C target-cpu={}", processor.name()));
    said(&mut command)
        .context("cannot build the peers in Rust, for which crates.io must be reachable")?;
    // as many versions as there are crates, from the lock file
    let lock =
        fs::read_to_string(source("rust/Cargo.lock")).context("cannot read the lock file")?;
    let version = |name: &str| {
        let mut lines = lock
            .lines()
            .skip_while(|line| *line != format!("name = {name:?}"));
        let version = lines.nth(1)?.strip_prefix("version = ")?;
        Some((name.to_owned(), version.trim_matches('"').to_owned()))
    };
    Ok(Built {
        line: vec![dir.join("release/peers")],
        versions: ["ode_solvers", "diffsol"]
            .iter()
            .filter_map(|name| version(name))
            .collect(),
    })
}

fn python(dir: &Path) -> Result<Built> {
    let venv = dir.join("venv");
    let python = venv.join("bin/python");
    let has = || said(Command::new(&python).args(["-c", "import scipy"]));
    if has().is_err() {
        eprintln!("winder: installing SciPy (pip) …");
        let wanted = "SciPy needs Python with venv and pip, and PyPI: apt-get install python3-venv";
        said(Command::new("python3").args(["-m", "venv"]).arg(&venv)).context(wanted)?;
        said(Command::new(&python).args(["-m", "pip", "install", "--quiet", "scipy"]))
            .context(wanted)?;
    }
    let script = source("python/scipy_peer.py");
    let version = said(Command::new(&python).arg(&script).arg("--version"))?;
    Ok(Built {
        line: vec![python, script],
        versions: vec![(String::new(), version.trim().to_owned())],
    })
}

impl Built {
    /// An interpreter runs it.
    pub fn interpreted(&self) -> bool {
        self.line.len() > 1
    }

    /// The version of a library in it.
    pub fn version(&self, library: &str) -> &str {
        let found = self
            .versions
            .iter()
            .find(|(name, _)| name.is_empty() || name == library);
        found.map_or("–", |(_, version)| version)
    }

    /// CPU time of the quickest of some runs, s, and the states.
    pub fn run(
        &self,
        problem: &Path,
        method: &str,
        setting: f64,
        runs: u32,
        out: &Path,
    ) -> Result<(f64, Vec<f64>)> {
        let mut command = Command::new(&self.line[0]);
        command.args(&self.line[1..]);
        result(
            arguments(&mut command, problem, method, setting, runs, out),
            out,
        )
    }

    /// Instructions of a run, less those of starting and reading.
    pub fn count(&self, problem: &Path, method: &str, setting: f64, out: &Path) -> Result<f64> {
        let of = |runs| {
            let mut command = Command::new("valgrind");
            // what is bound at the first call would count to the run
            command
                .env("LD_BIND_NOW", "1")
                .args([
                    "--tool=cachegrind",
                    "--cache-sim=no",
                    "--cachegrind-out-file=/dev/null",
                ])
                .args(&self.line);
            arguments(&mut command, problem, method, setting, runs, out);
            let text = told(&mut command)?;
            let refs = text.lines().find_map(|line| {
                line.split_once("refs:")
                    .map(|(_, count)| count.replace(',', ""))
            });
            let refs = refs.context("valgrind told no count")?;
            refs.trim()
                .parse::<f64>()
                .with_context(|| format!("{refs:?} is no count"))
        };
        Ok(of(1)? - of(0)?)
    }
}

fn arguments<'a>(
    command: &'a mut Command,
    problem: &Path,
    method: &str,
    setting: f64,
    runs: u32,
    out: &Path,
) -> &'a mut Command {
    command
        .arg(problem)
        .arg(method)
        .arg(setting.to_string())
        .arg(runs.to_string())
        .arg(out)
}

/// What a program says on stdout; it must succeed.
pub fn said(command: &mut Command) -> Result<String> {
    both(command).map(|(out, _)| out)
}

/// The same on stderr.
fn told(command: &mut Command) -> Result<String> {
    both(command).map(|(_, err)| err)
}

fn both(command: &mut Command) -> Result<(String, String)> {
    let name = Path::new(command.get_program())
        .file_name()
        .map(OsStr::to_owned)
        .unwrap_or_default();
    let name = name.to_string_lossy().into_owned();
    let output = command
        .stdin(Stdio::null())
        .output()
        .with_context(|| format!("cannot start {name}"))?;
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    let err = text(&output.stderr);
    let last = err
        .lines()
        .rev()
        .find(|line| !line.trim().is_empty())
        .unwrap_or_default();
    ensure!(
        output.status.success(),
        "{name} failed ({}): {last}",
        output.status
    );
    Ok((text(&output.stdout), err))
}
