//! The drive logic: its table walked, random commands, every fault with its effect and its reaction.
//!
//! Not here: how well the regulators hold what the logic asks for.
#![allow(clippy::float_cmp, clippy::unwrap_used)]

mod autotune;
mod bus;
mod faults;
mod maneuver;
#[path = "../operator/mod.rs"]
mod operator;
mod random;
mod table;
mod words;

use model_core::image::{self, Signal};
use model_core::logic::{Mode, command, status};
use operator::Operator;

/// Run speed, m/s.
const RUN: f64 = 2200.0 / 60.0;
/// Tension at the default machine, N.
const TENSION: f64 = 2800.0;

#[track_caller]
fn near(what: &str, value: f64, expected: f64, tolerance: f64) {
    assert!(
        (value - expected).abs() <= tolerance,
        "{what}: {value} is not {expected} ± {tolerance}"
    );
}

/// Sets a word as it travels: the faults' bits.
fn put(o: &mut Operator<f32>, signal: &Signal, word: u16) {
    o.image.commands.set_word(signal, word);
}

/// A web at rest in thread.
fn threaded() -> Operator<f32> {
    let mut o = Operator::new();
    o.thread();
    o.wait(5.0);
    o
}

/// Run at a speed, m/min, for some seconds.
fn running_at(speed: f64) -> Operator<f32> {
    let mut o = threaded();
    o.set(&image::V_SET, speed);
    o.run_up();
    o.wait(15.0);
    o
}

/// Stall tension after a stop.
fn stalled() -> Operator<f32> {
    let mut o = threaded();
    o.command(0);
    o.until(20.0, |o| o.mode() == Mode::Stall);
    o.wait(2.0);
    o
}

/// The winder in a mode.
fn in_mode(mode: Mode) -> Operator<f32> {
    let mut o = match mode {
        Mode::Off => {
            let mut o = Operator::new();
            o.press(command::PRESET_ACCEPT);
            o.press(command::WEB_THREADED);
            o
        }
        Mode::Ready => {
            let mut o = Operator::new();
            o.prepare();
            o
        }
        Mode::Thread => threaded(),
        Mode::Stall => stalled(),
        Mode::UnwindManeuver => {
            let mut o = Operator::new();
            o.press(command::PRESET_ACCEPT);
            o.switch_on();
            o.command(command::JOG_FORWARD);
            o.wait(1.0);
            o
        }
        _ => running_at(300.0),
    };
    use model_core::profidrive::stw1;
    match mode {
        Mode::NormalStop => o.command(0),
        Mode::EmergencyStop => o.drives(stw1::RUN & !stw1::NO_QUICK_STOP),
        Mode::CoastStop => o.drives(stw1::RUN & !stw1::NO_COAST),
        Mode::AutoTune => unreachable!("auto-tune has tests of its own"),
        Mode::WebBreakStop => {
            o.simulator.plant.winder_mut().break_web();
            o.until(1.0, |o| o.is(status::WEB_BREAK));
        }
        _ => {}
    }
    o.wait(0.1);
    assert_eq!(o.mode(), mode);
    o
}
