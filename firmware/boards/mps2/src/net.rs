//! The network: one Ethernet interface with a static address, a TCP server on the Modbus port, and the HMI's.
//!
//! Does not know what is said on a connection: the library does. There is no DHCP.

use embassy_executor::Spawner;
use embassy_net::{Config, Ipv4Address, Ipv4Cidr, Runner, Stack, StackResources, StaticConfigV4};
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use firmware::link::Service;
use firmware::net::{self, Places};
use static_cell::StaticCell;

use crate::http::{self, LocalDesk};
use crate::lan9118::Lan9118;

/// The first guest's address on QEMU's user network; QEMU forwards a port of the host to it.
const ADDRESS: Ipv4Cidr = Ipv4Cidr::new(Ipv4Address::new(10, 0, 2, 15), 24);
const GATEWAY: Ipv4Address = Ipv4Address::new(10, 0, 2, 2);

const SOCKETS: usize = net::MODBUS_SOCKETS + http::SOCKETS;

/// What the background's tasks share: they take turns, so a lock need not keep anything off.
pub type LocalService = Service<'static, NoopRawMutex>;

/// Starts the network. Runs in the background, where everything of the network stays.
pub fn start(spawner: Spawner, service: LocalService, desk: &'static LocalDesk) {
    static RESOURCES: StaticCell<StackResources<SOCKETS>> = StaticCell::new();
    static PLACES: StaticCell<Places<NoopRawMutex>> = StaticCell::new();

    let Ok(driver) = Lan9118::start() else {
        defmt::error!("no LAN9118: no network");
        return;
    };
    let config = Config::ipv4_static(StaticConfigV4 {
        address: ADDRESS,
        gateway: Some(GATEWAY),
        dns_servers: Default::default(),
    });
    // QEMU's network is private: nobody there guesses sequence numbers.
    let seed = 0;
    let (stack, runner) =
        embassy_net::new(driver, config, RESOURCES.init(StackResources::new()), seed);

    spawner.spawn(run(runner).expect("one runner"));
    let places = &*PLACES.init(Places::new());
    for _ in 0..net::MODBUS_SOCKETS {
        spawner.spawn(serve_modbus(stack, service, places).expect("as many tasks as sockets"));
    }
    http::start(spawner, stack, service, desk);
}

#[embassy_executor::task]
async fn run(mut runner: Runner<'static, Lan9118>) -> ! {
    runner.run().await
}

#[embassy_executor::task(pool_size = net::MODBUS_SOCKETS)]
async fn serve_modbus(
    stack: Stack<'static>,
    service: LocalService,
    places: &'static Places<NoopRawMutex>,
) -> ! {
    net::serve_modbus(stack, service, places).await
}
