//! What the firmware has to do while it is measured.
//!
//! Not here: how it gets there. A load sees the guest's frames once a virtual millisecond and answers with its own; it
//! has no clock but that, and no randomness, so that it does the same in every run.

use std::collections::VecDeque;

use anyhow::{Context, Result, anyhow, ensure};
use model_core::drive::DRIVE_PERIOD_MS;
use model_core::image::{FEEDBACK_WORDS, Feedback, HEARTBEAT_PLC, MODE, PLC_COMMAND_WORDS};
use model_core::logic::Mode;
use model_core::machine::Machine;
use model_core::twin;
use smoltcp::iface::{Config, Interface, SocketHandle, SocketSet};
use smoltcp::phy::{self, Device, DeviceCapabilities, Medium};
use smoltcp::socket::tcp;
use smoltcp::time::Instant;
use smoltcp::wire::{EthernetAddress, HardwareAddress, IpAddress, IpCidr, Ipv4Address};

use super::bench::Frame;

/// Something to do for the firmware.
pub trait Load {
    /// A virtual millisecond has passed: takes what the guest has sent, gives what it gets.
    fn beat(&mut self, millisecond: u64, received: Vec<Frame>) -> Result<Vec<Frame>>;

    /// At the end: what was done, or that it was not.
    fn done(&self) -> Result<String>;

    /// What the firmware last told of itself, where it was asked.
    fn feedback(&self) -> Option<&Feedback> {
        None
    }
}

/// A kind of load.
pub struct Kind {
    /// Its name.
    pub name: &'static str,
    /// How long it is measured, ms.
    pub milliseconds: u64,
    /// Milliseconds from one beat to the next.
    pub every: u64,
    /// Makes one.
    pub load: fn() -> Box<dyn Load>,
}

/// Every load: one row each.
pub const LOADS: &[Kind] = &[
    Kind {
        name: "idle",
        milliseconds: 10_000,
        every: 100,
        load: || Box::new(Idle),
    },
    Kind {
        name: "polling PLC",
        milliseconds: 25_000,
        every: 1,
        load: || Box::new(Plc::new()),
    },
    Kind {
        name: "packet storm",
        milliseconds: 4_000,
        every: 1,
        load: || Box::new(Storm::new()),
    },
];

/// The place of the polling PLC among them.
pub const POLLING: usize = 1;

/// Nothing is connected, and the winder stands still.
struct Idle;

impl Load for Idle {
    fn beat(&mut self, _: u64, _: Vec<Frame>) -> Result<Vec<Frame>> {
        Ok(Vec::new())
    }

    fn done(&self) -> Result<String> {
        Ok("nothing connected, drives off".to_owned())
    }
}

/// The guest, on the board's own network.
const GUEST: Ipv4Address = Ipv4Address::new(10, 0, 2, 15);
const GUEST_MAC: [u8; 6] = [0x02, 0, 0, 0, 0x05, 0];
/// The PLC there.
const PLC: Ipv4Address = Ipv4Address::new(10, 0, 2, 2);
const PLC_MAC: [u8; 6] = [0x02, 0, 0, 0, 0, 0x02];
/// Modbus TCP.
const MODBUS_PORT: u16 = 502;
/// The drive cycle from which on the PLC goes on winding: before its script would stop.
const WINDING: u32 = 39 * 1000 / DRIVE_PERIOD_MS;
/// The ports of the PLC's connections follow this one.
const PLC_PORT: u16 = 50_000;
/// Bytes of a TCP buffer: more than the longest Modbus frame.
const BUFFER: usize = 1024;
/// Ethernet's longest frame without its checksum, bytes.
const MTU: usize = 1514;

/// A winder PLC that writes its commands and reads all feedback every drive cycle, and winds: preset, web, drives on,
/// thread, run, as [`twin::commands`] has it,
/// and goes on.
struct Plc {
    cable: Cable,
    interface: Interface,
    sockets: SocketSet<'static>,
    socket: SocketHandle,
    machine: Machine,
    /// Requests that wait to be sent, and the beginning of an answer.
    requests: VecDeque<Vec<u8>>,
    answer: Vec<u8>,
    waiting: bool,
    connections: u16,
    transaction: u16,
    polls: u64,
    answers: u64,
    feedback: Feedback,
    has_run: bool,
}

/// The frames between the PLC's TCP and the bench.
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

impl Plc {
    fn new() -> Self {
        let mut cable = Cable::default();
        let address = HardwareAddress::Ethernet(EthernetAddress(PLC_MAC));
        let mut interface = Interface::new(Config::new(address), &mut cable, Instant::ZERO);
        interface.update_ip_addrs(|addresses| {
            // there is room for one
            let _ = addresses.push(IpCidr::new(IpAddress::Ipv4(PLC), 24));
        });
        let buffer = || tcp::SocketBuffer::new(vec![0; BUFFER]);
        let mut socket = tcp::Socket::new(buffer(), buffer());
        socket.set_nagle_enabled(false);
        let mut sockets = SocketSet::new(Vec::new());
        Self {
            cable,
            interface,
            socket: sockets.add(socket),
            sockets,
            machine: Machine::news_8000(),
            requests: VecDeque::new(),
            answer: Vec::new(),
            waiting: false,
            connections: 0,
            transaction: 0,
            polls: 0,
            answers: 0,
            feedback: Feedback::default(),
            has_run: false,
        }
    }

    /// A request: transaction, protocol 0, length, unit 1, and what is asked.
    fn request(&mut self, pdu: &[u8]) {
        self.transaction = self.transaction.wrapping_add(1);
        let mut frame = self.transaction.to_be_bytes().to_vec();
        frame.extend([0, 0]);
        frame.extend((1 + pdu.len() as u16).to_be_bytes());
        frame.push(1);
        frame.extend(pdu);
        self.requests.push_back(frame);
    }

    /// Writes the commands (function code 16), reads the feedback (function code 4).
    fn poll(&mut self, cycle: u32) {
        let mut commands = twin::commands(&self.machine, cycle.min(WINDING));
        commands.set_word(&HEARTBEAT_PLC, cycle as u16);
        let words = &commands.words[..PLC_COMMAND_WORDS];
        let mut write = vec![16, 0, 0, 0, words.len() as u8, 2 * words.len() as u8];
        write.extend(words.iter().flat_map(|word| word.to_be_bytes()));
        self.request(&write);
        self.request(&[4, 0, 0, 0, FEEDBACK_WORDS as u8]);
        self.polls += 1;
    }

    /// Takes a whole answer, if there is one.
    fn take_answer(&mut self) -> Result<()> {
        const HEADER: usize = 7;
        let Some(&[_, _, _, _, high, low, _]) = self.answer.first_chunk() else {
            return Ok(());
        };
        let end = HEADER - 1 + usize::from(u16::from_be_bytes([high, low]));
        if self.answer.len() < end {
            return Ok(());
        }
        let answer: Vec<u8> = self.answer.drain(..end).collect();
        let pdu = &answer[HEADER..];
        let function = pdu.first().copied().unwrap_or_default();
        ensure!(function < 0x80, "the firmware refuses a request: {pdu:?}");
        if function == 4 {
            let (words, _) = pdu[2..].as_chunks();
            ensure!(
                words.len() == FEEDBACK_WORDS,
                "{} words of feedback",
                words.len()
            );
            for (word, bytes) in self.feedback.words.iter_mut().zip(words) {
                *word = u16::from_be_bytes(*bytes);
            }
            self.has_run |= self.mode()? == Mode::Run;
            self.answers += 1;
        }
        self.waiting = false;
        Ok(())
    }

    fn mode(&self) -> Result<Mode> {
        let mode = Mode::ALL.get(usize::from(self.feedback.word(&MODE)));
        mode.copied().context("no such mode")
    }

    fn step(&mut self, millisecond: u64, received: Vec<Frame>) -> Result<Vec<Frame>> {
        self.cable.received.extend(received);
        let now = Instant::from_millis(millisecond as i64);
        self.interface.poll(now, &mut self.cable, &mut self.sockets);
        let socket = self.sockets.get_mut::<tcp::Socket>(self.socket);
        if !socket.is_open() {
            // again, where the simulator has lost the connection: nothing is under way any more
            self.requests.clear();
            self.answer.clear();
            self.waiting = false;
            self.connections += 1;
            let context = self.interface.context();
            let port = PLC_PORT + self.connections;
            socket
                .connect(context, (IpAddress::Ipv4(GUEST), MODBUS_PORT), port)
                .map_err(|error| anyhow!("the PLC cannot connect: {error}"))?;
        }
        if socket.can_recv() {
            let answer = &mut self.answer;
            let taken = socket.recv(|bytes| {
                answer.extend_from_slice(bytes);
                (bytes.len(), ())
            });
            taken.map_err(|error| anyhow!("the PLC's connection: {error}"))?;
        }
        let connected = socket.may_send();
        self.take_answer()?;
        if connected
            && millisecond.is_multiple_of(u64::from(DRIVE_PERIOD_MS))
            && self.requests.is_empty()
        {
            self.poll((millisecond / u64::from(DRIVE_PERIOD_MS)) as u32);
        }
        let socket = self.sockets.get_mut::<tcp::Socket>(self.socket);
        if connected
            && !self.waiting
            && let Some(request) = self.requests.pop_front()
        {
            socket
                .send_slice(&request)
                .map_err(|error| anyhow!("the PLC's connection: {error}"))?;
            self.waiting = true;
        }
        self.interface.poll(now, &mut self.cable, &mut self.sockets);
        Ok(std::mem::take(&mut self.cable.sent))
    }
}

impl Load for Plc {
    fn beat(&mut self, millisecond: u64, received: Vec<Frame>) -> Result<Vec<Frame>> {
        self.step(millisecond, received)
    }

    fn done(&self) -> Result<String> {
        ensure!(self.answers > 0, "no poll was answered");
        ensure!(
            self.has_run,
            "the PLC has not wound: mode {}",
            self.mode()?.name()
        );
        Ok(format!(
            "{} of {} polls answered, at the end in {}",
            self.answers,
            self.polls,
            self.mode()?.name()
        ))
    }

    fn feedback(&self) -> Option<&Feedback> {
        Some(&self.feedback)
    }
}

/// A flood of small frames at the rate of a cable of 100 Mbit/s: all that a guest takes for its own, and what it does
/// not.
struct Storm {
    state: u32,
    sent: u64,
    answered: u64,
}

/// The shortest frame takes 84 bytes of the cable (IEEE 802.3: with preamble, checksum and gap): 148 in a millisecond.
const STORM_FRAMES: usize = 100_000 / (8 * 84);
/// Ethernet's shortest frame without its checksum, bytes.
const SHORTEST: usize = 60;

impl Storm {
    fn new() -> Self {
        Self {
            // any but 0
            state: 0x9e37_79b9,
            sent: 0,
            answered: 0,
        }
    }

    /// Xorshift. Source: G. Marsaglia, J. Stat. Softw. 8 (2003) 14.
    fn random(&mut self) -> u32 {
        self.state ^= self.state << 13;
        self.state ^= self.state >> 17;
        self.state ^= self.state << 5;
        self.state
    }

    fn frame(&mut self) -> Frame {
        let (r, kind) = (self.random().to_be_bytes(), self.random() % 6);
        let to = if kind < 2 { [0xff; 6] } else { GUEST_MAC };
        let mut frame = to.to_vec();
        frame.extend([0x02, 0, r[0], r[1], r[2], r[3]]);
        let from = [10, 0, 2, 16 + r[3] % 200];
        match kind {
            // ARP: who has the guest's address, who has another
            0 | 1 => {
                frame.extend([0x08, 0x06, 0, 1, 8, 0, 6, 4, 0, 1]);
                frame.extend([0x02, 0, r[0], r[1], r[2], r[3]]);
                frame.extend(from);
                frame.extend([0; 6]);
                frame.extend([10, 0, 2, if kind == 0 { 15 } else { 99 }]);
            }
            // a segment that opens a connection to Modbus
            2 => {
                let mut segment = vec![r[0] | 0x80, r[1], 0x01, 0xf6];
                segment.extend(r);
                segment.extend([0, 0, 0, 0, 0x50, 0x02, 0x04, 0, 0, 0, 0, 0]);
                let sum = checksum(&[&pseudo(from, 6, segment.len()), &segment]);
                segment[16..18].copy_from_slice(&sum);
                frame.extend(ip(from, 6, &segment));
            }
            // an echo request
            3 => {
                let mut echo = vec![8, 0, 0, 0];
                echo.extend(r);
                let sum = checksum(&[&echo]);
                echo[2..4].copy_from_slice(&sum);
                frame.extend(ip(from, 1, &echo));
            }
            // a datagram to a port where nobody is
            4 => {
                let mut datagram = vec![r[0] | 0x80, r[1], r[2], r[3], 0, 12, 0, 0];
                datagram.extend(r);
                frame.extend(ip(from, 17, &datagram));
            }
            // noise
            _ => {
                frame.extend([0x08, 0]);
                frame.extend((0..11).flat_map(|_| self.random().to_be_bytes()));
            }
        }
        frame.resize(frame.len().max(SHORTEST), 0);
        frame
    }
}

/// An IPv4 packet to the guest, with its type.
fn ip(from: [u8; 4], protocol: u8, payload: &[u8]) -> Vec<u8> {
    let length = (20 + payload.len()) as u16;
    let mut header = vec![0x45, 0];
    header.extend(length.to_be_bytes());
    header.extend([0, 0, 0x40, 0, 64, protocol, 0, 0]);
    header.extend(from);
    header.extend(GUEST.octets());
    let sum = checksum(&[&header]);
    header[10..12].copy_from_slice(&sum);
    [&[0x08, 0x00], &header[..], payload].concat()
}

fn pseudo(from: [u8; 4], protocol: u8, length: usize) -> Vec<u8> {
    let mut pseudo = from.to_vec();
    pseudo.extend(GUEST.octets());
    pseudo.extend([0, protocol]);
    pseudo.extend((length as u16).to_be_bytes());
    pseudo
}

/// The checksum of the internet (RFC 1071) over parts of even length.
fn checksum(parts: &[&[u8]]) -> [u8; 2] {
    let words = parts.iter().flat_map(|part| part.chunks(2));
    let mut sum: u32 = words
        .map(|word| u32::from(word[0]) << 8 | word.get(1).map_or(0, |low| u32::from(*low)))
        .sum();
    while sum > 0xffff {
        sum = (sum & 0xffff) + (sum >> 16);
    }
    (!(sum as u16)).to_be_bytes()
}

impl Load for Storm {
    fn beat(&mut self, _: u64, received: Vec<Frame>) -> Result<Vec<Frame>> {
        self.answered += received.len() as u64;
        self.sent += STORM_FRAMES as u64;
        Ok((0..STORM_FRAMES).map(|_| self.frame()).collect())
    }

    fn done(&self) -> Result<String> {
        ensure!(self.answered > 0, "the guest answered none of the frames");
        Ok(format!(
            "{} frames of 60 bytes, {STORM_FRAMES} in 1 ms, {} answered",
            self.sent, self.answered
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An example of RFC 1071, section 3.
    #[test]
    fn the_checksum_is_the_internet_s() {
        let bytes = [0x00, 0x01, 0xf2, 0x03, 0xf4, 0xf5, 0xf6, 0xf7];
        assert_eq!(checksum(&[&bytes]), (!0xddf2_u16).to_be_bytes());
    }

    #[test]
    fn a_storm_is_of_short_frames_and_the_same_every_time() {
        let (mut a, mut b) = (Storm::new(), Storm::new());
        for millisecond in 0..10 {
            let frames = a.beat(millisecond, Vec::new()).unwrap();
            assert_eq!(frames.len(), STORM_FRAMES);
            assert!(frames.iter().all(|frame| frame.len() == SHORTEST));
            assert_eq!(frames, b.beat(millisecond, Vec::new()).unwrap());
        }
    }
}
