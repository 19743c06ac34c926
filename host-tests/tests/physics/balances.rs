//! What goes in comes out: paper and energy, for the default machine and for random ones.

use std::f64::consts::{PI, TAU};

use model_core::exchange::BySection;
use model_core::machine::{DrivenRoll, IdleRoll, Machine};
use model_core::plant::rk4::State;
use model_core::real::Float;
use proptest::prelude::*;

use crate::form::{self, Bench, H, RUN};
use crate::{in_both_scalars, near};

in_both_scalars!(
    a_cycle_loses_neither_paper_nor_energy,
    a_cycle_over_rolls_one_by_one_loses_neither,
);

/// A stretch of the schedule: for so long, s, with this acceleration, m/s², and this tension, N.
type Stretch = (f64, f64, f64);

/// Relative errors of the balances over a run.
#[derive(Debug, Default)]
struct Balance {
    /// Length that the parent roll gave, m.
    length: f64,
    /// Of the length without strain that the parent roll gave, the spans hold and the shipping roll took.
    paper: f64,
    /// Of the length on the shipping roll by its area and by its surface.
    area: f64,
    /// Of the kinetic energy and what came in, in terms of all that flowed.
    energy: f64,
}

impl Balance {
    /// Runs the schedule with torques that would do as it says, if nothing oscillated.
    fn of<R: Float, const SPANS: usize>(bench: &mut Bench<R, SPANS>, schedule: &[Stretch]) -> Self {
        let m = bench.machine.clone();
        let start = bench.x();
        let (mut taken, mut travel, mut supplied, mut turnover) = (0.0, 0.0, 0.0, 0.0);
        for &(time, acceleration, tension) in schedule {
            for _ in 0..(time / H) as u32 {
                let (x, t) = (bench.x(), bench.t());
                let torque = bench.pull(tension, acceleration);
                let (x_next, t_next) = (bench.x(), bench.t());
                travel += bench.travel();
                taken += 0.5 * H * (inflow(&x) + inflow(&x_next));
                let flows = powers(&m, &x, &t, &torque).into_iter();
                for (a, b) in flows.zip(powers(&m, &x_next, &t_next, &torque)) {
                    let energy = 0.5 * H * (a + b);
                    supplied += energy;
                    turnover += energy.abs();
                }
            }
        }
        assert!(bench.winder.threaded(), "the web broke");
        let end = bench.x();
        let length = |r: f64, r_0: f64| PI * (r * r - r_0 * r_0) / m.web.caliper_m;
        let given = length(start.r_uw, end.r_uw);
        let rolled = length(end.r_wu, start.r_wu);
        let kept = taken + stored(&m, &end) - stored(&m, &start);
        let gain = kinetic(&m, &end) - kinetic(&m, &start);
        Self {
            length: given,
            paper: (given / kept - 1.0).abs(),
            area: (rolled / travel - 1.0).abs(),
            energy: (gain - supplied).abs() / turnover,
        }
    }
}

/// Rate at which the shipping roll takes web, without its strain: V_rd/(1+ε_sr), m/s
fn inflow<const SPANS: usize>(x: &State<f64, SPANS>) -> f64 {
    x.v[SPANS - 1] / (1.0 + x.strain[SPANS - 1])
}

/// Length of web in the spans without its strain: Σ L/(1+ε), m
fn stored<const SPANS: usize>(m: &Machine, x: &State<f64, SPANS>) -> f64 {
    let spans = form::lengths::<SPANS>(m).into_iter().zip(x.strain);
    spans.map(|(length, strain)| length / (1.0 + strain)).sum()
}

/// Kinetic energy of all rolls, J
fn kinetic<const SPANS: usize>(m: &Machine, x: &State<f64, SPANS>) -> f64 {
    let idle = |i: usize| form::idle_mass(m, i) * x.v[i].powi(2);
    0.5 * (form::parent_inertia(m, x.r_uw) * x.omega_uw.powi(2)
        + (0..SPANS - 1).map(idle).sum::<f64>()
        + form::windup_mass(m, x.r_wu) * x.v[SPANS - 1].powi(2))
}

/// What flows into the rolls, W: by motors, frictions, tensions, and with the paper that leaves the parent roll
/// with ½·ρzW·V_uw³ and arrives at the shipping roll with ½·ρzW·V_rd³.
fn powers<const SPANS: usize>(
    m: &Machine,
    x: &State<f64, SPANS>,
    t: &[f64; SPANS],
    torque: &BySection<f64>,
) -> Vec<f64> {
    let v_uw = x.omega_uw * x.r_uw;
    let v_rd = x.v[SPANS - 1];
    let mass_per_length = m.web.grammage_kg_m2 * m.web.width_m;
    let mut powers = vec![
        torque.uw * x.omega_uw,
        torque.rd / m.rear_drum.radius_m * v_rd,
        torque.fd / m.front_drum.radius_m * v_rd,
        -m.parent_roll.friction_n_s_m * v_uw * v_uw,
        -form::windup_friction(m) * v_rd * v_rd,
        -0.5 * mass_per_length * v_uw.powi(3),
        0.5 * mass_per_length * v_rd.powi(3),
    ];
    for (roll, v) in m.idle.iter().zip(x.v) {
        powers.push(-roll.friction_n_s_m * v * v);
    }
    let entering = [v_uw].into_iter().chain(x.v);
    for ((t, v_up), v) in t.iter().zip(entering).zip(x.v) {
        powers.extend([t * v_up, -t * v]);
    }
    powers
}

fn a_cycle_loses_neither_paper_nor_energy<R: Float>() {
    a_cycle::<R, 3>(Machine::news_8000());
}

fn a_cycle_over_rolls_one_by_one_loses_neither<R: Float>() {
    a_cycle::<R, 8>(Machine::news_8000_unlumped());
}

/// Start, run, stop.
fn a_cycle<R: Float, const SPANS: usize>(m: Machine) {
    let t = form::tension(&m);
    let x = form::steady(&m, 0.5, t, 1.5, 0.05);
    let mut bench = Bench::<R, SPANS>::threaded(m, &x);
    let time = RUN / 0.45;
    let balance = Balance::of(
        &mut bench,
        &[(time, 0.45, t), (300.0, 0.0, t), (time, -0.45, t)],
    );
    near("back at crawl", bench.x().v[SPANS - 1], 0.5, 0.05);
    near("paper", balance.paper, 0.0, 1e-6);
    near("area", balance.area, 0.0, 1e-6);
    near("energy", balance.energy, 0.0, 1e-4);
}

/// What the parent roll loses in area the shipping roll gains 1 + ε times: the strain is wound in.
#[test]
fn the_shipping_roll_grows_by_the_strained_length() {
    let m = Machine::news_8000();
    let t = form::tension(&m);
    let x = form::steady(&m, RUN, t, 1.5, 0.05);
    let strain = x.strain[2];
    let mut bench = Bench::<f64>::threaded(m, &x);
    for _ in 0..(100.0 / H) as u32 {
        bench.pull(t, 0.0);
    }
    let end = bench.x();
    let gained = end.r_wu.powi(2) - x.r_wu.powi(2);
    let lost = x.r_uw.powi(2) - end.r_uw.powi(2);
    near("area", gained / lost, 1.0 + strain, 1e-6);
}

/// Machines from half to twice the default one, part by part.
fn machines() -> impl Strategy<Value = Machine> {
    let factor = || 0.5..2.0_f64;
    let roll = move || [factor(), factor(), factor(), factor()];
    let idle = move |roll: IdleRoll, f: [f64; 4]| IdleRoll {
        span_m: roll.span_m * f[0],
        radius_m: roll.radius_m * f[1],
        inertia_kg_m2: roll.inertia_kg_m2 * f[2],
        friction_n_s_m: roll.friction_n_s_m * f[3],
        ..roll
    };
    let drum = move |roll: &DrivenRoll, f: [f64; 4]| DrivenRoll {
        radius_m: roll.radius_m * f[1],
        inertia_kg_m2: roll.inertia_kg_m2 * f[2],
        friction_n_s_m: roll.friction_n_s_m * f[3],
    };
    let rolls = [roll(), roll(), roll(), roll(), roll()];
    (rolls, roll(), roll()).prop_map(move |(rolls, web, rest)| {
        let mut m = Machine::news_8000();
        m.idle[0] = idle(m.idle[0], rolls[0]);
        m.idle[1] = idle(m.idle[1], rolls[1]);
        m.rear_drum = drum(&m.rear_drum, rolls[2]);
        m.front_drum = drum(&m.front_drum, rolls[3]);
        m.rider_roll = drum(&m.rider_roll, rolls[4]);
        m.last_span_m *= rolls[4][0];
        m.web.width_m *= 0.5 * web[0];
        m.web.grammage_kg_m2 *= web[1];
        m.web.caliper_m *= web[2];
        m.web.stiffness_n_m *= web[3];
        m.web.strength_n_m = 1e6;
        m.parent_roll.spool_inertia_kg_m2 *= rest[0];
        m.parent_roll.friction_n_s_m *= rest[1];
        m.shipping_roll.friction_n_s_m *= rest[2];
        m.web.retardation_s *= rest[3];
        m
    })
}

/// Up to eight stretches of up to 3 s.
fn schedules() -> impl Strategy<Value = Vec<Stretch>> {
    prop::collection::vec((0.5..3.0, -0.5..0.8, 100.0..5000.0), 1..8)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    #[test]
    fn random_machines_lose_neither_paper_nor_energy(
        m in machines(),
        schedule in schedules(),
        v in 3.0..30.0,
        r_uw in 0.5..1.5,
        r_wu in 0.05..0.6,
    ) {
        prop_assert!(m.validate().is_ok());
        let x = form::steady(&m, v, 1000.0, r_uw, r_wu);
        let in_f64 = Balance::of(&mut Bench::<f64>::threaded(m.clone(), &x), &schedule);
        let good = in_f64.paper < 1e-6 && in_f64.area < 1e-6 && in_f64.energy < 1e-3;
        prop_assert!(good, "{in_f64:?}");
        // a run of seconds is short for f32: what an ulp of the radii at both ends is as length on the rolls
        let ulp = TAU * 1.5 * 1.5 * f64::from(f32::EPSILON) / m.web.caliper_m;
        let bound = 1e-5 + ulp / in_f64.length;
        let in_f32 = Balance::of(&mut Bench::<f32>::threaded(m, &x), &schedule);
        let good = in_f32.paper < bound && in_f32.area < bound && in_f32.energy < 1e-3;
        prop_assert!(good, "{in_f32:?} with a bound of {bound}");
    }
}
