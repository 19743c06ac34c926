//! The regulators of a generic winder drive, as difference equations.
//!
//! Not here: modes and interlocks (the logic's), and everything a drive cannot measure: the regulators get
//! [`Measurements`] and set-points, never the plant.

pub mod autotune;
pub mod diameter;
pub mod drums;
pub mod motor;
pub mod pi;
pub mod reference;
pub mod table;
pub mod tuning;
pub mod unwind;

use crate::exchange::{
    Actuators, Brakes, BySection, DriveCommand, DriveStatus, Loop, Measurements, Setting, TuneStep,
    UnwindControl,
};
use crate::machine::Machine;
use crate::real::Real;
use autotune::{Axis, Found, Span, Tuner};
use diameter::DiameterEstimator;
use drums::{DrumTask, Drums};
use motor::Motor;
use pi::Gains;
use reference::SCurve;
use tuning::Tuning;
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
    period: R,
    speed: SCurve<R>,
    tension: SCurve<R>,
    /// Largest rate of the tension reference, N/s, and its change, N/s².
    tension_rate: (R, R),
    diameter: DiameterEstimator<R>,
    unwind: Unwind<R>,
    drums: Drums<R>,
    /// The unwind's motor.
    motor: Motor<R>,
    tuner: Tuner<R>,
    /// The tuning before auto-tune, as long as that is at work.
    kept: Option<Tuning<R>>,
    /// Tension above which there is a web to measure a diameter by, N.
    web_present: R,
    /// 1/(1 − exp(−T/τ)) of the load cells' filter, and what they showed a period ago, N.
    per_filter: R,
    last_tension: R,
    /// The unwind's brake has been called to help.
    assisted: bool,
}

impl<R: Real> Drive<R> {
    /// For a valid machine.
    pub fn new(machine: &Machine) -> Self {
        let period = 1e-3 * f64::from(DRIVE_PERIOD_MS);
        let full = machine.operation.tension_n_m * machine.web.width_m;
        let motors = Motor::of_sections(machine, period);
        let diameter = DiameterEstimator::new(machine, period);
        let tuning = Tuning::new(machine, period);
        Self {
            period: R::of(period),
            speed: SCurve::new(period),
            tension: SCurve::new(period),
            tension_rate: (
                R::of(full / TENSION_RAMP_S),
                R::of(full / TENSION_RAMP_S / TENSION_ROUNDING_S),
            ),
            diameter,
            unwind: Unwind::new(
                machine,
                motors.uw,
                &tuning.unwind,
                diameter.radius(),
                period,
            ),
            drums: Drums::new(machine, &motors, &tuning.drums, period),
            motor: motors.uw,
            tuner: Tuner::new(machine, period),
            kept: None,
            web_present: R::of(0.5 * full * machine.operation.stall_share),
            per_filter: R::of(-1.0 / libm::expm1(-period / machine.load_cells.filter_s)),
            last_tension: R::ZERO,
            assisted: false,
        }
    }

    /// What the regulators know of their plant, and their gains.
    pub fn tuning(&self) -> Tuning<R> {
        Tuning {
            drums: *self.drums.tuning(),
            unwind: *self.unwind.tuning(),
        }
    }

    /// Puts a tuning into use.
    pub fn set_tuning(&mut self, tuning: &Tuning<R>) {
        self.drums.tune(&tuning.drums);
        self.unwind.tune(&tuning.unwind, self.diameter.radius());
    }

    /// One period: references, diameter, auto-tune, unwind, drums, motors. What comes of it is put where it is wanted.
    pub fn step(
        &mut self,
        command: &DriveCommand<R>,
        m: &Measurements<R>,
        actuators: &mut Actuators<R>,
        status: &mut DriveStatus<R>,
    ) {
        let v = self.drums.speed(m);
        let tuned = self.follow_autotune(command, m);
        self.follow_references(command, v, tuned);
        self.estimate_diameter(command, m, v);
        let torque = self.torques(command, m, v, tuned);
        self.end_autotune(m);
        let assist = command.brake_assist && (self.assisted || self.unwind.at_limit());
        self.assisted = assist;
        act(command, torque, assist, actuators);
        self.tell(m, v, torque, status);
        self.last_tension = m.tension;
    }

    fn follow_references(&mut self, command: &DriveCommand<R>, v: R, tuned: Option<Loop>) {
        let (rate, jerk) = self.tension_rate;
        self.tension.step(command.tension, rate, jerk);
        let alone = command.unwind == UnwindControl::Speed;
        if !(command.drums || alone) || tuned == Some(Loop::DrumSpeed) {
            self.speed.set(v);
        } else {
            self.speed
                .step(command.v_target, command.acceleration, command.jerk);
        }
    }

    fn estimate_diameter(&mut self, command: &DriveCommand<R>, m: &Measurements<R>, v: R) {
        if let Some(r) = command.preset {
            self.diameter.preset(r);
        }
        if command.bare_estimator {
            self.diameter.step_bare(v, m.omega.uw);
            return;
        }
        let no_web = m.tension < self.web_present || command.unwind != UnwindControl::Tension;
        self.diameter
            .step(v, m.omega.uw, command.freeze_diameter || no_web);
    }

    fn torques(
        &mut self,
        command: &DriveCommand<R>,
        m: &Measurements<R>,
        v: R,
        tuned: Option<Loop>,
    ) -> BySection<R> {
        let limit = command.torque_limit;
        let a_ref = if command.no_inertia_compensation {
            R::ZERO
        } else {
            self.speed.rate()
        };
        let probe = match tuned {
            Some(Loop::Tension) => self.tune_tension(command, m, v),
            _ => None,
        };
        let uw = if tuned == Some(Loop::UnwindSpeed) {
            self.tune_unwind(m, limit.uw)
        } else {
            let task = UnwindTask {
                control: command.unwind,
                v_ref: self.speed.value(),
                a_ref,
                tension_ref: self.tension.value(),
                tension_rate: self.tension.rate(),
                v,
                r: self.diameter.radius(),
                limit: limit.uw,
                open: command.tension_open,
                probe,
            };
            self.unwind.step(&task, m)
        };
        let windup = if tuned == Some(Loop::DrumSpeed) {
            self.drums.off();
            self.tune_drums(m, &limit)
        } else if command.drums {
            let task = DrumTask {
                v_ref: self.speed.value(),
                a_ref,
                limit,
                tension: (command.unwind == UnwindControl::Tension).then(|| self.tension.value()),
                probe: probe.unwrap_or_default(),
                share_trim: command.front_share_trim,
                rider_lifted: command.rider.lifted,
            };
            self.drums.step(&task, m)
        } else {
            self.drums.off();
            BySection::default()
        };
        BySection { uw, ..windup }
    }

    fn follow_autotune(&mut self, command: &DriveCommand<R>, m: &Measurements<R>) -> Option<Loop> {
        let tuned = self.tuner.follow(command.autotune)?;
        if self.kept.is_none() {
            self.kept = Some(self.tuning());
            let old = self.setting(tuned, m);
            self.tuner.report_mut().old = old;
        }
        Some(tuned)
    }

    fn tune_unwind(&mut self, m: &Measurements<R>, limit: R) -> R {
        let r = self.diameter.radius();
        let tuning = *self.unwind.tuning();
        let square = r * r;
        let axis = Axis {
            omega: m.omega.uw,
            r,
            limit: self.motor.limit(m.omega.uw, limit),
            rated: self.motor.rated(),
            inertia: tuning.inertia(r),
            friction: tuning.friction * square,
            braked: m.brakes.uw,
            tension: m.tension,
        };
        let torque = self.tuner.drive(&axis, |inertia| {
            let mass = inertia / square;
            tuning.speed_gains(mass, tuning.mode(mass)).times(square)
        });
        self.unwind.stand_by(torque);
        torque
    }

    fn tune_drums(&mut self, m: &Measurements<R>, limit: &BySection<R>) -> BySection<R> {
        let r = self.drums.radius();
        let tuning = *self.drums.tuning();
        let square = r * r;
        let axis = Axis {
            omega: m.omega.rd,
            r,
            limit: self.drums.limit(limit, m) * r,
            rated: self.drums.limit(&BySection::all(R::ONE), m) * r,
            inertia: tuning.mass(m.d_wu) * square,
            friction: tuning.friction * square,
            braked: m.brakes.rd || m.brakes.fd,
            tension: m.tension,
        };
        let torque = self
            .tuner
            .drive(&axis, |inertia| tuning.speed_gains(inertia));
        self.drums.evenly(torque / r)
    }

    fn tune_tension(&mut self, command: &DriveCommand<R>, m: &Measurements<R>, v: R) -> Option<R> {
        let tuning = self.unwind.tuning();
        let r = self.diameter.radius();
        self.tuner.watch(&Span {
            tension: m.tension,
            tension_ref: self.tension.value(),
            v,
            steady: self.speed.rate() == R::ZERO && self.tension.rate() == R::ZERO,
            controlled: command.unwind == UnwindControl::Tension
                && command.drums
                && !command.tension_open,
            stiffness: tuning.web_stiffness,
            mass: tuning.inertia(r) / (r * r),
            drum_mass: self.drums.tuning().mass(m.d_wu),
        })
    }

    /// Takes over what auto-tune has found; an abort puts the old tuning back.
    fn end_autotune(&mut self, m: &Measurements<R>) {
        if let Some(found) = self.tuner.take_found() {
            let tuning = self.tuning_with(&found, m);
            self.set_tuning(&tuning);
            if let Some(of) = self.tuner.report().of {
                let new = self.setting(of, m);
                self.tuner.report_mut().new = new;
            }
        }
        match self.tuner.report().step {
            TuneStep::Aborted => {
                if let Some(tuning) = self.kept.take() {
                    self.set_tuning(&tuning);
                }
            }
            TuneStep::Done => self.kept = None,
            _ => {}
        }
    }

    fn tuning_with(&self, found: &Found<R>, m: &Measurements<R>) -> Tuning<R> {
        let mut tuning = self.tuning();
        match *found {
            Found::Roll { inertia, friction } => {
                if self.tuner.report().of == Some(Loop::UnwindSpeed) {
                    let r = self.diameter.radius();
                    tuning.unwind.learn(inertia, friction / (r * r), r);
                } else {
                    let square = self.drums.radius() * self.drums.radius();
                    let (mass, friction) = (inertia / square, friction / square);
                    tuning.drums.learn(mass, friction, m.d_wu);
                }
            }
            Found::Web { stiffness, damping } => tuning.unwind.learn_web(stiffness, damping),
        }
        tuning
    }

    /// The setting of a loop at the present diameters.
    fn setting(&self, of: Loop, m: &Measurements<R>) -> Setting<R> {
        let gains = match of {
            Loop::DrumSpeed => {
                let (tuning, r) = (self.drums.tuning(), self.drums.radius());
                tuning.speed_gains(tuning.mass(m.d_wu)).times(r * r)
            }
            Loop::UnwindSpeed => {
                let (tuning, r) = (self.unwind.tuning(), self.diameter.radius());
                let mass = tuning.inertia(r) / (r * r);
                tuning.speed_gains(mass, tuning.mode(mass)).times(r * r)
            }
            Loop::Tension => self.unwind.tension_gains(),
        };
        gains.setting(self.period)
    }

    fn tell(&self, m: &Measurements<R>, v: R, torque: BySection<R>, status: &mut DriveStatus<R>) {
        let r_uw = self.diameter.radius();
        *status = DriveStatus {
            v,
            v_ref: self.speed.value(),
            a_ref: self.speed.rate(),
            v_uw: m.omega.uw * r_uw,
            r_uw,
            tension_ref: self.tension.value(),
            tension_at_once: self.last_tension + self.per_filter * (m.tension - self.last_tension),
            torque,
            autotune: *self.tuner.report(),
        };
    }
}

/// What acts on the winder: torques, brakes with the unwind's that assists or not, and what is passed through.
fn act<R: Real>(
    command: &DriveCommand<R>,
    torque: BySection<R>,
    assist: bool,
    actuators: &mut Actuators<R>,
) {
    actuators.torque = torque;
    actuators.brakes = Brakes {
        uw: command.brakes.uw || assist,
        ..command.brakes
    };
    actuators.rider = command.rider;
    actuators.handling = command.handling;
    actuators.faults = command.faults;
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
