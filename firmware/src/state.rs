//! The whole state of the simulator between two drive cycles: to keep it, and to go on from it.
//!
//! Not here: how the parts are brought together where they run in tasks of their own; that is the tasks'.

use model_core::drive::{DRIVE_PERIOD_MS, Drive};
use model_core::exchange::{Actuators, DriveCommand};
use model_core::image::{Commands, Feedback, Image};
use model_core::logic::Logic;
use model_core::machine::{Machine, MachineError};
use model_core::real::Scalar;
use model_core::simulator::Plant;

use crate::SPANS;

/// Everything that the future depends on. From equal states, equal commands lead to the same bits.
#[derive(Clone, Debug)]
pub struct State<R: Scalar> {
    /// The plant's part.
    pub plant: Plant<R, SPANS>,
    /// The regulators.
    pub drive: Drive<R::Si>,
    /// The logic.
    pub logic: Logic<R::Si>,
    /// What acts on the winder until the next drive cycle.
    pub actuators: Actuators<R::Si>,
    /// What the regulators are to do in it.
    pub command: DriveCommand<R::Si>,
    /// The process image.
    pub image: Image,
    /// Whether the drive cycle before it was the first of two: plant and regulators have a common tick in every second
    /// one only.
    pub odd: bool,
}

impl<R: Scalar> State<R> {
    /// A machine at power-up; fails with the first parameter outside its limits.
    pub fn fresh(machine: &Machine) -> Result<Self, MachineError> {
        Ok(Self {
            plant: Plant::new(machine)?,
            drive: Drive::new(machine),
            logic: Logic::new(machine),
            actuators: Actuators::default(),
            command: DriveCommand::default(),
            image: Image {
                commands: Commands::of(machine),
                feedback: Feedback::default(),
            },
            odd: false,
        })
    }

    /// The time within the common period of both tasks, ms.
    pub fn phase_ms(&self) -> u32 {
        if self.odd { DRIVE_PERIOD_MS } else { 0 }
    }
}
