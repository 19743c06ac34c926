//! The network: one Ethernet interface with a static address, a TCP server on the Modbus port, and the HMI's.
//!
//! Does not know what is said on a connection: the library does. There is no DHCP.

use board_cortex_m::net::{LocalDesk, LocalService, start_modbus};
use embassy_executor::Spawner;
use embassy_net::{Config, Ipv4Address, Ipv4Cidr, Runner, StackResources, StaticConfigV4};
use firmware::hmi::Hmi;
use firmware::net::MODBUS_SOCKETS;
use static_cell::StaticCell;

use crate::lan9118::Lan9118;

/// The first guest's address on QEMU's user network; QEMU forwards a port of the host to it.
const ADDRESS: Ipv4Cidr = Ipv4Cidr::new(Ipv4Address::new(10, 0, 2, 15), 24);
const GATEWAY: Ipv4Address = Ipv4Address::new(10, 0, 2, 2);

// Each of three browsers has a stream and some connections for what it asks.
board_cortex_m::serve_http!(12);

const SOCKETS: usize = MODBUS_SOCKETS + HTTP_SOCKETS;

/// Starts the network. Runs in the background, where everything of the network stays.
pub fn start(spawner: Spawner, service: LocalService, desk: &'static LocalDesk) {
    static RESOURCES: StaticCell<StackResources<SOCKETS>> = StaticCell::new();

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
    start_modbus(spawner, stack, service);
    start_http(spawner, stack, Hmi { service, desk });
}

#[embassy_executor::task]
async fn run(mut runner: Runner<'static, Lan9118>) -> ! {
    runner.run().await
}
