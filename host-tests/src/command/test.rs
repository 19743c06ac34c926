//! `winder test`

use std::process::ExitCode;
use std::time::Instant;

use anyhow::Result;

use crate::interrupt;
use crate::report::minutes;
use crate::setup::{self, TARGET, TARGET_SOFT, Warnings};

type Stage = (&'static str, fn() -> Result<()>);

/// Installs what is missing and runs every test there is.
pub fn main() -> Result<ExitCode> {
    let stages: [Stage; 8] = [
        ("formatting", || cargo(&["fmt", "--all", "--check"])),
        ("lints", lints),
        // as developed, where an overflow is a panic
        ("the libraries' tests", || {
            cargo(&[
                "test",
                "-p",
                "model-core",
                "-p",
                "firmware",
                "-p",
                "board-host",
                "-p",
                "offline",
            ])
        }),
        ("firmware builds without warnings", || {
            setup::mps2_with(Warnings::Denied)?;
            setup::counter(Warnings::Denied)?;
            setup::nucleo_h743zi2(Warnings::Denied)?;
            setup::nucleo_f207zg(Warnings::Denied)?;
            setup::tracer(Warnings::Denied)?;
            setup::mps2_for(TARGET_SOFT, Warnings::Denied)?;
            setup::twin(TARGET, Warnings::Denied)?;
            setup::twin(TARGET_SOFT, Warnings::Denied).map(drop)
        }),
        // as released: the libraries of this build are those of the tool that runs it
        ("on this PC and in QEMU", || {
            cargo(&[
                "test",
                "--release",
                "-p",
                "host-tests",
                "--features",
                "qemu",
            ])
        }),
        // one at a time: each has a simulator and a browser of its own
        ("the page in a browser", || {
            let browser = ["--features", "qemu", "--test", "browser"];
            let test = ["test", "--release", "-p", "host-tests"];
            cargo(&[&test[..], &browser, &["--", "--test-threads", "1"]].concat())
        }),
        ("fuzzing the link", super::fuzz::check),
        ("timing and sizes", || {
            super::timing::check()?;
            super::size::check()
        }),
    ];
    // what needs the network first: better no start than a late stop
    setup::qemu()?;
    setup::chromium()?;
    setup::mbpoll()?;
    setup::pymodbus()?;
    setup::soft_plc()?;
    setup::ip()?;
    setup::target(TARGET)?;
    setup::target(TARGET_SOFT)?;
    let began = Instant::now();
    let mut failed = Vec::new();
    let mut summary = String::new();
    for (name, stage) in stages {
        let stage_began = Instant::now();
        eprintln!("winder: {name} …");
        let outcome = stage();
        interrupt::check()?;
        let verdict = match outcome {
            Ok(()) => "ok",
            Err(error) => {
                eprintln!("winder: {error:#}");
                failed.push(name);
                "FAILED"
            }
        };
        let time = minutes(stage_began.elapsed().as_secs_f64());
        summary += &format!("  {name:34} {verdict:6} {time}\n");
    }
    let time = minutes(began.elapsed().as_secs_f64());
    print!("\n{summary}");
    if failed.is_empty() {
        println!("winder test: all passed in {time}");
        return Ok(ExitCode::SUCCESS);
    }
    println!("winder test: FAILED after {time}: {}", failed.join(", "));
    Ok(ExitCode::FAILURE)
}

/// Clippy, which must be of the compiler's own version: with a toolchain put together from packages it may not be.
///
/// Not of the boards: they are built without warnings anyway, and to lint them their libraries would have to be read once
/// more for each target. `docs/board.md` tells how to.
fn lints() -> Result<()> {
    let minor = |program, arguments: &[&str]| setup::minor_version(program, arguments);
    let (rustc, clippy) = (minor("rustc", &["-V"])?, minor("cargo", &["clippy", "-V"])?);
    if rustc != clippy {
        eprintln!("winder: no lints: rustc is 1.{rustc}, clippy for 1.{clippy}");
        return Ok(());
    }
    cargo(&["clippy", "--all-targets", "--", "-D", "warnings"])?;
    let plugins = ["qemu-pace", "qemu-count", "qemu-trace", "qemu-plugin"];
    let named = plugins.into_iter().flat_map(|plugin| ["-p", plugin]);
    let mut arguments = vec!["clippy", "--release"];
    arguments.extend(named);
    arguments.extend(["--", "-D", "warnings"]);
    cargo(&arguments)
}

fn cargo(arguments: &[&str]) -> Result<()> {
    setup::run(setup::cargo().args(arguments))
}
