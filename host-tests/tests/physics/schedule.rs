//! The offline run: what a schedule gives in a file.

use std::fs;

use host_tests::plant::{self, Options, Scalar, Stepper};
use model_core::fixed::Word;
use model_core::machine::Machine;
use tempfile::TempDir;

use crate::form::{self, Bench, H};
use crate::near;

const HEADER: &str = "t_s,T_uw,T_rd,T_fd,T_rr";
const COLUMNS: &str = "t_s,v_uw,v_gr,v_sr,v_rd,t_uw,t_gr,t_sr,r_uw,r_wu";

/// A folder with a schedule, and what to do with it.
fn options(schedule: &str) -> (TempDir, Options) {
    let folder = TempDir::new().unwrap();
    let path = folder.path();
    let options = Options {
        schedule: path.join("schedule.csv"),
        out: path.join("out.csv"),
        machine: None,
        scalar: None,
        stepper: Stepper::Rk4,
        every_s: 1.0,
        sweep: None,
    };
    fs::write(&options.schedule, schedule).unwrap();
    (folder, options)
}

fn table(text: &str) -> Vec<Vec<f64>> {
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some(COLUMNS));
    let numbers = |line: &str| line.split(',').map(|n| n.parse().unwrap()).collect();
    lines.map(numbers).collect()
}

fn run(options: &Options) -> Vec<Vec<f64>> {
    let mut console = Vec::new();
    plant::run(options, &mut console).unwrap();
    let table = table(&fs::read_to_string(&options.out).unwrap());
    let said = String::from_utf8(console).unwrap();
    assert!(said.ends_with(&format!("{} rows\n", table.len())), "{said}");
    table
}

#[test]
fn the_run_starts_at_stall_tension_and_ends_with_the_last_row() {
    let (_folder, options) = options(&format!(
        "{HEADER}\n0,-1260,0,0,0\n0.5,0,0,0,0\n3.5,1e6,0,0,0\n"
    ));
    let table = run(&options);
    let times: Vec<_> = table.iter().map(|row| row[0]).collect();
    assert_eq!(times, [0.0, 1.0, 2.0, 3.0]);
    let stall = 0.30 * form::tension(&Machine::news_8000());
    for (value, expected) in table[0]
        .iter()
        .zip([0.0, 0.0, 0.0, 0.0, 0.0, stall, stall, stall, 1.5, 0.05])
    {
        near("first row", *value, expected, 1e-9);
    }
}

/// The file has every digit of the winder's own numbers, in every scalar.
#[test]
fn numbers_round_trip() {
    let schedule = format!(
        "{HEADER},brake_uw\n0,-1000,400,400,0,0\n0.1,0,500,600,1,0\n1,0,0,0,0,1\n2,0,0,0,0,1"
    );
    for scalar in [Scalar::F32, Scalar::F64, Scalar::Fixed] {
        let (_folder, mut options) = options(&schedule);
        (options.scalar, options.every_s) = (Some(scalar), 0.1);
        let table = run(&options);
        assert_eq!(table.len(), 21);
        let expected = match scalar {
            Scalar::F32 => by_hand::<f32>(),
            Scalar::F64 => by_hand::<f64>(),
            Scalar::Fixed => by_hand::<Word>(),
        };
        for (row, expected) in table.iter().zip(&expected) {
            assert_eq!(row[1..], expected[..], "t = {}", row[0]);
        }
    }
}

/// The same schedule, step by step; every tenth of a second.
fn by_hand<R: model_core::real::Scalar>() -> Vec<Vec<f64>> {
    use model_core::exchange::{Actuators, Brakes, BySection};
    use model_core::real::Real;
    let mut bench = Bench::<R>::new(Machine::news_8000());
    bench.winder.thread_at(R::Si::of(840.0));
    let mut rows = Vec::new();
    for step in 0..=500 {
        if step % 25 == 0 {
            // the surface speed of the parent roll in the winder's own arithmetic
            let (x, t) = (bench.winder.state(), bench.winder.tension());
            let v_uw = x.omega_uw * x.r_uw;
            let row = [v_uw]
                .into_iter()
                .chain(x.v)
                .chain(t)
                .chain([x.r_uw, x.r_wu]);
            // f32 prints its own shortest digits, which read back as another f64
            rows.push(row.map(|n| format!("{n:?}").parse().unwrap()).collect());
        }
        let [uw, rd, fd, rr, brake] = match step {
            0..25 => [-1000.0, 400.0, 400.0, 0.0, 0.0],
            25..250 => [0.0, 500.0, 600.0, 1.0, 0.0],
            _ => [0.0, 0.0, 0.0, 0.0, 1.0],
        };
        bench.winder.step(&Actuators {
            torque: BySection { uw, rd, fd, rr }.map(R::Si::of),
            brakes: Brakes {
                uw: brake > 0.0,
                ..Brakes::default()
            },
            ..Actuators::default()
        });
    }
    rows
}

#[test]
fn a_dash_prints_the_table() {
    let (_folder, mut options) = options(&format!("{HEADER}\n0,0,0,0,0\n1,0,0,0,0"));
    options.out = "-".into();
    let mut console = Vec::new();
    plant::run(&options, &mut console).unwrap();
    assert_eq!(table(&String::from_utf8(console).unwrap()).len(), 2);
}

#[test]
fn what_is_refused_leaves_no_file() {
    let good = format!("{HEADER}\n0,0,0,0,0\n1,0,0,0,0");
    let bad = format!("{HEADER}\n0,0,0,0,0\n1,0,0,x,0");
    type Change = fn(&mut Options);
    let cases: [(&str, &str, Change, &str); 5] = [
        (
            "row",
            &bad,
            |_| {},
            "schedule.csv:3: T_fd = \"x\" is not a number",
        ),
        (
            "file",
            &good,
            |o| o.schedule.set_file_name("none"),
            "none: ",
        ),
        (
            "machine",
            &good,
            |o| o.machine = Some("x".into()),
            "NEWS-8000",
        ),
        ("period", &good, |o| o.every_s = H / 2.0, "--every 0.002 "),
        (
            "series in f32",
            &good,
            |o| (o.stepper, o.scalar) = (Stepper::Series, Some(Scalar::F32)),
            "in f64 only, not in f32",
        ),
    ];
    for (name, schedule, change, reason) in cases {
        let (_folder, mut options) = options(schedule);
        change(&mut options);
        let mut console = Vec::new();
        let error = format!("{:#}", plant::run(&options, &mut console).unwrap_err());
        assert!(error.contains(reason), "{error}");
        assert!(!options.out.exists() && console.is_empty(), "{name}");
    }
}

#[test]
fn strides_lead_where_steps_lead_and_stop_at_the_same_rows() {
    // taut, then with a drum's brake closed, then coasting; rows where no stride of four steps ends
    let (_folder, mut options) = options(&format!(
        "{HEADER},brake_rd\n0,-4000,700,700,0,0\n2.004,-4000,700,700,0,1\n3,-1500,300,300,0,0\n6,0,0,0,0,0\n"
    ));
    options.every_s = 0.5;
    let steps = run(&options);
    options.stepper = Stepper::Series;
    let strides = run(&options);
    assert_eq!(steps.len(), strides.len());
    let scale = |column: usize| {
        steps
            .iter()
            .map(|row| row[column].abs())
            .fold(1e-3, f64::max)
    };
    let mut apart = 0.0_f64;
    for (stepped, strode) in steps.iter().zip(&strides) {
        assert_eq!(stepped[0], strode[0]);
        for (column, (a, b)) in stepped.iter().zip(strode).enumerate().skip(1) {
            let off = (a - b).abs() / scale(column);
            assert!(off < 1e-5, "{a} {b} in column {column}");
            apart = apart.max(off);
        }
    }
    assert!(apart > 0.0, "no stride was taken");
}
