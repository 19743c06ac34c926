//! The simulator's microcontroller in QEMU: start, stop, log.
//!
//! Not here: building the firmware (that is [`crate::setup`]'s), other boards, a debugger. The emulated clock
//! counts instructions, so runs are reproducible; a plugin holds it to real time or a multiple of it.

use std::collections::VecDeque;
use std::fmt;
use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::ops::RangeInclusive;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, ChildStderr, Command, Stdio};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, mpsc};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail, ensure};
use defmt_decoder::{DecodeError, Frame, Table};

use crate::interrupt;
use crate::link::Link;
use crate::setup::{Mps2, on_path};

/// Time from power-up to the first answer: a second or so, more on a busy PC.
const START_TIMEOUT: Duration = Duration::from_secs(60);
/// Log lines that are kept.
const KEPT_LINES: usize = 10_000;

/// Simulated time over real time: from slow motion to faster than any PC.
const PACES: RangeInclusive<f64> = 0.01..=1000.0;

/// How serious a log line is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// Finest.
    Trace,
    /// For whoever looks for an error.
    Debug,
    /// For everyone.
    Info,
    /// Something is odd.
    Warn,
    /// Something has failed.
    Error,
}

/// A line of the log.
#[derive(Clone, Debug)]
pub struct Line {
    /// How serious it is.
    pub level: Level,
    /// Time stamp (where the firmware gives one) and text.
    pub text: String,
}

impl fmt::Display for Line {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let level = format!("{:?}", self.level).to_lowercase();
        write!(f, "{level:<5} {}", self.text)
    }
}

/// Gets every line as it comes.
pub type Sink = Box<dyn Fn(&Line) + Send + Sync>;

/// How to run it.
pub struct Options {
    /// Port for Modbus TCP; 0 = any free one.
    pub port: u16,
    /// Simulated time over real time.
    pub pace: f64,
    /// Who is shown the log.
    pub sink: Sink,
}

impl fmt::Debug for Options {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Options {{ port: {}, pace: {} }}", self.port, self.pace)
    }
}

impl Default for Options {
    fn default() -> Self {
        Self {
            port: 0,
            pace: 1.0,
            sink: Box::new(|_| ()),
        }
    }
}

impl Options {
    /// Refuses a pace that no clock can keep.
    pub fn check(&self) -> Result<()> {
        ensure!(
            PACES.contains(&self.pace),
            "pace {} is outside {} to {}: 1 is real time, 10 ten times faster",
            self.pace,
            PACES.start(),
            PACES.end()
        );
        Ok(())
    }
}

/// The lines of the log so far.
#[derive(Clone, Debug, Default)]
struct Log(Arc<Mutex<VecDeque<Line>>>);

impl Log {
    fn lines(&self) -> MutexGuard<'_, VecDeque<Line>> {
        // a line is pushed whole or not at all
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn push(&self, line: Line, sink: &Sink) {
        sink(&line);
        let mut lines = self.lines();
        if lines.len() == KEPT_LINES {
            lines.pop_front();
        }
        lines.push_back(line);
    }
}

/// A running QEMU; it ends when dropped.
#[derive(Debug)]
pub struct Qemu {
    child: Child,
    address: SocketAddr,
    log: Log,
    readers: Vec<JoinHandle<()>>,
}

impl Qemu {
    /// Starts the simulator and waits until it answers.
    pub fn start(files: &Mps2, options: Options) -> Result<Self> {
        let port = free_port(options.port)?;
        let elf = fs::read(&files.firmware)
            .with_context(|| format!("cannot read the firmware {}", files.firmware.display()))?;
        let table = Table::parse(&elf)
            .context("cannot read the log's texts in the firmware")?
            .context("the firmware has no log: its ELF file lacks the defmt section")?;

        let command = command(files, port, options.pace);
        let log = Log::default();
        let (started, child) = mpsc::channel();
        let sink = Arc::new(options.sink);
        let keeper = {
            let (log, sink) = (log.clone(), Arc::clone(&sink));
            thread::spawn(move || keep(command, &started, &table, &log, &sink))
        };
        let mut child = child.recv().context("QEMU's thread has ended")??;
        let mut readers = vec![keeper];
        if let Some(messages) = child.stderr.take() {
            let log = log.clone();
            readers.push(thread::spawn(move || listen(messages, &log, &sink)));
        }
        let mut qemu = Self {
            child,
            address: SocketAddr::from((Ipv4Addr::LOCALHOST, port)),
            log,
            readers,
        };
        qemu.wait_until_it_answers()?;
        Ok(qemu)
    }

    /// Where it answers Modbus TCP.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// The log so far, debug lines and all.
    pub fn log(&self) -> Vec<Line> {
        self.log.lines().iter().cloned().collect()
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
        let lines = self.log.lines();
        let last: Vec<_> = lines
            .iter()
            .rev()
            .take(5)
            .rev()
            .map(|line| format!("\n  {line}"))
            .collect();
        bail!(
            "QEMU has ended ({status}); its last words:{}",
            last.concat()
        )
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
fn free_port(wanted: u16) -> Result<u16> {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, wanted)).with_context(|| {
        format!("port {wanted} of 127.0.0.1 is not free: choose another with --port")
    })?;
    Ok(listener.local_addr()?.port())
}

fn command(files: &Mps2, port: u16, pace: f64) -> Command {
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
        .arg("-nic")
        .arg(format!(
            "user,restrict=on,hostfwd=tcp:127.0.0.1:{port}-:502"
        ))
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
fn escaped(path: &Path) -> String {
    path.display().to_string().replace(',', ",,")
}

/// Starts QEMU and decodes its log until it ends.
///
/// One thread for both: QEMU ends with the thread that started it (see [`command`]), and this one lives as long
/// as QEMU does.
fn keep(
    mut command: Command,
    started: &mpsc::Sender<Result<Child>>,
    table: &Table,
    log: &Log,
    sink: &Sink,
) {
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
    let mut decoder = table.new_stream_decoder();
    let mut buffer = [0; 4096];
    while let Ok(n) = frames.read(&mut buffer)
        && n > 0
    {
        decoder.received(&buffer[..n]);
        loop {
            match decoder.decode() {
                Ok(frame) => log.push(line(&frame), sink),
                Err(DecodeError::UnexpectedEof) => break,
                Err(DecodeError::Malformed) => {
                    let text = "log frame cannot be decoded".to_owned();
                    log.push(
                        Line {
                            level: Level::Warn,
                            text,
                        },
                        sink,
                    );
                    if !table.encoding().can_recover() {
                        return;
                    }
                }
            }
        }
    }
}

fn line(frame: &Frame<'_>) -> Line {
    let level = match frame.level().map(|level| level.as_str()) {
        Some("trace") => Level::Trace,
        Some("debug") => Level::Debug,
        Some("warn") => Level::Warn,
        Some("error") => Level::Error,
        _ => Level::Info,
    };
    let message = frame.display_message();
    let text = match frame.display_timestamp() {
        Some(time) => format!("{time} {message}"),
        None => message.to_string(),
    };
    Line { level, text }
}

/// What QEMU itself has to say, and what the firmware says by semihosting.
fn listen(messages: ChildStderr, log: &Log, sink: &Sink) {
    for text in BufReader::new(messages).lines().map_while(Result::ok) {
        let level = Level::Info;
        log.push(Line { level, text }, sink);
    }
}
