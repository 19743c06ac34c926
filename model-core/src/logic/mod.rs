//! The drive logic: in which mode the winder is, what it asks of the regulators, and why it refuses.
//!
//! Not here: what an auto-tune does to its loop (the regulators'). The logic runs once a drive cycle, in the
//! background, on what the PLC had written by then.
//!
//! | Part | What |
//! |---|---|
//! | [`table`] | which cause leads from which mode to which, and what a request needs |
//! | [`faults`] | which faults there are, how they are found, how the winder stops for them |
//! | `section` | the PROFIdrive state machine of each drive |
//! | `ask` | what each mode asks of the regulators |
//! | `report` | what the PLC is told |
//! | `bus` | what the drive bus delays |
//!
//! A request (thread, stall, run, jog, auto-tune) starts with a rising edge of its bit and lasts as long as the bit
//! stands, so that nothing starts by itself when a condition comes true later. Stops are demanded by the sections'
//! control words; the strongest of all sections counts. Where bits contradict each other, the safer one counts, and the
//! refusal says so.

mod ask;
mod bus;
mod detection;
pub mod faults;
mod report;
mod section;
pub mod table;
mod words;

pub use section::{Demand, Section, State};
pub use words::{
    COMMAND_2_BITS, COMMAND_BITS, DRIVE_FAULT_BITS, Fault, LOOPS, MACHINE_FAULT_BITS, Mode,
    Refusal, SENSOR_FAULT_BITS, STATUS_BITS, WARNING_BITS, WINDING_BITS, command, command_2,
    inject, status, warning,
};

use crate::drive::motor::Motors;
use crate::drive::table::Table;
use crate::exchange::{
    Autotune, Brakes, BySection, DriveCommand, DriveStatus, Handling, Loop, Measurements, Rider,
    TuneStep,
};
use crate::image::{self, Commands, Feedback};
use crate::machine::{MAX_RIDER_LOADS, Machine};
use crate::profidrive::stw1;
use crate::real::Real;
use bus::Bus;
use detection::{Heartbeat, Persistent};
use faults::{Faults, Look, Patience, Reaction};
use table::{Cause, Condition, Outcome};

/// Drive cycles in a second.
const CYCLES_PER_S: u16 = 100;
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
/// The unwind's speed does not fit when it is off by more than this share of the web's: no preset in use is.
const DEVIATION: f64 = 0.15;
/// A brake may differ from its command by this time beyond its delay, s.
const BRAKE_PATIENCE_S: f64 = 0.25;
/// Slower than this no pulse within a cycle is nothing unusual, m/s.
const PULSES_EXPECTED: f64 = 0.1;
/// Without web the load cells may show this share of the usual tension.
const LOAD_CELL_ZERO: f64 = 0.1;
/// Standstill, m/s.
const ZERO_SPEED: f64 = 0.01;
/// Tolerance of the web speed to its reference and set-point, of the highest speed.
const SPEED_TOLERANCE: f64 = 0.005;
/// Jerk of an emergency or web-break stop, m/s³.
const EMERGENCY_JERK: f64 = 2.0;

/// From asking the regulators for something to their status of it, drive cycles.
const ASKED_CYCLES: u16 = 2;

/// Requests that are done at once.
const ACTS: [(u16, Cause); 6] = [
    (command::PRESET_ACCEPT, Cause::PresetAccept),
    (command::NEW_CORE, Cause::NewCore),
    (command::NEW_PARENT_ROLL, Cause::NewParentRoll),
    (command::WEB_REMOVED, Cause::WebRemoved),
    (command::WEB_THREADED, Cause::WebThreaded),
    (command::DRUM_BRAKES, Cause::DrumBrakes),
];

/// Requests that cannot be meant together; the first one is done.
const CONTRADICTIONS: [(u16, u16); 2] = [
    (command::NEW_PARENT_ROLL, command::PRESET_ACCEPT),
    (command::WEB_REMOVED, command::WEB_THREADED),
];

/// The drive logic.
#[derive(Clone, Debug)]
pub struct Logic<R> {
    c: Coefficients<R>,
    patience: Patience,
    bus: Bus,
    mode: Mode,
    /// The mode has changed in this cycle.
    moved: bool,
    sections: BySection<Section>,
    refusal: Refusal,
    faults: Faults,
    motors: Motors<R>,
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
    /// Direction of jogging: 1 forward, −1 backward.
    jog: i8,
    /// It was commanded in the last cycle.
    jogged: bool,
    /// The loop that auto-tune tunes, and the cycles since it was asked for.
    tuned: Loop,
    tuning_cycles: u16,
    /// Speed at which the frozen ramp comes to rest.
    frozen: Option<R>,
    /// Brakes as they were asked for in the last cycle.
    asked: Brakes<bool>,
    /// The rider roll as it was asked for in the last cycle: what has been set by now.
    rider: Rider<R>,
    /// What the answer tells of auto-tune.
    told: Autotune<R>,
    one_shot: OneShot<R>,
    answer: Feedback,
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
    r_fd: R,
    spool: R,
    full: R,
    max_speed: R,
    emergency: R,
    emergency_jerk: R,
    zero_speed: R,
    speed_tolerance: R,
    web_break_speed: R,
    deviation: R,
    pulses_expected: R,
    detected: R,
    lost: R,
    load_cell_zero: R,
    /// Rider roll's load per width over the diameter, N/m.
    rider_load: Table<R, MAX_RIDER_LOADS>,
}

/// What the logic sees of the machine and the PLC in one cycle.
struct Sight<'a, R> {
    commands: &'a Commands,
    m: &'a Measurements<R>,
    drive: &'a DriveStatus<R>,
    standstill: bool,
    /// Direction of jogging that is commanded; none where both are.
    jog: Option<i8>,
}

impl<R: Real> Logic<R> {
    /// For a valid machine: drives off, web not threaded.
    pub fn new(machine: &Machine) -> Self {
        let roll = &machine.parent_roll;
        let circumference = core::f64::consts::TAU * machine.rear_drum.radius_m;
        let max_speed = machine.operation.max_speed_m_s;
        let tension = machine.operation.tension_n_m * machine.web.width_m;
        let cycles = |seconds: f64| (seconds * f64::from(CYCLES_PER_S)) as u16;
        let r = R::of;
        Self {
            c: Coefficients {
                width: r(machine.web.width_m),
                metres_per_pulse: circumference / machine.encoder_pulses,
                r_fd: r(machine.front_drum.radius_m),
                spool: r(roll.spool_radius_m),
                full: r(roll.full_radius_m),
                max_speed: r(max_speed),
                emergency: r(machine.operation.emergency_m_s2),
                emergency_jerk: r(EMERGENCY_JERK),
                zero_speed: r(ZERO_SPEED),
                speed_tolerance: r(SPEED_TOLERANCE * max_speed),
                web_break_speed: r(WEB_BREAK_SPEED),
                deviation: r(DEVIATION),
                pulses_expected: r(PULSES_EXPECTED),
                detected: r(TENSION_DETECTED),
                lost: r(WEB_BREAK),
                load_cell_zero: r(LOAD_CELL_ZERO * tension),
                rider_load: Table::new(
                    machine
                        .nips
                        .rider_load
                        .iter()
                        .map(|point| (point.diameter_m, point.load_n_m)),
                ),
            },
            patience: Patience {
                brake: cycles(machine.brakes.delay_s + BRAKE_PATIENCE_S),
                deviation: WEB_BREAK_CYCLES,
            },
            bus: Bus::default(),
            mode: Mode::default(),
            moved: false,
            sections: BySection::default(),
            refusal: Refusal::default(),
            faults: Faults::default(),
            motors: Motors::new(machine, 1.0 / f64::from(CYCLES_PER_S)),
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
            jog: 0,
            jogged: false,
            tuned: Loop::DrumSpeed,
            tuning_cycles: 0,
            frozen: None,
            asked: Brakes::default(),
            rider: Rider::default(),
            told: Autotune::default(),
            one_shot: OneShot::default(),
            answer: Feedback::default(),
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
        let commands = &self.bus.receive(commands);
        (self.moved, self.one_shot) = (false, OneShot::default());
        self.motors.heat(&drive.torque, &m.omega);
        self.switch_sections(commands);
        let sight = Sight {
            commands,
            m,
            drive,
            standstill: self.standstill(m, drive),
            jog: self.jog_command(commands),
        };
        self.acknowledge(&sight);
        self.detect(&sight);
        self.stop_for_faults();
        self.obey_stops(&sight);
        self.obey_requests(&sight);
        self.withdraw(&sight);
        self.go_on(&sight);
        self.freeze_ramp(&sight);
        self.last_command = commands.word(&image::WINDER_COMMAND);
        self.jogged = sight.jog != Some(0);
        let mut answer = self.answer;
        self.report(&sight, &mut answer);
        self.answer = answer;
        self.bus.send(&answer, feedback);
        let command = self.ask(&sight);
        (self.asked, self.rider) = (command.brakes, command.rider);
        command
    }

    /// Nothing turns, as far as the drives can tell.
    fn standstill(&self, m: &Measurements<R>, drive: &DriveStatus<R>) -> bool {
        let zero = self.c.zero_speed;
        let speeds = [drive.v_ref, drive.v, drive.v_uw, m.omega.fd * self.c.r_fd];
        speeds.into_iter().all(|v| v.is_near(R::ZERO, zero))
    }

    fn rising(&self, sight: &Sight<R>, bit: u16) -> bool {
        sight.commands.word(&image::WINDER_COMMAND) & !self.last_command & bit != 0
    }

    fn commanded(&self, sight: &Sight<R>, bit: u16) -> bool {
        sight.commands.word(&image::WINDER_COMMAND) & bit != 0
    }

    /// Jogging is commanded by the winder's word or by the unwind's own.
    fn jog_command(&self, commands: &Commands) -> Option<i8> {
        let word = commands.word(&image::WINDER_COMMAND);
        let direction = |bit, sign| if word & bit != 0 { sign } else { 0 };
        let forward = direction(command::JOG_FORWARD, 1);
        let backward = direction(command::JOG_BACKWARD, -1);
        match (forward, backward, self.sections.uw.jog()?) {
            (1, -1, _) | (1, _, -1) | (_, -1, 1) => None,
            (a, b, c) => Some((a + b + c).signum()),
        }
    }

    fn all_in_operation(&self) -> bool {
        let states = self.sections.map(|s| s.state()).into_array();
        states.iter().all(|s| *s == State::Operation)
    }

    /// Takes a cause to its outcome. Once the mode has changed, nothing changes it again in the same cycle.
    fn take(&mut self, cause: Cause) {
        match cause.outcome(self.mode) {
            Outcome::Go(mode) if !self.moved => self.enter(mode),
            _ => {}
        }
    }

    fn enter(&mut self, mode: Mode) {
        match (self.mode, mode) {
            // the unwind that was turned alone may be turned again
            (Mode::UnwindManeuver, Mode::Off) if self.sound_and_alone() => {}
            (_, Mode::Off) => self.switch_off(),
            // the drums are held where a stop has ended, and free where a request begins
            (Mode::NormalStop, Mode::Stall | Mode::Ready) => self.drums_held = true,
            (Mode::Ready, Mode::Stall) => self.drums_held = false,
            (_, Mode::WebBreakStop) => {
                self.web_threaded = false;
                self.tension.reset();
            }
            _ => {}
        }
        (self.mode, self.moved) = (mode, true);
    }

    fn sound_and_alone(&self) -> bool {
        self.faults.latched().reaction().is_none() && !self.all_in_operation()
    }

    fn switch_off(&mut self) {
        let faulty = self.faults.latched().sections();
        self.sections = self.sections.zip(faulty).map(|(mut section, fault)| {
            section.switch_off(fault);
            section
        });
        self.tension.reset();
    }

    /// The simulator has restarted by itself: drives off, brakes closed, and nothing starts before that is acknowledged.
    pub fn restarted(&mut self) {
        self.faults.latch(Fault::Restarted);
    }

    fn acknowledge(&mut self, sight: &Sight<R>) {
        let words = control_words(sight.commands).into_array();
        let by_section = words.iter().any(|w| w & stw1::ACKNOWLEDGE != 0);
        let now = by_section || self.commanded(sight, command::ACKNOWLEDGE);
        if now && !self.last_acknowledge && !self.faults.latched().is_empty() {
            if !sight.standstill {
                self.refusal = Refusal::NotAtStandstill;
            } else if !self.faults.acknowledge() {
                self.refusal = Refusal::CauseStands;
            }
        }
        self.last_acknowledge = now;
    }

    /// The sections' state machines. What a fault has taken out leaves operation at once; while the winder is off,
    /// so does a section that no longer wants it.
    fn switch_sections(&mut self, commands: &Commands) {
        let latched = self.faults.latched();
        let (faulty, tripped) = (latched.sections(), latched.tripped());
        let off = self.mode == Mode::Off;
        let inputs = control_words(commands).zip(faulty.zip(tripped));
        self.sections = self
            .sections
            .zip(inputs)
            .map(|(mut section, (word, (fault, tripped)))| {
                section.step(word, fault);
                if tripped {
                    section.trip();
                } else if off && section.demand() != Demand::Operate {
                    section.switch_off(fault);
                }
                section
            });
    }

    fn detect(&mut self, sight: &Sight<R>) {
        let (c, m) = (&self.c, sight.m);
        let stall = sight.commands.get::<R>(&image::STALL_SET) * c.width;
        // a break at crawl is found in the cycle in which tension would no longer be detected
        let held = self.holds_tension();
        self.tension
            .step(m.tension > c.detected * stall, TENSION_CYCLES);
        let look = self.look(sight);
        self.faults.watch(&look, &self.patience);

        let drive = sight.drive;
        let lost = held && drive.tension_at_once < c.lost * drive.tension_ref;
        let patience = if sight.drive.v.abs() > c.web_break_speed {
            WEB_BREAK_CYCLES
        } else {
            TENSION_CYCLES
        };
        if !lost {
            self.tension_lost.reset();
        } else if self.tension_lost.step(lost, patience) {
            self.faults.latch(Fault::WebBreak);
            self.take(Cause::WebBreak);
        }

        let count = sight.commands.word(&image::HEARTBEAT_PLC);
        let lost = self.faults.latched().has(Fault::HeartbeatLost);
        let watched = self.mode != Mode::Off && !lost;
        let time: R = sight.commands.get(&image::HEARTBEAT_TIME);
        let limit = (time.to_f32() * (1e-3 * f32::from(CYCLES_PER_S))) as u16;
        if self.heartbeat_plc.step(count, watched, limit) {
            self.faults.latch(Fault::HeartbeatLost);
        }
    }

    /// What the watch on faults gets to see.
    fn look(&self, sight: &Sight<R>) -> Look {
        let (c, m, d) = (&self.c, sight.m, sight.drive);
        let helped = self.mode == Mode::EmergencyStop;
        let holds = self.holds_tension();
        let turns = |v: R| v.abs() > c.pulses_expected;
        let jogs = self.mode == Mode::UnwindManeuver && turns(d.v_ref);
        let fast = d.v.abs() > c.web_break_speed;
        Look {
            injected: sight.commands.word(&image::FAULT_DRIVES),
            brake_differs: Brakes {
                uw: m.brakes.uw != self.asked.uw && !helped,
                rd: m.brakes.rd != self.asked.rd,
                fd: m.brakes.fd != self.asked.fd,
            },
            silent_uw: m.omega.uw == R::ZERO && !m.brakes.uw && (jogs || holds && turns(d.v)),
            silent_rd: m.omega.rd == R::ZERO && turns(m.omega.fd * c.r_fd),
            overloaded: self.motors.exhausted(),
            unwind_deviates: holds && fast && (d.v_uw - d.v).abs() > c.deviation * d.v.abs(),
            load_cell_zero: !self.web_threaded && m.tension.abs() > c.load_cell_zero,
        }
    }

    /// The unwind controls tension, and there is some.
    fn holds_tension(&self) -> bool {
        use Mode::*;
        let mode = matches!(
            self.mode,
            Thread | Stall | Run | NormalStop | EmergencyStop | AutoTune
        );
        mode && self.web_threaded && self.tension.is_on() && !self.faults.latched().tripped().uw
    }

    fn stop_for_faults(&mut self) {
        match self.faults.latched().reaction() {
            Some(Reaction::BrakeStop) => self.take(Cause::DrumsLost),
            Some(Reaction::QuickStop) => self.take(Cause::DriveLost),
            Some(Reaction::NormalStop) => self.take(Cause::StopByFault),
            Some(Reaction::WebBreakStop) | None => {}
        }
    }

    /// OFF2, OFF3 and OFF1 of any section.
    fn obey_stops(&mut self, sight: &Sight<R>) {
        let demands = self.sections.map(|s| s.demand()).into_array();
        // the unwind is maneuvered alone: the others need not be on
        let demands = match self.mode {
            Mode::UnwindManeuver => &demands[..1],
            _ => &demands[..],
        };
        match demands.iter().max() {
            Some(Demand::Coast) if sight.standstill => self.take(Cause::CoastStanding),
            Some(Demand::Coast) => self.take(Cause::Coast),
            Some(Demand::QuickStop) => self.take(Cause::QuickStop),
            Some(Demand::SwitchOff) => self.take(Cause::SwitchOff),
            _ => {}
        }
    }

    /// A request that is taken back ends its mode.
    fn withdraw(&mut self, sight: &Sight<R>) {
        let gone = |bit| !self.commanded(sight, bit);
        let gone = match self.mode {
            Mode::Thread => gone(command::THREAD),
            Mode::Run => gone(command::RUN),
            Mode::AutoTune => gone(command::AUTOTUNE),
            // it may have come here by a stop, without a request
            Mode::Stall => gone(command::STALL) && self.last_command & command::STALL != 0,
            _ => false,
        };
        if gone {
            self.take(Cause::Withdrawn);
        }
    }

    fn obey_requests(&mut self, sight: &Sight<R>) {
        let risen = |bit| self.rising(sight, bit);
        let maneuvers = self.mode == Mode::UnwindManeuver;
        let jog = matches!(sight.jog, Some(1 | -1)) && !self.jogged && !maneuvers;
        // the slowest first: of several in one cycle it counts
        let modes = [
            jog.then_some(Cause::Jog),
            risen(command::STALL).then_some(Cause::Stall),
            risen(command::THREAD).then_some(Cause::Thread),
            risen(command::AUTOTUNE).then(|| self.tune_cause(sight)),
            risen(command::RUN).then_some(Cause::Run),
        ];
        let mut modes = modes.into_iter().flatten();
        let mode = modes.next();
        let mut contradictory = modes.next().is_some() || sight.jog.is_none();
        let mut acts = ACTS.map(|(bit, cause)| risen(bit).then_some(cause));
        for (first, second) in CONTRADICTIONS {
            if risen(first) && risen(second) {
                contradictory = true;
                let dropped = ACTS.iter().position(|(bit, _)| *bit == second);
                if let Some(act) = dropped.and_then(|i| acts.get_mut(i)) {
                    *act = None;
                }
            }
        }
        self.jog = sight.jog.unwrap_or(0);
        let requests = acts.into_iter().chain([mode]).flatten();
        let mut any = false;
        for cause in requests {
            if !any {
                (any, self.refusal) = (true, Refusal::None);
            }
            if let Err(refusal) = self.request(cause, sight) {
                self.refusal = refusal;
            }
        }
        if contradictory && self.refusal == Refusal::None {
            self.refusal = Refusal::Contradictory;
        }
    }

    fn tune_cause(&self, sight: &Sight<R>) -> Cause {
        match loop_to_tune(sight.commands) {
            Loop::DrumSpeed | Loop::UnwindSpeed => Cause::TuneSpeed,
            Loop::Tension => Cause::TuneTension,
        }
    }

    /// What a request needs first, then its mode, then what it needs besides; then it is done.
    fn request(&mut self, cause: Cause, sight: &Sight<R>) -> Result<(), Refusal> {
        let meets = |conditions: &[Condition]| {
            let missing = conditions.iter().find(|c| !self.meets(**c, sight));
            missing.map_or(Ok(()), |condition| Err(condition.refusal()))
        };
        meets(cause.needs())?;
        match cause.outcome(self.mode) {
            Outcome::Refuse(refusal) => return Err(refusal),
            Outcome::Go(_) if self.moved => return Err(Refusal::WrongMode),
            Outcome::Go(_) | Outcome::Stay => {}
        }
        meets(cause.needs_then())?;
        self.act(cause, sight)?;
        self.take(cause);
        Ok(())
    }

    fn meets(&self, condition: Condition, sight: &Sight<R>) -> bool {
        match condition {
            Condition::NoFault => self.faults.latched().is_empty(),
            Condition::DrivesOn => self.all_in_operation(),
            Condition::UnwindOn => self.sections.uw.state() == State::Operation,
            Condition::WebThreaded => self.web_threaded,
            Condition::NoWeb => !self.web_threaded,
            Condition::Preset => self.preset_taken,
            Condition::Tension => self.tension.is_on(),
            Condition::Standstill => sight.standstill,
        }
    }

    /// What a request does beside its change of mode.
    fn act(&mut self, cause: Cause, sight: &Sight<R>) -> Result<(), Refusal> {
        let handling = &mut self.one_shot.handling;
        match cause {
            Cause::PresetAccept => return self.accept_preset(sight),
            Cause::NewCore => {
                handling.new_core = true;
                self.pulses_at_core = sight.m.pulses_rd;
            }
            Cause::NewParentRoll => {
                handling.new_parent_roll = true;
                self.preset_taken = false;
            }
            Cause::WebRemoved => {
                handling.remove_web = true;
                self.web_threaded = false;
                self.tension.reset();
            }
            Cause::WebThreaded => {
                handling.thread_web = true;
                self.web_threaded = true;
            }
            Cause::TuneSpeed | Cause::TuneTension => {
                (self.tuned, self.tuning_cycles) = (loop_to_tune(sight.commands), 0);
            }
            _ => {}
        }
        Ok(())
    }

    fn accept_preset(&mut self, sight: &Sight<R>) -> Result<(), Refusal> {
        let second = self.commanded(sight, command::PRESET_2);
        let diameter: R = sight.commands.get(if second {
            &image::D_PRESET_2_UW
        } else {
            &image::D_PRESET_UW
        });
        let r = diameter * R::of(0.5e-3);
        let count = R::of(0.5e-4);
        if r < self.c.spool - count || r > self.c.full + count {
            return Err(Refusal::PresetOutOfRange);
        }
        let error: R = sight.commands.get(&image::FAULT_PRESET);
        self.one_shot.preset = Some(r + r * error * R::of(0.01));
        self.preset_taken = true;
        Ok(())
    }

    /// Auto-tune ends when the regulators say so, of the tune that was asked for and not of the last one.
    fn follow_tuning(&mut self, sight: &Sight<R>) {
        self.tuning_cycles = self.tuning_cycles.saturating_add(1);
        let ended = matches!(
            sight.drive.autotune.step,
            TuneStep::Done | TuneStep::Aborted
        );
        if ended && self.tuning_cycles > ASKED_CYCLES {
            self.take(Cause::TuneEnds);
        }
    }

    /// While the ramp generator is frozen the speed stays where its acceleration can be rounded off: v + a·|a|/2j.
    fn freeze_ramp(&mut self, sight: &Sight<R>) {
        let frozen = self.sections.rd.word() & stw1::UNFREEZE_RAMP == 0;
        if !frozen || !matches!(self.mode, Mode::Thread | Mode::Run) {
            self.frozen = None;
        } else if self.frozen.is_none() {
            let (v, a) = (sight.drive.v_ref, sight.drive.a_ref);
            let jerk: R = sight.commands.get(&image::JERK_SET);
            let rest = v + a * a.abs() / (jerk + jerk);
            self.frozen = Some(rest.clamp(R::ZERO, self.c.max_speed));
        }
    }

    /// Modes that end by themselves.
    fn go_on(&mut self, sight: &Sight<R>) {
        if self.mode == Mode::AutoTune {
            self.follow_tuning(sight);
        }
        let ends = match self.mode {
            // what follows has a gentler jerk, which could not end the ramp in time
            Mode::WebBreakStop => sight.drive.a_ref == R::ZERO,
            Mode::UnwindManeuver => self.jog == 0,
            _ => true,
        };
        if self.all_in_operation() {
            self.take(Cause::DrivesOn);
        }
        if !ends || !sight.standstill {
            return;
        }
        let down = self.faults.latched().reaction().is_some() || !self.all_in_operation();
        self.take(if down {
            Cause::StandsDown
        } else if self.tension.is_on() {
            Cause::StandsTight
        } else {
            Cause::StandsSlack
        });
    }
}

fn loop_to_tune(commands: &Commands) -> Loop {
    match commands.word(&image::AUTOTUNE_LOOP) {
        0 => Loop::DrumSpeed,
        1 => Loop::UnwindSpeed,
        _ => Loop::Tension,
    }
}

fn control_words(commands: &Commands) -> BySection<u16> {
    BySection {
        uw: commands.word(&image::STW1_UW),
        rd: commands.word(&image::STW1_RD),
        fd: commands.word(&image::STW1_FD),
        rr: commands.word(&image::STW1_RR),
    }
}
