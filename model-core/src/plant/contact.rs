//! What brakes and nips hold: which rolls stand, and which stick to the shipping roll or slide on it.
//!
//! Not here: how the rolls move (the motion's), how hard the shipping roll lies on the others (the nips').
//!
//! What sticks together is one body, and its speeds stay equal to the bit. What slides is pulled with the traction of
//! its nip. Which of them slide is decided once a step, from the forces that sticking would take; a roll that has
//! slid sticks again when the speeds have met.

use super::friction::{Brake, Friction};
use super::windup::{LEAST_MASS, Nip, Parts, REAR, ROLLS, Speeds};
use crate::exchange::BySection;
use crate::machine::Machine;
use crate::real::Real;

/// Coefficients of the bodies in contact.
#[derive(Clone, Copy, Debug)]
pub struct Contact<R> {
    /// J/R² of each roll, kg.
    mass: [R; ROLLS],
    /// Surface friction c of each roll, N·s/m.
    friction: [R; ROLLS],
    /// Rolling resistance of the shipping roll c_wu, N·s/m.
    resistance: R,
    /// ½·π·ρ·W, kg/m².
    inertia_factor: R,
    /// R_core, m.
    core: R,
    /// ¼·g·W, kg/m.
    growth: R,
    /// 1/R of each roll, 1/m.
    per_radius: [R; ROLLS],
    least_mass: R,
    /// 1/h, 1/s.
    per_step: R,
}

/// The parent roll as its brake meets it.
#[derive(Clone, Copy, Debug)]
pub struct ParentRoll<R> {
    /// ½·π·ρ·W, kg/m².
    inertia_factor: R,
    /// J_0 − ½·π·ρ·W·R_spool⁴, kg·m².
    inertia_offset: R,
    /// Surface friction c, N·s/m.
    friction: R,
}

impl<R: Real> ParentRoll<R> {
    /// From the machine's description.
    pub fn new(machine: &Machine) -> Self {
        Self {
            inertia_factor: R::of(machine.web.inertia_factor()),
            inertia_offset: R::of(machine.parent_roll_offset()),
            friction: R::of(machine.parent_roll.friction_n_s_m),
        }
    }

    /// How a brake holds the roll of radius `r` over a step, against its motor and the web's tension `t`.
    pub fn hold(&self, brake: &Brake<R>, motor: R, t: R, omega: R, r: R) -> Friction<R> {
        let square = r * r;
        let inertia = self.inertia_offset + self.inertia_factor * (square * square);
        let free = motor + (t - self.friction * (omega * r)) * r;
        brake.hold(inertia, omega, free)
    }
}

/// The shipping roll at one radius.
#[derive(Clone, Copy, Debug)]
pub struct ShippingRoll<R> {
    /// J_wu/R_wu², kg.
    mass: R,
    /// (J_wu/R_wu²)·(Ṙ_wu/R_wu), kg/s.
    growth: R,
}

impl<R: Real> Holding<R> {
    /// Without brakes, all nips sticking; their forces are not asked for.
    pub fn free(drive: [R; ROLLS]) -> Self {
        Self {
            parts: Parts {
                drive,
                nips: [Nip::Sticks; ROLLS],
            },
            nip_force: [R::ZERO; ROLLS],
            roll_stops: false,
            stops: [false; ROLLS],
            meets: [false; ROLLS],
        }
    }

    /// Nothing is to be done at the end of the step.
    pub fn goes_on(&self) -> bool {
        !self.roll_stops && self.parts.nips.iter().all(|nip| *nip == Nip::Sticks)
    }
}

impl<R: Real> Nip<R> {
    /// The nip of a roll and the shipping roll at their speeds; how hard it pulls is for the next step to say.
    pub fn between(roll: R, wu: R) -> Self {
        if roll == wu {
            Nip::Sticks
        } else {
            Nip::Slides(roll - wu)
        }
    }
}

/// All forces on the bodies but those of the nips, at one instant.
struct Forces<R> {
    rolls: [R; ROLLS],
    wu: R,
}

/// The body that the shipping roll is part of.
struct Body<R> {
    mass: R,
    force: R,
}

/// How the nips and the brakes of the windup hold in one step.
#[derive(Clone, Copy, Debug)]
pub struct Holding<R> {
    /// Drives less brakes, and the nips.
    pub parts: Parts<R>,
    /// Tangential force of each nip on the shipping roll, N.
    pub nip_force: [R; ROLLS],
    /// The brakes bring the shipping roll, and what sticks to it, to rest.
    roll_stops: bool,
    /// The brake of a sliding roll brings it to rest.
    stops: [bool; ROLLS],
    /// The slip of a sliding roll ends within the step.
    meets: [bool; ROLLS],
}

/// What the nips can carry, N.
#[derive(Clone, Copy, Debug)]
pub struct Traction<R> {
    /// While they stick.
    pub sticking: [R; ROLLS],
    /// While they slide.
    pub sliding: [R; ROLLS],
}

impl<R: Real> Contact<R> {
    /// From the machine's description, in steps of `h` seconds.
    pub fn new(machine: &Machine, h: f64) -> Self {
        let rolls = [&machine.rear_drum, &machine.front_drum, &machine.rider_roll];
        let roll = &machine.shipping_roll;
        let layer = machine.web.caliper_m / core::f64::consts::TAU;
        Self {
            mass: rolls.map(|roll| R::of(roll.mass_kg())),
            friction: rolls.map(|roll| R::of(roll.friction_n_s_m)),
            resistance: R::of(roll.friction_n_s_m),
            inertia_factor: R::of(machine.web.inertia_factor()),
            core: R::of(roll.core_radius_m),
            growth: R::of(machine.web.inertia_factor() * layer),
            per_radius: rolls.map(|roll| R::of(1.0 / roll.radius_m)),
            least_mass: R::of(LEAST_MASS),
            per_step: R::of(1.0 / h),
        }
    }

    /// Torques of the motors as forces at the surfaces T_j/R_j, N.
    pub fn drive(&self, torque: &BySection<R>) -> [R; ROLLS] {
        let torque = [torque.rd, torque.fd, torque.rr];
        core::array::from_fn(|j| torque[j] * self.per_radius[j])
    }

    /// The shipping roll, as [`Windup::shipping_roll`](super::windup::Windup::shipping_roll) has it.
    pub fn shipping_roll(&self, r: R, paper: R) -> ShippingRoll<R> {
        let core = self.core / r;
        let square = core * core;
        let hollow = R::ONE - square * square;
        ShippingRoll {
            mass: self.inertia_factor * (r * r) * hollow,
            growth: self.growth * paper * hollow,
        }
    }

    fn forces(
        &self,
        v: &Speeds<R>,
        roll: &ShippingRoll<R>,
        t_sr: R,
        drive: &[R; ROLLS],
    ) -> Forces<R> {
        let mut rolls = core::array::from_fn(|j| drive[j] - self.friction[j] * v.rolls[j]);
        rolls[REAR] -= t_sr;
        Forces {
            rolls,
            wu: (roll.growth - self.resistance) * v.wu,
        }
    }

    fn body(&self, forces: &Forces<R>, roll: &ShippingRoll<R>, nips: &[Nip<R>; ROLLS]) -> Body<R> {
        let mut body = Body {
            mass: roll.mass,
            force: forces.wu,
        };
        let mut alone = true;
        for (j, nip) in nips.iter().enumerate() {
            match *nip {
                Nip::Sticks => {
                    body.mass += self.mass[j];
                    body.force += forces.rolls[j];
                    alone = false;
                }
                Nip::Slides(force) => body.force += force,
            }
        }
        if alone {
            body.mass = body.mass.max(self.least_mass);
        }
        body
    }

    /// Decides for one step how brakes and nips hold.
    ///
    /// A brake's force is the one that would bring its body to rest by the end of the step, as far as it can; the
    /// brakes of rolls that stick together share it by what they can give. The force of a sliding nip is, in the
    /// same way, the one that would end its slip, as far as its traction goes. Then every sticking nip is asked
    /// for the force that it needs: the one that is furthest beyond its traction lets go, until none is.
    pub fn hold(
        &self,
        v: &Speeds<R>,
        roll: &ShippingRoll<R>,
        t_sr: R,
        mut parts: Parts<R>,
        brakes: &[Brake<R>; ROLLS],
        traction: Option<&Traction<R>>,
    ) -> Holding<R> {
        let meets = match traction {
            Some(traction) => self.catch(v, roll, t_sr, &mut parts, brakes, traction),
            None => [false; ROLLS],
        };
        loop {
            let mut holding = self.hold_with(v, roll, t_sr, parts, brakes);
            holding.meets = meets;
            let Some(traction) = traction else {
                return holding;
            };
            let excess = |j: &usize| holding.nip_force[*j].abs() - traction.sticking[*j];
            let sticking = (0..ROLLS).filter(|j| parts.nips[*j] == Nip::Sticks);
            let loosest = sticking
                .filter(|j| excess(j) > R::ZERO)
                .reduce(|a, b| if excess(&b) > excess(&a) { b } else { a });
            let Some(j) = loosest else {
                return holding;
            };
            let pull = traction.sliding[j];
            let forward = holding.nip_force[j] > R::ZERO;
            parts.nips[j] = Nip::Slides(if forward { pull } else { -pull });
        }
    }

    /// How a brake holds the windup over a step, where it is one body at speed `v`.
    pub fn hold_whole(
        &self,
        v: R,
        roll: &ShippingRoll<R>,
        t_sr: R,
        drive: &[R; ROLLS],
        brake: &Brake<R>,
    ) -> Friction<R> {
        let speeds = Speeds {
            rolls: [v; ROLLS],
            wu: v,
        };
        let forces = self.forces(&speeds, roll, t_sr, drive);
        let body = self.body(&forces, roll, &[Nip::Sticks; ROLLS]);
        brake.hold(body.mass, v, body.force)
    }

    /// F_j = clamp(m·\[(V_j − V_wu)/h + f_j/m_j − f_wu/m_wu\], ±μ·N·W) of the sliding nips one after the other, with
    /// the reduced mass m: each takes relative speed away and can never turn it over. Tells which end their slip.
    fn catch(
        &self,
        v: &Speeds<R>,
        roll: &ShippingRoll<R>,
        t_sr: R,
        parts: &mut Parts<R>,
        brakes: &[Brake<R>; ROLLS],
        traction: &Traction<R>,
    ) -> [bool; ROLLS] {
        let forces = self.forces(v, roll, t_sr, &parts.drive);
        for nip in &mut parts.nips {
            if let Nip::Slides(force) = nip {
                *force = R::ZERO;
            }
        }
        core::array::from_fn(|j| {
            if parts.nips[j] == Nip::Sticks {
                return false;
            }
            let body = self.body(&forces, roll, &parts.nips);
            let reduced = self.mass[j] * (body.mass / (self.mass[j] + body.mass));
            let own = forces.rolls[j] - brakes[j].against(v.rolls[j]);
            let approach = own / self.mass[j] - body.force / body.mass;
            let slip = v.rolls[j] - v.wu;
            let needed = reduced * (slip * self.per_step + approach);
            let pull = traction.sliding[j];
            parts.nips[j] = Nip::Slides(needed.limit(pull));
            needed.abs() < pull
        })
    }

    fn hold_with(
        &self,
        v: &Speeds<R>,
        roll: &ShippingRoll<R>,
        t_sr: R,
        mut parts: Parts<R>,
        brakes: &[Brake<R>; ROLLS],
    ) -> Holding<R> {
        let free = self.forces(v, roll, t_sr, &parts.drive);
        let body = self.body(&free, roll, &parts.nips);
        let shared = (0..ROLLS)
            .filter(|j| parts.nips[*j] == Nip::Sticks)
            .fold(Brake::NONE, |sum, j| sum.with(&brakes[j]));
        let common = shared.hold(body.mass, v.wu, body.force);
        let acceleration = (body.force - common.lambda) / body.mass;

        let mut stops = [false; ROLLS];
        let mut nip_force = [R::ZERO; ROLLS];
        for j in 0..ROLLS {
            let lambda = match parts.nips[j] {
                Nip::Sticks => common.lambda * brakes[j].share_of(&shared),
                Nip::Slides(force) => {
                    let own: Friction<R> =
                        brakes[j].hold(self.mass[j], v.rolls[j], free.rolls[j] - force);
                    stops[j] = own.sticks;
                    own.lambda
                }
            };
            nip_force[j] = match parts.nips[j] {
                Nip::Sticks => free.rolls[j] - lambda - self.mass[j] * acceleration,
                Nip::Slides(force) => force,
            };
            parts.drive[j] -= lambda;
        }
        Holding {
            parts,
            nip_force,
            roll_stops: common.sticks,
            stops,
            meets: [false; ROLLS],
        }
    }

    /// Ends a step: bodies that are held stand still, and rolls whose slip has come to its end stick again, at the
    /// speed that keeps the momentum.
    pub fn settle(&self, v: &mut Speeds<R>, roll: &ShippingRoll<R>, holding: &mut Holding<R>) {
        let nips = &mut holding.parts.nips;
        if holding.roll_stops {
            v.wu = R::ZERO;
        }
        for (j, nip) in nips.iter().enumerate() {
            match nip {
                Nip::Sticks => v.rolls[j] = v.wu,
                Nip::Slides(_) if holding.stops[j] => v.rolls[j] = R::ZERO,
                Nip::Slides(_) => {}
            }
        }
        for j in 0..ROLLS {
            let Nip::Slides(force) = nips[j] else {
                continue;
            };
            let slip = v.rolls[j] - v.wu;
            // what nothing pulls slips on for ever
            let turned = slip * force < R::ZERO || slip == R::ZERO;
            if !turned && !holding.meets[j] {
                continue;
            }
            let stuck = (0..ROLLS).filter(|i| nips[*i] == Nip::Sticks);
            let mass = stuck.fold(roll.mass, |sum, i| sum + self.mass[i]);
            let met = v.wu + slip * (self.mass[j] / (mass + self.mass[j]));
            nips[j] = Nip::Sticks;
            v.wu = met;
            for (speed, nip) in v.rolls.iter_mut().zip(nips.iter()) {
                if *nip == Nip::Sticks {
                    *speed = met;
                }
            }
        }
    }
}
