//! The firmware in QEMU, its virtual time held at whole milliseconds, its network cable and its serial line in our
//! hands.
//!
//! Not here: what is sent to it, and what its numbers mean.
//!
//! Virtual time is a count of instructions, and stands still while [`Bench`] has the turn. Frames that are sent then
//! are in the guest's receive FIFO before it goes on: a filter in QEMU shows every frame that has passed, and behind
//! them follows one that the guest's Ethernet controller does not take, since it is for somebody else. When that one
//! shows, all before it have arrived. So every frame comes at the same instruction in every run. A byte on the serial
//! line is as sure: QEMU looks at all that is ready before it looks for the next such frame.

use std::io::{self, BufRead, BufReader, ErrorKind, Read, Write};
use std::os::fd::OwnedFd;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::net::{SocketAddr, UnixListener, UnixStream};
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail, ensure};

use super::elf::Elf;
use super::report::Report;
use crate::interrupt;
use crate::qemu::escaped;
use crate::setup::on_path;
use crate::twin::Core;

/// An Ethernet frame without its checksum.
pub type Frame = Vec<u8>;

/// What goes to the guest in a beat, or has come from it.
#[derive(Clone, Debug, Default)]
pub struct Traffic {
    /// On the network cable.
    pub frames: Vec<Frame>,
    /// On the serial line; to the guest one byte at most, since its UART holds no more.
    pub serial: Vec<u8>,
}

impl Traffic {
    /// Nothing but frames.
    pub fn of(frames: Vec<Frame>) -> Self {
        Self {
            frames,
            ..Self::default()
        }
    }
}

/// QEMU takes a moment to start, more on a busy PC.
const START: Duration = Duration::from_secs(60);
/// From one beat to the next, in real time: a millisecond of the guest, or many of them, on a busy PC.
const PATIENCE: Duration = Duration::from_secs(600);

/// The frame that shows when all before it have arrived: to nobody, of an experimental type (IEEE 802, local).
const LAST: &[u8] = &[
    0x02, 0, 0, 0, 0, 0xff, 0x02, 0, 0, 0, 0, 0xfe, 0x88, 0xb5, b'l', b'a', b's', b't',
];

/// What a bench needs.
#[derive(Clone, Debug)]
pub struct Files {
    /// The emulator.
    pub qemu: PathBuf,
    /// The plugin `qemu-trace`.
    pub plugin: PathBuf,
    /// The firmware, an ELF file.
    pub firmware: PathBuf,
}

/// What is seen of the firmware.
#[derive(Clone, Copy, Debug)]
pub enum Watch<'a> {
    /// Its tasks, some of which have a period, by their addresses, in counts of the stopwatch.
    Tasks(&'a [(u64, u64)]),
    /// Nothing but the milliseconds: what there is to know it says itself.
    Beats,
}

/// A running firmware; it ends when dropped.
pub struct Bench {
    child: Child,
    gate: BufReader<UnixStream>,
    wire: UnixStream,
    line: UnixStream,
    /// What QEMU shows of the frames that have passed.
    passed: BufReader<UnixStream>,
    /// The beginning of a frame that the guest is sending.
    partial: Vec<u8>,
}

impl Bench {
    /// Starts the firmware and lets it run to its first beat.
    pub fn start(files: &Files, core: &Core, elf: &Elf, watch: Watch<'_>) -> Result<Self> {
        Self::start_with(files, core, elf, watch, &[])
    }

    /// The same, with words that stand in memory before power comes, by their addresses.
    pub fn start_with(
        files: &Files,
        core: &Core,
        elf: &Elf,
        watch: Watch<'_>,
        memory: &[(u64, u32)],
    ) -> Result<Self> {
        static BENCHES: AtomicU32 = AtomicU32::new(0);
        let number = BENCHES.fetch_add(1, Ordering::Relaxed);
        let name = |what| format!("winder-{}-{number}-{what}", std::process::id());
        let (gate, passed, line) = (name("gate"), name("passed"), name("line"));
        let listen = |name: &str| -> io::Result<UnixListener> {
            let listener = UnixListener::bind_addr(&SocketAddr::from_abstract_name(name)?)?;
            listener.set_nonblocking(true)?;
            Ok(listener)
        };
        let gate_listener = listen(&gate).context("cannot listen for QEMU's plugin")?;
        let passed_listener = listen(&passed).context("cannot listen for QEMU's filter")?;
        let line_listener = listen(&line).context("cannot listen for QEMU's serial line")?;
        let (wire, theirs) = UnixStream::pair().context("cannot make a network cable")?;
        wire.set_nonblocking(true)?;

        let mut arguments = format!("{},gate={gate}", escaped(&files.plugin));
        let (low, high) = elf.stack();
        arguments += &format!(",stack={low:x}:{high:x}");
        match watch {
            Watch::Beats => arguments += ",only=beats",
            Watch::Tasks(periods) => {
                for (address, counts) in periods {
                    arguments += &format!(",period={address:x}:{counts}");
                }
            }
        }
        // where setpriv is at hand QEMU ends with us however we end
        let mut command = match on_path("setpriv") {
            Some(setpriv) => {
                let mut command = Command::new(setpriv);
                command.args(["--pdeathsig", "KILL"]).arg(&files.qemu);
                command
            }
            None => Command::new(&files.qemu),
        };
        command
            .args(["-M", core.board, "-display", "none", "-monitor", "none"])
            .args(["-icount", "shift=1,sleep=off"])
            .args(["-plugin", &arguments])
            .args(["-semihosting-config", "enable=on,target=native"])
            .args(["-serial", "null", "-serial", "chardev:line"])
            .args(["-nic", "socket,id=wire,fd=0"])
            .arg("-chardev")
            .arg(format!("socket,id=line,path={line},abstract=on"))
            .arg("-chardev")
            .arg(format!("socket,id=passed,path={passed},abstract=on"))
            .arg("-object")
            .arg("filter-mirror,id=mirror,netdev=wire,queue=tx,outdev=passed")
            .args(memory.iter().flat_map(|(address, word)| {
                let loader = format!("loader,addr={address:#x},data={word:#x},data-len=4");
                ["-device".to_owned(), loader]
            }))
            .arg("-kernel")
            .arg(&files.firmware)
            .stdin(Stdio::from(OwnedFd::from(theirs)))
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .process_group(0);
        let mut child = command.spawn().context("cannot start QEMU")?;
        let line = accept(&line_listener, &mut child)?;
        line.set_nonblocking(true)?;
        let passed = accept(&passed_listener, &mut child)?;
        let gate = accept(&gate_listener, &mut child)?;
        gate.set_read_timeout(Some(PATIENCE))?;
        passed.set_read_timeout(Some(PATIENCE))?;
        let mut bench = Self {
            child,
            gate: BufReader::new(gate),
            wire,
            line,
            passed: BufReader::new(passed),
            partial: Vec::new(),
        };
        bench.wait()?;
        Ok(bench)
    }

    /// Lets some virtual milliseconds pass.
    pub fn pass(&mut self, milliseconds: u64) -> Result<()> {
        self.say(&format!("go {milliseconds}"))?;
        self.wait()
    }

    /// Forgets all that was counted.
    pub fn zero(&mut self) -> Result<()> {
        self.say("zero")
    }

    /// What has been counted.
    pub fn report(&mut self) -> Result<Report> {
        self.say("report")?;
        let mut report = Report::default();
        loop {
            let line = self.answer()?;
            if line.is_empty() {
                return Ok(report);
            }
            report.line(&line)?;
        }
    }

    /// What the guest has sent.
    pub fn received(&mut self) -> Result<Traffic> {
        read_all(&mut self.wire, &mut self.partial).context("the network cable")?;
        let mut traffic = Traffic::default();
        read_all(&mut self.line, &mut traffic.serial).context("the serial line")?;
        while let Some((length, rest)) = self.partial.split_first_chunk() {
            let length = u32::from_be_bytes(*length) as usize;
            let Some(frame) = rest.get(..length) else {
                break;
            };
            traffic.frames.push(frame.to_vec());
            self.partial.drain(..size_of::<u32>() + length);
        }
        Ok(traffic)
    }

    /// Something for the guest: when this returns it has arrived.
    pub fn send(&mut self, traffic: &Traffic) -> Result<()> {
        /// QEMU notes in one round that the UART has room, hears in the next one that there is a byte, and has given it
        /// when a third one begins.
        const ROUNDS_OF_A_BYTE: usize = 3;
        let Traffic { frames, serial } = traffic;
        ensure!(serial.len() <= 1, "{} bytes for one beat", serial.len());
        self.line
            .write_all(serial)
            .context("cannot write to the serial line")?;
        if !frames.is_empty() || !serial.is_empty() {
            self.pass_frames(frames)?;
        }
        for _ in 1..ROUNDS_OF_A_BYTE * serial.len() {
            self.pass_frames(&[])?;
        }
        Ok(())
    }

    /// Frames, and the one that shows when they have arrived.
    fn pass_frames(&mut self, frames: &[Frame]) -> Result<()> {
        let mut bytes = Vec::new();
        for frame in frames.iter().map(Vec::as_slice).chain([LAST]) {
            bytes.extend((frame.len() as u32).to_be_bytes());
            bytes.extend(frame);
        }
        self.wire.set_nonblocking(false)?;
        self.wire
            .write_all(&bytes)
            .context("cannot write to the network cable")?;
        self.wire.set_nonblocking(true)?;
        loop {
            let mut length = [0; size_of::<u32>()];
            self.passed
                .read_exact(&mut length)
                .context("QEMU does not show what has passed")?;
            let mut frame = vec![0; u32::from_be_bytes(length) as usize];
            self.passed.read_exact(&mut frame)?;
            if frame == LAST {
                return Ok(());
            }
        }
    }

    fn say(&mut self, line: &str) -> Result<()> {
        self.gate
            .get_mut()
            .write_all(format!("{line}\n").as_bytes())
            .context("QEMU does not listen any more")
    }

    fn answer(&mut self) -> Result<String> {
        let mut line = String::new();
        let read = self.gate.read_line(&mut line);
        match read {
            Ok(n) if n > 0 => Ok(line.trim_end().to_owned()),
            Ok(_) => Err(last_words(&mut self.child)),
            Err(error) => Err(error).context("QEMU stands still"),
        }
    }

    fn wait(&mut self) -> Result<()> {
        interrupt::check()?;
        let line = self.answer()?;
        ensure!(line == "beat", "the plugin says {line:?}");
        Ok(())
    }
}

impl Drop for Bench {
    fn drop(&mut self) {
        // it may have ended by itself; then there is nothing to end
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// All that has come by now.
fn read_all(from: &mut UnixStream, into: &mut Vec<u8>) -> Result<()> {
    let mut buffer = [0; 1 << 16];
    loop {
        match from.read(&mut buffer) {
            Ok(0) => bail!("QEMU has let go of it"),
            Ok(n) => into.extend_from_slice(&buffer[..n]),
            Err(error) if error.kind() == ErrorKind::WouldBlock => return Ok(()),
            Err(error) => return Err(error.into()),
        }
    }
}

/// Waits for QEMU to connect, or for its end.
fn accept(listener: &UnixListener, child: &mut Child) -> Result<UnixStream> {
    let began = Instant::now();
    loop {
        interrupt::check()?;
        match listener.accept() {
            Ok((stream, _)) => {
                stream.set_nonblocking(false)?;
                return Ok(stream);
            }
            Err(error) if error.kind() == ErrorKind::WouldBlock => {}
            Err(error) => return Err(error).context("QEMU cannot connect"),
        }
        if child.try_wait()?.is_some() {
            return Err(last_words(child));
        }
        ensure!(
            began.elapsed() < START,
            "QEMU has not started within {} s",
            START.as_secs()
        );
        thread::sleep(Duration::from_millis(2));
    }
}

/// What QEMU said before it ended.
fn last_words(child: &mut Child) -> anyhow::Error {
    let _ = child.kill();
    let _ = child.wait();
    let mut said = String::new();
    if let Some(mut stderr) = child.stderr.take() {
        // what cannot be read is not said
        let _ = stderr.read_to_string(&mut said);
    }
    anyhow::anyhow!(
        "QEMU has ended: {}; needed is qemu-system-arm 7.0 or later with plugins (configured with --enable-plugins, as \
         Debian's and Ubuntu's is)",
        said.trim()
    )
}
