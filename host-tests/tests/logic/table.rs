//! Every mode × every command that a PLC can give, against the table; and the table against the stops as they are
//! written down for winder drives.

use crate::in_mode;
use crate::operator::Operator;
use model_core::image;
use model_core::logic::table::{Cause, Outcome};
use model_core::logic::{Mode, Refusal, command};
use model_core::profidrive::stw1;

/// The modes that need nothing but commands and accidents.
const REACHED: [Mode; 10] = [
    Mode::Off,
    Mode::Ready,
    Mode::Thread,
    Mode::Stall,
    Mode::Run,
    Mode::NormalStop,
    Mode::EmergencyStop,
    Mode::CoastStop,
    Mode::WebBreakStop,
    Mode::UnwindManeuver,
];

/// Every request, with its bits.
const REQUESTS: [(Cause, u16); 12] = [
    (Cause::PresetAccept, command::PRESET_ACCEPT),
    (Cause::NewCore, command::NEW_CORE),
    (Cause::NewParentRoll, command::NEW_PARENT_ROLL),
    (Cause::WebRemoved, command::WEB_REMOVED),
    (Cause::WebThreaded, command::WEB_THREADED),
    (Cause::DrumBrakes, command::DRUM_BRAKES),
    (Cause::Jog, command::JOG_BACKWARD),
    (Cause::Stall, command::STALL),
    (Cause::Thread, command::THREAD),
    (Cause::TuneSpeed, command::AUTOTUNE),
    (Cause::TuneTension, command::AUTOTUNE),
    (Cause::Run, command::RUN),
];

/// A request's bit rises for a cycle while all others stand as they did.
fn request(o: &mut Operator<f32>, cause: Cause, bits: u16) {
    let tuned = if cause == Cause::TuneTension { 2 } else { 0 };
    o.image.commands.set_word(&image::AUTOTUNE_LOOP, tuned);
    let before = o.image.commands.word(&image::WINDER_COMMAND);
    // an edge needs a cycle without it
    assert_eq!(before & bits, 0, "the bit stands already");
    o.command(before | bits);
    o.cycle();
}

#[test]
fn every_request_in_every_mode_has_the_outcome_of_the_table() {
    for mode in REACHED {
        let start = in_mode(mode);
        for (cause, bits) in REQUESTS {
            let mut o = start.clone();
            // not a bit that stands already, and not both directions of the maneuver
            let stands = o.image.commands.word(&image::WINDER_COMMAND) & bits != 0;
            if stands || (cause, mode) == (Cause::Jog, Mode::UnwindManeuver) {
                continue;
            }
            request(&mut o, cause, bits);
            let what = format!("{cause:?} in {mode:?}");
            let (now, refusal) = (o.mode(), o.refusal());
            let needed: Vec<Refusal> = cause.needs().iter().map(|c| c.refusal()).collect();
            let then: Vec<Refusal> = cause.needs_then().iter().map(|c| c.refusal()).collect();
            if refusal != Refusal::None {
                assert_eq!(now, mode, "{what}: a refused command changes nothing");
            }
            match cause.outcome(mode) {
                Outcome::Refuse(reason) => assert!(
                    refusal == reason || needed.contains(&refusal),
                    "{what}: {refusal:?}"
                ),
                Outcome::Go(to) if refusal == Refusal::None => assert_eq!(now, to, "{what}"),
                Outcome::Stay if refusal == Refusal::None => assert_eq!(now, mode, "{what}"),
                _ => assert!(
                    needed.contains(&refusal) || then.contains(&refusal),
                    "{what}: {refusal:?}"
                ),
            }
        }
    }
}

/// OFF1, OFF2 and OFF3 of any one section, in the words of the drives' own handbooks: what becomes of each mode.
#[test]
fn every_stop_of_every_section_stops_the_winder() {
    use Mode::*;
    let off1 = stw1::RUN & !stw1::ON;
    let off2 = stw1::RUN & !stw1::NO_COAST;
    let off3 = stw1::RUN & !stw1::NO_QUICK_STOP;
    let disabled = stw1::RUN & !stw1::ENABLE_OPERATION;
    let rows = [
        // mode             OFF1           OFF2        OFF3
        (Ready, Off, Off, Off),
        (Thread, NormalStop, CoastStop, EmergencyStop),
        (Stall, Off, Off, EmergencyStop),
        (Run, NormalStop, CoastStop, EmergencyStop),
        (NormalStop, NormalStop, CoastStop, EmergencyStop),
        (EmergencyStop, EmergencyStop, CoastStop, EmergencyStop),
        (CoastStop, CoastStop, CoastStop, CoastStop),
        (WebBreakStop, WebBreakStop, CoastStop, WebBreakStop),
    ];
    for (mode, by_off1, by_off2, by_off3) in rows {
        let start = in_mode(mode);
        for section in image::STW1 {
            for (word, expected) in [
                (off1, by_off1),
                (off2, by_off2),
                (disabled, by_off2),
                (off3, by_off3),
                // all at once: the strongest
                (stw1::CONTROL_BY_PLC, by_off2),
            ] {
                let mut o = start.clone();
                o.image.commands.set_word(section, word);
                o.cycle();
                assert_eq!(
                    o.mode(),
                    expected,
                    "{word:04x} at {} in {mode:?}",
                    section.name
                );
            }
        }
    }
}

/// Bits that cannot be meant together: the safer one is done, and the refusal says why not the other.
#[test]
fn of_contradictory_commands_the_safer_one_counts() {
    for (mode, bits, becomes) in [
        (Mode::Ready, command::THREAD | command::STALL, Mode::Stall),
        (Mode::Ready, command::THREAD | command::RUN, Mode::Thread),
        (Mode::Stall, command::RUN | command::THREAD, Mode::Thread),
        (
            Mode::Ready,
            command::THREAD | command::AUTOTUNE | command::RUN,
            Mode::Thread,
        ),
    ] {
        let mut o = in_mode(mode);
        o.command(bits);
        o.cycle();
        assert_eq!(
            (o.mode(), o.refusal()),
            (becomes, Refusal::Contradictory),
            "{bits:04x}"
        );
    }
    // a new roll has no preset, whatever stands in the register
    let mut o = in_mode(Mode::Off);
    o.press(command::NEW_PARENT_ROLL | command::PRESET_ACCEPT);
    assert_eq!(o.refusal(), Refusal::Contradictory);
    assert!(!o.is(model_core::logic::status::PRESET_TAKEN));
    let mut o = in_mode(Mode::Off);
    o.press(command::WEB_REMOVED | command::WEB_THREADED);
    assert_eq!(o.refusal(), Refusal::Contradictory);
    assert!(!o.is(model_core::logic::status::WEB_THREADED));
    assert!(!o.simulator.plant.winder().threaded());
}
