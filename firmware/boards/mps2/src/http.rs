//! The HMI's sockets: as many connections at once as there are tasks.
//!
//! Does not know what is asked and answered: the library does.

use embassy_executor::Spawner;
use embassy_net::Stack;
use embassy_net::tcp::TcpSocket;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_time::Duration;
use firmware::hmi::{BUFFER_BYTES, Hmi, desk, serve};
use firmware::link::seats::Seats;
use static_cell::{ConstStaticCell, StaticCell};

use crate::net::LocalService;

/// HTTP, from the IANA registry.
const PORT: u16 = 80;
/// Connections of browsers at once: each of three has a stream and some for what it asks.
const CONNECTIONS: usize = 12;
/// One more listens, and gives the newcomer somebody's place when all are taken.
pub const SOCKETS: usize = CONNECTIONS + 1;
/// Requests are short, and what is long of them may come in parts: together with Modbus's, the windows do not overrun
/// the receive FIFO of the LAN9118.
const RX_BYTES: usize = 256;
/// What a browser loads comes in pieces of two frames.
const TX_BYTES: usize = 2 * 1460;
/// A browser that is gone without a word is noticed after this time.
const KEEP_ALIVE: Duration = Duration::from_secs(5);
const TIMEOUT: Duration = Duration::from_secs(15);

/// The HMI's own things: all of the background.
pub type LocalDesk = desk::Desk<NoopRawMutex>;

type Places = Seats<NoopRawMutex, CONNECTIONS>;

/// Starts serving. Runs in the background, where everything of the network stays.
pub fn start(
    spawner: Spawner,
    stack: Stack<'static>,
    service: LocalService,
    desk: &'static LocalDesk,
) {
    static PLACES: StaticCell<Places> = StaticCell::new();
    static BUFFERS: ConstStaticCell<[Buffers; SOCKETS]> =
        ConstStaticCell::new([const { Buffers::new() }; SOCKETS]);

    let places = &*PLACES.init(Places::new());
    let hmi = Hmi { service, desk };
    for buffers in BUFFERS.take() {
        spawner.spawn(run(stack, hmi, places, buffers).expect("as many tasks as sockets"));
    }
}

struct Buffers {
    rx: [u8; RX_BYTES],
    tx: [u8; TX_BYTES],
    http: [u8; BUFFER_BYTES],
}

impl Buffers {
    const fn new() -> Self {
        Self {
            rx: [0; _],
            tx: [0; _],
            http: [0; _],
        }
    }
}

/// One connection after the other.
#[embassy_executor::task(pool_size = SOCKETS)]
async fn run(
    stack: Stack<'static>,
    hmi: Hmi<'static, NoopRawMutex>,
    places: &'static Places,
    buffers: &'static mut Buffers,
) -> ! {
    let Buffers { rx, tx, http } = buffers;
    loop {
        let mut socket = TcpSocket::new(stack, rx, tx);
        socket.set_keep_alive(Some(KEEP_ALIVE));
        socket.set_timeout(Some(TIMEOUT));
        // A sample is one write: holding it back for more would only delay it.
        socket.set_nagle_enabled(false);
        if socket.accept(PORT).await.is_ok() {
            let place = places.take();
            let session = serve(socket, http, hmi, || place.answered());
            // Displaced, the connection ends with the session.
            let _ = place.hold(session).await;
        }
    }
}
