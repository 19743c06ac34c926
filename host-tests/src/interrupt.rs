//! Ctrl-C and SIGTERM, as a flag that every loop looks at.
//!
//! Not here: ending anything by force. Whoever waits calls [`check`] and returns; what it started ends when it
//! is dropped.

use std::fmt;
use std::sync::atomic::{AtomicBool, Ordering};

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

/// The error [`Interrupted`] once the user has asked to end.
pub fn check() -> Result<()> {
    if REQUESTED.load(Ordering::Relaxed) {
        return Err(Interrupted.into());
    }
    Ok(())
}
