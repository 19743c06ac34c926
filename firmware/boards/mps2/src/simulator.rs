//! The simulator's tasks on this board: the library's, given their place.
//!
//! Does not compute anything and does not know the machine beyond its settings.

// A task that spawns on its own executor needs embassy's unsafe spawner.
#![allow(unsafe_code)]

use board_cortex_m::Log;
use board_cortex_m::net::{LocalDesk, LocalServed, LocalService};
use embassy_executor::Spawner;
use embassy_time::Instant;
use firmware::SPANS;
use firmware::hmi::desk::{AtDesk, Board, Books};
use firmware::life::Started;
use firmware::store::{Keeper, Store};
use firmware::tasks::{self, Hands};
use model_core::drive::Drive;
use model_core::logic::Logic;
use model_core::machine::Machine;
use model_core::restart::Restart;
use model_core::simulator::Plant;
use static_cell::{ConstStaticCell, StaticCell};

use crate::settings::Flash;
use crate::trace::Traced;
use crate::watchdog;

/// What the simulator computes with: floating point on a core that has it.
#[cfg(target_abi = "eabihf")]
pub type Scalar = f32;
/// What the simulator computes with: fixed point on a core without floating-point unit.
#[cfg(not(target_abi = "eabihf"))]
pub type Scalar = model_core::fixed::Word;

/// Its name.
pub const SCALAR: &str = if cfg!(target_abi = "eabihf") {
    "f32"
} else {
    "fixed point"
};

type Exchange = tasks::Exchange<Scalar>;

/// What the tasks share, made once.
pub fn exchange(started: Started) -> &'static Exchange {
    static EXCHANGE: StaticCell<Exchange> = StaticCell::new();
    EXCHANGE.init(Exchange::new(&watchdog::LIFE, started))
}

/// The plant, every 4 ms.
#[embassy_executor::task]
pub async fn plant(start: Instant, machine: &'static Machine, exchange: &'static Exchange) {
    match Plant::<Scalar, SPANS>::new(machine) {
        Ok(mut plant) => tasks::plant::<Traced, _>(start, &mut plant, exchange).await,
        Err(error) => defmt::panic!("{=str} = {=f64}", error.parameter, error.value),
    }
}

/// The regulators, every 10 ms.
#[embassy_executor::task]
pub async fn drive(start: Instant, machine: &'static Machine, exchange: &'static Exchange) {
    tasks::drive::<Traced, _>(start, &mut Drive::new(machine), exchange).await;
}

/// What the background gets of the start.
pub struct Given {
    pub started: Started,
    pub store: Option<Store<Flash>>,
    pub keeper: Keeper,
}

/// Everything that may wait: logic, settings, network, and the beat for the pace.
#[embassy_executor::task]
pub async fn background(machine: &'static Machine, exchange: &'static Exchange, given: Given) {
    static SERVED: StaticCell<LocalServed> = StaticCell::new();
    static DESK: StaticCell<LocalDesk> = StaticCell::new();
    static BOOKS: ConstStaticCell<Books> = ConstStaticCell::new(Books::new());

    let service = SERVED.init_with(|| LocalServed::new(machine)).service();
    let board = Board {
        name: "Cortex-M in QEMU (mps2)",
        version: env!("CARGO_PKG_VERSION"),
        reset: Restart::TEXTS[usize::from(given.started.why.number())],
        connections: (crate::net::HTTP_SOCKETS - 1) as u16,
        memory: board_cortex_m::memory::used,
    };
    let (_, line) = given.keeper.in_use();
    let desk = &*DESK.init(LocalDesk::new(board, given.keeper, BOOKS.take()));
    // SAFETY: an embassy executor polls this task.
    let spawner = unsafe { Spawner::for_current_executor() }.await;
    spawner.spawn(logic(machine, exchange, service, desk).expect("first"));
    spawner.spawn(crate::pace::pace().expect("first"));
    spawner.spawn(watchdog::feed().expect("first"));
    if let Some(store) = given.store {
        spawner.spawn(crate::settings::keep(store, desk).expect("first"));
    }
    crate::serial::start(spawner, service, line.address);
    crate::net::start(spawner, service, desk);
}

#[embassy_executor::task]
async fn logic(
    machine: &'static Machine,
    exchange: &'static Exchange,
    service: LocalService,
    desk: &'static LocalDesk,
) {
    let control = service.control;
    let mut at_desk = AtDesk { control, desk };
    let (mut logic, mut hands) = (Logic::new(machine), Hands::default());
    tasks::logic::<Traced, _, _>(
        &mut logic,
        exchange,
        service.image,
        &mut Log,
        &mut at_desk,
        Some(&mut hands),
    )
    .await;
}
