//! The problem that all peers compute: the lumped winder at speed, its torques held for 10 ms.
//!
//! Not here: brakes, slip, slack: what is smooth is what a general integrator can do.

use std::f64::consts::TAU;
use std::fmt::Write;

use model_core::machine::Machine;

/// How long torques are held, s: the drives' cycle.
pub const HOLD_S: f64 = 0.01;
/// Variables of state.
pub const STATES: usize = 9;
const SPANS: usize = 3;

/// Speed and radii in the middle of a set, m/s and m.
const SPEED_M_S: f64 = 20.0;
const R_UW_M: f64 = 1.2;
const R_WU_M: f64 = 0.35;

/// The text that a peer reads: coefficients, the state at the start, the load of each hold.
pub fn text(machine: &Machine, holds: u32) -> String {
    let stiffness = machine.web.stiffness_n_m * machine.web.width_m;
    let tension = machine.operation.tension_n_m * machine.web.width_m;
    let spans = || (0..SPANS).map(|i| machine.span_m(i));
    let idle = || machine.idle.iter();
    let core = machine.shipping_roll.core_radius_m;
    let rolls = [&machine.rear_drum, &machine.front_drum, &machine.rider_roll];
    let friction = rolls.iter().map(|roll| roll.friction_n_s_m).sum::<f64>()
        + machine.shipping_roll.friction_n_s_m;
    let unwind = &machine.parent_roll;

    let mut text = String::new();
    let mut line = |name: &str, values: &[f64]| {
        text += name;
        for value in values {
            // the shortest digits that read back as the same number; writing to a string cannot fail
            let _ = write!(text, " {value:?}");
        }
        text += "\n";
    };
    line("per_length", &spans().map(f64::recip).collect::<Vec<_>>());
    line("stiffness", &[stiffness]);
    let viscosity = |length| stiffness * machine.web.retardation_s / length;
    line("viscosity", &spans().map(viscosity).collect::<Vec<_>>());
    let masses: Vec<_> = idle().map(|roll| roll.mass_kg().recip()).collect();
    line("per_mass", &masses);
    let drag: Vec<_> = idle().map(|roll| roll.friction_n_s_m).collect();
    line("friction", &drag);
    line("uw_inertia", &[machine.web.inertia_factor()]);
    line("uw_offset", &[machine.parent_roll_offset()]);
    line("uw_friction", &[unwind.friction_n_s_m]);
    line("layer", &[machine.web.caliper_m / TAU]);
    line("core", &[core]);
    line("drums", &[machine.windup_mass_kg(core)]);
    line("windup_friction", &[friction]);
    line("hold_s", &[HOLD_S]);
    let strain = tension / stiffness;
    // each roll a little faster than the one before: the web is stretched once, in the first span
    let v = SPEED_M_S * (1.0 + strain);
    line(
        "start",
        &[
            strain,
            strain,
            strain,
            v,
            v,
            v,
            SPEED_M_S / R_UW_M,
            R_UW_M,
            R_WU_M,
        ],
    );
    line("holds", &[f64::from(holds)]);
    let all_drag = friction + drag.iter().sum::<f64>();
    for hold in 0..holds {
        let t = HOLD_S * f64::from(hold);
        // the unwind's torque swings by a tenth, the drums' force by a twentieth: slow enough for drives, with a step
        // at each hold that wakes every mode of the web
        let brake = tension * (1.0 + 0.10 * (TAU * 0.7 * t).sin());
        let pull = tension * (1.0 + 0.05 * (TAU * 1.9 * t).sin()) + all_drag * SPEED_M_S;
        let uw = (unwind.friction_n_s_m * SPEED_M_S - brake) * R_UW_M;
        line("load", &[uw, pull]);
    }
    text
}
