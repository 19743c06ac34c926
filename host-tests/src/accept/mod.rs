//! Acceptance run: does a winder PLC do what a winder needs?
//!
//! Not here: the winder. A run plays the operator and what breaks ([`course`]) on a simulator with a PLC ([`world`]),
//! keeps all that was seen ([`run`]), judges it by a table of checks ([`checks`]) and writes what came of it
//! ([`report`]). [`seeds`] are errors that a program may have, to see that they are found; [`wired`] runs a program as a PLC of its own, and
//! [`attend`] waits for runs that are asked for on the page.

pub mod attend;
pub mod checks;
pub mod controller;
pub mod course;
pub mod matrix;
pub mod report;
pub mod run;
pub mod seeds;
pub mod wired;
pub mod world;

use checks::{CHECKS, Check, Verdict};
use run::{Course, run};
use world::World;

/// What came of a run.
pub struct Outcome {
    /// All that was seen.
    pub course: Course,
    /// What each check says.
    pub verdicts: Vec<(&'static Check, Verdict)>,
}

impl Outcome {
    /// Checks that are not passed, with what was seen.
    pub fn findings(&self) -> impl Iterator<Item = (&'static Check, &str, Option<f64>)> {
        self.verdicts
            .iter()
            .filter_map(|(check, verdict)| match verdict {
                Err(checks::Miss::Failed(what, at)) => Some((*check, what.as_str(), *at)),
                _ => None,
            })
    }

    /// Checks that could not be looked at, with why.
    pub fn not_seen(&self) -> impl Iterator<Item = (&'static Check, &str)> {
        self.verdicts
            .iter()
            .filter_map(|(check, verdict)| match verdict {
                Err(checks::Miss::NotSeen(why)) => Some((*check, why.as_str())),
                _ => None,
            })
    }

    /// Every check has been looked at, and none has found anything.
    pub fn passed(&self) -> bool {
        self.verdicts.iter().all(|(_, verdict)| verdict.is_ok())
    }
}

/// Runs the course and judges it. It always ends; what goes wrong on the way is in the outcome.
pub fn accept(world: &mut dyn World) -> Outcome {
    let course = run(world);
    let verdicts = CHECKS
        .iter()
        .map(|check| (check, (check.judge)(&course)))
        .collect();
    Outcome { course, verdicts }
}
