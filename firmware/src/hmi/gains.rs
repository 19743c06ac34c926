//! The regulators' gains as the drive has them: of the machine's description, and of what auto-tune has found since.
//!
//! Not here: the regulators. Both take gains by the same rules from the same numbers, so that nothing has to travel in
//! every cycle for somebody who looks once a day.

use model_core::drive::DRIVE_PERIOD_MS;
use model_core::drive::tuning::Tuning;
use model_core::exchange::{Setting, TuneStep};
use model_core::image::{self, Feedback, Image};
use model_core::machine::Machine;

/// What is known of them.
#[derive(Clone, Debug)]
pub struct Known {
    tuning: Tuning<f32>,
    /// Radius of the rear drum, m.
    r_rd: f32,
    /// Loops that auto-tune has set.
    tuned: [bool; 3],
    step: u16,
}

/// Numbers of the loops, as the command has them.
const DRUM_SPEED: usize = 0;
const UNWIND_SPEED: usize = 1;

/// A diameter of the image, m.
fn diameter(feedback: &Feedback, signal: &'static image::Signal) -> f32 {
    feedback.get::<f32>(signal) / 1e3
}

impl Known {
    /// As the machine's description has them.
    pub fn new(machine: &Machine) -> Self {
        Self {
            tuning: Tuning::new(machine, 1e-3 * f64::from(DRIVE_PERIOD_MS)),
            r_rd: machine.rear_drum.radius_m as f32,
            tuned: [false; 3],
            step: 0,
        }
    }

    /// Looks at the image after a drive cycle: once auto-tune is done, what it has found is in use.
    pub fn look(&mut self, image: &Image) {
        let f = &image.feedback;
        let step = f.word(&image::AUTOTUNE_STEP);
        let before = core::mem::replace(&mut self.step, step);
        if step != TuneStep::Done as u16 || before == step {
            return;
        }
        let of = usize::from(image.commands.word(&image::AUTOTUNE_LOOP));
        let (inertia, friction) = (
            f.get::<f32>(&image::AUTOTUNE_INERTIA),
            f.get::<f32>(&image::AUTOTUNE_FRICTION),
        );
        let Tuning { drums, unwind } = &mut self.tuning;
        match of {
            DRUM_SPEED => {
                let square = self.r_rd * self.r_rd;
                let d_wu = diameter(f, &image::D_WU);
                drums.learn(inertia / square, friction / square, d_wu);
            }
            UNWIND_SPEED => {
                let r = diameter(f, &image::D_UW) / 2.0;
                unwind.learn(inertia, friction / (r * r), r);
            }
            // The damping is nothing that is told, and no gain of these.
            _ => unwind.learn_web(f.get(&image::AUTOTUNE_STIFFNESS), 0.0),
        }
        if let Some(tuned) = self.tuned.get_mut(of) {
            *tuned = true;
        }
    }

    /// Of all loops in the order of their numbers, at the present diameters; and whether auto-tune has set them.
    pub fn settings(&self, f: &Feedback) -> [(Setting<f32>, bool); 3] {
        let Tuning { drums, unwind } = &self.tuning;
        let period = 1e-3 * DRIVE_PERIOD_MS as f32;
        let (r_rd, r_uw) = (self.r_rd, diameter(f, &image::D_UW) / 2.0);
        let windup = drums.speed_gains(drums.mass(diameter(f, &image::D_WU)));
        let mass = unwind.inertia(r_uw) / (r_uw * r_uw);
        let mode = unwind.mode(mass);
        let mut all = [
            windup.times(r_rd * r_rd),
            unwind.speed_gains(mass, mode).times(r_uw * r_uw),
            unwind.tension_gains(mode),
        ]
        .map(|gains| (gains.setting(period), false));
        for (one, tuned) in all.iter_mut().zip(self.tuned) {
            one.1 = tuned;
        }
        all
    }
}
