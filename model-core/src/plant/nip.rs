//! The nips of the shipping roll: how hard it lies on the drums, what they can carry, how tight it is wound.
//!
//! Not here: rolling resistance (the windup's), the shape of the contact, vibration of the roll set.

use heapless::Vec;

use super::windup::ROLLS;
use crate::exchange::Rider;
use crate::machine::{MAX_RIDER_LOADS, Machine};
use crate::real::Real;

/// Acceleration of gravity, m/s² (CGPM 1901).
const GRAVITY: f64 = 9.806_65;

/// Coefficients of the nips.
#[derive(Clone, Debug)]
pub struct Nips<R> {
    /// μ·W, m: nip force per width to tangential force.
    friction: R,
    /// Share of it that worn drums have lost, and have left.
    lost: R,
    left: R,
    static_ratio: R,
    /// R_d + s/2 and R_d, of the rear and of the front drum, m.
    half_distance: [R; 2],
    drum: [R; 2],
    /// π·ρ·g, N/m³: weight per width of a solid roll for each m² of its radius squared.
    weight: R,
    /// Square of the core's radius, m²: the core weighs nothing.
    core: R,
    rider: RiderLoad<R>,
    /// Share of its load that the rider roll has; 0 while it is lifted.
    pressed: R,
    /// As it was commanded last.
    pressing: Rider<R>,
    wound_on: WoundOn<R>,
}

/// Load of the rider roll over the diameter of the shipping roll, linear between its points.
#[derive(Clone, Debug)]
struct RiderLoad<R> {
    /// Radius, m, load per width, N/m, and its slope to the next point, N/m².
    points: Vec<(R, R, R), MAX_RIDER_LOADS>,
}

/// Coefficients of the wound-on tension.
#[derive(Clone, Copy, Debug)]
struct WoundOn<R> {
    compresses: bool,
    per_width: R,
    tension_gain: R,
    force_gain: R,
    paper_friction: R,
    per_nip_scale: R,
    per_reference: R,
    hardness: R,
}

impl<R: Real> Nips<R> {
    /// From the machine's description.
    pub fn new(machine: &Machine) -> Self {
        let (nips, wound) = (&machine.nips, &machine.wound_on_tension);
        let drums = [machine.rear_drum.radius_m, machine.front_drum.radius_m];
        let core = machine.shipping_roll.core_radius_m;
        let weight = core::f64::consts::PI * machine.web.density_kg_m3() * GRAVITY;
        Self {
            friction: R::of(nips.friction * machine.web.width_m),
            lost: R::ZERO,
            left: R::ONE,
            static_ratio: R::of(nips.static_ratio),
            half_distance: drums.map(|r| R::of(r + 0.5 * nips.drum_gap_m)),
            drum: drums.map(R::of),
            weight: R::of(weight),
            core: R::of(core * core),
            rider: RiderLoad::new(machine),
            pressed: R::ONE,
            pressing: Rider {
                lifted: false,
                load_trim: R::ZERO,
            },
            wound_on: WoundOn {
                compresses: wound.compresses,
                per_width: R::of(1.0 / machine.web.width_m),
                tension_gain: R::of(wound.tension_gain),
                force_gain: R::of(wound.force_gain),
                paper_friction: R::of(wound.paper_friction),
                per_nip_scale: R::of(1.0 / wound.nip_scale_n_m),
                per_reference: R::of(1.0 / wound.reference_n_m),
                hardness: R::of(wound.hardness),
            },
        }
    }

    /// Layers are thinner the tighter they are wound.
    pub fn compress(&self) -> bool {
        self.wound_on.compresses
    }

    /// Loads of the nips per width, N/m: rear drum, front drum, rider roll.
    ///
    /// N = (w + Q)/(2·cos α) at each drum, sin α = (R_d + s/2)/(R_d + R_wu); the rider roll's nip carries Q.
    ///
    /// w = π·ρ·g·(R_wu² − R_core²) is the weight of the roll, Q the rider roll's load, both per width.
    pub fn loads(&self, r_wu: R) -> [R; ROLLS] {
        let rider = self.pressed * self.rider.at(r_wu);
        let weight = self.weight * (r_wu * r_wu - self.core);
        let half = R::of(0.5) * (weight + rider);
        let drum = |i: usize| {
            let sine = self.half_distance[i] / (self.drum[i] + r_wu);
            half / (R::ONE - sine * sine).sqrt()
        };
        [drum(0), drum(1), rider]
    }

    /// Lifts the rider roll, or presses it on with another load than its table's; tells whether it does so now.
    pub fn press(&mut self, rider: &Rider<R>) -> bool {
        if *rider == self.pressing {
            return false;
        }
        self.pressing = *rider;
        self.pressed = if rider.lifted {
            R::ZERO
        } else {
            (R::ONE + rider.load_trim).max(R::ZERO)
        };
        rider.lifted || rider.load_trim != R::ZERO
    }

    /// The rider roll is off the shipping roll.
    pub fn rider_lifted(&self) -> bool {
        self.pressing.lifted
    }

    /// Drums that have lost a share of their friction; tells whether they lose it now.
    pub fn wear(&mut self, lost: R) -> bool {
        if lost == self.lost {
            return false;
        }
        self.lost = lost;
        self.left = R::ONE - lost.clamp(R::ZERO, R::ONE);
        lost > R::ZERO
    }

    /// Largest tangential force of each nip while it slides, μ·N·W, N.
    pub fn traction(&self, loads: &[R; ROLLS]) -> [R; ROLLS] {
        let [rd, fd, rr] = loads.map(|load| self.friction * load);
        [self.left * rd, self.left * fd, rr]
    }

    /// The same for a nip that sticks.
    pub fn static_traction(&self, loads: &[R; ROLLS]) -> [R; ROLLS] {
        self.traction(loads).map(|force| self.static_ratio * force)
    }

    /// WOT = k_t·t_sr/W + μ_ww·N/(1 + N/N_0) + k_F·F_fd/W, N/m
    ///
    /// An engineering model: its gains are parameters to be fitted to a winder.
    pub fn wound_on_tension(&self, loads: &[R; ROLLS], t_sr: R, front_force: R) -> R {
        let w = &self.wound_on;
        let nip = loads[0];
        w.tension_gain * t_sr * w.per_width
            + w.paper_friction * nip / (R::ONE + nip * w.per_nip_scale)
            + w.force_gain * front_force * w.per_width
    }

    /// z_eff/z = 1 − κ·(WOT/WOT_ref − 1), within a half and one and a half; 1 where layers do not compress.
    pub fn thickness(&self, wound_on_tension: R) -> R {
        let w = &self.wound_on;
        if w.compresses {
            let tightness = wound_on_tension * w.per_reference - R::ONE;
            R::ONE - (w.hardness * tightness).limit(R::of(0.5))
        } else {
            R::ONE
        }
    }
}

impl<R: Real> RiderLoad<R> {
    fn new(machine: &Machine) -> Self {
        let table = &machine.nips.rider_load;
        let slope = |i: usize| match table.get(i + 1) {
            Some(next) if next.diameter_m > table[i].diameter_m => {
                let rise = next.load_n_m - table[i].load_n_m;
                2.0 * rise / (next.diameter_m - table[i].diameter_m)
            }
            _ => 0.0,
        };
        let points = table.iter().enumerate().map(|(i, point)| {
            let radius = R::of(0.5 * point.diameter_m);
            (radius, R::of(point.load_n_m), R::of(slope(i)))
        });
        Self {
            points: points.collect(),
        }
    }

    fn at(&self, r: R) -> R {
        let mut load = self.points.first().map_or(R::ZERO, |point| point.1);
        for (from, at_from, slope) in &self.points {
            if r >= *from {
                load = *at_from + *slope * (r - *from);
            }
        }
        load
    }
}
