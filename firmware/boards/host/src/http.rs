//! The HMI on loopback: as many connections at once as there are tasks.
//!
//! Not here: what is asked and answered; that is the library's.

use std::sync::Arc;

use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use firmware::hmi::{BUFFER_BYTES, Hmi, desk, serve};
use firmware::link::seats::Seats;
use tokio::net::TcpListener;
use tokio::task::LocalSet;

use crate::{ACCEPT_AGAIN, Server};

/// Connections of browsers at once: each of three has a stream and some for what it asks.
pub const CONNECTIONS: usize = 12;

/// The HMI's own things, shared by the threads of this process.
pub type Desk = desk::Desk<CriticalSectionRawMutex>;

struct Pages {
    listener: TcpListener,
    server: Arc<Server>,
    desk: Arc<Desk>,
    seats: Seats<CriticalSectionRawMutex, CONNECTIONS>,
}

/// Starts serving, in tasks that stay on their thread.
pub fn start(tasks: &LocalSet, listener: TcpListener, server: Arc<Server>, desk: Arc<Desk>) {
    let pages = Arc::new(Pages {
        listener,
        server,
        desk,
        seats: Seats::new(),
    });
    // One more, for the connection that displaces another.
    for _ in 0..=CONNECTIONS {
        tasks.spawn_local(pages.clone().run());
    }
}

impl Pages {
    /// One connection after the other, as on the other boards.
    async fn run(self: Arc<Self>) {
        let mut buffer = vec![0; BUFFER_BYTES];
        loop {
            let Ok((stream, _)) = self.listener.accept().await else {
                tokio::time::sleep(ACCEPT_AGAIN).await;
                continue;
            };
            let seat = self.seats.take();
            // A sample is one write: holding it back for more would only delay it.
            let _ = stream.set_nodelay(true);
            let hmi = Hmi {
                service: self.server.service(),
                desk: &*self.desk,
            };
            let session = serve(stream, &mut buffer, hmi, || seat.answered());
            // Displaced, the connection ends with the session.
            let _ = seat.hold(session).await;
        }
    }
}
