//! Speed and tension references.
//!
//! Not here: which speed to go to; that is the logic's.

use crate::real::Real;

/// A speed ramp with limited acceleration and jerk: the S-curve.
///
/// Target and limits may change at any time; speed and acceleration stay continuous.
#[derive(Clone, Copy, Debug)]
pub struct SpeedRamp<R> {
    period: R,
    rate: R,
    v: R,
    a: R,
}

impl<R: Real> SpeedRamp<R> {
    /// At standstill, stepped every `period` seconds.
    pub fn new(period: f64) -> Self {
        Self {
            period: R::of(period),
            rate: R::of(1.0 / period),
            v: R::ZERO,
            a: R::ZERO,
        }
    }

    /// Speed reference, m/s.
    pub fn v(&self) -> R {
        self.v
    }

    /// Its acceleration, m/s².
    pub fn a(&self) -> R {
        self.a
    }

    /// Jumps to a speed, with no acceleration: for a drive that takes over a turning machine.
    pub fn set(&mut self, v: R) {
        (self.v, self.a) = (v, R::ZERO);
    }

    /// One period towards `target`, within `acceleration` and `jerk`.
    ///
    /// Falling by δ = jerk·T each period, an acceleration `a` covers (a² + a·δ)/(2·jerk) until it is gone. So
    /// the largest one that still rounds off into the target is a = −δ/2 + √(δ²/4 + 2·jerk·|target − v|); less
    /// than one period away it is |target − v|/T. The ramp ends on the target exactly, without overshoot.
    pub fn step(&mut self, target: R, acceleration: R, jerk: R) {
        let distance = target - self.v;
        let change = jerk * self.period;
        let half = change * R::of(0.5);
        let rounding = (half * half + (jerk + jerk) * distance.abs()).sqrt() - half;
        let last = distance.abs() * self.rate;
        let size = rounding.min(acceleration).min(last);
        let wanted = if distance < R::ZERO { -size } else { size };
        self.a = wanted.clamp(self.a - change, self.a + change);
        self.v = if self.a.abs() >= last && self.a == wanted {
            target
        } else {
            self.v + self.a * self.period
        };
    }
}

/// A reference that follows its target at a limited rate.
#[derive(Clone, Copy, Debug)]
pub struct LinearRamp<R> {
    /// Largest change in one step.
    change: R,
    value: R,
}

impl<R: Real> LinearRamp<R> {
    /// At zero, stepped every `period` seconds, changing by at most `rate` in a second.
    pub fn new(rate: f64, period: f64) -> Self {
        Self {
            change: R::of(rate * period),
            value: R::ZERO,
        }
    }

    /// The value now.
    pub fn value(&self) -> R {
        self.value
    }

    /// One period towards `target`.
    pub fn step(&mut self, target: R) -> R {
        self.value = target.clamp(self.value - self.change, self.value + self.change);
        self.value
    }
}
