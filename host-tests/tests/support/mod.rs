//! The command line tool as a child process.
// every test program uses its part of it
#![allow(dead_code)]

use std::io::{BufRead, BufReader};
use std::net::SocketAddr;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::thread;
use std::time::{Duration, Instant};

/// `winder`, as cargo has built it for this test.
pub fn winder(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_winder"));
    command.args(arguments);
    command
}

/// A `winder run` that has said that it is ready.
pub struct Running {
    child: Child,
    pub address: SocketAddr,
    /// The page, `http://HOST:PORT`.
    pub page: String,
}

impl Running {
    pub fn start(arguments: &[&str]) -> Self {
        let mut child = winder(&[&["run"], arguments].concat())
            .stdout(Stdio::piped())
            .spawn()
            .expect("winder starts");
        let mut out = BufReader::new(child.stdout.take().expect("a pipe"));
        let mut line = String::new();
        out.read_line(&mut line).expect("text");
        let ready = line.trim_end().strip_prefix("ready modbus=");
        let ready = ready.and_then(|ready| ready.split_once(" http="));
        let ready = ready.and_then(|(address, page)| Some((address.parse().ok()?, page)));
        let (address, page) = ready.unwrap_or_else(|| panic!("not ready: {line:?}"));
        Self {
            address,
            page: page.to_owned(),
            child,
        }
    }

    /// Sends a signal by its name.
    pub fn signal(&self, name: &str) {
        let pid = self.child.id().to_string();
        let sent = Command::new("kill").args(["-s", name, &pid]).status();
        assert!(sent.is_ok_and(|status| status.success()), "SIG{name}");
    }

    /// Waits for its end.
    pub fn end(&mut self) -> ExitStatus {
        let began = Instant::now();
        loop {
            if let Some(status) = self.child.try_wait().expect("a child") {
                return status;
            }
            assert!(began.elapsed() < Duration::from_secs(5), "does not end");
            thread::sleep(Duration::from_millis(20));
        }
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
