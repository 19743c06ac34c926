//! Rolls: idle rolls that the web turns, and the parent roll that gives it off.
//!
//! Not here: bending, eccentricity, slip between web and roll.

use crate::machine::{IdleRoll, Machine};
use crate::real::Real;

/// An idle roll, or several of one radius, by its mass at the surface.
#[derive(Clone, Copy, Debug)]
pub struct Idle<R> {
    /// R²/J, 1/kg.
    per_mass: R,
    /// Surface friction c, N·s/m.
    friction: R,
}

impl<R: Real> Idle<R> {
    /// From its description.
    pub fn new(roll: &IdleRoll) -> Self {
        Self {
            per_mass: R::of(1.0 / roll.mass_kg()),
            friction: R::of(roll.friction_n_s_m),
        }
    }

    /// (J/R²)·V̇ = t_down − t_up − c·V
    #[inline(always)]
    pub fn acceleration(&self, v: R, t_up: R, t_down: R) -> R {
        (t_down - t_up - self.friction * v) * self.per_mass
    }
}

/// The parent roll in the unwind.
#[derive(Clone, Copy, Debug)]
pub struct Unwind<R> {
    /// ½·π·ρ·W, kg/m.
    inertia_factor: R,
    /// J_0 − ½·π·ρ·W·R_spool⁴, kg·m².
    inertia_offset: R,
    /// Surface friction c, N·s/m.
    friction: R,
    /// z/2π, m.
    layer: R,
}

impl<R: Real> Unwind<R> {
    /// From the machine's description.
    pub fn new(machine: &Machine) -> Self {
        Self {
            inertia_factor: R::of(machine.web.inertia_factor()),
            inertia_offset: R::of(machine.parent_roll_offset()),
            friction: R::of(machine.parent_roll.friction_n_s_m),
            layer: R::of(machine.web.caliper_m / core::f64::consts::TAU),
        }
    }

    /// J(R) = J_0 + ½·π·ρ·W·(R⁴ − R_spool⁴), kg·m²
    #[inline(always)]
    pub fn inertia(&self, r: R) -> R {
        let square = r * r;
        self.inertia_offset + self.inertia_factor * (square * square)
    }

    /// What turns the roll besides its brake: T + t·R − c·V·R, N·m
    #[inline(always)]
    pub fn torque(&self, motor: R, t: R, v: R, r: R) -> R {
        motor + (t - self.friction * v) * r
    }

    /// {5} Ṙ = −z·V/(2π·R) = −(z/2π)·ω, m/s
    ///
    /// There is no J̇·ω in the roll's torque balance: the web carries that angular momentum away.
    #[inline(always)]
    pub fn radius_rate(&self, omega: R) -> R {
        -(self.layer * omega)
    }
}
