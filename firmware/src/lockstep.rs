//! The simulator in one hand, for where there is no executor: a native process, a replay.
//!
//! Not here: the clock. Whoever calls [`Lockstep::cycle`] every 10 ms makes it run in real time; the result does
//! not depend on it.

use model_core::drive::DRIVE_PERIOD_MS;
use model_core::image::Image;
use model_core::machine::{Machine, MachineError};
use model_core::simulator::Simulator;

use crate::attendant::{Attendant, Done, Order};
use crate::journal::{Journal, Observer};
use crate::state::State;
use crate::{SPANS, Scalar};

/// The simulator with its journal; does in one call what the three tasks do in a drive cycle.
///
/// A clone is a snapshot: with the image of the same moment it goes on to the same bits.
#[derive(Clone, Debug)]
pub struct Lockstep<J> {
    simulator: Simulator<Scalar, SPANS>,
    observer: Observer,
    kept: Option<State<Scalar>>,
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
            kept: None,
            cycle: 0,
            journal,
        })
    }

    /// One drive cycle of 10 ms.
    pub fn cycle(&mut self, image: &mut Image) {
        self.attended_cycle(image, &mut ());
    }

    /// One drive cycle of 10 ms with somebody there.
    pub fn attended_cycle(&mut self, image: &mut Image, attendant: &mut impl Attendant) {
        let cycle = self.cycle;
        self.cycle = cycle.wrapping_add(1);
        attendant.before(cycle, image);
        self.simulator.drive_cycle(image);
        self.observer.look(cycle, image, &mut self.journal);
        attendant.after(cycle, image);
        let goes_on = match attendant.order() {
            None => return,
            Some(Order::Keep) => {
                self.kept = Some(self.state(image));
                attendant.done(self.cycle, Done::Kept, image);
                return;
            }
            Some(Order::Restore) => self.kept.clone(),
            Some(Order::Rebuild(machine)) => State::fresh(&machine).ok(),
        };
        if let Some(state) = goes_on {
            self.go_on_from(state, image);
            attendant.done(self.cycle, Done::GoesOn, image);
        }
    }

    /// The state, with the image of the same moment.
    pub fn state(&self, image: &Image) -> State<Scalar> {
        let s = &self.simulator;
        State {
            plant: s.plant.clone(),
            drive: s.drive,
            logic: s.logic.clone(),
            actuators: *s.actuators(),
            command: *s.command(),
            image: *image,
            odd: s.phase_ms() % (2 * DRIVE_PERIOD_MS) != 0,
        }
    }

    /// Goes on from another state.
    pub fn go_on_from(&mut self, state: State<Scalar>, image: &mut Image) {
        let phase_ms = state.phase_ms();
        *image = state.image;
        self.simulator = Simulator::resume(
            state.plant,
            state.drive,
            state.logic,
            state.actuators,
            state.command,
            phase_ms,
        );
    }
}
