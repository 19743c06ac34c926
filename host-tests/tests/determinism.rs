//! One set of paper, twice: bit for bit in the same scalar, and within a hair in the other.
//!
//! Not here: other machines and other builds; the trajectory's hash compares them wherever both can run.
// the same bits are meant
#![allow(clippy::float_cmp, clippy::unwrap_used)]

mod operator;

use std::f64::consts::PI;

use model_core::image::{self, Commands};
use model_core::logic::{Mode, command};
use model_core::real::Float;
use operator::{CYCLE, Operator};

/// Diameter of the finished roll, m.
const DIAMETER: f64 = 1.25;
/// Way of a normal stop from run speed, m.
const STOP: f64 = 1535.08;
/// Run speed, m/s.
const RUN: f64 = 2200.0 / 60.0;

/// Winds the default set: new rolls, preset, drives on, thread, run, normal stop at 1.25 m, stall tension. Gives the commands of every drive cycle.
fn wind<R: Float>(o: &mut Operator<R>, mut look: impl FnMut(&Operator<R>)) -> Vec<Commands> {
    let roll = &o.machine.shipping_roll;
    let area = PI * ((0.5 * DIAMETER).powi(2) - roll.core_radius_m.powi(2));
    let length = area / o.machine.web.caliper_m;
    o.press(command::NEW_CORE | command::NEW_PARENT_ROLL);
    o.thread();
    o.wait(5.0);
    let mut log = Vec::new();
    let mut record = |o: &Operator<R>| {
        log.push(o.image.commands);
        look(o);
    };
    o.command(command::RUN);
    o.until(1000.0, |o| {
        record(o);
        o.value(&image::LENGTH_WU) >= length - STOP - RUN * CYCLE
    });
    o.command(0);
    o.until(100.0, |o| {
        record(o);
        o.mode() == Mode::Stall
    });
    o.wait_with(10.0, record);
    log
}

/// What a set leaves behind: ticks and hash of the trajectory, every half second.
fn trajectory(o: &mut Operator<f32>) -> Vec<(u32, u32)> {
    let mut trajectory = Vec::new();
    wind(o, |o| {
        if o.cycles.is_multiple_of(50) {
            let record = o.simulator.record();
            trajectory.push((record.ticks, record.trajectory));
        }
    });
    trajectory
}

#[test]
fn the_same_commands_give_the_same_bits() {
    let once = trajectory(&mut Operator::new());
    assert_eq!(once, trajectory(&mut Operator::new()));
    // one count of one set-point makes another trajectory
    let mut other = Operator::new();
    let tension = other.machine.operation.tension_n_m;
    other.set(&image::TENSION_SET, tension + 1.0);
    let other = trajectory(&mut other);
    assert_eq!(once[0], other[0], "the set-point acts in run");
    assert_ne!(once[20], other[20]);
}

/// The set ends within 2 mm of its diameter, by commands alone.
#[test]
fn the_roll_ends_at_its_diameter() {
    let mut o = Operator::<f32>::new();
    wind(&mut o, |_| ());
    let diameter = 2.0 * o.x().r_wu;
    assert!((diameter - DIAMETER).abs() < 2e-3, "{diameter} m");
    assert_eq!(o.mode(), Mode::Stall);
}

/// All through the set, with the commands that `f64` needed given to `f32` in the same cycles.
#[test]
fn f32_stays_within_a_micrometre_and_two_newtons_of_f64() {
    let mut exact = Vec::new();
    let log = wind(&mut Operator::<f64>::new(), |o| exact.push((o.x(), o.t())));
    let mut cycle = 0;
    let same = wind(&mut Operator::<f32>::new(), |o| {
        let ((x, t), (x_64, t_64)) = ((o.x(), o.t()), &exact[cycle]);
        for (r, r_64) in [(x.r_uw, x_64.r_uw), (x.r_wu, x_64.r_wu)] {
            assert!((r - r_64).abs() < 1e-6, "cycle {cycle}: {r} m and {r_64} m");
        }
        for (t, t_64) in t.into_iter().zip(t_64) {
            assert!((t - t_64).abs() < 2.0, "cycle {cycle}: {t} N and {t_64} N");
        }
        for (v, v_64) in x.v.into_iter().zip(x_64.v) {
            assert!(
                (v - v_64).abs() < 1e-4,
                "cycle {cycle}: {v} m/s and {v_64} m/s"
            );
        }
        cycle += 1;
    });
    assert!(
        log == same,
        "what an operator sees is the same, so he does the same"
    );
}
