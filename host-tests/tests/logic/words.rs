//! Control and status words of the sections, bit by bit, and the drive that one of them is.

use crate::operator::Operator;
use crate::{TENSION, in_mode, near, put, running_at, threaded};
use model_core::exchange::TuneAbort;
use model_core::image::{self, Signal};
use model_core::logic::{Fault, Mode, Refusal, command, command_2, status};
use model_core::plant::nip::Nips;
use model_core::profidrive::{stw1, zsw1};

const SECTIONS: [(&Signal, &Signal); 4] = [
    (&image::STW1_UW, &image::ZSW1_UW),
    (&image::STW1_RD, &image::ZSW1_RD),
    (&image::STW1_FD, &image::ZSW1_FD),
    (&image::STW1_RR, &image::ZSW1_RR),
];

/// The state bits 0 to 2 and 6, and the echoes of OFF2 and OFF3, all through the start sequence and back; numbers as
/// the profile has them.
#[test]
fn each_section_answers_its_control_word_to_the_bit() {
    let state = 0b0111_0111;
    for (word, answer) in SECTIONS {
        let mut o = Operator::<f32>::new();
        for (control, expected) in [
            // OFF2 and OFF3 active: inhibited, bits 4 and 5 are 0
            (0x0400, 0b0100_0000),
            // OFF3 still active
            (0x0402, 0b0101_0000),
            // OFF2 still active
            (0x0404, 0b0110_0000),
            // S2 ready to switch on
            (0x047e, 0b0011_0001),
            // S3 switched on, then S4 operation
            (0x0477, 0b0011_0011),
            (0x047f, 0b0011_0111),
            // not by the PLC: the last word counts
            (0x0000, 0b0011_0111),
            // OFF1 at standstill
            (0x047e, 0b0011_0001),
            (0x047f, 0b0011_0111),
            // OFF2: inhibited until ON has been taken back
            (0x047d, 0b0110_0000),
            (0x047f, 0b0111_0000),
            (0x047e, 0b0011_0001),
        ] {
            o.image.commands.set_word(word, control);
            o.wait(0.05);
            let seen = o.image.feedback.word(answer);
            assert_eq!(seen & state, expected, "{control:04x} at {}", word.name);
            // no fault, no warning; control is always asked for; standing at zero is no error
            let rest = zsw1::FAULT | zsw1::WARNING | zsw1::CONTROL_REQUESTED;
            assert_eq!(seen & rest, zsw1::CONTROL_REQUESTED);
            assert_ne!(seen & zsw1::SPEED_WITHIN_TOLERANCE, 0);
            for (_, other) in SECTIONS {
                if other.name != answer.name {
                    let seen = o.image.feedback.word(other);
                    assert_eq!(seen & 0b111, 0, "{} is not commanded", other.name);
                }
            }
        }
    }
}

/// Bits 8 and 10 follow the web speed.
#[test]
fn speed_bits_follow_the_speed() {
    let mut o = in_mode(Mode::Thread);
    o.set(&image::V_SET, 600.0);
    o.command(command::RUN);
    o.wait(5.0);
    for (_, answer) in SECTIONS {
        let word = o.image.feedback.word(answer);
        assert_ne!(word & zsw1::SPEED_WITHIN_TOLERANCE, 0);
        assert_eq!(word & zsw1::SETPOINT_REACHED, 0);
    }
    o.until(60.0, |o| o.is(status::AT_SPEED));
    for (_, answer) in SECTIONS {
        assert_ne!(o.image.feedback.word(answer) & zsw1::SETPOINT_REACHED, 0);
    }
    // a reference that the drums cannot follow: no torque
    o.set(&image::TORQUE_LIMIT_DRUMS, 0.0);
    o.set(&image::V_SET, 1200.0);
    o.wait(15.0);
    for (_, answer) in SECTIONS {
        let word = o.image.feedback.word(answer);
        assert_eq!(word & zsw1::SPEED_WITHIN_TOLERANCE, 0);
    }
}

/// Bits 4 and 6 take the reference to zero along its ramp, bit 5 lets it stand still.
#[test]
fn the_ramp_generator_is_enabled_and_frozen_by_its_bits() {
    for bit in [stw1::ENABLE_RAMP, stw1::ENABLE_SETPOINT] {
        let mut o = running_at(300.0);
        o.drives(stw1::RUN & !bit);
        o.until(60.0, |o| o.value(&image::V_REF) == 0.0);
        assert_eq!(o.mode(), Mode::Run);
        o.drives(stw1::RUN);
        o.until(60.0, |o| o.is(status::AT_SPEED));
    }
    let mut o = running_at(300.0);
    o.set(&image::V_SET, 900.0);
    o.wait(5.0);
    o.drives(stw1::RUN & !stw1::UNFREEZE_RAMP);
    let began = o.value(&image::V_REF);
    o.wait(5.0);
    // the acceleration is rounded off within its jerk: a²/2j
    let frozen = o.value(&image::V_REF);
    near("frozen", frozen, began + 60.0 * 0.45 * 0.45 / 0.4, 1.0);
    o.wait(10.0);
    assert_eq!(o.value(&image::V_REF), frozen);
    assert_eq!((o.mode(), o.value(&image::A_REF)), (Mode::Run, 0.0));
    o.drives(stw1::RUN);
    o.until(60.0, |o| o.is(status::AT_SPEED));
}

/// An acknowledge is an edge, in any section's word or the winder's; a level that stands acknowledges nothing new.
#[test]
fn faults_are_acknowledged_by_an_edge() {
    for (word, _) in SECTIONS {
        let mut o = in_mode(Mode::Ready);
        o.silent = true;
        o.wait(1.0);
        assert!(o.is(status::FAULT));
        o.silent = false;
        o.drives(stw1::READY);
        o.wait(0.1);
        o.image
            .commands
            .set_word(word, stw1::READY | stw1::ACKNOWLEDGE);
        o.wait(0.1);
        assert!(!o.is(status::FAULT), "by {}", word.name);
        // the bit still stands: a new fault stays
        o.drives(stw1::RUN | stw1::ACKNOWLEDGE);
        o.until(1.0, |o| o.mode() == Mode::Ready);
        o.silent = true;
        o.wait(1.0);
        o.silent = false;
        o.wait(1.0);
        assert!(o.is(status::FAULT));
        o.command(command::ACKNOWLEDGE);
        o.wait(0.1);
        assert!(o.is(status::FAULT), "no edge: the sections' bit stands");
        o.command(0);
        o.drives(stw1::READY);
        o.wait(0.1);
        o.command(command::ACKNOWLEDGE);
        o.wait(0.1);
        assert!(!o.is(status::FAULT));
    }
}

/// A single section that is switched on while the winder is off goes off again by its own word.
#[test]
fn a_section_alone_obeys_its_stops_while_the_winder_is_off() {
    for (word, answer) in SECTIONS {
        for stop in [stw1::ON, stw1::NO_COAST, stw1::NO_QUICK_STOP] {
            let mut o = Operator::<f32>::new();
            o.image.commands.set_word(word, stw1::READY);
            o.wait(0.1);
            o.image.commands.set_word(word, stw1::RUN);
            o.wait(0.1);
            let on =
                |o: &Operator<f32>| o.image.feedback.word(answer) & zsw1::OPERATION_ENABLED != 0;
            assert!(on(&o));
            o.image.commands.set_word(word, stw1::RUN & !stop);
            o.wait(0.02);
            assert!(!on(&o), "{} without {stop:04x}", word.name);
        }
    }
}

/// A web that is taken out must be led through again; the parent roll's preset stays.
#[test]
fn a_web_that_is_taken_out_is_out() {
    let mut o = in_mode(Mode::Ready);
    assert!(o.is(status::WEB_THREADED));
    o.press(command::WEB_REMOVED);
    assert!(!o.is(status::WEB_THREADED) && o.is(status::PRESET_TAKEN));
    assert!(!o.simulator.plant.winder().threaded());
    o.command(command::THREAD);
    o.wait(0.1);
    assert_eq!(o.refusal(), Refusal::WebNotThreaded);
}

/// Lifted, the rider roll has neither load nor torque, and its speed is its own; lowered, it lies on the roll again,
/// with the load that the table has for the diameter.
#[test]
fn the_rider_roll_is_lifted_and_lowered() {
    let mut o = running_at(600.0);
    let table = |o: &Operator<f32>| {
        let d = 1e-3 * o.value(&image::D_WU);
        let points = &o.machine.nips.rider_load;
        let next = points.iter().position(|p| p.diameter_m > d).unwrap();
        let (a, b) = (&points[next - 1], &points[next]);
        let share = (d - a.diameter_m) / (b.diameter_m - a.diameter_m);
        a.load_n_m + share * (b.load_n_m - a.load_n_m)
    };
    assert!(o.is(status::RIDER_DOWN));
    near("Q", o.value(&image::RIDER_LOAD), table(&o), 5.0);
    assert_eq!(o.value(&image::NIP_LOAD_RD), 0.0, "not computed as yet");

    put(&mut o, &image::WINDER_COMMAND_2, command_2::RIDER_UP);
    o.wait(0.1);
    let d = o.value(&image::D_WU);
    o.wait(30.0);
    assert!(!o.is(status::RIDER_DOWN));
    for signal in [&image::RIDER_LOAD, &image::TORQUE_RR] {
        assert_eq!(o.value(signal), 0.0, "{}", signal.name);
    }
    // the beam no longer follows the roll
    assert_eq!(o.value(&image::D_WU), d);
    assert!(2e3 * o.x().r_wu > d + 5.0);
    let [_, rr, wu] = o.x().windup;
    assert!(wu - rr > 0.5, "{rr} of {wu} m/s");
    assert_eq!((o.mode(), o.fault()), (Mode::Run, Fault::None));

    put(&mut o, &image::WINDER_COMMAND_2, 0);
    o.wait(5.0);
    assert!(o.is(status::RIDER_DOWN));
    near("D", o.value(&image::D_WU), 2e3 * o.x().r_wu, 0.2);
    near("Q", o.value(&image::RIDER_LOAD), table(&o), 5.0);
    // the front drum had run ahead of a roll that lay on it so lightly
    o.until(15.0, |o| {
        o.image.feedback.word(&image::WINDING) & 0b111 == 0
    });
    let x = o.x();
    assert_eq!(x.windup, [x.v[2]; 3], "all stick");
}

/// The load is a share of the table's; 0 is the table's own, as it is for a PLC that does not know the word.
#[test]
fn the_load_of_the_rider_roll_is_set_in_percent_of_its_table() {
    let mut o = Operator::<f32>::new();
    o.wait(0.1);
    let table = o.value(&image::RIDER_LOAD);
    near("Q", table, o.machine.nips.rider_load[0].load_n_m, 1.0);
    for (set, share) in [
        (0.0, 1.0),
        (50.0, 0.5),
        (200.0, 2.0),
        (250.0, 2.0),
        (100.0, 1.0),
    ] {
        // beyond the limits as the wire may have it
        put(&mut o, &image::RIDER_LOAD_SET, (10.0 * set) as u16);
        o.wait(0.1);
        near("Q", o.value(&image::RIDER_LOAD), share * table, 1.0);
        if set > 0.0 {
            // a core weighs nothing: the nips are in proportion to Q
            let nip = share * Nips::<f64>::new(&o.machine).loads(0.05)[0];
            near("N", o.value(&image::NIP_LOAD_RD), nip, 1.0);
            near("N", o.value(&image::NIP_LOAD_FD), nip, 1.0);
        }
    }
}

/// A roll that is held by its own little weight alone slides on the drums that pull it up.
#[test]
fn without_the_rider_roll_a_small_roll_slides() {
    let slides = |bits| {
        let mut o = threaded();
        put(&mut o, &image::WINDER_COMMAND_2, bits);
        o.command(command::RUN);
        let mut slid = 0;
        o.wait_with(20.0, |o| {
            slid |= o.image.feedback.word(&image::WINDING) & 0b11;
        });
        slid
    };
    assert_eq!(slides(0), 0);
    assert_ne!(slides(command_2::RIDER_UP), 0);
}

/// With its loop open the unwind pulls what the reference says and the load cells are not looked at: the tension is
/// off by what the feed-forward does not know, and comes back when the loop closes, both without a bump.
#[test]
fn the_tension_loop_opens_and_closes() {
    let mut o = running_at(600.0);
    assert!(o.is(status::TENSION_CONTROL));
    let reference = o.value(&image::TENSION_REF);
    near("closed", o.value(&image::TENSION), reference, 1.0);
    // load cells that show too little are followed by the closed loop …
    o.set(&image::FAULT_WRAP_ANGLE, -10.0);
    o.wait(20.0);
    let followed = o.t()[1];
    assert!(followed > 1.02 * TENSION, "{followed} N");
    // … and not by the open one
    put(
        &mut o,
        &image::WINDER_COMMAND_2,
        command_2::TENSION_CONTROL_OFF,
    );
    let mut last = o.t()[1];
    o.wait_with(20.0, |o| {
        let now = o.t()[1];
        assert!((now - last).abs() < 10.0, "a bump from {last} to {now} N");
        last = now;
    });
    assert!(!o.is(status::TENSION_CONTROL) && o.is(status::TENSION_DETECTED));
    // the description of the drives is the plant's: the feed-forward alone is nearly right
    near("open", o.t()[1], TENSION, 0.01 * TENSION);
    put(&mut o, &image::WINDER_COMMAND_2, 0);
    o.wait_with(20.0, |o| {
        let now = o.t()[1];
        assert!((now - last).abs() < 10.0, "a bump from {last} to {now} N");
        last = now;
    });
    near("closed again", o.t()[1], followed, 0.005 * TENSION);
    assert_eq!((o.mode(), o.fault()), (Mode::Run, Fault::None));
}

/// Auto-tune of the tension needs its loop.
#[test]
fn the_tension_is_not_tuned_with_its_loop_open() {
    let mut o = in_mode(Mode::Thread);
    put(
        &mut o,
        &image::WINDER_COMMAND_2,
        command_2::TENSION_CONTROL_OFF,
    );
    put(&mut o, &image::AUTOTUNE_LOOP, 2);
    o.wait(1.0);
    o.command(command::AUTOTUNE);
    o.until(10.0, |o| o.value(&image::AUTOTUNE_ABORT) != 0.0);
    let code = o.value(&image::AUTOTUNE_ABORT) as u8;
    assert_eq!(code, TuneAbort::WrongControl.number());
}
