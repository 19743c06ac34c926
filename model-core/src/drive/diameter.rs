//! The unwind drive's estimate of the parent-roll radius, from a preset and the ratio of two encoders.
//!
//! Not here: the true radius. A drive cannot see it.

use crate::machine::Machine;
use crate::real::{Real, Sum};

/// Below this share of the highest speed the ratio of the encoders is too coarse.
const HOLD_SPEED: f64 = 0.03;
/// The radius may fall this many times faster than the caliper and the speed say.
const RATE_MARGIN: f64 = 2.0;
/// Lag of the estimate behind the encoders, s: longer than the slowest swing of the roll against the web. An
/// estimate that follows the swing takes it for diameter and hides it from the damping.
const LAG_S: f64 = 1.0;

/// The estimate without interlocks knows the roll's largest radius only so far.
const BARE_LIMIT: f64 = 1.5;

/// R̂ = V_rd/ω_uw with a lag and the interlocks of a drive.
#[derive(Clone, Copy, Debug)]
pub struct DiameterEstimator<R: Real> {
    hold_speed: R,
    /// Share of the difference that a period makes up for.
    share: R,
    /// Margin·z/2π·T: largest change in a period, for each rad/s.
    layer: R,
    spool: R,
    full: R,
    r: R::Sum,
}

impl<R: Real> DiameterEstimator<R> {
    /// Stands at a full roll until a preset comes; stepped every `period` seconds.
    pub fn new(machine: &Machine, period: f64) -> Self {
        let layer = machine.web.caliper_m / core::f64::consts::TAU;
        let full = R::of(machine.parent_roll.full_radius_m);
        Self {
            share: R::of(-libm::expm1(-period / LAG_S)),
            hold_speed: R::of(HOLD_SPEED * machine.operation.max_speed_m_s),
            layer: R::of(RATE_MARGIN * layer * period),
            spool: R::of(machine.parent_roll.spool_radius_m),
            full,
            r: R::Sum::at(full),
        }
    }

    /// The estimate R̂, m.
    pub fn radius(&self) -> R {
        self.r.value()
    }

    /// Takes over a preset, within spool and full roll.
    pub fn preset(&mut self, r: R) {
        self.r = R::Sum::at(r.clamp(self.spool, self.full));
    }

    /// One period as in the paper's simulator: the ratio as it comes, kept only from what no coefficient can be
    /// computed with. At the start, while slack is taken up and at rest, the ratio is anything.
    pub fn step_bare(&mut self, v_rd: R, omega_uw: R) {
        if omega_uw == R::ZERO {
            return;
        }
        let (low, high) = (self.spool, self.full * R::of(BARE_LIMIT));
        let ratio = (v_rd / omega_uw).clamp(low, high);
        self.r.add(self.share * (ratio - self.radius()));
    }

    /// One period. Held below the hold speed and while `hold`; falls only, no faster than caliper and speed
    /// allow, never below the spool.
    pub fn step(&mut self, v_rd: R, omega_uw: R, hold: bool) {
        if hold || v_rd < self.hold_speed || omega_uw <= R::ZERO {
            return;
        }
        let change = self.share * (v_rd / omega_uw - self.radius());
        self.r.add(change.clamp(-(self.layer * omega_uw), R::ZERO));
        if self.radius() < self.spool {
            self.r = R::Sum::at(self.spool);
        }
    }
}
