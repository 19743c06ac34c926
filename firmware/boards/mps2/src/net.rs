//! The network: one Ethernet interface with a static address, and a TCP server on the Modbus port.
//!
//! Does not know what is said on a connection: [`session`] does. There is no DHCP, no IPv6 and no
//! queue of connections: with every socket busy the next client is refused.

// A task that spawns on its own executor needs embassy's unsafe spawner.
#![allow(unsafe_code)]

use embassy_executor::Spawner;
use embassy_net::tcp::TcpSocket;
use embassy_net::{Config, Ipv4Address, Ipv4Cidr, Runner, Stack, StackResources, StaticConfigV4};
use embassy_time::{Duration, with_timeout};
use embedded_io_async::{Read, Write};
use static_cell::StaticCell;

use crate::lan9118::Lan9118;

/// The first guest's address on QEMU's user network; QEMU forwards a port of the host to it.
const ADDRESS: Ipv4Cidr = Ipv4Cidr::new(Ipv4Address::new(10, 0, 2, 15), 24);
const GATEWAY: Ipv4Address = Ipv4Address::new(10, 0, 2, 2);

/// Modbus TCP, from the IANA registry.
const MODBUS_PORT: u16 = 502;
/// Three clients and one socket that listens.
const MODBUS_SOCKETS: usize = 4;
/// Twice the longest Modbus frame (260 bytes), rounded up, in each direction.
const BUFFER_BYTES: usize = 1024;

/// A silent client is asked whether it is there this often …
const KEEP_ALIVE: Duration = Duration::from_secs(5);
/// … and is given up when nothing came from it for this long.
const TIMEOUT: Duration = Duration::from_secs(15);
/// The time for the last bytes of a connection to get through.
const CLOSING: Duration = Duration::from_secs(2);

/// Starts the network. Runs in the background, where everything of the network stays.
#[embassy_executor::task]
pub async fn network() {
    static RESOURCES: StaticCell<StackResources<MODBUS_SOCKETS>> = StaticCell::new();

    // SAFETY: an embassy executor polls this task.
    let spawner = unsafe { Spawner::for_current_executor() }.await;
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
    for _ in 0..MODBUS_SOCKETS {
        spawner.spawn(serve_modbus(stack).expect("as many tasks as sockets"));
    }
}

#[embassy_executor::task]
async fn run(mut runner: Runner<'static, Lan9118>) -> ! {
    runner.run().await
}

/// One client after the other.
#[embassy_executor::task(pool_size = MODBUS_SOCKETS)]
async fn serve_modbus(stack: Stack<'static>) -> ! {
    let mut rx = [0; BUFFER_BYTES];
    let mut tx = [0; BUFFER_BYTES];
    let mut socket = TcpSocket::new(stack, &mut rx, &mut tx);
    socket.set_keep_alive(Some(KEEP_ALIVE));
    socket.set_timeout(Some(TIMEOUT));
    // An answer is one write: holding it back for more would only delay it.
    socket.set_nagle_enabled(false);
    loop {
        if socket.accept(MODBUS_PORT).await.is_ok() && session(&mut socket).await.is_ok() {
            socket.close();
            let _ = with_timeout(CLOSING, socket.flush()).await;
        }
        // Whatever state it is in: the socket must be closed to listen again.
        socket.abort();
        let _ = with_timeout(CLOSING, socket.flush()).await;
    }
}

/// Talks to one client until it closes the connection. A stand-in that echoes.
async fn session<S: Read + Write>(stream: &mut S) -> Result<(), S::Error> {
    let mut buffer = [0; 512];
    loop {
        match stream.read(&mut buffer).await? {
            0 => return Ok(()),
            n => stream.write_all(&buffer[..n]).await?,
        }
    }
}
