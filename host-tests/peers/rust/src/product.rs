//! The product on the problem of its peers.
//!
//! SETTING is the number of steps in a hold, of strides for `series` and `offline`.

use std::hint::black_box;

use model_core::exchange::{Actuators, BySection};
use model_core::machine::{Machine, MachineError};
use model_core::plant::Winder;
use model_core::plant::motion::{Load, Motion};
use model_core::plant::rk4::State;
use model_core::plant::units::{One, Units};
use model_core::plant::windup::Whole;
use model_core::real::{Accumulator, Arithmetic, Float, Real};
use offline::{Held, Smooth, Strider};

use crate::{Problem, STATES};

const SPANS: usize = 3;
/// Steps of the winder in a stride.
const STRIDE: u32 = 2;

type Failed = Box<dyn std::error::Error>;

fn state<T: Copy, const APART: usize>(x: &[T; STATES], apart: T) -> State<T, SPANS, APART> {
    let [e0, e1, e2, v0, v1, v2, omega_uw, r_uw, r_wu] = *x;
    State {
        strain: [e0, e1, e2],
        v: [v0, v1, v2],
        windup: [apart; APART],
        omega_uw,
        r_uw,
        r_wu,
    }
}

fn states<R: Real, const APART: usize>(x: &State<R, SPANS, APART>) -> [f64; STATES] {
    let ([e0, e1, e2], [v0, v1, v2]) = (x.strain, x.v);
    [e0, e1, e2, v0, v1, v2, x.omega_uw, x.r_uw, x.r_wu].map(R::to_f64)
}

/// The motion alone, by the steps of the real-time path: what the plain loop in C does.
pub fn motion<R: Float>(problem: &Problem, steps: u32, out: &mut Vec<[f64; STATES]>) {
    let machine = Machine::news_8000();
    let h = problem.hold_s / f64::from(steps);
    let units = Units::of::<R>(&machine);
    let motion = Motion::<R, SPANS>::new(&One(&machine, &units), h);
    let start: State<R, SPANS, 0> = state(&problem.start.map(R::of), R::ZERO);
    let mut sums = start.map(<R as Arithmetic>::Sum::at);
    for held in &problem.loads {
        let load = Load {
            uw: R::of(held.uw),
            windup: Whole(R::of(held.pull)),
            layer: R::ONE,
            threaded: true,
            offsets: None,
        };
        for _ in 0..steps {
            let web = motion.web(&sums.map(|sum| sum.value()), None);
            motion.advance(&mut sums, &web, &load);
        }
        out.push(states(&sums.map(|sum| sum.value())));
    }
}

fn winder<R: Float>(problem: &Problem, h: f64) -> Result<Winder<R, SPANS>, MachineError> {
    let mut winder = Winder::new(&Machine::news_8000(), h)?;
    winder.thread_at(R::of(2800.0));
    winder.set_state(&state(&problem.start.map(R::of), R::ZERO));
    Ok(winder)
}

/// What acts in each hold.
fn actuators<R: Float>(problem: &Problem) -> impl Iterator<Item = Actuators<R>> {
    let r_rd = Machine::news_8000().rear_drum.radius_m;
    problem.loads.iter().map(move |held| Actuators {
        torque: BySection {
            uw: R::of(held.uw),
            rd: R::of(held.pull * r_rd),
            ..BySection::default()
        },
        ..Actuators::default()
    })
}

/// The whole winder, with people, brakes, the strength of the web and sensors.
pub fn steps<R: Float>(
    problem: &Problem,
    steps: u32,
    out: &mut Vec<[f64; STATES]>,
) -> Result<(), MachineError> {
    let mut winder = winder::<R>(problem, problem.hold_s / f64::from(steps))?;
    for actuators in actuators(problem) {
        for _ in 0..steps {
            black_box(winder.step(&actuators));
        }
        out.push(states(&winder.state()));
    }
    Ok(())
}

/// The motion alone, by the series of runs without a PLC.
pub fn series(problem: &Problem, strides: u32, out: &mut Vec<[f64; STATES]>) -> Result<(), Failed> {
    let h = problem.hold_s / f64::from(strides);
    let smooth = Smooth::new(&Machine::news_8000(), h).ok_or("too long a stride")?;
    let mut x: State<f64, SPANS, 0> = state(&problem.start, 0.0);
    for load in &problem.loads {
        let held = Held {
            uw: load.uw,
            pull: load.pull,
        };
        for _ in 0..strides {
            x = smooth.advance(&x, held).ok_or("the web is slack or torn")?;
        }
        out.push(states(&x));
    }
    Ok(())
}

/// The whole winder offline.
pub fn strides(
    problem: &Problem,
    strides: u32,
    out: &mut Vec<[f64; STATES]>,
) -> Result<(), Failed> {
    let h = problem.hold_s / f64::from(strides * STRIDE);
    let mut winder = winder::<f64>(problem, h)?;
    let strider = Strider::new(&Machine::news_8000(), h);
    for actuators in actuators(problem) {
        let mut left = strides * STRIDE;
        while left > 0 {
            left -= strider.advance(&mut winder, &actuators, left.min(STRIDE).into()) as u32;
        }
        out.push(states(&winder.state()));
    }
    Ok(())
}
