//! Browsers that look at the simulator's page, beside a PLC that winds.
//!
//! Not here: a browser. What comes over the cable is what counts: a stream of signals for each, at the page's highest
//! rate, and what the page asks besides.

use anyhow::{Result, bail, ensure};
use model_core::image::{Feedback, SIGNALS};
use serde_json::json;
use smoltcp::iface::SocketHandle;

use super::host::Host;
use super::plc::Tcp;
use super::{GUEST, Load, Traffic};

const HTTP_PORT: u16 = 80;
/// Browsers at once.
const BROWSERS: usize = 3;
/// Signals that a page shows at once, …
const SHOWN: usize = 48;
/// … and samples of them in a second.
const RATE: u32 = 50;
/// The largest of the page's files, and what it asks all the time, …
const ASKED: [&str; 5] = [
    "/app.js",
    "/api/v1/info",
    "/api/v1/panel",
    "/api/v1/link",
    "/api/v1/health",
];
/// … one of them so often, ms.
const ASK_EVERY: u64 = 100;

/// A stream of signals (WebSocket, RFC 6455).
struct Stream {
    socket: SocketHandle,
    heard: Vec<u8>,
    state: State,
    samples: u64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum State {
    Connecting,
    /// The upgrade is asked for.
    Asked,
    /// What comes are frames.
    Open,
}

impl Stream {
    fn on(host: &mut Host) -> Self {
        Self {
            socket: host.socket(),
            heard: Vec::new(),
            state: State::Connecting,
            samples: 0,
        }
    }

    fn step(&mut self, host: &mut Host) -> Result<()> {
        if host.connect(self.socket, HTTP_PORT)? {
            ensure!(self.state == State::Connecting, "a stream has broken off");
        }
        host.take(self.socket, &mut self.heard)?;
        match self.state {
            State::Connecting if host.connected(self.socket) => {
                host.send(self.socket, upgrade().as_bytes())?;
                self.state = State::Asked;
            }
            State::Asked => {
                if let Some(head) = head(&mut self.heard) {
                    ensure!(head.starts_with("HTTP/1.1 101"), "no stream: {head}");
                    host.send(self.socket, &wish())?;
                    self.state = State::Open;
                }
            }
            State::Open => {
                while let Some(text) = frame(&mut self.heard)? {
                    // the wish comes back first
                    self.samples += u64::from(text.first() == Some(&b'['));
                }
            }
            State::Connecting => {}
        }
        Ok(())
    }
}

fn upgrade() -> String {
    // the key is the RFC's own example: it need not be secret
    format!(
        "GET /api/v1/live HTTP/1.1\r\nHost: {GUEST}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n\
         Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
    )
}

/// The frame that says which signals.
fn wish() -> Vec<u8> {
    const FINAL_TEXT: u8 = 0x81;
    const MASKED_16: u8 = 0x80 | LONG;
    // a client masks what it says; any mask will do
    const MASK: [u8; 4] = [0x37, 0xfa, 0x21, 0x3d];
    let names: Vec<_> = SIGNALS.iter().rev().take(SHOWN).map(|s| s.name).collect();
    let text = json!({"signals": names, "hz": RATE}).to_string();
    let mut frame = vec![FINAL_TEXT, MASKED_16];
    frame.extend((text.len() as u16).to_be_bytes());
    frame.extend(MASK);
    frame.extend(text.bytes().zip(MASK.iter().cycle()).map(|(b, m)| b ^ m));
    frame
}

/// A length byte that says: two more follow.
const LONG: u8 = 126;

/// Takes a whole frame of the guest's, which is not masked: what is in it.
fn frame(heard: &mut Vec<u8>) -> Result<Option<Vec<u8>>> {
    let (begin, length) = match heard[..] {
        [_, LONG, high, low, ..] => (4, usize::from(u16::from_be_bytes([high, low]))),
        [_, length, ..] if length < LONG => (2, usize::from(length)),
        [_, length, ..] if length > LONG => bail!("a frame of length byte {length}"),
        _ => return Ok(None),
    };
    if heard.len() < begin + length {
        return Ok(None);
    }
    Ok(Some(heard.drain(..begin + length).skip(begin).collect()))
}

/// Takes the head of an answer, with its empty line.
fn head(heard: &mut Vec<u8>) -> Option<String> {
    const END: &[u8] = b"\r\n\r\n";
    let at = heard.windows(END.len()).position(|bytes| bytes == END)?;
    let head = heard.drain(..at + END.len());
    Some(String::from_utf8_lossy(head.as_slice()).into_owned())
}

/// What a page asks beside its stream, each on a connection of its own.
struct Asker {
    socket: SocketHandle,
    heard: Vec<u8>,
    asked: usize,
    answered: usize,
    bytes: usize,
}

impl Asker {
    fn on(host: &mut Host) -> Self {
        Self {
            socket: host.socket(),
            heard: Vec::new(),
            asked: 0,
            answered: 0,
            bytes: 0,
        }
    }

    fn step(&mut self, millisecond: u64, host: &mut Host) -> Result<()> {
        host.take(self.socket, &mut self.heard)?;
        if self.asked > self.answered {
            // the end of an answer is that of its connection
            if !host.is_open(self.socket) {
                let answer = String::from_utf8_lossy(&self.heard);
                ensure!(answer.starts_with("HTTP/1.1 200"), "an answer: {answer}");
                self.bytes += self.heard.len();
                self.heard.clear();
                self.answered += 1;
            }
            return Ok(());
        }
        if millisecond.is_multiple_of(ASK_EVERY) {
            host.connect(self.socket, HTTP_PORT)?;
        }
        if host.connected(self.socket) {
            let path = ASKED[self.asked % ASKED.len()];
            let request =
                format!("GET {path} HTTP/1.1\r\nHost: {GUEST}\r\nConnection: close\r\n\r\n");
            host.send(self.socket, request.as_bytes())?;
            self.asked += 1;
        }
        Ok(())
    }
}

/// Three pages, and a PLC.
pub struct Page {
    host: Host,
    plc: Tcp,
    streams: [Stream; BROWSERS],
    asker: Asker,
}

impl Page {
    pub fn new() -> Self {
        let mut host = Host::new();
        Self {
            plc: Tcp::on(&mut host),
            streams: std::array::from_fn(|_| Stream::on(&mut host)),
            asker: Asker::on(&mut host),
            host,
        }
    }
}

impl Load for Page {
    fn beat(&mut self, millisecond: u64, heard: Traffic) -> Result<Traffic> {
        self.host.hear(millisecond, heard.frames);
        self.plc.step(millisecond, &mut self.host)?;
        for stream in &mut self.streams {
            stream.step(&mut self.host)?;
        }
        self.asker.step(millisecond, &mut self.host)?;
        Ok(Traffic::of(self.host.say(millisecond)))
    }

    fn done(&self) -> Result<String> {
        let samples = self.streams.iter().map(|stream| stream.samples);
        let fewest = samples.clone().min().unwrap_or_default();
        ensure!(fewest > 0, "a stream has brought nothing");
        ensure!(
            self.asker.answered >= ASKED.len(),
            "the page was answered {} times only",
            self.asker.answered
        );
        let samples: u64 = samples.sum();
        Ok(format!(
            "{samples} samples in {BROWSERS} streams, {} requests for {} bytes; {}",
            self.asker.answered,
            self.asker.bytes,
            self.plc.done()?
        ))
    }

    fn feedback(&self) -> Option<&Feedback> {
        Some(self.plc.feedback())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Examples of RFC 6455, section 5.7.
    #[test]
    fn frames_are_taken_whole() {
        let hello = [0x81, 0x05, 0x48, 0x65, 0x6c, 0x6c, 0x6f];
        let mut heard = hello[..6].to_vec();
        assert_eq!(frame(&mut heard).unwrap(), None);
        heard.push(hello[6]);
        heard.extend([0x82, 0x7e, 0x01, 0x00]);
        heard.extend([0; 255]);
        assert_eq!(frame(&mut heard).unwrap(), Some(b"Hello".to_vec()));
        assert_eq!(frame(&mut heard).unwrap(), None);
        heard.push(1);
        assert_eq!(frame(&mut heard).unwrap().map(|f| f.len()), Some(256));
        assert!(heard.is_empty());
        heard.extend([0x82, 0x7f, 0, 0, 0, 0, 0, 1, 0, 0]);
        assert!(frame(&mut heard).is_err());
    }

    #[test]
    fn a_head_ends_with_an_empty_line() {
        let mut heard = b"HTTP/1.1 101 Switching\r\nA: b\r\n".to_vec();
        assert_eq!(head(&mut heard), None);
        heard.extend(b"\r\n\x81\x00");
        assert!(head(&mut heard).is_some_and(|head| head.ends_with("A: b\r\n\r\n")));
        assert_eq!(heard, [0x81, 0]);
    }
}
