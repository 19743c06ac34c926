//! Brakes: they stop in the time that Coulomb friction takes, hold without creep, and act after their delay.

use model_core::exchange::{Actuators, Brakes, BySection};
use model_core::machine::Machine;
use model_core::real::Float;

use crate::form::{self, Bench, H};
use crate::{in_both_scalars, near};

in_both_scalars!(
    a_brake_stops_in_momentum_over_force,
    the_time_of_a_stop_does_not_depend_on_the_step,
    a_brake_holds_the_web_at_standstill_without_creep,
    a_brake_holds_the_web_over_rolls_one_by_one,
    a_brake_that_is_too_weak_slips_by_the_difference,
    a_brake_acts_after_its_delay,
    the_papers_brake_creeps_and_the_set_valued_one_does_not,
    a_standing_brake_holds_more_than_a_sliding_one,
);

fn frictionless() -> Machine {
    let mut m = Machine::news_8000();
    m.parent_roll.friction_n_s_m = 0.0;
    m.shipping_roll.friction_n_s_m = 0.0;
    for roll in [&mut m.rear_drum, &mut m.front_drum, &mut m.rider_roll] {
        roll.friction_n_s_m = 0.0;
    }
    m
}

fn braked<R: Float>() -> Actuators<R> {
    Actuators {
        brakes: Brakes::all(true),
        ..Actuators::default()
    }
}

/// Time until the speed is exactly zero, in steps of [`H`]; it must stay so.
fn time_to_stop<R: Float>(bench: &mut Bench<R>, speed: impl Fn(&Bench<R>) -> R) -> f64 {
    time_to_stop_in(H, bench, speed)
}

fn time_to_stop_in<R: Float>(h: f64, bench: &mut Bench<R>, speed: impl Fn(&Bench<R>) -> R) -> f64 {
    let mut steps = 0;
    while speed(bench) != R::ZERO {
        assert!(speed(bench) > R::ZERO, "it turns back");
        bench.winder.step(&braked());
        steps += 1;
        assert!(steps < 100_000, "it does not stop");
    }
    for _ in 0..1000 {
        bench.winder.step(&braked());
        assert_eq!(speed(bench), R::ZERO);
    }
    f64::from(steps) * h
}

/// T = V_0·M/F_b and ω_0·J/T_b, ± h, after the delay. No web, no other friction.
fn a_brake_stops_in_momentum_over_force<R: Float>() {
    let m = frictionless();
    let (b, delay) = (&m.brakes, m.brakes.delay_s);
    let force = b.rd_n_m / m.rear_drum.radius_m + b.fd_n_m / m.front_drum.radius_m;
    for (v, r) in [(10.0, 0.05), (36.0, 0.6), (0.01, 0.3)] {
        let mut bench = Bench::<R>::new(m.clone());
        let mut x = bench.x();
        (x.v[2], x.r_wu) = (v, r);
        bench.set(&x);
        let time = time_to_stop(&mut bench, |bench| bench.winder.state().v[2]);
        let expected = v * form::windup_mass(&m, r) / force;
        near("windup", time, delay + expected, 1.01 * H);

        let omega = v / 1.5;
        let mut x = bench.x();
        (x.omega_uw, x.r_uw) = (omega, 1.5);
        bench.set(&x);
        let time = time_to_stop(&mut bench, |bench| bench.winder.state().omega_uw);
        // the brakes are closed already
        let expected = omega * form::parent_inertia(&m, 1.5) / b.uw_n_m;
        near("unwind", time, expected, 1.01 * H);
    }
}

/// T = V_0·M/F_b to a step, whatever the step is: half a minute at 36 m/s.
fn the_time_of_a_stop_does_not_depend_on_the_step<R: Float>() {
    let m = frictionless();
    let b = &m.brakes;
    let force = b.rd_n_m / m.rear_drum.radius_m + b.fd_n_m / m.front_drum.radius_m;
    let (v, r) = (36.0, 0.6);
    let expected = b.delay_s + v * form::windup_mass(&m, r) / force;
    for h in [0.008, 0.004, 0.002, 0.001, 0.0005] {
        let mut bench = Bench::<R>::with_step(m.clone(), h);
        let mut x = bench.x();
        (x.v[2], x.r_wu) = (v, r);
        bench.set(&x);
        let time = time_to_stop_in(h, &mut bench, |bench| bench.winder.state().v[2]);
        // f32 sums up 60 000 steps
        near(
            "time of the stop",
            time,
            expected,
            1.01 * h + form::either::<R>(1e-4, 0.0),
        );
    }
}

fn a_brake_holds_the_web_at_standstill_without_creep<R: Float>() {
    a_brake_holds::<R, 3>(Machine::news_8000());
}

fn a_brake_holds_the_web_over_rolls_one_by_one<R: Float>() {
    a_brake_holds::<R, 8>(Machine::news_8000_unlumped());
}

/// The web under stall tension between two held rolls, the motors pulling against the brakes.
fn a_brake_holds<R: Float, const SPANS: usize>(m: Machine) {
    let stall = m.operation.stall_share * form::tension(&m);
    let mut bench = Bench::<R, SPANS>::new(m);
    bench.winder.thread_at(R::of(stall));
    // until the brakes are closed, the web pulls the rolls together by a hair
    for _ in 0..25 {
        bench.winder.step(&braked());
    }
    // less than 6 and 10 kN·m of brakes less 840 N of web
    let motors = BySection {
        uw: 4e3,
        rd: 3e3,
        fd: 3e3,
        rr: 50.0,
    };
    let pulled = Actuators {
        torque: motors.map(R::of),
        ..braked()
    };
    let mut tension = bench.t();
    for minute in 0..3 {
        for _ in 0..(60.0 / H) as u32 {
            bench.winder.step(&pulled);
            let x = bench.winder.state();
            assert_eq!((x.v[SPANS - 1], x.omega_uw), (R::ZERO, R::ZERO));
        }
        for (t, before) in bench.t().into_iter().zip(tension) {
            // in the first minute the idle rolls come to rest
            let drift = if minute == 0 { 10.0 } else { 1e-3 };
            near("tension after a minute", t, before, drift);
        }
        tension = bench.t();
    }
    assert!(tension.iter().all(|t| *t > 0.9 * stall), "{tension:?}");
}

/// With F above F_b the body accelerates by (F − F_b)/M.
fn a_brake_that_is_too_weak_slips_by_the_difference<R: Float>() {
    let m = frictionless();
    let mut bench = Bench::<R>::new(m.clone());
    let mut actuators = braked::<R>();
    for _ in 0..20 {
        bench.winder.step(&actuators);
    }
    let torque = m.brakes.rd_n_m + m.brakes.fd_n_m + 1000.0;
    actuators.torque.rd = R::of(torque);
    actuators.torque.uw = R::of(m.brakes.uw_n_m + 500.0);
    for _ in 0..250 {
        bench.winder.step(&actuators);
    }
    let (x, m) = (bench.x(), &bench.machine);
    let v = 1000.0 / m.rear_drum.radius_m / form::windup_mass(m, 0.05);
    let omega = 500.0 / form::parent_inertia(m, 1.5);
    near("V after 1 s", x.v[2], v, 1e-4 * v);
    near("ω after 1 s", x.omega_uw, omega, 1e-4 * omega);
}

/// 40 ms are 10 steps without effect, both ways.
fn a_brake_acts_after_its_delay<R: Float>() {
    let mut bench = Bench::<R>::new(frictionless());
    let mut x = bench.x();
    (x.v[2], x.omega_uw) = (10.0, 10.0);
    bench.set(&x);
    let mut act = |on, braking: bool| {
        let actuators = Actuators {
            brakes: Brakes::all(on),
            ..Actuators::default()
        };
        let before = bench.winder.state();
        let m = bench.winder.step(&actuators);
        let after = bench.winder.state();
        assert_eq!(m.brakes, Brakes::all(braking));
        assert_eq!(after.v[2] < before.v[2], braking);
        assert_eq!(after.omega_uw < before.omega_uw, braking);
    };
    (0..10).for_each(|_| act(true, false));
    (0..10).for_each(|_| act(true, true));
    (0..10).for_each(|_| act(false, true));
    (0..10).for_each(|_| act(false, false));
}

/// The web under run tension against the closed unwind brake, the drums held: after how many seconds it is lost.
///
/// The roll comes to the brake with a speed inside the stiction band, as after every stop.
fn time_to_lose_tension<R: Float>(karnopp_m_s: f64) -> Option<f64> {
    let mut m = Machine::news_8000();
    m.brakes.karnopp_m_s = karnopp_m_s;
    let mut bench = Bench::<R>::new(m.clone());
    bench.winder.thread_at(R::of(form::tension(&m)));
    let mut x = bench.x();
    x.omega_uw = 0.01;
    bench.set(&x);
    let mut actuators = braked();
    // the drums hold the web by their motors
    actuators.torque.rd = R::of(form::tension(&m) * m.rear_drum.radius_m);
    let steps = (60.0 / H) as u32;
    let lost = (0..steps).find(|_| {
        bench.winder.step(&actuators);
        bench.t()[0] < 0.05 * form::tension(&m)
    });
    lost.map(|step| f64::from(step) * H)
}

/// Figure 2 of the paper balances the forces in its band and leaves the speed: the roll creeps on, the web goes
/// slack. The set-valued law takes the speed as well.
fn the_papers_brake_creeps_and_the_set_valued_one_does_not<R: Float>() {
    let lost = time_to_lose_tension::<R>(0.05);
    assert!(lost.is_some_and(|time| time < 5.0), "{lost:?}");
    assert_eq!(time_to_lose_tension::<R>(0.0), None);
}

/// At rest a brake holds its static torque; once it slips, its sliding torque is left.
fn a_standing_brake_holds_more_than_a_sliding_one<R: Float>() {
    let mut m = frictionless();
    m.brakes.static_ratio = 1.3;
    let (torque, inertia) = (m.brakes.uw_n_m, form::parent_inertia(&m, 1.5));
    for (share, slips) in [(1.29, false), (1.31, true)] {
        let mut bench = Bench::<R>::new(m.clone());
        let mut actuators = braked::<R>();
        for _ in 0..20 {
            bench.winder.step(&actuators);
        }
        actuators.torque.uw = R::of(share * torque);
        for _ in 0..250 {
            bench.winder.step(&actuators);
        }
        let omega = if slips {
            (share - 1.0) * torque / inertia
        } else {
            0.0
        };
        near("ω after 1 s", bench.x().omega_uw, omega, 1e-5);
    }
}
