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
        let rolls = [(p.full_radius_m, s.core_radius_m), (0.5*(p.full_radius_m+core), 0.5*(s.core_radius_m+s.full_radius_m)), (core, s.full_radius_m)];
        for (r_uw, r_wu) in rolls {
            let mut b = Bench::<f32>::new(&machine, r_uw, r_uw, r_wu);
            let time = b.tune(Loop::UnwindSpeed);
            let a = b.status.autotune;
            let j = machine.parent_roll_offset() + machine.web.roll_inertia(r_uw);
            println!("{name} uw {r_uw:.2} {:?} {:?} {time:.1} s J {:.5} b {:.4} old {:?} new {:?}", a.step, a.abort, a.inertia.to_f64()/j, a.friction.to_f64()/(p.friction_n_s_m*r_uw*r_uw), a.old, a.new);
            b.wait(0.1);
            let time = b.tune(Loop::DrumSpeed);
            let a = b.status.autotune;
            let mass = machine.rear_drum.mass_kg()+machine.front_drum.mass_kg()+machine.rider_roll.mass_kg() + (machine.web.roll_inertia(r_wu)-machine.web.roll_inertia(s.core_radius_m))/(r_wu*r_wu);
            let c = machine.rear_drum.friction_n_s_m+machine.front_drum.friction_n_s_m+machine.rider_roll.friction_n_s_m+s.friction_n_s_m;
            let sq = machine.rear_drum.radius_m.powi(2);
            println!("{name} rd {r_wu:.2} {:?} {:?} {time:.1} s J {:.5} b {:.4} old {:?} new {:?}", a.step, a.abort, a.inertia.to_f64()/mass/sq, a.friction.to_f64()/c/sq, a.old, a.new);
            let mut b = Bench::<f32>::running(&machine, r_uw, r_wu, machine.operation.thread_speed_m_s);
            b.wait(10.0); println!("t {:?}", b.t()); let time = b.tune(Loop::Tension);
            let a = b.status.autotune;
            println!("{name} t {r_uw:.2} {:?} {:?} {time:.1} s k {:.0} ({:.0}) damping {} old {:?} new {:?}", a.step, a.abort, a.stiffness.to_f64(), machine.web.stiffness_n_m*machine.web.width_m/machine.web_path_m(), b.drive.tuning().unwind.damping, a.old, a.new);
            let _ = CYCLE;
        }
    }
}
