//! Ctrl-C and SIGTERM, as a flag that every loop looks at.
//!
//! Not here: ending anything by force. Whoever waits calls [`check`] and returns; what it started ends when it
//! is dropped.

use std::fmt;
use std::process::{Child, ExitStatus};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use anyhow::{Context, Result};

static REQUESTED: AtomicBool = AtomicBool::new(false);

/// The user has asked to end.
#[derive(Debug)]
pub struct Interrupted;

impl fmt::Display for Interrupted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("interrupted")
    }
}

impl std::error::Error for Interrupted {}

/// Takes Ctrl-C, SIGTERM and SIGHUP over; once in a process.
pub fn install() -> Result<()> {
    ctrlc::set_handler(|| REQUESTED.store(true, Ordering::Relaxed))
        .context("cannot take over Ctrl-C")
}

/// Waits for a process, and ends it once the user has asked to end.
pub fn wait(child: &mut Child) -> Result<ExitStatus> {
    loop {
        if let Some(status) = child.try_wait().context("cannot wait for a process")? {
            // Ctrl-C reaches both: how the process took it does not matter
            check()?;
            return Ok(status);
        }
        if let Err(interrupted) = check() {
            // it may just have ended by itself
            let _ = child.kill();
            let _ = child.wait();
            return Err(interrupted);
        }
        thread::sleep(Duration::from_millis(20));
    }
}

/// The error [`Interrupted`] once the user has asked to end.
pub fn check() -> Result<()> {
    if REQUESTED.load(Ordering::Relaxed) {
        return Err(Interrupted.into());
    }
    Ok(())
}
