//! What each mode asks of the regulators.
//!
//! Not here: which mode it is.

use super::{Logic, Mode, Sight, command_2, inject};
use crate::exchange::{
    Brakes, BySection, DriveCommand, Faults, Loop, MachineFaults, Rider, SensorFaults, Stuck,
    UnwindControl,
};
use crate::image::{self, Commands};
use crate::profidrive::stw1;
use crate::real::Real;

/// A row of what the modes ask.
struct Row<R> {
    unwind: UnwindControl,
    drums: bool,
    v: R,
    /// Acceleration and jerk.
    limits: (R, R),
    tension: R,
    brakes: Brakes<bool>,
}

impl<R: Real> Logic<R> {
    /// What the present mode asks, less what faults have taken out.
    pub(super) fn ask(&self, sight: &Sight<R>) -> DriveCommand<R> {
        let commands = sight.commands;
        let get = |signal| commands.get::<R>(signal);
        let percent = R::of(0.01);
        let drum_limit = get(&image::TORQUE_LIMIT_DRUMS) * percent;
        let tripped = self.faults.latched().tripped();
        let defects = commands.word(&image::FAULT_DRIVES);
        let mut row = self.row(sight);
        if tripped.uw && row.unwind != UnwindControl::Off {
            (row.unwind, row.brakes.uw) = (UnwindControl::Off, true);
        }
        let unless = |tripped: bool, limit: R| if tripped { R::ZERO } else { limit };
        let torque_limit = BySection {
            uw: unless(tripped.uw, get(&image::TORQUE_LIMIT_UW) * percent),
            rd: drum_limit,
            fd: drum_limit,
            rr: unless(tripped.rr, drum_limit),
        };
        DriveCommand {
            unwind: row.unwind,
            drums: row.drums,
            v_target: row.v,
            acceleration: row.limits.0,
            jerk: row.limits.1,
            tension: row.tension,
            tension_open: tension_open(commands),
            preset: self.one_shot.preset,
            freeze_diameter: matches!(self.mode, Mode::WebBreakStop | Mode::UnwindManeuver),
            brake_assist: self.mode == Mode::EmergencyStop && !tripped.uw,
            torque_limit: torque_limit
                .zip(self.motors.allowed())
                .map(|(limit, allowed)| limit.min(allowed)),
            // a drum that has tripped leaves all to the other one
            front_share_trim: match (tripped.rd, tripped.fd) {
                (true, _) => R::ONE,
                (_, true) => -R::ONE,
                _ => get(&image::FRONT_SHARE_TRIM) * percent,
            },
            brakes: row.brakes,
            rider: rider(commands),
            handling: self.one_shot.handling,
            faults: self.inject(sight),
            autotune: (self.mode == Mode::AutoTune).then_some(self.tuned),
            bare_estimator: defects & inject::BARE_ESTIMATOR != 0,
            no_inertia_compensation: defects & inject::NO_INERTIA_COMPENSATION != 0,
        }
    }

    fn row(&self, sight: &Sight<R>) -> Row<R> {
        use UnwindControl::{Off, Speed};
        let (c, commands) = (&self.c, sight.commands);
        let minutes = R::of(1.0 / 60.0);
        let get = |signal| commands.get::<R>(signal);
        let stall = get(&image::STALL_SET) * c.width;
        let tension = get(&image::TENSION_SET) * c.width;
        let kept = sight.drive.tension_ref;
        let normal = (get(&image::ACCEL_SET), get(&image::JERK_SET));
        let emergency = (c.emergency, c.emergency_jerk);
        let run = (get(&image::V_SET) * minutes).min(c.max_speed);
        let crawl = (get(&image::V_THREAD_SET) * minutes).min(c.max_speed);
        let jog = (get(&image::V_JOG_SET) * minutes).min(c.max_speed);
        let word = self.sections.rd.word();
        let moving = |v| {
            let enabled = stw1::ENABLE_RAMP | stw1::ENABLE_SETPOINT;
            if word & enabled != enabled {
                R::ZERO
            } else {
                self.frozen.unwrap_or(v)
            }
        };
        // without web the unwind stands by its brake
        let pull = if !self.web_threaded {
            Off
        } else if self.tension.is_on() {
            UnwindControl::Tension
        } else {
            UnwindControl::TakeUp
        };
        let held = self.drums_held || self.commanded(sight, super::command::DRUM_BRAKES);
        let on = |uw, drums| Brakes {
            uw,
            rd: drums,
            fd: drums,
        };
        let open = on(!self.web_threaded, false);
        let latched = self.faults.latched();
        let brakes_only = latched.reaction() >= Some(super::faults::Reaction::QuickStop);
        let zero = R::ZERO;

        let (unwind, drums, v, limits, tension, brakes) = match self.mode {
            //               unwind  drums  speed  limits     tension  brakes: unwind, drums
            Mode::Off => (Off, false, zero, normal, zero, on(true, true)),
            Mode::Ready => (Off, true, zero, normal, zero, on(true, held)),
            Mode::Thread => (pull, true, moving(crawl), normal, stall, open),
            Mode::Stall => (pull, true, zero, normal, stall, on(false, held)),
            Mode::Run => (pull, true, moving(run), normal, tension, open),
            Mode::NormalStop => (pull, true, zero, normal, kept, open),
            Mode::EmergencyStop => (pull, true, zero, emergency, kept, open),
            Mode::CoastStop => {
                let brakes = on(brakes_only || !self.web_threaded, brakes_only);
                (Off, false, zero, normal, zero, brakes)
            }
            Mode::WebBreakStop => (Speed, true, zero, emergency, zero, on(true, false)),
            Mode::UnwindManeuver => {
                let v = match self.jog {
                    1 => jog,
                    -1 => -jog,
                    _ => zero,
                };
                (Speed, false, v, normal, zero, on(false, true))
            }
            Mode::AutoTune => match self.tuned {
                Loop::DrumSpeed => (Off, true, zero, normal, zero, on(true, false)),
                Loop::UnwindSpeed => (Off, false, zero, normal, zero, on(false, true)),
                Loop::Tension => (pull, true, moving(crawl), normal, stall, open),
            },
        };
        Row {
            unwind,
            drums,
            v,
            limits,
            tension,
            brakes,
        }
    }

    /// What a test puts in, for plant and sensors.
    fn inject(&self, sight: &Sight<R>) -> Faults<R> {
        let commands = sight.commands;
        let machine = commands.word(&image::FAULT_MACHINE);
        let sensors = commands.word(&image::FAULT_SENSORS);
        let get = |signal| commands.get::<R>(signal);
        // a brake cannot be stuck both ways: closed is the safe one
        let stuck = |open, closed| {
            if machine & closed != 0 {
                Stuck::Closed
            } else if machine & open != 0 {
                Stuck::Open
            } else {
                Stuck::No
            }
        };
        Faults {
            machine: MachineFaults {
                web_break: commands.word(&image::FAULT_WEB_BREAK).min(u8::MAX.into()) as u8,
                parent_roll_expired: machine & inject::PARENT_ROLL_EXPIRED != 0,
                next_parent_roll: get(&image::PARENT_ROLL_PUT_IN) * R::of(1e-3),
                brakes: Brakes {
                    uw: stuck(inject::BRAKE_UW_OPEN, inject::BRAKE_UW_CLOSED),
                    rd: stuck(inject::BRAKE_RD_OPEN, inject::BRAKE_RD_CLOSED),
                    fd: stuck(inject::BRAKE_FD_OPEN, inject::BRAKE_FD_CLOSED),
                },
                drum_wear: get(&image::FAULT_DRUM_WEAR) * R::of(0.01),
                eccentricity: get(&image::FAULT_ECCENTRICITY_UW) * R::of(1e-3),
            },
            sensors: SensorFaults {
                encoder_uw: sensors & inject::ENCODER_UW != 0,
                encoder_rd: sensors & inject::ENCODER_RD != 0,
                load_cell_stuck: sensors & inject::LOAD_CELL_STUCK != 0,
                wrap_error: get(&image::FAULT_WRAP_ANGLE) * R::of(core::f64::consts::PI / 180.0),
                drift: get(&image::FAULT_LOAD_CELL_DRIFT) * self.c.width * R::of(1.0 / 60.0),
            },
        }
    }
}

/// The rider roll as it is commanded. A load of 0 % is none that was set: the table's counts.
fn rider<R: Real>(commands: &Commands) -> Rider<R> {
    let load: R = commands.get(&image::RIDER_LOAD_SET);
    Rider {
        lifted: commands.word(&image::WINDER_COMMAND_2) & command_2::RIDER_UP != 0,
        load_trim: if load == R::ZERO {
            R::ZERO
        } else {
            load * R::of(0.01) - R::ONE
        },
    }
}

/// The PLC wants the tension loop open.
pub(super) fn tension_open(commands: &Commands) -> bool {
    commands.word(&image::WINDER_COMMAND_2) & command_2::TENSION_CONTROL_OFF != 0
}
