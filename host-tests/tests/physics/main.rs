//! The plant against closed forms, against an integrator that is not our own, and against itself in the other
//! scalar.
//!
//! Not here: the regulators (`regulators.rs`) and equal runs on other machines (`determinism.rs`).
//!
//! Every closed form is written out again, in `f64` and in terms of the machine's description alone, in
//! [`form`]. A test that is generic over the scalar runs in `f32` and in `f64`.

// exact zeros, held states and round trips are meant exactly
#![allow(clippy::float_cmp)]
// a test that cannot go on fails
#![allow(clippy::unwrap_used)]

mod balances;
mod brakes;
mod breaks;
mod description;
mod form;
mod integration;
mod modes;
mod nips;
mod radii;
mod reference;
mod schedule;
mod sensing;
mod sums;
mod web;

/// Runs generic tests in both scalars.
macro_rules! in_both_scalars {
    ($($test:ident),* $(,)?) => {
        mod in_f32 { $(#[test] fn $test() { super::$test::<f32>(); })* }
        mod in_f64 { $(#[test] fn $test() { super::$test::<f64>(); })* }
    };
}
pub(crate) use in_both_scalars;

/// Fails unless `value` is `expected` ± `tolerance`.
#[track_caller]
pub fn near(what: &str, value: f64, expected: f64, tolerance: f64) {
    assert!(
        (value - expected).abs() <= tolerance,
        "{what}: {value} is not {expected} ± {tolerance}"
    );
}
