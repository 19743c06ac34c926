//! A computer on the guest's cable: its TCP, by the guest's own clock.
//!
//! Not here: what it says. Its clock is the number of the beat, so that it does the same in every run.

use std::collections::VecDeque;

use anyhow::{Result, anyhow};
use smoltcp::iface::{Config, Interface, SocketHandle, SocketSet};
use smoltcp::phy::{self, Device, DeviceCapabilities, Medium};
use smoltcp::socket::tcp;
use smoltcp::time::Instant;
use smoltcp::wire::{EthernetAddress, HardwareAddress, IpAddress, IpCidr, Ipv4Address};

use super::{Frame, GUEST};

const ADDRESS: Ipv4Address = Ipv4Address::new(10, 0, 2, 2);
const MAC: [u8; 6] = [0x02, 0, 0, 0, 0, 0x02];
/// The ports of its connections follow this one.
const PORT: u16 = 50_000;
/// Bytes of a TCP buffer: more than the longest Modbus frame.
const BUFFER: usize = 1024;
/// Ethernet's longest frame without its checksum, bytes.
const MTU: usize = 1514;

/// A computer beside the guest.
pub struct Host {
    cable: Cable,
    interface: Interface,
    sockets: SocketSet<'static>,
    connections: u16,
}

/// The frames between its TCP and the bench.
#[derive(Default)]
struct Cable {
    received: VecDeque<Frame>,
    sent: Vec<Frame>,
}

impl Device for Cable {
    type RxToken<'a> = Received;
    type TxToken<'a> = Sent<'a>;

    fn receive(&mut self, _: Instant) -> Option<(Received, Sent<'_>)> {
        let frame = self.received.pop_front()?;
        Some((Received(frame), Sent(&mut self.sent)))
    }

    fn transmit(&mut self, _: Instant) -> Option<Sent<'_>> {
        Some(Sent(&mut self.sent))
    }

    fn capabilities(&self) -> DeviceCapabilities {
        let mut capabilities = DeviceCapabilities::default();
        capabilities.medium = Medium::Ethernet;
        capabilities.max_transmission_unit = MTU;
        capabilities
    }
}

struct Received(Frame);

impl phy::RxToken for Received {
    fn consume<R, F: FnOnce(&[u8]) -> R>(self, f: F) -> R {
        f(&self.0)
    }
}

struct Sent<'a>(&'a mut Vec<Frame>);

impl phy::TxToken for Sent<'_> {
    fn consume<R, F: FnOnce(&mut [u8]) -> R>(self, length: usize, f: F) -> R {
        let mut frame = vec![0; length];
        let result = f(&mut frame);
        self.0.push(frame);
        result
    }
}

impl Host {
    pub fn new() -> Self {
        let mut cable = Cable::default();
        let address = HardwareAddress::Ethernet(EthernetAddress(MAC));
        let mut interface = Interface::new(Config::new(address), &mut cable, Instant::ZERO);
        interface.update_ip_addrs(|addresses| {
            // there is room for one
            let _ = addresses.push(IpCidr::new(IpAddress::Ipv4(ADDRESS), 24));
        });
        Self {
            cable,
            interface,
            sockets: SocketSet::new(Vec::new()),
            connections: 0,
        }
    }

    /// Another socket, not yet connected.
    pub fn socket(&mut self) -> SocketHandle {
        let buffer = || tcp::SocketBuffer::new(vec![0; BUFFER]);
        let mut socket = tcp::Socket::new(buffer(), buffer());
        socket.set_nagle_enabled(false);
        self.sockets.add(socket)
    }

    /// A beat: the frames that have come.
    pub fn hear(&mut self, millisecond: u64, frames: Vec<Frame>) {
        self.cable.received.extend(frames);
        self.poll(millisecond);
    }

    /// The end of a beat: the frames that go.
    pub fn say(&mut self, millisecond: u64) -> Vec<Frame> {
        self.poll(millisecond);
        std::mem::take(&mut self.cable.sent)
    }

    fn poll(&mut self, millisecond: u64) {
        let now = Instant::from_millis(millisecond as i64);
        self.interface.poll(now, &mut self.cable, &mut self.sockets);
    }

    /// Connects to a port of the guest, where there is no connection, nor one under way; whether it has begun to.
    pub fn connect(&mut self, socket: SocketHandle, port: u16) -> Result<bool> {
        let socket = self.sockets.get_mut::<tcp::Socket>(socket);
        if socket.is_open() {
            return Ok(false);
        }
        self.connections += 1;
        let remote = (IpAddress::Ipv4(GUEST), port);
        socket
            .connect(self.interface.context(), remote, PORT + self.connections)
            .map_err(|error| anyhow!("no connection to port {port}: {error}"))?;
        Ok(true)
    }

    /// There is a connection, or one under way.
    pub fn is_open(&self, socket: SocketHandle) -> bool {
        self.sockets.get::<tcp::Socket>(socket).is_open()
    }

    /// The guest listens to what is sent.
    pub fn connected(&self, socket: SocketHandle) -> bool {
        self.sockets.get::<tcp::Socket>(socket).may_send()
    }

    /// Takes what has come.
    pub fn take(&mut self, socket: SocketHandle, into: &mut Vec<u8>) -> Result<()> {
        let socket = self.sockets.get_mut::<tcp::Socket>(socket);
        if !socket.can_recv() {
            if socket.state() == tcp::State::CloseWait {
                // the guest has said all
                socket.close();
            }
            return Ok(());
        }
        let taken = socket.recv(|bytes| {
            into.extend_from_slice(bytes);
            (bytes.len(), ())
        });
        taken.map_err(|error| anyhow!("a connection of the load: {error}"))
    }

    /// Sends something that fits into the buffer.
    pub fn send(&mut self, socket: SocketHandle, bytes: &[u8]) -> Result<()> {
        self.sockets
            .get_mut::<tcp::Socket>(socket)
            .send_slice(bytes)
            .map(drop)
            .map_err(|error| anyhow!("a connection of the load: {error}"))
    }
}
