//! Steps of plant, regulators and logic between marks.
//!
//! Does not count: that is the plugin's. What a step was is found out after it has been counted.

use core::hint::black_box;

use model_core::drive::{DRIVE_PERIOD_MS, Drive};
use model_core::exchange::{Actuators, Brakes, DriveCommand, DriveStatus};
use model_core::image::Feedback;
use model_core::logic::Logic;
use model_core::machine::{MAX_SPANS, Machine};
use model_core::plant::{PLANT_PERIOD_MS, Winder};
use model_core::real::Scalar;
use model_core::simulator::{Plant, logic_tick};
use model_core::twin::{self, Course, Extent, Moving};

use crate::Error;
use crate::marks::*;

/// Steps of the motion alone: one would do where nothing is decided on, and more show that it is so.
const STEPS: usize = 1000;

/// Counts what a preset takes: its course without and with slip, and the whole simulator.
pub fn count<R: Scalar>(name: &str) -> Result<(), Error> {
    let machine = Machine::preset(name).ok_or(Error::Unknown)?;
    count_begin();
    count_end();
    count_as_nothing();
    match machine.idle.len() + 1 {
        3 => count_with::<R, 3>(machine),
        MAX_SPANS => count_with::<R, MAX_SPANS>(machine),
        _ => Err(Error::Unknown),
    }
}

fn count_with<R: Scalar, const SPANS: usize>(mut machine: Machine) -> Result<(), Error> {
    motion::<R, SPANS>(&machine);
    simulator::<R, SPANS>(&machine)?;
    plant::<R, SPANS>(&machine)?;
    twin::may_slip(&mut machine);
    plant::<R, SPANS>(&machine)
}

/// The motion alone: its arithmetic, the same in every step.
fn motion<R: Scalar, const SPANS: usize>(machine: &Machine) {
    let mut moving = Moving::<R, SPANS>::of(machine);
    for _ in 0..STEPS {
        let moving = black_box(&mut moving);
        count_begin();
        moving.step();
        count_end();
        count_as_motion();
    }
}

/// The plant alone, through its short course.
fn plant<R: Scalar, const SPANS: usize>(machine: &Machine) -> Result<(), Error> {
    let period = 1e-3 * f64::from(PLANT_PERIOD_MS);
    let mut winder = Winder::<R, SPANS>::new(machine, period).map_err(Error::Machine)?;
    for (_, actuators) in Course::of(machine, Extent::Short).steps::<R::Si>() {
        // in memory, as it is where a task calls it
        let (winder, actuators) = (black_box(&mut winder), black_box(&actuators));
        count_begin();
        let measured = winder.step(actuators);
        count_end();
        let braked = black_box(measured).brakes != Brakes::default();
        let sliding = winder.winding().slides.contains(&true);
        match (machine.nips.slip, braked, sliding) {
            (true, _, true) => count_as_sliding(),
            (true, _, false) => count_as_gripping(),
            (false, true, _) => count_as_braked(),
            (false, false, _) => count_as_smooth(),
        }
    }
    Ok(())
}

/// All three parts, in the order of [`model_core::simulator::Simulator`].
fn simulator<R: Scalar, const SPANS: usize>(machine: &Machine) -> Result<(), Error> {
    let mut plant = Plant::<R, SPANS>::new(machine).map_err(Error::Machine)?;
    let (mut drive, mut logic) = (Drive::<R::Si>::new(machine), Logic::<R::Si>::new(machine));
    let mut actuators = Actuators::default();
    let mut status = DriveStatus::default();
    let mut command = DriveCommand::default();
    let mut feedback = Feedback::default();
    let mut plant_ticks = 0;
    for cycle in 0..twin::CYCLES {
        let commands = twin::commands(machine, cycle);
        let mut seen = None;
        while plant_ticks < (cycle + 1) * DRIVE_PERIOD_MS / PLANT_PERIOD_MS {
            plant_ticks += 1;
            let (plant, actuators) = (black_box(&mut plant), black_box(&actuators));
            count_begin();
            let now = plant.tick(actuators);
            count_end();
            count_as_tick();
            seen = Some(now);
        }
        let Some((measurements, record)) = seen else {
            continue;
        };
        let (drive, command_now) = (black_box(&mut drive), black_box(&command));
        count_begin();
        drive.step(command_now, &measurements, &mut actuators, &mut status);
        count_end();
        count_as_drive();
        (actuators, status) = black_box((actuators, status));

        let (logic, feedback) = (black_box(&mut logic), black_box(&mut feedback));
        count_begin();
        let next = logic_tick(logic, &commands, &measurements, &status, &record, feedback);
        count_end();
        count_as_logic();
        command = next;
    }
    Ok(())
}
