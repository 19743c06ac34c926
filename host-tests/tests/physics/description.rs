//! A machine's description: what is outside its limits is refused by name.

use model_core::machine::{Machine, PRESETS, Parameter, Value, parameters};
use proptest::prelude::*;

use crate::form::H;

/// No field of the description has been forgotten in the table of parameters.
#[test]
fn the_table_of_parameters_is_whole() {
    const COUNT: usize = 77;
    let mut m = Machine::news_8000();
    for parameter in parameters().filter(|parameter| parameter.length_of().is_none()) {
        let mark = match parameter.get(&m) {
            Some(Value::Number(_)) => Value::Number(f64::NAN),
            Some(Value::Count(_)) => Value::Count(COUNT),
            Some(Value::Switch(_)) => Value::Switch(true),
            None => continue,
        };
        parameter.set(&mut m, mark).unwrap();
        assert_eq!(
            format!("{:?}", parameter.get(&m)),
            format!("{:?}", Some(mark))
        );
    }
    let text = format!("{m:?}").replace(&COUNT.to_string(), "");
    let forgotten: Vec<_> = text
        .split([' ', ',', '[', ']'])
        .filter(|word| *word == "false" || word.parse().is_ok_and(|number: f64| !number.is_nan()))
        .collect();
    assert!(forgotten.is_empty(), "{forgotten:?} in {text}");
}

#[test]
fn the_presets_are_valid() {
    for (name, preset) in PRESETS {
        assert_eq!(preset().validate(), Ok(()), "{name}");
    }
}

/// A parameter of a preset, with a number outside its limits: just so, by far, infinite, or none.
fn outside() -> impl Strategy<Value = (Machine, &'static Parameter, f64)> {
    let distance = prop_oneof![Just(0.0), 1e-9..1.0, 1.0..1e300, Just(f64::INFINITY)];
    (
        0..PRESETS.len(),
        any::<prop::sample::Index>(),
        0..3,
        distance,
    )
        .prop_map(|(preset, index, side, distance)| {
            let m = PRESETS[preset].1();
            let numbers: Vec<_> = parameters()
                .filter(|parameter| matches!(parameter.get(&m), Some(Value::Number(_))))
                .collect();
            let parameter = *index.get(&numbers);
            let limits = parameter.limits(&m).unwrap();
            let value = match side {
                0 => limits.start().next_down() - distance,
                1 => limits.end().next_up() + distance,
                _ => f64::NAN,
            };
            (m, parameter, value)
        })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1024))]
    #[test]
    fn a_parameter_outside_its_limits_is_refused_by_name(
        (mut m, parameter, value) in outside()
    ) {
        parameter.set(&mut m, Value::Number(value)).unwrap();
        let error = m.validate().unwrap_err();
        prop_assert_eq!(error.parameter, parameter.name);
        prop_assert_eq!(error.value.to_bits(), value.to_bits());
        prop_assert!(!(error.low..=error.high).contains(&value));
        let text = error.to_string();
        prop_assert!(text.contains(parameter.name) && text.contains("outside"), "{}", text);
        let winder = model_core::plant::Winder::<f32, 3>::new(&m, H);
        prop_assert_eq!(winder.unwrap_err().parameter, parameter.name);
    }
}

/// Limits that are other parameters.
#[test]
fn parameters_that_contradict_each_other_are_refused_by_name() {
    type Change = fn(&mut Machine);
    let cases: &[(&str, Change)] = &[
        ("parent_roll.full_radius_m", |m| {
            m.parent_roll.full_radius_m = 0.44
        }),
        ("parent_roll.expire_radius_m", |m| {
            m.parent_roll.expire_radius_m = 0.39
        }),
        ("shipping_roll.full_radius_m", |m| {
            m.shipping_roll.full_radius_m = 0.04
        }),
        ("operation.run_speed_m_s", |m| {
            m.operation.run_speed_m_s = 42.0
        }),
        ("operation.thread_speed_m_s", |m| {
            m.operation.thread_speed_m_s = 37.0
        }),
        ("operation.emergency_m_s2", |m| {
            m.operation.emergency_m_s2 = 0.4
        }),
        ("operation.tension_n_m", |m| {
            m.operation.tension_n_m = 1001.0
        }),
        ("load_cells.roll", |m| m.load_cells.roll = 2),
        ("idle (number of rolls)", |m| m.idle.clear()),
        ("idle[1].eccentricity_m", |m| {
            m.idle[1].eccentricity_m = 0.016
        }),
        ("nips.rider_load (number of points)", |m| {
            m.nips.rider_load.clear()
        }),
        ("nips.rider_load[3].diameter_m", |m| {
            m.nips.rider_load[3].diameter_m = 0.29
        }),
        ("nips.drum_gap_m", |m| m.nips.drum_gap_m = 0.096),
        ("operation.front_share (number of points)", |m| {
            m.operation.front_share.clear()
        }),
        ("operation.front_share[1].diameter_m", |m| {
            m.operation.front_share[1].diameter_m = 0.09
        }),
    ];
    for (name, change) in cases {
        let mut m = Machine::news_8000();
        change(&mut m);
        assert_eq!(m.validate().unwrap_err().parameter, *name);
    }
}
