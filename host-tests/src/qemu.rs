//! The simulator's microcontroller in QEMU: start, stop, log.
//!
//! Not here: building the firmware (that is [`crate::setup`]'s), other boards, a debugger. The emulated clock
//! counts instructions, so runs are reproducible; a plugin holds it to real time or a multiple of it.

use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, ChildStderr, Command, Stdio};
use std::sync::mpsc;
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use defmt_decoder::{DecodeError, Frame, Table};

use crate::interrupt;
use crate::link::Link;
use crate::log::{Level, Line, Log};
use crate::namespace;
use crate::setup::{Mps2, on_path};
use crate::simulator::{Network, Options};

/// Time from power-up to the first answer: a second or so, more on a busy PC.
const START_TIMEOUT: Duration = Duration::from_secs(60);
/// Lines of the log that an error shows.
const LAST_WORDS: usize = 5;

/// Where the guest serves Modbus TCP, …
const MODBUS: u16 = 502;
/// … and its HMI.
const HTTP: u16 = 80;

/// What the log says before the path of the serial line.
pub const SERIAL: &str = "Modbus RTU, station 1, at ";

/// A running QEMU; it ends when dropped.
#[derive(Debug)]
pub struct Qemu {
    child: Child,
    address: SocketAddr,
    http: SocketAddr,
    log: Log,
    readers: Vec<JoinHandle<()>>,
}

impl Qemu {
    /// Starts the simulator and waits until it answers.
    pub fn start(files: &Mps2, options: Options) -> Result<Self> {
        let (network, address, http) = match options.network {
            Network::Ports => {
                let port = free_port(options.port, "--port")?;
                let http_port = free_port(options.http_port, "--http-port")?;
                let at = |port| SocketAddr::from((Ipv4Addr::LOCALHOST, port));
                (ports(port, http_port), at(port), at(http_port))
            }
            Network::Tap => {
                let at = |port| SocketAddr::from((namespace::GUEST, port));
                (tap(), at(MODBUS), at(HTTP))
            }
        };
        let elf = fs::read(&files.firmware)
            .with_context(|| format!("cannot read the firmware {}", files.firmware.display()))?;
        let table = Table::parse(&elf)
            .context("cannot read the log's texts in the firmware")?
            .context("the firmware has no log: its ELF file lacks the defmt section")?;

        let command = command(files, &network, options.pace);
        let (started, child) = mpsc::channel();
        let log = options.log.clone();
        let keeper = thread::spawn(move || keep(command, &started, &table, &log));
        let mut child = child.recv().context("QEMU's thread has ended")??;
        let mut readers = vec![keeper];
        if let Some(messages) = child.stderr.take() {
            let log = options.log.clone();
            readers.push(thread::spawn(move || listen(messages, &log)));
        }
        let mut qemu = Self {
            child,
            address,
            http,
            log: options.log,
            readers,
        };
        qemu.wait_until_it_answers()?;
        Ok(qemu)
    }

    /// Where it answers Modbus TCP.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Where its HMI is.
    pub fn http(&self) -> SocketAddr {
        self.http
    }

    /// Where the other end of its serial line is.
    pub fn serial(&self) -> Option<String> {
        let lines = self.log.lines();
        let path = lines.iter().find_map(|line| line.text.strip_prefix(SERIAL));
        path.map(str::to_owned)
    }

    /// An error that says why, once QEMU has ended by itself.
    pub fn check(&mut self) -> Result<()> {
        let Some(status) = self
            .child
            .try_wait()
            .context("cannot ask for QEMU's state")?
        else {
            return Ok(());
        };
        self.readers
            .drain(..)
            .for_each(|reader| drop(reader.join()));
        let last_words = self.log.last(LAST_WORDS);
        bail!("QEMU has ended ({status}); its last words:{last_words}")
    }

    fn wait_until_it_answers(&mut self) -> Result<()> {
        let began = Instant::now();
        loop {
            interrupt::check()?;
            self.check()?;
            // QEMU accepts connections before the firmware does: only an answer counts
            match Link::connect(self.address).and_then(|mut link| link.read()) {
                Ok(_) => return Ok(()),
                Err(error) if began.elapsed() > START_TIMEOUT => {
                    return Err(error.context(format!(
                        "the simulator in QEMU has not answered within {} s",
                        START_TIMEOUT.as_secs()
                    )));
                }
                Err(_) => thread::sleep(Duration::from_millis(50)),
            }
        }
    }
}

impl Drop for Qemu {
    fn drop(&mut self) {
        // it may have ended by itself; then there is nothing to end
        let _ = self.child.kill();
        let _ = self.child.wait();
        self.readers
            .drain(..)
            .for_each(|reader| drop(reader.join()));
    }
}

/// A port that nobody listens at: the wanted one, or any for 0.
fn free_port(wanted: u16, option: &str) -> Result<u16> {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, wanted)).with_context(|| {
        format!("port {wanted} of 127.0.0.1 is not free: choose another with {option}")
    })?;
    Ok(listener.local_addr()?.port())
}

/// QEMU's user network, which forwards two ports and lets nothing out.
fn ports(port: u16, http_port: u16) -> String {
    let forward = |from, to| format!("hostfwd=tcp:127.0.0.1:{from}-:{to}");
    let (modbus, http) = (forward(port, MODBUS), forward(http_port, HTTP));
    format!("user,restrict=on,{modbus},{http}")
}

/// The TAP of [`namespace`].
fn tap() -> String {
    format!("tap,ifname={},script=no,downscript=no", namespace::TAP)
}

fn command(files: &Mps2, network: &str, pace: f64) -> Command {
    // where setpriv is at hand QEMU ends with us however we end, even by SIGKILL
    let mut command = match on_path("setpriv") {
        Some(setpriv) => {
            let mut command = Command::new(setpriv);
            command.args(["--pdeathsig", "KILL"]).arg(&files.qemu);
            command
        }
        None => Command::new(&files.qemu),
    };
    command
        .args(["-M", "mps2-an500", "-display", "none", "-monitor", "none"])
        .args(["-icount", "shift=1,sleep=off"])
        .arg("-plugin")
        .arg(format!("{},speed={pace}", escaped(&files.plugin)))
        .args(["-semihosting-config", "enable=on,target=native"])
        .args([
            "-chardev",
            "stdio,id=log,signal=off",
            "-serial",
            "chardev:log",
        ])
        // the second UART: Modbus RTU at a pseudoterminal, whose name QEMU tells first
        .args(["-chardev", "pty,id=rtu", "-serial", "chardev:rtu"])
        .args(["-nic", network])
        .arg("-kernel")
        .arg(&files.firmware)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        // Ctrl-C is for us: we end QEMU when we have done with it
        .process_group(0);
    command
}

/// A path within a list of QEMU options: a comma is doubled.
pub(crate) fn escaped(path: &Path) -> String {
    path.display().to_string().replace(',', ",,")
}

/// Starts QEMU and decodes its log until it ends.
///
/// One thread for both: QEMU ends with the thread that started it (see [`command`]), and this one lives as long
/// as QEMU does.
fn keep(mut command: Command, started: &mpsc::Sender<Result<Child>>, table: &Table, log: &Log) {
    let mut child = match command.spawn().context("cannot start QEMU") {
        Ok(child) => child,
        Err(error) => {
            // nobody waits any more: nothing to tell
            let _ = started.send(Err(error));
            return;
        }
    };
    let Some(mut frames) = child.stdout.take() else {
        return;
    };
    if let Err(mpsc::SendError(Ok(mut orphan))) = started.send(Ok(child)) {
        let _ = orphan.kill();
        return;
    }
    if let Some(text) = serial_line(&mut frames) {
        log.push(Line {
            level: Level::Info,
            time: None,
            text,
        });
    }
    let mut decoder = table.new_stream_decoder();
    let mut buffer = [0; 4096];
    while let Ok(n) = frames.read(&mut buffer)
        && n > 0
    {
        decoder.received(&buffer[..n]);
        loop {
            match decoder.decode() {
                Ok(frame) => log.push(line(&frame)),
                Err(DecodeError::UnexpectedEof) => break,
                Err(DecodeError::Malformed) => {
                    let text = "log frame cannot be decoded".to_owned();
                    log.push(Line {
                        level: Level::Warn,
                        time: None,
                        text,
                    });
                    if !table.encoding().can_recover() {
                        return;
                    }
                }
            }
        }
    }
}

/// Where the serial line is, of which QEMU tells before the firmware says anything.
fn serial_line(out: &mut impl Read) -> Option<String> {
    const LONGEST: usize = 200;
    let mut told = Vec::new();
    let mut byte = [0];
    while told.len() < LONGEST && out.read(&mut byte).ok()? == 1 && byte != *b"\n" {
        told.extend(byte);
    }
    let told = String::from_utf8(told).ok()?;
    let path = told.split_whitespace().find(|word| word.starts_with('/'))?;
    Some(format!("{SERIAL}{path}"))
}

fn line(frame: &Frame<'_>) -> Line {
    let level = match frame.level().map(|level| level.as_str()) {
        Some("trace") => Level::Trace,
        Some("debug") => Level::Debug,
        Some("warn") => Level::Warn,
        Some("error") => Level::Error,
        _ => Level::Info,
    };
    Line {
        level,
        time: frame.display_timestamp().map(|time| time.to_string()),
        text: frame.display_message().to_string(),
    }
}

/// What QEMU itself has to say, and what the firmware says by semihosting.
fn listen(messages: ChildStderr, log: &Log) {
    for text in BufReader::new(messages).lines().map_while(Result::ok) {
        log.push(Line {
            level: Level::Info,
            time: None,
            text,
        });
    }
}
