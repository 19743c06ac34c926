//! A machine's description: what is outside its limits is refused by name.

use model_core::machine::Machine;
use proptest::prelude::*;

use crate::form::H;

type Parameter = (&'static str, fn(&mut Machine) -> &mut f64);

/// Every number of a description, by the name that an error gives it.
const PARAMETERS: &[Parameter] = &[
    ("web.width_m", |m| &mut m.web.width_m),
    ("web.grammage_kg_m2", |m| &mut m.web.grammage_kg_m2),
    ("web.caliper_m", |m| &mut m.web.caliper_m),
    ("web.stiffness_n_m", |m| &mut m.web.stiffness_n_m),
    ("web.retardation_s", |m| &mut m.web.retardation_s),
    ("web.strength_n_m", |m| &mut m.web.strength_n_m),
    ("parent_roll.full_radius_m", |m| {
        &mut m.parent_roll.full_radius_m
    }),
    ("parent_roll.spool_radius_m", |m| {
        &mut m.parent_roll.spool_radius_m
    }),
    ("parent_roll.expire_radius_m", |m| {
        &mut m.parent_roll.expire_radius_m
    }),
    ("parent_roll.spool_inertia_kg_m2", |m| {
        &mut m.parent_roll.spool_inertia_kg_m2
    }),
    ("parent_roll.friction_n_s_m", |m| {
        &mut m.parent_roll.friction_n_s_m
    }),
    ("idle.span_m", |m| &mut m.idle[0].span_m),
    ("idle.radius_m", |m| &mut m.idle[0].radius_m),
    ("idle.inertia_kg_m2", |m| &mut m.idle[0].inertia_kg_m2),
    ("idle.friction_n_s_m", |m| &mut m.idle[0].friction_n_s_m),
    ("idle.span_m", |m| &mut m.idle[1].span_m),
    ("idle.radius_m", |m| &mut m.idle[1].radius_m),
    ("idle.inertia_kg_m2", |m| &mut m.idle[1].inertia_kg_m2),
    ("idle.friction_n_s_m", |m| &mut m.idle[1].friction_n_s_m),
    ("idle.eccentricity_m", |m| &mut m.idle[0].eccentricity_m),
    ("idle.eccentricity_m", |m| &mut m.idle[1].eccentricity_m),
    ("parent_roll.eccentricity_m", |m| {
        &mut m.parent_roll.eccentricity_m
    }),
    ("load_cells.wrap_rad", |m| &mut m.load_cells.wrap_rad),
    ("load_cells.calibrated_wrap_rad", |m| {
        &mut m.load_cells.calibrated_wrap_rad
    }),
    ("load_cells.filter_s", |m| &mut m.load_cells.filter_s),
    ("nips.friction", |m| &mut m.nips.friction),
    ("nips.static_ratio", |m| &mut m.nips.static_ratio),
    ("nips.drum_gap_m", |m| &mut m.nips.drum_gap_m),
    ("nips.rider_load.diameter_m", |m| {
        &mut m.nips.rider_load[9].diameter_m
    }),
    ("nips.rider_load.load_n_m", |m| {
        &mut m.nips.rider_load[0].load_n_m
    }),
    ("wound_on_tension.tension_gain", |m| {
        &mut m.wound_on_tension.tension_gain
    }),
    ("wound_on_tension.force_gain", |m| {
        &mut m.wound_on_tension.force_gain
    }),
    ("wound_on_tension.paper_friction", |m| {
        &mut m.wound_on_tension.paper_friction
    }),
    ("wound_on_tension.nip_scale_n_m", |m| {
        &mut m.wound_on_tension.nip_scale_n_m
    }),
    ("wound_on_tension.reference_n_m", |m| {
        &mut m.wound_on_tension.reference_n_m
    }),
    ("wound_on_tension.hardness", |m| {
        &mut m.wound_on_tension.hardness
    }),
    ("brakes.static_ratio", |m| &mut m.brakes.static_ratio),
    ("brakes.karnopp_m_s", |m| &mut m.brakes.karnopp_m_s),
    ("last_span_m", |m| &mut m.last_span_m),
    ("rear_drum.radius_m", |m| &mut m.rear_drum.radius_m),
    ("rear_drum.inertia_kg_m2", |m| {
        &mut m.rear_drum.inertia_kg_m2
    }),
    ("rear_drum.friction_n_s_m", |m| {
        &mut m.rear_drum.friction_n_s_m
    }),
    ("front_drum.radius_m", |m| &mut m.front_drum.radius_m),
    ("front_drum.inertia_kg_m2", |m| {
        &mut m.front_drum.inertia_kg_m2
    }),
    ("front_drum.friction_n_s_m", |m| {
        &mut m.front_drum.friction_n_s_m
    }),
    ("rider_roll.radius_m", |m| &mut m.rider_roll.radius_m),
    ("rider_roll.inertia_kg_m2", |m| {
        &mut m.rider_roll.inertia_kg_m2
    }),
    ("rider_roll.friction_n_s_m", |m| {
        &mut m.rider_roll.friction_n_s_m
    }),
    ("shipping_roll.core_radius_m", |m| {
        &mut m.shipping_roll.core_radius_m
    }),
    ("shipping_roll.full_radius_m", |m| {
        &mut m.shipping_roll.full_radius_m
    }),
    ("shipping_roll.friction_n_s_m", |m| {
        &mut m.shipping_roll.friction_n_s_m
    }),
    ("motors.uw.power_w", |m| &mut m.motors.uw.power_w),
    ("motors.uw.torque_n_m", |m| &mut m.motors.uw.torque_n_m),
    ("motors.rd.power_w", |m| &mut m.motors.rd.power_w),
    ("motors.rd.torque_n_m", |m| &mut m.motors.rd.torque_n_m),
    ("motors.fd.power_w", |m| &mut m.motors.fd.power_w),
    ("motors.fd.torque_n_m", |m| &mut m.motors.fd.torque_n_m),
    ("motors.rr.power_w", |m| &mut m.motors.rr.power_w),
    ("motors.rr.torque_n_m", |m| &mut m.motors.rr.torque_n_m),
    ("motors.overload", |m| &mut m.motors.overload),
    ("brakes.uw_n_m", |m| &mut m.brakes.uw_n_m),
    ("brakes.rd_n_m", |m| &mut m.brakes.rd_n_m),
    ("brakes.fd_n_m", |m| &mut m.brakes.fd_n_m),
    ("brakes.delay_s", |m| &mut m.brakes.delay_s),
    ("operation.max_speed_m_s", |m| {
        &mut m.operation.max_speed_m_s
    }),
    ("operation.run_speed_m_s", |m| {
        &mut m.operation.run_speed_m_s
    }),
    ("operation.thread_speed_m_s", |m| {
        &mut m.operation.thread_speed_m_s
    }),
    ("operation.acceleration_m_s2", |m| {
        &mut m.operation.acceleration_m_s2
    }),
    ("operation.jerk_m_s3", |m| &mut m.operation.jerk_m_s3),
    ("operation.emergency_m_s2", |m| {
        &mut m.operation.emergency_m_s2
    }),
    ("operation.tension_n_m", |m| &mut m.operation.tension_n_m),
    ("operation.stall_share", |m| &mut m.operation.stall_share),
    ("operation.front_share", |m| &mut m.operation.front_share[0]),
    ("operation.front_share", |m| &mut m.operation.front_share[1]),
    ("encoder_pulses", |m| &mut m.encoder_pulses),
];

/// No number of the description has been forgotten above.
#[test]
fn the_table_of_parameters_is_whole() {
    let mut m = Machine::news_8000();
    for (_, parameter) in PARAMETERS {
        *parameter(&mut m) = f64::NAN;
    }
    m.load_cells.roll = 0;
    let text = format!("{m:?}").replace("roll: 0", "");
    let numbers: Vec<_> = text
        .split([' ', ',', '[', ']'])
        .filter(|word| word.parse::<f64>().is_ok_and(|number| !number.is_nan()))
        .collect();
    assert!(numbers.is_empty(), "{numbers:?} in {text}");
}

#[test]
fn the_presets_are_valid() {
    for (name, preset) in model_core::machine::PRESETS {
        assert_eq!(preset().validate(), Ok(()), "{name}");
    }
}

/// A number that no parameter may have: negative, absurdly large, or none.
fn absurd() -> impl Strategy<Value = f64> {
    prop_oneof![
        Just(f64::NAN),
        Just(f64::INFINITY),
        Just(f64::NEG_INFINITY),
        -1e9..-1e-9,
        1e9..1e300,
    ]
}

proptest! {
    #[test]
    fn a_parameter_outside_its_limits_is_refused_by_name(
        index in 0..PARAMETERS.len(),
        value in absurd(),
    ) {
        let (name, parameter) = PARAMETERS[index];
        let mut m = Machine::news_8000();
        *parameter(&mut m) = value;
        let error = m.validate().unwrap_err();
        prop_assert_eq!(error.parameter, name);
        prop_assert_eq!(error.value.to_bits(), value.to_bits());
        prop_assert!(!(error.low..=error.high).contains(&value));
        let text = error.to_string();
        prop_assert!(text.contains(name) && text.contains("outside"), "{}", text);
        let winder = model_core::plant::Winder::<f32, 3>::new(&m, H);
        prop_assert_eq!(winder.unwrap_err().parameter, name);
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
    ];
    for (name, change) in cases {
        let mut m = Machine::news_8000();
        change(&mut m);
        assert_eq!(m.validate().unwrap_err().parameter, *name);
    }
}
