//! The drive bus: its delay, its silence, the heartbeats of both ends.

use crate::operator::{CYCLE, Operator};
use crate::{near, put, running_at};
use model_core::image;
use model_core::logic::{Fault, Mode, command, command_2, inject, status};

/// Cycles from a command to the sight of its effect.
fn round_trip(delay: u16) -> u32 {
    let mut o = Operator::<f32>::new();
    put(&mut o, &image::BUS_DELAY, delay);
    o.wait(0.5);
    o.command(command::PRESET_ACCEPT);
    let start = o.cycles;
    o.until(1.0, |o| o.is(status::PRESET_TAKEN));
    o.cycles - start
}

/// One way takes one cycle less than the delay beyond the present one, and so does the other.
#[test]
fn the_delay_counts_in_both_directions() {
    for delay in 1..=10_u16 {
        assert_eq!(round_trip(delay), 1 + 2 * u32::from(delay - 1), "{delay}");
    }
    // what is set beyond the limits is limited
    assert_eq!(round_trip(0), 1);
    assert_eq!(round_trip(99), 19);
}

/// The PLC's words behind the simulator's travel by the bus as its first ones do.
#[test]
fn all_words_of_the_plc_travel_by_the_bus() {
    let mut o = Operator::<f32>::new();
    put(&mut o, &image::BUS_DELAY, 5);
    o.wait(0.5);
    put(&mut o, &image::RIDER_LOAD_SET, 500);
    let load = o.value(&image::RIDER_LOAD);
    let time = o.until(1.0, |o| o.value(&image::RIDER_LOAD) < 0.6 * load);
    // four cycles there, one for the regulators to take it, four back
    near("load after", time, 10.0 * CYCLE, 0.5 * CYCLE);
    put(&mut o, &image::FAULT_DRIVES, inject::BUS_SILENT);
    put(&mut o, &image::WINDER_COMMAND_2, command_2::RIDER_UP);
    o.wait(1.0);
    assert!(!o.simulator.actuators().rider.lifted);
    put(&mut o, &image::FAULT_DRIVES, 0);
    o.wait(0.2);
    assert!(o.simulator.actuators().rider.lifted);
}

/// The simulator's own words are never late, and the heartbeat of the drives is late by the delay.
#[test]
fn the_simulator_s_own_words_are_not_delayed() {
    let mut o = Operator::<f32>::new();
    put(&mut o, &image::BUS_DELAY, 5);
    o.wait(1.0);
    assert_eq!(
        o.image.feedback.double(&image::PLANT_TICKS),
        o.simulator.record().ticks
    );
    let beat = o.image.feedback.word(&image::HEARTBEAT);
    assert_eq!(u32::from(beat), o.cycles - 4);
}

/// Nothing passes: the drives miss the PLC's heartbeat and stop normally, the PLC sees theirs stand still.
#[test]
fn a_silent_bus_stops_the_winder_and_shows_it() {
    let mut o = running_at(300.0);
    put(&mut o, &image::FAULT_DRIVES, inject::BUS_SILENT);
    o.cycle();
    let seen = o.image.feedback;
    o.drives(0);
    o.wait_with(60.0, |o| {
        for signal in [
            &image::HEARTBEAT,
            &image::MODE,
            &image::V_WEB,
            &image::FAULT,
        ] {
            assert_eq!(
                o.image.feedback.word(signal),
                seen.word(signal),
                "{}",
                signal.name
            );
        }
    });
    // 0.5 s, then the stop
    assert_eq!(o.simulator.logic.mode(), Mode::Off);
    assert_eq!(o.x().v[2], 0.0);
    put(&mut o, &image::FAULT_DRIVES, 0);
    o.wait(0.1);
    assert_eq!((o.fault(), o.mode()), (Fault::HeartbeatLost, Mode::Off));
}

/// The time is a parameter, within its limits.
#[test]
fn the_heartbeat_time_is_a_parameter() {
    for (time, expected) in [(100.0, 0.1), (500.0, 0.5), (2000.0, 2.0)] {
        let mut o = Operator::<f32>::new();
        o.prepare();
        o.set(&image::HEARTBEAT_TIME, time);
        o.wait(0.5);
        o.silent = true;
        let found = o.until(5.0, |o| o.fault() == Fault::HeartbeatLost);
        near("found after", found, expected, 2.0 * CYCLE);
        o.cycle();
        assert_eq!(o.mode(), Mode::Off);
    }
}

/// It counts every drive cycle, by one, and wraps.
#[test]
fn the_drives_heartbeat_counts_cycles() {
    let mut o = Operator::<f32>::new();
    let mut last = o.image.feedback.word(&image::HEARTBEAT);
    for _ in 0..70_000 {
        o.cycle();
        let beat = o.image.feedback.word(&image::HEARTBEAT);
        assert_eq!(beat, last.wrapping_add(1));
        last = beat;
    }
}
