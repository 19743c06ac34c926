//! Radii over length, and what the rolls give and take.

use std::f64::consts::PI;

use model_core::exchange::BySection;
use model_core::machine::Machine;
use model_core::plant::units::{One, Units};
use model_core::plant::windup::Windup;
use model_core::real::Float;

use crate::form::{self, Bench, H, RUN};
use crate::{in_both_scalars, near};

in_both_scalars!(
    radii_follow_the_length,
    an_hour_of_thread_speed_moves_the_radii_by_the_closed_form,
    mass_of_the_windup_is_that_of_its_rolls,
    a_free_parent_roll_keeps_its_speed_while_its_radius_falls,
);

/// Radius of the shipping roll after a length, m, to the micrometre.
const SHIPPING_ROLL: [(f64, f64); 5] = [
    (100.0, 0.067594),
    (1_000.0, 0.152283),
    (5_000.0, 0.325501),
    (10_000.0, 0.457604),
    (18_758.93, 0.625000),
];

/// Radius of the parent roll after a length, m, to the micrometre.
const PARENT_ROLL: [(f64, f64); 3] = [
    (1_000.0, 1.493087),
    (5_000.0, 1.465111),
    (10_000.0, 1.429370),
];

#[test]
fn closed_forms_give_the_table() {
    let m = Machine::news_8000();
    for (length, r) in SHIPPING_ROLL {
        near("R_wu", form::shipping_radius(&m, length), r, 0.5e-6);
    }
    for (length, r) in PARENT_ROLL {
        near("R_uw", form::parent_radius(&m, length), r, 0.5e-6);
    }
}

/// A whole set at run speed; the lengths are what the rolls' surfaces have covered.
fn radii_follow_the_length<R: Float>() {
    let m = Machine::news_8000();
    let t = form::tension(&m);
    let x = form::steady(&m, RUN, t, m.parent_roll.full_radius_m, 0.05);
    let mut bench = Bench::<R>::threaded(m.clone(), &x);
    // half an ulp of f32 at 1.5 m; in f64 the trapezoidal rule for V_uw
    let tolerance = form::either::<R>(0.07e-6, 1e-9);
    let (mut wound, mut unwound) = (0.0, 0.0);
    let mut v_uw = x.omega_uw * x.r_uw;
    for (length, r) in SHIPPING_ROLL {
        while wound < length {
            bench.pull(t, 0.0);
            let x = bench.x();
            wound += bench.travel();
            let v = x.omega_uw * x.r_uw;
            unwound += 0.5 * H * (v_uw + v);
            v_uw = v;
        }
        let x = bench.x();
        near("R_wu", x.r_wu, form::shipping_radius(&m, wound), tolerance);
        near("R_uw", x.r_uw, form::parent_radius(&m, unwound), tolerance);
        // the last step goes past the length by up to V·h
        let rate = m.web.caliper_m / std::f64::consts::TAU / r;
        near("R_wu of the table", x.r_wu, r, rate * RUN * H + 0.5e-6);
    }
    near("run speed held", bench.x().v[2], RUN, 0.01);
}

/// 1 500 m at 25 m/min from a full parent roll on to a large shipping roll: in a step, either radius moves by less
/// than f32 can tell.
fn an_hour_of_thread_speed_moves_the_radii_by_the_closed_form<R: Float>() {
    let m = Machine::news_8000();
    let stall = m.operation.stall_share * form::tension(&m);
    let v = m.operation.thread_speed_m_s;
    let (r_uw, r_wu) = (1.5, 0.5);
    let x = form::steady(&m, v, stall, r_uw, r_wu);
    let mut bench = Bench::<R>::threaded(m.clone(), &x);
    // as f32 rounds it
    let start = bench.x();
    let (mut wound, mut unwound) = (0.0, 0.0);
    for _ in 0..(3600.0 / H).round() as u32 {
        bench.pull(stall, 0.0);
        let x = bench.x();
        wound += bench.travel();
        unwound += H * x.omega_uw * x.r_uw;
    }
    let end = bench.x();
    near("V", end.v[2], v, 0.01 * v);
    let layers = |length: f64| m.web.caliper_m * length / PI;
    let rise = (start.r_wu.powi(2) + layers(wound)).sqrt() - start.r_wu;
    let fall = start.r_uw - (start.r_uw.powi(2) - layers(unwound)).sqrt();
    near("R_wu", end.r_wu - start.r_wu, rise, 1e-4 * rise);
    near("R_uw", start.r_uw - end.r_uw, fall, 1e-4 * fall);
}

/// M at the core and at 1.25 m, and as a step of the winder shows it: M = F·h/ΔV.
fn mass_of_the_windup_is_that_of_its_rolls<R: Float>() {
    let m = Machine::news_8000();
    let windup = Windup::<R>::new(&One(&m, &Units::SI), H);
    for (r, mass) in [(0.05, 15_061.0), (0.625, 18_459.0)] {
        let core = windup
            .mass(&windup.shipping_roll(R::of(r), R::ZERO))
            .to_f64();
        near("M in kg", core, mass, 0.5);
        near("M", core, form::windup_mass(&m, r), 1e-6 * mass);

        let mut bench = Bench::<R>::new(m.clone());
        let mut x = bench.x();
        x.r_wu = r;
        bench.set(&x);
        let force = 1000.0;
        bench.step(&BySection {
            rd: force * m.rear_drum.radius_m,
            ..BySection::default()
        });
        // friction c·V takes ½·c·h/M = 4e-6 of the force
        let felt = force * H / bench.x().v[2];
        near("M felt", felt, form::windup_mass(&m, r), 1e-5 * mass);
    }
}

/// No J̇·ω: the web carries the angular momentum away. With it, ω would grow by 17 % in this test.
fn a_free_parent_roll_keeps_its_speed_while_its_radius_falls<R: Float>() {
    let mut m = Machine::news_8000();
    m.parent_roll.friction_n_s_m = 0.0;
    for roll in &mut m.idle {
        roll.friction_n_s_m = 0.0;
    }
    for roll in [&mut m.rear_drum, &mut m.front_drum, &mut m.rider_roll] {
        roll.friction_n_s_m = 0.0;
    }
    m.shipping_roll.friction_n_s_m = 0.0;
    // a loop in every span, and the drums a little slower than the parent roll
    let mut x = form::steady(&m, 30.0, 0.0, 1.5, 0.05);
    x.strain = [-0.01; 3];
    x.v = [28.0, 27.0, 26.0];
    x.omega_uw = 30.0 / 1.5;
    let mut bench = Bench::<R>::threaded(m.clone(), &x);
    let (omega, steps) = (bench.winder.state().omega_uw, (60.0 / H) as u32);
    for _ in 0..steps {
        bench.step(&Default::default());
        assert_eq!(bench.t(), [0.0; 3], "the web hangs loose");
        assert_eq!(bench.winder.state().omega_uw, omega);
    }
    let fallen = m.web.caliper_m / std::f64::consts::TAU * 20.0 * 60.0;
    near("R_uw", bench.x().r_uw, 1.5 - fallen, 1e-7);
}
