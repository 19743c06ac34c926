//! The drive logic: in which mode the winder is, what it asks of the regulators, and why it refuses.
//!
//! Not here: unwind maneuver, jog, auto-tune. The logic runs once a drive cycle, in the background, on what the
//! PLC had written by then.
//!
//! A request (thread, stall, run) starts with a rising edge of its bit and lasts as long as the bit stands, so
//! that nothing starts by itself when a condition comes true later. Of several requests in one cycle the
//! slowest counts. Stops are demanded by the sections' control words; the strongest of all sections counts.

mod detection;
mod report;
mod section;
mod words;

pub use section::{Demand, Section, State};
pub use words::{COMMAND_BITS, Fault, Mode, Refusal, STATUS_BITS, command, status};

use crate::exchange::{
    Brakes, BySection, DriveCommand, DriveStatus, Handling, Measurements, UnwindControl,
};
use crate::image::{self, Commands, Feedback};
use crate::machine::Machine;
use crate::profidrive::stw1;
use crate::real::Real;
use detection::{Heartbeat, Persistent};

/// Drive cycles in a second.
const CYCLES_PER_S: u16 = 100;
/// The PLC's heartbeat may stand still so long.
const HEARTBEAT_CYCLES: u16 = CYCLES_PER_S / 2;
/// Tension counts as detected above this share of the stall tension …
const TENSION_DETECTED: f64 = 0.5;
/// … for this time.
const TENSION_CYCLES: u16 = CYCLES_PER_S / 2;
/// The web counts as broken below this share of the tension reference …
const WEB_BREAK: f64 = 0.2;
/// … for this time.
const WEB_BREAK_CYCLES: u16 = CYCLES_PER_S / 10;
/// Below this speed a loss of tension must last as long as its detection to count as a break, m/s.
const WEB_BREAK_SPEED: f64 = 1.0;
/// Standstill, m/s.
const ZERO_SPEED: f64 = 0.01;
/// Tolerance of the web speed to its reference and set-point, of the highest speed.
const SPEED_TOLERANCE: f64 = 0.005;
/// Jerk of an emergency or web-break stop, m/s³.
const EMERGENCY_JERK: f64 = 2.0;

/// The drive logic.
#[derive(Clone, Debug)]
pub struct Logic<R> {
    c: Coefficients<R>,
    mode: Mode,
    sections: BySection<Section>,
    refusal: Refusal,
    fault: Fault,
    /// The command word of the last cycle.
    last_command: u16,
    last_acknowledge: bool,
    web_threaded: bool,
    preset_taken: bool,
    tension: Persistent,
    tension_lost: Persistent,
    heartbeat_plc: Heartbeat,
    heartbeat: u16,
    /// Length on the shipping roll, m: encoder pulses since the core was put in.
    pulses_at_core: u32,
    drums_held: bool,
    one_shot: OneShot<R>,
}

/// What is handed on for one cycle only.
#[derive(Clone, Copy, Debug, Default)]
struct OneShot<R> {
    preset: Option<R>,
    handling: Handling,
}

#[derive(Clone, Copy, Debug)]
struct Coefficients<R> {
    width: R,
    metres_per_pulse: f64,
    spool: R,
    full: R,
    max_speed: R,
    emergency: R,
    emergency_jerk: R,
    zero_speed: R,
    speed_tolerance: R,
    web_break_speed: R,
    detected: R,
    lost: R,
}

/// What the logic sees of the machine and the PLC in one cycle.
struct Sight<'a, R> {
    commands: &'a Commands,
    m: &'a Measurements<R>,
    drive: &'a DriveStatus<R>,
    standstill: bool,
}

impl<R: Real> Logic<R> {
    /// For a valid machine: drives off, web not threaded.
    pub fn new(machine: &Machine) -> Self {
        let roll = &machine.parent_roll;
        let circumference = core::f64::consts::TAU * machine.rear_drum.radius_m;
        let max_speed = machine.operation.max_speed_m_s;
        let r = R::of;
        Self {
            c: Coefficients {
                width: r(machine.web.width_m),
                metres_per_pulse: circumference / machine.encoder_pulses,
                spool: r(roll.spool_radius_m),
                full: r(roll.full_radius_m),
                max_speed: r(max_speed),
                emergency: r(machine.operation.emergency_m_s2),
                emergency_jerk: r(EMERGENCY_JERK),
                zero_speed: r(ZERO_SPEED),
                speed_tolerance: r(SPEED_TOLERANCE * max_speed),
                web_break_speed: r(WEB_BREAK_SPEED),
                detected: r(TENSION_DETECTED),
                lost: r(WEB_BREAK),
            },
            mode: Mode::default(),
            sections: BySection::default(),
            refusal: Refusal::default(),
            fault: Fault::default(),
            last_command: 0,
            last_acknowledge: false,
            web_threaded: false,
            preset_taken: false,
            tension: Persistent::default(),
            tension_lost: Persistent::default(),
            heartbeat_plc: Heartbeat::default(),
            heartbeat: 0,
            pulses_at_core: 0,
            drums_held: false,
            one_shot: OneShot::default(),
        }
    }

    /// The mode.
    pub fn mode(&self) -> Mode {
        self.mode
    }

    /// One drive cycle: takes the PLC's commands as they stand, fills the feedback, asks the regulators.
    pub fn step(
        &mut self,
        commands: &Commands,
        m: &Measurements<R>,
        drive: &DriveStatus<R>,
        feedback: &mut Feedback,
    ) -> DriveCommand<R> {
        let sight = Sight {
            commands,
            m,
            drive,
            standstill: self.standstill(drive),
        };
        self.one_shot = OneShot::default();
        self.acknowledge(&sight);
        self.switch_sections(&sight);
        self.detect(&sight);
        self.obey_stops(&sight);
        self.obey_requests(&sight);
        self.go_on(&sight);
        self.last_command = commands.word(&image::WINDER_COMMAND);
        self.report(&sight, feedback);
        self.ask(&sight)
    }

    fn standstill(&self, drive: &DriveStatus<R>) -> bool {
        let zero = self.c.zero_speed;
        drive.v_ref.is_near(R::ZERO, zero)
            && drive.v.is_near(R::ZERO, zero)
            && drive.v_uw.is_near(R::ZERO, zero)
    }

    fn rising(&self, sight: &Sight<R>, bit: u16) -> bool {
        sight.commands.word(&image::WINDER_COMMAND) & !self.last_command & bit != 0
    }

    fn commanded(&self, sight: &Sight<R>, bit: u16) -> bool {
        sight.commands.word(&image::WINDER_COMMAND) & bit != 0
    }

    fn all_in_operation(&self) -> bool {
        let states = self.sections.map(|s| s.state()).into_array();
        states.iter().all(|s| *s == State::Operation)
    }

    fn acknowledge(&mut self, sight: &Sight<R>) {
        let words = control_words(sight.commands).into_array();
        let by_section = words.iter().any(|w| w & stw1::ACKNOWLEDGE != 0);
        let now = by_section || self.commanded(sight, command::ACKNOWLEDGE);
        if now && !self.last_acknowledge && self.fault != Fault::None {
            if sight.standstill {
                self.fault = Fault::None;
            } else {
                self.refusal = Refusal::NotAtStandstill;
            }
        }
        self.last_acknowledge = now;
    }

    fn switch_sections(&mut self, sight: &Sight<R>) {
        let fault = self.fault == Fault::HeartbeatLost;
        let words = control_words(sight.commands);
        self.sections = self.sections.zip(words).map(|(mut section, word)| {
            section.step(word, fault);
            section
        });
    }

    fn detect(&mut self, sight: &Sight<R>) {
        let (c, m) = (&self.c, sight.m);
        let stall = sight.commands.get::<R>(&image::STALL_SET) * c.width;
        self.tension
            .step(m.tension > c.detected * stall, TENSION_CYCLES);

        let reference = sight.drive.tension_ref;
        let lost = self.holds_tension() && m.tension < c.lost * reference;
        let patience = if sight.drive.v.abs() > c.web_break_speed {
            WEB_BREAK_CYCLES
        } else {
            TENSION_CYCLES
        };
        if !lost {
            self.tension_lost.reset();
        } else if self.tension_lost.step(lost, patience) {
            self.break_web();
        }

        let count = sight.commands.word(&image::HEARTBEAT_PLC);
        let watched = self.mode != Mode::Off && self.fault != Fault::HeartbeatLost;
        if self.heartbeat_plc.step(count, watched, HEARTBEAT_CYCLES) {
            self.latch(Fault::HeartbeatLost);
            self.stop_normally();
        }
    }

    /// The modes in which the unwind controls tension once there is any.
    fn holds_tension(&self) -> bool {
        use Mode::*;
        let mode = matches!(self.mode, Thread | Stall | Run | NormalStop | EmergencyStop);
        mode && self.tension.is_on()
    }

    fn latch(&mut self, fault: Fault) {
        if self.fault == Fault::None {
            self.fault = fault;
        }
    }

    fn break_web(&mut self) {
        self.latch(Fault::WebBreak);
        self.web_threaded = false;
        self.tension.reset();
        self.mode = Mode::WebBreakStop;
    }

    fn stop_normally(&mut self) {
        if matches!(self.mode, Mode::Thread | Mode::Stall | Mode::Run) {
            self.mode = Mode::NormalStop;
        }
    }

    /// OFF2, OFF3 and OFF1 of any section that is in operation.
    fn obey_stops(&mut self, sight: &Sight<R>) {
        if self.mode == Mode::Off {
            return;
        }
        let demands = self.sections.map(|s| s.demand()).into_array();
        match demands.into_iter().max().unwrap_or_default() {
            Demand::Coast if sight.standstill => self.switch_off(),
            Demand::Coast => self.mode = Mode::CoastStop,
            Demand::QuickStop if self.mode == Mode::Ready => self.switch_off(),
            Demand::QuickStop if matches!(self.mode, Mode::CoastStop | Mode::WebBreakStop) => {}
            Demand::QuickStop => self.mode = Mode::EmergencyStop,
            Demand::SwitchOff if matches!(self.mode, Mode::Ready | Mode::Stall) => {
                self.switch_off();
            }
            Demand::SwitchOff => self.stop_normally(),
            Demand::Operate => {}
        }
    }

    fn switch_off(&mut self) {
        let fault = self.fault == Fault::HeartbeatLost;
        self.sections = self.sections.map(|mut section| {
            section.switch_off(fault);
            section
        });
        self.tension.reset();
        self.mode = Mode::Off;
    }

    fn obey_requests(&mut self, sight: &Sight<R>) {
        let acts = [
            (command::PRESET_ACCEPT, Self::take_preset as Request<R>),
            (command::NEW_CORE, Self::take_new_core),
            (command::NEW_PARENT_ROLL, Self::take_new_parent_roll),
            (command::WEB_THREADED, Self::take_threaded_web),
        ];
        let modes = [
            (command::STALL, Self::start_stall as Request<R>),
            (command::THREAD, Self::start_thread),
            (command::RUN, Self::start_run),
        ];
        let risen = |(bit, _): &(u16, Request<R>)| self.rising(sight, *bit);
        let acts = acts.map(|act| risen(&act).then_some(act.1));
        let mode = modes.into_iter().find(risen).map(|(_, request)| request);
        let mut requests = acts.into_iter().chain([mode]).flatten().peekable();
        if requests.peek().is_some() {
            self.refusal = Refusal::None;
        }
        for request in requests {
            if let Err(refusal) = request(self, sight) {
                self.refusal = refusal;
            }
        }
        self.end_requests(sight);
    }

    /// A request that is taken back ends its mode.
    fn end_requests(&mut self, sight: &Sight<R>) {
        let fell = |bit| self.last_command & bit != 0 && !self.commanded(sight, bit);
        match self.mode {
            Mode::Thread if !self.commanded(sight, command::THREAD) => self.stop_normally(),
            Mode::Run if !self.commanded(sight, command::RUN) => self.stop_normally(),
            Mode::Stall if fell(command::STALL) => self.mode = Mode::Ready,
            _ => {}
        }
    }

    fn take_preset(&mut self, sight: &Sight<R>) -> Result<(), Refusal> {
        self.without_tension(sight)?;
        let diameter: R = sight.commands.get(&image::D_PRESET_UW);
        let r = diameter * R::of(0.5e-3);
        let count = R::of(0.5e-4);
        if r < self.c.spool - count || r > self.c.full + count {
            return Err(Refusal::PresetOutOfRange);
        }
        self.one_shot.preset = Some(r);
        self.preset_taken = true;
        Ok(())
    }

    fn take_new_core(&mut self, sight: &Sight<R>) -> Result<(), Refusal> {
        self.without_tension(sight)?;
        self.one_shot.handling.new_core = true;
        self.pulses_at_core = sight.m.pulses_rd;
        Ok(())
    }

    fn take_new_parent_roll(&mut self, sight: &Sight<R>) -> Result<(), Refusal> {
        self.without_tension(sight)?;
        self.one_shot.handling.new_parent_roll = true;
        self.preset_taken = false;
        Ok(())
    }

    fn take_threaded_web(&mut self, sight: &Sight<R>) -> Result<(), Refusal> {
        self.without_tension(sight)?;
        self.one_shot.handling.thread_web = true;
        self.web_threaded = true;
        Ok(())
    }

    /// What people do at the machine, and the preset, need a machine that stands and does not pull.
    fn without_tension(&self, sight: &Sight<R>) -> Result<(), Refusal> {
        match self.mode {
            Mode::Off | Mode::Ready if sight.standstill => Ok(()),
            Mode::Off | Mode::Ready => Err(Refusal::NotAtStandstill),
            _ => Err(Refusal::WrongMode),
        }
    }

    fn start_stall(&mut self, _: &Sight<R>) -> Result<(), Refusal> {
        self.ready_to_pull()?;
        match self.mode {
            Mode::Ready => self.drums_held = false,
            Mode::Stall => {}
            _ => return Err(Refusal::WrongMode),
        }
        self.mode = Mode::Stall;
        Ok(())
    }

    fn start_thread(&mut self, _: &Sight<R>) -> Result<(), Refusal> {
        self.ready_to_pull()?;
        match self.mode {
            Mode::Ready | Mode::Stall => {
                self.mode = Mode::Thread;
                Ok(())
            }
            _ => Err(Refusal::WrongMode),
        }
    }

    fn start_run(&mut self, _: &Sight<R>) -> Result<(), Refusal> {
        self.ready_to_pull()?;
        match self.mode {
            Mode::Thread | Mode::Stall if self.tension.is_on() => {
                self.mode = Mode::Run;
                Ok(())
            }
            Mode::Ready | Mode::Thread | Mode::Stall => Err(Refusal::NoTension),
            _ => Err(Refusal::WrongMode),
        }
    }

    fn ready_to_pull(&self) -> Result<(), Refusal> {
        if self.fault != Fault::None {
            Err(Refusal::FaultLatched)
        } else if !self.all_in_operation() {
            Err(Refusal::DrivesNotOn)
        } else if !self.web_threaded {
            Err(Refusal::WebNotThreaded)
        } else if !self.preset_taken {
            Err(Refusal::NoPreset)
        } else {
            Ok(())
        }
    }

    /// Modes that end by themselves.
    fn go_on(&mut self, sight: &Sight<R>) {
        match self.mode {
            Mode::Off if self.all_in_operation() => self.mode = Mode::Ready,
            Mode::NormalStop if sight.standstill => {
                self.drums_held = true;
                self.mode = if self.tension.is_on() {
                    Mode::Stall
                } else {
                    Mode::Ready
                };
                if self.fault == Fault::HeartbeatLost {
                    self.switch_off();
                }
            }
            Mode::EmergencyStop | Mode::CoastStop if sight.standstill => self.switch_off(),
            // what follows has a gentler jerk, which could not end the ramp in time
            Mode::WebBreakStop if sight.standstill && sight.drive.a_ref == R::ZERO => {
                self.mode = Mode::Ready;
            }
            _ => {}
        }
    }

    fn ask(&self, sight: &Sight<R>) -> DriveCommand<R> {
        use UnwindControl::{Off, Speed, TakeUp, Tension};
        let (c, commands) = (&self.c, sight.commands);
        let minutes = R::of(1.0 / 60.0);
        let percent = R::of(0.01);
        let get = |signal| commands.get::<R>(signal);
        let stall = get(&image::STALL_SET) * c.width;
        let tension = get(&image::TENSION_SET) * c.width;
        let pull = if self.tension.is_on() {
            Tension
        } else {
            TakeUp
        };
        let held = self.drums_held || self.commanded(sight, command::DRUM_BRAKES);
        let drums = |on| Brakes {
            uw: false,
            rd: on,
            fd: on,
        };
        let normal = (get(&image::ACCEL_SET), get(&image::JERK_SET));
        let emergency = (c.emergency, c.emergency_jerk);
        let run = (get(&image::V_SET) * minutes).min(c.max_speed);
        let crawl = get(&image::V_THREAD_SET) * minutes;
        let word = self.sections.rd.word();
        let moving = |v| {
            let enabled = stw1::ENABLE_RAMP | stw1::ENABLE_SETPOINT;
            if word & enabled == enabled {
                v
            } else {
                R::ZERO
            }
        };

        //                     unwind  drums  speed          limits     tension  brakes
        let (unwind, on, v, (acceleration, jerk), t, brakes) = match self.mode {
            Mode::Off => (Off, false, R::ZERO, normal, R::ZERO, Brakes::all(true)),
            Mode::Ready => {
                let brakes = Brakes {
                    uw: true,
                    ..drums(held)
                };
                (Off, true, R::ZERO, normal, R::ZERO, brakes)
            }
            Mode::Thread => (pull, true, moving(crawl), normal, stall, drums(false)),
            Mode::Stall => (pull, true, R::ZERO, normal, stall, drums(held)),
            Mode::Run => (pull, true, moving(run), normal, tension, drums(false)),
            Mode::NormalStop => {
                let t = sight.drive.tension_ref;
                (pull, true, R::ZERO, normal, t, drums(false))
            }
            Mode::EmergencyStop => {
                let t = sight.drive.tension_ref;
                (pull, true, R::ZERO, emergency, t, drums(false))
            }
            Mode::CoastStop => (Off, false, R::ZERO, normal, R::ZERO, drums(false)),
            Mode::WebBreakStop => {
                let brakes = Brakes {
                    uw: true,
                    ..drums(false)
                };
                (Speed, true, R::ZERO, emergency, R::ZERO, brakes)
            }
        };
        let drum_limit = get(&image::TORQUE_LIMIT_DRUMS) * percent;
        DriveCommand {
            unwind,
            drums: on,
            v_target: v,
            acceleration,
            jerk,
            freeze_ramp: word & stw1::UNFREEZE_RAMP == 0 && self.mode == Mode::Run,
            tension: t,
            preset: self.one_shot.preset,
            freeze_diameter: self.mode == Mode::WebBreakStop,
            brake_assist: self.mode == Mode::EmergencyStop,
            torque_limit: BySection {
                uw: get(&image::TORQUE_LIMIT_UW) * percent,
                rd: drum_limit,
                fd: drum_limit,
                rr: drum_limit,
            },
            front_share_trim: get(&image::FRONT_SHARE_TRIM) * percent,
            brakes,
            handling: self.one_shot.handling,
            ..DriveCommand::default()
        }
    }
}

type Request<R> = fn(&mut Logic<R>, &Sight<R>) -> Result<(), Refusal>;

fn control_words(commands: &Commands) -> BySection<u16> {
    BySection {
        uw: commands.word(&image::STW1_UW),
        rd: commands.word(&image::STW1_RD),
        fd: commands.word(&image::STW1_FD),
        rr: commands.word(&image::STW1_RR),
    }
}
