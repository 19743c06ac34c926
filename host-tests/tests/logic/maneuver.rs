//! The unwind maneuver, and the two presets.

use crate::operator::Operator;
use crate::{in_mode, near};
use model_core::image;
use model_core::logic::{Fault, Mode, Refusal, command, status};
use model_core::profidrive::{stw1, zsw1};

/// The unwind's drive alone on, preset taken, no web.
fn alone() -> Operator<f32> {
    let mut o = Operator::new();
    o.press(command::PRESET_ACCEPT);
    o.image.commands.set_word(&image::STW1_UW, stw1::READY);
    o.wait(0.1);
    o.image.commands.set_word(&image::STW1_UW, stw1::RUN);
    o.wait(0.1);
    let on = o.image.feedback.word(&image::ZSW1_UW) & zsw1::OPERATION_ENABLED;
    assert_eq!((o.mode(), on), (Mode::Off, zsw1::OPERATION_ENABLED));
    o
}

/// Surface speed of the parent roll, m/s.
fn v_uw(o: &Operator<f32>) -> f64 {
    o.x().omega_uw * o.x().r_uw
}

#[test]
fn the_unwind_turns_alone_at_its_speed_in_both_directions() {
    for speed in [10.0, 15.0, 25.0] {
        for (bit, sign) in [(command::JOG_FORWARD, 1.0), (command::JOG_BACKWARD, -1.0)] {
            let mut o = alone();
            o.set(&image::V_JOG_SET, speed);
            o.command(bit);
            o.wait(0.1);
            assert_eq!(o.mode(), Mode::UnwindManeuver);
            o.wait(0.1);
            assert!(!o.is(status::BRAKE_UW) && o.is(status::BRAKE_RD | status::BRAKE_FD));
            let mut fastest = 0.0_f64;
            o.wait_with(15.0, |o| {
                let x = o.x();
                assert_eq!(x.v[2], 0.0, "the drums stand");
                assert_eq!(o.t(), [0.0; 3]);
                fastest = fastest.max(v_uw(o).abs());
            });
            let v = speed / 60.0;
            near("jog speed", v_uw(&o), sign * v, 0.002);
            assert!(fastest < 1.1 * v, "{fastest} m/s");
            // it ends when released: ramp, brake, and the drive may be used again
            let before = o.x().r_uw;
            o.command(0);
            o.until(5.0, |o| o.mode() == Mode::Off);
            o.wait(0.5);
            assert!(o.is(status::BRAKE_UW | status::ZERO_SPEED));
            assert_eq!(o.x().omega_uw, 0.0);
            assert_eq!(o.x().r_uw, before, "without web no paper is lost");
            o.command(bit);
            o.wait(0.1);
            assert_eq!(o.mode(), Mode::UnwindManeuver);
        }
    }
}

/// Set-points beyond 10 to 25 m/min are limited, as a drive does.
#[test]
fn the_jog_speed_is_limited() {
    for (set, speed) in [(0_u16, 10.0), (u16::MAX, 25.0)] {
        let mut o = alone();
        o.image.commands.set_word(&image::V_JOG_SET, set);
        o.command(command::JOG_FORWARD);
        o.wait(15.0);
        near("jog", v_uw(&o) * 60.0, speed, 0.2);
    }
}

/// Bits 8 and 9 of the unwind's control word, while bits 4 to 6 are 0.
#[test]
fn the_unwind_jogs_by_its_own_control_word() {
    let base = stw1::RUN & !(stw1::ENABLE_RAMP | stw1::UNFREEZE_RAMP | stw1::ENABLE_SETPOINT);
    for (jog, sign) in [(stw1::JOG_1, 1.0), (stw1::JOG_2, -1.0)] {
        let mut o = alone();
        o.image.commands.set_word(&image::STW1_UW, stw1::RUN | jog);
        o.wait(1.0);
        assert_eq!(o.mode(), Mode::Off, "the ramp generator is enabled");
        o.image.commands.set_word(&image::STW1_UW, base);
        o.wait(0.1);
        o.image.commands.set_word(&image::STW1_UW, base | jog);
        o.wait(15.0);
        assert_eq!(o.mode(), Mode::UnwindManeuver);
        near("jog", v_uw(&o) * 60.0, sign * 15.0, 0.2);
        o.image.commands.set_word(&image::STW1_UW, base);
        o.until(5.0, |o| o.mode() == Mode::Off);
    }
}

#[test]
fn both_directions_at_once_are_none() {
    let mut o = alone();
    o.command(command::JOG_FORWARD | command::JOG_BACKWARD);
    o.wait(1.0);
    assert_eq!((o.mode(), o.refusal()), (Mode::Off, Refusal::Contradictory));
    // nothing starts by itself when one of them goes
    o.command(command::JOG_FORWARD);
    o.wait(1.0);
    assert_eq!(o.mode(), Mode::Off);
    // in the middle of a maneuver it stops
    o.command(0);
    o.wait(0.1);
    o.command(command::JOG_FORWARD);
    o.wait(5.0);
    o.command(command::JOG_FORWARD | command::JOG_BACKWARD);
    o.until(5.0, |o| o.mode() == Mode::Off);
    assert_eq!(o.refusal(), Refusal::Contradictory);
}

#[test]
fn a_maneuver_is_refused_with_its_reason() {
    let mut o = Operator::<f32>::new();
    o.command(command::JOG_FORWARD);
    o.wait(0.1);
    assert_eq!((o.mode(), o.refusal()), (Mode::Off, Refusal::UnwindNotOn));
    let mut o = in_mode(Mode::Ready);
    o.command(command::JOG_FORWARD);
    o.wait(0.1);
    assert_eq!(
        (o.mode(), o.refusal()),
        (Mode::Ready, Refusal::WebInMachine)
    );
    // without the web it may, and ends where it came from
    o.command(0);
    o.press(command::WEB_REMOVED);
    o.command(command::JOG_FORWARD);
    o.wait(5.0);
    assert_eq!(
        (o.mode(), o.refusal()),
        (Mode::UnwindManeuver, Refusal::None)
    );
    o.command(0);
    o.until(5.0, |o| o.mode() == Mode::Ready);
}

/// OFF2, OFF3, a lost heartbeat: no torque, and the brake stops the roll: J·ω/T_b.
#[test]
fn a_stop_ends_a_maneuver_by_the_brake() {
    for stop in [stw1::NO_COAST, stw1::NO_QUICK_STOP, 0] {
        let mut o = alone();
        o.set(&image::V_JOG_SET, 25.0);
        o.command(command::JOG_FORWARD);
        o.wait(15.0);
        if stop == 0 {
            o.silent = true;
            o.until(0.6, |o| o.fault() == Fault::HeartbeatLost);
        } else {
            o.image
                .commands
                .set_word(&image::STW1_UW, stw1::RUN & !stop);
            o.cycle();
        }
        assert_eq!(o.mode(), Mode::Off);
        let x = o.x();
        let machine = o.machine.clone();
        let inertia = machine.parent_roll_offset() + machine.web.roll_inertia(x.r_uw);
        let time = o.until(10.0, |o| o.x().omega_uw == 0.0);
        let expected = 0.05 + x.omega_uw * inertia / machine.brakes.uw_n_m;
        near("stop", time, expected, 0.06);
    }
}

/// Two presets stand ready; the bit says which one is accepted.
#[test]
fn either_preset_is_taken_over() {
    let mut o = Operator::<f32>::new();
    o.set(&image::D_PRESET_UW, 2800.0);
    o.set(&image::D_PRESET_2_UW, 1200.0);
    for (select, diameter) in [(0, 2800.0), (command::PRESET_2, 1200.0), (0, 2800.0)] {
        o.command(select);
        o.wait(0.1);
        o.command(select | command::PRESET_ACCEPT);
        o.wait(0.1);
        near("d_uw", o.value(&image::D_UW), diameter, 0.05);
        o.command(select);
        o.wait(0.1);
        near("d_uw", o.value(&image::D_UW), diameter, 0.05);
    }
    o.set(&image::D_PRESET_2_UW, 700.0);
    o.press(command::PRESET_2 | command::PRESET_ACCEPT);
    assert_eq!(o.refusal(), Refusal::PresetOutOfRange);
    near("d_uw", o.value(&image::D_UW), 2800.0, 0.05);
}
