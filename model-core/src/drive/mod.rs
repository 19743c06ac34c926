//! The regulators of a generic winder drive, as difference equations.
//!
//! Not here: modes and interlocks (the logic's), and everything a drive cannot measure: the regulators get
//! [`Measurements`] and set-points, never the plant.

pub mod diameter;
pub mod drums;
pub mod motor;
pub mod pi;
pub mod reference;
pub mod unwind;

use crate::exchange::{
    Actuators, Brakes, BySection, DriveCommand, DriveStatus, Measurements, UnwindControl,
};
use crate::machine::Machine;
use crate::real::Real;
use diameter::DiameterEstimator;
use drums::{DrumTask, Drums};
use motor::Motor;
use pi::Gains;
use reference::SCurve;
use unwind::{Unwind, UnwindTask};

/// Period of the regulators' task, ms.
pub const DRIVE_PERIOD_MS: u32 = 10;

/// From a measurement to the torque that answers it: half a period of sampling and one of computing, s.
const SAMPLE_LAG_S: f64 = 1.5e-3 * DRIVE_PERIOD_MS as f64;
/// The symmetrical optimum's spread of the corner frequencies; 3 gives a phase margin of 53°.
const SPREAD: f64 = 3.0;
/// At its largest rate the tension reference goes from zero to full in this time, s …
const TENSION_RAMP_S: f64 = 6.0;
/// … and reaches that rate in this one, s.
const TENSION_ROUNDING_S: f64 = 2.0;

/// All regulators.
#[derive(Clone, Copy, Debug)]
pub struct Drive<R: Real> {
    speed: SCurve<R>,
    tension: SCurve<R>,
    /// Largest rate of the tension reference, N/s, and its change, N/s².
    tension_rate: (R, R),
    diameter: DiameterEstimator<R>,
    unwind: Unwind<R>,
    drums: Drums<R>,
    motors: BySection<Motor<R>>,
    /// Tension above which there is a web to measure a diameter by, N.
    web_present: R,
    /// The unwind's brake has been called to help.
    assisted: bool,
}

impl<R: Real> Drive<R> {
    /// For a valid machine.
    pub fn new(machine: &Machine) -> Self {
        let period = 1e-3 * f64::from(DRIVE_PERIOD_MS);
        let full = machine.operation.tension_n_m * machine.web.width_m;
        let motors = &machine.motors;
        Self {
            speed: SCurve::new(period),
            tension: SCurve::new(period),
            tension_rate: (
                R::of(full / TENSION_RAMP_S),
                R::of(full / TENSION_RAMP_S / TENSION_ROUNDING_S),
            ),
            diameter: DiameterEstimator::new(machine, period),
            unwind: Unwind::new(machine, period),
            drums: Drums::new(machine, period),
            motors: BySection {
                uw: Motor::new(&motors.uw),
                rd: Motor::new(&motors.rd),
                fd: Motor::new(&motors.fd),
                rr: Motor::new(&motors.rr),
            },
            web_present: R::of(0.5 * full * machine.operation.stall_share),
            assisted: false,
        }
    }

    /// One period: references, diameter, unwind, drums.
    pub fn step(
        &mut self,
        command: &DriveCommand<R>,
        m: &Measurements<R>,
    ) -> (Actuators<R>, DriveStatus<R>) {
        let v = self.drums.speed(m);
        self.follow_references(command, v);
        self.estimate_diameter(command, m, v);
        let torque = self.torques(command, m, v);
        let assist = command.brake_assist && (self.assisted || self.unwind.at_limit());
        self.assisted = assist;
        let actuators = Actuators {
            torque,
            brakes: Brakes {
                uw: command.brakes.uw || assist,
                ..command.brakes
            },
            handling: command.handling,
            faults: command.faults,
        };
        (actuators, self.status(m, v, torque))
    }

    fn follow_references(&mut self, command: &DriveCommand<R>, v: R) {
        let (rate, jerk) = self.tension_rate;
        self.tension.step(command.tension, rate, jerk);
        if !command.drums && command.unwind != UnwindControl::Speed {
            self.speed.set(v);
        } else if !command.freeze_ramp {
            self.speed
                .step(command.v_target, command.acceleration, command.jerk);
        }
    }

    fn estimate_diameter(&mut self, command: &DriveCommand<R>, m: &Measurements<R>, v: R) {
        if let Some(r) = command.preset {
            self.diameter.preset(r);
        }
        let no_web = m.tension < self.web_present || command.unwind != UnwindControl::Tension;
        self.diameter
            .step(v, m.omega.uw, command.freeze_diameter || no_web);
    }

    fn torques(&mut self, command: &DriveCommand<R>, m: &Measurements<R>, v: R) -> BySection<R> {
        let (v_ref, a_ref) = (self.speed.value(), self.speed.rate());
        let uw = self.unwind.step(
            &UnwindTask {
                control: command.unwind,
                v_ref,
                a_ref,
                tension_ref: self.tension.value(),
                tension_rate: self.tension.rate(),
                v,
                r: self.diameter.radius(),
                limit: command.torque_limit.uw,
            },
            m,
        );
        if !command.drums {
            self.drums.off();
            return BySection {
                uw,
                ..BySection::default()
            };
        }
        let task = DrumTask {
            v_ref,
            a_ref,
            limit: command.torque_limit,
            share_trim: command.front_share_trim,
        };
        BySection {
            uw,
            ..self.drums.step(&task, m)
        }
    }

    fn status(&self, m: &Measurements<R>, v: R, torque: BySection<R>) -> DriveStatus<R> {
        let r_uw = self.diameter.radius();
        DriveStatus {
            v,
            v_ref: self.speed.value(),
            a_ref: self.speed.rate(),
            v_uw: m.omega.uw * r_uw,
            r_uw,
            tension_ref: self.tension.value(),
            torque,
            load: torque.zip(self.motors).map(|(t, motor)| motor.load(t)),
            power: torque.zip(m.omega).map(|(t, omega)| t * omega),
        }
    }
}

/// Stiffness of the whole web path EA/ΣL, N/m.
fn web_stiffness(machine: &Machine) -> f64 {
    machine.web.stiffness_n_m * machine.web.width_m / machine.web_path_m()
}

/// First web mode with the drums held and a full parent roll, √(k·R²/J), rad/s.
fn first_web_mode(machine: &Machine) -> f64 {
    let full = machine.parent_roll.full_radius_m;
    let inertia = machine.parent_roll_offset() + machine.web.roll_inertia(full);
    libm::sqrt(web_stiffness(machine) / inertia) * full
}

/// The crossover that sampling allows, 1/(a·T_σ), rad/s.
fn fastest_crossover() -> f64 {
    1.0 / (SPREAD * SAMPLE_LAG_S)
}

/// PI gains for an integrating plant of unit mass by the symmetrical optimum: K_p = ω_c, T_i = a/ω_c.
///
/// Source: W. Leonhard, Control of Electrical Drives, 3rd ed., §7.3, with a·T_σ = 1/ω_c.
fn symmetrical_optimum<R: Real>(crossover: f64, period: f64) -> Gains<R> {
    Gains {
        proportional: R::of(crossover),
        integral: R::of(crossover * crossover / SPREAD * period),
    }
}
