//! Rolls: idle rolls that the web turns, and the parent roll that gives it off.
//!
//! Not here: bending, eccentricity, slip between web and roll.

use super::units::Units;
use crate::machine::{IdleRoll, Machine};
use crate::real::{Arithmetic, Scalar};

/// An idle roll, or several of one radius, by its mass at the surface.
#[derive(Clone, Copy, Debug)]
pub struct Idle<A: Arithmetic> {
    /// h/6·R²/J.
    per_mass: A::Gain,
    /// Surface friction c, N·s/m.
    friction: A,
}

impl<R: Scalar> Idle<R> {
    /// From its description, for steps of `h` seconds.
    pub fn new(roll: &IdleRoll, units: &Units, h: f64) -> Self {
        let mass = roll.mass_kg() * units.speed / units.force;
        Self {
            per_mass: R::gain(h / 6.0 / mass),
            friction: R::coefficient(roll.friction_n_s_m * units.speed / units.force),
        }
    }
}

impl<A: Arithmetic> Idle<A> {
    /// (J/R²)·V̇ = t_down − t_up − c·V
    #[inline(always)]
    pub fn acceleration(&self, v: A, t_up: A, t_down: A) -> A::Rate {
        (t_down - t_up - self.friction * v).rate(self.per_mass)
    }
}

/// The parent roll in the unwind.
#[derive(Clone, Copy, Debug)]
pub struct Unwind<A: Arithmetic> {
    /// ½·π·ρ·W, kg/m².
    inertia_factor: A,
    /// J_0 − ½·π·ρ·W·R_spool⁴, kg·m².
    inertia_offset: A,
    /// Surface friction c, N·s/m.
    friction: A,
    /// h/6 over 1 kg·m².
    per_inertia: A::Gain,
    /// −h/6·z/2π.
    layer: A::Gain,
}

impl<R: Scalar> Unwind<R> {
    /// From the machine's description, for steps of `h` seconds.
    pub fn new(machine: &Machine, units: &Units, h: f64) -> Self {
        let sixth = h / 6.0;
        let square = units.r_uw * units.r_uw;
        let layer = machine.web.caliper_m / core::f64::consts::TAU;
        Self {
            inertia_factor: R::coefficient(
                machine.web.inertia_factor() * (square * square) / units.inertia,
            ),
            inertia_offset: R::coefficient(machine.parent_roll_offset() / units.inertia),
            friction: R::coefficient(
                machine.parent_roll.friction_n_s_m * units.speed / units.force,
            ),
            per_inertia: R::gain(sixth * units.torque() / (units.inertia * units.omega())),
            layer: R::gain(-(sixth * layer * units.omega() / units.r_uw)),
        }
    }
}

impl<A: Arithmetic> Unwind<A> {
    /// J(R) = J_0 + ½·π·ρ·W·(R⁴ − R_spool⁴), kg·m²
    #[inline(always)]
    pub fn inertia(&self, r: A) -> A {
        let square = r * r;
        self.inertia_offset + self.inertia_factor * (square * square)
    }

    /// J(R)·ω̇ = T + t·R − c·V·R, with the motor's torque less its brake's.
    ///
    /// There is no J̇·ω: the web carries that angular momentum away.
    #[inline(always)]
    pub fn spin(&self, torque: A, t: A, v: A, r: A) -> A::Rate {
        let torque = torque + (t - self.friction * v) * r;
        torque.rate(A::gain_over(self.per_inertia, self.inertia(r)))
    }

    /// {5} Ṙ = −z·V/(2π·R) = −(z/2π)·ω
    #[inline(always)]
    pub fn thin(&self, omega: A) -> A::Rate {
        omega.rate(self.layer)
    }
}
