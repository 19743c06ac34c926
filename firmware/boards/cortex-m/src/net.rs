//! The tasks of the sockets, one each, all of the background.
//!
//! Not here: what is said on a connection, and the network below; the library and the board have them.

use embassy_executor::Spawner;
use embassy_net::Stack;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use firmware::hmi::desk::Desk;
use firmware::link::{Served, Service};
use firmware::net::{self, MODBUS_SOCKETS, Places};
use static_cell::StaticCell;

/// What the background's tasks share: they take turns, so a lock need not keep anything off.
pub type LocalServed = Served<NoopRawMutex>;
/// What their links serve of it.
pub type LocalService = Service<'static, NoopRawMutex>;
/// The HMI's own things, likewise.
pub type LocalDesk = Desk<NoopRawMutex>;

/// Starts serving Modbus TCP.
pub fn start_modbus(spawner: Spawner, stack: Stack<'static>, service: LocalService) {
    static PLACES: StaticCell<Places<NoopRawMutex>> = StaticCell::new();
    let places = &*PLACES.init(Places::new());
    for _ in 0..MODBUS_SOCKETS {
        spawner.spawn(serve_modbus(stack, service, places).expect("as many tasks as sockets"));
    }
}

#[embassy_executor::task(pool_size = MODBUS_SOCKETS)]
async fn serve_modbus(
    stack: Stack<'static>,
    service: LocalService,
    places: &'static Places<NoopRawMutex>,
) -> ! {
    net::serve_modbus(stack, service, places).await
}

/// Defines `start_http`, which starts serving the HMI to so many connections of browsers at once, and `HTTP_SOCKETS`:
/// one more listens, and gives the newcomer somebody's place when all are taken.
///
/// A macro, since how many there are is the board's, and a task's pool is no generic.
#[macro_export]
macro_rules! serve_http {
    ($connections:expr) => {
        pub const HTTP_SOCKETS: usize = $connections + 1;

        type HttpPlaces = $crate::export::firmware::link::seats::Seats<
            $crate::export::embassy_sync::blocking_mutex::raw::NoopRawMutex,
            { $connections },
        >;
        type LocalHmi = $crate::export::firmware::hmi::Hmi<
            'static,
            $crate::export::embassy_sync::blocking_mutex::raw::NoopRawMutex,
        >;

        /// Starts serving. Runs in the background, where everything of the network stays.
        pub fn start_http(
            spawner: $crate::export::embassy_executor::Spawner,
            stack: $crate::export::embassy_net::Stack<'static>,
            hmi: LocalHmi,
        ) {
            use $crate::export::firmware::net::HttpBuffers;
            use $crate::export::static_cell::{ConstStaticCell, StaticCell};
            static PLACES: StaticCell<HttpPlaces> = StaticCell::new();
            static BUFFERS: ConstStaticCell<[HttpBuffers; HTTP_SOCKETS]> =
                ConstStaticCell::new([const { HttpBuffers::new() }; HTTP_SOCKETS]);

            #[embassy_executor::task(pool_size = HTTP_SOCKETS)]
            async fn serve_http(
                stack: $crate::export::embassy_net::Stack<'static>,
                hmi: LocalHmi,
                places: &'static HttpPlaces,
                buffers: &'static mut HttpBuffers,
            ) -> ! {
                $crate::export::firmware::net::serve_http(stack, hmi, places, buffers).await
            }

            let places = &*PLACES.init(HttpPlaces::new());
            for buffers in BUFFERS.take() {
                spawner.spawn(
                    serve_http(stack, hmi, places, buffers).expect("as many tasks as sockets"),
                );
            }
        }
    };
}
