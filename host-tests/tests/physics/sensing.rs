//! What is not ideal about rolls and load cells.

use std::f64::consts::TAU;

use model_core::exchange::{Actuators, BySection};
use model_core::machine::{LoadCells, Machine};
use model_core::real::Float;

use crate::form::{self, Bench, H, RUN};
use crate::{in_both_scalars, near};

in_both_scalars!(
    load_cells_show_what_their_wrap_angle_and_zero_make_of_the_tension,
    load_cells_between_two_tensions_show_their_mean,
    load_cells_follow_through_their_filter,
    an_eccentric_parent_roll_pulls_once_a_turn,
    an_eccentric_idle_roll_gives_the_spans_beside_it_opposite_ripple,
);

/// The web at rest under one tension, the motors in balance with it.
fn at_rest<R: Float>(m: &Machine, tension: f64) -> (Bench<R>, Actuators<R>) {
    let mut bench = Bench::<R>::new(m.clone());
    bench.winder.thread_at(R::of(tension));
    let torque = BySection {
        uw: -tension * m.parent_roll.full_radius_m,
        rd: tension * m.rear_drum.radius_m,
        ..BySection::default()
    };
    let actuators = Actuators {
        torque: torque.map(R::of),
        ..Actuators::default()
    };
    (bench, actuators)
}

/// Indicated over true tension is sin(β/2)/sin(β_cal/2), and the zero adds tare/(2·sin(β_cal/2)).
fn load_cells_show_what_their_wrap_angle_and_zero_make_of_the_tension<R: Float>() {
    let tension = 2800.0;
    for (wrap, calibrated, tare, both_spans) in [
        (1.0, 1.0, 0.0, false),
        (1.0, 1.1, 0.0, false),
        (0.9, 1.0, 200.0, false),
        (1.0, 0.95, -100.0, true),
    ] {
        let mut m = Machine::news_8000();
        m.load_cells = LoadCells {
            wrap_rad: wrap,
            calibrated_wrap_rad: calibrated,
            tare_n: tare,
            both_spans,
            ..m.load_cells
        };
        let (mut bench, actuators) = at_rest::<R>(&m, tension);
        let shown = (0..500).map(|_| bench.winder.step(&actuators).tension.to_f64());
        let shown = shown.last().unwrap();
        let sine = |angle: f64| (0.5 * angle).sin();
        let expected = (tension * sine(wrap) + 0.5 * tare) / sine(calibrated);
        near("indicated", shown, expected, 1e-4 * expected);
    }
}

/// With cells that feel both spans, the friction of their roll shows by a half.
fn load_cells_between_two_tensions_show_their_mean<R: Float>() {
    let mut m = Machine::news_8000();
    m.load_cells.both_spans = true;
    let x = form::steady(&m, RUN, 2800.0, 1.5, 0.05);
    let mut bench = Bench::<R>::threaded(m, &x);
    let torque = form::torques(&bench.machine, &x, 2800.0, 0.0);
    let actuators = Actuators {
        torque: torque.map(R::of),
        ..Actuators::default()
    };
    let shown = (0..250).map(|_| bench.winder.step(&actuators).tension.to_f64());
    let shown = shown.last().unwrap();
    let [before, after, _] = bench.t();
    // the filter is 50 ms behind a tension that still settles
    near("indicated", shown, 0.5 * (before + after), 2.0);
    near("difference", after - before, 229.0, 3.0);
}

/// A step of tension arrives as 1 − exp(−t/τ).
fn load_cells_follow_through_their_filter<R: Float>() {
    let m = Machine::news_8000();
    let (mut bench, actuators) = at_rest::<R>(&m, 2800.0);
    for step in 1..50 {
        let shown = bench.winder.step(&actuators).tension.to_f64();
        let share = 1.0 - (-f64::from(step) * H / m.load_cells.filter_s).exp();
        near("indicated", shown, 2800.0 * share, 1e-4 * 2800.0);
    }
}

/// A machine whose rolls are so heavy that they do not feel the ripple.
fn heavy() -> Machine {
    let mut m = Machine::news_8000();
    m.parent_roll.spool_inertia_kg_m2 = 1e5;
    for roll in &mut m.idle {
        roll.inertia_kg_m2 = 1e4;
    }
    m.rear_drum.inertia_kg_m2 = 1e5;
    m.front_drum.inertia_kg_m2 = 1e5;
    m
}

/// Ripple of t_uw and t_gr at ω in steady run, N: what is in phase with cos(ω·t + φ), and a quarter turn later.
fn ripple<R: Float>(m: Machine, v: f64, omega: f64) -> [[f64; 2]; 2] {
    let x = form::steady(&m, v, 2800.0, 1.5, 0.05);
    let mut bench = Bench::<R>::threaded(m, &x);
    // whole turns, after the ripple has settled
    let turns = (4.0 * omega / TAU).floor();
    let steps = (turns * TAU / omega / H).round() as u32;
    let settle = (6.0 / H) as u32;
    let mut sums = [[0.0; 2]; 2];
    for step in 0..settle + steps {
        bench.pull(2800.0, 0.0);
        if step >= settle {
            let angle = omega * H * f64::from(step);
            for (sum, t) in sums.iter_mut().zip(bench.t()) {
                sum[0] += 2.0 * t * angle.cos() / f64::from(steps);
                sum[1] += 2.0 * t * angle.sin() / f64::from(steps);
            }
        }
    }
    sums
}

fn amplitude([cosine, sine]: [f64; 2]) -> f64 {
    cosine.hypot(sine)
}

/// A deviation δ = ω·e·cos of the speed that enters a span strains it by (δ/V)/(1 + jω·L/V), and ω = V/R: the
/// amplitude is EA·(e/R)/√(1 + (L/R)²).
fn an_eccentric_parent_roll_pulls_once_a_turn<R: Float>() {
    let (v, e) = (30.0, 1e-3);
    let mut m = heavy();
    m.parent_roll.eccentricity_m = e;
    let (r, l) = (m.parent_roll.full_radius_m, m.idle[0].span_m);
    let expected = form::stiffness(&m) * e / r / (1.0 + (l / r).powi(2)).sqrt();
    let [uw, _] = ripple::<R>(m.clone(), v, v / r);
    // the rolls give way by 2 %, the web's viscosity adds 1 %
    near("ripple", amplitude(uw), expected, 0.05 * expected);
    let [uw, _] = ripple::<R>(m, v, 2.0 * v / r);
    near("at twice the turn", amplitude(uw), 0.0, 0.05 * expected);
}

/// It lengthens the span before it by e as it shortens the one after it: EA·e/L on one side, −EA·e/L on the other.
fn an_eccentric_idle_roll_gives_the_spans_beside_it_opposite_ripple<R: Float>() {
    // slow enough that the step of 4 ms is short against a turn
    let (v, e) = (4.0, 1e-4);
    let mut m = heavy();
    m.idle[0].eccentricity_m = e;
    let r = m.idle[0].radius_m;
    let [uw, gr] = ripple::<R>(m.clone(), v, v / r);
    let ea = form::stiffness(&m);
    for (what, ripple, length) in [
        ("t_uw", uw, m.idle[0].span_m),
        ("t_gr", gr, m.idle[1].span_m),
    ] {
        let expected = ea * e / length;
        near(what, amplitude(ripple), expected, 0.05 * expected);
    }
    let product = uw[0] * gr[0] + uw[1] * gr[1];
    let opposite = -amplitude(uw) * amplitude(gr);
    near("opposite phase", product / opposite, 1.0, 0.05);
}
