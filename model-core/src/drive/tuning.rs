//! What auto-tune sets: what the regulators know of their plant, and their gains.
//!
//! Not here: how it is found. A tuning starts as the machine's description has it, and is plain numbers: it can be
//! read, kept and put back.

use super::pi::Gains;
use super::{SPREAD, fastest_crossover, first_web_mode, symmetrical_optimum, web_stiffness};
use crate::exchange::Setting;
use crate::machine::Machine;
use crate::real::Real;

/// A speed loop may be no faster than this share of the first web mode, so that it does not work against the web.
pub const SHARE_OF_MODE: f64 = 1.0 / 3.0;
/// Integral gain of the tension loop, of the first web mode.
pub const TENSION_INTEGRAL: f64 = 0.4;
/// Proportional gain of the tension loop.
pub const TENSION_GAIN: f64 = 0.3;
/// Damping ratio that the first web mode is given at crawl, where it has none of its own.
pub const CRAWL_DAMPING: f64 = 0.5;

/// All of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tuning<R> {
    /// Of the windup's regulators.
    pub drums: DrumTuning<R>,
    /// Of the unwind's regulators.
    pub unwind: UnwindTuning<R>,
}

/// The windup as its regulators know it, all at the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DrumTuning<R> {
    /// Mass of drums and rider roll, kg.
    pub drum_mass: R,
    /// ½·π·ρ·W/4: mass of the shipping roll for each m² of its diameter squared.
    pub roll_mass: R,
    /// Friction of all rolls, N·s/m.
    pub friction: R,
    /// Gains of the speed loop for 1 kg.
    pub speed: Gains<R>,
}

/// The parent roll and its web as the unwind's regulators know them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnwindTuning<R> {
    /// J(R) = offset + factor·R⁴, kg·m² and kg/m².
    pub inertia_offset: R,
    /// ½·π·ρ·W, kg/m².
    pub inertia_factor: R,
    /// Friction at the surface, N·s/m.
    pub friction: R,
    /// Gains of the speed loop for 1 kg and a crossover of 1 rad/s; the integral goes with its square.
    pub speed: Gains<R>,
    /// Stiffness of the whole web path, N/m.
    pub web_stiffness: R,
    /// Gains of the tension loop; the integral for a first web mode of 1 rad/s.
    pub tension: Gains<R>,
    /// Largest integral gain of the tension loop that filter and sampling allow, times the period.
    pub tension_integral_limit: R,
    /// Twice the damping ratio that is given to the first web mode at crawl.
    pub damping: R,
}

impl<R: Real> Tuning<R> {
    /// As a machine's description has it, for regulators stepped every `period` seconds.
    pub fn new(machine: &Machine, period: f64) -> Self {
        let (rd, fd, rr) = (&machine.rear_drum, &machine.front_drum, &machine.rider_roll);
        let r = R::of;
        let friction = rd.friction_n_s_m
            + fd.friction_n_s_m
            + rr.friction_n_s_m
            + machine.shipping_roll.friction_n_s_m;
        let crossover = (first_web_mode(machine) * SHARE_OF_MODE).min(fastest_crossover());
        let lag = machine.load_cells.filter_s + super::SAMPLE_LAG_S;
        Self {
            drums: DrumTuning {
                drum_mass: r(rd.mass_kg() + fd.mass_kg() + rr.mass_kg()),
                roll_mass: r(machine.web.inertia_factor() / 4.0),
                friction: r(friction),
                speed: symmetrical_optimum(crossover, period),
            },
            unwind: UnwindTuning {
                inertia_offset: r(machine.parent_roll_offset()),
                inertia_factor: r(machine.web.inertia_factor()),
                friction: r(machine.parent_roll.friction_n_s_m),
                speed: symmetrical_optimum(1.0, period),
                web_stiffness: r(web_stiffness(machine)),
                tension: Gains {
                    proportional: r(TENSION_GAIN),
                    integral: r(TENSION_INTEGRAL * period),
                },
                tension_integral_limit: r(period / (SPREAD * lag)),
                damping: r(2.0 * CRAWL_DAMPING),
            },
        }
    }
}

impl<R: Real> DrumTuning<R> {
    /// Mass of the windup at the surface, M = J_rd/R_rd² + J_fd/R_fd² + J_rr/R_rr² + J_wu/R_wu², kg, with a shipping
    /// roll of diameter `d_wu`.
    pub fn mass(&self, d_wu: R) -> R {
        self.drum_mass + self.roll_mass * (d_wu * d_wu)
    }

    /// Gains of the speed loop for a mass, N·s/m.
    pub fn speed_gains(&self, mass: R) -> Gains<R> {
        self.speed.times(mass)
    }

    /// Takes over mass and friction found with a shipping roll of diameter `d_wu`: the larger part of the mass is
    /// the one that was wrong.
    pub fn learn(&mut self, mass: R, friction: R, d_wu: R) {
        let square = d_wu * d_wu;
        let roll = self.roll_mass * square;
        if roll > self.drum_mass {
            self.roll_mass = (mass - self.drum_mass) / square;
        } else {
            self.drum_mass = mass - roll;
        }
        self.friction = friction;
    }
}

impl<R: Real> UnwindTuning<R> {
    /// Inertia of a parent roll of radius `r`, kg·m².
    pub fn inertia(&self, r: R) -> R {
        let square = r * r;
        self.inertia_offset + self.inertia_factor * (square * square)
    }

    /// First web mode with the drums held, √(k/m), rad/s.
    pub fn mode(&self, mass: R) -> R {
        (self.web_stiffness / mass).sqrt()
    }

    /// Gains of the speed loop for a mass at the surface and its first web mode, N·s/m: the symmetrical optimum,
    /// slowed to a third of the mode.
    pub fn speed_gains(&self, mass: R, mode: R) -> Gains<R> {
        let crossover = (mode * R::of(SHARE_OF_MODE)).min(R::of(fastest_crossover()));
        Gains {
            proportional: self.speed.proportional * crossover * mass,
            integral: self.speed.integral * (crossover * crossover) * mass,
        }
    }

    /// Gains of the tension loop for a first web mode.
    pub fn tension_gains(&self, mode: R) -> Gains<R> {
        Gains {
            proportional: self.tension.proportional,
            integral: (self.tension.integral * mode).min(self.tension_integral_limit),
        }
    }

    /// Takes over inertia and friction at the surface found at radius `r`: the larger part of the inertia is the one
    /// that was wrong.
    pub fn learn(&mut self, inertia: R, friction: R, r: R) {
        let square = r * r;
        let paper = self.inertia_factor * (square * square);
        if paper > self.inertia_offset {
            self.inertia_factor = (inertia - self.inertia_offset) / (square * square);
        } else {
            self.inertia_offset = inertia - paper;
        }
        self.friction = friction;
    }

    /// Takes over the stiffness of the web path, N/m, and how much of the damping at crawl the web has without help.
    pub fn learn_web(&mut self, stiffness: R, damping: R) {
        self.web_stiffness = stiffness;
        let missing = (R::of(CRAWL_DAMPING) - damping).max(R::ZERO);
        self.damping = missing + missing;
    }
}

impl<R: Real> Gains<R> {
    /// As a commissioning engineer reads them, for regulators stepped every `period` seconds.
    pub fn setting(&self, period: R) -> Setting<R> {
        let time = if self.integral > R::ZERO {
            self.proportional / self.integral * period
        } else {
            R::ZERO
        };
        Setting {
            gain: self.proportional,
            time,
        }
    }
}
