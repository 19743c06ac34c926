//! The acceptance run: the reference program passes, every seeded error is found, and whatever a PLC does, it ends.
#![allow(clippy::unwrap_used)]

use host_tests::accept::controller::{REFERENCE, StPlc};
use host_tests::accept::world::Lockstep;
use host_tests::accept::{Outcome, accept};
use model_core::machine::Machine;

fn run(text: &str) -> Outcome {
    let plc = StPlc::new(text).unwrap();
    accept(&mut Lockstep::new(&Machine::news_8000(), plc).unwrap())
}

#[test]
fn the_reference_program_raises_no_finding() {
    let outcome = run(REFERENCE);
    for e in &outcome.course.episodes {
        let t = |i: usize| outcome.course.samples.get(i).map_or(0.0, |s| s.t_s());
        println!(
            "{:<36} {:>7.1} {:>7.1} {:?}",
            e.name,
            t(e.from),
            t(e.to),
            e.stuck
        );
    }
    for (check, verdict) in &outcome.verdicts {
        println!("{} {:?}", check.id, verdict);
    }
    assert!(outcome.passed());
}
