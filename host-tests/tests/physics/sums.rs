//! Why slow states are summed up with compensation.

use model_core::machine::Machine;
use model_core::real::{Compensated, Plain, Sum};

use crate::form::{self, H, RUN};

fn steps(length: f64, v: f64, h: f64) -> u32 {
    (length / (v * h)).round() as u32
}

/// Parent roll's radius in f32 after `length` at `v`, summed up in `S` as the winder does.
fn radius<S: Sum<f32>>(length: f64, v: f64, h: f64) -> f64 {
    let m = Machine::news_8000();
    let layer = (m.web.caliper_m / std::f64::consts::TAU) as f32;
    let mut r = S::at(m.parent_roll.full_radius_m as f32);
    for _ in 0..steps(length, v, h) {
        // {5}, halfway through the step
        let rate = |r: f32| -layer * v as f32 / r;
        let half = r.value() + 0.5 * h as f32 * rate(r.value());
        r.add(h as f32 * rate(half));
    }
    f64::from(r.value())
}

/// What the fall of the radius over `length` is off by, relative.
fn error<S: Sum<f32>>(length: f64, v: f64, h: f64) -> f64 {
    let m = Machine::news_8000();
    let full = m.parent_roll.full_radius_m;
    let whole_steps = f64::from(steps(length, v, h)) * v * h;
    let fall = full - form::parent_radius(&m, whole_steps);
    (full - radius::<S>(length, v, h)) / fall - 1.0
}

#[test]
fn plain_f32_sums_lose_the_radius_and_compensated_ones_do_not() {
    for (h, lost) in [(H, 0.005), (H / 4.0, 0.05)] {
        let plain = error::<Plain<f32>>(20e3, RUN, h);
        let compensated = error::<Compensated<f32>>(20e3, RUN, h);
        assert!(plain.abs() > lost, "h = {h}: plain is off by {plain}");
        // half an ulp of f32 at 1.5 m in a fall of 0.15 m is 4e-7
        assert!(
            compensated.abs() < 1e-6,
            "h = {h}: compensated is off by {compensated}"
        );
    }
}

/// At 25 m/min a step is below half an ulp of the radius: a plain sum does not move at all.
#[test]
fn plain_f32_sums_stand_still_at_thread_speed() {
    let v = 25.0 / 60.0;
    assert_eq!(radius::<Plain<f32>>(100.0, v, H), 1.5);
    assert!(error::<Compensated<f32>>(100.0, v, H).abs() < 1e-4);
}
