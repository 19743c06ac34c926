//! The set of paper that every scalar winds, against the converged solution.
//!
//! The converged solution is the same winder with the same regulators, its plant integrated in f64 in steps of 0.5 ms
//! instead of 4. So it tells what the plant's step costs, and, beside that, what a scalar costs.
#![allow(clippy::unwrap_used)]

mod operator;

use model_core::drive::{DRIVE_PERIOD_MS, Drive};
use model_core::exchange::{Actuators, DriveCommand, DriveStatus};
use model_core::fixed::Word;
use model_core::image::{self, Commands, Feedback, Image};
use model_core::logic::{Logic, Mode, command};
use model_core::machine::Machine;
use model_core::plant::Winder;
use model_core::real::{Real, Scalar};
use model_core::simulator::{Record, Simulator, logic_tick};
use operator::Operator;

/// Step of the converged solution, s.
const FINE: f64 = 0.5e-3;

/// What is compared after every drive cycle.
struct Sample {
    r: [f64; 2],
    v: [f64; 3],
    t: [f64; 3],
}

impl Sample {
    fn of<R: Scalar>(winder: &Winder<R, 3>) -> Self {
        let x = winder.state();
        Self {
            r: [x.r_uw, x.r_wu].map(Real::to_f64),
            v: x.v.map(Real::to_f64),
            t: winder.tension().map(Real::to_f64),
        }
    }
}

/// The commands of a whole set, cycle by cycle: thread, run, normal stop, stall tension.
fn commands() -> Vec<Commands> {
    let mut o = Operator::<f64>::new();
    o.log = Some(Vec::new());
    o.press(command::NEW_CORE | command::NEW_PARENT_ROLL);
    o.thread();
    o.command(command::RUN);
    o.until(1000.0, |o| o.value(&image::LENGTH_WU) >= 17_200.0);
    o.command(0);
    o.until(100.0, |o| o.mode() == Mode::Stall);
    o.wait(5.0);
    o.log.unwrap_or_default()
}

/// The set as a simulator winds it.
fn wind<R: Scalar>(machine: &Machine, commands: &[Commands]) -> Vec<Sample> {
    let mut simulator = Simulator::<R, 3>::new(machine).unwrap();
    let mut image = Image {
        commands: Commands::of(machine),
        feedback: Feedback::default(),
    };
    let samples = commands.iter().map(|commands| {
        image.commands = *commands;
        simulator.drive_cycle(&mut image);
        Sample::of(simulator.plant.winder())
    });
    samples.collect()
}

/// The converged solution.
fn converge(machine: &Machine, commands: &[Commands]) -> Vec<Sample> {
    let steps = (1e-3 * f64::from(DRIVE_PERIOD_MS) / FINE).round() as u32;
    let mut winder = Winder::<f64, 3>::new(machine, FINE).unwrap();
    let (mut drive, mut logic) = (Drive::new(machine), Logic::new(machine));
    let (mut actuators, mut command) = (Actuators::default(), DriveCommand::default());
    let mut status = DriveStatus::default();
    let (mut feedback, record) = (Feedback::default(), Record::default());
    let samples = commands.iter().map(|commands| {
        let mut measurements = Default::default();
        for _ in 0..steps {
            measurements = winder.step(&actuators);
        }
        drive.step(&command, &measurements, &mut actuators, &mut status);
        command = logic_tick(
            &mut logic,
            commands,
            &measurements,
            &status,
            &record,
            &mut feedback,
        );
        Sample::of(&winder)
    });
    samples.collect()
}

/// Largest differences: radii, m; speeds, m/s; tensions, N.
fn differences(samples: &[Sample], exact: &[Sample]) -> [f64; 3] {
    let largest = |values: fn(&Sample) -> &[f64]| {
        let pairs = samples.iter().zip(exact);
        pairs
            .flat_map(|(a, b)| values(a).iter().zip(values(b)))
            .fold(0.0, |largest: f64, (a, b)| largest.max((a - b).abs()))
    };
    [largest(|s| &s.r), largest(|s| &s.v), largest(|s| &s.t)]
}

#[test]
fn single_precision_and_fixed_point_cost_nothing_beside_the_step() {
    let machine = Machine::news_8000();
    let commands = commands();
    let exact = converge(&machine, &commands);
    let double = wind::<f64>(&machine, &commands);
    let step = differences(&double, &exact);
    for (name, samples) in [
        ("f32", wind::<f32>(&machine, &commands)),
        ("fixed", wind::<Word>(&machine, &commands)),
    ] {
        let all = differences(&samples, &exact);
        for ((what, all), step) in ["radii", "speeds", "tensions"].iter().zip(all).zip(step) {
            assert!(
                all <= 1.05 * step,
                "{name}: {what} are off by {all}, and by {step} in f64"
            );
        }
        let [radii, ..] = differences(&samples, &double);
        assert!(
            radii < 1e-6,
            "{name}: radii differ by {radii} m from those in f64"
        );
    }
}
