//! The drives in a program that has no plant: they cannot name what they must not know.
//!
//! Not here: what they do. Regulators, machine and what is exchanged are compiled a second time, from the same files,
//! beside nothing else. As soon as one of them names the plant, this program is not built.
// not all that there is, is used here
#![allow(dead_code, unused_imports, clippy::unwrap_used)]

#[path = "../../model-core/src/drive/mod.rs"]
mod drive;
#[path = "../../model-core/src/exchange.rs"]
mod exchange;
#[path = "../../model-core/src/machine/mod.rs"]
mod machine;
#[path = "../../model-core/src/real.rs"]
mod real;

/// A winder of a few lines to keep the drives busy: two rolls, and a web between them that is a spring.
#[derive(Default)]
struct Toy {
    v_uw: f32,
    v_rd: f32,
    tension: f32,
}

/// The drives of this program and those of the library give the same torques, bit for bit, in all controls and in
/// auto-tune.
#[test]
fn the_drives_need_nothing_but_measurements() {
    use model_core::exchange as theirs;

    let machine = machine::Machine::news_8000();
    let mut alone = drive::Drive::<f32>::new(&machine);
    let mut whole =
        model_core::drive::Drive::<f32>::new(&model_core::machine::Machine::news_8000());
    let (mut actuators, mut status): (exchange::Actuators<_>, exchange::DriveStatus<_>) =
        Default::default();
    let (mut expected, mut theirs_told) = Default::default();
    let mut toy = Toy::default();
    let (r_uw, r_rd) = (1.5, 0.425);
    let (mut moved, mut step) = (0, exchange::TuneStep::Idle);
    for cycle in 0..30_000_u32 {
        let control = cycle / 2000 % 4;
        // auto-tune begins with a machine that stands
        let tuned = cycle / 10_000 == 2;
        if cycle == 20_000 {
            toy = Toy::default();
        }
        let v_target = if cycle % 4000 < 3000 { 5.0 } else { 0.0 };
        let command = exchange::DriveCommand {
            unwind: match control {
                0 => exchange::UnwindControl::Off,
                1 => exchange::UnwindControl::TakeUp,
                2 => exchange::UnwindControl::Tension,
                _ => exchange::UnwindControl::Speed,
            },
            drums: control != 0,
            v_target,
            acceleration: 0.45,
            jerk: 0.2,
            tension: 2800.0,
            torque_limit: exchange::BySection::all(1.5),
            autotune: tuned.then_some(exchange::Loop::UnwindSpeed),
            ..Default::default()
        };
        let same = theirs::DriveCommand {
            unwind: match control {
                0 => theirs::UnwindControl::Off,
                1 => theirs::UnwindControl::TakeUp,
                2 => theirs::UnwindControl::Tension,
                _ => theirs::UnwindControl::Speed,
            },
            drums: control != 0,
            v_target,
            acceleration: 0.45,
            jerk: 0.2,
            tension: 2800.0,
            torque_limit: theirs::BySection::all(1.5),
            autotune: tuned.then_some(theirs::Loop::UnwindSpeed),
            ..Default::default()
        };
        let m = exchange::Measurements {
            omega: exchange::BySection {
                uw: toy.v_uw / r_uw,
                rd: toy.v_rd / r_rd,
                fd: toy.v_rd / r_rd,
                rr: toy.v_rd / 0.15,
            },
            tension: toy.tension,
            d_wu: 0.3,
            ..Default::default()
        };
        let seen = theirs::Measurements {
            omega: theirs::BySection {
                uw: m.omega.uw,
                rd: m.omega.rd,
                fd: m.omega.fd,
                rr: m.omega.rr,
            },
            tension: m.tension,
            d_wu: m.d_wu,
            ..Default::default()
        };
        alone.step(&command, &m, &mut actuators, &mut status);
        whole.step(&same, &seen, &mut expected, &mut theirs_told);
        let torque = actuators.torque.into_array();
        assert_eq!(
            torque.map(f32::to_bits),
            expected.torque.into_array().map(f32::to_bits),
            "cycle {cycle}"
        );
        moved += u32::from(torque.iter().any(|t| *t != 0.0));
        step = status.autotune.step;
        let [uw, rd, fd, _] = torque;
        if control == 2 && !tuned {
            toy.tension = (toy.tension + 1.8e3 * (toy.v_rd - toy.v_uw)).clamp(0.0, 5e3);
        } else {
            toy.tension = 0.0;
        }
        toy.v_uw += 0.01 * (uw / r_uw + toy.tension - 20.0 * toy.v_uw) / 19.9e3;
        toy.v_rd += 0.01 * ((rd + fd) / r_rd - toy.tension - 30.0 * toy.v_rd) / 15e3;
    }
    assert_eq!(step, exchange::TuneStep::Done);
    assert!(moved > 15_000, "{moved} cycles with torque");
}
