//! Conditions that count only after they have lasted.

/// A condition that must hold for some cycles before it counts, and must be gone as long before it is over.
#[derive(Clone, Copy, Debug, Default)]
pub struct Persistent {
    cycles: u16,
    on: bool,
}

impl Persistent {
    /// One cycle of 10 ms; true when `now` has differed from the state so far for `needed` cycles.
    pub fn step(&mut self, now: bool, needed: u16) -> bool {
        self.cycles = if now == self.on { 0 } else { self.cycles + 1 };
        if self.cycles >= needed {
            (self.on, self.cycles) = (now, 0);
        }
        self.on
    }

    /// The state.
    pub fn is_on(&self) -> bool {
        self.on
    }

    /// Forgets.
    pub fn reset(&mut self) {
        *self = Self::default();
    }
}

/// Watches a counter that a living partner counts up.
#[derive(Clone, Copy, Debug, Default)]
pub struct Heartbeat {
    last: u16,
    cycles: u16,
}

impl Heartbeat {
    /// One cycle; true while the counter has stood still for more than `limit` cycles.
    pub fn step(&mut self, count: u16, watched: bool, limit: u16) -> bool {
        if count != self.last || !watched {
            (self.last, self.cycles) = (count, 0);
        } else {
            self.cycles = self.cycles.saturating_add(1);
        }
        self.cycles > limit
    }
}
