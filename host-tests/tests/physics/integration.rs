//! The winder's steps against an adaptive integrator of eighth order, and against themselves with other steps.

use model_core::exchange::BySection;
use model_core::machine::Machine;
use model_core::plant::rk4::State;
use model_core::real::Float;
use nalgebra::SVector;
use ode_solvers::dop_shared::OutputType;
use ode_solvers::dop853::Dop853;

use crate::form::{self, Bench, H, RUN};
use crate::{in_both_scalars, near};

in_both_scalars!(an_independent_integrator_agrees);

/// The state, and behind it the way of the rear drum's surface.
type Vector = SVector<f64, 13>;

struct Motion<'a>(&'a Machine, BySection<f64>);

fn unpack(y: &Vector) -> State<f64, 3> {
    State {
        strain: [y[0], y[1], y[2]],
        v: [y[3], y[4], y[5]],
        windup: [y[6], y[7], y[8]],
        omega_uw: y[9],
        r_uw: y[10],
        r_wu: y[11],
    }
}

impl ode_solvers::System<f64, Vector> for Motion<'_> {
    fn system(&self, _: f64, y: &Vector, dy: &mut Vector) {
        let rates = form::motion(self.0, &unpack(y), &self.1).rates;
        *dy = Vector::from_iterator(rates.iter().chain([y[5]]));
    }
}

/// The state after `time` under constant torques, and the way to there.
fn dop853(
    m: &Machine,
    x: &State<f64, 3>,
    torque: &BySection<f64>,
    time: f64,
) -> (State<f64, 3>, f64) {
    let y = Vector::from_iterator(x.iter().chain([0.0]));
    let mut stepper = Dop853::new(Motion(m, *torque), 0.0, time, time, y, 1e-13, 1e-15);
    // every step as it is: the dense output extrapolates to the end
    stepper.set_output(OutputType::Sparse);
    stepper.integrate().unwrap();
    let y = stepper.y_out().last().unwrap();
    (unpack(y), y[12])
}

/// Torques of an open-loop start: pull, accelerate, accelerate more, run, brake with the motors, in N·m.
const SCHEDULE: [(f64, [f64; 4]); 5] = [
    (2.0, [-1_300.0, 190.0, 230.0, 0.0]),
    (10.0, [7_000.0, 1_900.0, 2_300.0, 20.0]),
    (4.0, [9_000.0, 2_300.0, 2_700.0, 20.0]),
    (20.0, [-3_000.0, 800.0, 1_000.0, 10.0]),
    (6.0, [-9_000.0, -200.0, -300.0, -10.0]),
];

/// Both sides have slow oscillations, slack none: what is left is the step's own error, and f32's.
fn an_independent_integrator_agrees<R: Float>() {
    let m = Machine::news_8000();
    let stall = m.operation.stall_share * form::tension(&m);
    let mut exact = form::steady(&m, 0.0, stall, m.parent_roll.full_radius_m, 0.05);
    let mut bench = Bench::<R>::threaded(m.clone(), &exact);
    let (mut travel, mut way) = (0.0, 0.0);
    for (time, [uw, rd, fd, rr]) in SCHEDULE {
        let torque = BySection { uw, rd, fd, rr };
        let (next, more) = dop853(&m, &exact, &torque, time);
        (exact, way) = (next, way + more);
        for _ in 0..(time / H).round() as u32 {
            bench.step(&torque);
            travel += bench.travel();
        }
        let x = bench.x();
        let speeds = x.v.into_iter().chain([x.omega_uw]);
        for (v, exact) in speeds.zip(exact.v.into_iter().chain([exact.omega_uw])) {
            near("speed", v, exact, form::either::<R>(2e-6, 2e-8));
        }
        for (t, exact) in bench
            .t()
            .into_iter()
            .zip(form::motion(&m, &exact, &torque).tension)
        {
            near("tension", t, exact, form::either::<R>(0.02, 2e-4));
        }
        // half an ulp of f32 at 1.5 m
        let ulp = form::either::<R>(0.07e-6, 1e-12);
        near("r_uw", x.r_uw, exact.r_uw, ulp);
        near("r_wu", x.r_wu, exact.r_wu, ulp);
        near("way", travel, way, form::either::<R>(1e-5, 1e-8));
    }
}

/// State of the winder after a quarter of a second of a smooth stretch in steps of `h`: taut web, constant torques
/// that change speed and tension.
fn stretch<const SPANS: usize>(m: &Machine, h: f64) -> State<f64, SPANS> {
    let (x, torque) = start::<SPANS>(m);
    let mut bench = Bench::<f64, SPANS>::with_step(m.clone(), h);
    assert_eq!(bench.winder.substeps(), 1);
    bench.winder.thread_at(0.0);
    bench.set(&x);
    for _ in 0..(STRETCH / h).round() as u32 {
        bench.step(&torque);
    }
    bench.x()
}

/// Length of the stretch, s.
const STRETCH: f64 = 0.24;

fn start<const SPANS: usize>(m: &Machine) -> (State<f64, SPANS>, BySection<f64>) {
    let t = form::tension(m);
    let x = form::steady(m, RUN, t, 1.2, 0.3);
    (x, form::torques(m, &x, 1.2 * t, 0.3))
}

/// Largest errors of strain and of speed.
fn errors<const SPANS: usize>(x: &State<f64, SPANS>, exact: &State<f64, SPANS>) -> [f64; 2] {
    let error = x.zip(exact, |a, b| (a - b).abs());
    [error.strain, error.v].map(|errors| errors.into_iter().fold(0.0, f64::max))
}

fn divides_by_sixteen(errors: [[f64; 2]; 3]) {
    for pair in errors.windows(2) {
        for (coarse, fine) in pair[0].into_iter().zip(pair[1]) {
            near("ratio of errors", coarse / fine, 16.0, 2.0);
        }
    }
}

#[test]
fn halving_the_step_divides_the_error_by_sixteen() {
    let m = Machine::news_8000();
    let (x, torque) = start(&m);
    let (exact, _) = dop853(&m, &x, &torque, STRETCH);
    divides_by_sixteen([0.008, 0.004, 0.002].map(|h| errors(&stretch::<3>(&m, h), &exact)));
}

/// The modes of single rolls are three times as fast, and so are the steps; held against the next but two.
#[test]
fn halving_the_step_divides_the_error_by_sixteen_for_rolls_one_by_one() {
    let m = Machine::news_8000_unlumped();
    let exact = stretch::<8>(&m, 0.0625e-3);
    divides_by_sixteen([0.002, 0.001, 0.0005].map(|h| errors(&stretch::<8>(&m, h), &exact)));
}
