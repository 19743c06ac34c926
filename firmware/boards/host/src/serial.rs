//! The serial line: a device of this PC, or a pseudoterminal that the board makes.
//!
//! Not here: the characters' own times. The kernel hands bytes on in pieces, and at a pseudoterminal the speed means nothing:
//! one gap, longer than any pause within a frame, stands for both silences of the line.

use std::io;
use std::str::FromStr;
use std::sync::Arc;

use embassy_time::Duration;
use embedded_io_adapters::tokio_1::FromTokio;
use firmware::link::control::{Peer, Protocol};
use firmware::link::modbus::rtu::{Gaps, Station, session};
use tokio_serial::{SerialPort, SerialPortBuilderExt, SerialStream};

use crate::Server;

/// The station's address on its line.
pub const STATION: u8 = 1;
/// Longer than a writer pauses within a frame.
const GAP: Duration = Duration::from_millis(10);
/// Modbus's own speed, Bd.
const BAUD: u32 = 19_200;

/// A serial line to be served.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Line {
    /// A pseudoterminal of the board's own.
    Pseudoterminal,
    /// A device, and its speed in Bd; 8 bits, no parity.
    Device(String, u32),
}

impl FromStr for Line {
    type Err = String;

    /// `pty`, or a device as `/dev/ttyUSB0` or `/dev/ttyUSB0:9600`.
    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once(':') {
            _ if text == "pty" => Ok(Self::Pseudoterminal),
            _ if text.is_empty() => Err("a serial line is `pty` or a device".into()),
            None => Ok(Self::Device(text.into(), BAUD)),
            Some((device, baud)) => match baud.parse() {
                Ok(baud) if baud > 0 => Ok(Self::Device(device.into(), baud)),
                _ => Err(format!("{baud} is no speed in Bd")),
            },
        }
    }
}

/// An open line.
pub(crate) struct Port {
    stream: SerialStream,
    /// Where its other end is opened.
    pub(crate) path: String,
    gap: Duration,
    /// A pseudoterminal hangs up when nobody has its other end open.
    _other: Option<SerialStream>,
}

impl Port {
    /// Opens it, within a runtime.
    pub(crate) fn open(line: &Line) -> io::Result<Self> {
        Ok(match line {
            Line::Pseudoterminal => {
                let (stream, other) = SerialStream::pair()?;
                Self {
                    stream,
                    path: other.name().unwrap_or_default(),
                    gap: GAP,
                    _other: Some(other),
                }
            }
            Line::Device(path, baud) => Self {
                stream: tokio_serial::new(path, *baud).open_native_async()?,
                path: path.clone(),
                gap: GAP.max(Gaps::of_baud(*baud).between),
                _other: None,
            },
        })
    }

    /// Serves it until it breaks.
    pub(crate) async fn serve(self, server: Arc<Server>) {
        let service = server.service();
        let Some(client) = service.enter(Peer::Serial, Protocol::ModbusRtu) else {
            return;
        };
        let mut station = Station::new(STATION);
        let mut stream = FromTokio::new(self.stream);
        let _ = session(&mut stream, &client, &mut station, Gaps::tolerant(self.gap)).await;
    }
}
