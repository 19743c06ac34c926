//! The simulator's tasks on this board: the library's, in fixed point.

use board_cortex_m::Log;
use board_cortex_m::net::{LocalServed, LocalService, start_modbus};
use board_stm32::ethernet::{self, OTHER_SOCKETS};
use board_stm32::watchdog;
use embassy_executor::Spawner;
use embassy_net::StackResources;
use embassy_stm32::eth::PacketQueue;
use embassy_time::Instant;
use firmware::SPANS;
use firmware::life::Started;
use firmware::net::MODBUS_SOCKETS;
use firmware::store::Network;
use firmware::tasks;
use model_core::drive::Drive;
use model_core::fixed::Word;
use model_core::logic::Logic;
use model_core::machine::Machine;
use model_core::simulator::Plant;
use static_cell::StaticCell;

/// What the tasks hand to each other.
pub type Exchange = tasks::Exchange<Word>;
type Cycles = board_stm32::Cycles<{ crate::CORE_MHZ }>;

/// What the tasks share, made once.
pub fn exchange(started: Started) -> &'static Exchange {
    static EXCHANGE: StaticCell<Exchange> = StaticCell::new();
    EXCHANGE.init(Exchange::new(&watchdog::LIFE, started))
}

fn machine() -> Machine {
    Machine::news_8000()
}

/// The plant, every 4 ms.
#[embassy_executor::task]
pub async fn plant(start: Instant, exchange: &'static Exchange) {
    match Plant::<Word, SPANS>::new(&machine()) {
        Ok(mut plant) => tasks::plant::<Cycles, _>(start, &mut plant, exchange).await,
        Err(error) => defmt::panic!("{=str} = {=f64}", error.parameter, error.value),
    }
}

/// The regulators, every 10 ms.
#[embassy_executor::task]
pub async fn drive(start: Instant, exchange: &'static Exchange) {
    tasks::drive::<Cycles, _>(start, &mut Drive::new(&machine()), exchange).await;
}

/// Everything that may wait: logic and network.
#[embassy_executor::task]
pub async fn background(exchange: &'static Exchange, pins: ethernet::Pins) {
    static SERVED: StaticCell<LocalServed> = StaticCell::new();
    static FRAMES: StaticCell<PacketQueue<4, 6>> = StaticCell::new();
    static RESOURCES: StaticCell<StackResources<{ MODBUS_SOCKETS + OTHER_SOCKETS }>> =
        StaticCell::new();

    let service = SERVED.init_with(|| LocalServed::new(&machine())).service();
    // SAFETY: an embassy executor polls this task.
    let spawner = unsafe { Spawner::for_current_executor() }.await;
    spawner.spawn(logic(exchange, service).expect("first"));
    let frames = ethernet::frames(FRAMES.uninit());
    let resources = RESOURCES.init(StackResources::new());
    let stack = ethernet::start(spawner, pins, frames, resources, Network::Dhcp);
    start_modbus(spawner, stack, service);
}

#[embassy_executor::task]
async fn logic(exchange: &'static Exchange, service: LocalService) {
    let mut logic = Logic::new(&machine());
    let image = service.image;
    tasks::logic::<Cycles, _, _>(&mut logic, exchange, image, &mut Log, &mut (), None).await;
}
