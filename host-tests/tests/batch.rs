//! Winders side by side against winders alone: the same bits, whatever happens to them on the way.

// bits are meant exactly
#![allow(clippy::float_cmp)]
// a test that cannot go on fails
#![allow(clippy::unwrap_used)]

use std::fs;

use host_tests::batch::group::{Extremes, Progress, Run, side_by_side};
use host_tests::batch::lanes::{LANES, Lanes};
use host_tests::plant::{self, Options, Scalar, Schedule, Stepper};
use model_core::exchange::{Actuators, Brakes, BySection};
use model_core::machine::Machine;
use model_core::plant::Winder;
use model_core::real::Arithmetic;
use proptest::prelude::*;

/// Step of the plant, s.
const H: f64 = 0.004;
/// Spans of the machines here.
const SPANS: usize = 3;

/// A row of a schedule: how many steps it holds, torques of all sections, N·m, and brakes.
#[derive(Clone, Debug)]
struct Act {
    steps: u32,
    torque: [f64; 4],
    brakes: [bool; 3],
}

fn schedule(acts: &[Act]) -> Schedule {
    let mut text = "t_s,T_uw,T_rd,T_fd,T_rr,brake_uw,brake_rd,brake_fd\n".to_owned();
    let mut step = 0;
    for act in acts {
        let [uw, rd, fd, rr] = act.torque;
        let [b_uw, b_rd, b_fd] = act.brakes.map(u8::from);
        let t = f64::from(step) * H;
        text += &format!("{t},{uw:?},{rd:?},{fd:?},{rr:?},{b_uw},{b_rd},{b_fd}\n");
        step += act.steps;
    }
    text += &format!("{},0,0,0,0,0,0,0\n", f64::from(step) * H);
    Schedule::read("schedule", text.as_bytes()).unwrap()
}

/// What is compared of a run. `Debug` tells −0 from 0.
fn told(run: &Run<f32, SPANS>) -> String {
    let winder = &run.winder;
    format!(
        "{:?} {:?} {:?} {:?} {:?} {:?} {:?}",
        winder.sums(),
        winder.state(),
        winder.tension(),
        run.extremes,
        run.web_break,
        run.slip,
        run.burst
    )
}

/// The run of a winder alone, step by step.
fn by_hand(machine: &Machine, acts: &[Act]) -> Run<f32, SPANS> {
    let mut winder = Winder::<f32, SPANS>::new(machine, H).unwrap();
    let o = &machine.operation;
    winder.thread_at((o.stall_share * o.tension_n_m * machine.web.width_m) as f32);
    let highest = |w: &Winder<f32, SPANS>| w.tension().into_iter().fold(0.0, f32::max);
    let lowest = |w: &Winder<f32, SPANS>| w.tension().into_iter().fold(f32::INFINITY, f32::min);
    let mut tensions = vec![(highest(&winder), lowest(&winder))];
    let (mut whole, mut slides, mut bursts) = (Vec::new(), Vec::new(), Vec::new());
    for act in acts {
        let [uw, rd, fd, rr] = act.torque.map(|torque| torque as f32);
        let [b_uw, b_rd, b_fd] = act.brakes;
        for _ in 0..act.steps {
            winder.step(&Actuators {
                torque: BySection { uw, rd, fd, rr },
                brakes: Brakes {
                    uw: b_uw,
                    rd: b_rd,
                    fd: b_fd,
                },
                ..Actuators::default()
            });
            whole.push(winder.threaded());
            slides.push(winder.winding().slides.contains(&true));
            bursts.push(winder.winding().burst);
            tensions.push((highest(&winder), lowest(&winder)));
        }
    }
    let step = |at: Option<usize>| at.map(|i| i as u32 + 1);
    let web_break = step(whole.iter().position(|whole| !whole));
    tensions.truncate(web_break.map_or(tensions.len(), |step| step as usize));
    let largest = tensions.iter().map(|t| t.0).fold(0.0, f32::max);
    Run {
        winder,
        extremes: Extremes {
            largest,
            at: tensions.iter().position(|t| t.0 == largest).unwrap() as u32,
            smallest: tensions.iter().map(|t| t.1).fold(f32::INFINITY, f32::min),
        },
        web_break,
        slip: step(slides.iter().position(|slides| *slides)),
        burst: step(bursts.iter().position(|bursts| *bursts)),
    }
}

fn compare(machines: &[Machine], acts: &[Act]) -> Vec<Run<f32, SPANS>> {
    let runs = side_by_side::<SPANS>(machines, &schedule(acts), &Progress::default()).unwrap();
    assert_eq!(runs.len(), machines.len());
    for (i, (run, machine)) in runs.iter().zip(machines).enumerate() {
        assert_eq!(told(run), told(&by_hand(machine, acts)), "run {i}");
    }
    runs
}

const OPEN: [bool; 3] = [false; 3];

/// Forty machines in one schedule: weak webs that tear, small rolls that run out, slip, brakes of every delay, stiff
/// machines in smaller steps, and brakes that are released again.
#[test]
fn each_winder_has_the_bits_of_a_winder_alone() {
    let machines: Vec<_> = (0..40_u32)
        .map(|i| {
            let mut machine = Machine::news_8000();
            machine.web.stiffness_n_m *= 0.7 + 0.02 * f64::from(i);
            machine.web.strength_n_m = [700.0, 1000.0, 5000.0, 20e3][i as usize % 4];
            machine.brakes.delay_s = 0.004 * f64::from(i % 12);
            if i % 5 == 0 {
                machine.parent_roll.full_radius_m = 0.4503;
            }
            if i % 7 == 0 {
                machine.nips.slip = true;
                machine.nips.friction = 0.05;
            }
            if i % 11 == 3 {
                machine.idle[1].inertia_kg_m2 = 0.05;
            }
            if i == 31 {
                machine.idle[0].eccentricity_m = 1e-3;
            }
            machine
        })
        .collect();
    let act = |steps, torque, brakes| Act {
        steps,
        torque,
        brakes,
    };
    let acts = [
        act(2000, [-700.0, 900.0, 900.0, 0.0], OPEN),
        act(3, [-1200.0, 500.0, 500.0, 10.0], OPEN),
        act(500, [-2000.0, 500.0, 3400.0, 0.0], OPEN),
        act(300, [-600.0, 0.0, 0.0, 0.0], [true, false, true]),
        act(1500, [-600.0, 600.0, 600.0, 0.0], OPEN),
        act(200, [-9000.0, 4000.0, 4000.0, 0.0], OPEN),
        act(400, [0.0, 0.0, 0.0, 0.0], [false, true, false]),
        act(300, [500.0, 100.0, 0.0, 0.0], OPEN),
    ];
    let runs = compare(&machines, &acts);
    let count = |what: fn(&Run<f32, SPANS>) -> bool| runs.iter().filter(|run| what(run)).count();
    // the schedule does to them what it is meant to
    let broken = count(|run| run.web_break.is_some());
    assert!((10..=35).contains(&broken), "{broken} webs broke");
    assert!(count(|run| run.slip.is_some()) > 0);
    assert!(count(|run| run.burst.is_some()) > 0);
    assert!(count(|run| run.winder.substeps() > 1) > 0);
    assert!(count(|run| run.winder.glides(&Actuators::default())) > 20);
}

/// Torques that no motor has, up to what overflows.
#[test]
fn a_wreck_is_left_by_its_lane_alone() {
    let machines: Vec<_> = (0..LANES)
        .map(|i| {
            let mut machine = Machine::news_8000();
            machine.web.strength_n_m = 1e6;
            machine.web.stiffness_n_m = 1e8;
            machine.parent_roll.spool_inertia_kg_m2 = if i % 2 == 0 { 1e-4 } else { 1e5 };
            machine
        })
        .collect();
    let acts = [-1e6, 1e6, 0.0].map(|uw| Act {
        steps: 300,
        torque: [uw, 1e6, 1e6, 1e6],
        brakes: OPEN,
    });
    let runs = compare(&machines, &acts);
    assert!(runs.iter().any(|run| run.web_break.is_some()));
}

fn machine() -> impl Strategy<Value = Machine> {
    let web = (0.3..3.0, 400.0..4000.0, 0.0..0.02);
    let rolls = (0.4502..1.5, 0.0..20.0, 0.05..60.0, 0.5..8.0);
    let brakes = (0.0..0.1, 0.0..2e4, prop::bool::weighted(0.2));
    let rest = (
        prop::bool::weighted(0.2),
        prop::bool::weighted(0.1),
        prop::bool::weighted(0.1),
        0.02..0.4,
    );
    (web, rolls, brakes, rest).prop_map(|(web, rolls, brakes, rest)| {
        let mut m = Machine::news_8000();
        m.web.stiffness_n_m *= web.0;
        m.web.strength_n_m = web.1;
        m.web.retardation_s = web.2;
        m.operation.tension_n_m = m.operation.tension_n_m.min(0.5 * web.1);
        m.parent_roll.full_radius_m = rolls.0;
        m.parent_roll.friction_n_s_m = rolls.1;
        m.idle[0].inertia_kg_m2 = rolls.2;
        m.last_span_m = rolls.3;
        (m.brakes.delay_s, m.brakes.uw_n_m) = (brakes.0, brakes.1);
        m.brakes.karnopp_m_s = if brakes.2 { 0.02 } else { 0.0 };
        m.nips.slip = rest.0;
        m.wound_on_tension.compresses = rest.1;
        m.idle[1].eccentricity_m = if rest.2 { 1e-3 } else { 0.0 };
        m.nips.friction = rest.3;
        m
    })
}

fn act() -> impl Strategy<Value = Act> {
    let steps = prop_oneof![1..4_u32, 20..400_u32];
    let torque = prop_oneof![
        8 => -3000.0..1000.0,
        1 => -3e4..3e4,
    ];
    let drum = prop_oneof![
        8 => -500.0..2500.0,
        1 => -1e4..1e4,
    ];
    let brake = || prop::bool::weighted(0.15);
    let brakes = (brake(), brake(), brake());
    (steps, torque, drum, -1e3..3e3, -50.0..50.0, brakes).prop_map(
        |(steps, uw, rd, fd, rr, brakes)| Act {
            steps,
            torque: [uw, rd, fd, rr],
            brakes: brakes.into(),
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn random_sweeps_have_the_bits_of_winders_alone(
        machines in prop::collection::vec(machine(), 1..36),
        acts in prop::collection::vec(act(), 1..8),
    ) {
        compare(&machines, &acts);
    }

    /// Any bits at all, those of infinities and of what is not a number among them.
    #[test]
    fn a_lane_computes_as_a_number_does(a in any::<[u32; LANES]>(), b in any::<[u32; LANES]>()) {
        let (a, b) = (a.map(f32::from_bits), b.map(f32::from_bits));
        lanes_compute_as_numbers(&a, &b);
    }
}

fn lanes_compute_as_numbers(a: &[f32; LANES], b: &[f32; LANES]) {
    type Op<T> = fn(T, T) -> T;
    fn operations<A: Arithmetic<Gain = A, Rate = A>>() -> [Op<A>; 10] {
        [
            |a, b| a + b,
            |a, b| a - b,
            |a, b| a * b,
            |a, b| a.over(b),
            |a, _| -a,
            |a, _| a.positive(),
            |a, b| A::stretch(a).strained(b),
            |a, b| a.elastic(b).rate(a),
            |a, b| A::gain_over(a, b),
            |a, b| a * b + A::ONE,
        ]
    }
    let (many_a, many_b) = (Lanes::each(|i| a[i]), Lanes::each(|i| b[i]));
    let all = operations::<Lanes>().into_iter().zip(operations::<f32>());
    for (operation, (many, one)) in all.enumerate() {
        let many = many(many_a, many_b);
        for i in 0..LANES {
            let (many, one) = (many.lane(i), one(a[i], b[i]));
            // what is not a number may have any bits; a lane never hides it
            let none = one.is_nan() || a[i].is_nan() || b[i].is_nan();
            assert!(
                many.to_bits() == one.to_bits() || many.is_nan() && none,
                "operation {operation} of {:?} and {:?}: {many:?} is not {one:?}",
                a[i],
                b[i]
            );
        }
    }
}

#[test]
fn a_lane_computes_as_a_number_does_at_the_ends() {
    let ends = [
        0.0,
        -0.0,
        1.0,
        -1.0,
        f32::MIN_POSITIVE,
        -f32::MIN_POSITIVE,
        1e-45,
        -1e-45,
        f32::MAX,
        f32::MIN,
        f32::INFINITY,
        f32::NEG_INFINITY,
        f32::NAN,
        -f32::NAN,
        1.5,
        3.0,
    ];
    for shift in 0..LANES {
        let mut others = ends;
        others.rotate_left(shift);
        lanes_compute_as_numbers(&ends, &others);
    }
}

/// A winder that is asked for anything but torques goes by itself: with a lifted rider roll its windup may slip.
#[test]
fn what_moves_a_winder_beside_its_motors_keeps_it_from_gliding() {
    let winder = Winder::<f32, SPANS>::new(&Machine::news_8000(), H).unwrap();
    let torque = BySection::all(10.0);
    let driven = Actuators {
        torque,
        ..Actuators::default()
    };
    assert!(winder.glides(&driven));
    let mut asked = [driven; 5];
    asked[0].rider.lifted = true;
    asked[1].rider.load_trim = 0.5;
    asked[2].handling.new_core = true;
    asked[3].faults.machine.eccentricity = 1e-3;
    asked[4].brakes.uw = true;
    for actuators in asked {
        assert!(!winder.glides(&actuators), "{actuators:?}");
        let mut winder = winder.clone();
        winder.step(&actuators);
        let acts_on = actuators.rider != Default::default();
        assert_eq!(winder.winds(), acts_on, "{actuators:?}");
    }
}

/// The rows of a sweep, in the order of its combinations, end as single runs of the same machines do.
#[test]
fn a_row_of_a_sweep_is_the_end_of_a_single_run() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let torques = "t_s,T_uw,T_rd,T_fd,T_rr,brake_uw\n0,-1260,500,500,0,0\n4,0,0,0,0,1\n6,0,0,0,0,1";
    fs::write(path("torques.csv"), torques).unwrap();
    fs::write(path("mine.toml"), "preset = 'NEWS-8000'\nlast_span_m = 3\n").unwrap();
    let sweep = "machine = 'mine.toml'\n[vary]\nnips.slip = [true, false]\n\
                 [vary.web]\nstiffness_n_m = {from = 2e5, to = 3e5, steps = 3}\n";
    fs::write(path("sweep.toml"), sweep).unwrap();
    let run = |machine: Option<String>, sweep: Option<&str>, scalar| {
        let options = Options {
            schedule: path("torques.csv"),
            out: path("out.csv"),
            machine,
            scalar,
            stepper: Stepper::Rk4,
            every_s: 6.0,
            sweep: sweep.map(path),
        };
        let mut said = Vec::new();
        plant::run(&options, &mut said).unwrap();
        let said = String::from_utf8(said).unwrap();
        let out = fs::read_to_string(path("out.csv")).unwrap();
        let lines = out
            .lines()
            .map(|line| line.split(',').map(str::to_owned).collect());
        (said, lines.collect::<Vec<Vec<_>>>())
    };
    for scalar in [None, Some(Scalar::F64), Some(Scalar::Fixed)] {
        let (said, rows) = run(None, Some("sweep.toml"), scalar);
        assert!(said.contains("out.csv: 6 runs of 6 s in "), "{said}");
        let header = "nips.slip,web.stiffness_n_m,largest_t,largest_t_s,smallest_t,\
                      v_uw,v_gr,v_sr,v_rd,t_uw,t_gr,t_sr,r_uw,r_wu,web_break_s,slip_s,burst_s";
        assert_eq!(rows[0].join(","), header);
        assert_eq!(rows.len(), 7);
        let slips = ["true", "false"].iter();
        let pairs = slips.flat_map(|slip| ["200000.0", "250000.0", "300000.0"].map(|k| (*slip, k)));
        for (row, (slip, stiffness)) in rows[1..].iter().zip(pairs) {
            assert_eq!((row[0].as_str(), row[1].as_str()), (slip, stiffness));
            let machine = format!(
                "preset = 'NEWS-8000'\nlast_span_m = 3\nnips.slip = {slip}\nweb.stiffness_n_m = {stiffness}\n"
            );
            fs::write(path("one.toml"), machine).unwrap();
            let one = path("one.toml").to_str().unwrap().to_owned();
            let (_, single) = run(Some(one), None, Some(scalar.unwrap_or(Scalar::F32)));
            assert_eq!(row[5..14], single.last().unwrap()[1..]);
            assert_eq!(row[14..], ["", "", ""]);
        }
    }
}

#[test]
fn a_sweep_that_is_refused_leaves_no_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    fs::write(
        path("torques.csv"),
        "t_s,T_uw,T_rd,T_fd,T_rr\n0,0,0,0,0\n1,0,0,0,0",
    )
    .unwrap();
    fs::write(path("sweep.toml"), "[vary]\nweb.width_m = [6, 16]\n").unwrap();
    let options = Options {
        schedule: path("torques.csv"),
        out: path("out.csv"),
        machine: None,
        scalar: None,
        stepper: Stepper::Rk4,
        every_s: 1.0,
        sweep: Some(path("sweep.toml")),
    };
    let error = format!("{:#}", plant::run(&options, &mut Vec::new()).unwrap_err());
    assert!(
        error.ends_with("sweep.toml:2: web.width_m = 16 is outside 0.05 to 15"),
        "{error}"
    );
    assert!(!path("out.csv").exists());
}
