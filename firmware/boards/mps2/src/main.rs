//! The paper winder simulator on QEMU's `mps2` boards, for any PC: `an500`, a Cortex-M7, `an386`, a Cortex-M4F, and
//! `an385`, a Cortex-M3, each with Ethernet.
//!
//! Does not compute anything: the tasks are the library's. This crate starts the machine and
//! gives the tasks their priorities, their clock and their network.

#![no_std]
#![no_main]
// The web server's task has a deep type.
#![recursion_limit = "256"]
// Interrupt handlers call into their executors.
#![allow(unsafe_code)]

mod failure;
mod interrupts;
mod lan9118;
mod net;
mod pace;
mod register;
mod serial;
mod settings;
mod simulator;
mod stopwatch;
mod time_driver;
mod trace;
mod uart_log;
mod watchdog;

use embassy_executor::InterruptExecutor;
use embassy_time::{Duration, Instant};
use firmware::life::Task;
use interrupts::Interrupt;
use model_core::machine::Machine;
use model_core::restart::Restart;
use simulator::Given;
use static_cell::StaticCell;

static PLANT: InterruptExecutor = InterruptExecutor::new();
static DRIVE: InterruptExecutor = InterruptExecutor::new();
static BACKGROUND: InterruptExecutor = InterruptExecutor::new();

static MACHINE: StaticCell<Machine> = StaticCell::new();

extern "C" fn on_plant() {
    // SAFETY: this is the executor's interrupt, which only `start` enables.
    unsafe { PLANT.on_interrupt() }
}

extern "C" fn on_drive() {
    // SAFETY: as for the plant.
    unsafe { DRIVE.on_interrupt() }
}

extern "C" fn on_background() {
    // SAFETY: as for the plant.
    unsafe { BACKGROUND.on_interrupt() }
}

/// From switching on to the first activation of the timed tasks.
const SETTLING: Duration = Duration::from_millis(10);

#[cortex_m_rt::entry]
fn main() -> ! {
    let Some(mut core) = cortex_m::Peripherals::take() else {
        unreachable!("the entry point runs once")
    };
    failure::guard_stack(&mut core.MPU);
    // SAFETY: nothing runs yet but this, on the stack that the linker's script has.
    unsafe { board_cortex_m::memory::paint_stack() };
    uart_log::start();
    interrupts::set_priorities(&mut core.NVIC);
    time_driver::start();
    stopwatch::start();

    // Before any task runs, so that nothing preempts it: this is as good as the background.
    defmt::info!(
        "paper winder simulator {=str} on mps2, computing in {=str}",
        env!("CARGO_PKG_VERSION"),
        simulator::SCALAR
    );

    let started = watchdog::started();
    if started.why.is_by_itself() {
        defmt::warn!(
            "restarted: {=str}",
            Restart::TEXTS[usize::from(started.why.number())]
        );
    }

    let (store, keeper) = settings::at_start(started);
    let machine = &*MACHINE.init(keeper.settings().machine.clone());

    watchdog::start();
    let start = Instant::now() + SETTLING;
    let plant = PLANT.start(Interrupt::Plant);
    let drive = DRIVE.start(Interrupt::Drive);
    let background = BACKGROUND.start(Interrupt::Background);
    match watchdog::ordered_to_hang(started) {
        Some(Task::Plant) => plant.spawn(watchdog::hang().expect("first")),
        Some(Task::Drive) => drive.spawn(watchdog::hang().expect("first")),
        Some(_) => background.spawn(watchdog::hang().expect("first")),
        None => {}
    }
    let exchange = simulator::exchange(started);
    plant.spawn(simulator::plant(start, machine, exchange).expect("first"));
    drive.spawn(simulator::drive(start, machine, exchange).expect("first"));
    let given = Given {
        started,
        store,
        keeper,
    };
    background.spawn(simulator::background(machine, exchange, given).expect("first"));

    // Not an executor: embassy's idles in WFE, on which QEMU spins.
    loop {
        cortex_m::asm::wfi();
    }
}
