//! The machines that ship.
//!
//! Not here: measured machines. The numbers are engineering estimates within published ranges.

use heapless::Vec;

use super::*;

const SECONDS_PER_MINUTE: f64 = 60.0;

/// A machine that ships, by name.
pub type Preset = (&'static str, fn() -> Machine);

/// Every preset.
pub const PRESETS: &[Preset] = &[("NEWS-8000", Machine::news_8000)];

/// The rider roll's load by diameter, m and N/m.
fn rider_load<const N: usize>(points: [(f64, f64); N]) -> Vec<RiderLoad, MAX_RIDER_LOADS> {
    let point = |(diameter_m, load_n_m)| RiderLoad {
        diameter_m,
        load_n_m,
    };
    points.into_iter().map(point).collect()
}

impl Machine {
    /// The preset of a name, in capitals or not.
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
                rider_load: rider_load([
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
                ]),
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
}
