//! The two-drum windup: rear drum, front drum and rider roll, and the shipping roll between them.
//!
//! Not here: how hard the roll lies on them (the nips'), bouncing of the roll.
//!
//! Each of the three rolls either sticks to the shipping roll or slides on it. What sticks together is one body:
//! its forces and masses add up, as in equation {15}, and its speeds stay equal to the bit. What slides is pulled
//! with the traction of its nip. Which of them slide is decided once a step, from the forces that sticking would
//! take; a roll that has slid sticks again when the speeds have met.

use super::friction::{Brake, Friction};
use crate::exchange::BySection;
use crate::machine::Machine;
use crate::real::Real;

/// The rolls that touch the shipping roll, in this order everywhere: rear drum, front drum, rider roll.
pub const ROLLS: usize = 3;
/// Index of the rear drum.
pub const REAR: usize = 0;
/// Index of the front drum.
pub const FRONT: usize = 1;

/// Mass that a core has at least when nothing sticks to it, kg: a shipping roll without paper has none in {15}.
const LEAST_MASS: f64 = 5.0;

/// Coefficients of the windup.
#[derive(Clone, Copy, Debug)]
pub struct Windup<R> {
    /// J/R² of each roll, kg.
    mass: [R; ROLLS],
    /// Surface friction c of each roll, N·s/m.
    friction: [R; ROLLS],
    /// Rolling resistance of the shipping roll c_wu, N·s/m.
    resistance: R,
    /// Sums of both over all rolls, as {15} has them.
    drum_mass: R,
    all_friction: R,
    /// ½·π·ρ·W, kg/m².
    inertia_factor: R,
    /// ½·π·ρ·W·R_core⁴, kg·m².
    core_inertia: R,
    /// z/2π, m.
    layer: R,
    /// 1/R of each roll, 1/m.
    per_radius: [R; ROLLS],
    least_mass: R,
    /// 1/h, 1/s.
    per_step: R,
}

/// The shipping roll at one radius.
#[derive(Clone, Copy, Debug)]
pub struct ShippingRoll<R> {
    /// 1/R_wu, 1/m.
    per_radius: R,
    /// J_wu/R_wu², kg.
    mass: R,
    /// Ṙ_wu, m/s.
    pub radius_rate: R,
}

impl<R: Real> ShippingRoll<R> {
    /// (J_wu/R_wu²)·(Ṙ_wu/R_wu), kg/s: at one surface speed a roll that grows turns slower, {13}.
    #[inline(always)]
    fn growth(&self) -> R {
        self.mass * (self.radius_rate * self.per_radius)
    }
}

/// Surface speeds, or their rates: of the three rolls, and of the shipping roll.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Speeds<T> {
    /// Of the rolls.
    pub rolls: [T; ROLLS],
    /// Of the shipping roll.
    pub wu: T,
}

/// What acts on the windup over one step, constant.
#[derive(Clone, Copy, Debug)]
pub enum Load<R> {
    /// All nips stick: one body, driven by this force at its surface, N.
    Whole(R),
    /// Roll by roll.
    Apart(Parts<R>),
}

/// What acts at the surfaces roll by roll.
#[derive(Clone, Copy, Debug)]
pub struct Parts<R> {
    /// Torque of the motor less that of the brake, at the surface of each roll, N.
    pub drive: [R; ROLLS],
    /// What is known of each nip.
    pub nips: [Nip<R>; ROLLS],
}

/// A nip over one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Nip<R> {
    /// Both surfaces have one speed.
    Sticks,
    /// The roll slides and pulls the shipping roll with this force, N, in the direction of its slip.
    Slides(R),
}

impl<R: Real> Parts<R> {
    /// The load of a step.
    pub fn load(&self) -> Load<R> {
        if self.nips.iter().all(|nip| *nip == Nip::Sticks) {
            Load::Whole(self.drive[0] + self.drive[1] + self.drive[2])
        } else {
            Load::Apart(*self)
        }
    }
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

impl<R: Real> Windup<R> {
    /// From the machine's description, in steps of `h` seconds.
    pub fn new(machine: &Machine, h: f64) -> Self {
        let rolls = [&machine.rear_drum, &machine.front_drum, &machine.rider_roll];
        let roll = &machine.shipping_roll;
        Self {
            mass: rolls.map(|roll| R::of(roll.mass_kg())),
            friction: rolls.map(|roll| R::of(roll.friction_n_s_m)),
            resistance: R::of(roll.friction_n_s_m),
            drum_mass: R::of(rolls.iter().map(|roll| roll.mass_kg()).sum()),
            all_friction: R::of(
                rolls.iter().map(|roll| roll.friction_n_s_m).sum::<f64>() + roll.friction_n_s_m,
            ),
            inertia_factor: R::of(machine.web.inertia_factor()),
            core_inertia: R::of(machine.web.roll_inertia(roll.core_radius_m)),
            layer: R::of(machine.web.caliper_m / core::f64::consts::TAU),
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

    /// J_wu/R² = ½·π·ρ·W·(R⁴ − R_core⁴)/R², and {3} Ṙ_wu = z_eff·V_rd/(2π·R_wu).
    ///
    /// `paper` is the speed of the web that arrives times z_eff/z; zero without web.
    #[inline(always)]
    pub fn shipping_roll(&self, r: R, paper: R) -> ShippingRoll<R> {
        let per_radius = R::ONE / r;
        ShippingRoll {
            per_radius,
            mass: self.inertia_factor * (r * r) - self.core_inertia * (per_radius * per_radius),
            radius_rate: self.layer * paper * per_radius,
        }
    }

    /// Rates of the speeds:
    ///
    /// m_j·V̇_j = T_j/R_j − c_j·V_j − F_j, for the rear drum less t_sr, and
    /// m_wu·V̇_wu = Σ F_j − c_wu·V_wu + m_wu·(Ṙ_wu/R_wu)·V_wu,
    ///
    /// where sticking nips take the F_j that keeps their speeds equal. All sticking, this is {15}:
    /// M·V̇ = Σ T_j/R_j − t_sr − \[Σ c_j − (J_wu/R_wu²)·(Ṙ_wu/R_wu)\]·V
    #[inline(always)]
    pub fn rates(
        &self,
        v: &Speeds<R>,
        roll: &ShippingRoll<R>,
        t_sr: R,
        load: &Load<R>,
    ) -> Speeds<R> {
        match load {
            Load::Whole(drive) => {
                let friction = (self.all_friction - roll.growth()) * v.rolls[REAR];
                let rate = (*drive - t_sr - friction) / self.mass(roll);
                Speeds {
                    rolls: [rate; ROLLS],
                    wu: rate,
                }
            }
            Load::Apart(parts) => self.rates_apart(v, roll, t_sr, parts),
        }
    }

    fn rates_apart(
        &self,
        v: &Speeds<R>,
        roll: &ShippingRoll<R>,
        t_sr: R,
        parts: &Parts<R>,
    ) -> Speeds<R> {
        let forces = self.forces(v, roll, t_sr, &parts.drive);
        let body = self.body(&forces, roll, &parts.nips);
        let common = body.force / body.mass;
        Speeds {
            rolls: core::array::from_fn(|j| match parts.nips[j] {
                Nip::Sticks => common,
                Nip::Slides(force) => (forces.rolls[j] - force) / self.mass[j],
            }),
            wu: common,
        }
    }

    /// {15} M = J_rd/R_rd² + J_fd/R_fd² + J_rr/R_rr² + J_wu/R_wu², kg: of the windup as one body.
    pub fn mass(&self, roll: &ShippingRoll<R>) -> R {
        self.drum_mass + roll.mass
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
            wu: (roll.growth() - self.resistance) * v.wu,
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
            if slip * force > R::ZERO && !holding.meets[j] {
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
