//! Conditions that count only after they have lasted, and what a filter hides.

use crate::real::Real;

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

/// What a first-order filter is fed with, from what comes out of it.
#[derive(Clone, Copy, Debug)]
pub struct Unfiltered<R> {
    /// 1/(1 − exp(−T/τ))
    lead: R,
    last: R,
}

impl<R: Real> Unfiltered<R> {
    /// For a filter of `tau` seconds, looked at every `period` seconds.
    pub fn new(tau: f64, period: f64) -> Self {
        Self {
            lead: R::of(-1.0 / libm::expm1(-period / tau)),
            last: R::ZERO,
        }
    }

    /// One period: u = y₋ + (y − y₋)/(1 − exp(−T/τ)), exact for an input that is constant over the period.
    pub fn step(&mut self, y: R) -> R {
        let u = self.last + (y - self.last) * self.lead;
        self.last = y;
        u
    }
}
