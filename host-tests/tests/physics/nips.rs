//! The nips of the windup: load, traction, slip, and how tight the roll is wound.

use std::f64::consts::PI;

use model_core::exchange::{Actuators, Brakes, BySection, Rider};
use model_core::machine::Machine;
use model_core::plant::nip::Nips;
use model_core::real::Float;
use proptest::prelude::*;

use crate::form::{self, Bench, H, either};
use crate::{in_both_scalars, near};

in_both_scalars!(
    without_slip_nothing_changes_when_slip_is_possible,
    a_drum_lets_go_at_the_traction_of_its_nip,
    a_sliding_drum_accelerates_by_what_its_nip_leaves,
    a_roll_that_sticks_again_keeps_the_momentum,
    static_traction_is_lost_at_once,
    tight_layers_are_thinner,
    a_lifted_rider_roll_coasts,
    a_lowered_rider_roll_is_caught,
    drums_without_friction_turn_alone,
);

fn slipping() -> Machine {
    let mut m = Machine::news_8000();
    m.nips.slip = true;
    m
}

/// No web, no viscous friction: what is left are torques, masses and nips.
fn bare() -> Machine {
    let mut m = slipping();
    m.shipping_roll.friction_n_s_m = 0.0;
    for roll in [&mut m.rear_drum, &mut m.front_drum, &mut m.rider_roll] {
        roll.friction_n_s_m = 0.0;
    }
    m
}

fn turning<R: Float>(machine: Machine, v: f64, r_wu: f64) -> Bench<R> {
    let mut bench = Bench::new(machine);
    let mut x = bench.x();
    (x.v[2], x.windup, x.r_wu) = (v, [v; 3], r_wu);
    bench.set(&x);
    bench
}

fn front<R: Float>(torque: f64) -> Actuators<R> {
    Actuators {
        torque: BySection {
            fd: R::of(torque),
            ..BySection::default()
        },
        ..Actuators::default()
    }
}

/// The load of the rear drum's nip N = (w + Q)/(2·cos α), N/m
fn load(m: &Machine, r: f64, rider: f64) -> f64 {
    let density = m.web.grammage_kg_m2 / m.web.caliper_m;
    let weight = density * 9.806_65 * PI * (r.powi(2) - m.shipping_roll.core_radius_m.powi(2));
    let drum = m.rear_drum.radius_m;
    let alpha = ((drum + 0.5 * m.nips.drum_gap_m) / (drum + r)).asin();
    (weight + rider) / (2.0 * alpha.cos())
}

/// Every point of the table holds 3.0 kN/m, until the roll's own weight takes over.
#[test]
fn the_rider_roll_holds_the_nip_load() {
    let m = Machine::news_8000();
    let nips = Nips::<f64>::new(&m);
    for (i, point) in m.nips.rider_load.iter().enumerate() {
        let r = 0.5 * point.diameter_m;
        let [rear, front, rider] = nips.loads(r);
        near("Q of the table", rider, point.load_n_m, 1e-9);
        near("N", rear, load(&m, r, point.load_n_m), 1e-9 * rear);
        assert_eq!(rear, front, "equal drums");
        if i < 9 {
            near("N", rear, 3.0e3, 0.02 * 3.0e3);
        } else {
            assert!(rear > 3.0e3, "{rear}");
        }
    }
    // linear between two points, and held beyond the ends
    near(
        "D = 0.25",
        nips.loads(0.125)[2],
        0.5 * (3.26e3 + 3.54e3),
        1e-9,
    );
    near("below", nips.loads(0.049)[2], 2.53e3, 1e-9);
    near("above", nips.loads(0.6)[2], 0.40e3, 1e-9);
}

/// Q is the table's times what is set, and 0 of a lifted roll; the drums' nips follow by N = (w + Q)/(2·cos α).
#[test]
fn the_load_of_the_rider_roll_is_set() {
    let m = Machine::news_8000();
    let mut nips = Nips::<f64>::new(&m);
    let r = 0.2;
    let table = nips.loads(r)[2];
    for (lifted, load_trim, share, changed) in [
        (false, 0.0, 1.0, false),
        (false, -0.4, 0.6, true),
        (false, 1.0, 2.0, true),
        (false, -1.5, 0.0, true),
        (true, 0.5, 0.0, true),
    ] {
        assert_eq!(nips.press(&Rider { lifted, load_trim }), changed);
        let [rear, front, rider] = nips.loads(r);
        near("Q", rider, share * table, 1e-9 * table);
        near("N", rear, load(&m, r, share * table), 1e-9 * rear);
        assert_eq!(rear, front);
        assert_eq!(nips.rider_lifted(), lifted);
    }
}

fn with_rider<R: Float>(lifted: bool) -> Actuators<R> {
    Actuators {
        rider: Rider {
            lifted,
            ..Rider::default()
        },
        ..Actuators::default()
    }
}

/// V_rr = V_0·exp(−c·t/m), and what is left of the windup slows down by its own friction: M'·V̇ = −Σ c·V. On a
/// machine that does not compute slip otherwise.
fn a_lifted_rider_roll_coasts<R: Float>() {
    let mut m = Machine::news_8000();
    // resistance and growth of the shipping roll have tests of their own
    m.shipping_roll.friction_n_s_m = 0.0;
    let (v, r, steps) = (20.0, 0.3, 2500);
    let mut bench = turning::<R>(m.clone(), v, r);
    for _ in 0..steps {
        let measured = bench.winder.step(&with_rider(true));
        assert!(measured.rider_lifted);
    }
    let time = f64::from(steps) * H;
    let x = bench.x();
    let [fd, rr, wu] = x.windup;
    let rider = m.rider_roll;
    let coasted = v * (-rider.friction_n_s_m * time / rider.mass_kg()).exp();
    near("V_rr", rr, coasted, either::<R>(1e-4, 1e-9));
    let mass = form::windup_mass(&m, r) - rider.mass_kg();
    let friction = m.rear_drum.friction_n_s_m + m.front_drum.friction_n_s_m;
    let slowed = v * (-friction * time / mass).exp();
    near("V_rd", x.v[2], slowed, either::<R>(1e-4, 1e-9));
    assert_eq!([fd, wu], [x.v[2]; 2], "the others stick");
    assert!((rr - x.v[2]).abs() > 0.1, "{rr} is not {}", x.v[2]);
}

/// Lowered onto a turning roll the standing rider roll is pulled up by μ·Q·W, and sticks with the momentum kept.
fn a_lowered_rider_roll_is_caught<R: Float>() {
    let m = bare();
    let (v, r) = (20.0, 0.3);
    let mut bench = turning::<R>(m.clone(), v, r);
    let mut x = bench.x();
    x.windup[1] = 0.0;
    bench.set(&x);
    for _ in 0..100 {
        bench.winder.step(&with_rider(true));
    }
    assert_eq!(bench.x().windup[1], 0.0, "nothing pulls it");
    let rider = m.rider_roll.mass_kg();
    let rest = form::windup_mass(&m, r) - rider;
    let pull = m.nips.friction * m.web.width_m * Nips::<f64>::new(&m).loads(r)[2];
    // both ends of the slip come nearer by the pull on their reduced mass
    let slips = v / (pull * (1.0 / rider + 1.0 / rest));
    let mut steps = 0;
    while bench.winder.winding().slides[2] {
        bench.winder.step(&with_rider(false));
        steps += 1;
        assert!(steps < 1000);
    }
    near("slip ends after", f64::from(steps) * H, slips, 2.0 * H);
    let common = v * rest / (rest + rider);
    let x = bench.x();
    near("V", x.v[2], common, either::<R>(1e-4, 1e-9));
    assert_eq!(x.windup, [x.v[2]; 3]);
}

/// Drums that have lost all their friction keep their speeds while a brake stops one of them: nothing passes.
fn drums_without_friction_turn_alone<R: Float>() {
    let mut bench = turning::<R>(bare(), 10.0, 0.3);
    let mut actuators = Actuators::<R>::default();
    actuators.faults.machine.drum_wear = R::of(1.0);
    actuators.brakes.rd = true;
    for _ in 0..2000 {
        bench.winder.step(&actuators);
    }
    let x = bench.x();
    let [fd, rr, wu] = x.windup;
    assert_eq!(x.v[2], 0.0);
    near("V_fd", fd, 10.0, either::<R>(1e-4, 1e-9));
    near("V_wu", wu, 10.0, either::<R>(1e-4, 1e-9));
    near("V_rr", rr, 10.0, either::<R>(1e-4, 1e-9));
}

/// All nips sticking is {15}: the same bits as the windup that cannot slip.
fn without_slip_nothing_changes_when_slip_is_possible<R: Float>() {
    let run = |machine: Machine| {
        let x = form::steady(&machine, 20.0, 2800.0, 1.4, 0.3);
        let mut bench = Bench::<R>::threaded(machine, &x);
        for step in 0..2500 {
            let a = if step % 1000 < 500 { 0.45 } else { -0.45 };
            let torque = form::torques(&bench.machine, &bench.x(), 2800.0, a);
            bench.winder.step(&Actuators {
                torque: torque.map(R::of),
                brakes: Brakes {
                    uw: false,
                    rd: step > 2400,
                    fd: step > 2400,
                },
                ..Actuators::default()
            });
            assert_eq!(bench.winder.winding().slides, [false; 3]);
        }
        bench.winder.state()
    };
    assert_eq!(run(slipping()), run(Machine::news_8000()));
}

/// The front drum's nip needs F = (T/R)·(M − m_fd)/M; it slides from μ·N·W on.
fn a_drum_lets_go_at_the_traction_of_its_nip<R: Float>() {
    let m = bare();
    let r = 0.3;
    let drum = m.front_drum;
    let mass = drum.inertia_kg_m2 / drum.radius_m.powi(2);
    let whole = form::windup_mass(&m, r);
    let rider = Nips::<f64>::new(&m).loads(r)[2];
    let traction = m.nips.friction * load(&m, r, rider) * m.web.width_m;
    let limit = traction * drum.radius_m * whole / (whole - mass);
    for (share, slides) in [
        (0.999, false),
        (1.001, true),
        (-0.999, false),
        (-1.001, true),
    ] {
        let mut bench = turning::<R>(m.clone(), 20.0, r);
        bench.winder.step(&front(share * limit));
        assert_eq!(
            bench.winder.winding().slides,
            [false, slides, false],
            "{share}"
        );
        let force = bench.winder.winding().nip_force[1].to_f64();
        let expected = share.clamp(-1.0, 1.0) * traction;
        near("F_fd", force, expected, either::<R>(1e-5, 1e-9) * traction);
    }
}

/// m_fd·V̇_fd = T/R − μ·N·W, and the rest of the windup is driven by μ·N·W.
fn a_sliding_drum_accelerates_by_what_its_nip_leaves<R: Float>() {
    let m = bare();
    let (r, torque, steps) = (0.3, 12e3, 250);
    let mut bench = turning::<R>(m.clone(), 5.0, r);
    for _ in 0..steps {
        bench.winder.step(&front(torque));
    }
    let rider = Nips::<f64>::new(&m).loads(r)[2];
    let traction = m.nips.friction * load(&m, r, rider) * m.web.width_m;
    let drum = m.front_drum;
    let mass = drum.inertia_kg_m2 / drum.radius_m.powi(2);
    let time = f64::from(steps) * H;
    let x = bench.x();
    let [fd, rr, wu] = x.windup;
    let slid = 5.0 + (torque / drum.radius_m - traction) / mass * time;
    let driven = 5.0 + traction / (form::windup_mass(&m, r) - mass) * time;
    let tolerance = either::<R>(2e-5, 1e-9);
    near("V_fd", fd, slid, tolerance);
    near("V_rd", x.v[2], driven, tolerance);
    assert_eq!([x.v[2], rr], [wu, wu], "what sticks has one speed");
}

/// After a kick the drum slides back into grip; Σ m·V is what the torque gave.
fn a_roll_that_sticks_again_keeps_the_momentum<R: Float>() {
    let m = bare();
    let r = 0.5;
    let drum = m.front_drum;
    let mass = drum.inertia_kg_m2 / drum.radius_m.powi(2);
    let whole = form::windup_mass(&m, r);
    let mut bench = turning::<R>(m.clone(), 10.0, r);
    let (torque, kick) = (15e3, 50);
    let mut slid = 0;
    for step in 0..1500 {
        let torque = if step < kick { torque } else { 0.0 };
        bench.winder.step(&front(torque));
        slid += i32::from(bench.winder.winding().slides[1]);
    }
    assert!(slid > kick, "it slid on after the kick: {slid} steps");
    let x = bench.x();
    assert_eq!(x.windup, [x.v[2]; 3], "all stick again");
    let impulse = f64::from(kick) * H * torque / drum.radius_m;
    let momentum = 10.0 * whole + impulse;
    let tolerance = either::<R>(1e-6, 1e-12);
    near("Σ m·V", whole * x.v[2], momentum, tolerance * momentum);
    assert!(mass < whole);
}

/// With static above sliding friction a nip holds more, and carries only sliding friction once it has let go.
fn static_traction_is_lost_at_once<R: Float>() {
    let mut m = bare();
    m.nips.static_ratio = 1.5;
    let r = 0.3;
    let sliding = Nips::<f64>::new(&m).traction(&Nips::<f64>::new(&m).loads(r))[1];
    let drum = m.front_drum;
    let mass = drum.inertia_kg_m2 / drum.radius_m.powi(2);
    let whole = form::windup_mass(&m, r);
    let needs = |force: f64| force * drum.radius_m * whole / (whole - mass);
    let mut bench = turning::<R>(m, 20.0, r);
    for (force, slides, carried) in [
        (1.4 * sliding, false, 1.4 * sliding),
        (1.6 * sliding, true, sliding),
        // what would have held before does not catch it again while the drum is faster
        (1.4 * sliding, true, sliding),
    ] {
        bench.winder.step(&front(needs(force)));
        let winding = bench.winder.winding();
        assert_eq!(winding.slides[1], slides, "{force}");
        near(
            "F_fd",
            winding.nip_force[1].to_f64(),
            carried,
            1e-5 * carried,
        );
    }
}

/// R_wu² = R_core² + z_eff·L/π with z_eff = z·[1 − κ·(WOT/WOT_ref − 1)], and WOT as its terms say.
fn tight_layers_are_thinner<R: Float>() {
    let mut m = Machine::news_8000();
    m.wound_on_tension.compresses = true;
    m.wound_on_tension.hardness = 0.05;
    m.wound_on_tension.reference_n_m = 400.0;
    let x = form::steady(&m, 20.0, 2800.0, 1.4, 0.3);
    let mut bench = Bench::<R>::threaded(m.clone(), &x);
    let (mut length, mut thinning) = (0.0, 0.0);
    let steps = 500;
    for _ in 0..steps {
        bench.pull(2800.0, 0.0);
        length += bench.travel();
        let winding = bench.winder.winding();
        let (load, front) = (winding.nip_load[0].to_f64(), winding.nip_force[1].to_f64());
        let w = &m.wound_on_tension;
        let expected = w.tension_gain * bench.t()[2] / m.web.width_m
            + w.paper_friction * load / (1.0 + load / w.nip_scale_n_m)
            + w.force_gain * front / m.web.width_m;
        near(
            "WOT",
            winding.wound_on_tension.to_f64(),
            expected,
            1e-5 * expected,
        );
        thinning += w.hardness * (expected / w.reference_n_m - 1.0) / f64::from(steps);
    }
    let gained = (bench.x().r_wu.powi(2) - 0.3_f64.powi(2)) * PI / m.web.caliper_m / length;
    // a layer follows the tension of the step before
    near("z_eff/z", gained, 1.0 - thinning, either::<R>(2e-3, 2e-4));
    assert!(thinning > 0.02, "{thinning}");
}

proptest! {
    /// Nips only take energy: ½·Σ m·V² never rises without torque, whatever the rolls do.
    #[test]
    fn nips_and_brakes_never_give_energy(
        r in 0.06..0.62_f64,
        v in prop::array::uniform4(-30.0..30.0_f64),
        friction in 0.02..0.5_f64,
        brake in prop::bool::ANY,
    ) {
        let mut m = bare();
        m.nips.friction = friction;
        let mut bench = Bench::<f64>::new(m.clone());
        let mut x = bench.x();
        (x.v[2], x.windup, x.r_wu) = (v[0], [v[1], v[2], v[3]], r);
        bench.set(&x);
        let masses = [
            form::shipping_mass(&m, r),
            m.rear_drum.mass_kg(),
            m.front_drum.mass_kg(),
            m.rider_roll.mass_kg(),
        ];
        let energy = |bench: &Bench<f64>| {
            let x = bench.x();
            let v = [x.windup[2], x.v[2], x.windup[0], x.windup[1]];
            masses.iter().zip(v).map(|(m, v)| 0.5 * m * v * v).sum::<f64>()
        };
        let mut before = energy(&bench);
        for _ in 0..500 {
            bench.winder.step(&Actuators {
                brakes: Brakes { uw: false, rd: brake, fd: brake },
                ..Actuators::default()
            });
            let after = energy(&bench);
            prop_assert!(after <= before * (1.0 + 1e-12), "{before} J to {after} J");
            before = after;
        }
    }

    /// No torque, brake or web makes a state anything but a finite number.
    #[test]
    fn no_input_makes_a_state_infinite(
        torques in prop::collection::vec(
            (prop::array::uniform4(-1e9..1e9_f64), prop::bool::ANY, prop::bool::ANY), 1..40),
        slip in prop::bool::ANY,
        karnopp in prop::bool::ANY,
    ) {
        let mut m = Machine::news_8000();
        m.nips.slip = slip;
        m.wound_on_tension.compresses = slip;
        m.brakes.karnopp_m_s = if karnopp { 0.05 } else { 0.0 };
        m.parent_roll.eccentricity_m = 1e-3;
        let mut bench = Bench::<f32>::new(m);
        bench.winder.thread_at(2800.0);
        for (torque, brake, thread) in torques {
            let [uw, rd, fd, rr] = torque.map(|t| t as f32);
            let mut actuators = Actuators {
                torque: BySection { uw, rd, fd, rr },
                brakes: Brakes::all(brake),
                ..Actuators::default()
            };
            actuators.handling.thread_web = thread;
            for _ in 0..20 {
                bench.winder.step(&actuators);
                let x = bench.winder.state();
                prop_assert!(x.iter().all(f32::is_finite), "{x:?}");
                prop_assert!(bench.winder.tension().iter().all(|t| t.is_finite()));
            }
        }
    }
}
