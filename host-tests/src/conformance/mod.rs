//! Does a Modbus server do what the specification wants? A table of cases, for any server.
//!
//! Not here: what the registers mean, idle times of a minute, and what needs raw packets (half-open connections,
//! floods). A case writes only to the registers of [`Map::scratch`], and what it finds there it puts back.
//!
//! | Part | What |
//! |---|---|
//! | [`pdu`] | one request and the reply to it |
//! | [`stream`] | frames on a connection, and connections |
//! | [`serial`] | the same PDU, and frames, on a serial line |
//! | [`peers`] | servers of others, to compare |
//!
//! Sources, as the cases cite them: PDU is the MODBUS Application Protocol Specification V1.1b3, TCP the MODBUS
//! Messaging on TCP/IP Implementation Guide V1.0b.

pub mod pdu;
pub mod peers;
pub mod serial;
pub mod stream;

use std::fmt;
use std::io::{self, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::time::Duration;

use firmware::link::modbus::tcp::ADU_MAX;
use model_core::image::{COMMAND_WORDS, D_PRESET_2_UW, FEEDBACK_WORDS};

/// A reply takes milliseconds; this long without one there is none.
pub const PATIENCE: Duration = Duration::from_secs(2);

/// What a server has. Addresses count from 0, and end with the first that is refused.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct Map {
    /// Holding registers
    #[arg(long, default_value_t = COMMAND_WORDS as u16)]
    pub holding: u16,
    /// Input registers
    #[arg(long, default_value_t = FEEDBACK_WORDS as u16)]
    pub inputs: u16,
    /// Coils
    #[arg(long, default_value_t = 16 * COMMAND_WORDS as u16)]
    pub coils: u16,
    /// Discrete inputs
    #[arg(long, default_value_t = 16 * FEEDBACK_WORDS as u16)]
    pub discretes: u16,
    /// First of two holding registers that may be written; with coils, those of the same bits
    #[arg(long, default_value_t = D_PRESET_2_UW.word)]
    pub scratch: u16,
}

impl Default for Map {
    fn default() -> Self {
        Self {
            holding: COMMAND_WORDS as u16,
            inputs: FEEDBACK_WORDS as u16,
            coils: 16 * COMMAND_WORDS as u16,
            discretes: 16 * FEEDBACK_WORDS as u16,
            scratch: D_PRESET_2_UW.word,
        }
    }
}

/// The server that is looked at.
#[derive(Clone, Copy, Debug)]
pub struct Server {
    /// Where it listens.
    pub address: SocketAddr,
    /// What it has.
    pub map: Map,
}

/// A case, as it came out.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Name of the case.
    pub id: &'static str,
    /// Where the specification says so.
    pub source: &'static str,
    /// What is sent, or done.
    pub sent: String,
    /// What must come of it.
    pub wanted: String,
    /// What came instead, if it did.
    pub failed: Option<String>,
}

/// Runs every case, one after the other.
pub fn run(server: Server, mut each: impl FnMut(&Outcome)) -> Vec<Outcome> {
    let mut outcomes = Vec::new();
    let mut keep = |outcome: Outcome| {
        each(&outcome);
        outcomes.push(outcome);
    };
    pdu::run(server, &mut keep);
    stream::run(server, &mut keep);
    outcomes
}

/// A connection that speaks frames.
pub struct Client {
    /// The connection itself.
    pub stream: TcpStream,
    transaction: u16,
}

/// What a server does about a request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Reaction {
    /// It replies with this PDU.
    Reply(Vec<u8>),
    /// It closes the connection.
    Close,
    /// It does nothing.
    Silence,
    /// It sends something that is no reply to this request.
    Garbage(String),
}

impl fmt::Display for Reaction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Reply(pdu) => write!(f, "{}", hex(pdu)),
            Self::Close => f.write_str("closed"),
            Self::Silence => f.write_str("silence"),
            Self::Garbage(what) => f.write_str(what),
        }
    }
}

/// Bytes for people; long ones shortened.
pub fn hex(bytes: &[u8]) -> String {
    const SHOWN: usize = 12;
    let shown: Vec<_> = bytes
        .iter()
        .take(SHOWN)
        .map(|b| format!("{b:02x}"))
        .collect();
    match bytes.len() {
        0..=SHOWN => shown.join(" "),
        n => format!("{} … ({n} bytes)", shown.join(" ")),
    }
}

/// A request as it travels.
pub fn frame(transaction: u16, unit: u8, pdu: &[u8]) -> Vec<u8> {
    let length = (pdu.len() as u16 + 1).to_be_bytes();
    [
        &transaction.to_be_bytes()[..],
        &[0, 0],
        &length,
        &[unit],
        pdu,
    ]
    .concat()
}

impl Client {
    /// Connects.
    pub fn connect(address: SocketAddr) -> io::Result<Self> {
        let stream = TcpStream::connect_timeout(&address, PATIENCE)?;
        stream.set_read_timeout(Some(PATIENCE))?;
        stream.set_write_timeout(Some(PATIENCE))?;
        stream.set_nodelay(true)?;
        Ok(Self {
            stream,
            transaction: 0,
        })
    }

    /// Sends bytes; that the server has closed shows when its reply is read.
    pub fn send(&mut self, bytes: &[u8]) {
        let _ = self.stream.write_all(bytes);
    }

    /// One request, and what becomes of it.
    pub fn ask(&mut self, pdu: &[u8]) -> Reaction {
        self.transaction = self.transaction.wrapping_add(0x0101);
        let (transaction, unit) = (self.transaction, 1);
        self.send(&frame(transaction, unit, pdu));
        self.reply(transaction, unit)
    }

    /// The next reply, which must be that of this transaction and unit.
    pub fn reply(&mut self, transaction: u16, unit: u8) -> Reaction {
        let mut head = [0; 7];
        if let Some(reaction) = self.fill(&mut head) {
            return reaction;
        }
        let [t, u, p, q, a, b, from] = head;
        let length = usize::from(u16::from_be_bytes([a, b]));
        if u16::from_be_bytes([t, u]) != transaction || [p, q] != [0, 0] || from != unit {
            return Reaction::Garbage(format!("another header: {}", hex(&head)));
        }
        if !(2..=ADU_MAX - 6).contains(&length) {
            return Reaction::Garbage(format!("a length of {length}"));
        }
        let mut pdu = vec![0; length - 1];
        self.fill(&mut pdu).unwrap_or(Reaction::Reply(pdu))
    }

    /// Reads all of it, or tells what came instead.
    fn fill(&mut self, bytes: &mut [u8]) -> Option<Reaction> {
        let mut filled = 0;
        while filled < bytes.len() {
            match self.stream.read(&mut bytes[filled..]) {
                Ok(0) => return Some(Reaction::Close),
                Ok(n) => filled += n,
                Err(error) if error.kind() == io::ErrorKind::WouldBlock && filled > 0 => {
                    return Some(Reaction::Garbage("half a reply".into()));
                }
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => {
                    return Some(Reaction::Silence);
                }
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(_) => return Some(Reaction::Close),
            }
        }
        None
    }
}

/// The outcomes as a table, and a line that sums them up.
pub fn table(outcomes: &[Outcome]) -> String {
    let mut text = String::new();
    let width = outcomes.iter().map(|o| o.id.len()).max().unwrap_or(0);
    for o in outcomes {
        let verdict = if o.failed.is_none() { "ok" } else { "FAILED" };
        text += &format!(
            "{verdict:6} {:width$} {:10} {} -> {}",
            o.id, o.source, o.sent, o.wanted
        );
        if let Some(failed) = &o.failed {
            text += &format!("; got {failed}");
        }
        text.push('\n');
    }
    let failed = outcomes.iter().filter(|o| o.failed.is_some()).count();
    text + &format!("{} cases, {failed} failed\n", outcomes.len())
}
