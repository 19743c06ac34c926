//! Modbus over a stream: frames out of bytes, and the session of one client.
//!
//! Not here: sockets, the accept loop, who may connect; nor the gateway's use of the unit identifier: every
//! unit is answered alike, with its own number.
//!
//! A client that breaks the framing is disconnected, since what follows cannot be trusted. So is one that sends
//! nothing for long, that leaves a request half sent, or that does not read its replies: a place is scarce.
//!
//! Source: MODBUS Messaging on TCP/IP Implementation Guide V1.0b, sections 3.1 and 4.

use core::mem;

use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::{Duration, Instant, Timer, with_deadline, with_timeout};
use embedded_io_async::{Error as _, ErrorKind, Read, Write};
use heapless::Vec;

use super::pdu::{PDU_MAX, Pdu};
use super::{response_delay, serve};
use crate::link::Client;

/// The MBAP header up to and with the length, which counts what follows it; in bytes.
const PREFIX: usize = 6;
/// The unit identifier, last of the header; in bytes.
const UNIT: usize = 1;
const HEADER: usize = PREFIX + UNIT;
/// The protocol identifier of Modbus.
const PROTOCOL: [u8; 2] = [0, 0];
/// Longest frame, in bytes.
pub const ADU_MAX: usize = HEADER + PDU_MAX;

/// The bytes are not Modbus TCP: another protocol, or a length that no frame has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Malformed;

/// A whole request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Adu<'a> {
    /// Chosen by the client, to be echoed.
    pub transaction: [u8; 2],
    /// Likewise.
    pub unit: u8,
    /// Function code and data, at least one byte.
    pub pdu: &'a [u8],
}

/// Gathers frames from a stream, however it is cut.
#[derive(Clone, Debug)]
pub struct Reassembler {
    frame: [u8; ADU_MAX],
    filled: usize,
}

impl Default for Reassembler {
    fn default() -> Self {
        Self {
            frame: [0; ADU_MAX],
            filled: 0,
        }
    }
}

impl Reassembler {
    /// Takes bytes off the front of `input`: until a request is whole, or else all of them.
    ///
    /// # Errors
    /// The stream is not Modbus TCP, and stays so.
    pub fn push(&mut self, input: &mut &[u8]) -> Result<Option<Adu<'_>>, Malformed> {
        loop {
            let missing = self.wanted()? - self.filled;
            if missing == 0 {
                break;
            }
            if input.is_empty() {
                return Ok(None);
            }
            let (taken, rest) = input.split_at(missing.min(input.len()));
            self.frame[self.filled..][..taken.len()].copy_from_slice(taken);
            self.filled += taken.len();
            *input = rest;
        }
        let [t, u, _, _, _, _, unit, ..] = self.frame;
        Ok(Some(Adu {
            transaction: [t, u],
            unit,
            // The next call begins the next frame.
            pdu: &self.frame[HEADER..mem::take(&mut self.filled)],
        }))
    }

    /// No request is half there.
    pub fn is_empty(&self) -> bool {
        self.filled == 0
    }

    /// Bytes to gather in all: first those that tell the length, then the frame.
    fn wanted(&self) -> Result<usize, Malformed> {
        if self.filled < PREFIX {
            return Ok(PREFIX);
        }
        let [_, _, p, q, a, b, ..] = self.frame;
        let length = usize::from(u16::from_be_bytes([a, b]));
        if [p, q] == PROTOCOL && (UNIT + 1..=UNIT + PDU_MAX).contains(&length) {
            Ok(PREFIX + length)
        } else {
            Err(Malformed)
        }
    }
}

/// How long a session waits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timeouts {
    /// For the next request.
    pub idle: Duration,
    /// For the rest of a request, from its first byte on.
    pub half_request: Duration,
    /// For the client to make room for a reply.
    pub write: Duration,
}

impl Default for Timeouts {
    fn default() -> Self {
        Self {
            idle: Duration::from_secs(60),
            half_request: Duration::from_secs(1),
            write: Duration::from_secs(5),
        }
    }
}

/// Why a session ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// The client closed the connection.
    Closed,
    /// No request came.
    Idle,
    /// Half a request came.
    Stalled,
    /// The client does not speak Modbus TCP.
    Malformed,
    /// The client does not read its replies.
    NotReading,
    /// The connection broke.
    Broken(ErrorKind),
}

/// Serves one client until it goes, or has to; the caller then closes or aborts the stream.
///
/// Requests are answered one by one in their order, each as one event on the image. `answered` is called after
/// each reply. What is written must travel without being flushed, and without Nagle's delay.
pub async fn session<S, M>(
    stream: &mut S,
    client: &Client<'_, M>,
    timeouts: &Timeouts,
    mut answered: impl FnMut(),
) -> End
where
    S: Read + Write,
    M: RawMutex,
{
    let mut requests = Reassembler::default();
    let mut received = [0; ADU_MAX];
    let mut deadline = Instant::now() + timeouts.idle;
    loop {
        let mut input = match with_deadline(deadline, stream.read(&mut received)).await {
            Ok(Ok(0)) => return End::Closed,
            Ok(Ok(n)) => &received[..n],
            Ok(Err(error)) => return End::Broken(error.kind()),
            Err(_) if requests.is_empty() => return End::Idle,
            Err(_) => return End::Stalled,
        };
        let mut begins = requests.is_empty();
        loop {
            let reply = match requests.push(&mut input) {
                Ok(Some(request)) => {
                    let delay = response_delay(&client.service());
                    if delay > Duration::MIN {
                        Timer::after(delay).await;
                    }
                    reply(&request, client)
                }
                Ok(None) => break,
                Err(Malformed) => return End::Malformed,
            };
            match with_timeout(timeouts.write, stream.write_all(&reply)).await {
                Ok(Ok(())) => answered(),
                Ok(Err(error)) => return End::Broken(error.kind()),
                Err(_) => return End::NotReading,
            }
            begins = true;
        }
        // Dripping bytes does not prolong the time of a request.
        if requests.is_empty() {
            deadline = Instant::now() + timeouts.idle;
        } else if begins {
            deadline = Instant::now() + timeouts.half_request;
        }
    }
}

/// The whole reply frame, to go out in one piece.
fn reply<M: RawMutex>(request: &Adu, client: &Client<'_, M>) -> Vec<u8, ADU_MAX> {
    let mut pdu = Pdu::new();
    serve(client, request.pdu, &mut pdu);
    let [t, u] = request.transaction;
    let [p, q] = PROTOCOL;
    let [a, b] = ((UNIT + pdu.len()) as u16).to_be_bytes();
    let mut frame = Vec::new();
    // Fits: a header and at most the longest PDU.
    frame.extend([t, u, p, q, a, b, request.unit]);
    frame.extend(pdu);
    frame
}
