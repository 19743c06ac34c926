//! The HMI's sockets.
//!
//! Does not know what is asked and answered: the library does.

use embassy_executor::Spawner;
use embassy_net::Stack;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use firmware::hmi::{Hmi, desk};
use firmware::net::{self, HTTP_SOCKETS, HttpBuffers, HttpPlaces};
use static_cell::{ConstStaticCell, StaticCell};

use crate::net::LocalService;

/// The HMI's own things: all of the background.
pub type LocalDesk = desk::Desk<NoopRawMutex>;

/// Starts serving. Runs in the background, where everything of the network stays.
pub fn start(
    spawner: Spawner,
    stack: Stack<'static>,
    service: LocalService,
    desk: &'static LocalDesk,
) {
    static PLACES: StaticCell<HttpPlaces<NoopRawMutex>> = StaticCell::new();
    static BUFFERS: ConstStaticCell<[HttpBuffers; HTTP_SOCKETS]> =
        ConstStaticCell::new([const { HttpBuffers::new() }; HTTP_SOCKETS]);

    let places = &*PLACES.init(HttpPlaces::new());
    let hmi = Hmi { service, desk };
    for buffers in BUFFERS.take() {
        spawner.spawn(run(stack, hmi, places, buffers).expect("as many tasks as sockets"));
    }
}

#[embassy_executor::task(pool_size = HTTP_SOCKETS)]
async fn run(
    stack: Stack<'static>,
    hmi: Hmi<'static, NoopRawMutex>,
    places: &'static HttpPlaces<NoopRawMutex>,
    buffers: &'static mut HttpBuffers,
) -> ! {
    net::serve_http(stack, hmi, places, buffers).await
}
