//! The plant against its equations written a second time, for an adaptive integrator of another library:
//! `reference/reference.py` computes a table for every schedule beside it.
//!
//! Not here: how the tables come about. What the winder itself makes of a schedule, anyone can see with
//! `cargo winder plant --machine NAME --schedule NAME.csv --out -`.
//!
//! The tables know of no steps. The winder decides once a step whether a brake or a nip holds, and what comes to rest
//! does so at a step's end; a web that comes taut in the middle of a step bends the tension there. Either moves a
//! roll by up to V̇·h²/8 against the table: at a stop of the drums 3 µm, which is 3 N in the last span. So schedules
//! with such events are run twice: in steps of the plant's task, with what they may be off by after the first event,
//! and in much smaller steps, where they must keep to what is asked of all others.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use host_tests::machine_file::Description;
use model_core::exchange::{Actuators, Brakes, BySection};
use model_core::machine::{MAX_SPANS, Machine};
use model_core::plant::Winder;
use model_core::real::{Float, Real};

use crate::form::{self, H};
use crate::in_both_scalars;

in_both_scalars!(
    a_full_set,
    the_web_breaks_by_its_strength,
    the_parent_roll_runs_out,
    torque_steps_excite_the_modes,
    torque_steps_excite_the_modes_of_rolls_one_by_one,
    brakes_stop_hold_and_give_way,
    drums_slip_and_stick_again,
    the_web_goes_slack_and_comes_taut,
);

/// The folder of schedules and tables.
pub fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/physics/reference")
}

/// A row by the names of its columns.
type Row = HashMap<String, f64>;

fn rows(file: &str) -> Vec<Row> {
    let mut reader = csv::Reader::from_path(folder().join(file)).unwrap();
    reader.deserialize().map(Result::unwrap).collect()
}

/// The step of a row; every row is at one.
fn tick(row: &Row) -> u64 {
    let ticks = row["t_s"] / H;
    assert!((ticks - ticks.round()).abs() < 1e-6, "{} s", row["t_s"]);
    ticks.round() as u64
}

fn actuators<R: Float>(row: &Row) -> Actuators<R> {
    let closed = |name: &str| row.get(name).is_some_and(|on| *on > 0.0);
    Actuators {
        torque: BySection {
            uw: R::of(row["T_uw"]),
            rd: R::of(row["T_rd"]),
            fd: R::of(row["T_fd"]),
            rr: R::of(row["T_rr"]),
        },
        brakes: Brakes {
            uw: closed("brake_uw"),
            rd: closed("brake_rd"),
            fd: closed("brake_fd"),
        },
        ..Actuators::default()
    }
}

/// Largest errors of a run, or what is allowed.
#[derive(Clone, Copy, Debug, Default)]
struct Errors {
    /// Of the speeds, of the largest speed in the table.
    speed: f64,
    /// Of the tensions, N, where 0.1 % of the tension is not more.
    tension: f64,
    /// Of the radii, m.
    radius: f64,
}

impl Errors {
    /// What is asked: speeds 1e-6, tensions 0.1 % or 1 N, radii 1e-8 m; of f32, radii to a unit in the last place.
    fn asked<R: Float>() -> Self {
        Self {
            speed: 1e-6,
            tension: 1.0,
            radius: form::either::<R>(1.2e-7, 1e-8),
        }
    }

    /// What a taut web without events keeps to: far less.
    fn of_a_taut_web<R: Float>() -> Self {
        Self {
            speed: 1e-6,
            tension: form::either::<R>(0.2, 0.01),
            radius: form::either::<R>(1.2e-7, 1e-9),
        }
    }

    #[track_caller]
    fn within(&self, allowed: &Self) {
        let good = self.speed <= allowed.speed
            && self.tension <= allowed.tension
            && self.radius <= allowed.radius;
        assert!(good, "{self:?}, allowed {allowed:?}");
    }
}

/// A run that is held against its table.
struct Run {
    schedule: &'static str,
    machine: Machine,
}

impl Run {
    /// A schedule with a preset, or with a machine file beside it.
    fn new(schedule: &'static str, machine: &str) -> Self {
        let file = folder().join(machine);
        let name = if file.exists() {
            file.to_str().unwrap()
        } else {
            machine
        };
        let machine = Description::find(name).unwrap().machine;
        Self { schedule, machine }
    }

    /// Errors until `end_s`, in steps of [`H`] or of a part of it.
    fn errors<R: Float>(&self, steps_per_tick: u32, end_s: f64) -> Errors {
        match self.machine.idle.len() + 1 {
            3 => self.errors_of::<R, 3>(steps_per_tick, end_s),
            MAX_SPANS => self.errors_of::<R, MAX_SPANS>(steps_per_tick, end_s),
            spans => panic!("{spans} spans"),
        }
    }

    fn errors_of<R: Float, const SPANS: usize>(&self, steps_per_tick: u32, end_s: f64) -> Errors {
        let m = &self.machine;
        let mut winder = Winder::<R, SPANS>::new(m, H / f64::from(steps_per_tick)).unwrap();
        winder.thread_at(R::of(m.operation.stall_share * form::tension(m)));
        let schedule = rows(&format!("{}.csv", self.schedule));
        let table = rows(&format!("{}.table.csv", self.schedule));
        assert_eq!(tick(schedule.last().unwrap()), tick(table.last().unwrap()));
        let mut changes = schedule.iter().peekable();
        let (mut now, mut at) = (Actuators::default(), 0);
        let (mut errors, mut fastest) = (Errors::default(), 0.0_f64);
        for row in table.iter().take_while(|row| row["t_s"] <= end_s) {
            while at < tick(row) {
                while let Some(change) = changes.next_if(|change| tick(change) <= at) {
                    now = actuators(change);
                }
                (0..steps_per_tick).for_each(|_| {
                    winder.step(&now);
                });
                at += 1;
            }
            let (speeds, tensions, radii) = columns(&winder);
            for (name, v) in speeds {
                fastest = fastest.max(row[&name].abs());
                errors.speed = errors.speed.max((v - row[&name]).abs());
            }
            for (name, t) in tensions {
                // 0.1 % is as good as 1 N
                let off = (t - row[&name]).abs() / (1e-3 * row[&name]).max(1.0);
                errors.tension = errors.tension.max(off);
            }
            for (name, r) in radii {
                errors.radius = errors.radius.max((r - row[&name]).abs());
            }
        }
        errors.speed /= fastest;
        errors
    }
}

type Named = Vec<(String, f64)>;

/// Speeds, tensions and radii by the names that the table has for them.
fn columns<R: Float, const SPANS: usize>(winder: &Winder<R, SPANS>) -> (Named, Named, Named) {
    let x = winder.state().map(Real::to_f64);
    let t = winder.tension().map(Real::to_f64);
    let idle: Vec<String> = match SPANS {
        3 => vec!["gr".into(), "sr".into()],
        _ => (1..SPANS).map(|i| i.to_string()).collect(),
    };
    let rolls = |prefix: &str, before: Option<&str>, after: Option<&str>| -> Vec<String> {
        let before = before.map(String::from).into_iter();
        let names = before
            .chain(idle.clone())
            .chain(after.map(String::from))
            .map(|roll| format!("{prefix}_{roll}"));
        names.collect()
    };
    let mut speeds: Named = rolls("v", None, Some("rd")).into_iter().zip(x.v).collect();
    let others = ["v_fd", "v_rr", "v_wu"].map(String::from);
    speeds.extend(others.into_iter().zip(x.windup));
    speeds.push(("v_uw".into(), x.omega_uw * x.r_uw));
    let tensions = rolls("t", Some("uw"), None).into_iter().zip(t).collect();
    let radii = vec![("r_uw".into(), x.r_uw), ("r_wu".into(), x.r_wu)];
    (speeds, tensions, radii)
}

/// 18.4 km from standstill to standstill, the torques as 80 steps.
fn a_full_set<R: Float>() {
    let run = Run::new("full_set", "NEWS-8000");
    run.errors::<R>(1, f64::MAX)
        .within(&Errors::of_a_taut_web::<R>());
}

/// The unwind pulls until a span parts at 16 kN, at the end of a step; rolls and brakes afterwards.
fn the_web_breaks_by_its_strength<R: Float>() {
    let run = Run::new("break", "NEWS-8000");
    run.errors::<R>(1, f64::MAX)
        .within(&Errors::of_a_taut_web::<R>());
}

/// A kilometre from a laboratory roll, to its end and beyond.
fn the_parent_roll_runs_out<R: Float>() {
    let run = Run::new("run_out", "LAB-300");
    run.errors::<R>(1, f64::MAX)
        .within(&Errors::of_a_taut_web::<R>());
}

fn torque_steps_excite_the_modes<R: Float>() {
    for (schedule, machine) in [("steps", "NEWS-8000"), ("steps_lwc", "LWC-8000")] {
        let run = Run::new(schedule, machine);
        run.errors::<R>(1, f64::MAX)
            .within(&Errors::of_a_taut_web::<R>());
    }
}

fn torque_steps_excite_the_modes_of_rolls_one_by_one<R: Float>() {
    for (schedule, machine) in [
        ("steps_unlumped", "NEWS-8000-UNLUMPED"),
        ("steps_lab", "LAB-300"),
    ] {
        let run = Run::new(schedule, machine);
        run.errors::<R>(1, f64::MAX)
            .within(&Errors::of_a_taut_web::<R>());
    }
}

/// Runs a schedule whose first event is after `event_s`: as good as any other until then, then within `after`, and
/// in so many steps for one of the plant's as good as any other all the time.
#[track_caller]
fn keeps_to_its_events<R: Float>(run: &Run, event_s: f64, after: &Errors, steps: u32) {
    run.errors::<R>(1, event_s)
        .within(&Errors::of_a_taut_web::<R>());
    run.errors::<R>(1, f64::MAX).within(after);
    run.errors::<R>(steps, f64::MAX)
        .within(&Errors::asked::<R>());
}

/// The unwind's brake stops the winder, those of the drums hold it; each gives way once to more torque than it has,
/// and holds again.
fn brakes_stop_hold_and_give_way<R: Float>() {
    let after = Errors {
        speed: 2e-5,
        ..Errors::asked::<R>()
    };
    keeps_to_its_events::<R>(&Run::new("brakes", "NEWS-8000"), 24.35, &after, 8);
}

/// The front drum is driven beyond the traction of its nip, and then the rear drum held back beyond it.
fn drums_slip_and_stick_again<R: Float>() {
    let after = Errors {
        speed: 2e-5,
        tension: 3.0,
        ..Errors::asked::<R>()
    };
    keeps_to_its_events::<R>(&Run::new("slip", "slip.toml"), 13.13, &after, 8);
}

/// Both drums at 150 % for a tenth of a second throw a loop into the web.
fn the_web_goes_slack_and_comes_taut<R: Float>() {
    for (schedule, machine, tension, steps) in [
        ("slack", "NEWS-8000", 2.0, 16),
        ("slack_unlumped", "NEWS-8000-UNLUMPED", 1.0, 32),
    ] {
        let after = Errors {
            speed: 1e-4,
            tension,
            ..Errors::asked::<R>()
        };
        keeps_to_its_events::<R>(&Run::new(schedule, machine), 5.8, &after, steps);
    }
}
