//! A small winder PLC: what an operator and a winder's control program do to wind one set.
//!
//! Not here: taper, rider load, splices, length counters with slow-down points, recipes in a database. One set
//! from a new core and a full parent roll, stopped so that the roll ends at its diameter.
//!
//! [`Plc`] is the program: feedback in, commands out, once a cycle; it knows no clock but the simulator's own
//! ticks, so it works at any pace. [`wind`] runs it over Modbus TCP.

use std::f64::consts::PI;
use std::fmt;
use std::net::SocketAddr;
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Result, bail};
use model_core::desk::{ALARM_BITS, STATES};
use model_core::drive::DRIVE_PERIOD_MS;
use model_core::image::{self, Commands, Feedback, Image, Kind, Signal};
use model_core::logic::{Fault, Mode, Refusal, command, status};
use model_core::machine::Machine;
use model_core::plant::PLANT_PERIOD_MS;
use model_core::profidrive::{stw1, zsw1};
use model_core::simulator::Simulator;

use crate::interrupt;
use crate::link::Link;

/// Time of a program cycle, s of simulated time; usual for a winder PLC.
pub const CYCLE_S: f64 = 0.040;
/// A step stands at least this long, s: its commands have arrived and their effect is in the feedback.
const STEP_S: f64 = 0.2;
/// A refusal that stands longer than this belongs to the present step, s.
const REFUSAL_S: f64 = 0.5;
/// The tension has settled when it has stayed for this long, s, ...
const SETTLED_S: f64 = 2.0;
/// ... this near to stall tension, of it.
const SETTLED_BAND: f64 = 0.05;
/// Without a tick for this long the simulator hangs.
const STANDSTILL_OF_TICKS: Duration = Duration::from_secs(5);

/// What to wind.
#[derive(Clone, Debug)]
pub struct Recipe {
    /// The machine, as the PLC's own parameters have it.
    pub machine: Machine,
    /// Diameter of the finished shipping roll, m.
    pub diameter_m: f64,
    /// Speed, m/s.
    pub speed_m_s: f64,
}

impl Recipe {
    /// Length of web between two diameters of the shipping roll, m: π·(D² − d²)/(4·z).
    pub fn length_m(&self, from_m: f64, to_m: f64) -> f64 {
        PI * (to_m * to_m - from_m * from_m) / (4.0 * self.machine.web.caliper_m)
    }

    /// Length of the whole set, m.
    pub fn set_length_m(&self) -> f64 {
        self.length_m(
            2.0 * self.machine.shipping_roll.core_radius_m,
            self.diameter_m,
        )
    }

    /// The ramp of the machine.
    pub fn ramp(&self) -> Ramp {
        Ramp {
            acceleration_m_s2: self.machine.operation.acceleration_m_s2,
            jerk_m_s3: self.machine.operation.jerk_m_s3,
        }
    }

    /// About how long the set runs, s.
    pub fn duration_s(&self) -> f64 {
        self.set_length_m() / self.speed_m_s + self.ramp().stop(self.speed_m_s, 0.0).time_s
    }

    fn commands(&self) -> Commands {
        let mut commands = Commands::of(&self.machine);
        commands.set(&image::V_SET, self.speed_m_s * 60.0);
        commands
    }
}

/// The limits of an S-curve.
#[derive(Clone, Copy, Debug)]
pub struct Ramp {
    /// Acceleration and deceleration, m/s².
    pub acceleration_m_s2: f64,
    /// Jerk, m/s³.
    pub jerk_m_s3: f64,
}

/// A stop along an S-curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stop {
    /// Web that runs until standstill, m.
    pub distance_m: f64,
    /// Time until standstill, s.
    pub time_s: f64,
}

impl Ramp {
    /// The stop from speed `v` [m/s] while still accelerating with `a` ≥ 0 [m/s²].
    ///
    /// The acceleration first goes to zero: t₀ = a/j, v₀ = v + a²/2j, s₀ = v·t₀ + a³/3j². Then the speed
    /// falls, symmetrically in time, so that the mean speed is v₀/2: T = v₀/a_max + a_max/j with a stretch of
    /// constant deceleration, T = 2·√(v₀/j) without.
    pub fn stop(&self, v: f64, a: f64) -> Stop {
        let (a_max, j) = (self.acceleration_m_s2, self.jerk_m_s3);
        let t_0 = a / j;
        let v_0 = v + a * a / (2.0 * j);
        let s_0 = v * t_0 + a.powi(3) / (3.0 * j * j);
        let fall = if v_0 >= a_max * a_max / j {
            v_0 / a_max + a_max / j
        } else {
            2.0 * (v_0 / j).sqrt()
        };
        Stop {
            distance_m: s_0 + 0.5 * v_0 * fall,
            time_s: t_0 + fall,
        }
    }
}

/// A step of the set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Old faults are acknowledged.
    Acknowledge,
    /// The operator puts in a new core and a full parent roll.
    NewRolls,
    /// The drive takes over the parent roll's diameter.
    Preset,
    /// The drives become ready to switch on.
    MakeReady,
    /// The drives are switched on.
    SwitchOn,
    /// The operator leads the web through the machine.
    LeadWeb,
    /// Slack is taken up at thread speed.
    Thread,
    /// Stall tension builds up.
    Tension,
    /// The roll grows.
    Run,
    /// The machine stops.
    Stop,
    /// The web rests in stall tension.
    Rest,
    /// The drives are switched off.
    SwitchOff,
    /// The set is wound.
    Done,
}

impl Step {
    /// What happens, for the operator.
    pub fn name(self) -> &'static str {
        match self {
            Step::Acknowledge => "acknowledge faults",
            Step::NewRolls => "new rolls",
            Step::Preset => "diameter preset",
            Step::MakeReady => "make drives ready",
            Step::SwitchOn => "switch drives on",
            Step::LeadWeb => "lead web through",
            Step::Thread => "thread",
            Step::Tension => "build up tension",
            Step::Run => "run",
            Step::Stop => "stop",
            Step::Rest => "stall tension",
            Step::SwitchOff => "switch drives off",
            Step::Done => "set wound",
        }
    }

    fn next(self) -> Self {
        match self {
            Step::Acknowledge => Step::NewRolls,
            Step::NewRolls => Step::Preset,
            Step::Preset => Step::MakeReady,
            Step::MakeReady => Step::SwitchOn,
            Step::SwitchOn => Step::LeadWeb,
            Step::LeadWeb => Step::Thread,
            Step::Thread => Step::Tension,
            Step::Tension => Step::Run,
            Step::Run => Step::Stop,
            Step::Stop => Step::Rest,
            Step::Rest => Step::SwitchOff,
            Step::SwitchOff | Step::Done => Step::Done,
        }
    }

    /// The winder's command word of the step. Each bit that acts on its rising edge stands in one step only.
    fn winder_command(self) -> u16 {
        match self {
            Step::Acknowledge => command::ACKNOWLEDGE,
            Step::NewRolls => command::NEW_CORE | command::NEW_PARENT_ROLL,
            Step::Preset => command::PRESET_ACCEPT,
            Step::LeadWeb => command::WEB_THREADED,
            Step::Thread | Step::Tension => command::THREAD,
            Step::Run => command::RUN,
            _ => 0,
        }
    }

    /// Control word 1 of every drive in the step.
    fn stw1(self) -> u16 {
        match self {
            Step::Acknowledge => stw1::READY | stw1::ACKNOWLEDGE,
            Step::NewRolls | Step::Preset | Step::MakeReady => stw1::READY,
            Step::SwitchOff | Step::Done => stw1::READY,
            _ => stw1::RUN,
        }
    }
}

/// The feedback of one cycle.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// Simulated time since the program started, s.
    pub t_s: f64,
    /// The program's step.
    pub step: Step,
    /// What the simulator said.
    pub feedback: Feedback,
}

impl Sample {
    /// The value of a feedback signal in its unit.
    pub fn value(&self, signal: &Signal) -> f64 {
        self.feedback.get(signal)
    }

    /// The operating mode, where the code is known.
    pub fn mode(&self) -> Option<Mode> {
        code(Mode::ALL, self.feedback.word(&image::MODE))
    }
}

fn code<T: Copy>(all: &[T], word: u16) -> Option<T> {
    all.get(usize::from(word)).copied()
}

/// Why the program gave up.
#[derive(Clone, Debug)]
pub struct Trouble {
    /// What is wrong.
    pub what: String,
    /// Since when it was in its step, s.
    pub since_s: f64,
    /// What it saw last.
    pub sample: Box<Sample>,
}

impl fmt::Display for Trouble {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let s = &self.sample;
        write!(
            f,
            "{} (step \"{}\" after {:.1} s, {:.1} s into the set; ",
            self.what,
            s.step.name(),
            s.t_s - self.since_s,
            s.t_s
        )?;
        for signal in [&image::MODE, &image::REFUSAL, &image::FAULT] {
            let word = s.feedback.word(signal);
            let text = match signal.kind {
                Kind::Code(texts) => code(texts, word).unwrap_or("unknown code"),
                _ => "",
            };
            write!(f, "{} {word}: {text}; ", signal.name)?;
        }
        for signal in image::ZSW1 {
            write!(f, "{} {:04X} hex, ", signal.name, s.feedback.word(signal))?;
        }
        write!(f, "{}", image::WINDER_STATUS.name)?;
        if let Kind::Bits(bits) = image::WINDER_STATUS.kind {
            let word = s.feedback.word(&image::WINDER_STATUS);
            for bit in bits.iter().filter(|bit| word >> bit.number & 1 == 1) {
                write!(f, " {}", bit.name)?;
            }
        }
        for signal in [
            &image::V_WEB,
            &image::TENSION,
            &image::TENSION_REF,
            &image::D_UW,
            &image::D_WU,
        ] {
            write!(
                f,
                ", {} {:.1} {}",
                signal.name,
                s.value(signal),
                signal.unit
            )?;
        }
        f.write_str(")")
    }
}

impl std::error::Error for Trouble {}

/// The program.
#[derive(Clone, Debug)]
pub struct Plc {
    recipe: Recipe,
    commands: Commands,
    step: Step,
    since_s: f64,
    settled_since_s: Option<f64>,
    first_tick: Option<u32>,
}

impl Plc {
    /// A program that has not begun.
    pub fn new(recipe: Recipe) -> Self {
        Self {
            commands: recipe.commands(),
            recipe,
            step: Step::Acknowledge,
            since_s: 0.0,
            settled_since_s: None,
            first_tick: None,
        }
    }

    /// The present step.
    pub fn step(&self) -> Step {
        self.step
    }

    /// What the last cycle commanded.
    pub fn commands(&self) -> &Commands {
        &self.commands
    }

    /// One cycle: what the simulator says, what to command next (see [`Self::commands`]).
    pub fn cycle(&mut self, feedback: &Feedback) -> Result<Sample, Trouble> {
        let ticks = feedback.double(&image::PLANT_TICKS);
        let first = *self.first_tick.get_or_insert(ticks);
        let sample = Sample {
            t_s: 1e-3 * f64::from(PLANT_PERIOD_MS) * f64::from(ticks.wrapping_sub(first)),
            step: self.step,
            feedback: *feedback,
        };
        let tension = sample.value(&image::TENSION) / self.commands.get::<f64>(&image::STALL_SET);
        self.settled_since_s = ((tension - 1.0).abs() <= SETTLED_BAND)
            .then(|| self.settled_since_s.unwrap_or(sample.t_s));
        let in_step_s = sample.t_s - self.since_s;
        if in_step_s >= STEP_S && self.finished(&sample) {
            self.step = self.step.next();
            self.since_s = sample.t_s;
        } else if let Some(what) = self.complaint(&sample, in_step_s) {
            return Err(Trouble {
                what,
                since_s: self.since_s,
                sample: Box::new(sample),
            });
        }
        let heartbeat = self.commands.word(&image::HEARTBEAT_PLC).wrapping_add(1);
        self.commands.set_word(&image::HEARTBEAT_PLC, heartbeat);
        self.commands
            .set_word(&image::WINDER_COMMAND, self.step.winder_command());
        for word in image::STW1 {
            self.commands.set_word(word, self.step.stw1());
        }
        Ok(sample)
    }

    /// Has the present step reached its end?
    fn finished(&self, sample: &Sample) -> bool {
        let is = |bits| sample.feedback.word(&image::WINDER_STATUS) & bits == bits;
        let drives = |bits| {
            image::ZSW1
                .iter()
                .all(|zsw1| sample.feedback.word(zsw1) & bits == bits)
        };
        let near = |signal, value_mm: f64| (sample.value(signal) - value_mm).abs() < 1.0;
        match self.step {
            Step::Acknowledge => sample.feedback.word(&image::FAULT) == Fault::None as u16,
            Step::NewRolls => near(
                &image::D_WU,
                2e3 * self.recipe.machine.shipping_roll.core_radius_m,
            ),
            Step::Preset => {
                is(status::PRESET_TAKEN)
                    && near(&image::D_UW, self.commands.get(&image::D_PRESET_UW))
            }
            Step::MakeReady => drives(zsw1::READY_TO_SWITCH_ON),
            Step::SwitchOn => drives(zsw1::OPERATION_ENABLED) && is(status::DRIVES_ON),
            Step::LeadWeb => is(status::WEB_THREADED),
            Step::Thread => is(status::TENSION_DETECTED),
            Step::Run => self.time_to_stop(sample),
            Step::Stop => {
                is(status::ZERO_SPEED | status::TENSION_DETECTED)
                    && sample.mode() == Some(Mode::Stall)
            }
            Step::Tension | Step::Rest => self
                .settled_since_s
                .is_some_and(|since_s| sample.t_s - since_s >= SETTLED_S),
            Step::SwitchOff => !is(status::DRIVES_ON) && sample.mode() == Some(Mode::Off),
            Step::Done => true,
        }
    }

    /// Will the roll be full when the machine stands, if it stops now?
    fn time_to_stop(&self, sample: &Sample) -> bool {
        let v_ref = sample.value(&image::V_REF) / 60.0;
        let a_ref = sample.value(&image::A_REF).max(0.0);
        let remaining_m = self
            .recipe
            .length_m(sample.value(&image::D_WU) * 1e-3, self.recipe.diameter_m);
        // the command arrives within a cycle or so
        remaining_m <= self.recipe.ramp().stop(v_ref, a_ref).distance_m + v_ref * CYCLE_S
    }

    /// What is wrong, if anything.
    fn complaint(&self, sample: &Sample, in_step_s: f64) -> Option<String> {
        // what an earlier set has left behind goes with the acknowledge
        if self.step != Step::Acknowledge {
            let fault = sample.feedback.word(&image::FAULT);
            if fault != Fault::None as u16 {
                let text = code(Fault::ALL, fault).map_or("unknown", Fault::name);
                return Some(format!("the drives report fault {fault}: {text}"));
            }
            let refusal = sample.feedback.word(&image::REFUSAL);
            if in_step_s > REFUSAL_S && refusal != Refusal::None as u16 {
                let text = code(Refusal::ALL, refusal).map_or("unknown", Refusal::name);
                return Some(format!(
                    "the drives refuse the command, reason {refusal}: {text}"
                ));
            }
        }
        let limit_s = self.time_limit_s();
        (in_step_s > limit_s).then(|| format!("not done within {limit_s:.0} s"))
    }

    /// How long the present step may take, s.
    fn time_limit_s(&self) -> f64 {
        match self.step {
            // the rolls are at hand, and the drives switch in milliseconds
            Step::Acknowledge | Step::NewRolls | Step::Preset => 5.0,
            Step::MakeReady | Step::SwitchOn | Step::LeadWeb => 5.0,
            Step::Thread => 60.0,
            Step::Run => 60.0 + 1.5 * self.recipe.duration_s(),
            Step::Stop => 30.0 + 1.5 * self.recipe.ramp().stop(self.recipe.speed_m_s, 0.0).time_s,
            Step::Tension | Step::Rest => 30.0,
            Step::SwitchOff => 15.0,
            Step::Done => f64::INFINITY,
        }
    }
}

/// Winds a set on a simulator in this process, both in lockstep: no network, no clock. `meanwhile` sees each
/// sample, and may do something to the winder.
///
/// `machine` is the simulated one, valid and of `SPANS` spans; the recipe has the PLC's idea of it. Fails where the
/// program does.
pub fn wind_in_lockstep<const SPANS: usize>(
    machine: &Machine,
    recipe: &Recipe,
    mut meanwhile: impl FnMut(&mut Simulator<f32, SPANS>, &Sample),
) -> Result<Vec<Sample>, Trouble> {
    let mut simulator = Simulator::new(machine).expect("a valid machine");
    let mut image = Image {
        commands: Commands::of(machine),
        feedback: Feedback::default(),
    };
    let mut plc = Plc::new(recipe.clone());
    let mut samples = Vec::new();
    while plc.step() != Step::Done {
        for _ in 0..(1e3 * CYCLE_S) as u32 / DRIVE_PERIOD_MS {
            simulator.drive_cycle(&mut image);
        }
        let sample = plc.cycle(&image.feedback)?;
        image.commands = *plc.commands();
        meanwhile(&mut simulator, &sample);
        samples.push(sample);
    }
    Ok(samples)
}

/// What a winder PLC shows its operator: its state, and the alarms that stand.
pub fn shown(commands: &Commands) -> (&'static str, Vec<&'static str>) {
    let state = usize::from(commands.word(&image::PLC_STATE));
    let alarms = commands.word(&image::PLC_ALARMS);
    let standing = ALARM_BITS
        .iter()
        .filter(|bit| alarms >> bit.number & 1 == 1);
    (
        STATES.get(state).copied().unwrap_or("unknown state"),
        standing.map(|bit| bit.name).collect(),
    )
}

/// Winds a set on the simulator at `address`, which runs at `pace` times real time; shows the observer a sample
/// of every cycle.
pub fn wind(
    address: SocketAddr,
    recipe: &Recipe,
    pace: f64,
    mut observer: impl FnMut(&Sample),
) -> Result<()> {
    let mut link = Link::connect(address)?;
    let mut plc = Plc::new(recipe.clone());
    let period = Duration::from_secs_f64(CYCLE_S / pace);
    // before the first tick there is nothing to see
    let (mut last_tick, mut ticked) = (0, Instant::now());
    while plc.step() != Step::Done {
        interrupt::check()?;
        let began = Instant::now();
        let feedback = link.read()?;
        let sample = plc.cycle(&feedback)?;
        let tick = feedback.double(&image::PLANT_TICKS);
        if tick != last_tick {
            (last_tick, ticked) = (tick, Instant::now());
            observer(&sample);
        } else if ticked.elapsed() > STANDSTILL_OF_TICKS {
            bail!(
                "the simulator answers, but its plant has stood at tick {tick} for {} s",
                STANDSTILL_OF_TICKS.as_secs()
            );
        }
        link.write(plc.commands())?;
        thread::sleep(period.saturating_sub(began.elapsed()));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(value: f64, expected: f64, tolerance: f64) {
        assert!(
            (value - expected).abs() <= tolerance,
            "{value} is not {expected} ± {tolerance}"
        );
    }

    const RAMP: Ramp = Ramp {
        acceleration_m_s2: 0.45,
        jerk_m_s3: 0.20,
    };

    #[test]
    fn stop_from_run_speed_is_the_closed_form() {
        let stop = RAMP.stop(2200.0 / 60.0, 0.0);
        near(stop.distance_m, 1535.08, 0.01);
        near(stop.time_s, 83.73, 0.01);
    }

    /// The same stop, followed in small steps.
    fn followed(v: f64, a: f64) -> Stop {
        const DT: f64 = 1e-4;
        let (mut v, mut a, mut s, mut t) = (v, a, 0.0, 0.0);
        while v > 0.0 || a > 0.0 {
            // the acceleration must be back at zero when the speed is
            let j = if a < 0.0 && v <= a * a / (2.0 * RAMP.jerk_m_s3) {
                RAMP.jerk_m_s3
            } else if a <= -RAMP.acceleration_m_s2 {
                0.0
            } else {
                -RAMP.jerk_m_s3
            };
            a += j * DT;
            if j > 0.0 && a >= 0.0 {
                break;
            }
            s += v * DT;
            v += a * DT;
            t += DT;
        }
        Stop {
            distance_m: s,
            time_s: t,
        }
    }

    #[test]
    fn stop_is_the_followed_one_at_any_speed_and_acceleration() {
        for (v, a) in [
            (20.0, 0.0),
            (20.0, 0.45),
            (5.0, 0.3),
            (0.4, 0.0),
            (0.4, 0.1),
        ] {
            let (stop, followed) = (RAMP.stop(v, a), followed(v, a));
            near(
                stop.distance_m,
                followed.distance_m,
                2e-3 * followed.distance_m + 1e-3,
            );
            near(stop.time_s, followed.time_s, 5e-2);
        }
    }

    #[test]
    fn length_of_the_full_set_is_the_closed_form() {
        let recipe = Recipe {
            machine: Machine::news_8000(),
            diameter_m: 1.25,
            speed_m_s: 2200.0 / 60.0,
        };
        near(recipe.set_length_m(), 18_758.93, 0.02);
    }
}
