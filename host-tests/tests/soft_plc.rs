//! A soft PLC that is not ours winds a set by itself: ClassicLadder runs the ladder program of `plc/ladder`, mb2hal
//! speaks Modbus TCP for it, and the firmware in QEMU is the winder. Not here: how the program works; its README says.
//!
//! Both come with LinuxCNC, which `cargo winder test` installs. They need no real-time kernel: a scan that is late is
//! late, as with any soft PLC.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use host_tests::link::Link;
use host_tests::log::Log;
use host_tests::setup;
use host_tests::simulator::{Board, Options, Simulator};
use model_core::image::{self, Feedback};
use model_core::link_words::link_status;
use model_core::logic::{Fault, Mode, status};
use tempfile::TempDir;

/// Times real time: the ladder's scan and its poll stay as they are.
const PACE: f64 = 3.0;
/// The set of winder.hal, m.
const SET_M: f64 = 40.0;
/// What runs on between the scan that sees the length and the command's effect, at the set's speed, m; and the web is
/// led through before the count begins anew.
const TOLERANCE_M: f64 = 1.5;
/// A minute at most, several on a busy PC; a program that hangs must not hang the test.
const PATIENCE: Duration = Duration::from_secs(180);

/// The user that LinuxCNC's real-time part becomes where it is started by root: Debian's `nobody`.
const NOBODY: &str = "65534";

/// The soft PLC; it ends when dropped.
struct SoftPlc {
    halrun: PathBuf,
    child: Option<Child>,
    fifo: PathBuf,
    files: TempDir,
}

impl SoftPlc {
    /// Starts it, wired to a simulator's port.
    fn start(port: u16) -> Self {
        let plc = Path::new(env!("CARGO_MANIFEST_DIR")).join("plc/ladder");
        let files = tempfile::tempdir().expect("a directory");
        for name in ["winder.clp", "winder.hal"] {
            fs::copy(plc.join(name), files.path().join(name)).expect("copied");
        }
        let wiring = fs::read_to_string(plc.join("mb2hal.ini")).expect("read");
        let wired = wiring.replace("TCP_PORT=5020", &format!("TCP_PORT={port}"));
        assert_ne!(wiring, wired, "mb2hal.ini names no port 5020");
        fs::write(files.path().join("mb2hal.ini"), wired).expect("written");
        let mut plc = Self {
            halrun: setup::soft_plc().expect("LinuxCNC"),
            child: None,
            // `nobody` must be able to make it
            fifo: std::env::temp_dir().join(format!("winder-rtapi-{}", std::process::id())),
            files,
        };
        let mut command = plc.halrun(&["-I", "-f", "winder.hal"]);
        command.stdin(Stdio::piped()).stdout(Stdio::piped());
        plc.child = Some(command.spawn().expect("halrun starts"));
        plc
    }

    fn halrun(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(&self.halrun);
        command
            .args(arguments)
            .current_dir(self.files.path())
            .env("RTAPI_FIFO_PATH", &self.fifo);
        if setup::is_root() {
            command.env("RTAPI_UID", NOBODY);
        }
        command
    }

    /// Asks for values of its pins, ends it, and gives what it has told.
    fn last_words(mut self, pins: &[&str]) -> Vec<String> {
        let mut child = self.child.take().expect("it runs");
        let mut ask = child.stdin.take().expect("piped");
        for pin in pins {
            writeln!(ask, "getp {pin}").expect("it listens");
        }
        writeln!(ask, "exit").expect("it listens");
        drop(ask);
        let output = child.wait_with_output().expect("it ends");
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        let is_value =
            |line: &&str| ["TRUE", "FALSE"].contains(line) || line.parse::<i64>().is_ok();
        let values: Vec<_> = text.lines().filter(is_value).map(str::to_owned).collect();
        assert_eq!(values.len(), pins.len(), "{text}");
        values
    }
}

impl Drop for SoftPlc {
    fn drop(&mut self) {
        if let Some(mut child) = self.child.take() {
            // it ends with what it listens to
            drop(child.stdin.take());
            let ended = (0..100).any(|_| {
                thread::sleep(Duration::from_millis(100));
                matches!(child.try_wait(), Ok(Some(_)))
            });
            if !ended {
                let _ = child.kill();
                let _ = child.wait();
                let _ = self.halrun(&["-U"]).status();
            }
        }
        let _ = fs::remove_file(&self.fifo);
    }
}

#[test]
fn classicladder_winds_a_set_by_itself() {
    let log = Log::default();
    let options = Options {
        pace: PACE,
        log: log.clone(),
        ..Options::default()
    };
    let simulator = Simulator::start(Board::Mps2, options).expect("QEMU starts");
    let mut link = Link::connect(simulator.address()).unwrap();
    let plc = SoftPlc::start(simulator.address().port());

    let mut modes = Vec::new();
    let mut fastest = 0.0_f64;
    let began = Instant::now();
    let wound = |f: &Feedback| length(f) > 0.9 * SET_M && f.word(&image::MODE) == Mode::Off as u16;
    let mut seen = link.read().unwrap();
    while !wound(&seen) {
        assert!(began.elapsed() < PATIENCE, "{modes:?}\n{}", log.last(20));
        thread::sleep(Duration::from_millis(20));
        seen = link.read().unwrap();
        let mode = seen.word(&image::MODE);
        if modes.last() != Some(&mode) {
            modes.push(mode);
        }
        fastest = fastest.max(seen.get(&image::V_WEB));
        let fault = seen.word(&image::FAULT);
        assert_eq!(fault, Fault::None as u16, "{}", log.last(20));
    }

    // it was wound as winder.hal asks for, and in the order of a winder
    let run = [Mode::Thread, Mode::Run, Mode::NormalStop, Mode::Stall].map(|mode| mode as u16);
    let passed: Vec<_> = modes.iter().filter(|mode| run.contains(mode)).collect();
    assert_eq!(passed, run.iter().collect::<Vec<_>>(), "{modes:?}");
    assert!((119.0..123.0).contains(&fastest), "{fastest} m/min");
    let wound = length(&seen);
    assert!((wound - SET_M).abs() < TOLERANCE_M, "{wound} m");
    let state = seen.word(&image::WINDER_STATUS);
    assert_eq!(state & status::WEB_BREAK, 0);
    let controls = seen.word(&image::LINK_STATUS) & link_status::PLC_CONTROLS;
    assert_ne!(controls, 0, "the soft PLC controls");

    // and neither end has missed anything
    thread::sleep(Duration::from_millis(500));
    let told = plc.last_words(&[
        "classicladder.0.out-00",
        "classicladder.0.out-01",
        "mb2hal.status.num_errors",
        "mb2hal.feedback.num_errors",
        "mb2hal.commands.num_errors",
    ]);
    assert_eq!(
        told,
        ["TRUE", "FALSE", "0", "0", "0"],
        "wound, trouble, errors"
    );
}

fn length(feedback: &Feedback) -> f64 {
    feedback.get(&image::LENGTH_WU)
}
