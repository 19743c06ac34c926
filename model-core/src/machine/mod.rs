//! The machine as an engineer describes it: SI units, limits, presets.
//!
//! Not here: anything that computes. The plant and the regulators derive their coefficients from this
//! description once, when they are built.

mod parameters;
mod presets;

pub use parameters::{MachineError, Parameter, Value, parameters};
pub use presets::{PRESETS, Preset};

use heapless::Vec;

/// The most web spans a machine can have.
pub const MAX_SPANS: usize = 8;
/// The most points in the table of the rider roll's load.
pub const MAX_RIDER_LOADS: usize = 16;
/// The most points in the table of the front drum's share.
pub const MAX_FRONT_SHARES: usize = 8;

/// The web.
#[derive(Clone, Debug, PartialEq)]
pub struct Web {
    /// Width W, m.
    pub width_m: f64,
    /// Mass per area g, kg/m².
    pub grammage_kg_m2: f64,
    /// Thickness z, m.
    pub caliper_m: f64,
    /// Stiffness per width E·z, N/m.
    pub stiffness_n_m: f64,
    /// Retardation time of the Kelvin–Voigt web τ_v, s.
    pub retardation_s: f64,
    /// Ultimate tensile strength per width, N/m.
    pub strength_n_m: f64,
    /// Whether the web between a break and the rear drum is wound up as well; otherwise the radii hold at once.
    pub tail: bool,
}

impl Web {
    /// Density of the wound paper ρ = g/z, kg/m³.
    pub fn density_kg_m3(&self) -> f64 {
        self.grammage_kg_m2 / self.caliper_m
    }
    /// ½·π·ρ·W, kg/m²: a solid roll of the web has the inertia ½·π·ρ·W·R⁴.
    pub fn inertia_factor(&self) -> f64 {
        0.5 * core::f64::consts::PI * self.density_kg_m3() * self.width_m
    }
    /// Inertia of a solid roll of the web, ½·π·ρ·W·R⁴, kg·m².
    pub fn roll_inertia(&self, radius_m: f64) -> f64 {
        let square = radius_m * radius_m;
        self.inertia_factor() * square * square
    }
}

/// The parent roll on its spool in the unwind.
#[derive(Clone, Debug, PartialEq)]
pub struct ParentRoll {
    /// Radius of a full roll R_reel, m.
    pub full_radius_m: f64,
    /// Radius of the empty spool, m.
    pub spool_radius_m: f64,
    /// Radius at which the roll runs out of paper, m.
    pub expire_radius_m: f64,
    /// Inertia of spool and drive train J_0, kg·m².
    pub spool_inertia_kg_m2: f64,
    /// Friction referred to the surface, N·s/m.
    pub friction_n_s_m: f64,
    /// Distance of the axis of rotation from the centre, m.
    pub eccentricity_m: f64,
}

/// A web span and the idle roll at its end, in the web's direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IdleRoll {
    /// Length of the span that leads to the roll, m.
    pub span_m: f64,
    /// Radius, m.
    pub radius_m: f64,
    /// Inertia, of all rolls where several are lumped, kg·m².
    pub inertia_kg_m2: f64,
    /// Friction referred to the surface, N·s/m.
    pub friction_n_s_m: f64,
    /// Distance of the axis of rotation from the centre, m.
    pub eccentricity_m: f64,
}

/// A driven roll of the windup.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DrivenRoll {
    /// Radius, m.
    pub radius_m: f64,
    /// Inertia with its drive train, kg·m².
    pub inertia_kg_m2: f64,
    /// Friction referred to the surface, N·s/m.
    pub friction_n_s_m: f64,
}

/// The shipping roll on its core.
#[derive(Clone, Debug, PartialEq)]
pub struct ShippingRoll {
    /// Radius of the core R_core, m.
    pub core_radius_m: f64,
    /// Radius of a full roll, m.
    pub full_radius_m: f64,
    /// Rolling resistance referred to the surface, N·s/m.
    pub friction_n_s_m: f64,
}

/// Load of the rider roll at one diameter of the shipping roll.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RiderLoad {
    /// Diameter of the shipping roll, m.
    pub diameter_m: f64,
    /// Load per width Q, N/m.
    pub load_n_m: f64,
}

/// The contacts of the shipping roll with both drums and the rider roll.
#[derive(Clone, Debug, PartialEq)]
pub struct Nips {
    /// Whether the rolls may slip on each other; otherwise the windup turns as one body.
    pub slip: bool,
    /// Coefficient of sliding friction between drum and paper μ.
    pub friction: f64,
    /// Static over sliding friction.
    pub static_ratio: f64,
    /// Gap between the drums s, m.
    pub drum_gap_m: f64,
    /// Load of the rider roll over the diameter of the shipping roll, linear between the points.
    pub rider_load: Vec<RiderLoad, MAX_RIDER_LOADS>,
}

/// How tight the shipping roll is wound, and what that does to its layers.
#[derive(Clone, Debug, PartialEq)]
pub struct WoundOnTension {
    /// Whether the thickness of a wound layer follows the wound-on tension; otherwise it is the caliper.
    pub compresses: bool,
    /// Gain of the web tension k_t.
    pub tension_gain: f64,
    /// Gain of the front drum's force k_F.
    pub force_gain: f64,
    /// Coefficient of friction paper on paper μ_ww.
    pub paper_friction: f64,
    /// Nip force per width at which its effect has fallen to a half N_0, N/m.
    pub nip_scale_n_m: f64,
    /// Wound-on tension per width at which a layer has the caliper WOT_ref, N/m.
    pub reference_n_m: f64,
    /// Loss of thickness κ for a doubled wound-on tension.
    pub hardness: f64,
}

/// The load cells under a roll that the web wraps.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadCells {
    /// Which idle roll, from 0, lies on them.
    pub roll: usize,
    /// Whether they feel the spans on both sides of the roll, as they do; otherwise the span after it alone.
    pub both_spans: bool,
    /// Wrap angle of the web β, rad.
    pub wrap_rad: f64,
    /// Wrap angle that the amplifier has been calibrated for β_cal, rad.
    pub calibrated_wrap_rad: f64,
    /// Error of the zero, N.
    pub tare_n: f64,
    /// Time constant of the filter, s.
    pub filter_s: f64,
    /// Web tension at which the amplifier's analogue output is at its end, N.
    pub full_scale_n: f64,
}

/// A motor, referred to the shaft of its roll.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motor {
    /// Rated power, W.
    pub power_w: f64,
    /// Rated torque, N·m.
    pub torque_n_m: f64,
}

/// The motors of all sections.
#[derive(Clone, Debug, PartialEq)]
pub struct Motors {
    /// Unwind.
    pub uw: Motor,
    /// Rear drum.
    pub rd: Motor,
    /// Front drum.
    pub fd: Motor,
    /// Rider roll.
    pub rr: Motor,
    /// Torque for a short time, of rated torque.
    pub overload: f64,
}

/// The mechanical brakes.
#[derive(Clone, Debug, PartialEq)]
pub struct Brakes {
    /// Torque of the unwind's brake, N·m.
    pub uw_n_m: f64,
    /// Torque of the rear drum's brake, N·m.
    pub rd_n_m: f64,
    /// Torque of the front drum's brake, N·m.
    pub fd_n_m: f64,
    /// Time from command to effect, s.
    pub delay_s: f64,
    /// Static over sliding friction.
    pub static_ratio: f64,
    /// Half width ΔV of the stiction band of the paper's brake model (figure 2), m/s; 0 for the set-valued law.
    pub karnopp_m_s: f64,
}

/// Front drum's share of the drums' force at one diameter of the shipping roll.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrontShare {
    /// Diameter of the shipping roll, m.
    pub diameter_m: f64,
    /// Share of the force of both drums.
    pub share: f64,
}

/// How the machine is run.
#[derive(Clone, Debug, PartialEq)]
pub struct Operation {
    /// Highest web speed, m/s.
    pub max_speed_m_s: f64,
    /// Usual web speed, m/s.
    pub run_speed_m_s: f64,
    /// Web speed in thread, m/s.
    pub thread_speed_m_s: f64,
    /// Acceleration and deceleration, m/s².
    pub acceleration_m_s2: f64,
    /// Rate of change of the acceleration, m/s³.
    pub jerk_m_s3: f64,
    /// Deceleration of an emergency stop, m/s².
    pub emergency_m_s2: f64,
    /// Web tension per width, N/m.
    pub tension_n_m: f64,
    /// Tension at standstill, of the web tension.
    pub stall_share: f64,
    /// Front drum's share of the drums' force over the diameter of the shipping roll, linear between the points.
    pub front_share: Vec<FrontShare, MAX_FRONT_SHARES>,
    /// Rider roll's share of the winding force.
    pub rider_share: f64,
}

impl IdleRoll {
    /// Mass at the surface J/R², kg.
    pub fn mass_kg(&self) -> f64 {
        self.inertia_kg_m2 / (self.radius_m * self.radius_m)
    }
}

impl DrivenRoll {
    /// Mass at the surface J/R², kg.
    pub fn mass_kg(&self) -> f64 {
        self.inertia_kg_m2 / (self.radius_m * self.radius_m)
    }
}

/// The winder.
#[derive(Clone, Debug, PartialEq)]
pub struct Machine {
    /// The web.
    pub web: Web,
    /// The parent roll.
    pub parent_roll: ParentRoll,
    /// Idle rolls from the unwind to the windup, each with the span before it.
    pub idle: Vec<IdleRoll, { MAX_SPANS - 1 }>,
    /// Load cells.
    pub load_cells: LoadCells,
    /// Length of the last span, to the rear drum, m.
    pub last_span_m: f64,
    /// Rear drum.
    pub rear_drum: DrivenRoll,
    /// Front drum.
    pub front_drum: DrivenRoll,
    /// Rider roll.
    pub rider_roll: DrivenRoll,
    /// Shipping roll.
    pub shipping_roll: ShippingRoll,
    /// Contacts of the shipping roll.
    pub nips: Nips,
    /// Tightness of the shipping roll.
    pub wound_on_tension: WoundOnTension,
    /// Motors.
    pub motors: Motors,
    /// Brakes.
    pub brakes: Brakes,
    /// Operation.
    pub operation: Operation,
    /// Pulses of the rear drum's encoder for one revolution.
    pub encoder_pulses: f64,
    /// Pulses of the unwind's encoder for one revolution.
    pub encoder_pulses_uw: f64,
}

impl Machine {
    /// Inertia of the parent roll without its paper, as if the paper were solid to the axis: J_0 less what a solid
    /// roll would have inside the spool, kg·m². With [`Web::roll_inertia`] it gives J_uw(R).
    pub fn parent_roll_offset(&self) -> f64 {
        let roll = &self.parent_roll;
        roll.spool_inertia_kg_m2 - self.web.roll_inertia(roll.spool_radius_m)
    }

    /// Mass of the windup at its surface with a shipping roll of this radius, {15}, kg.
    pub fn windup_mass_kg(&self, r_wu: f64) -> f64 {
        let rolls = [&self.rear_drum, &self.front_drum, &self.rider_roll];
        let core = self.shipping_roll.core_radius_m;
        let roll = self.web.roll_inertia(r_wu) - self.web.roll_inertia(core);
        rolls.iter().map(|roll| roll.mass_kg()).sum::<f64>() + roll / (r_wu * r_wu)
    }

    /// Length of span `i`, m: those that lead to the idle rolls, and the last.
    pub fn span_m(&self, i: usize) -> f64 {
        self.idle
            .get(i)
            .map_or(self.last_span_m, |roll| roll.span_m)
    }

    /// Length of the web from the middle of span `i` to the rear drum, m: the tail that a break there leaves.
    pub fn tail_m(&self, i: usize) -> f64 {
        let after: f64 = (i + 1..=self.idle.len()).map(|i| self.span_m(i)).sum();
        0.5 * self.span_m(i) + after
    }

    /// Length of the web from the unwind to the rear drum, m.
    pub fn web_path_m(&self) -> f64 {
        self.idle.iter().map(|roll| roll.span_m).sum::<f64>() + self.last_span_m
    }
}

/// The longest delay of a brake that the plant's delay line holds, s.
pub const MAX_BRAKE_DELAY_S: f64 = 0.5;
