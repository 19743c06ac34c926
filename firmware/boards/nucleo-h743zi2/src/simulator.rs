//! The simulator's tasks on this board: the library's, given their place.
//!
//! Does not compute anything and does not know the machine beyond its settings.

use core::cell::RefCell;

use cortex_m::peripheral::DWT;
use embassy_executor::SendSpawner;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_time::Instant;
use firmware::hmi::desk::{AtDesk, Board};
use firmware::journal::Journal;
use firmware::life::Started;
use firmware::link::control::Control;
use firmware::link::{ControlCell, ImageCell};
use firmware::tasks::{self, Stopwatch};
use firmware::{SPANS, Scalar};
use model_core::drive::Drive;
use model_core::image::{Commands, Feedback, Image};
use model_core::logic::{Fault, Logic, Mode, Refusal};
use model_core::machine::Machine;
use model_core::simulator::Plant;
use static_cell::StaticCell;

use crate::http::LocalDesk;
use crate::net::LocalService;
use crate::watchdog;
use crate::wires::Wires;

/// What the tasks hand to each other.
pub type Exchange = tasks::Exchange<Scalar>;

/// The core's own count of its cycles.
struct Cycles;

impl Stopwatch for Cycles {
    const PER_US: u32 = crate::clock::CORE_MHZ;

    fn count() -> u32 {
        DWT::cycle_count()
    }
}

/// The timed tasks, each in its executor, from one common start.
pub fn start(
    [plant_at, drive_at]: [SendSpawner; 2],
    start: Instant,
    machine: &'static Machine,
    wires: Wires,
    started: Started,
) -> &'static Exchange {
    static EXCHANGE: StaticCell<Exchange> = StaticCell::new();
    let exchange = &*EXCHANGE.init(Exchange::new(&watchdog::LIFE, started));
    plant_at.spawn(plant(start, machine, exchange).expect("first"));
    // after the plant, which the same alarm wakes
    plant_at.spawn(crate::wires::run(start, wires, exchange).expect("first"));
    drive_at.spawn(drive(start, machine, exchange).expect("first"));
    exchange
}

/// What the links serve, at power-up.
pub fn service(machine: &Machine) -> LocalService {
    static IMAGE: StaticCell<ImageCell<NoopRawMutex>> = StaticCell::new();
    static CONTROL: StaticCell<ControlCell<NoopRawMutex>> = StaticCell::new();
    LocalService {
        image: IMAGE.init(ImageCell::new(RefCell::new(Image {
            commands: Commands::of(machine),
            feedback: Feedback::default(),
        }))),
        control: CONTROL.init(ControlCell::new(RefCell::new(Control::default()))),
    }
}

/// The plant, every 4 ms.
#[embassy_executor::task]
async fn plant(start: Instant, machine: &'static Machine, exchange: &'static Exchange) {
    match Plant::<Scalar, SPANS>::new(machine) {
        Ok(mut plant) => tasks::plant::<Cycles, _>(start, &mut plant, exchange).await,
        Err(error) => defmt::panic!("{=str} = {=f64}", error.parameter, error.value),
    }
}

/// The regulators, every 10 ms.
#[embassy_executor::task]
async fn drive(start: Instant, machine: &'static Machine, exchange: &'static Exchange) {
    tasks::drive::<Cycles, _>(start, &mut Drive::new(machine), exchange).await;
}

/// The drive logic, in the background.
#[embassy_executor::task]
pub async fn logic(
    machine: &'static Machine,
    exchange: &'static Exchange,
    service: LocalService,
    desk: &'static LocalDesk,
) {
    let control = service.control;
    let mut at_desk = AtDesk { control, desk };
    let (mut logic, image) = (Logic::new(machine), service.image);
    tasks::logic::<Cycles, _, _>(&mut logic, exchange, image, &mut Log, &mut at_desk).await;
}

/// The HMI's desk.
pub fn desk(machine: &Machine, reset: &'static str) -> &'static LocalDesk {
    static DESK: StaticCell<LocalDesk> = StaticCell::new();
    let board = Board {
        name: "NUCLEO-H743ZI2",
        version: env!("CARGO_PKG_VERSION"),
        reset,
    };
    DESK.init(LocalDesk::new(board, machine))
}

/// The journal goes to the log.
struct Log;

impl Journal for Log {
    fn command(&mut self, cycle: u32, word: u16, value: u16) {
        defmt::debug!("command {=u32} {=u16} {=u16}", cycle, word, value);
    }

    fn state(&mut self, _: u32, mode: Mode, fault: Fault, refusal: Refusal) {
        let (fault, refusal) = (fault.name(), refusal.name());
        defmt::info!(
            "{=str}; fault: {=str}; refused: {=str}",
            mode.name(),
            fault,
            refusal
        );
    }
}
