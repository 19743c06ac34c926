//! Mechanical brakes: Coulomb friction as the set-valued law it is.
//!
//! Not here: brake temperature, hydraulics (a pure delay stands for them), static above kinetic friction.
//!
//! The paper's figure 2 holds a roll by setting its *acceleration* to zero inside a band ±ΔV; the roll creeps on
//! with whatever speed it had when it entered. Here the friction force of a step is the one that would bring
//! the body to rest by the end of the step, as far as the brake can; there is no band to choose.

use crate::machine::MAX_BRAKE_DELAY_S;
use crate::real::Real;

/// The friction of one braked body for one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Friction<R> {
    /// λ, constant over the step: a force in N or a torque in N·m.
    pub lambda: R,
    /// The brake can hold the body: its speed is exactly zero after the step.
    pub sticks: bool,
}

impl<R: Real> Friction<R> {
    /// No brake.
    pub const NONE: Self = Self {
        lambda: R::ZERO,
        sticks: false,
    };

    /// λ = clamp(M·V/h + F_ext, ±F_b), with the body's momentum M·V, the external force F_ext (viscous friction
    /// included) at the start of the step, and the brake's force F_b.
    #[inline(always)]
    pub fn of(momentum: R, external: R, brake: R, per_step: R) -> Self {
        let needed = momentum * per_step + external;
        Self {
            lambda: needed.limit(brake),
            sticks: needed.abs() < brake,
        }
    }
}

/// A pure delay of an on/off signal by whole steps.
#[derive(Clone, Copy, Debug)]
pub struct Delay {
    steps: u32,
    history: u128,
}

impl Delay {
    /// A delay of `delay_s` in steps of `h` seconds, to the nearest step; at start the signal was off.
    pub fn new(delay_s: f64, h: f64) -> Self {
        let steps = delay_s.clamp(0.0, MAX_BRAKE_DELAY_S) / h + 0.5;
        Self {
            steps: (steps as u32).min(u128::BITS - 1),
            history: 0,
        }
    }

    /// Takes the signal of this step, gives the one of `delay_s` ago.
    pub fn step(&mut self, on: bool) -> bool {
        self.history = self.history << 1 | u128::from(on);
        self.history >> self.steps & 1 == 1
    }
}
