//! One run, many machines, the same bits: this PC in release and development builds, and Cortex-M7, M4F and M3 in QEMU.
//!
//! Not here: that the run is right (the physics' tests) and that tasks on a board keep its order (`qemu.rs`).
//! `cargo winder test` runs it.

use std::process::Command;

use host_tests::setup::{self, Warnings};
use host_tests::twin::{self, CORES, Mark, Twin};

/// A whole set in the microcontrollers' scalars, all phases in the other, and the simulator with regulators and logic.
const RUNS: [[&str; 3]; 6] = [
    ["wind", "f32", "set"],
    ["wind", "fixed", "set"],
    ["wind", "f64", "short"],
    ["operate", "f32", "plc"],
    ["operate", "fixed", "plc"],
    ["operate", "f64", "plc"],
];

/// Fails with the first phase in which two runs part.
#[track_caller]
fn compare(run: [&str; 3], who: &str, there: &[Mark], here: &[Mark]) {
    for (there, here) in there.iter().zip(here) {
        assert_eq!(there, here, "{run:?} on {who}");
    }
    assert_eq!(there.len(), here.len(), "{run:?} on {who}");
}

#[test]
fn every_core_computes_the_same_bits() {
    for core in CORES {
        let twin = Twin::on(core).unwrap();
        for run in RUNS {
            let there = twin.run(&run).unwrap();
            compare(run, core.name, &there, &twin::here(&run).unwrap());
        }
    }
}

/// The boards copy memory by code of their own.
#[test]
fn every_core_copies_bytes_as_this_pc_does() {
    let (times, hash) = model_core::twin::copies();
    for core in CORES {
        let there = Twin::on(core)
            .unwrap()
            .run(&["copy", "bytes", "all"])
            .unwrap();
        assert_eq!(there.len(), 1);
        assert_eq!(
            (there[0].steps, there[0].hash),
            (times, hash),
            "{}",
            core.name
        );
    }
}

#[test]
fn a_development_build_computes_the_same_bits() {
    let program = setup::development_twin().unwrap();
    for run in RUNS {
        let output = Command::new(&program).args(run).output().unwrap();
        let there = twin::marks(&String::from_utf8_lossy(&output.stdout)).unwrap();
        compare(run, "this PC", &there, &twin::here(&run).unwrap());
    }
}

/// Counts of instructions are exact, so they are the same twice.
#[test]
fn instructions_are_counted_exactly() {
    let counter = setup::counter(Warnings::Shown).unwrap();
    let twin = Twin::on(CORES[0]).unwrap();
    let count = || twin.count(&counter, "f32", "NEWS-8000").unwrap();
    let once = count();
    assert_eq!(once, count());
    for part in [
        "motion", "smooth", "braked", "gripping", "sliding", "tick", "drive", "logic",
    ] {
        let section = once.iter().find(|section| section.name == part);
        let section = section.unwrap_or_else(|| panic!("{part} has not been counted"));
        assert!(section.times >= 100, "{section:?}");
    }
    // nothing is decided on: every step takes the same
    let motion = once.iter().find(|section| section.name == "motion");
    assert!(
        motion.is_some_and(|motion| motion.min == motion.max),
        "{motion:?}"
    );
    // one task's call holds the step and the hash of its 13 numbers
    let mean = |part| once.iter().find(|s| s.name == part).map_or(0.0, |s| s.mean);
    assert!(mean("tick") > mean("smooth"), "{once:?}");
}

/// An unknown run is refused with its name.
#[test]
fn an_unknown_run_is_refused() {
    let twin = Twin::on(CORES[0]).unwrap();
    for run in [
        ["wind", "f16", "set"],
        ["wind", "f32", "all"],
        ["count", "f32", "NEWS-9000"],
    ] {
        let error = twin.run(&run).unwrap_err().to_string();
        assert!(error.contains(&run.join(" ")), "{error}");
        assert!(twin::here(&run).is_err());
    }
}
