//! The paper winder simulator on the dev board NUCLEO-H743ZI2.
//!
//! Does not compute anything: the tasks are the library's. This crate starts the chip and gives the tasks their
//! priorities, their clock, their network, their wires.
//!
//! Who may preempt whom, and what they share, is a table of `docs/board.md`.

#![no_std]
#![no_main]
// The web server's task has a deep type.
#![recursion_limit = "256"]
// Interrupt handlers call into their executors.
#![allow(unsafe_code)]

mod clock;
mod links;
mod memory;
mod settings;
mod simulator;
mod wires;

use board_cortex_m::net::{LocalDesk, LocalServed};
use board_cortex_m::settings::open;
use board_stm32::lamps::Lamps;
use board_stm32::watchdog::{self, Reset};
use board_stm32::{ethernet, ethernet_pins};
// The log: its way out.
use defmt_rtt as _;
use embassy_executor::{InterruptExecutor, Spawner};
use embassy_futures::block_on;
use embassy_stm32::gpio::{Input, Pull};
use embassy_stm32::interrupt::{InterruptExt, Priority};
use embassy_stm32::peripherals::IWDG1;
use embassy_stm32::{Peri, interrupt, pac};
use embassy_time::{Duration, Instant};
use firmware::hmi::desk::{Board, Books};
use firmware::store::{Keeper, Store};
use model_core::machine::Machine;
use model_core::restart::Restart;
use settings::Sectors;
use simulator::Exchange;
use static_cell::{ConstStaticCell, StaticCell};

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

/// From the end of the settings' reading to the first activation of the timed tasks.
const SETTLING: Duration = Duration::from_millis(10);

#[cortex_m_rt::entry]
fn main() -> ! {
    let Some(mut core) = cortex_m::Peripherals::take() else {
        unreachable!("the entry point runs once")
    };
    memory::prepare(&mut core);
    // SAFETY: nothing runs yet but this, on the stack that the linker's script has.
    unsafe { board_cortex_m::memory::paint_stack() };
    let p = embassy_stm32::init(clock::config());
    let started = watchdog::started(reset());
    let why = Restart::TEXTS[usize::from(started.why.number())];
    defmt::info!(
        "paper winder simulator {=str} on NUCLEO-H743ZI2; {=str}",
        env!("CARGO_PKG_VERSION"),
        why
    );
    for (interrupt, priority) in [
        (interrupt::TIM3, Priority::P1),
        (interrupt::UART7, Priority::P1),
        (interrupt::UART8, Priority::P2),
        (interrupt::ETH, Priority::P3),
        (interrupt::USART2, Priority::P3),
        (interrupt::RNG, Priority::P3),
        (interrupt::FLASH, Priority::P3),
        (interrupt::SAI1, Priority::P3),
    ] {
        interrupt.set_priority(priority);
    }

    let lamps = Lamps::new([p.PB0.into(), p.PE1.into(), p.PB14.into()]);
    let button = Input::new(p.PC13, Pull::Down);
    let flash = Sectors::new(p.FLASH);
    // Only its repair takes time, which no task needs yet.
    let (store, keeper) = block_on(open(flash, settings::RANGE, button.is_high()));
    let machine = &*MACHINE.init(keeper.settings().machine.clone());
    let wires = wires::new(
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
    let start = Instant::now() + SETTLING;
    let timed = [PLANT.start(interrupt::UART7), DRIVE.start(interrupt::UART8)];
    timed[0].spawn(watch(p.IWDG1).expect("first"));
    let exchange = simulator::start(timed, start, machine, wires, started);
    let background = BACKGROUND.start(interrupt::SAI1);
    background.spawn(
        all_else(
            machine,
            exchange,
            Given {
                lamps,
                ethernet: ethernet_pins!(p),
                line: links::Line {
                    usart: p.USART2,
                    pins: (p.PD6, p.PD5, p.PD4),
                },
                store,
                keeper,
                why,
            },
        )
        .expect("first"),
    );

    loop {
        cortex_m::asm::wfi();
    }
}

/// What the chip knows of its reset. Source: RM0433 rev. 8, section 8.7.37 (RCC_RSR).
fn reset() -> Reset {
    let flags = pac::RCC.rsr().read();
    pac::RCC.rsr().modify(|w| w.set_rmvf(true));
    Reset::of(
        flags.porrstf() || flags.borrstf(),
        flags.iwdg1rstf(),
        flags.sftrstf(),
    )
}

#[embassy_executor::task]
async fn watch(device: Peri<'static, IWDG1>) {
    watchdog::run(device).await
}

/// What the background gets of chip and settings.
struct Given {
    lamps: Lamps,
    ethernet: ethernet::Pins,
    line: links::Line,
    store: Option<Store<Sectors>>,
    keeper: Keeper,
    why: &'static str,
}

/// Everything that may wait: logic, lamps, serial line, network.
#[embassy_executor::task]
async fn all_else(machine: &'static Machine, exchange: &'static Exchange, given: Given) {
    static SERVED: StaticCell<LocalServed> = StaticCell::new();
    static DESK: StaticCell<LocalDesk> = StaticCell::new();
    static BOOKS: ConstStaticCell<Books> = ConstStaticCell::new(Books::new());
    let service = SERVED.init_with(|| LocalServed::new(machine)).service();
    let board = Board {
        name: "NUCLEO-H743ZI2",
        version: env!("CARGO_PKG_VERSION"),
        reset: given.why,
        connections: (links::HTTP_SOCKETS - 1) as u16,
        memory: board_cortex_m::memory::used,
    };
    let (network, serial) = given.keeper.in_use();
    let desk = &*DESK.init(LocalDesk::new(board, given.keeper, BOOKS.take()));
    // SAFETY: an embassy executor polls this task.
    let spawner = unsafe { Spawner::for_current_executor() }.await;
    spawner.spawn(simulator::logic(machine, exchange, service, desk).expect("first"));
    if let Some(store) = given.store {
        spawner.spawn(settings::keep(store, desk).expect("first"));
    }
    links::start_line(spawner, given.line, serial, service);
    links::start_network(spawner, given.ethernet, network, service, desk);
    given
        .lamps
        .run(exchange, service, || desk.is_undecided())
        .await
}
