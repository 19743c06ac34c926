#![allow(clippy::unwrap_used)]
mod bench;
use bench::{Bench, CYCLE};
use model_core::exchange::*;
use model_core::machine::Machine;
use model_core::real::Real;

#[test]
fn explore() {
    for name in ["NEWS-8000", "LWC-8000", "LAB-300"] {
        let machine = Machine::preset(name).unwrap();
        let p = &machine.parent_roll;
        let s = &machine.shipping_roll;
        let core = 1.05 * p.expire_radius_m;
        let rolls = [
            (p.full_radius_m, s.core_radius_m),
            (
                0.5 * (p.full_radius_m + core),
                0.5 * (s.core_radius_m + s.full_radius_m),
            ),
            (core, s.full_radius_m),
        ];
        for (r_uw, r_wu) in rolls {
            let mut b = Bench::<f32>::new(&machine, r_uw, r_uw, r_wu);
            let time = b.tune(Loop::UnwindSpeed);
            let a = b.status.autotune;
            let j = machine.parent_roll_offset() + machine.web.roll_inertia(r_uw);
            println!(
                "{name} uw {r_uw:.2} {:?} {:?} {time:.1} s J {:.5} b {:.4} old {:?} new {:?}",
                a.step,
                a.abort,
                a.inertia.to_f64() / j,
                a.friction.to_f64() / (p.friction_n_s_m * r_uw * r_uw),
                a.old,
                a.new
            );
            b.wait(0.1);
            let time = b.tune(Loop::DrumSpeed);
            let a = b.status.autotune;
            let mass = machine.rear_drum.mass_kg()
                + machine.front_drum.mass_kg()
                + machine.rider_roll.mass_kg()
                + (machine.web.roll_inertia(r_wu) - machine.web.roll_inertia(s.core_radius_m))
                    / (r_wu * r_wu);
            let c = machine.rear_drum.friction_n_s_m
                + machine.front_drum.friction_n_s_m
                + machine.rider_roll.friction_n_s_m
                + s.friction_n_s_m;
            let sq = machine.rear_drum.radius_m.powi(2);
            println!(
                "{name} rd {r_wu:.2} {:?} {:?} {time:.1} s J {:.5} b {:.4} old {:?} new {:?}",
                a.step,
                a.abort,
                a.inertia.to_f64() / mass / sq,
                a.friction.to_f64() / c / sq,
                a.old,
                a.new
            );
            let mut b =
                Bench::<f32>::running(&machine, r_uw, r_wu, machine.operation.thread_speed_m_s);
            b.wait(10.0);
            println!("t {:?}", b.t());
            let time = b.tune(Loop::Tension);
            let a = b.status.autotune;
            println!(
                "{name} t {r_uw:.2} {:?} {:?} {time:.1} s k {:.0} ({:.0}) damping {} old {:?} new {:?}",
                a.step,
                a.abort,
                a.stiffness.to_f64(),
                machine.web.stiffness_n_m * machine.web.width_m / machine.web_path_m(),
                b.drive.tuning().unwind.damping,
                a.old,
                a.new
            );
            let _ = CYCLE;
        }
    }
}
#[test]
fn trace() {
    let machine = Machine::preset("LAB-300").unwrap();
    let mut b = Bench::<f32>::running(&machine, 0.15, 0.038, machine.operation.thread_speed_m_s);
    b.wait(10.0);
    b.command.autotune = Some(Loop::Tension);
    let mut n = 0;
    for _ in 0..800 {
        b.cycle();
        if b.status.autotune.step >= TuneStep::Up && n < 80 {
            n += 1;
            println!(
                "T {n} {:?} {:.3} {:?} v {:.5} uw {:.5}",
                b.status.autotune.step,
                b.m.tension,
                b.t(),
                b.status.v,
                b.status.v_uw
            );
        }
    }
}
#[path = "bench/response.rs"]
mod response;
use response::*;
fn rolls(machine: &Machine) -> [(f64, f64); 3] {
    let p = &machine.parent_roll;
    let s = &machine.shipping_roll;
    let core = 1.15 * p.expire_radius_m;
    [
        (p.full_radius_m, s.core_radius_m),
        (
            0.5 * (p.full_radius_m + core),
            0.5 * (s.core_radius_m + s.full_radius_m),
        ),
        (core, s.full_radius_m),
    ]
}
#[test]
fn margins() {
    for name in ["NEWS-8000", "LWC-8000", "LAB-300"] {
        let machine = Machine::preset(name).unwrap();
        let o = machine.operation.clone();
        for (r_uw, r_wu) in rolls(&machine) {
            let mut b = Bench::<f64>::running(&machine, r_uw, r_wu, o.thread_speed_m_s);
            b.wait(10.0);
            b.tune(Loop::Tension);
            println!("{:?} {:?}", b.status.autotune.step, b.drive.tuning().unwind);
            let tuning = b.drive.tuning();
            for v in [o.thread_speed_m_s, 0.5 * o.run_speed_m_s, o.run_speed_m_s] {
                let mut b = Bench::<f64>::running(&machine, r_uw, r_wu, v);
                b.drive.set_tuning(&tuning);
                b.wait(12.0);
                for drum in [false, true] {
                    let mut b = b.clone();
                    let mut r = Response::new(CYCLE);
                    let amplitude = 0.004 * b.full_tension();
                    let radius = b.machine.rear_drum.radius_m;
                    for i in 0..2 * WINDOW {
                        if i == WINDOW {
                            r = Response::new(CYCLE);
                        }
                        let d = amplitude * r.disturbance();
                        if drum {
                            b.disturbance.rd = d * radius * 0.5;
                            b.disturbance.fd = 0.5 * d * radius;
                        } else {
                            b.disturbance.uw = d * r_uw;
                        }
                        b.cycle();
                        let t = b.status.torque;
                        let answer = if drum {
                            (t.rd + t.fd) / radius + t.rr / b.machine.rider_roll.radius_m
                        } else {
                            t.uw / r_uw
                        };
                        r.look(answer, d);
                    }
                    let l = r.open_loop();
                    println!(
                        "{name} drum {drum} r {r_uw:.2} v {v:.2} margins {:.2?} Ms {:.2} t {:.0?}",
                        gain_margins(&l),
                        sensitivity(&l),
                        b.t()
                    );
                    if std::env::var("V").is_ok() {
                        for p in &l {
                            println!(
                                "   {:.2} {:.3} {:.1}",
                                p.omega,
                                p.re.hypot(p.im),
                                p.im.atan2(p.re).to_degrees()
                            );
                        }
                    }
                }
            }
        }
    }
}
#[test]
fn ramps() {
    for name in ["NEWS-8000", "LWC-8000", "LAB-300"] {
        let machine = Machine::preset(name).unwrap();
        let o = machine.operation.clone();
        for (r_uw, r_wu) in rolls(&machine) {
            let mut b = Bench::<f32>::running(
                &machine,
                r_uw.max(0.4 * machine.parent_roll.full_radius_m),
                r_wu,
                o.thread_speed_m_s,
            );
            b.wait(10.0);
            if std::env::var("T").is_ok() {
                b.tune(Loop::Tension);
            }
            b.command.tension = b.full_tension() as f32;
            b.command.v_target = o.run_speed_m_s as f32;
            let mut worst = [0.0_f64; 6];
            let mut look = |b: &Bench<f32>| {
                let e = b.m.tension.to_f64() / b.status.tension_ref.to_f64() - 1.0;
                let ev = b.status.v.to_f64() - b.status.v_ref.to_f64();
                worst[0] = worst[0].min(e);
                worst[1] = worst[1].max(e);
                worst[2] = worst[2].min(ev);
                worst[3] = worst[3].max(ev);
            };
            let up = o.run_speed_m_s / o.acceleration_m_s2 + o.acceleration_m_s2 / o.jerk_m_s3;
            b.wait_with(up + 15.0, &mut look);
            let top = b.status.v;
            b.command.v_target = 0.0;
            b.wait_with(up + 10.0, &mut look);
            println!(
                "R {name} {r_uw:.2} top {top} tension {:.3} {:.3} speed {:.5} {:.5} t {:.0?} r {:.3}",
                worst[0],
                worst[1],
                worst[2],
                worst[3],
                b.t(),
                b.x().r_uw
            );
        }
    }
}
#[test]
fn estop() {
    for name in ["NEWS-8000", "LWC-8000"] {
        let machine = Machine::preset(name).unwrap();
        let o = machine.operation.clone();
        let n = 9;
        for i in 0..n {
            let lo = machine.parent_roll.expire_radius_m * 1.08;
            let r_uw = machine.parent_roll.full_radius_m
                + (lo - machine.parent_roll.full_radius_m) * i as f64 / (n - 1) as f64;
            let r_wu = 0.1 + 0.5 * i as f64 / (n - 1) as f64;
            let mut b = Bench::<f32>::running(&machine, r_uw, r_wu, o.run_speed_m_s);
            b.wait(6.0);
            b.command.v_target = 0.0;
            b.command.acceleration = o.emergency_m_s2 as f32;
            b.command.jerk = 2.0;
            b.command.brake_assist = true;
            let mut worst = [0.0_f64; 6];
            let mut at = [0.0; 2];
            let mut k = 0;
            let mut atl = 0;
            let look = |b: &Bench<f32>| {
                k += 1;
                let e = b.m.tension.to_f64() / b.status.tension_ref.to_f64() - 1.0;
                if e < worst[0] {
                    worst[0] = e;
                    at[0] = k as f64 * CYCLE;
                }
                if e > worst[1] {
                    worst[1] = e;
                    at[1] = k as f64 * CYCLE;
                }
                let ev = b.status.v.to_f64() - b.status.v_ref.to_f64();
                worst[2] = worst[2].min(ev);
                worst[3] = worst[3].max(ev);
                worst[4] = worst[4].max(b.t().into_iter().fold(0.0, f64::max));
                if b.m.brakes.uw {
                    atl += 1;
                }
            };
            b.wait_with(o.run_speed_m_s + 3.0, look);
            println!(
                "E {name} {r_uw:.2} tension {:.3} {:.3} at {:.2?} speed {:.5} {:.5} max {:.0} t {:.0?} braked {} s v {}",
                worst[0],
                worst[1],
                at,
                worst[2],
                worst[3],
                worst[4],
                b.t(),
                atl as f64 * CYCLE,
                b.status.v
            );
        }
    }
}
#[test]
fn defects() {
    let machine = Machine::preset("NEWS-8000").unwrap();
    let o = machine.operation.clone();
    for (what, preset, none, bare) in [
        ("normal", 1.5, false, false),
        ("low 3.3", 1.5 * 0.967, false, false),
        ("high 1", 1.5 * 0.99, false, false),
        ("none", 1.5, true, false),
        ("bare", 1.5, false, true),
    ] {
        let mut b = Bench::<f32>::new(&machine, 1.5, preset, 0.05);
        b.winder.thread_at(0.3 * 2800.0);
        b.command.tension = 840.0;
        b.command.no_inertia_compensation = none;
        b.command.bare_estimator = bare;
        b.hold(0.0);
        b.wait(10.0);
        b.command.v_target = o.thread_speed_m_s as f32;
        b.wait(15.0);
        b.command.tension = 2800.0;
        b.command.v_target = o.run_speed_m_s as f32;
        let mut log = vec![];
        let mut k = 0;
        let up = o.run_speed_m_s / o.acceleration_m_s2 + o.acceleration_m_s2 / o.jerk_m_s3;
        let mut worst = [0.0_f64, 0.0, 3.0, 0.0, 0.0];
        let mut look = |b: &Bench<f32>| {
            k += 1;
            let e = b.m.tension.to_f64() / b.status.tension_ref.to_f64() - 1.0;
            worst[0] = worst[0].min(e);
            worst[1] = worst[1].max(e);
            worst[2] = worst[2].min(b.status.r_uw.to_f64() / b.x().r_uw - 1.0);
            worst[3] = worst[3].max(b.status.r_uw.to_f64() / b.x().r_uw - 1.0);
            worst[4] = worst[4].max(b.t()[1]);
            if k % 500 == 0 {
                log.push((b.t()[1] as i32, (b.status.r_uw * 1e3) as i32));
            }
        };
        b.wait_with(up + 15.0, &mut look);
        b.command.v_target = 0.0;
        b.wait_with(up + 10.0, &mut look);
        println!("D {what} {:.3?} {:?}", worst, log);
    }
}
