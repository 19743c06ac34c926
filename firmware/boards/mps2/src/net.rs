//! The network: one Ethernet interface with a static address, a TCP server on the Modbus port, and the HMI's.
//!
//! Does not know what is said on a connection: the library's session does. There is no DHCP, no IPv6 and no
//! queue of connections: with every socket busy the next client is refused.

use embassy_executor::Spawner;
use embassy_net::tcp::TcpSocket;
use embassy_net::{
    Config, IpAddress, Ipv4Address, Ipv4Cidr, Runner, Stack, StackResources, StaticConfigV4,
};
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_time::{Duration, with_timeout};
use firmware::link::Service;
use firmware::link::control::{Peer, Protocol};
use firmware::link::modbus::tcp::{End, Timeouts, session};
use firmware::link::seats::Seats;
use static_cell::StaticCell;

use crate::http::{self, LocalDesk};
use crate::lan9118::Lan9118;

/// The first guest's address on QEMU's user network; QEMU forwards a port of the host to it.
const ADDRESS: Ipv4Cidr = Ipv4Cidr::new(Ipv4Address::new(10, 0, 2, 15), 24);
const GATEWAY: Ipv4Address = Ipv4Address::new(10, 0, 2, 2);

/// Modbus TCP, from the IANA registry.
const MODBUS_PORT: u16 = 502;
/// Clients that can be served at once.
const MODBUS_CLIENTS: usize = 8;
/// One more listens, and gives the newcomer somebody's place when all are taken.
const MODBUS_SOCKETS: usize = MODBUS_CLIENTS + 1;
const SOCKETS: usize = MODBUS_SOCKETS + http::SOCKETS;
/// More than two of the longest Modbus frames (260 bytes), in each direction; all sockets together fit into the
/// receive FIFO of the LAN9118 (10 KiB), so that clients alone cannot overrun it.
const BUFFER_BYTES: usize = 768;

/// A silent client is asked whether it is there this often …
const KEEP_ALIVE: Duration = Duration::from_secs(5);
/// … and is given up when nothing came from it for this long.
const TIMEOUT: Duration = Duration::from_secs(15);
/// The time for the last bytes of a connection to get through.
const CLOSING: Duration = Duration::from_secs(2);

/// What the background's tasks share: they take turns, so a lock need not keep anything off.
pub type LocalService = Service<'static, NoopRawMutex>;

type Places = Seats<NoopRawMutex, MODBUS_CLIENTS>;

/// Starts the network. Runs in the background, where everything of the network stays.
pub fn start(spawner: Spawner, service: LocalService, desk: &'static LocalDesk) {
    static RESOURCES: StaticCell<StackResources<SOCKETS>> = StaticCell::new();
    static PLACES: StaticCell<Places> = StaticCell::new();

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
    for _ in 0..MODBUS_SOCKETS {
        spawner.spawn(serve_modbus(stack, service, places).expect("as many tasks as sockets"));
    }
    http::start(spawner, stack, service, desk);
}

#[embassy_executor::task]
async fn run(mut runner: Runner<'static, Lan9118>) -> ! {
    runner.run().await
}

/// One client after the other.
#[embassy_executor::task(pool_size = MODBUS_SOCKETS)]
async fn serve_modbus(stack: Stack<'static>, service: LocalService, places: &'static Places) -> ! {
    let mut rx = [0; BUFFER_BYTES];
    let mut tx = [0; BUFFER_BYTES];
    let timeouts = Timeouts::default();
    let mut socket = TcpSocket::new(stack, &mut rx, &mut tx);
    socket.set_keep_alive(Some(KEEP_ALIVE));
    socket.set_timeout(Some(TIMEOUT));
    // An answer is one write: holding it back for more would only delay it.
    socket.set_nagle_enabled(false);
    loop {
        if socket.accept(MODBUS_PORT).await.is_ok() {
            let peer = socket.remote_endpoint().map(|from| match from.addr {
                IpAddress::Ipv4(address) => Peer::Ip(address),
            });
            let client = peer.and_then(|peer| service.enter(peer, Protocol::ModbusTcp));
            if let Some(client) = client {
                let place = places.take();
                let talk = session(&mut socket, &client, &timeouts, || place.answered());
                if place.hold(talk).await == Some(End::Closed) {
                    socket.close();
                    let _ = with_timeout(CLOSING, socket.flush()).await;
                }
            }
        }
        // Whatever state it is in: the socket must be closed to listen again.
        socket.abort();
        let _ = with_timeout(CLOSING, socket.flush()).await;
    }
}
