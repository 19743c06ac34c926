//! A proportional–integral regulator as a difference equation.
//!
//! Not here: its gains; each loop derives them from its own plant.

use crate::real::Real;

/// Gains for one step; they may change from step to step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gains<R> {
    /// Proportional gain.
    pub proportional: R,
    /// Integral gain times the period.
    pub integral: R,
}

impl<R: Real> Gains<R> {
    /// Both gains times a factor.
    pub fn times(&self, factor: R) -> Self {
        Self {
            proportional: self.proportional * factor,
            integral: self.integral * factor,
        }
    }
}

/// The regulator's memory.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pi<R> {
    integral: R,
}

impl<R: Real> Pi<R> {
    /// Forgets the integral: for a loop that opens.
    pub fn reset(&mut self) {
        self.integral = R::ZERO;
    }

    /// Sets the integral so that the loop closes at `output`, without a bump.
    pub fn start_at(&mut self, gains: &Gains<R>, error: R, output: R) {
        self.integral = output - gains.proportional * error;
    }

    /// u = u_ff + K_p·e + Σ K_i·T·e, limited to `low ..= high`.
    ///
    /// At a limit the integral moves only away from it.
    pub fn step(&mut self, gains: &Gains<R>, error: R, feed_forward: R, low: R, high: R) -> R {
        let increment = gains.integral * error;
        let output = feed_forward + gains.proportional * error + self.integral + increment;
        let limited = output.clamp(low, high);
        let pushes_out = output != limited && (output > limited) == (increment > R::ZERO);
        if !pushes_out {
            self.integral += increment;
        }
        limited
    }
}
