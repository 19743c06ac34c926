//! The Ethernet: an address, and a TCP server on the Modbus port.
//!
//! Does not know what is said on a connection: the library does. An unplugged cable stops nothing: the
//! address comes when the cable does.

use embassy_executor::Spawner;
use embassy_net::{Config, Runner, Stack, StackResources};
use embassy_stm32::eth::{self, Ethernet, GenericPhy, Sma};
use embassy_stm32::peripherals::{
    ETH, ETH_SMA, PA1, PA2, PA7, PB13, PC1, PC4, PC5, PG11, PG13, RNG,
};
use embassy_stm32::rng::{self, Rng};
use embassy_stm32::{Peri, bind_interrupts, uid};
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use firmware::link::Service;
use firmware::net::{self, Places};
use firmware::store::Network;
use static_cell::StaticCell;

use crate::http::{self, LocalDesk};
use crate::{memory, watchdog};

bind_interrupts!(struct Irqs {
    ETH => eth::InterruptHandler;
    RNG => rng::InterruptHandler<RNG>;
});

type Device = Ethernet<'static, ETH, GenericPhy<Sma<'static, ETH_SMA>>>;

/// With that of DHCP.
const SOCKETS: usize = net::MODBUS_SOCKETS + http::SOCKETS + 1;
/// What the background's tasks share: they take turns, so a lock need not keep anything off.
pub type LocalService = Service<'static, NoopRawMutex>;

/// What the Ethernet takes of the chip: RMII as the board is wired (UM2407, table 12), and random numbers.
pub struct Resources {
    /// The controller.
    pub eth: Peri<'static, ETH>,
    /// Its way to the transceiver's registers: MDIO, MDC.
    pub sma: (
        Peri<'static, ETH_SMA>,
        Peri<'static, PA2>,
        Peri<'static, PC1>,
    ),
    /// REF_CLK, CRS_DV.
    pub clock: (Peri<'static, PA1>, Peri<'static, PA7>),
    /// RXD0, RXD1.
    pub rx: (Peri<'static, PC4>, Peri<'static, PC5>),
    /// TXD0, TXD1, TX_EN.
    pub tx: (
        Peri<'static, PG13>,
        Peri<'static, PB13>,
        Peri<'static, PG11>,
    ),
    /// For sequence numbers that nobody guesses.
    pub rng: Peri<'static, RNG>,
}

/// Starts the network. Runs in the background, where everything of the network stays.
pub fn start(
    spawner: Spawner,
    r: Resources,
    network: Network,
    service: LocalService,
    desk: &'static LocalDesk,
) {
    static RESOURCES: StaticCell<StackResources<SOCKETS>> = StaticCell::new();
    static PLACES: StaticCell<Places<NoopRawMutex>> = StaticCell::new();

    let seed = Rng::new(r.rng, Irqs).next_u64();
    let device = Ethernet::new(
        memory::queue(),
        r.eth,
        Irqs,
        r.clock.0,
        r.clock.1,
        r.rx.0,
        r.rx.1,
        r.tx.0,
        r.tx.1,
        r.tx.2,
        net::hardware_address(&uid::uid()),
        r.sma.0,
        r.sma.1,
        r.sma.2,
    );
    let mut config = Config::default();
    config.ipv4 = net::address(network);
    let (stack, runner) =
        embassy_net::new(device, config, RESOURCES.init(StackResources::new()), seed);

    spawner.spawn(run(runner).expect("one runner"));
    if network == Network::Dhcp {
        spawner.spawn(fall_back(stack).expect("first"));
    }
    let places = &*PLACES.init(Places::new());
    for _ in 0..net::MODBUS_SOCKETS {
        spawner.spawn(serve_modbus(stack, service, places).expect("as many tasks as sockets"));
    }
    http::start(spawner, stack, service, desk);
}

#[embassy_executor::task]
async fn run(runner: Runner<'static, Device>) -> ! {
    net::run(runner, &watchdog::LIFE).await
}

#[embassy_executor::task]
async fn fall_back(stack: Stack<'static>) -> ! {
    net::fall_back(stack, |address| {
        defmt::info!("address {}", defmt::Display2Format(&address));
    })
    .await
}

#[embassy_executor::task(pool_size = net::MODBUS_SOCKETS)]
async fn serve_modbus(
    stack: Stack<'static>,
    service: LocalService,
    places: &'static Places<NoopRawMutex>,
) -> ! {
    net::serve_modbus(stack, service, places).await
}
