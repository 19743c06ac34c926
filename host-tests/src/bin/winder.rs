//! `winder`: the one command line tool of the simulator.

use std::process::ExitCode;

use anyhow::Result;
use clap::{Parser, Subcommand};
use host_tests::command::{
    accept, bench, conformance, demo, figures, flash, fuzz, lesson, machine, plc, replay, run,
    scenario, signals, size, test, timing,
};
use host_tests::interrupt::{self, Interrupted};
use host_tests::plant;

/// A winder for a PLC to control: unwind, web, drums, shipping roll and their electric drives, simulated in real
/// time on a microcontroller, in QEMU or on this PC.
#[derive(Debug, Parser)]
#[command(name = "cargo winder", bin_name = "cargo winder", version)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Wind a set of paper: start the simulator, command it as a winder PLC would, show what came of it
    ///
    /// Installs and builds what is missing. Exit status 1: a limit was missed, or the set was not wound.
    Demo(demo::Args),
    /// Run the simulator alone, for your PLC
    ///
    /// Prints `ready modbus=ADDRESS:PORT http=http://ADDRESS:PORT` on a line of its own once it answers; ends with Ctrl-C.
    Run(run::Args),
    /// Install what is missing and run every test, on the host and in QEMU
    Test,
    /// Play scenarios: timed commands, faults and what is expected, faster than real time
    ///
    /// Without a file, all that ship. Exit status 1: something was not as expected.
    Scenario(scenario::Args),
    /// Find what is wrong with a winder PLC: plays operator and faults, watches what the PLC does, writes a report
    ///
    /// Exit status 1: something was found, or could not be seen.
    Accept(accept::Args),
    /// Run a program in Structured Text as a winder PLC of its own, wired to a running simulator
    ///
    /// Without a program, the reference winder PLC. Ends with Ctrl-C.
    Plc(plc::Args),
    /// Learn to operate the winder: a goal, hints and a score, at the desk of the PLC that ships
    ///
    /// Without a name, lists the lessons. Exit status 1: not all points.
    Lesson(lesson::Args),
    /// Play a recording again and compare it, to the bit
    Replay(replay::Args),
    /// Draw the paper's figures 7 to 14 and those of the physics, each with what to compare
    Figures(figures::Args),
    /// Count the instructions of a plant step on three microcontrollers in QEMU, and time it on this PC
    ///
    /// Installs and builds what is missing; what cannot be had is named, and the rest is measured.
    Bench(bench::Args),
    /// Flash the firmware to a NUCLEO-H743ZI2 and show its log until Ctrl-C
    ///
    /// Builds it; says what is missing when probe-rs or the board is not there.
    Flash(flash::Args),
    /// Measure the firmware's tasks in QEMU on three cores under several loads, the same in every run
    ///
    /// Installs and builds what is missing. Exit status 1: a bar was missed, or something is not as kept.
    Timing(timing::Args),
    /// Print what the firmware takes of the memories, and compare it with what is kept
    Size(size::Args),
    /// Run the winder alone, open loop, from a schedule of torques
    Plant(plant::Options),
    /// Print a machine as a file: every parameter with its unit, limits and description
    ///
    /// The file is what `--machine` takes. One of your own names a preset and what differs from it.
    Machine(machine::Args),
    /// Give arbitrary bytes to the link's codec, stream and serial line
    ///
    /// Exit status 1: an invariant did not hold; the input that broke it is named.
    Fuzz(fuzz::Args),
    /// Look whether a Modbus TCP server does what the specification wants, case by case
    ///
    /// Without an address, the simulator's own. Exit status 1: a case failed.
    Conformance(conformance::Args),
    /// Print the signal list as CSV
    Signals(signals::Args),
}

/// What a shell says of a program that Ctrl-C has ended: 128 + SIGINT.
const INTERRUPTED: u8 = 130;

fn main() -> ExitCode {
    run(Cli::parse()).unwrap_or_else(|error| {
        eprintln!("error: {error:#}");
        ExitCode::from(if error.is::<Interrupted>() {
            INTERRUPTED
        } else {
            1
        })
    })
}

fn run(cli: Cli) -> Result<ExitCode> {
    match cli.command {
        Command::Signals(args) => signals::main(&args),
        Command::Machine(args) => machine::main(&args),
        Command::Scenario(args) => scenario::main(&args),
        Command::Accept(args) => interrupt::install().and_then(|()| accept::main(&args)),
        Command::Plc(args) => interrupt::install().and_then(|()| plc::main(&args)),
        Command::Lesson(args) => interrupt::install().and_then(|()| lesson::main(&args)),
        Command::Replay(args) => replay::main(&args),
        Command::Figures(args) => figures::main(&args),
        Command::Plant(options) => {
            plant::run(&options, &mut std::io::stdout().lock())?;
            Ok(ExitCode::SUCCESS)
        }
        // the others start processes, which must end with this one
        Command::Demo(args) => interrupt::install().and_then(|()| demo::main(&args)),
        Command::Run(args) => interrupt::install().and_then(|()| run::main(args)),
        Command::Fuzz(args) => interrupt::install().and_then(|()| fuzz::main(&args)),
        Command::Conformance(args) => interrupt::install().and_then(|()| conformance::main(&args)),
        Command::Bench(args) => interrupt::install().and_then(|()| bench::main(&args)),
        Command::Flash(args) => interrupt::install().and_then(|()| flash::main(&args)),
        Command::Timing(args) => interrupt::install().and_then(|()| timing::main(&args)),
        Command::Size(args) => interrupt::install().and_then(|()| size::main(args)),
        Command::Test => interrupt::install().and_then(|()| test::main()),
    }
}
