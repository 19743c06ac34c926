//! Speed and tension references.
//!
//! Not here: which speed to go to; that is the logic's.

use crate::real::{Real, Sum};

/// A rate is all but gone when it is below so many times its change in a period.
const GONE: f64 = 1.25;

/// A reference that goes to its target with limited rate and limited change of rate: the S-curve.
///
/// Target and limits may change at any time; value and rate stay continuous. For the web speed the rate is the
/// acceleration and its change the jerk.
#[derive(Clone, Copy, Debug)]
pub struct SCurve<R: Real> {
    period: R,
    per_period: R,
    value: R::Sum,
    rate: R,
}

impl<R: Real> SCurve<R> {
    /// At zero, stepped every `period` seconds.
    pub fn new(period: f64) -> Self {
        Self {
            period: R::of(period),
            per_period: R::of(1.0 / period),
            value: R::Sum::at(R::ZERO),
            rate: R::ZERO,
        }
    }

    /// The reference.
    pub fn value(&self) -> R {
        self.value.value()
    }

    /// Its rate, for a second.
    pub fn rate(&self) -> R {
        self.rate
    }

    /// Jumps to a value, at rest: for a drive that takes over a turning machine.
    pub fn set(&mut self, value: R) {
        (self.value, self.rate) = (R::Sum::at(value), R::ZERO);
    }

    /// One period towards `target` with at most `rate`, which changes by at most `jerk` in a second.
    ///
    /// Falling by δ = jerk·T each period, a rate r covers (r² + r·δ)/(2·jerk) until it is gone. So the largest
    /// one that still rounds off into the target is r = −δ/2 + √(δ²/4 + 2·jerk·|target − x|); less than one
    /// period away it is |target − x|/T. The ramp ends on the target exactly, without overshoot.
    ///
    /// Rounding may leave the last steps some hundredths too long; what would pass the target with a rate that
    /// is all but gone, arrives.
    pub fn step(&mut self, target: R, rate: R, jerk: R) {
        let distance = target - self.value();
        if distance == R::ZERO && self.rate == R::ZERO {
            return;
        }
        let change = jerk * self.period;
        let half = change * R::of(0.5);
        let last = distance.abs() * self.per_period;
        let largest = rate.min(last);
        // far from the target no root is needed to see that it is far
        let reach = half * half + (jerk + jerk) * distance.abs();
        let beyond = largest + half;
        let size = if beyond * beyond > reach {
            (reach.sqrt() - half).min(largest)
        } else {
            largest
        };
        let wanted = if distance < R::ZERO { -size } else { size };
        self.rate = wanted.clamp(self.rate - change, self.rate + change);
        let way = self.rate * self.period;
        let gone = self.rate.abs() <= change * R::of(GONE);
        let passes = (distance - way) * distance <= R::ZERO;
        let lands = size == last && self.rate == wanted;
        if lands || (gone && passes) {
            self.value = R::Sum::at(target);
        } else {
            self.value.add(way);
        }
    }
}
