//! The model alone on QEMU's `mps2` boards: Cortex-M7 (`an500`), M4F (`an386`) and M3 (`an385`).
//!
//! Not here: tasks, network, clock. The program computes one run as fast as it can and ends QEMU.
//!
//! What it runs is QEMU's command line (`-semihosting-config arg=…`), three words:
//!
//! - `wind SCALAR short` or `wind SCALAR set`: the course of [`model_core::twin`], open loop
//! - `operate SCALAR plc`: the whole simulator under the PLC of the same module
//! - `count SCALAR MACHINE`: steps, regulators and logic of a preset between marks, for the counting plugin
//!
//! It prints, by semihosting, a line for each phase: name, steps, and hash in hex. Exit code 1 says that it could
//! not run; the last line then says why.

#![no_std]
#![no_main]

mod count;
mod marks;
mod system;

// How memory is copied.
use board_copy as _;
use cortex_m_semihosting::{debug, hprintln};
use model_core::fixed::Word;
use model_core::real::Scalar;
use model_core::twin::{self, Extent};

/// What can be run in one scalar.
struct Runs {
    wind: fn(Extent) -> Result<(), Error>,
    operate: fn() -> Result<(), Error>,
    count: fn(&str) -> Result<(), Error>,
}

/// Every scalar by its name.
const SCALARS: &[(&str, Runs)] = &[
    ("f32", runs::<f32>()),
    ("f64", runs::<f64>()),
    ("fixed", runs::<Word>()),
];

const fn runs<R: Scalar>() -> Runs {
    Runs {
        wind: wind::<R>,
        operate: operate::<R>,
        count: count::count::<R>,
    }
}

/// Why there is no run.
enum Error {
    /// These words mean nothing.
    Unknown,
    /// A machine is outside its limits.
    Machine(model_core::machine::MachineError),
}

fn wind<R: Scalar>(extent: Extent) -> Result<(), Error> {
    twin::wind::<R>(extent, |phase, record| {
        hprintln!(
            "{} {} {:08x}",
            phase.name(),
            record.ticks,
            record.trajectory
        );
    })
    .map_err(Error::Machine)
}

fn operate<R: Scalar>() -> Result<(), Error> {
    twin::operate::<R>(|record| hprintln!("plc {} {:08x}", record.ticks, record.trajectory))
        .map_err(Error::Machine)
}

fn run(line: &str) -> Result<(), Error> {
    let mut words = line.split_ascii_whitespace();
    let (Some(what), Some(scalar), Some(which), None) =
        (words.next(), words.next(), words.next(), words.next())
    else {
        return Err(Error::Unknown);
    };
    if (what, scalar, which) == ("copy", "bytes", "all") {
        let (times, hash) = twin::copies();
        hprintln!("copies {} {:08x}", times, hash);
        return Ok(());
    }
    let Some((_, runs)) = SCALARS.iter().find(|(name, _)| *name == scalar) else {
        return Err(Error::Unknown);
    };
    match (what, which) {
        ("wind", "short") => (runs.wind)(Extent::Short),
        ("wind", "set") => (runs.wind)(Extent::Set),
        ("operate", "plc") => (runs.operate)(),
        ("count", machine) => (runs.count)(machine),
        _ => Err(Error::Unknown),
    }
}

#[cortex_m_rt::entry]
fn main() -> ! {
    let mut buffer = [0; 64];
    let line = system::command_line(&mut buffer);
    let status = match run(line) {
        Ok(()) => debug::EXIT_SUCCESS,
        Err(Error::Unknown) => {
            hprintln!("no run is called {:?}", line);
            debug::EXIT_FAILURE
        }
        Err(Error::Machine(error)) => {
            hprintln!(
                "{} = {} is outside {} to {}",
                error.parameter,
                error.value,
                error.low,
                error.high
            );
            debug::EXIT_FAILURE
        }
    };
    system::end(status)
}
