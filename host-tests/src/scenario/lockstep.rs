//! A scenario on a simulator in this process, both in lockstep: no network, no clock, as fast as the PC can.
//!
//! Not here: the simulator's parts and their order; they are the core's.

use anyhow::{Context, Result};
use firmware::{SPANS, Scalar};
use model_core::image::{self, Commands, Feedback, Image};
use model_core::machine::{Machine, MachineError};
use model_core::simulator::Simulator;

use super::Scenario;
use super::player::{Failure, Player, Timing};

/// A simulator with its image; a clone is a snapshot, which goes on to the same bits.
#[derive(Clone, Debug)]
pub struct Bench {
    /// Plant, regulators and logic.
    pub simulator: Simulator<Scalar, SPANS>,
    /// What a PLC sees.
    pub image: Image,
    /// Drive cycles since power-up.
    pub cycle: u64,
}

impl Bench {
    /// At power-up; fails with the first parameter outside its limits, or when the machine has another number of
    /// spans than the firmware's.
    pub fn new(machine: &Machine) -> Result<Self, MachineError> {
        Ok(Self {
            simulator: Simulator::new(machine)?,
            image: Image {
                commands: Commands::of(machine),
                feedback: Feedback::default(),
            },
            cycle: 0,
        })
    }

    /// One drive cycle with these commands.
    pub fn step(&mut self, commands: &Commands) {
        self.image.commands = *commands;
        self.simulator.drive_cycle(&mut self.image);
        self.cycle += 1;
    }

    /// Hash over the plant's trajectory, as the image tells it.
    pub fn trajectory(&self) -> u32 {
        self.image.feedback.double(&image::TRAJECTORY)
    }
}

/// What came of a scenario.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// What was not as expected, in order of time.
    pub failures: Vec<Failure>,
    /// Drive cycles that were simulated.
    pub cycles: u64,
    /// Hash over the plant's trajectory.
    pub trajectory: u32,
}

/// Plays a scenario; `look` sees the simulator after each drive cycle.
pub fn play<'a>(
    scenario: &'a Scenario,
    mut look: impl FnMut(&Bench, &Player<'a>),
) -> Result<Outcome> {
    let mut bench = Bench::new(&scenario.machine.machine)
        .with_context(|| format!("{}: the machine cannot be simulated", scenario.name))?;
    let mut player = Player::new(scenario, Timing::LOCKSTEP);
    loop {
        player.look(bench.cycle, &bench.image.feedback);
        if player.is_done() {
            break;
        }
        bench.step(player.commands());
        look(&bench, &player);
    }
    Ok(Outcome {
        failures: player.failures().to_vec(),
        cycles: bench.cycle,
        trajectory: bench.trajectory(),
    })
}
