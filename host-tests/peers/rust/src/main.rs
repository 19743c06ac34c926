//! The peers in Rust, and the product beside them.
//!
//!     peers PROBLEM METHOD SETTING RUNS OUT
//!
//! As the peers in C, see `c/peer.h`: it runs the problem RUNS times, prints the CPU time of the quickest run, and
//! writes the states at the end of every hold to OUT.

mod plant;
mod product;

use std::cell::Cell;
use std::error::Error;
use std::fs;
use std::time::Duration;

use diffsol::{NalgebraMat, OdeBuilder, OdeSolverMethod, OdeSolverStopReason};
use ode_solvers::dop_shared::OutputType;
use ode_solvers::dop853::Dop853;
use ode_solvers::dopri5::Dopri5;
use ode_solvers::rk4::Rk4;
use ode_solvers::{SVector, System};
use plant::{Load, Plant, STATES};
use rustix::time::{ClockId, clock_gettime};

/// What is to be computed.
#[derive(Debug, Default)]
pub struct Problem {
    plant: Plant,
    pub hold_s: f64,
    pub start: [f64; STATES],
    pub loads: Vec<Load>,
}

type Out = Vec<[f64; STATES]>;
type Failed = Box<dyn Error>;

impl Problem {
    fn read(text: &str) -> Result<Self, Failed> {
        let mut problem = Self::default();
        let plant = &mut problem.plant;
        for line in text.lines() {
            let mut words = line.split_whitespace();
            let name = words.next().unwrap_or_default();
            let numbers = words.map(str::parse).collect::<Result<Vec<f64>, _>>()?;
            let into: &mut [f64] = match name {
                "per_length" => &mut plant.per_length,
                "stiffness" => std::slice::from_mut(&mut plant.stiffness),
                "viscosity" => &mut plant.viscosity,
                "per_mass" => &mut plant.per_mass,
                "friction" => &mut plant.friction,
                "uw_inertia" => std::slice::from_mut(&mut plant.uw_inertia),
                "uw_offset" => std::slice::from_mut(&mut plant.uw_offset),
                "uw_friction" => std::slice::from_mut(&mut plant.uw_friction),
                "layer" => std::slice::from_mut(&mut plant.layer),
                "core" => std::slice::from_mut(&mut plant.core),
                "drums" => std::slice::from_mut(&mut plant.drums),
                "windup_friction" => std::slice::from_mut(&mut plant.windup_friction),
                "hold_s" => std::slice::from_mut(&mut problem.hold_s),
                "start" => &mut problem.start,
                "holds" => continue,
                "load" => {
                    let [uw, pull] = numbers[..] else {
                        return Err(format!("not a load: {line}").into());
                    };
                    problem.loads.push(Load { uw, pull });
                    continue;
                }
                _ => return Err(format!("unknown: {line}").into()),
            };
            if into.len() != numbers.len() {
                return Err(format!("{} numbers are wanted: {line}", into.len()).into());
            }
            into.copy_from_slice(&numbers);
        }
        Ok(problem)
    }
}

type Vector = SVector<f64, STATES>;

/// The plant under one load, for ode_solvers.
#[derive(Clone, Copy)]
struct Held<'a>(&'a Plant, Load);

impl System<f64, Vector> for Held<'_> {
    fn system(&self, _: f64, x: &Vector, dx: &mut Vector) {
        self.0.rates(&self.1, &x.data.0[0], &mut dx.data.0[0]);
    }
}

/// The last state of an integration that went well.
fn last(states: &[Vector]) -> Result<Vector, Failed> {
    Ok(*states.last().ok_or("no state came out")?)
}

/// Length of a step that is sure not to be the limit, and the settings of ode_solvers as its short constructors have
/// them, without dense output.
fn ode_solvers(problem: &Problem, method: &str, setting: f64, out: &mut Out) -> Result<(), Failed> {
    const SAFETY: f64 = 0.9;
    const STEPS: u32 = 100_000;
    const STIFF: u32 = 1000;
    let (end, atol) = (problem.hold_s, 1e-3 * setting);
    let mut x = Vector::from(problem.start);
    for load in &problem.loads {
        let f = Held(&problem.plant, *load);
        x = match method {
            "rk4" => {
                let mut solver = Rk4::new(f, 0.0, x, end, end / setting);
                solver.integrate()?;
                last(solver.y_out())?
            }
            "dopri5" => {
                let mut solver = Dopri5::from_param(
                    f,
                    0.0,
                    end,
                    end,
                    x,
                    setting,
                    atol,
                    SAFETY,
                    0.04,
                    0.2,
                    10.0,
                    end,
                    end,
                    STEPS,
                    STIFF,
                    OutputType::Sparse,
                );
                solver.integrate()?;
                last(solver.y_out())?
            }
            _ => {
                let mut solver = Dop853::from_param(
                    f,
                    0.0,
                    end,
                    end,
                    x,
                    setting,
                    atol,
                    SAFETY,
                    0.0,
                    0.333,
                    6.0,
                    end,
                    end,
                    STEPS,
                    STIFF,
                    OutputType::Sparse,
                );
                solver.integrate()?;
                last(solver.y_out())?
            }
        };
        out.push(x.data.0[0]);
    }
    Ok(())
}

fn diffsol(problem: &Problem, tolerance: f64, out: &mut Out) -> Result<(), Failed> {
    let held = Cell::new(Load::default());
    let array = |x: &[f64]| -> [f64; STATES] { std::array::from_fn(|i| x[i]) };
    let rates = |x: &[f64], dx: &mut [f64]| {
        let dx: &mut [f64; STATES] = dx
            .try_into()
            .unwrap_or_else(|_| unreachable!("nine states"));
        let x: &[f64; STATES] = x.try_into().unwrap_or_else(|_| unreachable!("nine states"));
        problem.plant.rates(&held.get(), x, dx);
    };
    held.set(problem.loads[0]);
    let ode = OdeBuilder::<NalgebraMat<f64>>::new()
        .rtol(tolerance)
        .atol([1e-3 * tolerance])
        .h0(problem.hold_s)
        .rhs(|x: &[f64], _: &[f64], _: f64, dx: &mut [f64]| rates(x, dx))
        .init(
            |_: &[f64], _: f64, x: &mut [f64]| x.copy_from_slice(&problem.start),
            STATES,
        )
        .build()?;
    let mut solver = ode.tsit45()?;
    for (hold, load) in problem.loads.iter().enumerate() {
        held.set(*load);
        // the rates jump; the length of step that was good remains so
        let state = solver.state_mut();
        rates(state.y.batch_as_slice(0), state.dy.batch_as_mut_slice(0));
        solver.set_stop_time((hold + 1) as f64 * problem.hold_s)?;
        while solver.step()? != OdeSolverStopReason::TstopReached {}
        out.push(array(solver.state().y.batch_as_slice(0)));
    }
    Ok(())
}

fn run(problem: &Problem, method: &str, setting: f64, out: &mut Out) -> Result<(), Failed> {
    let steps = setting as u32;
    match method {
        "motion" => product::motion::<f64>(problem, steps, out),
        "motion-f32" => product::motion::<f32>(problem, steps, out),
        "winder" => product::steps::<f64>(problem, steps, out)?,
        "series" => product::series(problem, steps, out)?,
        "offline" => product::strides(problem, steps, out)?,
        "rk4" | "dopri5" | "dop853" => ode_solvers(problem, method, setting, out)?,
        "tsit45" => diffsol(problem, setting, out)?,
        _ => return Err(format!("no method is called {method}").into()),
    }
    Ok(())
}

/// CPU time of this process.
fn cpu() -> Duration {
    let now = clock_gettime(ClockId::ProcessCPUTime);
    Duration::new(now.tv_sec.cast_unsigned(), now.tv_nsec as u32)
}

fn main() -> Result<(), Failed> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [path, method, setting, runs, to] = &arguments[..] else {
        return Err("usage: peers PROBLEM METHOD SETTING RUNS OUT".into());
    };
    let problem = Problem::read(&fs::read_to_string(path)?)?;
    let (setting, runs): (f64, u32) = (setting.parse()?, runs.parse()?);
    let mut out = Out::with_capacity(problem.loads.len());
    let mut best = Duration::MAX;
    for _ in 0..runs {
        out.clear();
        let began = cpu();
        run(&problem, method, setting, &mut out)?;
        best = best.min(cpu() - began);
    }
    let bytes: Vec<u8> = out.iter().flatten().flat_map(|x| x.to_ne_bytes()).collect();
    fs::write(to, bytes)?;
    println!("{:.9e}", best.as_secs_f64());
    Ok(())
}
