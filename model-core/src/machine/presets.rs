//! The machines that ship.
//!
//! Not here: measured machines. The numbers are engineering estimates within published ranges.

use heapless::Vec;

use super::*;

const SECONDS_PER_MINUTE: f64 = 60.0;

/// A machine that ships, by name.
pub type Preset = (&'static str, fn() -> Machine);

/// Every preset.
pub const PRESETS: &[Preset] = &[
    ("NEWS-8000", Machine::news_8000),
    ("NEWS-8000-UNLUMPED", Machine::news_8000_unlumped),
    ("LWC-8000", Machine::lwc_8000),
    ("LAB-300", Machine::lab_300),
];

/// The rider roll's load by diameter, m and N/m.
fn rider_load<const N: usize>(points: [(f64, f64); N]) -> Vec<RiderLoad, MAX_RIDER_LOADS> {
    let point = |(diameter_m, load_n_m)| RiderLoad {
        diameter_m,
        load_n_m,
    };
    points.into_iter().map(point).collect()
}

/// The front drum's share by diameter, m.
fn front_share<const N: usize>(points: [(f64, f64); N]) -> Vec<FrontShare, MAX_FRONT_SHARES> {
    let point = |(diameter_m, share)| FrontShare { diameter_m, share };
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
                tail: false,
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
                full_scale_n: 10e3,
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
                front_share: front_share([(0.10, 0.60), (1.25, 0.52)]),
                rider_share: 0.05,
            },
            encoder_pulses: 4096.0,
            encoder_pulses_uw: 1024.0,
        }
    }

    /// `NEWS-8000-UNLUMPED`: `NEWS-8000` with every idle roll by itself; the load cells are under the last roll of
    /// the slitter table.
    pub fn news_8000_unlumped() -> Self {
        let guide = |span_m| IdleRoll {
            span_m,
            radius_m: 0.20,
            inertia_kg_m2: 9.5,
            friction_n_s_m: 1.25,
            eccentricity_m: 0.0,
        };
        let spreader = |span_m| IdleRoll {
            span_m,
            radius_m: 0.15,
            inertia_kg_m2: 6.0,
            friction_n_s_m: 3.6,
            eccentricity_m: 0.0,
        };
        let news = Self::news_8000();
        Self {
            idle: Vec::from_iter([
                guide(4.0),
                guide(1.5),
                guide(1.0),
                guide(1.0),
                guide(1.0),
                spreader(1.2),
                spreader(0.8),
            ]),
            load_cells: LoadCells {
                roll: 4,
                ..news.load_cells
            },
            last_span_m: 1.0,
            ..news
        }
    }

    /// `LWC-8000`: light-weight coated paper 60 g/m² on the winder of `NEWS-8000`.
    ///
    /// The paper is denser, so that the shipping roll's own weight takes over from the rider roll earlier, and
    /// tighter, so that a layer has its caliper at a higher wound-on tension.
    pub fn lwc_8000() -> Self {
        let news = Self::news_8000();
        Self {
            web: Web {
                grammage_kg_m2: 0.060,
                caliper_m: 50e-6,
                stiffness_n_m: 420e3,
                strength_n_m: 3.0e3,
                tail: false,
                ..news.web
            },
            parent_roll: ParentRoll {
                full_radius_m: 1.20,
                ..news.parent_roll
            },
            nips: Nips {
                // a nip of 3.0 kN/m until the roll's own weight takes over
                rider_load: rider_load([
                    (0.10, 2.52e3),
                    (0.20, 3.15e3),
                    (0.30, 3.23e3),
                    (0.40, 2.96e3),
                    (0.50, 2.40e3),
                    (0.60, 1.59e3),
                    (0.65, 1.10e3),
                    (0.70, 0.55e3),
                    (0.72, 0.40e3),
                ]),
                ..news.nips
            },
            wound_on_tension: WoundOnTension {
                reference_n_m: 850.0,
                ..news.wound_on_tension
            },
            operation: Operation {
                tension_n_m: 450.0,
                ..news.operation
            },
            ..news
        }
    }

    /// `LAB-300`: newsprint of 0.3 m at 240 m/min on a machine that stands on a desk.
    ///
    /// Steel rolls of 60 mm and a web path with loops keep the web's modes below 200 rad/s, where steps of 1 ms hold
    /// them: a short path over light rolls would be ten times as stiff.
    pub fn lab_300() -> Self {
        let news = Self::news_8000();
        // 2 steel rolls of 6.6 kg each, turning as one
        let rolls = |span_m| IdleRoll {
            span_m,
            radius_m: 0.03,
            inertia_kg_m2: 0.006,
            friction_n_s_m: 0.06,
            eccentricity_m: 0.0,
        };
        let drum = DrivenRoll {
            radius_m: 0.06,
            inertia_kg_m2: 0.05,
            friction_n_s_m: 0.2,
        };
        let drum_motor = Motor {
            power_w: 550.0,
            torque_n_m: 6.0,
        };
        Self {
            web: Web {
                width_m: 0.30,
                ..news.web
            },
            parent_roll: ParentRoll {
                full_radius_m: 0.15,
                spool_radius_m: 0.038,
                expire_radius_m: 0.045,
                spool_inertia_kg_m2: 0.02,
                friction_n_s_m: 0.5,
                eccentricity_m: 0.0,
            },
            idle: Vec::from_iter([rolls(1.5), rolls(1.0)]),
            load_cells: LoadCells {
                full_scale_n: 300.0,
                ..news.load_cells
            },
            last_span_m: 0.8,
            rear_drum: drum,
            front_drum: drum,
            rider_roll: DrivenRoll {
                radius_m: 0.03,
                inertia_kg_m2: 0.003,
                friction_n_s_m: 0.1,
            },
            shipping_roll: ShippingRoll {
                core_radius_m: 0.038,
                full_radius_m: 0.10,
                friction_n_s_m: 0.4,
            },
            nips: Nips {
                drum_gap_m: 0.010,
                // a nip of 0.6 kN/m; the roll's own weight never takes over
                rider_load: rider_load([
                    (0.076, 0.90e3),
                    (0.10, 0.95e3),
                    (0.14, 0.97e3),
                    (0.20, 0.91e3),
                ]),
                ..news.nips
            },
            wound_on_tension: WoundOnTension {
                reference_n_m: 370.0,
                ..news.wound_on_tension
            },
            motors: Motors {
                uw: Motor {
                    power_w: 750.0,
                    torque_n_m: 20.0,
                },
                rd: drum_motor,
                fd: drum_motor,
                rr: Motor {
                    power_w: 120.0,
                    torque_n_m: 0.6,
                },
                overload: 1.5,
            },
            brakes: Brakes {
                uw_n_m: 20.0,
                rd_n_m: 10.0,
                fd_n_m: 10.0,
                ..news.brakes
            },
            operation: Operation {
                max_speed_m_s: 300.0 / SECONDS_PER_MINUTE,
                run_speed_m_s: 240.0 / SECONDS_PER_MINUTE,
                thread_speed_m_s: 10.0 / SECONDS_PER_MINUTE,
                acceleration_m_s2: 0.30,
                jerk_m_s3: 0.20,
                emergency_m_s2: 1.0,
                tension_n_m: 250.0,
                stall_share: 0.30,
                front_share: front_share([(0.076, 0.60), (0.20, 0.52)]),
                rider_share: 0.05,
            },
            encoder_pulses: 4096.0,
            encoder_pulses_uw: 1024.0,
        }
    }
}
