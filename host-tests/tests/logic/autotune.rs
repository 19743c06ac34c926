//! Auto-tune as a PLC commands it and sees it; what it finds is the regulators' matter.

use crate::operator::Operator;
use crate::{in_mode, near, put, threaded};
use model_core::exchange::{TuneAbort, TuneStep};
use model_core::image;
use model_core::logic::{Mode, Refusal, command, inject, status};
use model_core::profidrive::stw1;

/// Codes of the loops in the image.
const DRUMS: u16 = 0;
const UNWIND: u16 = 1;
const TENSION: u16 = 2;

/// Drives on, preset taken, no web.
fn ready() -> Operator<f32> {
    let mut o = Operator::new();
    o.press(command::PRESET_ACCEPT);
    o.switch_on();
    o
}

fn begin(o: &mut Operator<f32>, which: u16, bits: u16) {
    put(o, &image::AUTOTUNE_LOOP, which);
    o.command(bits | command::AUTOTUNE);
    o.wait(0.1);
}

fn step(o: &Operator<f32>) -> u16 {
    o.image.feedback.word(&image::AUTOTUNE_STEP)
}

fn abort(o: &Operator<f32>) -> u16 {
    o.image.feedback.word(&image::AUTOTUNE_ABORT)
}

/// From one command: progress that only rises, a result within 2 % of the truth, a stop, and ready again.
#[test]
fn a_speed_loop_is_tuned_by_one_command() {
    for which in [DRUMS, UNWIND] {
        let mut o = ready();
        begin(&mut o, which, 0);
        assert_eq!((o.mode(), o.refusal()), (Mode::AutoTune, Refusal::None));
        let (mut progress, mut fastest) = (0.0, 0.0_f64);
        o.until(400.0, |o| {
            let now = o.value(&image::AUTOTUNE_PROGRESS);
            assert!(now >= progress, "{now} % after {progress} %");
            progress = now;
            let x = o.x();
            let (drums, unwind) = (x.v[2].abs(), (x.omega_uw * x.r_uw).abs());
            let (tuned, other) = match which {
                DRUMS => (drums, unwind),
                _ => (unwind, drums),
            };
            fastest = fastest.max(tuned);
            assert_eq!(other, 0.0, "the other section stands");
            assert_eq!(o.t(), [0.0; 3]);
            o.mode() != Mode::AutoTune
        });
        assert_eq!(
            step(&o),
            u16::from(TuneStep::Done.number()),
            "{:?}",
            abort(&o)
        );
        near("progress", progress, 100.0, 0.0);
        assert!(fastest > 1.0, "{fastest} m/s");
        o.until(60.0, |o| o.mode() == Mode::Ready);
        let (machine, x) = (o.machine.clone(), o.x());
        let true_inertia = match which {
            DRUMS => {
                let r = machine.rear_drum.radius_m;
                let drums = machine.rear_drum.mass_kg()
                    + machine.front_drum.mass_kg()
                    + machine.rider_roll.mass_kg();
                let roll = machine.web.roll_inertia(x.r_wu)
                    - machine
                        .web
                        .roll_inertia(machine.shipping_roll.core_radius_m);
                (drums + roll / (x.r_wu * x.r_wu)) * r * r
            }
            _ => machine.parent_roll_offset() + machine.web.roll_inertia(x.r_uw),
        };
        let found = o.value(&image::AUTOTUNE_INERTIA) / true_inertia;
        near("inertia", found, 1.0, 0.02);
        assert!(o.value(&image::AUTOTUNE_GAIN_NEW) > 0.0);
        assert!(o.value(&image::AUTOTUNE_TIME_NEW) > 0.0);
        // the bit still stands: nothing begins again by itself
        o.wait(5.0);
        assert_eq!(o.mode(), Mode::Ready);
    }
}

/// With the web under stall tension at thread speed; it ends at rest in stall tension.
#[test]
fn the_tension_loop_is_tuned_in_thread() {
    let mut o = threaded();
    begin(&mut o, TENSION, command::THREAD);
    assert_eq!((o.mode(), o.refusal()), (Mode::AutoTune, Refusal::None));
    o.until(400.0, |o| o.mode() != Mode::AutoTune);
    assert_eq!(
        step(&o),
        u16::from(TuneStep::Done.number()),
        "{:?}",
        abort(&o)
    );
    o.until(60.0, |o| o.mode() == Mode::Stall);
    assert!(o.value(&image::AUTOTUNE_STIFFNESS) > 0.0);
    o.command(0);
    o.wait(1.0);
    o.command(command::RUN);
    o.until(200.0, |o| o.is(status::AT_SPEED));
}

/// A bit that is taken back, a stop, a fault: the tune ends, its code says cancelled, the old gains stand.
#[test]
fn a_tune_can_be_ended_at_any_time() {
    for after in [0.05, 1.0, 6.0, 15.0] {
        let mut o = ready();
        begin(&mut o, DRUMS, 0);
        o.wait(after);
        o.command(0);
        o.until(60.0, |o| o.mode() == Mode::Ready);
        assert_eq!(step(&o), u16::from(TuneStep::Aborted.number()));
        assert_eq!(abort(&o), u16::from(TuneAbort::Cancelled.number()));
        for (word, ends) in [
            (stw1::RUN & !stw1::NO_COAST, Mode::CoastStop),
            (stw1::RUN & !stw1::NO_QUICK_STOP, Mode::EmergencyStop),
            (stw1::RUN & !stw1::ON, Mode::NormalStop),
        ] {
            let mut o = ready();
            begin(&mut o, UNWIND, 0);
            o.wait(after + 10.0);
            assert_eq!(o.mode(), Mode::AutoTune);
            o.drives(word);
            o.cycle();
            assert_eq!(o.mode(), ends, "{word:04x}");
            o.until(2000.0, |o| o.mode() == Mode::Off);
            assert_eq!(o.image.feedback.word(&image::TORQUE_UW), 0);
        }
        let mut o = ready();
        begin(&mut o, DRUMS, 0);
        o.wait(after);
        put(&mut o, &image::FAULT_DRIVES, inject::TRIP_FD);
        o.cycle();
        assert_eq!(o.mode(), Mode::EmergencyStop);
        o.until(60.0, |o| o.mode() == Mode::Off);
    }
}

#[test]
fn a_tune_out_of_place_is_refused_with_its_reason() {
    for (mode, which, refusal) in [
        (Mode::Off, DRUMS, Refusal::DrivesNotOn),
        (Mode::Ready, DRUMS, Refusal::WebInMachine),
        (Mode::Ready, TENSION, Refusal::NoTension),
        (Mode::Stall, TENSION, Refusal::WrongMode),
        (Mode::Run, TENSION, Refusal::WrongMode),
        (Mode::Run, UNWIND, Refusal::WebInMachine),
    ] {
        let mut o = in_mode(mode);
        let word = o.image.commands.word(&image::WINDER_COMMAND);
        begin(&mut o, which, word);
        assert_eq!((o.mode(), o.refusal()), (mode, refusal), "{which}");
    }
}

/// A torque limit below what the tune takes: it aborts, with a code that says so.
#[test]
fn a_tune_that_aborts_says_why() {
    let mut o = ready();
    o.set(&image::TORQUE_LIMIT_DRUMS, 1.0);
    begin(&mut o, DRUMS, 0);
    o.until(100.0, |o| o.mode() != Mode::AutoTune);
    assert_eq!(step(&o), u16::from(TuneStep::Aborted.number()));
    assert_eq!(abort(&o), u16::from(TuneAbort::TorqueLimit.number()));
    o.until(60.0, |o| o.mode() == Mode::Ready);
}
