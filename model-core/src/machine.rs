//! The machine as an engineer describes it: SI units, limits, presets.
//!
//! Not here: anything that computes. The plant and the regulators derive their coefficients from this
//! description once, when they are built.

use core::fmt;

use heapless::Vec;

/// The most web spans a machine can have.
pub const MAX_SPANS: usize = 8;
/// The most points in the table of the rider roll's load.
pub const MAX_RIDER_LOADS: usize = 16;

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
    /// Front drum's share of the drum torque at the core and at the full roll.
    pub front_share: [f64; 2],
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
}

/// A parameter that no winder can have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MachineError {
    /// The parameter, as part and name with its unit.
    pub parameter: &'static str,
    /// The value that was given.
    pub value: f64,
    /// Smallest permitted value.
    pub low: f64,
    /// Largest permitted value.
    pub high: f64,
}

impl fmt::Display for MachineError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} = {} is outside {} to {}",
            self.parameter, self.value, self.low, self.high
        )
    }
}

impl core::error::Error for MachineError {}

const SECONDS_PER_MINUTE: f64 = 60.0;

/// A machine that ships, by name.
pub type Preset = (&'static str, fn() -> Machine);

/// Every preset.
pub const PRESETS: &[Preset] = &[("NEWS-8000", Machine::news_8000)];

impl Machine {
    /// The preset of a name.
    pub fn preset(name: &str) -> Option<Self> {
        let (_, preset) = PRESETS.iter().find(|(n, _)| n.eq_ignore_ascii_case(name))?;
        Some(preset())
    }

    /// `NEWS-8000`: newsprint 45 g/m², 8 m wide, 2 200 m/min, two drums; guide and spreader rolls lumped.
    ///
    /// Caliper, stiffness, strength and inertias are engineering estimates within published ranges for
    /// newsprint winders; grammage and friction are published values.
    pub fn news_8000() -> Self {
        let drum = DrivenRoll {
            radius_m: 0.425,
            inertia_kg_m2: 1300.0,
            friction_n_s_m: 6.8,
        };
        let drum_motor = Motor {
            power_w: 300e3,
            torque_n_m: 3.5e3,
        };
        // 3 guide and 2 slitter-table rolls
        let gr = IdleRoll {
            span_m: 6.0,
            radius_m: 0.20,
            inertia_kg_m2: 47.5,
            friction_n_s_m: 6.25,
            eccentricity_m: 0.0,
        };
        // 2 spreader rolls
        let sr = IdleRoll {
            span_m: 3.0,
            radius_m: 0.15,
            inertia_kg_m2: 12.0,
            friction_n_s_m: 7.2,
            eccentricity_m: 0.0,
        };
        Self {
            web: Web {
                width_m: 8.0,
                grammage_kg_m2: 0.045,
                caliper_m: 65e-6,
                stiffness_n_m: 260e3,
                retardation_s: 5e-3,
                strength_n_m: 2.0e3,
            },
            parent_roll: ParentRoll {
                full_radius_m: 1.50,
                spool_radius_m: 0.40,
                expire_radius_m: 0.45,
                spool_inertia_kg_m2: 950.0,
                friction_n_s_m: 20.0,
                eccentricity_m: 0.0,
            },
            idle: Vec::from_iter([gr, sr]),
            load_cells: LoadCells {
                roll: 0,
                both_spans: false,
                wrap_rad: 1.0,
                calibrated_wrap_rad: 1.0,
                tare_n: 0.0,
                filter_s: 0.05,
            },
            last_span_m: 2.5,
            rear_drum: drum,
            front_drum: drum,
            rider_roll: DrivenRoll {
                radius_m: 0.15,
                inertia_kg_m2: 15.0,
                friction_n_s_m: 2.7,
            },
            shipping_roll: ShippingRoll {
                core_radius_m: 0.05,
                full_radius_m: 0.625,
                friction_n_s_m: 13.6,
            },
            nips: Nips {
                slip: false,
                friction: 0.35,
                static_ratio: 1.0,
                drum_gap_m: 0.012,
                // a nip of 3.0 kN/m until the roll's own weight takes over
                rider_load: [
                    (0.10, 2.53e3),
                    (0.20, 3.26e3),
                    (0.30, 3.54e3),
                    (0.40, 3.53e3),
                    (0.50, 3.32e3),
                    (0.60, 2.94e3),
                    (0.70, 2.41e3),
                    (0.80, 1.74e3),
                    (0.90, 0.94e3),
                    (1.00, 0.40e3),
                ]
                .map(|(diameter_m, load_n_m)| RiderLoad {
                    diameter_m,
                    load_n_m,
                })
                .into_iter()
                .collect(),
            },
            wound_on_tension: WoundOnTension {
                compresses: false,
                tension_gain: 1.0,
                force_gain: 0.5,
                paper_friction: 0.19,
                nip_scale_n_m: 6.0e3,
                reference_n_m: 750.0,
                hardness: 0.01,
            },
            motors: Motors {
                uw: Motor {
                    power_w: 500e3,
                    torque_n_m: 20.5e3,
                },
                rd: drum_motor,
                fd: drum_motor,
                rr: Motor {
                    power_w: 30e3,
                    torque_n_m: 108.0,
                },
                overload: 1.5,
            },
            brakes: Brakes {
                uw_n_m: 6e3,
                rd_n_m: 5e3,
                fd_n_m: 5e3,
                delay_s: 0.040,
                static_ratio: 1.0,
                karnopp_m_s: 0.0,
            },
            operation: Operation {
                max_speed_m_s: 2500.0 / SECONDS_PER_MINUTE,
                run_speed_m_s: 2200.0 / SECONDS_PER_MINUTE,
                thread_speed_m_s: 25.0 / SECONDS_PER_MINUTE,
                acceleration_m_s2: 0.45,
                jerk_m_s3: 0.20,
                emergency_m_s2: 1.0,
                tension_n_m: 350.0,
                stall_share: 0.30,
                front_share: [0.60, 0.52],
            },
            encoder_pulses: 4096.0,
        }
    }

    /// Refuses a machine that cannot be: the first parameter outside its limits.
    pub fn validate(&self) -> Result<(), MachineError> {
        let check = |parameter, value: f64, low: f64, high: f64| {
            // written so that NaN fails
            if value >= low && value <= high {
                Ok(())
            } else {
                Err(MachineError {
                    parameter,
                    value,
                    low,
                    high,
                })
            }
        };
        let w = &self.web;
        check("web.width_m", w.width_m, 0.05, 15.0)?;
        check("web.grammage_kg_m2", w.grammage_kg_m2, 0.005, 2.0)?;
        check("web.caliper_m", w.caliper_m, 5e-6, 5e-3)?;
        check("web.stiffness_n_m", w.stiffness_n_m, 1e3, 1e8)?;
        check("web.retardation_s", w.retardation_s, 0.0, 0.05)?;
        check("web.strength_n_m", w.strength_n_m, 10.0, 1e6)?;

        let p = &self.parent_roll;
        check("parent_roll.spool_radius_m", p.spool_radius_m, 0.02, 2.0)?;
        check(
            "parent_roll.expire_radius_m",
            p.expire_radius_m,
            p.spool_radius_m,
            3.0,
        )?;
        check(
            "parent_roll.full_radius_m",
            p.full_radius_m,
            p.expire_radius_m,
            3.0,
        )?;
        check(
            "parent_roll.spool_inertia_kg_m2",
            p.spool_inertia_kg_m2,
            1e-4,
            1e5,
        )?;
        check("parent_roll.friction_n_s_m", p.friction_n_s_m, 0.0, 1e4)?;
        check(
            "parent_roll.eccentricity_m",
            p.eccentricity_m,
            0.0,
            0.1 * p.spool_radius_m,
        )?;

        check(
            "idle (number of rolls)",
            self.idle.len() as f64,
            1.0,
            (MAX_SPANS - 1) as f64,
        )?;
        for roll in &self.idle {
            check("idle.span_m", roll.span_m, 0.05, 50.0)?;
            check("idle.radius_m", roll.radius_m, 0.01, 2.0)?;
            check("idle.inertia_kg_m2", roll.inertia_kg_m2, 1e-5, 1e4)?;
            check("idle.friction_n_s_m", roll.friction_n_s_m, 0.0, 1e4)?;
            check(
                "idle.eccentricity_m",
                roll.eccentricity_m,
                0.0,
                0.1 * roll.radius_m,
            )?;
        }
        check("last_span_m", self.last_span_m, 0.05, 50.0)?;
        let l = &self.load_cells;
        check(
            "load_cells.roll",
            l.roll as f64,
            0.0,
            (self.idle.len() - 1) as f64,
        )?;
        check(
            "load_cells.wrap_rad",
            l.wrap_rad,
            0.05,
            core::f64::consts::PI,
        )?;
        check(
            "load_cells.calibrated_wrap_rad",
            l.calibrated_wrap_rad,
            0.05,
            core::f64::consts::PI,
        )?;
        check("load_cells.tare_n", l.tare_n, -1e5, 1e5)?;
        check("load_cells.filter_s", l.filter_s, 0.004, 10.0)?;

        let rolls = [
            (
                [
                    "rear_drum.radius_m",
                    "rear_drum.inertia_kg_m2",
                    "rear_drum.friction_n_s_m",
                ],
                &self.rear_drum,
            ),
            (
                [
                    "front_drum.radius_m",
                    "front_drum.inertia_kg_m2",
                    "front_drum.friction_n_s_m",
                ],
                &self.front_drum,
            ),
            (
                [
                    "rider_roll.radius_m",
                    "rider_roll.inertia_kg_m2",
                    "rider_roll.friction_n_s_m",
                ],
                &self.rider_roll,
            ),
        ];
        for ([radius, inertia, friction], roll) in rolls {
            check(radius, roll.radius_m, 0.01, 2.0)?;
            check(inertia, roll.inertia_kg_m2, 1e-5, 1e5)?;
            check(friction, roll.friction_n_s_m, 0.0, 1e4)?;
        }
        let s = &self.shipping_roll;
        check("shipping_roll.core_radius_m", s.core_radius_m, 0.01, 1.0)?;
        check(
            "shipping_roll.full_radius_m",
            s.full_radius_m,
            s.core_radius_m,
            2.0,
        )?;
        check("shipping_roll.friction_n_s_m", s.friction_n_s_m, 0.0, 1e4)?;

        let n = &self.nips;
        check("nips.friction", n.friction, 0.01, 2.0)?;
        check("nips.static_ratio", n.static_ratio, 1.0, 2.0)?;
        // the bare core must not fall through
        check("nips.drum_gap_m", n.drum_gap_m, 0.0, 1.9 * s.core_radius_m)?;
        check(
            "nips.rider_load (number of points)",
            n.rider_load.len() as f64,
            1.0,
            MAX_RIDER_LOADS as f64,
        )?;
        let mut last = 0.0;
        for point in &n.rider_load {
            check("nips.rider_load.diameter_m", point.diameter_m, last, 5.0)?;
            check("nips.rider_load.load_n_m", point.load_n_m, 0.0, 1e5)?;
            last = point.diameter_m;
        }
        let t = &self.wound_on_tension;
        check("wound_on_tension.tension_gain", t.tension_gain, 0.0, 2.0)?;
        check("wound_on_tension.force_gain", t.force_gain, 0.0, 2.0)?;
        check(
            "wound_on_tension.paper_friction",
            t.paper_friction,
            0.0,
            2.0,
        )?;
        check("wound_on_tension.nip_scale_n_m", t.nip_scale_n_m, 1.0, 1e6)?;
        check("wound_on_tension.reference_n_m", t.reference_n_m, 1.0, 1e6)?;
        check("wound_on_tension.hardness", t.hardness, 0.0, 0.1)?;

        let motors = [
            (
                ["motors.uw.power_w", "motors.uw.torque_n_m"],
                &self.motors.uw,
            ),
            (
                ["motors.rd.power_w", "motors.rd.torque_n_m"],
                &self.motors.rd,
            ),
            (
                ["motors.fd.power_w", "motors.fd.torque_n_m"],
                &self.motors.fd,
            ),
            (
                ["motors.rr.power_w", "motors.rr.torque_n_m"],
                &self.motors.rr,
            ),
        ];
        for ([power, torque], motor) in motors {
            check(power, motor.power_w, 1.0, 1e7)?;
            check(torque, motor.torque_n_m, 0.01, 1e6)?;
        }
        check("motors.overload", self.motors.overload, 1.0, 3.0)?;
        let b = &self.brakes;
        check("brakes.uw_n_m", b.uw_n_m, 0.0, 1e6)?;
        check("brakes.rd_n_m", b.rd_n_m, 0.0, 1e6)?;
        check("brakes.fd_n_m", b.fd_n_m, 0.0, 1e6)?;
        check("brakes.delay_s", b.delay_s, 0.0, MAX_BRAKE_DELAY_S)?;
        check("brakes.static_ratio", b.static_ratio, 1.0, 2.0)?;
        check("brakes.karnopp_m_s", b.karnopp_m_s, 0.0, 1.0)?;

        let o = &self.operation;
        check("operation.max_speed_m_s", o.max_speed_m_s, 0.1, 60.0)?;
        check(
            "operation.run_speed_m_s",
            o.run_speed_m_s,
            0.1,
            o.max_speed_m_s,
        )?;
        check(
            "operation.thread_speed_m_s",
            o.thread_speed_m_s,
            0.01,
            o.run_speed_m_s,
        )?;
        check(
            "operation.acceleration_m_s2",
            o.acceleration_m_s2,
            0.01,
            5.0,
        )?;
        check("operation.jerk_m_s3", o.jerk_m_s3, 0.01, 10.0)?;
        check(
            "operation.emergency_m_s2",
            o.emergency_m_s2,
            o.acceleration_m_s2,
            10.0,
        )?;
        check(
            "operation.tension_n_m",
            o.tension_n_m,
            1.0,
            0.5 * w.strength_n_m,
        )?;
        check("operation.stall_share", o.stall_share, 0.05, 1.0)?;
        for share in o.front_share {
            check("operation.front_share", share, 0.0, 1.0)?;
        }
        check("encoder_pulses", self.encoder_pulses, 1.0, 1e5)
    }

    /// Inertia of the parent roll without its paper, as if the paper were solid to the axis: J_0 less what a solid
    /// roll would have inside the spool, kg·m². With [`Web::roll_inertia`] it gives J_uw(R).
    pub fn parent_roll_offset(&self) -> f64 {
        let roll = &self.parent_roll;
        roll.spool_inertia_kg_m2 - self.web.roll_inertia(roll.spool_radius_m)
    }

    /// Length of the web from the unwind to the rear drum, m.
    pub fn web_path_m(&self) -> f64 {
        self.idle.iter().map(|roll| roll.span_m).sum::<f64>() + self.last_span_m
    }
}

/// The longest delay of a brake that the plant's delay line holds, s.
pub const MAX_BRAKE_DELAY_S: f64 = 0.5;
