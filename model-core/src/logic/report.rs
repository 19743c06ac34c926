//! What the logic tells the PLC after each drive cycle.
//!
//! Not here: the tasks' times; whoever runs the tasks knows them.

use super::{Fault, Logic, Mode, Refusal, Sight, ask, status};
use crate::exchange::Autotune;
use crate::image::{self, Feedback};
use crate::profidrive::zsw1;
use crate::real::Real;

impl<R: Real> Logic<R> {
    /// Fills the feedback after a cycle.
    pub(super) fn report(&mut self, sight: &Sight<R>, f: &mut Feedback) {
        let (c, m, d) = (&self.c, sight.m, sight.drive);
        self.heartbeat = self.heartbeat.wrapping_add(1);
        f.set_word(&image::HEARTBEAT, self.heartbeat);
        f.set_word(&image::MODE, self.mode as u16);
        f.set_word(&image::REFUSAL, self.refusal as u16);
        f.set_word(&image::FAULT, self.faults.first() as u16);
        f.set_word(&image::WARNINGS, self.faults.warnings());

        let set = sight.commands.get::<R>(&image::V_SET) * R::of(1.0 / 60.0);
        let at_speed = self.mode == Mode::Run && d.v.is_near(set, c.speed_tolerance);
        f.set_word(&image::WINDER_STATUS, self.status(sight, at_speed));
        let mut speed = 0;
        if d.v.is_near(d.v_ref, c.speed_tolerance) {
            speed |= zsw1::SPEED_WITHIN_TOLERANCE;
        }
        if at_speed {
            speed |= zsw1::SETPOINT_REACHED;
        }
        let faulty = self.faults.latched().sections();
        let warned = self.faults.warned();
        let told = self.sections.zip(faulty.zip(warned));
        let zsw = told.map(|(s, (fault, warning))| s.status(fault, warning, speed));
        f.set_word(&image::ZSW1_UW, zsw.uw);
        f.set_word(&image::ZSW1_RD, zsw.rd);
        f.set_word(&image::ZSW1_FD, zsw.fd);
        f.set_word(&image::ZSW1_RR, zsw.rr);

        let per_minute = R::of(60.0);
        f.set(&image::V_WEB, d.v * per_minute);
        f.set(&image::V_REF, d.v_ref * per_minute);
        f.set(&image::A_REF, d.a_ref);
        f.set(&image::TENSION, m.tension / c.width);
        f.set(&image::TENSION_REF, d.tension_ref / c.width);
        let rpm = m
            .omega
            .map(|omega| omega * R::of(30.0 / core::f64::consts::PI));
        f.set(&image::N_UW, rpm.uw);
        f.set(&image::N_RD, rpm.rd);
        f.set(&image::N_FD, rpm.fd);
        f.set(&image::N_RR, rpm.rr);
        let load = self
            .motors
            .load(&d.torque)
            .map(|share| share * R::of(100.0));
        f.set(&image::TORQUE_UW, load.uw);
        f.set(&image::TORQUE_RD, load.rd);
        f.set(&image::TORQUE_FD, load.fd);
        f.set(&image::TORQUE_RR, load.rr);
        let power = d.torque.zip(m.omega);
        let power = power.map(|(torque, omega)| torque * omega * R::of(1e-3));
        f.set(&image::POWER_UW, power.uw);
        f.set(&image::POWER_RD, power.rd);
        f.set(&image::POWER_FD, power.fd);
        f.set(&image::POWER_RR, power.rr);
        f.set(&image::D_UW, d.r_uw * R::of(2e3));
        f.set(&image::D_WU, m.d_wu * R::of(1e3));
        f.set(&image::RIDER_LOAD, self.rider_load(m.d_wu));
        let pulses = m.pulses_rd.wrapping_sub(self.pulses_at_core);
        f.set(&image::LENGTH_WU, f64::from(pulses) * c.metres_per_pulse);
        let ahead = u32::from(sight.commands.word(&image::PULSES_AHEAD)) << 16;
        f.set_double(&image::PULSES_RD, m.pulses_rd.wrapping_add(ahead));

        if d.autotune != self.told {
            self.told = d.autotune;
            tell_autotune(&d.autotune, f);
        }
    }

    /// Load of the rider roll per width as it is set, N/m.
    fn rider_load(&self, d_wu: R) -> R {
        if self.rider.lifted {
            return R::ZERO;
        }
        (R::ONE + self.rider.load_trim) * self.c.rider_load.at(d_wu)
    }

    fn status(&self, sight: &Sight<R>, at_speed: bool) -> u16 {
        let (closed, latched) = (sight.m.brakes, self.faults.latched());
        let closed_loop = self.holds_tension() && !ask::tension_open(sight.commands);
        [
            (self.all_in_operation(), status::DRIVES_ON),
            (self.tension.is_on(), status::TENSION_DETECTED),
            (self.web_threaded, status::WEB_THREADED),
            (latched.has(Fault::WebBreak), status::WEB_BREAK),
            (at_speed, status::AT_SPEED),
            (sight.standstill, status::ZERO_SPEED),
            (closed.uw, status::BRAKE_UW),
            (closed.rd, status::BRAKE_RD),
            (closed.fd, status::BRAKE_FD),
            (self.preset_taken, status::PRESET_TAKEN),
            (!latched.is_empty(), status::FAULT),
            (self.refusal != Refusal::None, status::REFUSED),
            (!sight.m.rider_lifted, status::RIDER_DOWN),
            (closed_loop, status::TENSION_CONTROL),
        ]
        .into_iter()
        .filter_map(|(on, bit)| on.then_some(bit))
        .sum()
    }
}

/// What auto-tune tells.
fn tell_autotune<R: Real>(tune: &Autotune<R>, f: &mut Feedback) {
    f.set_word(&image::AUTOTUNE_STEP, tune.step.number().into());
    f.set(&image::AUTOTUNE_PROGRESS, tune.progress);
    f.set_word(&image::AUTOTUNE_ABORT, tune.abort.number().into());
    f.set(&image::AUTOTUNE_INERTIA, tune.inertia);
    f.set(&image::AUTOTUNE_FRICTION, tune.friction);
    f.set(&image::AUTOTUNE_STIFFNESS, tune.stiffness);
    f.set(&image::AUTOTUNE_GAIN_OLD, tune.old.gain);
    f.set(&image::AUTOTUNE_GAIN_NEW, tune.new.gain);
    f.set(&image::AUTOTUNE_TIME_OLD, tune.old.time);
    f.set(&image::AUTOTUNE_TIME_NEW, tune.new.time);
}
