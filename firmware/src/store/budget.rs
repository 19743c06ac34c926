//! How often the flash is written.

/// Seconds for which one more write is saved up: a quarter of an hour.
pub const REFILL_S: u32 = 15 * 60;
/// Writes that may follow each other at once, for somebody who tries settings.
const BURST: u32 = 10;

/// Bounds the writes, so that the flash outlives the winder whatever a client does: ten at once, and one more for
/// each quarter of an hour since. What comes in between waits; the latest is written then.
#[derive(Clone, Copy, Debug)]
pub struct Budget {
    /// Seconds saved up.
    saved: u32,
    /// The last look, seconds since power-up.
    looked: u32,
}

impl Default for Budget {
    fn default() -> Self {
        Self {
            saved: BURST * REFILL_S,
            looked: 0,
        }
    }
}

impl Budget {
    /// Takes a write, at a time since power-up; false if it has to wait.
    pub fn take(&mut self, now_s: u32) -> bool {
        let passed = now_s.saturating_sub(self.looked);
        self.looked = self.looked.max(now_s);
        self.saved = self.saved.saturating_add(passed).min(BURST * REFILL_S);
        let enough = self.saved >= REFILL_S;
        if enough {
            self.saved -= REFILL_S;
        }
        enough
    }

    /// Writes that would not have to wait.
    pub fn left(&self) -> u32 {
        self.saved / REFILL_S
    }
}
