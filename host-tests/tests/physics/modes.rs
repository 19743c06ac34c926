//! Small-signal modes of the web and the rolls, as eigenvalues of the linearised winder.

use model_core::machine::{MAX_SPANS, Machine, PRESETS};
use model_core::plant::modes::{fastest, substeps};
use model_core::plant::rk4::State;
use nalgebra::{Complex, DMatrix};

use crate::form::{self, Bench, H, RUN};
use crate::{near, reference};

/// A step so small that the step's own error does not show, s.
const TINY: f64 = 1e-6;
/// What such a step leaves of a mode: the drums that are held move on within it.
const MODES_TOLERANCE: f64 = 1e-5;

/// Variables that move in a mode: strains, speeds, ω_uw. Radii stand still.
fn moving(spans: usize) -> usize {
    2 * spans + 1
}

/// V_rd among them.
fn drums(spans: usize) -> usize {
    2 * spans - 1
}

/// The moving variables by number.
fn variable<const SPANS: usize>(x: &mut State<f64, SPANS>, i: usize) -> &mut f64 {
    if i < SPANS {
        &mut x.strain[i]
    } else if i < 2 * SPANS {
        &mut x.v[i - SPANS]
    } else {
        &mut x.omega_uw
    }
}

/// ∂ẋ/∂x of the winder about the steady run at `v`, by central differences of one tiny step.
fn linearised<const SPANS: usize>(m: Machine, v: f64) -> DMatrix<f64> {
    let t = form::tension(&m);
    let core = m.shipping_roll.core_radius_m;
    let x = form::steady::<SPANS>(&m, v, t, m.parent_roll.full_radius_m, core);
    let torque = form::torques(&m, &x, t, 0.0);
    let mut bench = Bench::<f64, SPANS>::with_step(m, TINY);
    bench.winder.thread_at(0.0);
    let count = moving(SPANS);
    let mut moved = |i: usize, by: f64| -> Vec<f64> {
        let mut x = x;
        *variable(&mut x, i) += by;
        bench.set(&x);
        bench.step(&torque);
        let mut y = bench.x();
        let change = |j| *variable(&mut y, j) - *variable(&mut x, j);
        (0..count).map(change).collect()
    };
    let mut jacobian = DMatrix::zeros(count, count);
    for i in 0..count {
        // 1 % of a tension of 2 800 N, 0.01 m/s, 0.01 rad/s
        let by = if i < SPANS { 1e-5 } else { 1e-2 };
        let (up, down) = (moved(i, by), moved(i, -by));
        for j in 0..count {
            jacobian[(j, i)] = (up[j] - down[j]) / (2.0 * by * TINY);
        }
    }
    jacobian
}

/// Natural frequency, rad/s, and damping ratio of every oscillation, the slowest first.
fn modes(matrix: DMatrix<f64>) -> Vec<(f64, f64)> {
    let mut modes: Vec<_> = matrix
        .complex_eigenvalues()
        .iter()
        // over a step of h a mode goes from 1 to exp(λ·h)
        .map(|s: &Complex<f64>| (s * TINY + 1.0).ln() / TINY)
        .filter(|s| s.im > 1e-3)
        .map(|s| (s.norm(), -s.re / s.norm()))
        .collect();
    modes.sort_by(|a, b| a.0.total_cmp(&b.0));
    modes
}

fn held<const SPANS: usize>(m: Machine, v: f64) -> Vec<(f64, f64)> {
    let drums = drums(SPANS);
    modes(
        linearised::<SPANS>(m, v)
            .remove_row(drums)
            .remove_column(drums),
    )
}

fn free<const SPANS: usize>(m: Machine, v: f64) -> Vec<(f64, f64)> {
    modes(linearised::<SPANS>(m, v))
}

/// A row of the table of modes: machine, m/s, drums held or free, ω in rad/s, damping ratio.
type Mode = (String, f64, String, f64, f64);

/// Every mode of every preset at crawl and at run speed: the winder's equations written a second time, differentiated
/// by a complex step, and their eigenvalues by LAPACK.
#[test]
fn all_modes_are_those_of_the_reference() {
    let path = reference::folder().join("modes.csv");
    let mut reader = csv::Reader::from_path(path).unwrap();
    let table: Vec<Mode> = reader.deserialize().map(Result::unwrap).collect();
    for (name, preset) in PRESETS {
        for v in [0.5, preset().operation.run_speed_m_s] {
            let spans = preset().idle.len() + 1;
            let modes = match spans {
                3 => [held::<3>(preset(), v), free::<3>(preset(), v)],
                MAX_SPANS => [
                    held::<MAX_SPANS>(preset(), v),
                    free::<MAX_SPANS>(preset(), v),
                ],
                spans => panic!("{spans} spans"),
            };
            for (drums, modes) in ["held", "free"].into_iter().zip(modes) {
                let expected = table.iter().filter(|(machine, speed, held, ..)| {
                    machine == name && (speed - v).abs() < 1e-6 && held == drums
                });
                let expected: Vec<_> = expected
                    .map(|(.., omega, damping)| (omega, damping))
                    .collect();
                assert_eq!(
                    (modes.len(), expected.len()),
                    (spans, spans),
                    "{name} {drums}"
                );
                for ((omega, damping), (expected, ratio)) in modes.into_iter().zip(expected) {
                    near(name, omega, *expected, MODES_TOLERANCE * expected);
                    near(name, damping, *ratio, MODES_TOLERANCE);
                }
            }
        }
    }
}

#[test]
fn modes_lie_where_the_closed_form_has_them() {
    let tables = [
        (
            "drums held",
            held::<3>(Machine::news_8000(), 0.5),
            [2.99, 23.6, 56.5],
        ),
        (
            "drums free",
            free::<3>(Machine::news_8000(), 0.5),
            [4.57, 24.0, 56.7],
        ),
    ];
    for (what, modes, expected) in tables {
        assert_eq!(modes.len(), 3, "{what}: {modes:?}");
        for ((omega, _), expected) in modes.iter().zip(expected) {
            near(what, *omega, expected, 0.005 * expected);
        }
    }
}

/// The web's transport damps the lowest mode at speed, and hardly at crawl.
#[test]
fn the_lowest_mode_is_damped_by_half_at_full_speed_and_hardly_at_thread_speed() {
    for (v, damping, tolerance) in [
        (RUN, 0.537, 0.005),
        (0.5, 0.0150, 2e-4),
        (25.0 / 60.0, 0.0138, 2e-4),
    ] {
        let (_, ratio) = held::<3>(Machine::news_8000(), v)[0];
        near("damping ratio", ratio, damping, tolerance);
    }
}

/// ω of the fastest mode of the elastic web: the largest eigenvalue of M⁻¹·K as a symmetric matrix.
fn fastest_elastic(m: &Machine) -> f64 {
    let roll = &m.parent_roll;
    let parent = |r: f64| form::parent_inertia(m, r) / (r * r);
    let lightest = parent(roll.expire_radius_m).min(parent(roll.full_radius_m));
    let idle = (0..m.idle.len()).map(|i| form::idle_mass(m, i));
    let drums = form::windup_mass(m, m.shipping_roll.core_radius_m);
    let masses: Vec<f64> = [lightest].into_iter().chain(idle).chain([drums]).collect();
    let lengths = m.idle.iter().map(|roll| roll.span_m);
    let mut k = DMatrix::<f64>::zeros(masses.len(), masses.len());
    for (i, length) in lengths.chain([m.last_span_m]).enumerate() {
        let spring = form::stiffness(m) / length;
        for (row, column, sign) in [
            (i, i, 1.0),
            (i + 1, i + 1, 1.0),
            (i, i + 1, -1.0),
            (i + 1, i, -1.0),
        ] {
            k[(row, column)] += sign * spring / (masses[row] * masses[column]).sqrt();
        }
    }
    k.symmetric_eigenvalues().max().sqrt()
}

#[test]
fn the_fastest_mode_of_every_preset_is_that_of_its_matrix() {
    for (name, preset) in PRESETS {
        let m = preset();
        let expected = fastest_elastic(&m);
        near(name, fastest(&m), expected, 1e-5 * expected);
    }
    let unlumped = fastest(&Machine::news_8000_unlumped());
    near("unlumped", unlumped, 179.0, 1.0);
}

/// One step up to h·|λ| = 0.5; beyond, as many as make it at most 0.2, and no more.
#[test]
fn a_machine_takes_smaller_steps_from_a_half_on_and_then_of_a_fifth() {
    let steps = PRESETS
        .iter()
        .map(|(name, preset)| (*name, substeps(&preset(), H)));
    let expected = [
        ("NEWS-8000", 1),
        ("NEWS-8000-UNLUMPED", 4),
        ("LWC-8000", 1),
        ("LAB-300", 4),
    ];
    assert!(steps.eq(expected));
    for (name, preset) in PRESETS {
        let m = preset();
        let h = |size: f64| size / fastest(&m);
        for (size, steps) in [
            (0.01, 1),
            (0.499, 1),
            (0.501, 3),
            (0.599, 3),
            (0.601, 4),
            (2.001, 11),
        ] {
            assert_eq!(substeps(&m, h(size)), steps, "{name}: {size}");
        }
    }
}

/// A web that only creeps: |λ| is the root of λ² + τ·ω²·λ + ω², and tends to τ·ω².
#[test]
fn a_creeping_mode_is_as_fast_as_its_damping_makes_it() {
    let mut m = Machine::news_8000();
    m.idle[1].inertia_kg_m2 = 0.01;
    let omega = fastest_elastic(&m);
    let damped = m.web.retardation_s * omega * omega;
    let root = fastest(&m);
    near(
        "λ² + τ·ω²·λ + ω²",
        root * root - damped * root,
        -omega * omega,
        1e-3 * omega * omega,
    );
    assert!(root > 0.9 * damped, "{root} of {damped}");
}

/// Rolls as light as that would tear the web apart by the integration alone; in smaller steps they are followed as
/// a fifty times finer integration does.
#[test]
fn a_machine_that_is_too_fast_for_its_step_takes_smaller_ones() {
    let mut m = Machine::news_8000();
    for roll in &mut m.idle {
        roll.inertia_kg_m2 *= 0.01;
    }
    let steps = substeps(&m, H);
    assert!(steps > 1 && fastest(&m) * H / f64::from(steps) <= 0.2);
    let x = form::steady(&m, 10.0, 2800.0, 1.5, 0.05);
    let torque = form::torques(&m, &x, 2800.0, 0.3);
    let run = |h: f64| {
        let mut bench = Bench::<f64>::with_step(m.clone(), h);
        bench.winder.thread_at(0.0);
        bench.set(&x);
        for _ in 0..(2.0 / h).round() as u32 {
            bench.step(&torque);
        }
        (bench.x(), bench.t(), bench.winder.substeps())
    };
    let (coarse, t, taken) = run(H);
    let (fine, t_fine, _) = run(H / 50.0);
    assert_eq!(taken, steps);
    near("V", coarse.v[2], fine.v[2], 1e-6);
    for (t, fine) in t.into_iter().zip(t_fine) {
        near("t", t, fine, 0.05);
    }
}
