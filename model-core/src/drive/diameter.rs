//! The unwind drive's estimate of the parent-roll radius, from a preset and the ratio of two encoders.
//!
//! Not here: the true radius. A drive cannot see it.

use crate::machine::Machine;
use crate::real::Real;

/// Below this share of the highest speed the ratio of the encoders is too coarse.
const HOLD_SPEED: f64 = 0.03;
/// The radius may fall this many times faster than the caliper and the speed say.
const RATE_MARGIN: f64 = 2.0;

/// R̂ = V_rd/ω_uw with the interlocks of a drive.
#[derive(Clone, Copy, Debug)]
pub struct DiameterEstimator<R> {
    hold_speed: R,
    /// Margin·z/2π·T: largest change in a period, for each rad/s.
    layer: R,
    spool: R,
    full: R,
    r: R,
}

impl<R: Real> DiameterEstimator<R> {
    /// Stands at a full roll until a preset comes; stepped every `period` seconds.
    pub fn new(machine: &Machine, period: f64) -> Self {
        let layer = machine.web.caliper_m / core::f64::consts::TAU;
        let full = R::of(machine.parent_roll.full_radius_m);
        Self {
            hold_speed: R::of(HOLD_SPEED * machine.operation.max_speed_m_s),
            layer: R::of(RATE_MARGIN * layer * period),
            spool: R::of(machine.parent_roll.spool_radius_m),
            full,
            r: full,
        }
    }

    /// The estimate R̂, m.
    pub fn radius(&self) -> R {
        self.r
    }

    /// Takes over a preset, within spool and full roll.
    pub fn preset(&mut self, r: R) {
        self.r = r.clamp(self.spool, self.full);
    }

    /// One period. Held below the hold speed and while `hold`; falls only, no faster than caliper and speed
    /// allow, never below the spool.
    pub fn step(&mut self, v_rd: R, omega_uw: R, hold: bool) {
        if hold || v_rd < self.hold_speed || omega_uw <= R::ZERO {
            return;
        }
        let lowest = (self.r - self.layer * omega_uw).max(self.spool);
        self.r = (v_rd / omega_uw).clamp(lowest, self.r);
    }
}
