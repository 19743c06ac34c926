//! The simulator's own HMI: a page out of flash, and the interface behind it.
//!
//! Not here: sockets and accept loops, which are a board's; the page itself, which is in `www`; anything that
//! computes. Like a link, the HMI sees the process image and never the plant. What it wants of the simulator beyond
//! that (another machine, a snapshot) it leaves at the [`desk::Desk`], where the simulator finds it between two drive
//! cycles.
//!
//! | Module | |
//! |---|---|
//! | [`routes`] | the table of what can be asked, and the one way in |
//! | `guard`, `auth` | who may ask, who may change something |
//! | `body`, `answer`, `documents` | what comes in and what goes out, piece by piece |
//! | `live` | the stream of signals |
//! | [`desk`] | what there is beside the image, and the way to the simulator |
//! | `setup` | the machine's parameters, staged and applied as one |
//! | `settings` | what the board remembers, and whether it does |
//! | [`panel`] | the operator panel's sequence |
//! | `gains` | the regulators' gains |
//! | `timed` | faults that end by themselves |
//! | `acceptance` | the acceptance run that the page asks for |
//! | `events`, `recorder` | what has happened, and every command with its cycle |

// A refusal with its details has no heap to be put on.
#![allow(clippy::result_large_err, clippy::large_enum_variant)]

mod acceptance;
mod answer;
pub mod assets;
mod auth;
mod body;
pub mod desk;
mod documents;
mod events;
mod gains;
mod guard;
mod live;
pub mod panel;
mod recorder;
pub mod routes;
mod settings;
mod setup;
mod timed;

use embassy_sync::blocking_mutex::raw::RawMutex;
use picoserve::io::Socket;
use picoserve::time::Duration;
use picoserve::{Config, Router, Server, Timeouts};

use crate::link::Service;
use desk::Desk;
pub use settings::keep;

/// Bytes that a board gives each connection for what it reads: a request's head, and the longest body.
pub const BUFFER_BYTES: usize = HEAD_BYTES + BODY_BYTES;
/// Longest head of a request, in bytes: what a browser sends is half of it.
const HEAD_BYTES: usize = 2048;
/// Longest body of a request, in bytes: every parameter of a machine fits into it.
pub const BODY_BYTES: usize = 6144;

/// A browser that is not asking keeps its connection this long, s; then somebody else may have the socket.
const KEEP_S: u64 = 5;
/// A request must be whole after this time, s.
const REQUEST_S: u64 = 5;
/// A client that reads nothing for this long, s, is gone.
const WRITE_S: u64 = 5;

const CONFIG: Config = Config::new(Timeouts {
    start_read_request: Duration::from_secs(REQUEST_S),
    persistent_start_read_request: Duration::from_secs(KEEP_S),
    read_request: Duration::from_secs(REQUEST_S),
    write: Duration::from_secs(WRITE_S),
})
.keep_connection_alive();

/// What the HMI has to do with.
pub struct Hmi<'a, M: RawMutex> {
    /// The process image, and who controls the winder.
    pub service: Service<'a, M>,
    /// All else.
    pub desk: &'a Desk<M>,
}

impl<M: RawMutex> Clone for Hmi<'_, M> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<M: RawMutex> Copy for Hmi<'_, M> {}

/// The clock that every board has.
struct Clock;

impl<Runtime> picoserve::Timer<Runtime> for Clock {
    async fn delay(&self, duration: Duration) {
        embassy_time::Timer::after_millis(duration.as_millis()).await;
    }
}

/// Serves one connection to its end. `answered` is called with each request, and with each sample of a stream.
pub async fn serve<Runtime, S: Socket<Runtime>, M: RawMutex>(
    socket: S,
    buffer: &mut [u8],
    hmi: Hmi<'_, M>,
    answered: impl Fn(),
) {
    let routes = routes::Routes {
        hmi,
        answered: &answered,
    };
    let app = Router::from_service(routes);
    let _connected = hmi.desk.connect();
    // However it ended: the connection is gone.
    let _ = Server::custom(&app, Clock, &CONFIG, buffer)
        .serve(socket)
        .await;
}
