//! A quadrature encoder out of a timer.
//!
//! Not here: the timer. A board gives it two compare channels that toggle once in each of its periods, one at a
//! quarter and one at three quarters of it, and counts the periods; so a period is half a pulse, and which channel
//! comes first tells the direction. Settings are preloaded: they count from the end of the running period.
//!
//! The frequency is the roll's, to the timer's resolution. What rounding, late settings and the running period
//! leave as an error of the count is corrected slowly, so that a counter card sees neither a jump in frequency nor a
//! wrong count: at standstill the count is within a pulse of the simulated one, after any time.

use core::f32::consts::TAU;

/// Half pulses for each pulse.
const HALVES: i32 = 2;

/// Share of the count's error that is made up for in one interval: small against the frequency at crawl, and gone
/// in a tenth of a second.
const CORRECTION: f32 = 0.125;

/// The longest period, in intervals. A timer keeps its period to the end, so a long one would answer late.
const LONGEST: f32 = 5.0;

/// Which channel toggles first in a period.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Leads {
    /// A before B: forward.
    A,
    /// B before A: backward.
    B,
}

/// What the timer is to do from the end of its running period on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Setting {
    /// Stand still.
    Hold,
    /// Go on period after period.
    Turn {
        /// Ticks of the timer in a period, half a pulse.
        ticks: u32,
        /// The direction.
        leads: Leads,
    },
}

/// What the timer has done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Seen {
    /// Periods that have ended since the start; wraps.
    pub periods: u16,
    /// A period is running.
    pub running: bool,
}

/// One encoder.
#[derive(Clone, Copy, Debug)]
pub struct Encoder {
    /// Half pulses in an interval for each rad/s.
    halves: f32,
    /// Ticks of the timer in an interval.
    interval: f32,
    /// Half pulses that the simulated encoder is ahead of the timer.
    ahead: i32,
    count: u32,
    periods: u16,
    leads: Leads,
}

impl Encoder {
    /// An encoder of `pulses` a revolution on a timer of `clock_hz`, set every `interval_s`.
    pub fn new(pulses: f32, clock_hz: f32, interval_s: f32) -> Self {
        Self {
            halves: pulses * HALVES as f32 * interval_s / TAU,
            interval: clock_hz * interval_s,
            ahead: 0,
            count: 0,
            periods: 0,
            leads: Leads::A,
        }
    }

    /// The setting for the next interval: `count` pulses have been simulated, wrapping, and the roll turns at
    /// `omega`, rad/s.
    pub fn set(&mut self, count: u32, omega: f32, seen: Seen) -> Setting {
        let periods = i32::from(seen.periods.wrapping_sub(self.periods));
        self.periods = seen.periods;
        let done = match self.leads {
            Leads::A => periods,
            Leads::B => -periods,
        };
        let pulses = count.wrapping_sub(self.count).cast_signed();
        self.count = count;
        self.ahead = self
            .ahead
            .saturating_add(pulses.saturating_mul(HALVES))
            .saturating_sub(done);

        let wanted = omega * self.halves + self.ahead as f32 * CORRECTION;
        let leads = if wanted < 0.0 { Leads::B } else { Leads::A };
        // Less than a pulse apart and slower than the slowest: that is standstill, as far as can be shown.
        let still = wanted.abs() < 1.0 / LONGEST && self.ahead.abs() < HALVES;
        // Only a timer at rest turns round, so that each of its periods has one direction.
        let turns = seen.running && leads != self.leads;
        if still || turns || !wanted.is_finite() {
            return Setting::Hold;
        }
        self.leads = leads;
        let periods = wanted.abs().max(1.0 / LONGEST);
        // the cast saturates; a period has at least its two edges
        let ticks = ((self.interval / periods + 0.5) as u32).max(4);
        Setting::Turn { ticks, leads }
    }
}

/// The angle of a roll as a count of pulses, where only its speed is known.
#[derive(Clone, Copy, Debug)]
pub struct Angle {
    /// Units of 2⁻³² pulse in an interval for each rad/s, for the sum of two speeds.
    units: f32,
    omega: f32,
    way: i64,
}

impl Angle {
    /// Of an encoder of `pulses` a revolution, looked at every `interval_s`.
    pub fn new(pulses: f32, interval_s: f32) -> Self {
        const UNITS: f32 = 4_294_967_296.0;
        Self {
            units: 0.5 * UNITS * pulses * interval_s / TAU,
            omega: 0.0,
            way: 0,
        }
    }

    /// The pulses until now, wrapping: the speed is taken as linear since the last look, rad/s.
    pub fn count(&mut self, omega: f32) -> u32 {
        // the cast takes what is not a number to 0
        self.way = self
            .way
            .wrapping_add(((self.omega + omega) * self.units) as i64);
        self.omega = omega;
        (self.way >> 32) as u32
    }
}
