//! The two-drum windup as one body: drums, rider roll and shipping roll without slip.
//!
//! Not here: slip at the nips, the rider roll's load, wound-on tension.

use crate::machine::Machine;
use crate::real::Real;

/// Equation {15} in surface form.
#[derive(Clone, Copy, Debug)]
pub struct Windup<R> {
    /// J_rd/R_rd² + J_fd/R_fd² + J_rr/R_rr², kg.
    drum_mass: R,
    /// c_rd + c_fd + c_rr + c_wu, N·s/m.
    friction: R,
    /// ½·π·ρ·W, kg/m.
    inertia_factor: R,
    /// ½·π·ρ·W·R_core⁴, kg·m².
    core_inertia: R,
    /// z/2π, m.
    layer: R,
    /// 1/R of the rear drum, the front drum and the rider roll, 1/m.
    per_radius: [R; 3],
}

/// The shipping roll's part of the windup at one radius.
#[derive(Clone, Copy, Debug)]
pub struct ShippingRoll<R> {
    /// 1/R_wu, 1/m.
    per_radius: R,
    /// J_wu/R_wu², kg.
    mass: R,
}

impl<R: Real> Windup<R> {
    /// From the machine's description.
    pub fn new(machine: &Machine) -> Self {
        let driven = [&machine.rear_drum, &machine.front_drum, &machine.rider_roll];
        let friction: f64 = driven.iter().map(|roll| roll.friction_n_s_m).sum();
        let roll = &machine.shipping_roll;
        Self {
            drum_mass: R::of(driven.iter().map(|roll| roll.mass_kg()).sum()),
            friction: R::of(friction + roll.friction_n_s_m),
            inertia_factor: R::of(machine.web.inertia_factor()),
            core_inertia: R::of(machine.web.roll_inertia(roll.core_radius_m)),
            layer: R::of(machine.web.caliper_m / core::f64::consts::TAU),
            per_radius: driven.map(|roll| R::of(1.0 / roll.radius_m)),
        }
    }

    /// Torques of rear drum, front drum and rider roll as one force at the surface, Σ T_j/R_j, N
    #[inline(always)]
    pub fn force(&self, torques: [R; 3]) -> R {
        torques[0] * self.per_radius[0]
            + torques[1] * self.per_radius[1]
            + torques[2] * self.per_radius[2]
    }

    /// J_wu/R² = ½·π·ρ·W·(R⁴ − R_core⁴)/R²
    #[inline(always)]
    pub fn shipping_roll(&self, r: R) -> ShippingRoll<R> {
        let per_radius = R::ONE / r;
        ShippingRoll {
            per_radius,
            mass: self.inertia_factor * (r * r) - self.core_inertia * (per_radius * per_radius),
        }
    }

    /// M = J_rd/R_rd² + J_fd/R_fd² + J_rr/R_rr² + J_wu/R_wu², kg
    #[inline(always)]
    pub fn mass(&self, roll: &ShippingRoll<R>) -> R {
        self.drum_mass + roll.mass
    }

    /// {3} Ṙ_wu = z·V/(2π·R_wu), m/s
    #[inline(always)]
    pub fn radius_rate(&self, roll: &ShippingRoll<R>, v: R) -> R {
        self.layer * v * roll.per_radius
    }

    /// All forces but the brakes': Σ T_j/R_j − t_sr − \[Σ c_j − (J_wu/R_wu²)·(Ṙ_wu/R_wu)\]·V, N
    #[inline(always)]
    pub fn resultant(&self, roll: &ShippingRoll<R>, drive: R, t_sr: R, v: R, r_rate: R) -> R {
        drive - t_sr - (self.friction - roll.mass * (r_rate * roll.per_radius)) * v
    }
}
