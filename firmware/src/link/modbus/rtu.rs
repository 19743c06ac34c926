//! Modbus on a serial line: frames out of bytes and silence, and the station that answers them.
//!
//! Not here: the UART, and Modbus ASCII. Time comes with the bytes, so that everything but [`session`] is pure.
//!
//! A frame ends with a silence of t3.5. One with a gap above t1.5 in its midst is thrown away as a whole, and so is
//! one that is too short, too long or of the wrong checksum: its author hears nothing and asks again. A broadcast
//! (address 0) is done and not answered.
//!
//! Source: MODBUS over Serial Line Specification and Implementation Guide V1.02, section 2.5; function 8: MODBUS
//! Application Protocol Specification V1.1b3, section 6.8.

use crc::{CRC_16_MODBUS, Crc};
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::{Duration, Instant, Timer, with_deadline};
use embedded_io_async::{Read, Write};
use heapless::Vec;

use super::pdu::{Exception, PDU_MAX, Pdu, refuse};
use super::{is_exception, response_delay, serve};
use crate::link::control::{Peer, Protocol};
use crate::link::{Client, Service};

const ADDRESS: usize = 1;
const CHECKSUM: usize = 2;
/// Longest frame, in bytes.
pub const FRAME_MAX: usize = ADDRESS + PDU_MAX + CHECKSUM;
/// Shortest: a function code between address and checksum.
pub const FRAME_MIN: usize = ADDRESS + 1 + CHECKSUM;
/// The address of all stations.
pub const BROADCAST: u8 = 0;

/// A frame, or a reply in the making.
pub type Frame = Vec<u8, FRAME_MAX>;

static CRC: Crc<u16> = Crc::<u16>::new(&CRC_16_MODBUS);

/// The checksum as it travels.
pub fn checksum(bytes: &[u8]) -> [u8; CHECKSUM] {
    CRC.checksum(bytes).to_le_bytes()
}

/// The silences that count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Gaps {
    /// Longest within a frame: t1.5.
    pub within: Duration,
    /// Shortest between frames: t3.5.
    pub between: Duration,
}

impl Gaps {
    /// Those of a line of so many Bd, with 11 bits to a character; fixed above 19 200 Bd.
    pub const fn of_baud(baud: u32) -> Self {
        const FAST: u32 = 19_200;
        if baud > FAST || baud == 0 {
            return Self {
                within: Duration::from_micros(750),
                between: Duration::from_micros(1750),
            };
        }
        // half a million characters of 11 bits, in µs: what half a character takes, times the speed
        const HALF: u64 = 11 * 500_000;
        let baud = baud as u64;
        Self {
            within: Duration::from_micros(3 * HALF / baud),
            between: Duration::from_micros(7 * HALF / baud),
        }
    }

    /// One gap for both, where the bytes' own times are not known: behind a driver that hands them on in pieces.
    pub const fn tolerant(gap: Duration) -> Self {
        Self {
            within: gap,
            between: gap,
        }
    }
}

/// Why bytes were no frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Broken {
    /// A gap in its midst.
    Gap,
    /// Fewer bytes than any frame has.
    Short,
    /// More bytes than a frame may have.
    Long,
    /// The checksum is another.
    Checksum,
}

/// Gathers frames from a line.
#[derive(Clone, Debug)]
pub struct Framer {
    gaps: Gaps,
    bytes: Frame,
    last: Option<Instant>,
    broken: Option<Broken>,
}

impl Framer {
    /// Hears nothing yet.
    pub const fn new(gaps: Gaps) -> Self {
        Self {
            gaps,
            bytes: Vec::new(),
            last: None,
            broken: None,
        }
    }

    /// When the frame that is being received will have ended, if no byte comes.
    pub fn ends(&self) -> Option<Instant> {
        self.last.map(|last| last + self.gaps.between)
    }

    /// It is `now`: the frame that has ended by then, if one has; the address, then the PDU.
    pub fn silence(&mut self, now: Instant) -> Option<Result<Frame, Broken>> {
        if now < self.ends()? {
            return None;
        }
        self.last = None;
        let mut bytes = core::mem::take(&mut self.bytes);
        if let Some(broken) = self.broken.take() {
            return Some(Err(broken));
        }
        let Some(length) = bytes.len().checked_sub(CHECKSUM) else {
            return Some(Err(Broken::Short));
        };
        if bytes.len() < FRAME_MIN {
            return Some(Err(Broken::Short));
        }
        if bytes[length..] != checksum(&bytes[..length]) {
            return Some(Err(Broken::Checksum));
        }
        bytes.truncate(length);
        Some(Ok(bytes))
    }

    /// A byte has come, after whatever [`Self::silence`] has told of the time before it.
    pub fn byte(&mut self, now: Instant, byte: u8) {
        if self.last.is_some_and(|last| now > last + self.gaps.within) {
            self.broken = self.broken.or(Some(Broken::Gap));
        }
        self.last = Some(now);
        if self.bytes.push(byte).is_err() {
            self.broken = self.broken.or(Some(Broken::Long));
        }
    }
}

/// What a station has counted since it was last told to begin anew; each wraps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Whole frames on the line, whoever they were for.
    pub bus_messages: u16,
    /// Broken frames.
    pub bus_errors: u16,
    /// Exceptions that it has answered.
    pub exceptions: u16,
    /// Frames for it, or for all.
    pub messages: u16,
    /// Frames for it that it did not answer.
    pub unanswered: u16,
    /// Characters that were lost.
    pub overruns: u16,
}

/// One station of a line.
#[derive(Clone, Debug)]
pub struct Station {
    address: u8,
    /// What it has counted.
    pub counters: Counters,
    listens_only: bool,
}

/// Function code of the diagnostics, which only a serial line has.
const DIAGNOSTICS: u8 = 8;

/// Subfunctions of the diagnostics.
mod diagnostics {
    pub const ECHO: u16 = 0;
    pub const RESTART: u16 = 1;
    pub const REGISTER: u16 = 2;
    pub const LISTEN_ONLY: u16 = 4;
    pub const CLEAR: u16 = 10;
    pub const BUS_MESSAGES: u16 = 11;
    pub const BUS_ERRORS: u16 = 12;
    pub const EXCEPTIONS: u16 = 13;
    pub const MESSAGES: u16 = 14;
    pub const UNANSWERED: u16 = 15;
    pub const NAKS: u16 = 16;
    pub const BUSY: u16 = 17;
    pub const OVERRUNS: u16 = 18;
    pub const CLEAR_OVERRUNS: u16 = 20;
}

impl Station {
    /// A station of this address, 1 to 247.
    pub const fn new(address: u8) -> Self {
        Self {
            address,
            counters: Counters {
                bus_messages: 0,
                bus_errors: 0,
                exceptions: 0,
                messages: 0,
                unanswered: 0,
                overruns: 0,
            },
            listens_only: false,
        }
    }

    /// Something on the line was no frame.
    pub fn broken(&mut self, broken: Broken) {
        count(&mut self.counters.bus_errors);
        if broken == Broken::Long {
            count(&mut self.counters.overruns);
        }
    }

    /// A frame, and what is sent back, if anything; `respond` does what is not the line's own business.
    pub fn receive(
        &mut self,
        frame: &[u8],
        respond: impl FnOnce(&[u8], &mut Pdu),
    ) -> Option<Frame> {
        let (&address, request) = frame.split_first()?;
        count(&mut self.counters.bus_messages);
        if address != self.address && address != BROADCAST {
            return None;
        }
        count(&mut self.counters.messages);
        let mut reply = Pdu::new();
        let function = request.first().copied();
        let answers = match function {
            Some(DIAGNOSTICS) => self.diagnose(request, &mut reply),
            _ if self.listens_only => false,
            // nobody could hear what a broadcast reads
            Some(function) if address == BROADCAST && !writes(function) => false,
            _ => {
                respond(request, &mut reply);
                true
            }
        };
        if is_exception(&reply) {
            count(&mut self.counters.exceptions);
        }
        if !answers || address == BROADCAST || reply.is_empty() {
            count(&mut self.counters.unanswered);
            return None;
        }
        let mut frame = Frame::new();
        // fits: a frame holds the longest PDU
        frame.extend([address]);
        frame.extend(reply);
        let sum = checksum(&frame);
        frame.extend(sum);
        Some(frame)
    }

    /// Function 8; false where it is not answered.
    fn diagnose(&mut self, request: &[u8], reply: &mut Pdu) -> bool {
        match self.diagnosis(request) {
            Ok(Some(data)) => reply.extend(request.iter().copied().take(3).chain(data)),
            Ok(None) => return false,
            Err(_) if self.listens_only => return false,
            Err(exception) => refuse(DIAGNOSTICS, exception, reply),
        }
        true
    }

    fn diagnosis(&mut self, request: &[u8]) -> Result<Option<Vec<u8, PDU_MAX>>, Exception> {
        use diagnostics::*;
        let (sub, data) = match *request {
            [_, a, b, ref data @ ..] if data.len() >= 2 => (u16::from_be_bytes([a, b]), data),
            _ => return Err(Exception::IllegalDataValue),
        };
        let zero = data == [0, 0];
        let c = &mut self.counters;
        let told = match sub {
            ECHO => {
                // longer data than a PDU has cannot come
                let echo = Vec::from_slice(data).map_err(|_| Exception::IllegalDataValue)?;
                return Ok((!self.listens_only).then_some(echo));
            }
            RESTART if zero || data == [0xff, 0] => {
                let silent = core::mem::take(&mut self.listens_only);
                self.counters = Counters::default();
                let echo = Vec::from_slice(data).unwrap_or_default();
                return Ok((!silent).then_some(echo));
            }
            LISTEN_ONLY if zero => {
                self.listens_only = true;
                return Ok(None);
            }
            CLEAR if zero => {
                *c = Counters::default();
                0
            }
            CLEAR_OVERRUNS if zero => {
                c.overruns = 0;
                0
            }
            REGISTER | NAKS | BUSY if zero => 0,
            BUS_MESSAGES if zero => c.bus_messages,
            BUS_ERRORS if zero => c.bus_errors,
            EXCEPTIONS if zero => c.exceptions,
            MESSAGES if zero => c.messages,
            UNANSWERED if zero => c.unanswered,
            OVERRUNS if zero => c.overruns,
            RESTART | REGISTER | LISTEN_ONLY | CLEAR..=OVERRUNS | CLEAR_OVERRUNS => {
                return Err(Exception::IllegalDataValue);
            }
            _ => return Err(Exception::IllegalFunction),
        };
        let told = Vec::from_slice(&told.to_be_bytes()).unwrap_or_default();
        Ok((!self.listens_only).then_some(told))
    }
}

fn count(counter: &mut u16) {
    *counter = counter.wrapping_add(1);
}

/// Functions that change something, and so make sense as a broadcast.
fn writes(function: u8) -> bool {
    matches!(function, 5 | 6 | 15 | 16 | 22 | 23)
}

/// Serves a line for good: what its driver reports, noise or an overrun, ends nothing.
pub async fn serve_line<S, M>(mut port: S, service: Service<'_, M>, address: u8, gaps: Gaps)
where
    S: Read + Write,
    M: RawMutex,
{
    let mut station = Station::new(address);
    if let Some(client) = service.enter(Peer::Serial, Protocol::ModbusRtu) {
        while session(&mut port, &client, &mut station, gaps)
            .await
            .is_err()
        {}
    }
}

/// Serves a line for good, or until it breaks.
///
/// `port` gives bytes as they come. What it sends must go out without being flushed.
pub async fn session<S, M>(
    port: &mut S,
    client: &Client<'_, M>,
    station: &mut Station,
    gaps: Gaps,
) -> Result<(), S::Error>
where
    S: Read + Write,
    M: RawMutex,
{
    let mut framer = Framer::new(gaps);
    let mut received = [0; 64];
    loop {
        let read = port.read(&mut received);
        let read = match framer.ends() {
            Some(end) => with_deadline(end, read).await,
            None => Ok(read.await),
        };
        let now = Instant::now();
        match framer.silence(now) {
            None => {}
            Some(Err(broken)) => {
                station.broken(broken);
                client.line_error();
            }
            Some(Ok(frame)) => {
                let reply = station.receive(&frame, |pdu, reply| serve(client, pdu, reply));
                if let Some(reply) = reply {
                    let delay = response_delay(&client.service());
                    if delay > Duration::MIN {
                        Timer::after(delay).await;
                    }
                    port.write_all(&reply).await?;
                }
            }
        }
        match read {
            Ok(Ok(0)) => return Ok(()),
            Ok(Ok(n)) => received[..n]
                .iter()
                .for_each(|byte| framer.byte(now, *byte)),
            Ok(Err(error)) => return Err(error),
            Err(_) => {}
        }
    }
}
