//! The simulator's tasks on this board: the library's, given their place.
//!
//! Does not compute anything and does not know the machine beyond its settings.

use board_cortex_m::Log;
use board_cortex_m::net::{LocalDesk, LocalService};
use board_stm32::watchdog;
use embassy_executor::SendSpawner;
use embassy_time::Instant;
use firmware::hmi::desk::AtDesk;
use firmware::life::Started;
use firmware::tasks::Hands;
use firmware::{SPANS, Scalar, tasks};
use model_core::drive::Drive;
use model_core::logic::Logic;
use model_core::machine::Machine;
use model_core::simulator::Plant;
use static_cell::StaticCell;

use crate::wires::Wires;

/// What the tasks hand to each other.
pub type Exchange = tasks::Exchange<Scalar>;
type Cycles = board_stm32::Cycles<{ crate::clock::CORE_MHZ }>;

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
    plant_at.spawn(show(start, wires, exchange).expect("first"));
    drive_at.spawn(drive(start, machine, exchange).expect("first"));
    exchange
}

/// The plant, every 4 ms.
#[embassy_executor::task]
async fn plant(start: Instant, machine: &'static Machine, exchange: &'static Exchange) {
    match Plant::<Scalar, SPANS>::new(machine) {
        Ok(mut plant) => tasks::plant::<Cycles, _>(start, &mut plant, exchange).await,
        Err(error) => defmt::panic!("{=str} = {=f64}", error.parameter, error.value),
    }
}

/// The wires, every 4 ms.
#[embassy_executor::task]
async fn show(start: Instant, wires: Wires, exchange: &'static Exchange) {
    wires.run(start, exchange).await;
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
    let (mut logic, mut hands) = (Logic::new(machine), Hands::default());
    tasks::logic::<Cycles, _, _>(
        &mut logic,
        exchange,
        service.image,
        &mut Log,
        &mut at_desk,
        Some(&mut hands),
    )
    .await;
}
