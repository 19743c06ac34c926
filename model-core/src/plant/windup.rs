//! The two-drum windup: how rear drum, front drum, rider roll and the shipping roll between them move.
//!
//! Not here: which of them slip and what their brakes hold (the contact's), bouncing of the roll.
//!
//! As long as nothing slips the four turn as one body, equation {15}. Otherwise each roll either sticks to the shipping
//! roll or slides on it and pulls it with a force that is held over the step. What sticks together is one body: its
//! forces and masses add up.

use super::units::Machines;
use crate::machine::{DrivenRoll, Machine};
use crate::real::Arithmetic;

/// The rolls that touch the shipping roll, in this order everywhere: rear drum, front drum, rider roll.
pub const ROLLS: usize = 3;
/// Index of the rear drum.
pub const REAR: usize = 0;
/// Index of the front drum.
pub const FRONT: usize = 1;

/// Mass that a core has at least when nothing sticks to it, kg: a shipping roll without paper has none in {15}.
pub const LEAST_MASS: f64 = 5.0;

/// The rolls in their order.
fn roll(machine: &Machine, j: usize) -> &DrivenRoll {
    [&machine.rear_drum, &machine.front_drum, &machine.rider_roll][j]
}

fn each<T>(of: impl Fn(usize) -> T) -> [T; ROLLS] {
    core::array::from_fn(of)
}

/// Coefficients of the windup.
#[derive(Clone, Copy, Debug)]
pub struct Windup<A: Arithmetic> {
    /// 1/R of each roll, 1/m.
    per_radius: [A; ROLLS],
    /// J/R² of each roll, kg, and of all together.
    mass: [A; ROLLS],
    drum_mass: A,
    least_mass: A,
    /// Surface friction c of each roll, N·s/m, and of all with the shipping roll's rolling resistance.
    friction: [A; ROLLS],
    all_friction: A,
    /// Rolling resistance of the shipping roll c_wu, N·s/m.
    resistance: A,
    /// ½·π·ρ·W, kg/m².
    inertia_factor: A,
    /// R_core, m.
    core: A,
    /// ½·π·ρ·W·z/2π = ¼·g·W, kg/m.
    growth: A,
    /// h/3·z/(2π·R_core).
    layer: A::Gain,
    /// h/3 over 1 kg, and over the mass of each roll.
    per_mass: A::Gain,
    per_roll: [A::Gain; ROLLS],
}

/// The shipping roll at one radius.
#[derive(Clone, Copy, Debug)]
pub struct ShippingRoll<A: Arithmetic> {
    /// J_wu/R_wu², kg.
    mass: A,
    /// (J_wu/R_wu²)·(Ṙ_wu/R_wu), kg/s: at one surface speed a roll that grows turns slower, {13}.
    growth: A,
    /// Ṙ_wu.
    pub radius_rate: A::Rate,
}

/// Surface speeds, or their rates: of the three rolls, and of the shipping roll.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Speeds<T> {
    /// Of the rolls.
    pub rolls: [T; ROLLS],
    /// Of the shipping roll.
    pub wu: T,
}

/// What acts on a windup of which `APART` rolls have speeds of their own, constant over a step.
pub trait Load<A: Arithmetic, const APART: usize>: Copy {
    /// Rates of the speeds of the rear drum and of the rolls apart, at those speeds.
    fn accelerate(
        &self,
        windup: &Windup<A>,
        v_rd: A,
        apart: &[A; APART],
        roll: &ShippingRoll<A>,
        t_sr: A,
    ) -> (A::Rate, [A::Rate; APART]);
}

/// All nips stick: one body, driven by this force at its surface, N.
#[derive(Clone, Copy, Debug)]
pub struct Whole<A>(pub A);

/// Roll by roll.
#[derive(Clone, Copy, Debug)]
pub struct Parts<T> {
    /// Torque of the motor less that of the brake, at the surface of each roll, N.
    pub drive: [T; ROLLS],
    /// What is known of each nip.
    pub nips: [Nip<T>; ROLLS],
}

impl<T: Copy> Parts<T> {
    /// The same in other numbers.
    pub fn map<U>(&self, mut f: impl FnMut(T) -> U) -> Parts<U> {
        Parts {
            drive: self.drive.map(&mut f),
            nips: self.nips.map(|nip| match nip {
                Nip::Sticks => Nip::Sticks,
                Nip::Slides(force) => Nip::Slides(f(force)),
            }),
        }
    }
}

/// A nip over one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Nip<T> {
    /// Both surfaces have one speed.
    Sticks,
    /// The roll slides and pulls the shipping roll with this force, N, in the direction of its slip.
    Slides(T),
}

impl<A: Arithmetic> Windup<A> {
    /// From the machines' description, for steps of `h` seconds.
    pub fn new(machines: &impl Machines<A>, h: f64) -> Self {
        let third = h / 3.0;
        let friction =
            |c: fn(&Machine) -> f64| machines.coefficient(move |m, u| c(m) * u.speed / u.force);
        let layer = |m: &Machine| m.web.caliper_m / core::f64::consts::TAU;
        let growth = |m: &Machine| m.web.inertia_factor() * layer(m);
        let core = |m: &Machine| m.shipping_roll.core_radius_m;
        Self {
            per_radius: each(|j| machines.coefficient(|m, u| u.r_rolls / roll(m, j).radius_m)),
            mass: each(|j| machines.coefficient(|m, u| roll(m, j).mass_kg() / u.mass)),
            drum_mass: machines.coefficient(|m, u| m.windup_mass_kg(core(m)) / u.mass),
            least_mass: machines.coefficient(|_, u| LEAST_MASS / u.mass),
            friction: each(|j| {
                machines.coefficient(|m, u| roll(m, j).friction_n_s_m * u.speed / u.force)
            }),
            all_friction: friction(|m| {
                let rolls = (0..ROLLS).map(|j| roll(m, j).friction_n_s_m);
                rolls.sum::<f64>() + m.shipping_roll.friction_n_s_m
            }),
            resistance: friction(|m| m.shipping_roll.friction_n_s_m),
            inertia_factor: machines
                .coefficient(|m, u| m.web.inertia_factor() * u.r_wu * u.r_wu / u.mass),
            core: machines.coefficient(|m, u| core(m) / u.r_wu),
            growth: machines.coefficient(|m, u| growth(m) * u.speed * u.speed / u.force),
            layer: machines.gain(|m, u| third * layer(m) * u.speed / (core(m) * u.r_wu)),
            per_mass: machines.gain(|_, u| third * u.force / (u.mass * u.speed)),
            per_roll: each(|j| {
                machines.gain(|m, u| third * u.force / (roll(m, j).mass_kg() * u.speed))
            }),
        }
    }

    /// With κ = R_core/R_wu: J_wu/R_wu² = ½·π·ρ·W·R_wu²·(1 − κ⁴), and {3} Ṙ_wu = z_eff·V_rd/(2π·R_wu).
    ///
    /// `paper` is the speed of the web that arrives times z_eff/z; zero without web.
    #[inline(always)]
    pub fn shipping_roll(&self, r: A, paper: A) -> ShippingRoll<A> {
        let core = self.core.over(r);
        let square = core * core;
        let hollow = A::ONE - square * square;
        ShippingRoll {
            mass: self.inertia_factor * (r * r) * hollow,
            growth: self.growth * paper * hollow,
            radius_rate: (paper * core).rate(self.layer),
        }
    }

    /// Σ T_j/R_j, the force of all motors at the surface.
    #[inline(always)]
    pub fn pull(&self, torque: [A; ROLLS]) -> A {
        let [rd, fd, rr] = self.per_radius;
        torque[0] * rd + torque[1] * fd + torque[2] * rr
    }

    /// ω_j = V_j/R_j of drums and rider roll.
    #[inline(always)]
    pub fn turn(&self, v: [A; ROLLS]) -> [A; ROLLS] {
        each(|j| v[j] * self.per_radius[j])
    }

    /// {15} M = J_rd/R_rd² + J_fd/R_fd² + J_rr/R_rr² + J_wu/R_wu², kg: of the windup as one body.
    #[inline(always)]
    pub fn mass(&self, roll: &ShippingRoll<A>) -> A {
        self.drum_mass + roll.mass
    }
}

/// {15} M·V̇ = Σ T_j/R_j − t_sr − \[Σ c_j − (J_wu/R_wu²)·(Ṙ_wu/R_wu)\]·V
impl<A: Arithmetic> Load<A, 0> for Whole<A> {
    #[inline(always)]
    fn accelerate(
        &self,
        windup: &Windup<A>,
        v_rd: A,
        _: &[A; 0],
        roll: &ShippingRoll<A>,
        t_sr: A,
    ) -> (A::Rate, [A::Rate; 0]) {
        let friction = (windup.all_friction - roll.growth) * v_rd;
        let per_mass = A::gain_over(windup.per_mass, windup.mass(roll));
        ((self.0 - t_sr - friction).rate(per_mass), [])
    }
}

/// m_j·V̇_j = T_j/R_j − c_j·V_j − F_j, for the rear drum less t_sr, and
/// m_wu·V̇_wu = Σ F_j − c_wu·V_wu + m_wu·(Ṙ_wu/R_wu)·V_wu,
///
/// where sticking nips take the F_j that keeps their speeds equal. All sticking, this is {15}.
impl<A: Arithmetic + PartialOrd> Load<A, ROLLS> for Parts<A> {
    fn accelerate(
        &self,
        windup: &Windup<A>,
        v_rd: A,
        apart: &[A; ROLLS],
        roll: &ShippingRoll<A>,
        t_sr: A,
    ) -> (A::Rate, [A::Rate; ROLLS]) {
        let [v_fd, v_rr, v_wu] = *apart;
        let v = [v_rd, v_fd, v_rr];
        let mut force: [A; ROLLS] =
            core::array::from_fn(|j| self.drive[j] - windup.friction[j] * v[j]);
        force[REAR] -= t_sr;
        let mut body = (roll.mass, (roll.growth - windup.resistance) * v_wu);
        let mut alone = true;
        for (j, nip) in self.nips.iter().enumerate() {
            match *nip {
                Nip::Sticks => {
                    body.0 += windup.mass[j];
                    body.1 += force[j];
                    alone = false;
                }
                Nip::Slides(pull) => body.1 += pull,
            }
        }
        if alone && body.0 < windup.least_mass {
            body.0 = windup.least_mass;
        }
        let common = body.1.rate(A::gain_over(windup.per_mass, body.0));
        let [rd, fd, rr] = core::array::from_fn(|j| match self.nips[j] {
            Nip::Sticks => common,
            Nip::Slides(pull) => (force[j] - pull).rate(windup.per_roll[j]),
        });
        (rd, [fd, rr, common])
    }
}
