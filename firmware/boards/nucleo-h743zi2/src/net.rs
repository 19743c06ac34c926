//! The Ethernet: an address, and a TCP server on the Modbus port.
//!
//! Does not know what is said on a connection: the library's session does. An unplugged cable stops nothing: the
//! address comes when the cable does.

use embassy_executor::Spawner;
use embassy_net::tcp::TcpSocket;
use embassy_net::{
    Config, ConfigV4, IpAddress, Ipv4Address, Ipv4Cidr, Runner, Stack, StackResources,
    StaticConfigV4,
};
use embassy_stm32::eth::{self, Ethernet, GenericPhy, Sma};
use embassy_stm32::peripherals::{
    ETH, ETH_SMA, PA1, PA2, PA7, PB13, PC1, PC4, PC5, PG11, PG13, RNG,
};
use embassy_stm32::rng::{self, Rng};
use embassy_stm32::{Peri, bind_interrupts, uid};
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_time::{Duration, with_timeout};
use firmware::link::Service;
use firmware::link::control::{Peer, Protocol};
use firmware::link::modbus::tcp::{End, Timeouts, session};
use firmware::link::seats::Seats;
use firmware::store::Network;
use static_cell::StaticCell;

use crate::memory;

bind_interrupts!(struct Irqs {
    ETH => eth::InterruptHandler;
    RNG => rng::InterruptHandler<RNG>;
});

type Device = Ethernet<'static, ETH, GenericPhy<Sma<'static, ETH_SMA>>>;

/// Modbus TCP, from the IANA registry.
const MODBUS_PORT: u16 = 502;
/// Clients that can be served at once.
const MODBUS_CLIENTS: usize = 8;
/// One more listens, and gives the newcomer somebody's place when all are taken.
const MODBUS_SOCKETS: usize = MODBUS_CLIENTS + 1;
/// Of DHCP.
const OTHER_SOCKETS: usize = 1;
/// More than two of the longest Modbus frames (260 bytes), in each direction.
const BUFFER_BYTES: usize = 768;

/// A silent client is asked whether it is there this often …
const KEEP_ALIVE: Duration = Duration::from_secs(5);
/// … and is given up when nothing came from it for this long.
const TIMEOUT: Duration = Duration::from_secs(15);
/// The time for the last bytes of a connection to get through.
const CLOSING: Duration = Duration::from_secs(2);
/// A DHCP server that has not answered by then is not there.
const DHCP: Duration = Duration::from_secs(10);

/// What the background's tasks share: they take turns, so a lock need not keep anything off.
pub type LocalService = Service<'static, NoopRawMutex>;

type Places = Seats<NoopRawMutex, MODBUS_CLIENTS>;

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
pub fn start(spawner: Spawner, r: Resources, network: Network, service: LocalService) {
    static RESOURCES: StaticCell<StackResources<{ MODBUS_SOCKETS + OTHER_SOCKETS }>> =
        StaticCell::new();
    static PLACES: StaticCell<Places> = StaticCell::new();

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
        hardware_address(),
        r.sma.0,
        r.sma.1,
        r.sma.2,
    );
    let mut config = Config::default();
    config.ipv4 = ip(network);
    let (stack, runner) =
        embassy_net::new(device, config, RESOURCES.init(StackResources::new()), seed);

    spawner.spawn(run(runner).expect("one runner"));
    if network == Network::Dhcp {
        spawner.spawn(fall_back(stack).expect("first"));
    }
    let places = &*PLACES.init(Places::new());
    for _ in 0..MODBUS_SOCKETS {
        spawner.spawn(serve_modbus(stack, service, places).expect("as many tasks as sockets"));
    }
}

fn ip(network: Network) -> ConfigV4 {
    let Network::Static {
        address,
        prefix,
        gateway,
    } = network
    else {
        return ConfigV4::Dhcp(Default::default());
    };
    let address_of = |[a, b, c, d]: [u8; 4]| Ipv4Address::new(a, b, c, d);
    ConfigV4::Static(StaticConfigV4 {
        address: Ipv4Cidr::new(address_of(address), prefix),
        gateway: gateway.map(address_of),
        dns_servers: Default::default(),
    })
}

/// Of the chip's own number, in the range that everybody may use (IEEE 802, locally administered).
fn hardware_address() -> [u8; 6] {
    // FNV-1a. Source: Fowler, Noll, Vo, draft-eastlake-fnv, 32 bits.
    let hash = uid::uid().iter().fold(0x811c_9dc5_u32, |hash, byte| {
        (hash ^ u32::from(*byte)).wrapping_mul(0x0100_0193)
    });
    let [a, b, c, d] = hash.to_be_bytes();
    [0x02, 0x57, a, b, c, d]
}

#[embassy_executor::task]
async fn run(mut runner: Runner<'static, Device>) -> ! {
    runner.run().await
}

/// Takes the fixed address when no server gives one; a cable that is plugged in later starts anew.
#[embassy_executor::task]
async fn fall_back(stack: Stack<'static>) {
    loop {
        stack.wait_link_up().await;
        if with_timeout(DHCP, stack.wait_config_up()).await.is_err() {
            defmt::warn!("no DHCP server: fixed address");
            stack.set_config_v4(ip(Network::FALLBACK));
        }
        if let Some(config) = stack.config_v4() {
            defmt::info!("address {}", defmt::Display2Format(&config.address));
        }
        stack.wait_link_down().await;
        stack.set_config_v4(ip(Network::Dhcp));
    }
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
