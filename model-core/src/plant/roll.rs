//! Rolls: idle rolls that the web turns, and the parent roll that gives it off.
//!
//! Not here: bending, eccentricity, slip between web and roll.

use super::units::Machines;
use crate::machine::Machine;
use crate::real::Arithmetic;

/// An idle roll, or several of one radius, by its mass at the surface.
#[derive(Clone, Copy, Debug)]
pub struct Idle<A: Arithmetic> {
    /// h/3·R²/J.
    per_mass: A::Gain,
    /// Surface friction c, N·s/m.
    friction: A,
}

impl<A: Arithmetic> Idle<A> {
    /// Idle roll `i` of the machines, which must have it, for steps of `h` seconds.
    pub fn new(machines: &impl Machines<A>, i: usize, h: f64) -> Self {
        Self {
            per_mass: machines.gain(|m, u| h / 3.0 * u.force / (m.idle[i].mass_kg() * u.speed)),
            friction: machines.coefficient(|m, u| m.idle[i].friction_n_s_m * u.speed / u.force),
        }
    }

    /// No roll: nothing moves it.
    pub fn none(machines: &impl Machines<A>) -> Self {
        Self {
            per_mass: machines.gain(|_, _| 0.0),
            friction: A::ZERO,
        }
    }

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
    /// h/3 over 1 kg·m².
    per_inertia: A::Gain,
    /// −h/3·z/2π.
    layer: A::Gain,
}

impl<A: Arithmetic> Unwind<A> {
    /// From the machines' description, for steps of `h` seconds.
    pub fn new(machines: &impl Machines<A>, h: f64) -> Self {
        let third = h / 3.0;
        let layer = |m: &Machine| m.web.caliper_m / core::f64::consts::TAU;
        Self {
            inertia_factor: machines.coefficient(|m, u| {
                let square = u.r_uw * u.r_uw;
                m.web.inertia_factor() * (square * square) / u.inertia
            }),
            inertia_offset: machines.coefficient(|m, u| m.parent_roll_offset() / u.inertia),
            friction: machines.coefficient(|m, u| m.parent_roll.friction_n_s_m * u.speed / u.force),
            per_inertia: machines.gain(|_, u| third * u.torque() / (u.inertia * u.omega())),
            layer: machines.gain(|m, u| -(third * layer(m) * u.omega() / u.r_uw)),
        }
    }

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
