//! What a simulator says of itself, line by line.
//!
//! Not here: the PLC's view, which is the process image. The log is for people and for tests.

use std::collections::VecDeque;
use std::fmt;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Lines that are kept; at full length a set takes some ten thousand with its commands.
const KEPT_LINES: usize = 100_000;

/// How serious a line is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// Finest.
    Trace,
    /// For whoever looks for an error, and for replay.
    Debug,
    /// For everyone.
    Info,
    /// Something is odd.
    Warn,
    /// Something has failed.
    Error,
}

/// A line.
#[derive(Clone, Debug)]
pub struct Line {
    /// How serious it is.
    pub level: Level,
    /// Simulated time since power-up, s, where it is known.
    pub time: Option<String>,
    /// What it says.
    pub text: String,
}

impl fmt::Display for Line {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let level = format!("{:?}", self.level).to_lowercase();
        let time = self.time.as_deref().unwrap_or_default();
        write!(f, "{level:<5} {time:>11} {}", self.text)
    }
}

/// The log of a simulator; clones share it.
#[derive(Clone)]
pub struct Log {
    lines: Arc<Mutex<VecDeque<Line>>>,
    sink: Arc<dyn Fn(&Line) + Send + Sync>,
}

impl Log {
    /// An empty log, whose lines also go to `sink` as they come.
    pub fn new(sink: impl Fn(&Line) + Send + Sync + 'static) -> Self {
        Self {
            lines: Arc::default(),
            sink: Arc::new(sink),
        }
    }

    /// Adds a line.
    pub fn push(&self, line: Line) {
        (self.sink)(&line);
        let mut lines = self.kept();
        if lines.len() == KEPT_LINES {
            lines.pop_front();
        }
        lines.push_back(line);
    }

    /// The lines so far, debug lines and all.
    pub fn lines(&self) -> Vec<Line> {
        self.kept().iter().cloned().collect()
    }

    /// The last lines for everyone, for an error's message.
    pub fn last(&self, count: usize) -> String {
        let lines = self.kept();
        let lines = lines.iter().rev().filter(|line| line.level >= Level::Info);
        let last: Vec<_> = lines
            .take(count)
            .map(|line| format!("\n  {line}"))
            .collect();
        last.into_iter().rev().collect()
    }

    fn kept(&self) -> MutexGuard<'_, VecDeque<Line>> {
        // a line is there as a whole or not at all, whatever another thread came to
        self.lines.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A log that nobody is shown.
impl Default for Log {
    fn default() -> Self {
        Self::new(|_| ())
    }
}

impl fmt::Debug for Log {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Log of {} lines", self.kept().len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_lines_are_kept() {
        let log = Log::default();
        for i in 0..KEPT_LINES + 2 {
            log.push(Line {
                level: Level::Info,
                time: None,
                text: i.to_string(),
            });
        }
        let lines = log.lines();
        assert_eq!(lines.len(), KEPT_LINES);
        assert_eq!(lines[0].text, "2");
        assert!(log.last(1).ends_with(&format!(" {}", KEPT_LINES + 1)));
    }
}
