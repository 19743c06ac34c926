//! A Modbus RTU station on its line.
//!
//! Not here: what is asked, of which [`pdu`](super::pdu) has enough; silences below 10 ms, which a pseudoterminal cannot
//! make; parity. A case writes to the scratch registers, and the last one puts back what was there.
//!
//! LINE is the MODBUS over Serial Line Specification and Implementation Guide V1.02.

use std::io::{self, ErrorKind, Read, Write};
use std::thread;
use std::time::Duration;

use anyhow::{Context, Result};
use firmware::link::modbus::rtu::checksum;
use serialport::{ClearBuffer, SerialPort};

use super::{Map, Outcome, hex};

/// A reply begins within milliseconds; this long without one there is none.
const PATIENCE: Duration = Duration::from_millis(300);
/// A line that was just opened may take longer: QEMU looks once a second whether anybody is at its pseudoterminal.
const OPENING: Duration = Duration::from_secs(2);
/// A silence that ends a frame for everybody.
const SILENCE: Duration = Duration::from_millis(40);

/// A station and its line.
pub struct Line {
    port: Box<dyn SerialPort>,
    station: u8,
    scratch: u16,
    /// How long a reply is waited for.
    patience: Duration,
}

type Case = (
    &'static str,
    &'static str,
    &'static str,
    &'static str,
    fn(&mut Line) -> Result<(), String>,
);

/// Address of all stations.
const BROADCAST: u8 = 0;
const DIAGNOSTICS: u8 = 8;
/// Subfunctions of the diagnostics.
const ECHO: u16 = 0;
const RESTART: u16 = 1;
const LISTEN_ONLY: u16 = 4;
const CLEAR: u16 = 10;
const BUS_MESSAGES: u16 = 11;
const BUS_ERRORS: u16 = 12;
const EXCEPTIONS: u16 = 13;
const MESSAGES: u16 = 14;
const UNANSWERED: u16 = 15;

const CASES: &[Case] = &[
    (
        "a read",
        "LINE 2.5.1",
        "function 3",
        "a reply with address and checksum",
        |line| line.is_read(),
    ),
    (
        "an exception",
        "LINE 2.5.1",
        "function 9",
        "exception 1",
        |line| line.wants(&[9], &[0x89, 1]),
    ),
    (
        "shortest frame",
        "LINE 2.5.1",
        "function 3 alone, 4 bytes",
        "exception 3",
        |line| line.wants(&[3], &[0x83, 3]),
    ),
    (
        "longest frame",
        "LINE 2.5.1",
        "function 16, 123 registers, 255 bytes",
        "the write, or exception 2",
        longest,
    ),
    (
        "bad checksum",
        "LINE 2.5.1.2",
        "a read, its last byte wrong",
        "silence",
        |line| {
            let mut frame = line.read_frame();
            *frame.last_mut().ok_or("no frame")? ^= 1;
            line.silent(&frame)
        },
    ),
    (
        "another station",
        "LINE 2.2",
        "a read of another address",
        "silence",
        |line| {
            let frame = line.frame(line.station ^ 0x55, &line.read());
            line.silent(&frame)
        },
    ),
    (
        "three bytes",
        "LINE 2.5.1",
        "an address and a checksum",
        "silence",
        |line| {
            let frame = line.frame(line.station, &[]);
            line.silent(&frame)
        },
    ),
    (
        "257 bytes",
        "LINE 2.5.1",
        "a frame longer than any",
        "silence",
        |line| {
            let frame = line.frame(line.station, &[3; 254]);
            line.silent(&frame)
        },
    ),
    (
        "noise before a frame",
        "LINE 2.5.1.1",
        "3 bytes, a silence, a read",
        "a reply",
        |line| {
            line.silent(&[0x55, 0xaa, 0xff])?;
            line.is_read()
        },
    ),
    (
        "noise in a frame",
        "LINE 2.5.1.2",
        "a read with a byte more before it",
        "silence",
        |line| {
            let frame = [&[0xff][..], &line.read_frame()].concat();
            line.silent(&frame)
        },
    ),
    (
        "a gap in a frame",
        "LINE 2.5.1.1",
        "half a read, a silence, the rest",
        "silence",
        |line| {
            let frame = line.read_frame();
            let (begin, end) = frame.split_at(4);
            line.send(begin)?;
            thread::sleep(SILENCE);
            line.silent(end)
        },
    ),
    (
        "frames one after the other",
        "LINE 2.5.1.1",
        "10 reads, each after a reply",
        "10 replies",
        |line| (0..10).try_for_each(|_| line.is_read()),
    ),
    (
        "broadcast, a read",
        "LINE 2.2",
        "function 3 to address 0",
        "silence",
        |line| {
            let frame = line.frame(BROADCAST, &line.read());
            line.silent(&frame)
        },
    ),
    (
        "broadcast, a write",
        "LINE 2.2",
        "function 6 to address 0",
        "silence, and it is written",
        broadcast,
    ),
    ("diagnostics, echo", "PDU 6.8", "8, 0", "the same", |line| {
        line.diagnoses(ECHO, 0xa55a, 0xa55a)
    }),
    (
        "diagnostics, no such one",
        "PDU 6.8",
        "8, 99",
        "exception 1",
        |line| line.wants(&[DIAGNOSTICS, 0, 99, 0, 0], &[0x88, 1]),
    ),
    (
        "diagnostics, counters",
        "PDU 6.8",
        "8, 10, then good and bad frames",
        "8, 11 to 15 count them",
        counters,
    ),
    (
        "diagnostics, listen only",
        "PDU 6.8",
        "8, 4; a read; 8, 1",
        "silence; silence; silence; then replies",
        listen_only,
    ),
];

/// Runs the cases at the station of a line.
///
/// # Errors
/// The line cannot be opened.
pub fn run(
    path: &str,
    baud: u32,
    station: u8,
    map: &Map,
    mut keep: impl FnMut(Outcome),
) -> Result<()> {
    let port = serialport::new(path, baud).open();
    let mut line = Line {
        port: port.with_context(|| format!("cannot open the serial line {path}"))?,
        station,
        scratch: map.scratch,
        patience: OPENING,
    };
    let held = line.held();
    line.patience = PATIENCE;
    for (id, source, sent, wanted, case) in CASES {
        thread::sleep(SILENCE);
        // what a case has left behind is not the next one's
        line.port.clear(ClearBuffer::Input)?;
        keep(Outcome {
            id,
            source,
            sent: (*sent).into(),
            wanted: (*wanted).into(),
            failed: case(&mut line).err(),
        });
    }
    if let Ok(held) = held {
        // nobody is left to be told
        let _ = line.ask(&line.write(held));
    }
    Ok(())
}

impl Line {
    fn frame(&self, address: u8, pdu: &[u8]) -> Vec<u8> {
        let mut frame = [&[address], pdu].concat();
        frame.extend(checksum(&frame));
        frame
    }

    /// The request for the first scratch register.
    fn read(&self) -> Vec<u8> {
        let [a, b] = self.scratch.to_be_bytes();
        vec![3, a, b, 0, 1]
    }

    /// The request that writes it.
    fn write(&self, value: u16) -> Vec<u8> {
        let ([a, b], [c, d]) = (self.scratch.to_be_bytes(), value.to_be_bytes());
        vec![6, a, b, c, d]
    }

    fn read_frame(&self) -> Vec<u8> {
        self.frame(self.station, &self.read())
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), String> {
        self.port
            .write_all(bytes)
            .map_err(|error| error.to_string())
    }

    /// All that comes until it is silent.
    fn heard(&mut self) -> Result<Vec<u8>, String> {
        let (mut heard, mut bytes) = (Vec::new(), [0; 512]);
        let mut patience = self.patience;
        loop {
            self.port
                .set_timeout(patience)
                .map_err(|error| error.to_string())?;
            match self.port.read(&mut bytes) {
                Ok(n) => heard.extend(&bytes[..n]),
                Err(error) if error.kind() == ErrorKind::TimedOut => return Ok(heard),
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(io::Error::to_string(&error)),
            }
            patience = SILENCE;
        }
    }

    /// The PDU that a request is answered with.
    fn ask(&mut self, pdu: &[u8]) -> Result<Vec<u8>, String> {
        let frame = self.frame(self.station, pdu);
        self.send(&frame)?;
        let heard = self.heard()?;
        match &heard[..] {
            [] => Err("silence".into()),
            [address, pdu @ .., _, _]
                if *address == self.station && self.frame(*address, pdu) == heard =>
            {
                Ok(pdu.to_vec())
            }
            other => Err(hex(other)),
        }
    }

    fn wants(&mut self, pdu: &[u8], wanted: &[u8]) -> Result<(), String> {
        let reply = self.ask(pdu)?;
        if reply == wanted {
            Ok(())
        } else {
            Err(hex(&reply))
        }
    }

    fn silent(&mut self, bytes: &[u8]) -> Result<(), String> {
        self.send(bytes)?;
        let heard = self.heard()?;
        if heard.is_empty() {
            Ok(())
        } else {
            Err(hex(&heard))
        }
    }

    fn held(&mut self) -> Result<u16, String> {
        match self.ask(&self.read())?[..] {
            [3, 2, a, b] => Ok(u16::from_be_bytes([a, b])),
            ref other => Err(hex(other)),
        }
    }

    fn is_read(&mut self) -> Result<(), String> {
        self.held().map(drop)
    }

    fn diagnosis(sub: u16, data: u16) -> Vec<u8> {
        [&[DIAGNOSTICS][..], &sub.to_be_bytes(), &data.to_be_bytes()].concat()
    }

    fn diagnoses(&mut self, sub: u16, data: u16, wanted: u16) -> Result<(), String> {
        let told = self.wants(&Self::diagnosis(sub, data), &Self::diagnosis(sub, wanted));
        told.map_err(|error| format!("8, {sub}: {error}"))
    }
}

fn longest(line: &mut Line) -> Result<(), String> {
    const REGISTERS: u8 = 123;
    let [a, b] = line.scratch.to_be_bytes();
    let zeros = [0; 2 * REGISTERS as usize];
    let request = [&[16, a, b, 0, REGISTERS, 2 * REGISTERS][..], &zeros].concat();
    match line.ask(&request)?[..] {
        [16, _, _, _, REGISTERS] | [0x90, 2] => Ok(()),
        ref other => Err(hex(other)),
    }
}

fn broadcast(line: &mut Line) -> Result<(), String> {
    let other = line.held()? ^ 1;
    let frame = line.frame(BROADCAST, &line.write(other));
    line.silent(&frame)?;
    match line.held()? {
        held if held == other => Ok(()),
        held => Err(format!("not written: {held}")),
    }
}

fn counters(line: &mut Line) -> Result<(), String> {
    line.diagnoses(CLEAR, 0, 0)?;
    line.is_read()?;
    line.wants(&[9], &[0x89, 1])?;
    let mut bad = line.read_frame();
    bad[2] ^= 1;
    line.silent(&bad)?;
    let other = line.frame(line.station ^ 0x55, &line.read());
    line.silent(&other)?;
    let broadcast = line.frame(BROADCAST, &line.read());
    line.silent(&broadcast)?;
    // each of these counts itself, too
    line.diagnoses(BUS_MESSAGES, 0, 5)?;
    line.diagnoses(BUS_ERRORS, 0, 1)?;
    line.diagnoses(EXCEPTIONS, 0, 1)?;
    line.diagnoses(MESSAGES, 0, 7)?;
    line.diagnoses(UNANSWERED, 0, 1)
}

fn listen_only(line: &mut Line) -> Result<(), String> {
    let listen = line.frame(line.station, &Line::diagnosis(LISTEN_ONLY, 0));
    line.silent(&listen)?;
    let read = line.read_frame();
    line.silent(&read)?;
    let restart = line.frame(line.station, &Line::diagnosis(RESTART, 0));
    line.silent(&restart)?;
    line.is_read()
}
