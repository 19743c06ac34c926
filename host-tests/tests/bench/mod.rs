//! The regulators and the plant on a bench: no logic, commands by hand.
//!
//! Not here: modes, sections, a PLC.
// every test program uses its part of it
#![allow(dead_code)]

pub mod response;

use model_core::drive::{DRIVE_PERIOD_MS, Drive};
use model_core::exchange::{
    Actuators, Autotune, BySection, DriveCommand, DriveStatus, Loop, Measurements, TuneStep,
    UnwindControl,
};
use model_core::machine::Machine;
use model_core::plant::rk4::State;
use model_core::plant::{PLANT_PERIOD_MS, Winder};
use model_core::real::{Real, Scalar};

/// A drive cycle, s.
pub const CYCLE: f64 = 1e-3 * DRIVE_PERIOD_MS as f64;

/// From taking over a running machine to rest, s.
const SETTLE_S: f64 = 12.0;

/// The bench.
#[derive(Clone)]
pub struct Bench<R: Scalar> {
    pub machine: Machine,
    pub winder: Winder<R, 3>,
    pub drive: Drive<R::Si>,
    pub command: DriveCommand<R::Si>,
    pub m: Measurements<R::Si>,
    pub status: DriveStatus<R::Si>,
    /// Torques that somebody adds at the shafts, N·m.
    pub disturbance: BySection<R::Si>,
    actuators: Actuators<R::Si>,
    phase_ms: u32,
}

impl<R: Scalar> Bench<R> {
    /// A machine at standstill without web, its rolls of these radii, m.
    pub fn new(machine: &Machine, r_uw: f64, r_wu: f64) -> Self {
        Self::known_as(machine, machine, r_uw, r_uw, r_wu)
    }

    /// The same; the drives have another description of it, and know the parent roll's radius as `preset`.
    pub fn known_as(
        machine: &Machine,
        description: &Machine,
        r_uw: f64,
        preset: f64,
        r_wu: f64,
    ) -> Self {
        let mut winder = Winder::new(machine, 1e-3 * f64::from(PLANT_PERIOD_MS)).unwrap();
        let mut x = winder.state();
        (x.r_uw, x.r_wu) = (R::Si::of(r_uw), R::Si::of(r_wu));
        winder.set_state(&x);
        let o = &machine.operation;
        let mut bench = Self {
            machine: machine.clone(),
            winder,
            drive: Drive::new(description),
            command: DriveCommand {
                acceleration: R::Si::of(o.acceleration_m_s2),
                jerk: R::Si::of(o.jerk_m_s3),
                torque_limit: BySection::all(R::Si::of(1.5)),
                preset: Some(R::Si::of(preset)),
                ..DriveCommand::default()
            },
            m: Measurements::default(),
            status: DriveStatus::default(),
            disturbance: BySection::default(),
            actuators: Actuators::default(),
            phase_ms: 0,
        };
        bench.wait(0.1);
        bench.command.preset = None;
        bench
    }

    /// The same machine with a tight web that runs at a speed, m/s, in tension control: under stall tension up to
    /// thread speed, under full tension above.
    pub fn running(mut self, v: f64) -> Self {
        let o = &self.machine.operation;
        let share = if v > o.thread_speed_m_s {
            1.0
        } else {
            o.stall_share
        };
        let tension = share * self.full_tension();
        // the tension reference has its ramp behind it
        self.command.tension = R::Si::of(tension);
        self.wait(10.0);
        self.winder.thread_at(R::Si::of(tension));
        let mut x = self.winder.state();
        // the strain of the tension makes the roll slower than the web
        let strain = tension / (self.machine.web.stiffness_n_m * self.machine.web.width_m);
        x.v = [R::Si::of(v); 3];
        x.windup = [R::Si::of(v); 3];
        x.omega_uw = R::Si::of(v / x.r_uw.to_f64() / (1.0 + strain));
        self.winder.set_state(&x);
        // the drives see the machine turn, and take over
        self.wait(2.0 * CYCLE);
        self.hold(v);
        self.wait(SETTLE_S);
        self
    }

    /// Tension control at a speed, m/s.
    pub fn hold(&mut self, v: f64) {
        self.command.unwind = UnwindControl::Tension;
        self.command.drums = true;
        self.command.v_target = R::Si::of(v);
    }

    /// Full tension, N.
    pub fn full_tension(&self) -> f64 {
        self.machine.operation.tension_n_m * self.machine.web.width_m
    }

    /// One drive cycle.
    pub fn cycle(&mut self) {
        let end = self.phase_ms + DRIVE_PERIOD_MS;
        for _ in 0..end / PLANT_PERIOD_MS - self.phase_ms / PLANT_PERIOD_MS {
            self.m = self.winder.step(&self.actuators);
        }
        self.phase_ms = end % (PLANT_PERIOD_MS * DRIVE_PERIOD_MS);
        self.drive.step(
            &self.command,
            &self.m,
            &mut self.actuators,
            &mut self.status,
        );
        let (torque, more) = (self.actuators.torque, self.disturbance);
        self.actuators.torque = torque.zip(more).map(|(t, more)| t + more);
    }

    /// Waits, s, with an eye on something in every cycle.
    pub fn wait_with(&mut self, seconds: f64, mut look: impl FnMut(&Self)) {
        for _ in 0..(seconds / CYCLE).round() as u32 {
            self.cycle();
            look(self);
        }
    }

    /// Waits, s.
    pub fn wait(&mut self, seconds: f64) {
        self.wait_with(seconds, |_| ());
    }

    /// Tunes a loop to its end, with an eye on something in every cycle; fails after ten minutes.
    pub fn tune_with(&mut self, of: Loop, mut look: impl FnMut(&mut Self)) -> Autotune<R::Si> {
        self.command.autotune = Some(of);
        for _ in 0..60_000 {
            self.cycle();
            look(self);
            let told = self.status.autotune;
            if matches!(told.step, TuneStep::Done | TuneStep::Aborted) {
                self.command.autotune = None;
                self.cycle();
                return told;
            }
        }
        panic!("still tuning: {:?}", self.status.autotune);
    }

    /// Tunes a loop to its end.
    pub fn tune(&mut self, of: Loop) -> Autotune<R::Si> {
        self.tune_with(of, |_| ())
    }

    /// Ground truth: the plant's state.
    pub fn x(&self) -> State<f64, 3> {
        self.winder.state().map(Real::to_f64)
    }

    /// Ground truth: tensions, N.
    pub fn t(&self) -> [f64; 3] {
        self.winder.tension().map(Real::to_f64)
    }
}
