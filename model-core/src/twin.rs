//! Runs that every machine repeats to the bit: the plant open loop, and the whole simulator under a PLC.
//!
//! Not here: a machine to run them on, and the comparison. A microcontroller and a PC compute the same run, each
//! tells the hash of its trajectory after every [`Phase`], and whoever has both compares.
//!
//! The course of the plant is what a set goes through: slack taken up, acceleration, constant speed, a drum that
//! loses traction, brakes down to standstill, stall tension held, a web break. Nothing is fed back: the torques
//! follow from the machine's description by the balances of each roll, so that every scalar gets the same ones.

use core::hint::black_box;

use heapless::Vec;

use crate::drive::DRIVE_PERIOD_MS;
use crate::exchange::{Actuators, Brakes, BySection, Handling};
use crate::image::{self, Commands, Feedback, Image};
use crate::logic::command;
use crate::machine::{IdleRoll, Machine, MachineError};
use crate::plant::PLANT_PERIOD_MS;
use crate::plant::motion::{Load, Motion};
use crate::plant::rk4::State;
use crate::plant::span::Web;
use crate::plant::units::{One, Units};
use crate::plant::windup::Whole;
use crate::profidrive::stw1;
use crate::real::{Accumulator, Real, Scalar};
use crate::simulator::{Plant, Record, Simulator};

/// Coefficient of friction of a worn drum on paper.
const WORN: f64 = 0.20;

/// Web spans of [`machine`].
pub const SPANS: usize = 3;

/// The machine of the runs: `NEWS-8000` with all that can be switched on in the plant, worn drums that slip.
pub fn machine() -> Machine {
    let mut machine = Machine::news_8000();
    may_slip(&mut machine);
    machine.nips.static_ratio = 1.1;
    machine.brakes.static_ratio = 1.2;
    machine.wound_on_tension.compresses = true;
    machine.load_cells.both_spans = true;
    machine.parent_roll.eccentricity_m = 1e-4;
    for roll in &mut machine.idle {
        roll.eccentricity_m = 2e-5;
    }
    machine
}

/// Gives a machine worn drums that slip where the course of [`Phase::Slip`] pulls.
pub fn may_slip(machine: &mut Machine) {
    machine.nips.slip = true;
    machine.nips.friction = WORN;
}

/// Winds a course; tells at the end of each phase how far it has come.
pub fn wind<R: Scalar>(
    extent: Extent,
    mut tell: impl FnMut(Phase, Record),
) -> Result<(), MachineError> {
    let machine = machine();
    let mut plant = Plant::<R, SPANS>::new(&machine)?;
    let mut last = None;
    for (phase, actuators) in Course::of(&machine, extent).steps::<R::Si>() {
        if let Some((before, record)) = last
            && before != phase
        {
            tell(before, record);
        }
        last = Some((phase, plant.tick(&actuators).1));
    }
    if let Some((phase, record)) = last {
        tell(phase, record);
    }
    Ok(())
}

/// Runs the whole simulator under the PLC of [`commands`]; tells every ten seconds how far it has come: drive
/// cycles, and a hash over all feedback of every cycle.
pub fn operate<R: Scalar>(mut tell: impl FnMut(Record)) -> Result<(), MachineError> {
    let machine = Machine::news_8000();
    let mut simulator = Simulator::<R, SPANS>::new(&machine)?;
    let mut image = Image {
        commands: Commands::of(&machine),
        feedback: Feedback::default(),
    };
    let mut record = Record::default();
    for cycle in 0..CYCLES {
        image.commands = commands(&machine, cycle);
        simulator.drive_cycle(&mut image);
        record.step();
        for word in image.feedback.words {
            record.hash(word.into());
        }
        if record.ticks.is_multiple_of(TOLD_EVERY) {
            tell(record);
        }
    }
    Ok(())
}

/// How long a course is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// All phases in little more than a minute, at low speed.
    Short,
    /// A whole set: a full roll at run speed.
    Set,
}

/// What happens in a part of a course, in this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Phase {
    /// The web is led through; the unwind takes up its slack against the drums' brakes.
    TakeUp,
    /// To the course's speed, under tension.
    Accelerate,
    /// At constant speed.
    Wind,
    /// The front drum pulls harder than its nip can carry.
    Slip,
    /// The nips catch.
    Catch,
    /// All brakes are closed at speed, the motors do the rest.
    Brake,
    /// At standstill the unwind tightens the web, its brake closed.
    Tighten,
    /// All brakes hold it.
    Hold,
    /// The drums tear it.
    Tear,
    /// The rolls turn without a web.
    Coast,
}

impl Phase {
    /// For people and programs.
    pub const fn name(self) -> &'static str {
        match self {
            Self::TakeUp => "take-up",
            Self::Accelerate => "accelerate",
            Self::Wind => "wind",
            Self::Slip => "slip",
            Self::Catch => "catch",
            Self::Brake => "brake",
            Self::Tighten => "tighten",
            Self::Hold => "hold",
            Self::Tear => "tear",
            Self::Coast => "coast",
        }
    }
}

/// What holds for some steps.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Row {
    phase: Phase,
    steps: u32,
    torque: BySection<f64>,
    brakes: Brakes<bool>,
}

/// Rows that a ramp, or a long time at constant speed, is cut into: friction and radius are constant in each.
const PARTS: u32 = 4;
/// Rows of a course.
const ROWS: usize = 3 * PARTS as usize + 8;

/// What acts on the plant over time.
#[derive(Clone, Debug)]
pub struct Course {
    rows: Vec<Row, ROWS>,
}

/// Speed of a short course at most, m/s.
const SHORT_SPEED: f64 = 8.0;
/// Time at constant speed in a short course, s.
const SHORT_WIND: f64 = 20.0;
/// Acceleration while the front drum slips, m/s².
const SLIP_ACCELERATION: f64 = 0.5;
/// Share of the braking that is left to the unwind's brake alone, the drums as slow as it.
const LAST: f64 = 0.02;

const NONE: Brakes<bool> = Brakes {
    uw: false,
    rd: false,
    fd: false,
};
const UNWIND: Brakes<bool> = Brakes { uw: true, ..NONE };
const DRUMS: Brakes<bool> = Brakes {
    rd: true,
    fd: true,
    ..NONE
};
const ALL: Brakes<bool> = Brakes { uw: true, ..DRUMS };

/// Where a set has come to, as the balances see it.
#[derive(Clone, Copy)]
struct Point {
    /// Web on the shipping roll, m.
    length: f64,
    /// Speed, m/s.
    v: f64,
}

impl Course {
    /// The course of a machine.
    pub fn of(machine: &Machine, extent: Extent) -> Self {
        let o = &machine.operation;
        let v = match extent {
            Extent::Short => o.run_speed_m_s.min(SHORT_SPEED),
            Extent::Set => o.run_speed_m_s,
        };
        let (up, down) = (v / o.acceleration_m_s2, v / o.emergency_m_s2);
        let wind = match extent {
            Extent::Short => SHORT_WIND,
            Extent::Set => set_length(machine) / v - 0.5 * (up + down),
        };
        let tension = o.tension_n_m * machine.web.width_m;
        let stall = o.stall_share * tension;
        let end = Point {
            length: v * (0.5 * up + wind),
            v: 0.0,
        };
        let at_rest = |uw, drums| BySection {
            uw,
            ..pull(machine, drums)
        };
        let r_uw = parent_radius(machine, end.length);
        let stalled = at_rest(-stall * r_uw, 0.0);

        let mut course = Self { rows: Vec::new() };
        let slack = at_rest(-stall * machine.parent_roll.full_radius_m, 0.0);
        course.add(Phase::TakeUp, 3.0, slack, DRUMS);
        for part in 0..PARTS {
            let share = (f64::from(part) + 0.5) / f64::from(PARTS);
            let point = Point {
                length: 0.5 * v * up * share * share,
                v: v * share,
            };
            let torque = balance(machine, point, o.acceleration_m_s2, tension);
            course.add(Phase::Accelerate, up / f64::from(PARTS), torque, NONE);
        }
        for part in 0..PARTS {
            let share = (f64::from(part) + 0.5) / f64::from(PARTS);
            let length = v * (0.5 * up + wind * share);
            let torque = balance(machine, Point { length, v }, 0.0, tension);
            course.add(Phase::Wind, wind / f64::from(PARTS), torque, NONE);
        }
        let point = Point { v, ..end };
        let even = balance(machine, point, 0.0, tension);
        let pulling = BySection {
            fd: machine.motors.overload * machine.motors.fd.torque_n_m,
            uw: balance(machine, point, SLIP_ACCELERATION, tension).uw,
            ..even
        };
        course.add(Phase::Slip, 0.5, pulling, NONE);
        course.add(Phase::Catch, 2.0, even, NONE);
        for part in 0..PARTS {
            let share = (f64::from(part) + 0.5) / f64::from(PARTS);
            let point = Point {
                v: v * (1.0 - share),
                ..end
            };
            let mut torque = balance(machine, point, -o.emergency_m_s2, tension);
            torque.uw += machine.brakes.uw_n_m;
            torque.rd += machine.brakes.rd_n_m;
            torque.fd += machine.brakes.fd_n_m;
            let time = (1.0 - LAST) * down / f64::from(PARTS);
            course.add(Phase::Brake, time, torque, ALL);
        }
        let last = (machine.brakes.uw_n_m + stall * r_uw) * r_uw / parent_inertia(machine, r_uw);
        let mut torque = balance(machine, end, -last, stall);
        torque.uw = stalled.uw;
        torque.rd += machine.brakes.rd_n_m;
        torque.fd += machine.brakes.fd_n_m;
        course.add(Phase::Brake, 6.0, torque, ALL);
        // against its own brake, which does not let it spring back
        let mut torque = stalled;
        torque.uw -= machine.brakes.uw_n_m;
        course.add(Phase::Tighten, 3.0, torque, ALL);
        course.add(Phase::Hold, 5.0, stalled, ALL);
        let strength = machine.web.strength_n_m * machine.web.width_m;
        let torn = at_rest(stalled.uw, 2.0 * strength);
        course.add(Phase::Tear, 3.0, torn, UNWIND);
        course.add(Phase::Coast, 2.0, BySection::default(), NONE);
        course.add(Phase::Coast, 2.0, BySection::default(), ALL);
        course
    }

    fn add(&mut self, phase: Phase, seconds: f64, torque: BySection<f64>, brakes: Brakes<bool>) {
        let row = Row {
            phase,
            steps: (seconds * 1e3 / f64::from(PLANT_PERIOD_MS) + 0.5) as u32,
            torque,
            brakes,
        };
        // `ROWS` counts them all
        let _ = self.rows.push(row);
    }

    /// What acts in every step, from the first.
    pub fn steps<R: Real>(&self) -> impl Iterator<Item = (Phase, Actuators<R>)> {
        self.rows.iter().flat_map(|row| {
            let actuators = Actuators {
                torque: row.torque.map(R::of),
                brakes: row.brakes,
                handling: Handling {
                    thread_web: row.phase == Phase::TakeUp,
                    ..Handling::default()
                },
                ..Actuators::default()
            };
            (0..row.steps).map(move |_| (row.phase, actuators))
        })
    }
}

/// Length of web on a full shipping roll, π·(R² − R_core²)/z, m.
fn set_length(machine: &Machine) -> f64 {
    let roll = &machine.shipping_roll;
    let squares = roll.full_radius_m * roll.full_radius_m - roll.core_radius_m * roll.core_radius_m;
    core::f64::consts::PI * squares / machine.web.caliper_m
}

/// {4} Radius of the parent roll without a length of web, m.
fn parent_radius(machine: &Machine, length: f64) -> f64 {
    let full = machine.parent_roll.full_radius_m;
    let paper = length * machine.web.caliper_m / core::f64::consts::PI;
    let least = machine.parent_roll.expire_radius_m;
    libm::sqrt((full * full - paper).max(least * least))
}

/// J(R) of the parent roll, kg·m².
fn parent_inertia(machine: &Machine, r: f64) -> f64 {
    machine.parent_roll_offset() + machine.web.roll_inertia(r)
}

/// {1} Radius of the shipping roll with a length of web, m.
fn shipping_radius(machine: &Machine, length: f64) -> f64 {
    let core = machine.shipping_roll.core_radius_m;
    libm::sqrt(core * core + length * machine.web.caliper_m / core::f64::consts::PI)
}

/// A force at the surface of the drums, N, as torques of both, N·m.
fn pull(machine: &Machine, force: f64) -> BySection<f64> {
    BySection {
        rd: 0.5 * force * machine.rear_drum.radius_m,
        fd: 0.5 * force * machine.front_drum.radius_m,
        ..BySection::default()
    }
}

/// Torques that accelerate every roll by `a` at a point of the set, the first span under `tension`.
fn balance(machine: &Machine, point: Point, a: f64, tension: f64) -> BySection<f64> {
    let Point { length, v } = point;
    let r = parent_radius(machine, length);
    let unwind =
        parent_inertia(machine, r) * a / r + (machine.parent_roll.friction_n_s_m * v - tension) * r;

    let r_wu = shipping_radius(machine, length);
    let shipping = machine.web.roll_inertia(r_wu)
        - machine
            .web
            .roll_inertia(machine.shipping_roll.core_radius_m);
    let drums = [&machine.rear_drum, &machine.front_drum, &machine.rider_roll];
    let idle_force = |force, roll: &IdleRoll| force + roll.mass_kg() * a + roll.friction_n_s_m * v;
    let windup = drums.iter().fold(
        shipping / (r_wu * r_wu) * a + machine.shipping_roll.friction_n_s_m * v,
        |force, roll| force + roll.mass_kg() * a + roll.friction_n_s_m * v,
    );
    BySection {
        uw: unwind,
        ..pull(
            machine,
            machine.idle.iter().fold(tension + windup, idle_force),
        )
    }
}

/// The motion alone, at run speed in the middle of a set: nothing is decided on, so that its arithmetic can be counted.
#[derive(Clone, Debug)]
pub struct Moving<R: Scalar, const SPANS: usize> {
    motion: Motion<R, SPANS>,
    sums: State<R::Sum, SPANS, 0>,
    web: Web<R, SPANS>,
    load: Load<'static, R, Whole<R>, SPANS>,
}

impl<R: Scalar, const SPANS: usize> Moving<R, SPANS> {
    /// The motion of a machine with `SPANS` spans under its web tension, in steps of the plant's period.
    pub fn of(machine: &Machine) -> Self {
        let h = 1e-3 * f64::from(PLANT_PERIOD_MS);
        let o = &machine.operation;
        let (tension, v) = (o.tension_n_m * machine.web.width_m, o.run_speed_m_s);
        let length = 0.5 * set_length(machine);
        let r_uw = parent_radius(machine, length);
        let torque = balance(machine, Point { length, v }, 0.0, tension);
        let force =
            torque.rd / machine.rear_drum.radius_m + torque.fd / machine.front_drum.radius_m;

        let units = Units::of::<R>(machine);
        let motion = Motion::new(&One(machine, &units), h);
        let at = |x: f64, unit: f64| R::Sum::at(R::coefficient(x / unit));
        let strain = tension / (machine.web.stiffness_n_m * machine.web.width_m);
        let sums = State {
            strain: core::array::from_fn(|_| at(strain, units.strain)),
            v: core::array::from_fn(|_| at(v, units.speed)),
            windup: [],
            omega_uw: at(v / r_uw, units.omega()),
            r_uw: at(r_uw, units.r_uw),
            r_wu: at(shipping_radius(machine, length), units.r_wu),
        };
        let web = motion.web(&sums.map(|sum| sum.value()), None);
        Self {
            motion,
            sums,
            web,
            load: Load {
                uw: R::coefficient(torque.uw / units.torque()),
                windup: Whole(R::coefficient(force / units.force)),
                layer: R::coefficient(1.0),
                threaded: true,
                offsets: None,
            },
        }
    }

    /// A step, and the web that belongs to its end.
    pub fn step(&mut self) {
        self.motion.advance(&mut self.sums, &self.web, &self.load);
        self.web = self.motion.web(&self.values(), None);
    }

    /// The state, counted in the scalar's units.
    pub fn values(&self) -> State<R, SPANS, 0> {
        self.sums.map(|sum| sum.value())
    }
}

/// Drive cycles of the run under a PLC.
pub const CYCLES: u32 = 60 * 1000 / DRIVE_PERIOD_MS;

/// Web speed in the run under a PLC, m/min: reached within the time there is.
const PLC_SPEED: f64 = 300.0;

/// Drive cycles from one record of [`operate`] to the next.
const TOLD_EVERY: u32 = 10 * 1000 / DRIVE_PERIOD_MS;

/// What the PLC of the second run commands in a drive cycle: preset, web, drives on, thread, run, normal stop.
///
/// It waits for nothing: each command comes when the one before has had time enough on `NEWS-8000`.
pub fn commands(machine: &Machine, cycle: u32) -> Commands {
    let mut commands = Commands::of(machine);
    let tenths = cycle * DRIVE_PERIOD_MS / 100;
    let word = match tenths {
        1 => command::PRESET_ACCEPT,
        3 => command::WEB_THREADED,
        10..150 => command::THREAD,
        150..400 => command::RUN,
        _ => 0,
    };
    let drives = match tenths {
        0..5 => 0,
        5 => stw1::READY,
        _ => stw1::RUN,
    };
    commands.set_word(&image::HEARTBEAT_PLC, cycle as u16);
    commands.set_word(&image::WINDER_COMMAND, word);
    commands.set(&image::V_SET, PLC_SPEED);
    for signal in image::STW1 {
        commands.set_word(signal, drives);
    }
    commands
}

/// Longest of [`copies`], bytes: some rounds of eight words, and a rest of every length.
const LONGEST_COPY: usize = 100;
/// Bytes of two words.
const PLACES: usize = 8;

/// Copies bytes between all places of two words, of all lengths up to [`LONGEST_COPY`]; gives how many times, and a hash of
/// all that stands where they were copied to and beside it. For boards that copy memory by code of their own.
pub fn copies() -> (u32, u32) {
    let source: [u8; LONGEST_COPY + PLACES] = core::array::from_fn(|i| (i * 37 + 11) as u8);
    let (mut times, mut hash) = (0, 0_u32);
    for (from, to) in (0..PLACES).flat_map(|from| (0..PLACES).map(move |to| (from, to))) {
        for length in 0..=LONGEST_COPY {
            let length = black_box(length);
            let mut target = [0; LONGEST_COPY + PLACES];
            target[to..to + length].copy_from_slice(&source[from..from + length]);
            for byte in black_box(target) {
                hash = hash.wrapping_mul(31).wrapping_add(byte.into());
            }
            times += 1;
        }
    }
    (times, hash)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::{MODE, V_WEB};
    use crate::logic::Mode;

    /// Every phase does what its name says, or the runs would compare nothing.
    #[test]
    fn a_course_goes_through_all_that_can_happen() {
        let machine = machine();
        let tension = machine.operation.tension_n_m * machine.web.width_m;
        let stall = machine.operation.stall_share * tension;
        let mut plant = Plant::<f64, SPANS>::new(&machine).unwrap();
        let (mut fastest, mut slid, mut held) = (0.0_f64, 0, 0);
        for (phase, actuators) in Course::of(&machine, Extent::Short).steps::<f64>() {
            plant.tick(&actuators);
            let winder = plant.winder();
            let (x, t) = (winder.state(), winder.tension());
            let v_rd = x.v[SPANS - 1];
            let slides = winder.winding().slides.contains(&true);
            fastest = fastest.max(v_rd);
            match phase {
                Phase::Accelerate | Phase::Wind => assert!(!slides),
                Phase::Slip => slid += u32::from(slides),
                Phase::Hold => {
                    let still = v_rd == 0.0 && x.omega_uw == 0.0;
                    let tight = t.iter().all(|t| (0.5 * stall..2.0 * tension).contains(t));
                    held += u32::from(still && tight);
                }
                Phase::Coast => assert!(!winder.threaded()),
                _ => {}
            }
            if phase < Phase::Tear {
                assert!(winder.threaded(), "{} at {v_rd} m/s, {t:?} N", phase.name());
            }
        }
        assert!((fastest - SHORT_SPEED).abs() < 0.5, "{fastest} m/s");
        assert!(slid > 100, "{slid} steps of slip");
        assert!(held > 500, "{held} steps at rest under tension");
    }

    /// The courses have room in their list: a row that does not fit would be lost.
    #[test]
    fn a_course_has_all_its_rows() {
        for extent in [Extent::Short, Extent::Set] {
            let course = Course::of(&machine(), extent);
            assert_eq!(course.rows.len(), ROWS);
            assert_eq!(course.rows.last().map(|row| row.phase), Some(Phase::Coast));
        }
    }

    /// What is counted is a winder at work: it keeps its speed, and its web is tight.
    #[test]
    fn the_motion_alone_goes_on_as_it_began() {
        let machine = Machine::news_8000();
        let mut moving = Moving::<f64, SPANS>::of(&machine);
        let before = moving.values();
        for _ in 0..250 {
            moving.step();
        }
        let after = moving.values();
        for (v, v_before) in after.v.into_iter().zip(before.v) {
            assert!((v - v_before).abs() < 0.1, "{v} m/s after {v_before} m/s");
        }
        assert!(after.strain.iter().all(|strain| *strain > 0.0), "{after:?}");
        assert!(after.r_wu > before.r_wu && after.r_uw < before.r_uw);
    }

    /// The PLC's commands come when they are taken: the set is at speed, and at the end it is stopped under tension.
    #[test]
    fn the_plc_is_obeyed() {
        let machine = Machine::news_8000();
        let mut simulator = Simulator::<f64, SPANS>::new(&machine).unwrap();
        let mut image = Image {
            commands: Commands::of(&machine),
            feedback: Feedback::default(),
        };
        let mut fastest = 0.0_f64;
        for cycle in 0..CYCLES {
            image.commands = commands(&machine, cycle);
            simulator.drive_cycle(&mut image);
            fastest = fastest.max(image.feedback.get(&V_WEB));
        }
        assert!((fastest - PLC_SPEED).abs() < 5.0, "{fastest} m/min");
        assert_eq!(image.feedback.word(&MODE), Mode::Stall as u16);
    }
}
