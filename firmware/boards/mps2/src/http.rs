//! The HMI's sockets.
//!
//! Does not know what is asked and answered: the library does.

use embassy_executor::Spawner;
use embassy_net::Stack;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use firmware::hmi::{Hmi, desk};
use firmware::link::seats::Seats;
use firmware::net::{self, HttpBuffers};
use static_cell::{ConstStaticCell, StaticCell};

use crate::net::LocalService;

/// Connections of browsers at once: each of three has a stream and some for what it asks.
const CONNECTIONS: usize = 12;
/// One more listens, and gives the newcomer somebody's place when all are taken.
pub const SOCKETS: usize = CONNECTIONS + 1;

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
    static BUFFERS: ConstStaticCell<[HttpBuffers; SOCKETS]> =
        ConstStaticCell::new([const { HttpBuffers::new() }; SOCKETS]);

    let places = &*PLACES.init(Places::new());
    let hmi = Hmi { service, desk };
    for buffers in BUFFERS.take() {
        spawner.spawn(run(stack, hmi, places, buffers).expect("as many tasks as sockets"));
    }
}

#[embassy_executor::task(pool_size = SOCKETS)]
async fn run(
    stack: Stack<'static>,
    hmi: Hmi<'static, NoopRawMutex>,
    places: &'static Places,
    buffers: &'static mut HttpBuffers,
) -> ! {
    net::serve_http(stack, hmi, places, buffers).await
}
