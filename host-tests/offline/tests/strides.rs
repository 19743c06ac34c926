//! Strides beside the winder's own steps: the same motion to their order, the same bits where none can be taken.

use model_core::exchange::{Actuators, Brakes, BySection, Handling};
use model_core::machine::Machine;
use model_core::plant::rk4::State;
use model_core::plant::{Winder, modes};
use offline::{Held, LONGEST, ORDER, Smooth, Strider};
use proptest::prelude::*;

const LUMPED: usize = 3;
/// The drives' cycle, s.
const HOLD_S: f64 = 0.01;

/// A winder in the middle of a set, its web taut.
fn winding(machine: &Machine, h: f64, speed: f64) -> Winder<f64, LUMPED> {
    let mut winder = Winder::new(machine, h).expect("a preset is valid");
    let tension = machine.operation.tension_n_m * machine.web.width_m;
    winder.thread_at(tension);
    let strain = winder.state().strain;
    let (core, full) = (
        machine.shipping_roll.core_radius_m,
        machine.shipping_roll.full_radius_m,
    );
    let (r_uw, v) = (
        0.8 * machine.parent_roll.full_radius_m,
        speed * (1.0 + strain[0]),
    );
    winder.set_state(&State {
        strain,
        v: [v; LUMPED],
        windup: [v; 3],
        omega_uw: speed / r_uw,
        r_uw,
        r_wu: 0.5 * (core + full),
    });
    winder
}

/// Torques of hold `i`, which keep the web taut and shake it.
fn torques(machine: &Machine, i: u32) -> BySection<f64> {
    let tension = machine.operation.tension_n_m * machine.web.width_m;
    let swing = 0.1 * f64::from(i % 7) / 7.0 - 0.05;
    BySection {
        uw: -tension * (1.0 + swing) * 0.8 * machine.parent_roll.full_radius_m,
        rd: tension * 0.6 * machine.rear_drum.radius_m,
        fd: tension * 0.45 * machine.front_drum.radius_m,
        rr: 0.0,
    }
}

fn held(machine: &Machine, torque: BySection<f64>) -> Held {
    Held {
        uw: torque.uw,
        pull: torque.rd / machine.rear_drum.radius_m
            + torque.fd / machine.front_drum.radius_m
            + torque.rr / machine.rider_roll.radius_m,
    }
}

type States = Vec<State<f64, LUMPED, 0>>;

/// Largest difference of a variable between two runs, relative to the variable.
fn apart(a: &States, b: &States) -> f64 {
    let each = a.iter().zip(b).flat_map(|(a, b)| a.iter().zip(b.iter()));
    each.map(|(a, b)| (a - b).abs() / b.abs())
        .fold(0.0, f64::max)
}

/// Where each of a second of holds leads, in so many strides each.
fn strides(machine: &Machine, strides: u32) -> States {
    let smooth = Smooth::new(machine, HOLD_S / f64::from(strides)).expect("short enough");
    let mut x = winding(machine, HOLD_S, 10.0).state().with_apart([]);
    let hold = |i| {
        let held = held(machine, torques(machine, i));
        for _ in 0..strides {
            x = smooth.advance(&x, held).expect("the web is taut");
        }
        x
    };
    (0..100).map(hold).collect()
}

/// Where the same holds lead in so many of the winder's own steps each.
fn steps(machine: &Machine, steps: u32) -> States {
    let mut winder = winding(machine, HOLD_S / f64::from(steps), 10.0);
    let hold = |i| {
        let actuators = Actuators {
            torque: torques(machine, i),
            ..Actuators::default()
        };
        for _ in 0..steps {
            winder.step(&actuators);
        }
        winder.state().with_apart([])
    };
    (0..100).map(hold).collect()
}

/// Presets whose idle rolls are lumped, and a web slow enough for a hold in one stride.
fn lumped() -> Vec<Machine> {
    let presets = model_core::machine::PRESETS.iter();
    let machines = presets.map(|(name, _)| Machine::preset(name).expect("it is a preset"));
    machines
        .filter(|m| m.idle.len() + 1 == LUMPED && !m.nips.slip && !m.wound_on_tension.compresses)
        .filter(|m| Smooth::new(m, HOLD_S).is_some())
        .collect()
}

#[test]
fn a_stride_leads_where_many_small_steps_lead() {
    let machines = lumped();
    assert!(machines.contains(&Machine::news_8000()));
    for machine in machines {
        let fine = steps(&machine, 100);
        let off = apart(&strides(&machine, 1), &fine);
        let reach = HOLD_S * modes::fastest(&machine);
        assert!(off < 1e-6 * reach.powi(ORDER as i32), "{off:e} at {reach}");
    }
}

#[test]
fn half_the_stride_has_a_256th_of_the_error() {
    // a web as quick as strides reach, so that errors stand well above rounding
    let mut machine = Machine::news_8000();
    machine.web.stiffness_n_m *= 0.95 * (HOLD_S * modes::fastest(&machine)).powi(-2);
    let exact = strides(&machine, 8);
    let [one, two] = [1, 2].map(|n| apart(&strides(&machine, n), &exact));
    let order = (one / two).log2();
    assert!(one > 1e-9, "{one:e} is too near to rounding");
    assert!(
        (order - ORDER as f64).abs() < 0.7,
        "{order}: {one:e}, {two:e}"
    );
}

#[test]
fn where_no_stride_can_be_taken_the_bits_are_those_of_steps() {
    let machine = Machine::news_8000();
    let strider = Strider::new(&machine, 0.004);
    let running = Actuators {
        torque: torques(&machine, 3),
        ..Actuators::default()
    };
    let brake = Actuators {
        brakes: Brakes {
            rd: true,
            ..Brakes::default()
        },
        ..running
    };
    let out = Actuators {
        handling: Handling {
            remove_web: true,
            ..Handling::default()
        },
        ..running
    };
    let slack = Actuators {
        torque: BySection {
            uw: 5e4,
            ..BySection::default()
        },
        ..running
    };
    for (name, actuators) in [("brake", brake), ("no web", out), ("slack", slack)] {
        let mut stepped = winding(&machine, 0.004, 10.0);
        let mut strode = stepped.clone();
        if name == "slack" {
            // all strides would begin in it
            for winder in [&mut stepped, &mut strode] {
                for _ in 0..100 {
                    winder.step(&slack);
                }
            }
            assert!(stepped.tension().contains(&0.0));
        }
        for _ in 0..500 {
            stepped.step(&actuators);
            assert_eq!(
                strider.advance(&mut strode, &actuators, LONGEST),
                1,
                "{name}"
            );
        }
        let (mut a, mut b) = (Vec::new(), Vec::new());
        stepped.fingerprint(|bits| a.push(bits));
        strode.fingerprint(|bits| b.push(bits));
        assert_eq!(a, b, "{name}");
    }
}

#[test]
fn a_web_that_breaks_breaks_in_the_step_in_which_it_does_without_strides() {
    let machine = Machine::news_8000();
    let strider = Strider::new(&machine, 0.004);
    let pulls = Actuators {
        torque: BySection {
            uw: -2e4,
            rd: 6e3,
            fd: 6e3,
            rr: 0.0,
        },
        ..Actuators::default()
    };
    let mut stepped = winding(&machine, 0.004, 10.0);
    let mut strode = stepped.clone();
    let (mut at, mut steps, mut strides) = (0, 0, 0);
    while stepped.threaded() {
        stepped.step(&pulls);
        at += 1;
        assert!(at < 10_000, "nothing breaks it");
    }
    while strode.threaded() {
        let taken = strider.advance(&mut strode, &pulls, LONGEST);
        steps += taken;
        strides += u64::from(taken > 1);
        assert!(steps < 10_000, "nothing breaks it");
    }
    assert!(strides > 0, "no stride was taken on the way");
    assert_eq!(steps, at);
    assert_eq!(strode.broken_span(), stepped.broken_span());
}

#[test]
fn no_stride_is_longer_than_asked_for() {
    let machine = Machine::news_8000();
    let strider = Strider::new(&machine, 0.004);
    let mut winder = winding(&machine, 0.004, 10.0);
    let running = Actuators {
        torque: torques(&machine, 3),
        ..Actuators::default()
    };
    for most in 1..=LONGEST + 2 {
        assert_eq!(
            strider.advance(&mut winder, &running, most),
            most.min(LONGEST)
        );
    }
}

#[test]
fn a_machine_too_quick_for_strides_steps() {
    let mut machine = Machine::news_8000();
    machine.web.stiffness_n_m *= 200.0;
    assert!(Smooth::new(&machine, HOLD_S).is_none());
    let strider = Strider::new(&machine, HOLD_S);
    let mut winder = winding(&machine, HOLD_S, 10.0);
    let still = Actuators::default();
    assert_eq!(strider.advance(&mut winder, &still, LONGEST), 1);
}

#[test]
fn machines_of_many_rolls_stride_too() {
    let machine = Machine::news_8000_unlumped();
    let h = 0.002;
    let smooth = Smooth::new(&machine, h).expect("short enough");
    let tension = machine.operation.tension_n_m * machine.web.width_m;
    let mut winder = Winder::<f64, 8>::new(&machine, h / 20.0).expect("a preset is valid");
    winder.thread_at(tension);
    let mut x = winder.state().with_apart([]);
    let r_uw = x.r_uw;
    for i in 0..200 {
        let pull = tension * (1.0 + 0.02 * f64::from(i % 5));
        let uw = -tension * r_uw;
        let actuators = Actuators {
            torque: BySection {
                uw,
                rd: pull * machine.rear_drum.radius_m,
                ..BySection::default()
            },
            ..Actuators::default()
        };
        for _ in 0..20 {
            winder.step(&actuators);
        }
        x = smooth
            .advance(&x, Held { uw, pull })
            .expect("the web is taut");
    }
    for (strode, stepped) in x.iter().zip(winder.state().with_apart::<0>([]).iter()) {
        let off = (strode - stepped).abs();
        assert!(off < 1e-7 * stepped.abs().max(1e-3), "{strode} {stepped}");
    }
}

proptest! {
    /// Whatever the motors do, strides give what is finite, and what small steps give as long as they are taken.
    #[test]
    fn a_stride_is_refused_or_right(
        uw in -3e4..3e4_f64,
        rd in -5e3..5e3_f64,
        fd in -5e3..5e3_f64,
        speed in -5.0..40.0_f64,
    ) {
        let machine = Machine::news_8000();
        let smooth = Smooth::new(&machine, HOLD_S).expect("short enough");
        let mut winder = winding(&machine, HOLD_S / 40.0, speed);
        let torque = BySection { uw, rd, fd, rr: 0.0 };
        let actuators = Actuators { torque, ..Actuators::default() };
        let x = winder.state().with_apart([]);
        if let Some(x) = smooth.advance(&x, held(&machine, torque)) {
            for _ in 0..40 {
                winder.step(&actuators);
            }
            prop_assert!(winder.threaded());
            prop_assert!(winder.tension().iter().all(|t| *t > 0.0));
            for (strode, stepped) in x.iter().zip(winder.state().with_apart::<0>([]).iter()) {
                let off = (strode - stepped).abs();
                prop_assert!(off < 1e-8 * stepped.abs().max(1e-3), "{strode} {stepped}");
            }
        }
    }
}
