//! What boards with embassy's network stack share: where the address comes from, the Modbus server, the HMI's.
//!
//! Not here: the network device, and the stack that a board builds around it; what is said on a connection, which is
//! the link's session and the HMI's. There is no IPv6.

use core::future::poll_fn;
use core::mem;
use core::pin::{Pin, pin};
use core::task::Poll;

use embassy_futures::join::join;
use embassy_net::driver::Driver;
use embassy_net::tcp::TcpSocket;
use embassy_net::{ConfigV4, IpAddress, Ipv4Address, Ipv4Cidr, Runner, Stack, StaticConfigV4};
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::{Duration, Instant, Timer, with_timeout};

use crate::hash::fnv1a;
use crate::hmi::{self, Hmi};
use crate::life::{Life, PATIENCE, Task};
use crate::link::Service;
use crate::link::control::{Peer, Protocol};
use crate::link::modbus::tcp::{End, Timeouts, session};
use crate::link::seats::Seats;
use crate::store::Network;

/// Modbus TCP, from the IANA registry.
const MODBUS_PORT: u16 = 502;
/// Clients that can be served at once.
pub const MODBUS_CLIENTS: usize = 8;
/// Some more listen, and give newcomers somebody's place when all are taken. The stack keeps no queue of connections: one
/// that comes while none of its sockets listens is refused. A socket that loses its client listens again a moment
/// later, and until then the others do.
const MODBUS_SPARE: usize = 3;
/// Sockets, and so tasks, of the Modbus server.
pub const MODBUS_SOCKETS: usize = MODBUS_CLIENTS + MODBUS_SPARE;
/// Two of the longest Modbus frames (260 bytes), in each direction. Small enough that all sockets together fit into a
/// network device's receive FIFO of 10 KiB, so that clients alone cannot overrun it.
const BUFFER_BYTES: usize = 600;

/// HTTP, from the IANA registry.
const HTTP_PORT: u16 = 80;
/// Requests are short, and what is long of them may come in parts: together with Modbus's, the windows do not overrun
/// a receive FIFO of 10 KiB.
const HTTP_RX_BYTES: usize = 256;
/// What a browser loads comes in pieces of two frames.
const HTTP_TX_BYTES: usize = 2 * 1460;

/// A silent client is asked whether it is there this often …
const KEEP_ALIVE: Duration = Duration::from_secs(5);
/// … and is given up when nothing came from it for this long.
const TIMEOUT: Duration = Duration::from_secs(15);
/// A handshake takes a network's round trip. One that its client has not ended by then is given up: a flood of them
/// takes every socket, and must not keep them.
const HANDSHAKE: Duration = Duration::from_millis(500);
/// The time for the last bytes of a connection to get through.
const CLOSING: Duration = Duration::from_secs(2);
/// A DHCP server that has not answered by then is not there.
const DHCP: Duration = Duration::from_secs(10);

/// The places of the Modbus clients.
pub type Places<M> = Seats<M, MODBUS_CLIENTS>;

/// Waits for a client whose handshake ends; false, when one does not. Such a socket has to be dropped and not closed:
/// nobody is there to be told, and it would wait for the address of nobody's hardware.
async fn accept(socket: &mut TcpSocket<'_>, port: u16) -> bool {
    let ended = {
        let mut accepted = pin!(socket.accept(port));
        let mut listens = false;
        let mut handshake = None;
        poll_fn(|cx| {
            if let Poll::Ready(accepted) = accepted.as_mut().poll(cx) {
                return Poll::Ready(accepted.is_ok());
            }
            // the first time it begins to listen; again, when a handshake begins
            if !mem::replace(&mut listens, true) {
                return Poll::Pending;
            }
            let handshake = handshake.get_or_insert_with(|| Timer::after(HANDSHAKE));
            Pin::new(handshake).poll(cx).map(|()| false)
        })
        .await
    };
    ended && socket.remote_endpoint().is_some()
}

/// One client after the other: the task of one socket, of which a board runs [`MODBUS_SOCKETS`].
pub async fn serve_modbus<M: RawMutex>(
    stack: Stack<'_>,
    service: Service<'_, M>,
    places: &Places<M>,
) -> ! {
    let mut rx = [0; BUFFER_BYTES];
    let mut tx = [0; BUFFER_BYTES];
    let timeouts = Timeouts::default();
    loop {
        let mut socket = TcpSocket::new(stack, &mut rx, &mut tx);
        socket.set_keep_alive(Some(KEEP_ALIVE));
        socket.set_timeout(Some(TIMEOUT));
        // An answer is one write: holding it back for more would only delay it.
        socket.set_nagle_enabled(false);
        if !accept(&mut socket, MODBUS_PORT).await {
            continue;
        }
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
        // Whatever state it is in: a client that is there is told.
        socket.abort();
        let _ = with_timeout(CLOSING, socket.flush()).await;
    }
}

/// What one of the HMI's sockets needs.
pub struct HttpBuffers {
    rx: [u8; HTTP_RX_BYTES],
    tx: [u8; HTTP_TX_BYTES],
    http: [u8; hmi::BUFFER_BYTES],
}

impl HttpBuffers {
    /// Empty.
    pub const fn new() -> Self {
        Self {
            rx: [0; _],
            tx: [0; _],
            http: [0; _],
        }
    }
}

impl Default for HttpBuffers {
    fn default() -> Self {
        Self::new()
    }
}

/// One connection after the other: the task of one of the HMI's sockets. A board has one more of them than places.
pub async fn serve_http<M: RawMutex, const N: usize>(
    stack: Stack<'_>,
    hmi: Hmi<'_, M>,
    places: &Seats<M, N>,
    buffers: &mut HttpBuffers,
) -> ! {
    let HttpBuffers { rx, tx, http } = buffers;
    loop {
        let mut socket = TcpSocket::new(stack, rx, tx);
        socket.set_keep_alive(Some(KEEP_ALIVE));
        socket.set_timeout(Some(TIMEOUT));
        // A sample is one write: holding it back for more would only delay it.
        socket.set_nagle_enabled(false);
        if accept(&mut socket, HTTP_PORT).await {
            let place = places.take();
            let session = hmi::serve(socket, http, hmi, || place.answered());
            // Displaced, the connection ends with the session.
            let _ = place.hold(session).await;
        }
    }
}

/// The stack's own task, which shows that it lives.
pub async fn run<D: Driver>(mut runner: Runner<'_, D>, life: &Life) -> ! {
    let lives = async {
        loop {
            life.see(Task::Network, Instant::now());
            Timer::after(PATIENCE / 2).await;
        }
    };
    join(runner.run(), lives).await.0
}

/// A hardware address out of a chip's own number, in the range that everybody may use (IEEE 802, locally
/// administered).
pub fn hardware_address(chip: &[u8]) -> [u8; 6] {
    let [a, b, c, d] = fnv1a(chip.iter().copied()).to_be_bytes();
    [0x02, 0x57, a, b, c, d]
}

/// What the stack is configured with.
pub fn address(network: Network) -> ConfigV4 {
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

/// Takes the fixed address when no DHCP server gives one; a cable that is plugged in later starts anew. `told` gets
/// the address.
pub async fn fall_back(stack: Stack<'_>, told: impl Fn(Ipv4Cidr)) -> ! {
    loop {
        stack.wait_link_up().await;
        if with_timeout(DHCP, stack.wait_config_up()).await.is_err() {
            stack.set_config_v4(address(Network::FALLBACK));
        }
        if let Some(config) = stack.config_v4() {
            told(config.address);
        }
        stack.wait_link_down().await;
        stack.set_config_v4(address(Network::Dhcp));
    }
}
