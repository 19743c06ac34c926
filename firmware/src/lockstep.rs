//! The simulator in one hand, for where there is no executor: a native process, a replay.
//!
//! Not here: the clock. Whoever calls [`Lockstep::cycle`] every 10 ms makes it run in real time; the result does
//! not depend on it.

use model_core::image::Image;
use model_core::machine::{Machine, MachineError};
use model_core::simulator::Simulator;

use crate::journal::{Journal, Observer};
use crate::{SPANS, Scalar};

/// The simulator with its journal; does in one call what the three tasks do in a drive cycle.
///
/// A clone is a snapshot: with the image of the same moment it goes on to the same bits.
#[derive(Clone, Debug)]
pub struct Lockstep<J> {
    simulator: Simulator<Scalar, SPANS>,
    observer: Observer,
    cycle: u32,
    journal: J,
}

impl<J: Journal> Lockstep<J> {
    /// The simulator of a machine at power-up, where `image` stands; fails with the first parameter outside its
    /// limits.
    pub fn new(machine: &Machine, image: &Image, journal: J) -> Result<Self, MachineError> {
        Ok(Self {
            simulator: Simulator::new(machine)?,
            observer: Observer::new(image.commands),
            cycle: 0,
            journal,
        })
    }

    /// One drive cycle of 10 ms.
    pub fn cycle(&mut self, image: &mut Image) {
        self.simulator.drive_cycle(image);
        self.observer.look(self.cycle, image, &mut self.journal);
        self.cycle = self.cycle.wrapping_add(1);
    }
}
