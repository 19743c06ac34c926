//! The paper winder simulator on the dev board NUCLEO-H743ZI2.
//!
//! Does not compute anything: the tasks are the library's. This crate starts the chip and gives the tasks their
//! priorities, their clock, their network, their wires.
//!
//! # Who may preempt whom
//!
//! | Priority | Interrupt | Does |
//! |---|---|---|
//! | 0x10 | `TIM3`, the time driver | wakes the tasks that are due; would only interrupt the plant for tasks that wait for it anyway |
//! | 0x10 | `UART7`, no device's | the plant, then the wires |
//! | 0x20 | `UART8`, no device's | the regulators |
//! | 0x30 | `ETH`, `USART2` | wake the link's tasks |
//! | 0x30 | `SAI1`, no device's | everything else |
//!
//! What they share is a mailbox, which keeps no interrupt off.

#![no_std]
#![no_main]
// The web server's task has a deep type.
#![recursion_limit = "256"]
// Interrupt handlers call into their executors.
#![allow(unsafe_code)]

mod clock;
mod failure;
mod http;
mod memory;
mod net;
mod panel;
mod serial;
mod settings;
mod simulator;
mod watchdog;
mod wires;

// How memory is copied.
use board_copy as _;
// The log: its way out.
use defmt_rtt as _;
use embassy_executor::{InterruptExecutor, Spawner};
use embassy_futures::block_on;
use embassy_stm32::gpio::{Input, Pull};
use embassy_stm32::interrupt;
use embassy_stm32::interrupt::{InterruptExt, Priority};
use embassy_time::{Duration, Instant};
use firmware::store::{Network, Serial};
use model_core::machine::Machine;
use model_core::restart::Restart;
use panel::Panel;
use simulator::Exchange;
use static_cell::StaticCell;
use wires::Wires;

static PLANT: InterruptExecutor = InterruptExecutor::new();
static DRIVE: InterruptExecutor = InterruptExecutor::new();
static BACKGROUND: InterruptExecutor = InterruptExecutor::new();

static MACHINE: StaticCell<Machine> = StaticCell::new();

#[interrupt]
fn UART7() {
    // SAFETY: this is the executor's interrupt, which only its `start` enables.
    unsafe { PLANT.on_interrupt() }
}

#[interrupt]
fn UART8() {
    // SAFETY: as for the plant.
    unsafe { DRIVE.on_interrupt() }
}

#[interrupt]
fn SAI1() {
    // SAFETY: as for the plant.
    unsafe { BACKGROUND.on_interrupt() }
}

/// From switching on to the first activation of the timed tasks: the flash has been read by then.
const SETTLING: Duration = Duration::from_millis(50);

#[cortex_m_rt::entry]
fn main() -> ! {
    let Some(mut core) = cortex_m::Peripherals::take() else {
        unreachable!("the entry point runs once")
    };
    memory::prepare(&mut core);
    let p = embassy_stm32::init(clock::config());
    let started = watchdog::started();
    let reset = Restart::TEXTS[usize::from(started.why.number())];
    defmt::info!(
        "paper winder simulator {=str} on NUCLEO-H743ZI2; {=str}",
        env!("CARGO_PKG_VERSION"),
        reset
    );
    for (interrupt, priority) in [
        (interrupt::TIM3, Priority::P1),
        (interrupt::UART7, Priority::P1),
        (interrupt::UART8, Priority::P2),
        (interrupt::ETH, Priority::P3),
        (interrupt::USART2, Priority::P3),
        (interrupt::SAI1, Priority::P3),
    ] {
        interrupt.set_priority(priority);
    }

    let panel = Panel::new(p.PB0, p.PE1, p.PB14);
    let button = Input::new(p.PC13, Pull::Down);
    // The flash answers at once: there is nothing to wait for.
    let (_store, settings) = block_on(settings::open(p.FLASH, button.is_high()));
    let machine = &*MACHINE.init(settings.machine);
    let wires = Wires::new(
        machine,
        wires::Resources {
            rd: (p.TIM2, p.TIM1, p.PB10, p.PB11),
            uw: (p.TIM5, p.TIM8, p.PA0, p.PA3),
            dac: (p.DAC1, p.PA4),
            wired: p.PG14.into(),
            switches: [p.PG12.into(), p.PF3.into(), p.PE14.into()],
            button,
            relays: [
                p.PE9.into(),
                p.PE11.into(),
                p.PE13.into(),
                p.PD15.into(),
                p.PD14.into(),
            ],
        },
    );
    let ethernet = net::Resources {
        eth: p.ETH,
        sma: (p.ETH_SMA, p.PA2, p.PC1),
        clock: (p.PA1, p.PA7),
        rx: (p.PC4, p.PC5),
        tx: (p.PG13, p.PB13, p.PG11),
        rng: p.RNG,
    };

    let line = serial::Resources {
        usart: p.USART2,
        pins: (p.PD6, p.PD5, p.PD4),
    };

    let start = Instant::now() + SETTLING;
    let timed = [PLANT.start(interrupt::UART7), DRIVE.start(interrupt::UART8)];
    timed[0].spawn(watchdog::run(p.IWDG1).expect("first"));
    let exchange = simulator::start(timed, start, machine, wires, started);
    let background = BACKGROUND.start(interrupt::SAI1);
    background.spawn(
        all_else(
            machine,
            exchange,
            Given {
                panel,
                ethernet,
                network: settings.network,
                line,
                serial: settings.serial,
                reset,
            },
        )
        .expect("first"),
    );

    loop {
        cortex_m::asm::wfi();
    }
}

/// What the background gets of chip and settings.
struct Given {
    panel: Panel,
    ethernet: net::Resources,
    network: Network,
    line: serial::Resources,
    serial: Serial,
    reset: &'static str,
}

/// Everything that may wait: logic, panel, serial line, network.
#[embassy_executor::task]
async fn all_else(machine: &'static Machine, exchange: &'static Exchange, given: Given) {
    // SAFETY: an embassy executor polls this task.
    let spawner = unsafe { Spawner::for_current_executor() }.await;
    let service = simulator::service(machine);
    let desk = simulator::desk(machine, given.reset);
    spawner.spawn(simulator::logic(machine, exchange, service, desk).expect("first"));
    spawner.spawn(panel::run(given.panel, exchange, service).expect("first"));
    serial::start(spawner, given.line, given.serial, service);
    net::start(spawner, given.ethernet, given.network, service, desk);
}
