//! The simulator's tasks on this board: the library's, in fixed point.

use core::cell::RefCell;

use cortex_m::peripheral::DWT;
use embassy_executor::Spawner;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_time::Instant;
use firmware::SPANS;
use firmware::life::Started;
use firmware::link::control::Control;
use firmware::link::{ControlCell, ImageCell};
use firmware::tasks::{self, Stopwatch};
use model_core::drive::Drive;
use model_core::fixed::Word;
use model_core::image::{Commands, Feedback, Image};
use model_core::logic::Logic;
use model_core::machine::Machine;
use model_core::simulator::Plant;
use static_cell::StaticCell;

use crate::net::{self, LocalService};
use crate::watchdog;

/// What the tasks hand to each other.
pub type Exchange = tasks::Exchange<Word>;

type LocalImage = ImageCell<NoopRawMutex>;

/// The core's own count of its cycles.
struct Cycles;

impl Stopwatch for Cycles {
    const PER_US: u32 = crate::CORE_MHZ;

    fn count() -> u32 {
        DWT::cycle_count()
    }
}

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
pub async fn background(exchange: &'static Exchange, ethernet: net::Resources) {
    static IMAGE: StaticCell<LocalImage> = StaticCell::new();
    static CONTROL: StaticCell<ControlCell<NoopRawMutex>> = StaticCell::new();

    let image = &*IMAGE.init(ImageCell::new(RefCell::new(Image {
        commands: Commands::of(&machine()),
        feedback: Feedback::default(),
    })));
    let control = &*CONTROL.init(ControlCell::new(RefCell::new(Control::default())));
    // SAFETY: an embassy executor polls this task.
    let spawner = unsafe { Spawner::for_current_executor() }.await;
    spawner.spawn(logic(exchange, image).expect("first"));
    net::start(spawner, ethernet, LocalService { image, control });
}

#[embassy_executor::task]
async fn logic(exchange: &'static Exchange, image: &'static LocalImage) {
    tasks::logic::<Cycles, _, _>(
        &mut Logic::new(&machine()),
        exchange,
        image,
        &mut (),
        &mut (),
    )
    .await;
}
