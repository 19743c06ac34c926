//! Every preset as a user meets it: wound in closed loop, printed as a file and read back.
//!
//! Not here: the physics of a machine (`physics`), and what a bad file is told (`machine_file.rs`).

// what a machine file gives back is the same to the bit
#![allow(clippy::float_cmp)]
// a test that cannot go on fails
#![allow(clippy::unwrap_used)]

use std::f64::consts::PI;

use host_tests::machine_file::Description;
use host_tests::plc::{Recipe, Step, wind_in_lockstep};
use host_tests::report::Report;
use model_core::image;
use model_core::machine::{Machine, Motor, PRESETS, Value, parameters};
use proptest::prelude::*;

/// The tension stays within ±10 % of its reference from the first metre of the run to standstill.
fn holds_its_tension<const SPANS: usize>(name: &str, diameter_m: f64) {
    let machine = Machine::preset(name).unwrap();
    let recipe = Recipe {
        speed_m_s: machine.operation.run_speed_m_s,
        diameter_m,
        machine,
    };
    let samples = wind_in_lockstep::<SPANS>(&recipe.machine, &recipe, |_, _| ());
    let samples = samples.unwrap_or_else(|trouble| panic!("{trouble}"));
    let report = Report::of(&recipe, &samples);
    assert!(report.missed().is_empty(), "{name}:\n{report}");
    let moving = samples
        .iter()
        .filter(|s| matches!(s.step, Step::Run | Step::Stop) && s.value(&image::V_REF) > 0.0);
    let deviations = moving.map(|s| s.value(&image::TENSION) / s.value(&image::TENSION_REF) - 1.0);
    let worst = deviations.fold(0.0, |a: f64, b| if b.abs() > a.abs() { b } else { a });
    let fastest = samples.iter().map(|s| s.value(&image::V_WEB));
    let fastest = fastest.fold(0.0, f64::max) / 60.0;
    println!(
        "{name}: tension {:+.1} %, {fastest:.1} m/s\n{report}",
        100.0 * worst
    );
    assert!(worst.abs() <= 0.10, "{name}: {:+.1} %", 100.0 * worst);
    assert!(fastest > 0.99 * recipe.speed_m_s, "{name}: {fastest} m/s");
}

#[test]
fn news_8000_unlumped_holds_its_tension() {
    holds_its_tension::<8>("NEWS-8000-UNLUMPED", 0.80);
}

#[test]
fn lwc_8000_holds_its_tension() {
    holds_its_tension::<3>("LWC-8000", 0.80);
}

#[test]
fn lab_300_holds_its_tension() {
    holds_its_tension::<3>("LAB-300", 0.20);
}

/// A parent roll fills more than one shipping roll, and the rider roll's load holds a nip at every diameter.
#[test]
fn presets_fit_together() {
    for (name, preset) in PRESETS {
        let m = preset();
        let (parent, shipping) = (&m.parent_roll, &m.shipping_roll);
        let area = |outer: f64, inner: f64| PI * (outer.powi(2) - inner.powi(2));
        let sets = area(parent.full_radius_m, parent.expire_radius_m)
            / area(shipping.full_radius_m, shipping.core_radius_m);
        assert!(sets > 1.0, "{name}: {sets} sets");

        for percent in 0..=100 {
            let share = f64::from(percent) / 100.0;
            let r =
                shipping.core_radius_m + share * (shipping.full_radius_m - shipping.core_radius_m);
            let nip = drum_nip(&m, r) / if *name == "LAB-300" { 0.6e3 } else { 3.0e3 };
            assert!(
                (0.9..2.7).contains(&nip),
                "{name}: {nip} of its nip at {r} m"
            );
        }
    }
}

/// At run speed and full acceleration the drums stay below what they can give for ever, in an emergency stop below
/// what they can give for a short time; and the unwind holds the tension of a full roll.
#[test]
fn motors_have_a_margin() {
    for (name, preset) in PRESETS {
        let m = preset();
        let (o, motors) = (&m.operation, &m.motors);
        let tension = o.tension_n_m * m.web.width_m;
        let torque = |motor: &Motor, r: f64| {
            let omega = o.run_speed_m_s / r;
            motor.torque_n_m.min(motor.power_w / omega)
        };

        let (r, r_core) = (m.shipping_roll.full_radius_m, m.shipping_roll.core_radius_m);
        let rolls = [&m.rear_drum, &m.front_drum, &m.rider_roll];
        let paper = m.web.roll_inertia(r) - m.web.roll_inertia(r_core);
        let mass = rolls.iter().map(|roll| roll.mass_kg()).sum::<f64>() + paper / (r * r);
        let friction = rolls.iter().map(|roll| roll.friction_n_s_m).sum::<f64>()
            + m.idle.iter().map(|roll| roll.friction_n_s_m).sum::<f64>()
            + m.shipping_roll.friction_n_s_m;
        let front = o.front_share[o.front_share.len() - 1].share;
        let drums = (torque(&motors.fd, m.front_drum.radius_m) / (front * m.front_drum.radius_m))
            .min(torque(&motors.rd, m.rear_drum.radius_m) / ((1.0 - front) * m.rear_drum.radius_m));
        let up = tension + friction * o.run_speed_m_s + mass * o.acceleration_m_s2;
        let down = mass * o.emergency_m_s2 - tension;
        assert!(up < drums, "{name}: the drums need {up} N of {drums} N");
        assert!(
            down < motors.overload * drums,
            "{name}: the drums need {down} N to stop"
        );

        let r = m.parent_roll.full_radius_m;
        let mass = (m.parent_roll_offset() + m.web.roll_inertia(r)) / (r * r);
        let unwind = torque(&motors.uw, r) / r;
        let friction = m.parent_roll.friction_n_s_m * o.run_speed_m_s;
        let down = tension + mass * o.acceleration_m_s2 - friction;
        assert!(
            down < unwind,
            "{name}: the unwind needs {down} N of {unwind} N"
        );
        println!(
            "{name}: drums {:.2}, unwind {:.2} of their limits",
            up / drums,
            down / unwind
        );
    }
}

/// N = (w + Q)/(2·cos α) with sin α = (R_d + s/2)/(R_d + R), N/m
fn drum_nip(m: &Machine, r: f64) -> f64 {
    const GRAVITY: f64 = 9.80665;
    let core = m.shipping_roll.core_radius_m;
    let weight = m.web.density_kg_m3() * GRAVITY * PI * (r * r - core * core);
    let drum = m.rear_drum.radius_m;
    let sine = (drum + 0.5 * m.nips.drum_gap_m) / (drum + r);
    (weight + rider_load(m, 2.0 * r)) / (2.0 * (1.0 - sine * sine).sqrt())
}

/// Q(D), linear between the points and constant outside them, N/m
fn rider_load(m: &Machine, d: f64) -> f64 {
    let points = &m.nips.rider_load;
    let next = points.iter().position(|point| point.diameter_m > d);
    match next {
        Some(0) => points[0].load_n_m,
        None => points[points.len() - 1].load_n_m,
        Some(i) => {
            let (a, b) = (&points[i - 1], &points[i]);
            let share = (d - a.diameter_m) / (b.diameter_m - a.diameter_m);
            a.load_n_m + share * (b.load_n_m - a.load_n_m)
        }
    }
}

fn written(description: &Description) -> String {
    let mut text = Vec::new();
    description.write(&mut text).unwrap();
    String::from_utf8(text).unwrap()
}

/// Any machine within its limits, every parameter, count and switch by chance.
fn any_machine() -> impl Strategy<Value = Description> {
    let shares = prop::collection::vec(0.0..=1.0, parameters().count());
    (0..PRESETS.len(), shares).prop_map(|(preset, shares)| {
        let mut description = Description::of(&PRESETS[preset]);
        let m = &mut description.machine;
        for (parameter, share) in parameters().zip(shares) {
            let (Some(value), Some(limits)) = (parameter.get(m), parameter.limits(m)) else {
                continue;
            };
            let (low, high) = (*limits.start(), *limits.end());
            let number = f64::clamp(low + share * (high - low), low, high);
            let value = match value {
                Value::Number(_) => Value::Number(number),
                Value::Count(_) => Value::Count(number.round() as usize),
                Value::Switch(_) => Value::Switch(share < 0.5),
            };
            parameter.set(m, value).unwrap();
        }
        description
    })
}

proptest! {
    // a case that fails becomes a test of its own, not a file
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn what_is_printed_reads_back_as_the_same_machine(description in any_machine()) {
        prop_assert_eq!(description.machine.validate(), Ok(()));
        let read = Description::read("m.toml", &written(&description)).unwrap();
        prop_assert_eq!(read, description);
    }

    /// Whatever a file holds, it is read or refused; and what is refused is told with the file's name.
    #[test]
    fn no_file_makes_the_reader_panic(
        text in "(preset = 'LAB-300'\n)?([\\[\\]{}='a-z_.0-9,\n -]|idle|nips|rider_load|\\[\\[idle\\]\\]\n|span_m = ){0,40}",
    ) {
        if let Err(error) = Description::read("m.toml", &text) {
            prop_assert!(format!("{error:#}").starts_with("m.toml:"), "{error:#}");
        }
    }
}

#[test]
fn presets_read_back_as_themselves() {
    for preset in PRESETS {
        let description = Description::of(preset);
        let text = written(&description);
        assert_eq!(Description::read("m.toml", &text).unwrap(), description);
        for parameter in parameters().filter(|p| p.get(&description.machine).is_some()) {
            assert!(text.contains(parameter.about), "{}", parameter.name);
        }
    }
}
