//! Web break: by strength, by the end of the parent roll, and what is left of it.

use std::f64::consts::PI;

use model_core::machine::Machine;
use model_core::real::Float;

use crate::form::{self, Bench, H};
use crate::{in_both_scalars, near};

in_both_scalars!(
    the_web_breaks_above_its_strength,
    the_web_parts_when_the_parent_roll_runs_out,
    a_commanded_break_is_the_same,
    the_tail_is_wound_up,
);

/// No tension, radii hold, rolls turn on; threading makes it whole again.
fn is_broken<R: Float>(bench: &mut Bench<R>) {
    let at = bench.winder.state();
    assert!(!bench.winder.threaded());
    for _ in 0..(5.0 / H) as u32 {
        bench.step(&Default::default());
        let x = bench.winder.state();
        assert_eq!(bench.t(), [0.0; 3]);
        assert_eq!((x.r_uw, x.r_wu), (at.r_uw, at.r_wu));
    }
    let x = bench.x();
    // friction alone: within 5 s the slowest of them, the spreader rolls, loses 7 %
    assert!(x.v.iter().zip(at.v).all(|(v, at)| *v > 0.9 * at.to_f64()));
    assert!(x.omega_uw > 0.9 * at.omega_uw.to_f64());
    bench.winder.thread_at(R::of(100.0));
    assert!(bench.winder.threaded());
}

fn running<R: Float>(r_uw: f64) -> Bench<R> {
    let m = Machine::news_8000();
    let x = form::steady(&m, 10.0, form::tension(&m), r_uw, 0.3);
    Bench::threaded(m, &x)
}

/// 2 kN/m·8 m = 16 kN in any span; below, it holds.
fn the_web_breaks_above_its_strength<R: Float>() {
    let mut bench = running::<R>(1.5);
    let strength = bench.machine.web.strength_n_m * bench.machine.web.width_m;
    let mut highest = 0.0_f64;
    // the unwind is held back with a torque that rises by 10 kN·m/s
    for step in 0..5_000 {
        let mut torque = form::torques(&bench.machine, &bench.x(), 2800.0, 0.0);
        torque.uw -= 10e3 * H * f64::from(step);
        bench.step(&torque);
        if !bench.winder.threaded() {
            break;
        }
        highest = bench.t().into_iter().fold(highest, f64::max);
    }
    assert!(highest <= strength, "{highest} N, and the web still holds");
    assert!(highest > 0.98 * strength, "it broke at {highest} N already");
    is_broken(&mut bench);
}

fn the_web_parts_when_the_parent_roll_runs_out<R: Float>() {
    let mut bench = running::<R>(0.4501);
    let expire = bench.machine.parent_roll.expire_radius_m;
    for _ in 0..100_000 {
        if !bench.winder.threaded() {
            break;
        }
        assert!(bench.x().r_uw > expire);
        bench.pull(2800.0, 0.0);
    }
    let r = bench.x().r_uw;
    assert!(r <= expire && r > expire - 1e-6, "{r} m");
    is_broken(&mut bench);
}

fn a_commanded_break_is_the_same<R: Float>() {
    let mut bench = running::<R>(1.0);
    bench.winder.break_web();
    is_broken(&mut bench);
}

/// Where it is wanted, what hangs between the break and the drum still goes onto the roll: π·ΔR²/z = L, and no more.
fn the_tail_is_wound_up<R: Float>() {
    let mut m = Machine::news_8000();
    m.web.tail = true;
    let x = form::steady(
        &m,
        10.0,
        form::tension(&m),
        m.parent_roll.expire_radius_m,
        0.3,
    );
    let mut bench: Bench<R> = Bench::threaded(m.clone(), &x);
    // the roll has run out in the first span
    bench.step(&Default::default());
    let before = bench.x();
    assert!(!bench.winder.threaded());
    let tail = 0.5 * 6.0 + 3.0 + 2.5;
    for _ in 0..(5.0 / H) as u32 {
        bench.step(&Default::default());
    }
    let x = bench.x();
    let gained = PI * (x.r_wu.powi(2) - before.r_wu.powi(2)) / m.web.caliper_m;
    // it ends with the step in which it does
    near("tail in m", gained, tail, 10.0 * H + 0.01);
    assert!(gained >= tail - 0.01, "{gained} m");
    assert_eq!(x.r_uw, before.r_uw);
}
