//! `winder fuzz`

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use anyhow::{Result, ensure};

use crate::interrupt;
use crate::setup;

/// The targets, each with its invariants at its head.
const TARGETS: [&str; 3] = ["pdu", "stream", "serial"];
/// Executions of a target in a run of all tests: some seconds.
const SHORT: u64 = 500_000;
/// Longest input, bytes: more than the longest frame.
const LONGEST: &str = "600";

/// The coverage that the fuzzer follows, with the flags of a stable compiler.
const FLAGS: &str = "--cfg fuzzing -Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 \
    -Cllvm-args=-sanitizer-coverage-inline-8bit-counters -Cllvm-args=-sanitizer-coverage-pc-table \
    -Cllvm-args=-sanitizer-coverage-trace-compares -Ccodegen-units=1";
/// Named, so that build scripts are not compiled with these flags.
const TRIPLE: &str = "x86_64-unknown-linux-gnu";

/// What to fuzz, and for how long.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// pdu, stream or serial; without a name, all
    #[arg(value_parser = TARGETS)]
    target: Option<String>,
    /// Executions of each target
    #[arg(long, default_value_t = 10_000_000)]
    runs: u64,
}

/// Fuzzes until a finding or the end.
pub fn main(args: &Args) -> Result<ExitCode> {
    let chosen = |name: &&str| args.target.as_deref().is_none_or(|target| target == *name);
    run(TARGETS.into_iter().filter(chosen), args.runs)?;
    Ok(ExitCode::SUCCESS)
}

/// The short run of all tests.
pub fn check() -> Result<()> {
    run(TARGETS, SHORT)
}

fn run(targets: impl IntoIterator<Item = &'static str>, runs: u64) -> Result<()> {
    let package = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz");
    let built = setup::scratch("fuzz")?;
    let mut build = setup::cargo();
    build
        .args(["build", "--release", "--target", TRIPLE])
        .arg("--manifest-path")
        .arg(package.join("Cargo.toml"))
        .env("RUSTFLAGS", FLAGS)
        .env("CARGO_TARGET_DIR", &built);
    setup::run(&mut build)?;
    for target in targets {
        interrupt::check()?;
        let program: PathBuf = [
            &built,
            Path::new(TRIPLE),
            Path::new("release"),
            Path::new(target),
        ]
        .iter()
        .collect();
        let corpus = package.join("corpus").join(target);
        ensure!(corpus.is_dir(), "there is no corpus {}", corpus.display());
        // new inputs go to a directory of their own: the committed ones are chosen by hand
        let found = setup::scratch(&format!("fuzz-{target}"))?;
        std::fs::create_dir_all(&found)?;
        let mut fuzz = Command::new(program);
        fuzz.arg(&found)
            .arg(&corpus)
            .args([&format!("-runs={runs}"), "-close_fd_mask=1", "-verbosity=0"])
            .arg(format!("-max_len={LONGEST}"))
            .arg(format!("-artifact_prefix={}/", found.display()));
        eprintln!("winder: fuzzing {target}, {runs} executions …");
        setup::run(&mut fuzz)?;
    }
    Ok(())
}
