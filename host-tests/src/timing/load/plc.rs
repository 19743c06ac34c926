//! A winder PLC that winds, over Modbus TCP or over the serial line.
//!
//! Not here: a PLC that reacts. It follows [`twin::commands`] by the clock, whatever it is told.

use std::collections::VecDeque;

use anyhow::{Context, Result, ensure};
use board_host::STATION;
use firmware::link::modbus::rtu::checksum;
use model_core::drive::DRIVE_PERIOD_MS;
use model_core::image::{FEEDBACK_WORDS, Feedback, HEARTBEAT_PLC, MODE, PLC_COMMAND_WORDS};
use model_core::logic::Mode;
use model_core::machine::Machine;
use model_core::twin;
use smoltcp::iface::SocketHandle;

use super::host::Host;
use super::{Load, Traffic};
use crate::conformance::frame;

/// Modbus TCP.
const MODBUS_PORT: u16 = 502;
/// Any will do: over TCP there is one.
const UNIT: u8 = 1;
/// The drive cycle from which on the PLC goes on winding: before its script would stop.
const WINDING: u32 = 39 * 1000 / DRIVE_PERIOD_MS;
/// Function codes.
const READ_INPUT_REGISTERS: u8 = 4;
const WRITE_REGISTERS: u8 = 16;
const EXCEPTION: u8 = 0x80;

/// A program that writes its commands, reads all feedback, and winds: preset, web, drives on, thread, run, and goes on.
struct Program {
    machine: Machine,
    polls: u64,
    answers: u64,
    feedback: Feedback,
    has_run: bool,
}

impl Program {
    fn new() -> Self {
        Self {
            machine: Machine::news_8000(),
            polls: 0,
            answers: 0,
            feedback: Feedback::default(),
            has_run: false,
        }
    }

    /// What it asks at a millisecond: a write and a read.
    fn poll(&mut self, millisecond: u64) -> [Vec<u8>; 2] {
        let cycle = (millisecond / u64::from(DRIVE_PERIOD_MS)) as u32;
        let mut commands = twin::commands(&self.machine, cycle.min(WINDING));
        commands.set_word(&HEARTBEAT_PLC, cycle as u16);
        let words = &commands.words[..PLC_COMMAND_WORDS];
        let (count, bytes) = (words.len() as u8, 2 * words.len() as u8);
        let mut write = vec![WRITE_REGISTERS, 0, 0, 0, count, bytes];
        write.extend(words.iter().flat_map(|word| word.to_be_bytes()));
        self.polls += 1;
        let read = vec![READ_INPUT_REGISTERS, 0, 0, 0, FEEDBACK_WORDS as u8];
        [write, read]
    }

    fn answer(&mut self, pdu: &[u8]) -> Result<()> {
        let function = pdu.first().copied().unwrap_or_default();
        ensure!(
            function < EXCEPTION,
            "the firmware refuses a request: {pdu:?}"
        );
        if function == READ_INPUT_REGISTERS {
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
        Ok(())
    }

    fn mode(&self) -> Result<Mode> {
        let mode = Mode::ALL.get(usize::from(self.feedback.word(&MODE)));
        mode.copied().context("no such mode")
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
}

/// One that polls every drive cycle over Modbus TCP.
pub struct Tcp {
    program: Program,
    socket: SocketHandle,
    /// Requests that wait to be sent, and the beginning of an answer.
    requests: VecDeque<Vec<u8>>,
    answer: Vec<u8>,
    waiting: bool,
    transaction: u16,
}

impl Tcp {
    pub fn on(host: &mut Host) -> Self {
        Self {
            program: Program::new(),
            socket: host.socket(),
            requests: VecDeque::new(),
            answer: Vec::new(),
            waiting: false,
            transaction: 0,
        }
    }

    fn request(&mut self, pdu: &[u8]) {
        self.transaction = self.transaction.wrapping_add(1);
        self.requests.push_back(frame(self.transaction, UNIT, pdu));
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
        self.program.answer(&answer[HEADER..])?;
        self.waiting = false;
        Ok(())
    }

    /// What it does in a beat.
    pub fn step(&mut self, millisecond: u64, host: &mut Host) -> Result<()> {
        if host.connect(self.socket, MODBUS_PORT)? {
            // where the simulator has lost the connection nothing is under way any more
            self.requests.clear();
            self.answer.clear();
            self.waiting = false;
        }
        host.take(self.socket, &mut self.answer)?;
        self.take_answer()?;
        if !host.connected(self.socket) {
            return Ok(());
        }
        if millisecond.is_multiple_of(u64::from(DRIVE_PERIOD_MS)) && self.requests.is_empty() {
            for request in self.program.poll(millisecond) {
                self.request(&request);
            }
        }
        if !self.waiting
            && let Some(request) = self.requests.pop_front()
        {
            host.send(self.socket, &request)?;
            self.waiting = true;
        }
        Ok(())
    }

    pub fn done(&self) -> Result<String> {
        self.program.done()
    }

    pub fn feedback(&self) -> &Feedback {
        &self.program.feedback
    }
}

/// One that is alone on the cable.
pub struct Alone {
    host: Host,
    plc: Tcp,
}

impl Alone {
    pub fn new() -> Self {
        let mut host = Host::new();
        let plc = Tcp::on(&mut host);
        Self { host, plc }
    }
}

impl Load for Alone {
    fn beat(&mut self, millisecond: u64, heard: Traffic) -> Result<Traffic> {
        self.host.hear(millisecond, heard.frames);
        self.plc.step(millisecond, &mut self.host)?;
        Ok(Traffic::of(self.host.say(millisecond)))
    }

    fn done(&self) -> Result<String> {
        self.plc.done()
    }

    fn feedback(&self) -> Option<&Feedback> {
        Some(self.plc.feedback())
    }
}

/// One on the serial line, as fast as the line lets it: a byte in a beat, as at 9600 bit/s.
pub struct Serial {
    program: Program,
    requests: VecDeque<Vec<u8>>,
    /// What of a request has not been sent.
    rest: VecDeque<u8>,
    answer: Vec<u8>,
    /// Bytes of the answer that is waited for.
    expected: usize,
    /// When the last byte has come or gone.
    last: u64,
}

/// Bytes about a PDU: address and checksum.
const ABOUT: usize = 3;
/// A silence that ends a frame for the board in QEMU, ms, and one beat more.
const SILENCE: u64 = 11;
/// An answer that has not come by then is lost, ms.
const PATIENCE: u64 = 100;

impl Serial {
    pub fn new() -> Self {
        Self {
            program: Program::new(),
            requests: VecDeque::new(),
            rest: VecDeque::new(),
            answer: Vec::new(),
            expected: 0,
            last: 0,
        }
    }

    fn send(&mut self, pdu: &[u8]) {
        let mut frame = [&[STATION], pdu].concat();
        frame.extend(checksum(&frame));
        self.rest.extend(frame);
        self.answer.clear();
        self.expected = ABOUT
            + match pdu {
                [READ_INPUT_REGISTERS, ..] => 2 + 2 * FEEDBACK_WORDS,
                _ => 5,
            };
    }
}

impl Load for Serial {
    fn beat(&mut self, millisecond: u64, heard: Traffic) -> Result<Traffic> {
        if !heard.serial.is_empty() {
            self.answer.extend(heard.serial);
            self.last = millisecond;
        }
        if self.expected > 0 && self.answer.len() >= self.expected {
            let (frame, sum) = self.answer.split_at(self.answer.len() - 2);
            ensure!(
                sum == checksum(frame),
                "a bad checksum: {:02x?}",
                self.answer
            );
            self.program.answer(&frame[1..])?;
            self.expected = 0;
        }
        let quiet = millisecond - self.last;
        ensure!(
            self.expected == 0 || !self.rest.is_empty() || quiet < PATIENCE,
            "no answer within {PATIENCE} ms, but {:02x?}",
            self.answer
        );
        if self.expected == 0 && quiet >= SILENCE {
            if self.requests.is_empty() {
                self.requests.extend(self.program.poll(millisecond));
            }
            if let Some(request) = self.requests.pop_front() {
                self.send(&request);
            }
        }
        let serial: Vec<u8> = self.rest.pop_front().into_iter().collect();
        if !serial.is_empty() {
            self.last = millisecond;
        }
        Ok(Traffic {
            serial,
            ..Traffic::default()
        })
    }

    fn done(&self) -> Result<String> {
        self.program.done()
    }

    fn feedback(&self) -> Option<&Feedback> {
        Some(&self.program.feedback)
    }
}
