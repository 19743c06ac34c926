//! Motors with ideal torque regulators: shaft torque is the reference, within the motor's limits.
//!
//! Not here: overload in time, temperature, field weakening beyond constant power.

use crate::machine;
use crate::real::Real;

/// Limits of a motor.
#[derive(Clone, Copy, Debug)]
pub struct Motor<R> {
    torque: R,
    power: R,
    per_torque: R,
}

impl<R: Real> Motor<R> {
    /// From its description.
    pub fn new(motor: &machine::Motor) -> Self {
        Self {
            torque: R::of(motor.torque_n_m),
            power: R::of(motor.power_w),
            per_torque: R::of(1.0 / motor.torque_n_m),
        }
    }

    /// Largest torque at a speed, N·m: `share` of the rated one, above the base speed of constant power.
    pub fn limit(&self, omega: R, share: R) -> R {
        let demand = self.torque * omega.abs();
        let torque = if demand > self.power {
            self.power / omega.abs()
        } else {
            self.torque
        };
        torque * share
    }

    /// Rated torque, N·m.
    pub fn rated(&self) -> R {
        self.torque
    }

    /// A torque as share of the rated one.
    pub fn load(&self, torque: R) -> R {
        torque * self.per_torque
    }
}
