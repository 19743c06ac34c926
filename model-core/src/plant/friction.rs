//! Mechanical brakes: Coulomb friction as the set-valued law it is, and the paper's Karnopp model beside it.
//!
//! Not here: brake temperature, hydraulics (a pure delay stands for them).
//!
//! The paper's figure 2 holds a roll by setting its *acceleration* to zero inside a band ±ΔV; the roll creeps on
//! with whatever speed it had when it entered. The set-valued law has no band: the friction of a step is the
//! force that would bring the body to rest by the end of the step, as far as the brake can.

use crate::machine::MAX_BRAKE_DELAY_S;
use crate::real::Real;

/// The friction of one braked body for one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Friction<R> {
    /// λ, constant over the step: a force in N or a torque in N·m.
    pub lambda: R,
    /// The brake holds the body: its speed is exactly zero after the step.
    pub sticks: bool,
}

impl<R: Real> Friction<R> {
    /// No friction.
    pub const NONE: Self = Self {
        lambda: R::ZERO,
        sticks: false,
    };
}

/// Which law a closed brake follows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Law<R> {
    /// λ = clamp(M·V/h + F_ext, ±F_b), with 1/h.
    SetValued {
        /// 1/h, 1/s.
        per_step: R,
    },
    /// Figure 2 of the paper, with its ΔV.
    Karnopp {
        /// Half width of the stiction band.
        band: R,
    },
}

/// A brake over one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Brake<R> {
    /// F_b while the body moves; zero when the brake is open.
    sliding: R,
    /// F_b while it stands.
    sticking: R,
    law: Law<R>,
}

impl<R: Real> Brake<R> {
    /// No brake.
    pub const NONE: Self = Self {
        sliding: R::ZERO,
        sticking: R::ZERO,
        law: Law::SetValued { per_step: R::ZERO },
    };

    /// A closed brake.
    pub fn closed(sliding: R, static_ratio: R, law: Law<R>) -> Self {
        Self {
            sliding,
            sticking: sliding * static_ratio,
            law,
        }
    }

    /// The same brake by another law.
    pub fn following(self, law: Law<R>) -> Self {
        Self { law, ..self }
    }

    /// This brake if `closed`, otherwise none.
    pub fn when(self, closed: bool) -> Self {
        if closed { self } else { Self::NONE }
    }

    /// Both brakes on one body.
    pub fn with(&self, other: &Self) -> Self {
        Self {
            sliding: self.sliding + other.sliding,
            sticking: self.sticking + other.sticking,
            law: if other.sliding > R::ZERO {
                other.law
            } else {
                self.law
            },
        }
    }

    /// What part of the friction of `all` this one of them gives.
    pub fn share_of(&self, all: &Self) -> R {
        if self.sliding > R::ZERO {
            self.sliding / all.sliding
        } else {
            R::ZERO
        }
    }

    /// The friction on a body that moves at `v`.
    pub fn against(&self, v: R) -> R {
        if v > R::ZERO {
            self.sliding
        } else if v < R::ZERO {
            -self.sliding
        } else {
            R::ZERO
        }
    }

    /// The friction on a body of inertia M and speed V, under the external force F_ext (viscous friction
    /// included) at the start of the step.
    #[inline(always)]
    pub fn hold(&self, mass: R, v: R, external: R) -> Friction<R> {
        if self.sliding <= R::ZERO {
            return Friction::NONE;
        }
        match self.law {
            Law::SetValued { per_step } => {
                let needed = mass * v * per_step + external;
                let stands = v == R::ZERO;
                let limit = if stands { self.sticking } else { self.sliding };
                let sticks = needed.abs() < limit;
                Friction {
                    lambda: if sticks {
                        needed
                    } else {
                        needed.limit(self.sliding)
                    },
                    sticks,
                }
            }
            Law::Karnopp { band } => {
                let balanced = v.abs() < band && external.abs() < self.sticking;
                let against = if v.abs() < band { external } else { v };
                let opposing = if against < R::ZERO {
                    -self.sliding
                } else {
                    self.sliding
                };
                Friction {
                    lambda: if balanced { external } else { opposing },
                    sticks: false,
                }
            }
        }
    }
}

/// A pure delay of an on/off signal by whole steps.
#[derive(Clone, Copy, Debug)]
pub struct Delay {
    steps: u32,
    /// The signal of the last step, and how many steps in a row it has been so.
    last: bool,
    steady: u32,
    /// The signal of the steps before, the last one lowest; kept only while it is not steady.
    history: u128,
}

impl Delay {
    /// A delay of `delay_s` in steps of `h` seconds, to the nearest step; at start the signal was off.
    pub fn new(delay_s: f64, h: f64) -> Self {
        let steps = delay_s.clamp(0.0, MAX_BRAKE_DELAY_S) / h + 0.5;
        Self {
            steps: (steps as u32).min(u128::BITS - 1),
            last: false,
            steady: u128::BITS,
            history: 0,
        }
    }

    /// Takes the signal of this step, gives the one of `delay_s` ago.
    pub fn step(&mut self, on: bool) -> bool {
        if on == self.last && self.steady > self.steps {
            return on;
        }
        if self.steady > self.steps {
            self.history = if self.last { u128::MAX } else { 0 };
        }
        self.steady = if on == self.last { self.steady + 1 } else { 1 };
        self.last = on;
        self.history = self.history << 1 | u128::from(on);
        self.history >> self.steps & 1 == 1
    }

    /// The signal has been off for longer than `delay_s`: as long as it stays off, a step changes nothing.
    pub fn rests(&self) -> bool {
        !self.last && self.steady > self.steps
    }
}
