//! The simulator: plant, regulators and logic, and the order in which they run.
//!
//! Not here: what makes them run on time. On a microcontroller three tasks call the three parts; on a PC
//! [`Simulator`] calls them in the same order, so that the same commands at the same ticks give the same bits.
//!
//! The order is fixed: at a common tick the plant moves first, then the regulators see it, then the logic runs
//! on what the regulators told, and what it asks for counts from the next drive cycle on.

use crate::drive::{DRIVE_PERIOD_MS, Drive};
use crate::exchange::{Actuators, DriveCommand, DriveStatus, Measurements};
use crate::image::{self, Commands, Feedback, Image};
use crate::logic::Logic;
use crate::machine::{Machine, MachineError};
use crate::plant::{PLANT_PERIOD_MS, Winder};
use crate::real::{Real, Scalar};

/// The plant's part: every 4 ms.
#[derive(Clone, Debug)]
pub struct Plant<R: Scalar, const SPANS: usize> {
    winder: Winder<R, SPANS>,
    record: Record,
}

/// How far the plant has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Record {
    /// Steps since power-up; wraps.
    pub ticks: u32,
    /// Hash over every state variable after every step.
    pub trajectory: u32,
    /// What no drive can see.
    pub truth: Truth,
}

/// Ground truth for the eyes of a person, never for a drive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Truth {
    /// Span in which the web has parted, counted from the unwind; 0 while it is whole.
    pub broken_span: u8,
    /// Nips that slide: bit 0 rear drum, 1 front drum, 2 rider roll.
    pub sliding: u8,
    /// Wound-on tension per width, N/m; 0 where it is not computed.
    pub wound_on_tension: u16,
    /// Loads of the drums' nips per width, rear and front, N/m; 0 where they are not computed.
    pub nip_load: [u16; 2],
    /// The shipping roll has burst.
    pub burst: bool,
}

impl Truth {
    fn of<R: Scalar, const SPANS: usize>(winder: &Winder<R, SPANS>) -> Self {
        let winding = winder.winding();
        let [rd, fd, rr] = winding.slides.map(u8::from);
        let [load_rd, load_fd, _] = winding.nip_load.map(R::Si::to_f32);
        Self {
            broken_span: winder.broken_span(),
            sliding: rd | fd << 1 | rr << 2,
            // the casts saturate
            wound_on_tension: winding.wound_on_tension.to_f32() as u16,
            nip_load: [load_rd as u16, load_fd as u16],
            burst: winding.burst,
        }
    }
}

impl Record {
    /// FNV's starting value. Source: Fowler, Noll, Vo, draft-eastlake-fnv, 32 bits.
    const START: u32 = 0x811c_9dc5;
    /// FNV's prime.
    const PRIME: u32 = 0x0100_0193;

    /// A step begins.
    pub(crate) fn step(&mut self) {
        self.ticks = self.ticks.wrapping_add(1);
    }

    /// Hashes a word of what it has left behind: h·p + x, a polynomial in FNV's prime. One instruction of a
    /// microcontroller, where FNV itself takes two.
    pub(crate) fn hash(&mut self, bits: u32) {
        self.trajectory = self.trajectory.wrapping_mul(Self::PRIME).wrapping_add(bits);
    }
}

impl Default for Record {
    fn default() -> Self {
        Self {
            ticks: 0,
            trajectory: Self::START,
            truth: Truth::default(),
        }
    }
}

impl<R: Scalar, const SPANS: usize> Plant<R, SPANS> {
    /// The plant of a machine; fails with the first parameter outside its limits.
    pub fn new(machine: &Machine) -> Result<Self, MachineError> {
        Ok(Self {
            winder: Winder::new(machine, 1e-3 * f64::from(PLANT_PERIOD_MS))?,
            record: Record::default(),
        })
    }

    /// 4 ms of the winder.
    pub fn tick(&mut self, actuators: &Actuators<R::Si>) -> (Measurements<R::Si>, Record) {
        let measurements = self.winder.step(actuators);
        self.record.step();
        self.winder.fingerprint(|bits| self.record.hash(bits));
        self.record.truth.broken_span = self.winder.broken_span();
        if self.winder.winds() {
            self.record.truth = Truth::of(&self.winder);
        }
        (measurements, self.record)
    }

    /// The winder itself: ground truth.
    pub fn winder(&self) -> &Winder<R, SPANS> {
        &self.winder
    }

    /// The winder itself, to put it into a state.
    pub fn winder_mut(&mut self) -> &mut Winder<R, SPANS> {
        &mut self.winder
    }
}

/// All parts in one hand, in lockstep.
#[derive(Clone, Debug)]
pub struct Simulator<R: Scalar, const SPANS: usize> {
    /// The plant's part.
    pub plant: Plant<R, SPANS>,
    /// The regulators.
    pub drive: Drive<R::Si>,
    /// The logic.
    pub logic: Logic<R::Si>,
    actuators: Actuators<R::Si>,
    measurements: Measurements<R::Si>,
    command: DriveCommand<R::Si>,
    status: DriveStatus<R::Si>,
    record: Record,
    /// Time within the common period of both tasks, ms.
    phase_ms: u32,
}

impl<R: Scalar, const SPANS: usize> Simulator<R, SPANS> {
    /// The simulator of a machine at power-up; fails with the first parameter outside its limits.
    pub fn new(machine: &Machine) -> Result<Self, MachineError> {
        Ok(Self {
            plant: Plant::new(machine)?,
            drive: Drive::new(machine),
            logic: Logic::new(machine),
            actuators: Actuators::default(),
            measurements: Measurements::default(),
            command: DriveCommand::default(),
            status: DriveStatus::default(),
            record: Record::default(),
            phase_ms: 0,
        })
    }

    /// One drive cycle of 10 ms: the plant's ticks up to it, the regulators, the logic.
    pub fn drive_cycle(&mut self, image: &mut Image) {
        self.drive_cycle_seen(image, |_| ());
    }

    /// The same; `see` is shown what can be measured after each tick of the plant.
    pub fn drive_cycle_seen(
        &mut self,
        image: &mut Image,
        mut see: impl FnMut(&Measurements<R::Si>),
    ) {
        let end = self.phase_ms + DRIVE_PERIOD_MS;
        let plant_ticks = end / PLANT_PERIOD_MS - self.phase_ms / PLANT_PERIOD_MS;
        for _ in 0..plant_ticks {
            (self.measurements, self.record) = self.plant.tick(&self.actuators);
            see(&self.measurements);
        }
        self.phase_ms = end % (PLANT_PERIOD_MS * DRIVE_PERIOD_MS);
        self.drive.step(
            &self.command,
            &self.measurements,
            &mut self.actuators,
            &mut self.status,
        );
        self.command = logic_tick(
            &mut self.logic,
            &image.commands,
            &self.measurements,
            &self.status,
            &self.record,
            &mut image.feedback,
        );
    }

    /// The simulator between two drive cycles, as its parts were left by other hands: what acts on the winder, what
    /// the regulators are to do next, and the time within the common period of both tasks, ms.
    pub fn resume(
        plant: Plant<R, SPANS>,
        drive: Drive<R::Si>,
        logic: Logic<R::Si>,
        actuators: Actuators<R::Si>,
        command: DriveCommand<R::Si>,
        phase_ms: u32,
    ) -> Self {
        Self {
            // Every drive cycle begins with ticks of the plant, which renew these.
            measurements: Measurements::default(),
            status: DriveStatus::default(),
            record: plant.record,
            plant,
            drive,
            logic,
            actuators,
            command,
            phase_ms: phase_ms % (PLANT_PERIOD_MS * DRIVE_PERIOD_MS),
        }
    }

    /// How far the plant has come.
    pub fn record(&self) -> Record {
        self.record
    }

    /// What acts on the winder until the next drive cycle.
    pub fn actuators(&self) -> &Actuators<R::Si> {
        &self.actuators
    }

    /// What the regulators are to do next.
    pub fn command(&self) -> &DriveCommand<R::Si> {
        &self.command
    }

    /// The time within the common period of both tasks, ms.
    pub fn phase_ms(&self) -> u32 {
        self.phase_ms
    }

    /// What the regulators told last.
    pub fn status(&self) -> &DriveStatus<R::Si> {
        &self.status
    }
}

/// The logic's part: once every drive cycle, after the regulators.
pub fn logic_tick<R: Real>(
    logic: &mut Logic<R>,
    commands: &Commands,
    measurements: &Measurements<R>,
    status: &DriveStatus<R>,
    record: &Record,
    feedback: &mut Feedback,
) -> DriveCommand<R> {
    feedback.set_double(&image::PLANT_TICKS, record.ticks);
    feedback.set_double(&image::TRAJECTORY, record.trajectory);
    let truth = &record.truth;
    feedback.set_word(&image::BROKEN_SPAN, truth.broken_span.into());
    let burst = u16::from(truth.burst) << 3;
    feedback.set_word(&image::WINDING, u16::from(truth.sliding) | burst);
    feedback.set_word(&image::WOUND_ON_TENSION, truth.wound_on_tension);
    feedback.set_word(&image::NIP_LOAD_RD, truth.nip_load[0]);
    feedback.set_word(&image::NIP_LOAD_FD, truth.nip_load[1]);
    logic.step(commands, measurements, status, feedback)
}
